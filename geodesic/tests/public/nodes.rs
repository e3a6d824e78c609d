//! Nodes of quadratures along many rays against the Taylor tracer and closed forms.

use crate::{at_infinity, at_radius};
use kerrlight_geodesic::simd::{Crossings, NodeRequest, Nodes, PanelRule};
use kerrlight_geodesic::{Kerr, Outcome, Path, Quantities, Tracer};

fn request(radius: f64) -> NodeRequest {
    let rule = PanelRule::new(8);
    NodeRequest { radius, rule, split: 1, quantities: Quantities::ALL }
}

fn screen() -> (Vec<f64>, Vec<f64>) {
    let points = (0..19).flat_map(|i| (0..19).map(move |j| (i, j)));
    points.map(|(i, j)| (f64::from(i) * 1.1 - 9.91, f64::from(j) * 1.1 - 9.91)).unzip()
}

fn turn(angle: f64) -> f64 {
    use core::f64::consts::TAU;
    (angle - TAU * (angle / TAU).round()).abs()
}

/// Largest misses of (r relative, cos θ, azimuth, delay, velocities) at all nodes of the screen.
fn misses(spin: f64, degrees: f64, radius: f64) -> [f64; 5] {
    let hole = Kerr::new(spin).unwrap();
    let observer = at_radius(degrees, radius);
    let (alpha, beta) = screen();
    let mut nodes = Nodes::default();
    nodes.trace(&hole, &observer, &alpha, &beta, None, &request(20.0)).unwrap();
    let tracer = Tracer::new(1e-13).unwrap();
    let (mut path, mut worst, mut compared) = (Path::new(), [0.0f64; 5], 0);
    for k in 0..alpha.len() {
        let ray = observer.ray(&hole, alpha[k], beta[k]).unwrap();
        tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
        let found = nodes.ray(k);
        if found.error > 1e-10 {
            continue;
        }
        compared += usize::from(!found.radius.is_empty());
        assert!(found.radius.iter().all(|r| *r < 20.0 * (1.0 + 1e-12)));
        for (j, time) in found.mino_time.iter().enumerate() {
            let point = path.at(*time);
            let each = [
                (found.radius[j] / point.radius() - 1.0).abs(),
                (found.cos_theta[j] - point.cos_theta()).abs(),
                turn(found.azimuth[j] - point.azimuth) * (1.0 - hole.horizon() / point.radius()),
                (found.delay[j] - point.delay).abs() * (1.0 - hole.horizon() / point.radius()),
                (found.radial_velocity[j] - point.inverse_radius_rate).abs()
                    + (found.polar_velocity[j] - point.velocity[2]).abs(),
            ];
            assert!(each.iter().all(|x| x.is_finite()), "{each:?}");
            worst.iter_mut().zip(each).for_each(|(worst, x)| *worst = worst.max(x));
        }
    }
    assert!(compared > alpha.len() / 2, "{compared} of {} rays", alpha.len());
    worst
}

#[test]
fn code_nodes_lie_on_the_traced_paths() {
    for spin in [0.0, 0.5, -0.94, 0.998] {
        for inclination in [0.0, 17.0, 60.0, 90.0, 163.0] {
            for radius in [f64::INFINITY, 1000.0, 19.0] {
                let [r, u, azimuth, delay, velocity] = misses(spin, inclination, radius);
                let case = format!("a = {spin}, i = {inclination}, {radius:?}");
                let all = format!("{case}: {r:e} {u:e} {azimuth:e} {delay:e} {velocity:e}");
                assert!(r < 1e-11 && u < 5e-11 && velocity < 1e-9, "{all}");
                assert!(azimuth < 5e-9 && delay < 3e-8, "{all}");
            }
        }
    }
}

/// ∫Σ dτ over the part of a radial ray of a hole without spin inside a sphere is the difference
/// of radii, and ∫dτ the Mino time, whatever power of Δ it is weighted with at the horizon.
#[test]
fn exact_integrals_along_a_falling_ray() {
    let hole = Kerr::new(0.0).unwrap();
    let observer = at_infinity(60.0);
    let mut nodes = Nodes::default();
    for (split, tolerance) in [(1, 2e-7), (2, 1e-9), (4, 1e-12)] {
        let request = NodeRequest { split, ..request(10.0) };
        nodes.trace(&hole, &observer, &[0.0], &[0.0], None, &request).unwrap();
        let length: f64 = nodes.ray(0).weight.iter().sum();
        assert!((length - 8.0).abs() < tolerance, "{split}: {length}");
    }
    let ray = nodes.ray(0);
    // dr/dτ = −r²: ∫ r^{−1/2} (r − 2)^{−1/2} dr from 2 to 10 = 2 artanh √(1 − 2/r).
    let singular = ray.radius.iter().zip(ray.weight);
    let sum: f64 = singular.map(|(r, w)| w / (r * (r - 2.0)).sqrt()).sum();
    let expected = 2.0 * 0.8f64.sqrt().atanh();
    assert!((sum / expected - 1.0).abs() < 1e-7, "{sum} {expected}");
}

#[test]
fn exact_nodes_end_where_they_are_told_to() {
    let hole = Kerr::new(0.7).unwrap();
    let observer = at_infinity(60.0);
    let (alpha, beta) = screen();
    let (mut all, mut cut) = (Nodes::default(), Nodes::default());
    all.trace(&hole, &observer, &alpha, &beta, None, &request(20.0)).unwrap();
    let mut compared = 0;
    for share in [0.1, 0.45, 0.5, 0.8, 1.0] {
        let end = |k| all.ray(k).mino_time.last().copied().unwrap_or(0.0) * share;
        let ends: Vec<f64> = (0..alpha.len()).map(end).collect();
        cut.trace(&hole, &observer, &alpha, &beta, Some(&ends), &request(20.0)).unwrap();
        for (k, end) in ends.iter().enumerate() {
            let (ray, whole) = (cut.ray(k), all.ray(k));
            assert!(ray.mino_time.iter().all(|time| time < end));
            // ∫dτ is the way from the sphere to the end.
            let sum = |ray: &kerrlight_geodesic::simd::RayNodes<'_>| -> f64 {
                let sigma = |j: usize| ray.radius[j].powi(2) + (0.7 * ray.cos_theta[j]).powi(2);
                (0..ray.radius.len()).map(|j| ray.weight[j] / sigma(j)).sum()
            };
            if ray.radius.is_empty() {
                continue;
            }
            compared += 1;
            let start = whole.mino_time[0] - ray.mino_time[0];
            assert!(start.is_finite() && sum(&ray) <= end * (1.0 + 1e-12));
            if share == 1.0 {
                let missing = sum(&whole) - sum(&ray);
                assert!((0.0..0.02).contains(&missing), "{missing}");
            }
        }
    }
    assert!(compared > 5 * alpha.len() / 2, "{compared} of {} rays", 5 * alpha.len());
}

#[test]
fn code_ends_of_rays_are_those_of_the_tracer() {
    let tracer = Tracer::new(1e-13).unwrap();
    let (alpha, beta) = screen();
    let (mut path, mut found) = (Path::new(), Crossings::default());
    let (mut compared, mut captured) = (0, 0);
    for (spin, degrees, radius) in
        [(0.0, 0.0, f64::INFINITY), (0.9, 60.0, 1000.0), (-0.5, 90.0, 30.0), (1.0, 17.0, 1e6)]
    {
        let hole = Kerr::new(spin).unwrap();
        let observer = at_radius(degrees, radius);
        found.trace(&hole, &observer, &alpha, &beta, 2).unwrap();
        for k in 0..alpha.len() {
            let ray = observer.ray(&hole, alpha[k], beta[k]).unwrap();
            tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
            let ends = found.ends(k);
            if ends.error > 1e-9 {
                continue;
            }
            compared += 1;
            assert_eq!(ends.escapes, path.outcome() == Outcome::Escaped);
            captured += u32::from(!ends.escapes);
            let total = match path.turning_point() {
                Some((turning, _)) if radius.is_finite() => 2.0 * turning,
                _ => path.mino_total(),
            };
            assert!((ends.mino_total / total - 1.0).abs() < 1e-10, "{}", ends.mino_total);
            let crossings = path.equatorial_crossings().filter(|time| *time <= total).count();
            assert_eq!(ends.crossings as usize, crossings, "{} {}", alpha[k], beta[k]);
        }
    }
    assert!(captured > 100 && compared > 2 * alpha.len(), "{captured} of {compared}");
}
