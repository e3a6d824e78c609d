//! Hamilton's equations in Kerr–Schild coordinates against the separated equations in Mino
//! time: two tracers without a common equation of motion, on random rays.

use crate::report::Case;
use kerrlight_geodesic::{
    AffineTracer, Error, Inclination, Kerr, Observer, Path, Quantities, Tracer,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

const AUTHORITY: &str = "Hamilton's equations, Kerr–Schild";

/// Rays compared.
const RAYS: u64 = 10_000;

/// Errors of one ray: r, θ, azimuth, delay, and H of the referee.
fn compare(seed: u64) -> Result<Option<[f64; 5]>, Error> {
    let mut random = Pcg64::seed_from_u64(seed);
    let hole = Kerr::new(random.random_range(-1.0..=1.0))?;
    let inclination = Inclination::from_degrees(random.random_range(1.0..179.0))?;
    let observer = Observer::at_radius(inclination, 100.0)?;
    let (alpha, beta) = (random.random_range(-15.0..15.0), random.random_range(-15.0..15.0));
    let referee = AffineTracer::new(1e-13)?.trace(&hole, &observer, alpha, beta)?;
    let ray = observer.ray(&hole, alpha, beta)?;
    // Next to the critical curve the referee, which conserves nothing, loses its digits.
    let height = ray.potential.barrier.map_or(1.0, |barrier| barrier.height.abs());
    if height < 1e-3 {
        return Ok(None);
    }
    let mut path = Path::new();
    Tracer::new(1e-13)?.trace(&hole, &ray, Quantities::ALL, &mut path);
    if referee.outcome() != path.outcome() {
        return Ok(Some([f64::INFINITY; 5]));
    }
    let mut worst = [0.0f64; 5];
    worst[4] = referee.largest_hamiltonian();
    for part in [0.2, 0.5, 0.8, 0.95] {
        let time = part * referee.mino_total();
        let (a, b) = (referee.at(time), path.at(time));
        let r = b.radius();
        // dφ = a dr/Δ amplifies errors of r at the horizon, 1/sin θ those of position at the
        // poles.
        let amplified = (1.0 + hole.spin().abs() * r / hole.delta(r)) / b.theta().sin().max(1e-9);
        let turn = (a.azimuth - b.azimuth) / std::f64::consts::TAU;
        let slope = (r * r + hole.spin().powi(2)) / hole.delta(r);
        let misses = [
            (a.radius() / r - 1.0).abs(),
            (a.theta() - b.theta()).abs(),
            (turn - turn.round()).abs() * std::f64::consts::TAU / amplified,
            (a.delay - b.delay).abs() / (b.delay.abs().max(1.0) + slope * r),
        ];
        for (worst, miss) in worst.iter_mut().zip(misses) {
            *worst = worst.max(miss);
        }
    }
    Ok(Some(worst))
}

/// All cases of this file.
pub fn cases() -> Vec<Case> {
    let compared: Vec<[f64; 5]> = (0..RAYS)
        .into_par_iter()
        .filter_map(|seed| compare(seed).unwrap_or(Some([f64::INFINITY; 5])))
        .collect();
    let names = [
        "radius",
        "polar angle (radians)",
        "azimuth (radians, over its amplification at horizon and poles)",
        "delay (relative)",
        "H = ½ g^{μν} p_μ p_ν of the referee (absolute)",
    ];
    names
        .into_iter()
        .enumerate()
        .map(|(k, name)| {
            let errors = compared.iter().map(|e| e[k]).collect();
            Case::sample(AUTHORITY, name, "random rays", errors, 1e-9)
        })
        .collect()
}
