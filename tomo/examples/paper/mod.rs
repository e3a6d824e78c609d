//! Scene "1" of BH-NeRF (Levis et al. 2022): a hot spot that orbits at 3.5 M.

use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use kerrlight_tomo::fit::{
    Batch, ForwardModel, Motion, Region, Sampling, SightlineRequest, Sightlines,
};
use std::error::Error;

/// `side` places from −8 M to 8 M.
pub fn screen(side: usize) -> Vec<f64> {
    (0..side).map(|k| -8.0 + 16.0 * k as f64 / (side - 1) as f64).collect()
}

/// A hole without spin seen edge-on from 1000 M: rays at all pairs of these places on the screen, `per_ray`
/// nodes each in a region.
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

/// The spot of scene "1", σ = 0.4 M at the reference time.
pub struct Truth {
    axis: Axis,
}

impl Truth {
    /// Starts about this axis.
    pub fn about(axis: Axis) -> Self {
        Self { axis }
    }

    /// Emission.
    fn at(x: [f64; 3]) -> f64 {
        let (sin, cos) = 60f64.to_radians().sin_cos();
        let centre = [3.5 * sin, 0.0, 3.5 * cos];
        let square: f64 = x.iter().zip(centre).map(|(a, b)| (a - b) * (a - b)).sum();
        (-square / (2.0 * 0.4 * 0.4)).exp()
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
                    weight * Self::at([x[k], y[k], z[k]].map(f64::from))
                };
                image[*pixel as usize] = (ends[0]..ends[1]).map(light).sum::<f64>() as f32;
            }
        }
        movie
    }
}
