//! Paths that a device has followed, against those of the tracer in doubles.

use crate::classes::Picture;
use crate::compare::Errors;
use kerrlight_geodesic::gpu::GpuTracer;
use kerrlight_geodesic::vector::distance;
use kerrlight_geodesic::{DevicePaths, Outcome, Path, PathPoint, Quantities, Tracer};

/// Places on each ray that are compared, its ends left out.
const PLACES: usize = 40;

/// Adds a picture's errors.
pub fn compare(tracer: &GpuTracer, picture: &Picture, errors: &mut Errors) {
    let Picture { hole, view, x, y } = picture;
    let mut paths = DevicePaths::default();
    tracer.follow(hole, view, (x, y), &mut paths).unwrap();
    assert_eq!(paths.len(), x.len());
    let (mut exact, mut found) = (Path::new(), Path::new());
    let reference = Tracer::new(1e-12).unwrap();
    for (k, (x, y)) in x.iter().zip(y).enumerate() {
        let Ok(ray) = view.ray(hole, *x, *y) else { continue };
        errors.rays += 1;
        reference.trace(hole, &ray, Quantities::ALL, &mut exact);
        let Some(error) = paths.assemble(k, hole, &ray, &mut found) else {
            errors.flagged += 1;
            continue;
        };
        assert!((1e-7..1e-3).contains(&error), "({x}, {y}): {error:e}");
        if !agree(hole.horizon(), &exact, &found, errors) {
            eprintln!("a = {}, ({x}, {y}): {:?}", hole.spin(), exact.outcome());
            errors.wrong += 1;
        }
    }
}

/// Compares two paths of a ray; whether their fate and their events are the same.
fn agree(horizon: f64, exact: &Path, found: &Path, errors: &mut Errors) -> bool {
    let total = exact.mino_total();
    let times = |path: &Path| -> Vec<f64> {
        path.equatorial_crossings().chain(path.turning_point().map(|(time, _)| time)).collect()
    };
    let [own, theirs] = [exact, found].map(times);
    let ends = |path: &Path| (path.outcome(), path.turning_point().is_some());
    if ends(exact) != ends(found) || own.len() != theirs.len() {
        return false;
    }
    own.iter().zip(theirs).for_each(|(a, b)| errors.push("events", (a - b).abs() / total));
    for k in 1..PLACES {
        let time = total * k as f64 / PLACES as f64;
        points([exact.at(time), found.at(time)], horizon, exact.angular_rate(), errors);
    }
    exact.outcome() == Outcome::Captured || escapes([exact, found], errors)
}

/// Compares places: radii by their ratio; azimuths and delays times 1 − r₊/r, since they diverge at the horizon, delays
/// in units of the larger of radius and impact parameter; d(1/r)/dτ, and dn/dτ by the impact parameter.
fn points([a, b]: [PathPoint; 2], horizon: f64, impact: f64, errors: &mut Errors) {
    let gap = (1.0 - horizon * a.inverse_radius).max(0.0);
    errors.push("r", (b.radius() * a.inverse_radius - 1.0).abs());
    errors.push("θ", (a.theta() - b.theta()).abs());
    errors.push("φ", (a.azimuth - b.azimuth).abs() * gap);
    errors.push("delay", (a.delay - b.delay).abs() / impact.max(a.radius()) * gap);
    let speed = (a.inverse_radius_rate - b.inverse_radius_rate).abs();
    // Without the part that diverges with the azimuth.
    let across = (a.velocity[2] - b.velocity[2]).abs() / impact;
    errors.push("rates", speed.max(across));
}

/// The direction in which a ray escapes, and its parts in a shell; whether there are as many.
fn escapes(paths: [&Path; 2], errors: &mut Errors) -> bool {
    let total = paths[0].mino_total();
    let [a, b] = paths.map(|path| path.at(path.mino_total()).direction);
    errors.push("θ", distance(a, b));
    let mut parts = [Vec::new(), Vec::new()];
    paths.iter().zip(&mut parts).for_each(|(path, parts)| path.intervals_within(9.0, 12.0, parts));
    let [a, b] = parts;
    let ends = a.iter().flatten().zip(b.iter().flatten());
    ends.for_each(|(a, b)| errors.push("events", (a - b).abs() / total));
    a.len() == b.len()
}
