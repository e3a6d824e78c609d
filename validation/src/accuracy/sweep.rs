//! Integrator × tolerance × spin × class of ray.

use super::rays::{Class, Draw, draw};
use super::{Oracle, Truth};
use kerrlight_geodesic::{Bundle, Integrator, Kerr, OutOfRange, Placement, Request, Uncertainty};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// What is swept.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Integrators and their tolerances.
    pub settings: Vec<(Integrator, f64)>,
    /// Spins.
    pub spins: Vec<f64>,
    /// Rays of every class and spin.
    pub rays: usize,
    /// Seed of the random rays.
    pub seed: u64,
}

impl Sweep {
    /// The whole sweep, with this many rays of every class and spin.
    pub fn full(rays: usize, seed: u64) -> Self {
        let mut settings = Vec::new();
        for integrator in Integrator::ALL {
            for digits in [4, 6, 8, 10, 12, 13, 14] {
                settings.push((*integrator, 10f64.powi(-digits)));
            }
        }
        Sweep { settings, spins: vec![0.0, 0.5, 0.94, -0.94, 0.998, 1.0], rays, seed }
    }
}

/// What was found for one setting, spin and class.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Integrator.
    pub integrator: Integrator,
    /// Its tolerance.
    pub tolerance: f64,
    /// Spin.
    pub spin: f64,
    /// Class of rays.
    pub class: Class,
    /// How many rays.
    pub rays: usize,
    /// How many of them had another fate than the truth.
    pub wrong_fates: usize,
    /// Median, 99 % quantile and maximum over rays of the largest error of a position: of r
    /// (relative), θ and φ (radians), at [`SAMPLES`] points of each ray.
    pub error: [f64; 3],
    /// The same of the delay, in M.
    pub delay_error: [f64; 3],
    /// Share of rays whose estimate bounds the error, in r, θ and φ each.
    pub bounded: f64,
    /// Median of estimate over error of the position.
    pub overestimate: f64,
    /// Time of a ray without samples, in ns, on one core.
    pub ns_per_ray: f64,
    /// Time of another sample, in ns.
    pub ns_per_sample: f64,
}

/// Points of each ray at which errors are taken.
pub const SAMPLES: usize = 20;

/// What is asked of a ray of a class.
fn request(class: Class, points: usize) -> Request {
    let placement = match class {
        _ if points == 0 => Placement::None,
        Class::NearHorizon => Placement::GaussLegendre { points, from: 1.0, to: 2.4 },
        Class::Far => Placement::MinoTime(points),
        _ => Placement::GaussLegendre { points, from: 1.0, to: 100.0 },
    };
    Request { uncertainty: points > 0, ..Request::samples(placement) }
}

/// Runs the sweep; `progress` hears of every finished group of rows.
///
/// # Errors
/// If a spin or tolerance is out of range.
pub fn run(sweep: &Sweep, progress: impl Fn(usize, usize)) -> Result<Vec<Row>, OutOfRange> {
    let mut rows = Vec::new();
    let groups = Class::ALL.len() * sweep.spins.len();
    for class in Class::ALL {
        for spin in &sweep.spins {
            let mut rng = Pcg64Mcg::seed_from_u64(sweep.seed);
            let rays: Vec<Draw> =
                (0..sweep.rays).map(|_| draw(&mut rng, class, *spin)).collect::<Result<_, _>>()?;
            let judged = judge(&rays, class, &sweep.settings)?;
            for (k, (integrator, tolerance)) in sweep.settings.iter().enumerate() {
                let column: Vec<&Judged> = judged.iter().map(|ray| &ray[k]).collect();
                let [ns_per_ray, ns_per_sample] = time(&rays, *integrator, *tolerance)?;
                rows.push(Row {
                    spin: *spin,
                    class,
                    ns_per_ray,
                    ns_per_sample,
                    ..summary(*integrator, *tolerance, &column)
                });
            }
            progress(rows.len() / sweep.settings.len(), groups);
        }
    }
    Ok(rows)
}

/// One ray by one setting.
struct Judged {
    right_fate: bool,
    truth: Truth,
    estimate: Uncertainty,
}

/// Every ray by every setting, against the oracle.
fn judge(
    rays: &[Draw],
    class: Class,
    settings: &[(Integrator, f64)],
) -> Result<Vec<Vec<Judged>>, OutOfRange> {
    let request = request(class, SAMPLES);
    rays.par_iter()
        .map_init(Oracle::default, |oracle, ray| {
            oracle.trace(ray)?;
            settings
                .iter()
                .map(|(integrator, tolerance)| {
                    let bundle =
                        trace(std::slice::from_ref(ray), *integrator, *tolerance, &request)?;
                    let points = &bundle.samples;
                    let mut truth = Truth::default();
                    for k in 0..points.len() {
                        let at =
                            [points.radius[k], points.theta[k], points.azimuth[k], points.delay[k]];
                        // The ends have no finite azimuth or delay.
                        if points.radius[k] > 1.0 + 1e-9 {
                            truth = truth.max(oracle.judge(points.mino_time[k], at));
                        }
                    }
                    let right_fate = bundle.outcome[0] == oracle.outcome();
                    Ok(Judged { right_fate, truth, estimate: bundle.uncertainty[0] })
                })
                .collect()
        })
        .collect()
}

/// Rays one by one, on this thread.
fn trace(
    rays: &[Draw],
    integrator: Integrator,
    tolerance: f64,
    request: &Request,
) -> Result<Bundle, OutOfRange> {
    let mut last = Bundle::default();
    for ray in rays {
        let (alpha, beta) = ([ray.alpha], [ray.beta]);
        let (hole, observer) = (Kerr::new(ray.spin)?, ray.observer()?);
        last = integrator.trace(&hole, &observer, &alpha, &beta, tolerance, request)?;
    }
    Ok(last)
}

/// ns a ray and ns a sample: the best of a few runs of at least a millisecond.
fn time(rays: &[Draw], integrator: Integrator, tolerance: f64) -> Result<[f64; 2], OutOfRange> {
    let few = &rays[..rays.len().min(24)];
    let request = |points: usize| {
        let placement = if points == 0 { Placement::None } else { Placement::MinoTime(points) };
        Request::samples(placement)
    };
    let best = |points: usize| -> Result<f64, OutOfRange> {
        let request = request(points);
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            let (start, mut runs) = (Instant::now(), 0);
            while runs == 0 || start.elapsed() < Duration::from_millis(1) {
                trace(few, integrator, tolerance, &request)?;
                runs += 1;
            }
            best = best.min(start.elapsed().as_secs_f64() / f64::from(runs));
        }
        Ok(1e9 * best / few.len() as f64)
    };
    let (none, some) = (best(0)?, best(100)?);
    Ok([none, ((some - none) / 100.0).max(0.0)])
}

/// Median, 99 % quantile and maximum.
fn quantiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    [0.5, 0.99, 1.0].map(|part| values[(part * last as f64).round() as usize])
}

fn summary(integrator: Integrator, tolerance: f64, rays: &[&Judged]) -> Row {
    let bounded = |ray: &&&Judged| {
        let (truth, estimate) = (&ray.truth, &ray.estimate);
        truth.radius <= estimate.radius
            && truth.theta <= estimate.theta
            && truth.azimuth <= estimate.azimuth
    };
    let ratio = |ray: &&Judged| {
        let estimate = ray.estimate.radius.max(ray.estimate.theta).max(ray.estimate.azimuth);
        estimate / ray.truth.position().max(f64::EPSILON)
    };
    Row {
        integrator,
        tolerance,
        spin: 0.0,
        class: Class::Generic,
        rays: rays.len(),
        wrong_fates: rays.iter().filter(|ray| !ray.right_fate).count(),
        error: quantiles(rays.iter().map(|ray| ray.truth.position()).collect()),
        delay_error: quantiles(rays.iter().map(|ray| ray.truth.delay).collect()),
        bounded: rays.iter().filter(bounded).count() as f64 / rays.len() as f64,
        overestimate: quantiles(rays.iter().map(ratio).collect())[0],
        ns_per_ray: 0.0,
        ns_per_sample: 0.0,
    }
}
