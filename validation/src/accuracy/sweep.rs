//! Integrator × tolerance × spin × class of ray.

use super::rays::{Class, Draw, draw};
use super::{Oracle, settings};
use kerrlight_geodesic::{Error, Integrator, Kerr, Placement, RayTable, Request, Uncertainty};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Values that are swept.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Integrators and their tolerances.
    pub settings: Vec<(Integrator, f64)>,
    /// Spins.
    pub spins: Vec<f64>,
    /// Observers of every class and spin.
    pub observers: usize,
    /// Rays of every observer.
    pub rays: usize,
    /// Seed of the random rays.
    pub seed: u64,
}

impl Sweep {
    /// The whole sweep, with this many rays of every class and spin, eight observers each.
    pub fn full(rays: usize, seed: u64) -> Self {
        let settings = settings(&[4, 6, 8, 10, 12, 13, 14]);
        let spins = vec![0.0, 0.5, 0.94, -0.94, 0.998, 1.0];
        Sweep { settings, spins, observers: 8, rays: rays.div_ceil(8), seed }
    }
}

/// Result for one setting, spin and class.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Integrator.
    pub integrator: Integrator,
    /// Its tolerance.
    pub tolerance: f64,
    /// Spin; `None` for all spins together.
    pub spin: Option<f64>,
    /// Class of rays.
    pub class: Class,
    /// Number of rays.
    pub rays: usize,
    /// Number of rays with another fate than the truth; they are left out of the errors.
    pub wrong_fates: usize,
    /// Median, 99 % quantile and maximum over rays of the largest error of a position: of r
    /// (relative), θ and φ (radians), at the samples of each ray.
    pub error: [f64; 3],
    /// The same of the delay, in M.
    pub delay_error: [f64; 3],
    /// Share of rays whose estimates bound the errors of r, θ and φ, each of them.
    pub bounded: f64,
    /// Median of estimate over error of the position.
    pub overestimate: f64,
    /// Time of a ray without samples, in ns, on one core.
    pub ns_per_ray: f64,
    /// Time of another sample, in ns.
    pub ns_per_sample: f64,
}

/// Points of each ray at which errors are taken, equidistant in Mino time.
fn points(class: Class) -> usize {
    if class == Class::NearHorizon { 100 } else { 20 }
}

/// Returns whether a point counts.
fn counts(class: Class, spin: f64, radius: f64) -> bool {
    let horizon = 1.0 + (1.0 - spin * spin).max(0.0).sqrt();
    // Azimuth and delay diverge at the horizon itself.
    radius > horizon * (1.0 + 2e-8) && (class != Class::NearHorizon || radius < 1.2 * horizon)
}

/// Runs the sweep; `progress` hears how many of how many groups of rows are done and says
/// whether to go on.
///
/// # Errors
/// If a spin or tolerance is out of range.
pub fn run(sweep: &Sweep, progress: impl Fn(usize, usize) -> bool) -> Result<Vec<Row>, Error> {
    let mut rows = Vec::new();
    let groups = Class::ALL.len() * sweep.spins.len();
    let mut done = 0;
    for class in Class::ALL {
        let mut all: Vec<Vec<Judged>> = sweep.settings.iter().map(|_| Vec::new()).collect();
        let first = rows.len();
        for spin in &sweep.spins {
            if !progress(done, groups) {
                return Ok(rows);
            }
            done += 1;
            let mut rng = Pcg64Mcg::seed_from_u64(sweep.seed);
            let rays = (0..sweep.observers)
                .map(|_| draw(&mut rng, class, *spin, sweep.rays))
                .collect::<Result<Vec<_>, _>>()?;
            let judged = judge(&rays.concat(), class, &sweep.settings)?;
            for (setting, (all, ray)) in sweep.settings.iter().zip(all.iter_mut().zip(judged)) {
                let times = time(&rays, *setting)?;
                rows.push(summary(*setting, Some(*spin), class, &ray, times));
                all.extend(ray);
            }
        }
        let count = sweep.settings.len();
        for (k, (setting, all)) in sweep.settings.iter().zip(&all).enumerate() {
            let of_this = rows[first..].iter().skip(k).step_by(count);
            let mean = |value: fn(&Row) -> f64| {
                of_this.clone().map(value).sum::<f64>() / sweep.spins.len() as f64
            };
            let times = [mean(|row| row.ns_per_ray), mean(|row| row.ns_per_sample)];
            rows.push(summary(*setting, None, class, all, times));
        }
    }
    Ok(rows)
}

/// One ray by one setting.
struct Judged {
    right_fate: bool,
    truth: Uncertainty,
    estimate: Uncertainty,
}

/// Every ray by every setting, against the oracle: for each setting a column of rays.
fn judge(
    rays: &[Draw],
    class: Class,
    settings: &[(Integrator, f64)],
) -> Result<Vec<Vec<Judged>>, Error> {
    let placement = Placement::MinoTime(points(class));
    let request = Request { uncertainty: true, ..Request::samples(placement) };
    let judged = rays
        .par_iter()
        .map_init(Oracle::default, |oracle, ray| {
            oracle.trace(ray)?;
            let one = std::slice::from_ref(ray);
            let judge = |setting: &(Integrator, f64)| {
                let table = trace(one, *setting, &request)?;
                Ok(judged(&table, class, ray.spin, oracle))
            };
            settings.iter().map(judge).collect::<Result<Vec<_>, Error>>()
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut columns: Vec<Vec<Judged>> = settings.iter().map(|_| Vec::new()).collect();
    for ray in judged {
        columns.iter_mut().zip(ray).for_each(|(column, judged)| column.push(judged));
    }
    Ok(columns)
}

fn judged(table: &RayTable, class: Class, spin: f64, oracle: &Oracle) -> Judged {
    let samples = &table.samples;
    let mut truth = Uncertainty::default();
    for k in 0..samples.len() {
        if counts(class, spin, samples.radius[k]) {
            truth = truth.max(oracle.judge(samples, k));
        }
    }
    let right_fate = table.outcome[0] == oracle.outcome();
    Judged { right_fate, truth, estimate: table.uncertainty[0] }
}

/// Rays of one observer.
fn trace(
    rays: &[Draw],
    (integrator, tolerance): (Integrator, f64),
    request: &Request,
) -> Result<RayTable, Error> {
    let (hole, observer) = (Kerr::new(rays[0].spin)?, rays[0].observer()?);
    let column = |value: fn(&Draw) -> f64| rays.iter().map(value).collect::<Vec<_>>();
    let (alpha, beta) = (column(|ray| ray.alpha), column(|ray| ray.beta));
    integrator.trace(&hole, &observer, &alpha, &beta, tolerance, request)
}

/// ns a ray and ns a sample on one core: the best of a few runs of at least a millisecond.
fn time(rays: &[Vec<Draw>], setting: (Integrator, f64)) -> Result<[f64; 2], Error> {
    let count = rays.iter().map(Vec::len).sum::<usize>() as f64;
    let best = |points: usize| -> Result<f64, Error> {
        let samples = if points == 0 { Placement::None } else { Placement::MinoTime(points) };
        let request = Request::samples(samples);
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            let (start, mut runs) = (Instant::now(), 0);
            while runs == 0 || start.elapsed() < Duration::from_millis(1) {
                for observer in rays {
                    std::hint::black_box(trace(observer, setting, &request)?);
                }
                runs += 1;
            }
            best = best.min(start.elapsed().as_secs_f64() / f64::from(runs));
        }
        Ok(1e9 * best / count)
    };
    let measure = || {
        let (none, some) = (best(0)?, best(100)?);
        Ok([none, ((some - none) / 100.0).max(0.0)])
    };
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(one_core) => one_core.install(measure),
        // No thread to be had: no time either.
        Err(_) => Ok([f64::NAN; 2]),
    }
}

/// Median, 99 % quantile and maximum.
fn quantiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    if values.is_empty() {
        return [f64::NAN; 3];
    }
    let last = values.len() - 1;
    [0.5, 0.99, 1.0].map(|part| values[(part * last as f64).round() as usize])
}

/// The largest of the errors of r (relative), θ and φ.
fn position(errors: &Uncertainty) -> f64 {
    errors.radius.max(errors.theta).max(errors.azimuth)
}

fn summary(
    (integrator, tolerance): (Integrator, f64),
    spin: Option<f64>,
    class: Class,
    rays: &[Judged],
    [ns_per_ray, ns_per_sample]: [f64; 2],
) -> Row {
    let right: Vec<&Judged> = rays.iter().filter(|ray| ray.right_fate).collect();
    let bounded = |ray: &&&Judged| {
        let (truth, estimate) = (&ray.truth, &ray.estimate);
        truth.radius <= estimate.radius
            && truth.theta <= estimate.theta
            && truth.azimuth <= estimate.azimuth
    };
    let ratio = |ray: &&Judged| position(&ray.estimate) / position(&ray.truth).max(f64::EPSILON);
    let count = right.len().max(1) as f64;
    Row {
        integrator,
        tolerance,
        spin,
        class,
        rays: rays.len(),
        wrong_fates: rays.len() - right.len(),
        error: quantiles(right.iter().map(|ray| position(&ray.truth)).collect()),
        delay_error: quantiles(right.iter().map(|ray| ray.truth.delay).collect()),
        bounded: right.iter().filter(bounded).count() as f64 / count,
        overestimate: quantiles(right.iter().map(ratio).collect())[0],
        ns_per_ray,
        ns_per_sample,
    }
}
