//! Polarisation carried to the screen by the Walker–Penrose constant, against parallel transport
//! that is integrated step by step, closed forms and published numbers.

use crate::kerr_schild::Transported;
use kerrlight_geodesic::{
    Inclination, Kerr, Observer, Path, PathPoint, Quantities, Ray, ScreenPoint, Tracer, ZamoFrame,
};

const SPINS: [f64; 5] = [0.0, 0.5, 0.94, -0.94, 1.0];

fn trace(hole: &Kerr, degrees: f64, alpha: f64, beta: f64) -> (Ray, Path, ScreenPoint) {
    let inclination = Inclination::from_degrees(degrees).unwrap();
    let ray = Observer::at_infinity(inclination).ray(hole, alpha, beta).unwrap();
    let mut path = Path::new();
    Tracer::new(1e-13).unwrap().trace(hole, &ray, Quantities::ALL, &mut path);
    (ray, path, ScreenPoint::new(hole, inclination.sin(), alpha, beta))
}

fn frame_and_photon(hole: &Kerr, ray: &Ray, point: &PathPoint) -> (ZamoFrame, [f64; 4]) {
    let frame = ZamoFrame::of(hole, point).unwrap();
    (frame, frame.covariant(point.momentum(hole, ray.lambda)))
}

/// The part of the space-like vector `s` of the frame that is normal to the photon.
fn normal(k: [f64; 4], s: [f64; 3]) -> [f64; 4] {
    let along: f64 = (0..3).map(|i| k[i + 1] * s[i]).sum::<f64>() / (k[0] * k[0]);
    [0.0, s[0] - along * k[1], s[1] - along * k[2], s[2] - along * k[3]]
}

#[test]
fn exact_parallel_transport_step_by_step() {
    let mut count = 0;
    for spin in SPINS {
        let hole = Kerr::new(spin).unwrap();
        // The last ones pass over the axis.
        for (degrees, alpha, beta) in [
            (60.0, -6.0, 2.0),
            (17.0, 4.0, -5.0),
            (90.0, 7.0, 1.0),
            (150.0, 0.3, 6.5),
            (70.0, 1e-5, 6.0),
            (0.0, 3.0, -5.0),
            (50.0, -0.1, 5.3),
        ] {
            let (ray, path, screen) = trace(&hole, degrees, alpha, beta);
            let total = path.mino_total();
            let first = path.equatorial_crossings().next().unwrap_or(0.5 * total);
            for time in [first, 0.4 * total, 0.8 * total] {
                let point = path.at(time);
                if point.radius() < 1.05 * hole.horizon() {
                    continue;
                }
                let (frame, k) = frame_and_photon(&hole, &ray, &point);
                let f = normal(k, [0.3, -0.8, 0.5]);
                let [north, east] = screen.transport(&frame, k, f);
                let start = Transported::new(&hole, &frame, point.azimuth, k, f);
                let end = start.carried_out(spin, 0.004);
                let (expected, miss) = end.on_screen(degrees.to_radians());
                let error = (north - expected[0]).hypot(east - expected[1]);
                assert!(miss < 1e-7, "a = {spin}, i = {degrees}, ({alpha}, {beta}): {miss:e}");
                let size = expected[0].hypot(expected[1]);
                assert!(
                    error < 1e-8 * size,
                    "a = {spin}, i = {degrees}, ({alpha}, {beta}), r = {}: {error:e}, {miss:e}",
                    point.radius()
                );
                count += 1;
            }
        }
    }
    assert!(count > 80, "{count}");
}

/// |κ|² = 𝒦 f·f, 𝒦 = β² + ν² (Walker & Penrose 1970), at every point of a ray.
#[test]
fn exact_length_is_kept() {
    for spin in SPINS {
        let hole = Kerr::new(spin).unwrap();
        let (ray, path, screen) = trace(&hole, 35.0, -4.5, 3.0);
        for part in 1..20 {
            let point = path.at(f64::from(part) / 20.0 * path.mino_total());
            if point.radius() < 1.01 * hole.horizon() {
                continue;
            }
            let (frame, k) = frame_and_photon(&hole, &ray, &point);
            let f = normal(k, [-0.2, 0.4, 0.9]);
            let length = f.iter().map(|x| x * x).sum::<f64>().sqrt();
            // A multiple of k changes nothing.
            let shifted = std::array::from_fn(|i| f[i] + 0.7 * k[i]);
            for f in [f, shifted] {
                let [north, east] = screen.transport(&frame, k, f);
                let miss = north.hypot(east) / length - 1.0;
                assert!(miss.abs() < 1e-9, "a = {spin}, r = {}: {miss:e}", point.radius());
            }
        }
    }
}

/// Without spin a ray stays in a plane, and so does the angle of f with it.
#[test]
fn exact_planes_without_spin() {
    let hole = Kerr::new(0.0).unwrap();
    for (degrees, alpha, beta) in
        [(60.0, -6.0, 2.0), (17.0, 4.0, -5.0), (0.0, 1.0, 7.0), (90.0, 0.0, 6.0)]
    {
        let (ray, path, screen) = trace(&hole, degrees, alpha, beta);
        for part in 1..10 {
            let point = path.at(f64::from(part) / 10.0 * path.mino_total());
            if point.radius() < 2.01 {
                continue;
            }
            let (frame, k) = frame_and_photon(&hole, &ray, &point);
            // e_r × k is normal to the plane: on the screen, to the radius (α, β).
            let across = (k[2] * k[2] + k[3] * k[3]).sqrt();
            let [north, east] =
                screen.transport(&frame, k, [0.0, 0.0, -k[3] / across, k[2] / across]);
            let b = alpha.hypot(beta);
            // The photon moves inward on the screen: −(α, β); e_r × that points along (β, −α).
            let expected = [-alpha / b, -beta / b];
            let miss = (north - expected[0]).hypot(east - expected[1]);
            assert!(miss < 1e-10, "i = {degrees}, ({alpha}, {beta}): {north} {east} {expected:?}");
        }
    }
}

/// The pictures from above and below, and of holes that turn against each other, are mirrored.
#[test]
fn exact_mirrors() {
    let at = |spin: f64, degrees: f64, alpha: f64, beta: f64, s: [f64; 3]| {
        let hole = Kerr::new(spin).unwrap();
        let (ray, path, screen) = trace(&hole, degrees, alpha, beta);
        let point = path.at(0.6 * path.mino_total());
        let (frame, k) = frame_and_photon(&hole, &ray, &point);
        screen.transport(&frame, k, normal(k, s))
    };
    for spin in [0.5, 0.94] {
        let [north, east] = at(spin, 40.0, -3.0, 5.0, [0.3, -0.8, 0.5]);
        let below = at(spin, 140.0, -3.0, -5.0, [0.3, 0.8, 0.5]);
        assert!((below[0] + north).abs() < 1e-9 && (below[1] - east).abs() < 1e-9);
        let other = at(-spin, 40.0, 3.0, 5.0, [0.3, -0.8, -0.5]);
        assert!((other[0] - north).abs() < 1e-9 && (other[1] + east).abs() < 1e-9);
    }
}

/// Principal null rays, on which κ vanishes, continue their neighbours.
#[test]
fn exact_principal_null_rays() {
    for (spin, degrees) in [(0.0, 30.0), (0.9, 60.0), (-0.7, 120.0), (1.0, 90.0), (0.94, 0.0)] {
        let hole = Kerr::new(spin).unwrap();
        let alpha = -spin * f64::to_radians(degrees).sin();
        let at = |da: f64, db: f64| {
            let (ray, path, screen) = trace(&hole, degrees, alpha + da, db);
            let point = path.at(0.3 * path.mino_total());
            let (frame, k) = frame_and_photon(&hole, &ray, &point);
            // On the axis the meridian's direction is arbitrary: a fixed direction instead.
            let phi = if degrees == 0.0 { point.azimuth } else { 0.0 };
            let s = [0.0, -phi.cos(), phi.sin()];
            (screen.transport(&frame, k, normal(k, s)), point.radius())
        };
        let (centre, r) = at(0.0, 0.0);
        for (da, db) in [(1e-5, 0.0), (0.0, 1e-5), (-7e-6, 7e-6)] {
            let (beside, _) = at(da, db);
            // On the axis a meridian and the opposite one are the same.
            let sign = if degrees == 0.0 { (beside[0] * centre[0]).signum() } else { 1.0 };
            let miss = (beside[0] - sign * centre[0]).hypot(beside[1] - sign * centre[1]);
            assert!(miss < 3e-5, "a = {spin}, r = {r}: {centre:?} {beside:?}");
        }
    }
}

/// EVPA, east of north, of light from the equatorial plane that is polarised along e_φ in the
/// frame of zero angular momentum, at the `n`-th crossing, seen face-on.
fn face_on(spin: f64, b: f64, n: usize) -> (f64, f64) {
    let hole = Kerr::new(spin).unwrap();
    let (ray, path, screen) = trace(&hole, 0.0, b, 0.0);
    let Some(time) = path.equatorial_crossings().nth(n) else { return (0.0, 0.0) };
    let point = path.at(time);
    let (frame, k) = frame_and_photon(&hole, &ray, &point);
    let [north, east] = screen.transport(&frame, k, normal(k, [0.0, 0.0, 1.0]));
    ((east / north).atan(), point.radius())
}

/// Gelles et al. 2021 (arXiv:2105.09440, abstract): seen face-on, the spin turns the polarisation
/// of the direct image by −2a/r_s² at leading order.
#[test]
fn paper_face_on_rotation_by_spin() {
    for spin in [0.3, 0.9, -0.9] {
        for b in [100.0, 300.0, 1000.0] {
            let (with, r) = face_on(spin, b, 0);
            let (without, _) = face_on(0.0, b, 0);
            let coefficient = (with - without) * r * r / spin;
            assert!((coefficient + 2.0).abs() < 2.5 / b, "a = {spin}, r = {r}: {coefficient}");
        }
    }
}

/// The same: of the subimages by ±a/√27, for slow spins and where √27 stands for the impact
/// parameter, which it is for all but the first of them.
#[test]
fn paper_face_on_rotation_of_subimages() {
    // b at which the n-th crossing is at r.
    let impact = |spin: f64, n: usize, r: f64| {
        let (mut lo, mut hi) = (5.19, if n == 1 { 6.4 } else { 5.23 });
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            let (_, at) = face_on(spin, middle, n);
            *(if at > 0.0 && at < r { &mut lo } else { &mut hi }) = middle;
        }
        lo
    };
    for spin in [0.01, -0.01] {
        for (n, sign, tolerance) in [(1, -1.0, 2e-3), (2, 1.0, 8e-3)] {
            let (b, without) = (impact(spin, n, 3000.0), impact(0.0, n, 3000.0));
            let turned = face_on(spin, b, n).0 - face_on(0.0, without, n).0;
            let coefficient = sign * turned * b / spin;
            assert!((coefficient - 1.0).abs() < tolerance, "a = {spin}, n = {n}: {coefficient}");
            if n == 2 {
                let published = sign * turned * 27f64.sqrt() / spin;
                assert!((published - 1.0).abs() < 8e-3, "a = {spin}: {published}");
            }
        }
    }
}
