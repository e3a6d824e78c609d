//! Scenes "1", "4" and "8" of BH-NeRF (Levis et al. 2022): hot spots that orbit at 3.5 M.

use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{AngularVelocity, Axis, Turned, pull_back};
use kerrlight_render::points::{Coordinates, CoordinatesMut};
use kerrlight_tomo::fit::{
    Batch, ForwardModel, Motion, Region, Sampling, SightlineRequest, Sightlines,
};
use std::error::Error;

/// Frames of the movie.
pub const FRAMES: usize = 128;

/// `side` places from −8 M to 8 M.
pub fn screen(side: usize) -> Vec<f64> {
    (0..side).map(|k| -8.0 + 16.0 * k as f64 / (side - 1) as f64).collect()
}

/// A hole without spin seen edge-on from 1000 M: rays at all pairs of these places on the screen, `per_ray`
/// nodes each.
pub fn lines(places: &[f64], per_ray: usize) -> Result<Sightlines, Box<dyn Error>> {
    lines_in(Region { r_min: 0.0, r_max: 5.0, z_width: f64::INFINITY }, places, per_ray)
}

/// The same with nodes in a region.
pub fn lines_in(
    region: Region,
    places: &[f64],
    per_ray: usize,
) -> Result<Sightlines, Box<dyn Error>> {
    let observer = Observer::at_radius(Inclination::from_degrees(90.0)?, 1000.0)?;
    let side = places.len();
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..side * side).map(|k| (places[k % side], places[k / side])).unzip();
    let request = SightlineRequest {
        region,
        sampling: Sampling::EqualMinoTime { per_ray },
        delay: false,
        momentum: false,
    };
    Ok(Sightlines::trace(&Kerr::new(0.0)?, &observer, &alpha, &beta, &request)?)
}

/// These rays with a movie of `frames` frames over a unit of time.
pub fn forward_model(
    lines: &Sightlines,
    frames: usize,
) -> Result<ForwardModel<f32>, Box<dyn Error>> {
    let time = |k: usize| k as f64 / (frames - 1) as f64;
    let motion = Motion {
        velocity: AngularVelocity::bhnerf(),
        reference: 0.0,
        injection: None,
        times: (0..frames).map(time).collect(),
    };
    Ok(ForwardModel::new(lines, &motion, &Kerr::new(0.0)?, None)?)
}

/// Gaussian spots of σ = 0.4 M at the reference time.
pub struct Truth {
    axis: Axis,
    spots: Vec<[f64; 3]>,
    /// Spots that have been sheared for 32/127 of a unit of time.
    sheared: Vec<[f64; 3]>,
}

fn turned(axis: Axis, [x, y, z]: [f64; 3], angle: f64) -> [f64; 3] {
    let [mut a, mut b, mut c] = [[0.0]; 3];
    let (x, y, z) = ([x], [y], [z]);
    let turned = Turned { points: Coordinates::xyz(&x, &y, &z), angles: &[angle] };
    pull_back(axis, turned, CoordinatesMut::xyz(&mut a, &mut b, &mut c));
    [a[0], b[0], c[0]]
}

impl Truth {
    /// Scene 1, 4 or 8.
    pub fn scene(number: &str, axis: Axis) -> Result<Self, String> {
        let (sin, cos) = 60f64.to_radians().sin_cos();
        let start = [3.5 * sin, 0.0, 3.5 * cos];
        let centre =
            |phase: &u32| turned(axis, start, -std::f64::consts::TAU * f64::from(*phase) / 127.0);
        let centres = |phases: &[u32]| phases.iter().map(centre).collect::<Vec<_>>();
        let four = [60, 75, 105, 0];
        let (spots, sheared) = match number {
            "1" => (centres(&[0]), Vec::new()),
            "4" => (centres(&four), Vec::new()),
            "8" => (centres(&[25, 55, 60, 40]), centres(&four)),
            other => return Err(format!("scene {other}: 1, 4 or 8")),
        };
        Ok(Self { axis, spots, sheared })
    }

    /// Emission.
    pub fn at(&self, x: [f64; 3]) -> f64 {
        let light = |spots: &[[f64; 3]], x: [f64; 3]| -> f64 {
            let spot = |c: &[f64; 3]| (-distance(x, *c).powi(2) / (2.0 * 0.4 * 0.4)).exp();
            spots.iter().map(spot).sum()
        };
        if self.sheared.is_empty() {
            return light(&self.spots, x);
        }
        let angle = AngularVelocity::bhnerf().angle(x, 32.0 / 127.0, 0.0);
        light(&self.spots, x) + light(&self.sheared, turned(self.axis, x, angle))
    }

    /// Pixels of all frames, frame after frame.
    pub fn movie(&self, model: &ForwardModel<f32>) -> Vec<f32> {
        let mut batch = Batch::default();
        let mut movie = vec![0.0; model.frames() * model.pixels()];
        for (frame, image) in movie.chunks_exact_mut(model.pixels()).enumerate() {
            batch.set((0..model.rays()).map(|ray| (ray as u32, frame as u32)));
            batch.gather(model, self.axis, None);
            let [x, y, z] = &batch.columns.pulled;
            for (pixel, ends) in model.pixel().iter().zip(batch.starts.windows(2)) {
                let light = |k: usize| {
                    let weight = f64::from(batch.columns.weight[k]);
                    weight * self.at([x[k], y[k], z[k]].map(f64::from))
                };
                image[*pixel as usize] = (ends[0]..ends[1]).map(light).sum::<f64>() as f32;
            }
        }
        movie
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Processor time of all threads so far, s; NaN where the system does not tell.
pub fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> = text
        .rsplit(')')
        .next()
        .map(|rest| rest.split_whitespace().skip(11).take(2).flat_map(str::parse).collect())
        .unwrap_or_default();
    if fields.len() == 2 { fields.iter().sum::<f64>() / 100.0 } else { f64::NAN }
}
