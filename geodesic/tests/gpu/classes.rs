//! Rays by what is hard about them.

use kerrlight_geodesic::{Camera, Inclination, Kerr, Motion, Observer, RadialPotential, View};

/// A view with points of its picture.
pub struct Picture {
    pub hole: Kerr,
    pub view: View,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

/// Rays with the same difficulty, and the errors that half of them and 99 in 100 keep: of radii (relative),
/// azimuths, delays (relative), directions of escape and samples.
pub struct Class {
    pub name: &'static str,
    pub pictures: Vec<Picture>,
    pub allowed: [f64; 2],
    /// The share that may be flagged.
    pub flagged: f64,
}

/// Numbers in [0, 1), the same in every run.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    pub fn unit(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn within(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }
}

const SPINS: [f64; 6] = [0.0, 0.5, -0.7, 0.94, 0.998, 1.0];

fn hole(spin: f64) -> Kerr {
    Kerr::new(spin).unwrap()
}

fn screen(degrees: f64) -> View {
    View::Screen(Observer::at_infinity(Inclination::from_degrees(degrees).unwrap()))
}

/// Points of a screen, `draw` gives (α, β).
fn picture(spin: f64, view: View, count: usize, mut draw: impl FnMut() -> (f64, f64)) -> Picture {
    let (x, y) = (0..count).map(|_| draw()).unzip();
    Picture { hole: hole(spin), view, x, y }
}

/// Pictures of all these spins and inclinations.
fn pictures(
    spins: &[f64],
    degrees: &[f64],
    count: usize,
    mut draw: impl FnMut() -> (f64, f64),
) -> Vec<Picture> {
    let all = spins.iter().flat_map(|spin| degrees.iter().map(move |degrees| (*spin, *degrees)));
    all.map(|(spin, degrees)| picture(spin, screen(degrees), count, &mut draw)).collect()
}

pub fn classes() -> Vec<Class> {
    vec![generic(), polar(), near(), far(), near_critical(), horizon(), cameras()]
}

fn generic() -> Class {
    let mut random = Random::new(1);
    let draw = || (random.within(-15.0, 15.0), random.within(-15.0, 15.0));
    let pictures = pictures(&SPINS, &[5.0, 17.0, 60.0, 85.0, 90.0], 200, draw);
    Class { name: "generic", pictures, allowed: [5e-7, 1e-5], flagged: 0.0 }
}

/// Observers on the axis or next to it, and rays that pass it.
fn polar() -> Class {
    let mut random = Random::new(2);
    let mut pictures = Vec::new();
    for spin in SPINS {
        for degrees in [0.0, 1e-4, 0.1, 180.0] {
            let draw = || (random.within(-12.0, 12.0), random.within(-12.0, 12.0));
            pictures.push(picture(spin, screen(degrees), 100, draw));
        }
        let draw = || (1e-7 * random.within(-1.0, 1.0), random.within(-12.0, 12.0));
        pictures.push(picture(spin, screen(60.0), 100, draw));
        pictures.push(Picture {
            x: vec![0.0; 5],
            y: vec![-9.0, -4.0, 0.0, 5.5, 8.0],
            ..picture(spin, screen(30.0), 0, || (0.0, 0.0))
        });
    }
    Class { name: "polar", pictures, allowed: [5e-7, 1e-5], flagged: 0.0 }
}

/// Observers at finite distances.
fn near() -> Class {
    let mut random = Random::new(3);
    let mut pictures = Vec::new();
    for spin in [0.0, 0.9, 0.998] {
        for radius in [8.0, 50.0, 1e3, 1e6] {
            let observer =
                Observer::at_radius(Inclination::from_degrees(70.0).unwrap(), radius).unwrap();
            let reach = f64::min(12.0, 0.7 * radius);
            let draw = || (random.within(-reach, reach), random.within(-reach, reach));
            pictures.push(picture(spin, View::Screen(observer), 200, draw));
        }
    }
    Class { name: "finite", pictures, allowed: [5e-7, 1e-5], flagged: 0.0 }
}

/// Rays that pass at a distance.
fn far() -> Class {
    let mut random = Random::new(4);
    let mut draw = || 10f64.powf(random.within(1.0, 5.0)) * random.within(-1.0, 1.0).signum();
    let pictures = pictures(&[0.0, 0.9], &[20.0, 80.0], 200, || (draw(), draw()));
    Class { name: "far", pictures, allowed: [5e-7, 1e-5], flagged: 0.0 }
}

/// The factor by which (α, β) is stretched onto the critical curve.
pub fn critical_factor(hole: &Kerr, view: &View, (x, y): (f64, f64)) -> f64 {
    let captures = |s: f64| {
        let potential: RadialPotential = view.ray(hole, s * x, s * y).unwrap().potential;
        potential.captures()
    };
    let (mut low, mut high) = (0.0, 20.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if captures(middle) { low = middle } else { high = middle }
    }
    high
}

/// Rays at relative distances from 1e-2 to 1e-6 from the critical curve.
fn near_critical() -> Class {
    let mut random = Random::new(5);
    let mut pictures = Vec::new();
    for spin in [0.0, 0.5, -0.7, 0.94, 0.998] {
        for degrees in [17.0, 60.0, 90.0] {
            let (hole, view) = (hole(spin), screen(degrees));
            let draw = || {
                let angle: f64 = random.within(0.0, core::f64::consts::TAU);
                let (y, x) = angle.sin_cos();
                let apart =
                    10f64.powf(random.within(-6.0, -2.0)) * random.within(-1.0, 1.0).signum();
                let s = critical_factor(&hole, &view, (x, y)) * (1.0 + apart);
                (s * x, s * y)
            };
            pictures.push(picture(spin, view, 100, draw));
        }
    }
    Class { name: "near-critical", pictures, allowed: [2e-6, 2e-4], flagged: 0.0 }
}

/// Rays well inside the critical curve, whose last crossings lie next to the horizon.
fn horizon() -> Class {
    let mut random = Random::new(6);
    let draw = || (random.within(-2.0, 3.0), random.within(-2.0, 2.0));
    let pictures = pictures(&[0.0, 0.5, 0.94, 0.998], &[30.0, 80.0], 200, draw);
    Class { name: "horizon", pictures, allowed: [5e-7, 1e-4], flagged: 0.0 }
}

/// Cameras near the hole, inside and outside the photon orbits, moving or not.
fn cameras() -> Class {
    let mut random = Random::new(7);
    let mut pictures = Vec::new();
    for spin in [0.0, 0.9, 0.998] {
        for (radius, motion) in [
            (2.5, Motion::Zamo),
            (6.0, Motion::Static),
            (10.0, Motion::Keplerian),
            (30.0, Motion::FreeFall),
            (300.0, Motion::Static),
        ] {
            let inclination = Inclination::from_degrees(75.0).unwrap();
            let camera = Camera::new(&hole(spin), inclination, radius, motion).unwrap();
            let camera =
                camera.with_pointing(random.within(-3.0, 3.0), random.within(-1.0, 1.0), 0.3);
            let draw = || (random.within(-1.5, 1.5), random.within(-1.5, 1.5));
            pictures.push(picture(spin, View::Camera(camera), 150, draw));
        }
    }
    Class { name: "cameras", pictures, allowed: [5e-7, 1e-5], flagged: 1e-3 }
}
