//! Movies of a sky that no fit of kerrlight has modelled: rays of the affine parameter in Kerr–Schild coordinates, emission
//! and motion in closed form at every point of them, pixels that are means over many rays.

use kerrlight_geodesic::{AffineTracer, Error, Inclination, Kerr, Observer};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Distance of the observer, M: rays are parallel to a part in 10⁴ of the screen.
const DISTANCE: f64 = 1e5;
/// Points on each ray inside the outermost radius.
const POINTS: usize = 240;
/// Radii where nothing else is said, M.
const RADII: [f64; 2] = [1.8, 16.0];

/// A piece of a spiral tube about the spin axis that shines at time 0: a spot, an arc, a filament.
#[derive(Clone, Copy, Debug)]
pub struct Arc {
    /// Distance of its middle from the axis, M.
    pub radius: f64,
    /// Azimuth of its middle, radians from the observer's meridian.
    pub azimuth: f64,
    /// Growth of its distance with azimuth, M a radian.
    pub pitch: f64,
    /// Standard deviation along it, M: for a spot that across it.
    pub length: f64,
    /// Standard deviation across it, M.
    pub sigma: f64,
    /// Emission in its middle.
    pub amplitude: f64,
}

impl Arc {
    /// Emission at (ρ, φ, z) in cylindrical coordinates.
    fn emission(&self, [rho, phi, z]: [f64; 3]) -> f64 {
        let turn = core::f64::consts::TAU;
        let along = (phi - self.azimuth + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
        let across = rho - self.radius - self.pitch * along;
        let squares = (across.powi(2) + z * z) / self.sigma.powi(2)
            + (self.radius * along / self.length).powi(2);
        self.amplitude * (-0.5 * squares).exp()
    }
}

/// Emission of all pieces at (ρ, φ, z).
pub fn shining(arcs: &[Arc]) -> impl Fn([f64; 3]) -> f64 + Sync {
    |place| arcs.iter().map(|arc| arc.emission(place)).sum()
}

/// A hole with matter on circular geodesics about it, and who looks at it.
#[derive(Clone, Copy, Debug)]
pub struct Sky {
    /// Spin, M: below 0 where matter is retrograde.
    pub spin: f64,
    /// Inclination from the spin axis, degrees.
    pub inclination_deg: f64,
    /// Position angle of the spin axis, degrees east of north.
    pub position_angle_deg: f64,
    /// Power of the redshift factor that emission goes with.
    pub power: f64,
    /// Matter shines between these radii, M.
    pub radii: [f64; 2],
    /// And up to this |z|, M.
    pub height: f64,
}

impl Sky {
    /// A hole in the middle of the screen whose matter shines at all radii up to 16 M, with g².
    pub fn new(spin: f64, inclination_deg: f64, position_angle_deg: f64) -> Self {
        let (power, radii, height) = (2.0, RADII, f64::INFINITY);
        Self { spin, inclination_deg, position_angle_deg, power, radii, height }
    }
}

/// A square screen.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Width between its edges, M.
    pub width: f64,
    /// Pixels a side.
    pub pixels: usize,
    /// Rays a side of each pixel.
    pub rays: usize,
}

/// Intersection of a ray with matter.
struct Point {
    /// ρ, φ and z.
    place: [f64; 3],
    /// Angular velocity there, M⁻¹.
    rate: f64,
    /// Time before its arrival at which its light was there, M, less that of the whole way.
    before: f64,
    /// g to the sky's power, times dλ, M.
    weight: f64,
}

impl Sky {
    /// Images at some times (M), rows from north, columns from east: emission at (ρ, φ, z) at time 0, which matter carries,
    /// along the affine parameter, M. φ is that from the observer's meridian. Light takes its time.
    ///
    /// # Errors
    /// If spin or inclination is out of range.
    pub fn movie(
        &self,
        screen: Screen,
        times: &[f64],
        emission: impl Fn([f64; 3]) -> f64 + Sync,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let Screen { width, pixels, rays } = screen;
        let (step, n) = (width / (pixels * rays) as f64, rays * rays);
        let pixel = |k: usize| -> Result<Vec<f64>, Error> {
            let mut seen = vec![0.0; times.len()];
            for ray in 0..n {
                let place = |pixel: usize, ray: usize| {
                    ((pixel * rays + ray) as f64 + 0.5) * step - 0.5 * width
                };
                let [x, y] = [place(k % pixels, ray % rays), -place(k / pixels, ray / rays)];
                for point in self.points([x, y])? {
                    for (seen, time) in seen.iter_mut().zip(times) {
                        let [rho, phi, z] = point.place;
                        let then = [rho, phi - point.rate * (time - point.before), z];
                        *seen += point.weight * emission(then) / n as f64;
                    }
                }
            }
            Ok(seen)
        };
        let seen = (0..pixels * pixels).into_par_iter().map(pixel);
        let seen = seen.collect::<Result<Vec<_>, _>>()?;
        Ok((0..times.len()).map(|t| seen.iter().map(|pixel| pixel[t]).collect()).collect())
    }

    /// The points of the ray that arrives at a place of the screen, M to the west and to the north.
    fn points(&self, [x, y]: [f64; 2]) -> Result<Vec<Point>, Error> {
        let hole = Kerr::new(self.spin)?;
        let inclination = Inclination::from_degrees(self.inclination_deg)?;
        let observer = Observer::at_radius(inclination, DISTANCE)?;
        let (sin, cos) = self.position_angle_deg.to_radians().sin_cos();
        let (alpha, beta) = (x * cos + y * sin, y * cos - x * sin);
        let path = AffineTracer::new(1e-11)?.trace(&hole, &observer, alpha, beta)?;
        let mut pieces = Vec::new();
        path.intervals_within(self.radii[0], self.radii[1], &mut pieces);
        let momentum = -alpha * self.inclination_deg.to_radians().sin();
        let mut points = Vec::new();
        for [from, to] in pieces {
            let step = (to - from) / POINTS as f64;
            for k in 0..POINTS {
                let point = path.at(from + (k as f64 + 0.5) * step);
                let (r, (sin, cos)) = (point.radius(), point.theta().sin_cos());
                if (r * cos).abs() > self.height {
                    continue;
                }
                let (rate, g) = self.matter([r, sin, cos], momentum);
                points.push(Point {
                    place: [r * sin, point.azimuth, r * cos],
                    rate,
                    before: point.delay - DISTANCE - 2.0 * DISTANCE.ln(),
                    weight: g.powf(self.power) * (r * r + (self.spin * cos).powi(2)) * step,
                });
            }
        }
        Ok(points)
    }

    /// Angular velocity of a circular geodesic at (r, sin θ, cos θ), and the redshift factor of light with this angular
    /// momentum; 0 where matter would be as fast as light.
    fn matter(&self, [r, sin, cos]: [f64; 3], momentum: f64) -> (f64, f64) {
        let a = self.spin;
        let rate = 1.0 / (r.powf(1.5) + a);
        let sigma = r * r + (a * cos).powi(2);
        let lapse = 1.0 - 2.0 * r / sigma;
        let swirl = -2.0 * a * r * sin * sin / sigma;
        let around = sin * sin * (r * r + a * a - swirl * a);
        let norm = lapse - 2.0 * swirl * rate - around * rate * rate;
        (rate, norm.max(0.0).sqrt() / (1.0 - rate * momentum))
    }
}

/// Gaussian noise on all images (Box & Muller 1958).
pub fn add_noise(movie: &mut [Vec<f64>], sigma: f64, seed: u64) {
    let mut random = Pcg64::seed_from_u64(seed);
    for value in movie.iter_mut().flatten() {
        let [u, v]: [f64; 2] = [random.random(), random.random()];
        let length = (-2.0 * (1.0 - u).ln()).sqrt();
        *value += sigma * length * (core::f64::consts::TAU * v).cos();
    }
}
