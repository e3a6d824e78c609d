//! Rays of a device against those of the tracer in doubles.

use crate::classes::Picture;
use kerrlight_geodesic::gpu::GpuTracer;
use kerrlight_geodesic::vector::distance;
use kerrlight_geodesic::{DeviceRays, DeviceRequest, Outcome, Path, PathPoint, Quantities, Tracer};
use std::collections::BTreeMap;

/// Crossings that are compared, and samples.
const CROSSINGS: usize = 4;
const SAMPLES: usize = 20;

/// Name of the counts of steps, which are kept among the errors.
pub const STEPS: &str = "steps";

/// The errors of a class.
#[derive(Default)]
pub struct Errors {
    pub rays: usize,
    /// Rays that the device does not vouch for.
    pub flagged: usize,
    /// Rays of the other fate, or with other events, that are not flagged.
    pub wrong: usize,
    /// Errors by quantity.
    pub of: BTreeMap<&'static str, Vec<f64>>,
}

impl Errors {
    pub fn push(&mut self, what: &'static str, error: f64) {
        self.of.entry(what).or_default().push(error);
    }
}

/// The value that a share of `values` keep below; 0 if there is none.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}

/// Adds a picture's errors.
pub fn compare(tracer: &GpuTracer, picture: &Picture, errors: &mut Errors) {
    let Picture { hole, view, x, y } = picture;
    let request = DeviceRequest {
        crossings: CROSSINGS,
        samples: SAMPLES,
        quadratures: true,
        end: 0.0,
        sphere: None,
    };
    let mut rays = DeviceRays::default();
    tracer.trace(hole, view, (x, y), &request, &mut rays).unwrap();
    let (mut path, exact) = (Path::new(), Tracer::new(1e-12).unwrap());
    for (k, (x, y)) in x.iter().zip(y).enumerate() {
        let Ok(ray) = view.ray(hole, *x, *y) else {
            assert!(!rays.ends()[k].is_trusted, "no photon arrives at ({x}, {y})");
            continue;
        };
        errors.rays += 1;
        exact.trace(hole, &ray, Quantities::ALL, &mut path);
        if !rays.ends()[k].is_trusted {
            errors.flagged += 1;
            continue;
        }
        if !agree(&rays, k, &path, errors) {
            let end = &rays.ends()[k];
            eprintln!("a = {}, ({x}, {y}): {end:?}, exact {:?}", hole.spin(), path.outcome());
            errors.wrong += 1;
        }
    }
}

/// Compares ray `k`; whether its fate and its number of crossings are right. Radii and samples are compared by their
/// ratio, delays in units of what the impact parameter is.
fn agree(rays: &DeviceRays, k: usize, path: &Path, errors: &mut Errors) -> bool {
    let end = &rays.ends()[k];
    errors.push(STEPS, f64::from(end.steps));
    if end.outcome != path.outcome() || end.crossings as usize != path.equatorial_crossings().len()
    {
        return false;
    }
    let scale = (end.eta + end.lambda * end.lambda).max(1.0).sqrt();
    for (found, time) in rays.crossings_of(k).iter().zip(path.equatorial_crossings()) {
        let point = path.at(time);
        errors.push("r", (found.radius * point.inverse_radius - 1.0).abs());
        errors.push("φ", (found.azimuth - point.azimuth).abs());
        errors.push("delay", (found.delay - point.delay).abs() / scale.max(point.radius()));
    }
    if end.outcome == Outcome::Escaped {
        let last = path.at(path.mino_total());
        errors.push("exit", distance(end.exit, last.direction));
    }
    samples(rays, k, path, errors);
    true
}

/// Samples are compared at their own Mino times; the last one of a captured ray lies on the horizon.
fn samples(rays: &DeviceRays, k: usize, path: &Path, errors: &mut Errors) {
    let captured = path.outcome() == Outcome::Captured;
    let n = SAMPLES as f64;
    let at_infinity = path.at(0.0).inverse_radius == 0.0;
    let (from, to) = match (at_infinity, captured) {
        (true, true) => (1.0 / n, 1.0),
        (true, false) => (1.0 / (n + 1.0), n / (n + 1.0)),
        (false, _) => (0.0, 1.0),
    };
    for (j, sample) in rays.samples_of(k).iter().enumerate() {
        let share = from + (to - from) * j as f64 / (n - 1.0);
        let point: PathPoint = path.at(share * path.mino_total());
        let last = j + 1 == SAMPLES && to == 1.0;
        if last {
            continue;
        }
        let radial = (sample.radius * point.inverse_radius - 1.0).abs();
        errors.push("samples", radial.max((sample.theta - point.theta()).abs()));
    }
}
