//! Scene "1" of BH-NeRF (Levis et al. 2022): a hot spot that orbits at 3.5 M, σ = 0.4 M at the reference time, about a hole
//! without spin seen edge-on from 1000 M.

use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use kerrlight_tomo::fit::{
    Batch, BatchSize, Data, ForwardModel, ImageTerm, Motion, Objective, Region, Sampling,
    SightlineRequest, Sightlines, Training, Weighted,
};
use kerrlight_tomo::optimise::LinearDecay;
use std::error::Error;

const REGION: Region = Region { r_min: 2.0, r_max: 5.0, z_width: f64::INFINITY };
/// Pixels along each side, from −8 M to 8 M.
const SIDE: usize = 64;

/// The axis that the spot turns about.
pub fn axis() -> Axis {
    Axis::new([0.5, 0.0, -(0.75f64.sqrt())]).expect("an axis")
}

/// Emission at the reference time.
fn spot(x: [f64; 3]) -> f64 {
    let (sin, cos) = 60f64.to_radians().sin_cos();
    let centre = [3.5 * sin, 0.0, 3.5 * cos];
    let square: f64 = x.iter().zip(centre).map(|(a, b)| (a - b) * (a - b)).sum();
    (-square / (2.0 * 0.4 * 0.4)).exp()
}

/// Images of the spot, `frames` over a unit of time, along rays with 100 nodes each.
pub fn objective(frames: usize) -> Result<Objective<f32>, Box<dyn Error>> {
    let hole = Kerr::new(0.0)?;
    let observer = Observer::at_radius(Inclination::from_degrees(90.0)?, 1000.0)?;
    let place = |k: usize| -8.0 + 16.0 * k as f64 / (SIDE - 1) as f64;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..SIDE * SIDE).map(|k| (place(k % SIDE), place(k / SIDE))).unzip();
    let sampling = Sampling::EqualMinoTime { per_ray: 100 };
    let request = SightlineRequest { region: REGION, sampling, delay: false, momentum: false };
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request)?;
    let motion = Motion {
        velocity: AngularVelocity::bhnerf(),
        reference: 0.0,
        injection: None,
        times: (0..frames).map(|k| k as f64 / (frames - 1) as f64).collect(),
    };
    let model = ForwardModel::<f32>::new(&lines, &motion, &hole, None)?;
    let movie = model.movie_of(axis(), &spot, &mut Batch::default());
    let movie: Vec<f32> = movie.into_iter().map(|pixel| pixel as f32).collect();
    let term = Box::new(ImageTerm::new(movie, lines.pixels, 1.0)?);
    let image = Some(Weighted { weight: 1.0, term });
    Ok(Objective { model, data: Data { image, others: Vec::new() } })
}

/// Training without a mask.
pub fn training(batch: BatchSize, steps: u64) -> Training {
    Training {
        seed: 1,
        muon: None,
        rate: LinearDecay { from: 1e-3, to: 1e-5, steps },
        axis_rate: None,
        ramp: 0,
        batch,
        occupancy: None,
        change: None,
        region: REGION,
        keep_every: 50,
    }
}
