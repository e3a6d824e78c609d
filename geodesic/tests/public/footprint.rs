//! Beams of rays against differences of neighbouring rays and against closed forms.

use crate::{at_infinity, at_radius, inclination};
use kerrlight_geodesic::footprint::{self, Disc, Ellipse, Sky};
use kerrlight_geodesic::quadrature::gauss_legendre;
use kerrlight_geodesic::{Camera, Kerr, Motion, Outcome, Path, Quantities, Ray, Tracer};

/// Direction at infinity (0 if captured), then r and φ of the first crossing (0 if none).
fn ends(hole: &Kerr, ray: &Ray) -> [f64; 5] {
    let mut path = Path::new();
    Tracer::new(1e-14).unwrap().trace(hole, ray, Quantities::ALL, &mut path);
    let escaped = path.outcome() == Outcome::Escaped;
    let n = if escaped { path.at(path.mino_total()).direction } else { [0.0; 3] };
    let hit = path.equatorial_crossings().next().map(|time| path.at(time));
    // Far out a crossing moves too fast for differences.
    let hit = hit.filter(|p| p.radius() < 100.0);
    let [r, phi] = hit.map_or([0.0; 2], |p| [p.radius(), p.azimuth]);
    [n[0], n[1], n[2], r, phi]
}

/// Five-point differences with respect to both coordinates of the screen: h⁴ times a fifth
/// derivative is left out, and 1e-14/h of rounding.
fn differences(h: f64, at: impl Fn(f64, f64) -> [f64; 5]) -> [[f64; 5]; 2] {
    [[h, 0.0], [0.0, h]].map(|[u, v]| {
        let [up, down] = [at(u, v), at(-u, -v)];
        let [up2, down2] = [at(2.0 * u, 2.0 * v), at(-2.0 * u, -2.0 * v)];
        core::array::from_fn(|k| (8.0 * (up[k] - down[k]) - (up2[k] - down2[k])) / (12.0 * h))
    })
}

fn compare(what: &str, sky: Option<Sky>, disc: Option<&Disc>, expected: [[f64; 5]; 2]) {
    for (k, expected) in expected.iter().enumerate() {
        let n = sky.map_or([0.0; 3], |sky| [sky.by_first, sky.by_second][k]);
        let hit = disc.map_or([0.0; 2], |disc| [disc.radius_by[k], disc.azimuth_by[k]]);
        let found = [n[0], n[1], n[2], hit[0], hit[1]];
        for (found, expected) in found.iter().zip(expected) {
            let miss = (found - expected).abs() / expected.abs().max(1.0);
            assert!(miss < 1e-9, "{what}: {found} {expected}");
        }
    }
}

fn near(hits: &[Disc]) -> Option<&Disc> {
    hits.first().filter(|disc| disc.radius < 100.0)
}

#[test]
fn exact_jacobians_of_the_screen() {
    let cases = [
        (0.9, 60.0, -6.0, 2.0, f64::INFINITY),
        (0.9, 60.0, 1.0, 2.0, f64::INFINITY),
        (0.5, 0.0, 8.0, 1.0, f64::INFINITY),
        (0.5, 90.0, 5.0, 6.0, f64::INFINITY),
        (-0.998, 17.0, 9.0, -3.0, 100.0),
        // Leaves within 1e-2 of the pole opposite to the observer's.
        (0.5, 0.0, 500.0, 100.0, f64::INFINITY),
    ];
    for (spin, degrees, alpha, beta, radius) in cases {
        let hole = Kerr::new(spin).unwrap();
        let observer = at_radius(degrees, radius);
        let beams = footprint::of_screen(&hole, &observer, &[alpha], &[beta], 1e-14, 1).unwrap();
        let h = 1e-3 * f64::hypot(alpha, beta);
        let at = |u: f64, v: f64| ends(&hole, &observer.ray(&hole, alpha + u, beta + v).unwrap());
        let what = format!("a {spin} i {degrees} ({alpha}, {beta})");
        compare(&what, beams.sky[0], near(beams.of(0)), differences(h, at));
        assert_eq!(beams.sky[0].is_some(), beams.outcome[0] == Outcome::Escaped);
        assert!(beams.of(1).is_empty());
    }
}

#[test]
fn exact_jacobians_of_a_camera() {
    let hole = Kerr::new(0.8).unwrap();
    for motion in [Motion::Static, Motion::Zamo, Motion::Keplerian, Motion::FreeFall] {
        let camera = Camera::new(&hole, inclination(70.0), 12.0, motion).unwrap();
        for (x, y) in [(0.9, 0.4), (-0.8, -0.7), (0.1, 0.2)] {
            let beams = footprint::of_camera(&camera, &[x], &[y], 1e-14, 1).unwrap();
            let at = |u: f64, v: f64| ends(&hole, &camera.ray(x + u, y + v).unwrap());
            let what = format!("{motion:?} ({x}, {y})");
            compare(&what, beams.sky[0], near(beams.of(0)), differences(1e-4, at));
        }
    }
}

/// Total deflection of Schwarzschild light with perihelion 1/w₀, and its impact parameter: the
/// orbit equation (Darwin 1959) with w = w₀ sin χ, which makes the integrand smooth.
fn deflection(w0: f64) -> (f64, f64) {
    let integrand = |chi: f64| {
        let w = w0 * chi.sin();
        (w0 * (1.0 + chi.sin()) / (w0 + w - 2.0 * (w0 * w0 + w0 * w + w * w))).sqrt()
    };
    let half = core::f64::consts::FRAC_PI_2;
    let sum: f64 = gauss_legendre(120).iter().map(|(x, w)| w * half * integrand(half * x)).sum();
    (2.0 * sum - core::f64::consts::PI, 1.0 / (w0 * (1.0 - 2.0 * w0).sqrt()))
}

/// Without spin a patch of screen is stretched by |dα̂/db| along the plane of the ray, and by
/// |sin α̂|/b across it.
#[test]
fn exact_footprint_of_the_schwarzschild_deflection() {
    let hole = Kerr::new(0.0).unwrap();
    for (degrees, tilt) in [(60.0, 0.3), (0.0, 2.0), (90.0, -1.2)] {
        let observer = at_infinity(degrees);
        for w0 in [0.02, 0.15, 0.29, 0.32] {
            let (angle, b) = deflection(w0);
            let h = 2e-3 * (1.0 / 3.0 - w0).min(w0);
            let slope = |f: &dyn Fn(f64) -> f64| {
                let d = |h: f64| f(w0 + h) - f(w0 - h);
                (8.0 * d(h) - d(2.0 * h)) / (12.0 * h)
            };
            let along = slope(&|w| deflection(w).0) / slope(&|w| deflection(w).1);
            let across = angle.sin() / b;
            let (sin, cos) = f64::sin_cos(tilt);
            let beams =
                footprint::of_screen(&hole, &observer, &[b * cos], &[b * sin], 1e-14, 0).unwrap();
            let ellipse = beams.sky[0].unwrap().ellipse();
            let (major, minor) = (along.abs().max(across.abs()), along.abs().min(across.abs()));
            assert!((ellipse.semi_major / major - 1.0).abs() < 1e-8, "{w0}");
            assert!((ellipse.semi_minor / minor - 1.0).abs() < 1e-8, "{w0}");
            let area = along * across;
            assert!((ellipse.magnification / area - 1.0).abs() < 1e-8, "{w0}: {ellipse:?} {area}");
        }
    }
}

/// Far away nothing is bent: the sky is seen as it is, upright.
#[test]
fn exact_flat_limit_of_a_camera() {
    let hole = Kerr::new(0.7).unwrap();
    let camera = Camera::new(&hole, inclination(50.0), 1e7, Motion::Static).unwrap();
    for (x, y) in [(0.7f64, -0.4f64), (-0.2, 0.9)] {
        let beams = footprint::of_camera(&camera, &[x], &[y], 1e-12, 0).unwrap();
        let sky = beams.sky[0].unwrap();
        let solid_angle = (1.0 + x * x + y * y).powf(-1.5);
        assert!((sky.ellipse().magnification / solid_angle - 1.0).abs() < 1e-5);
        // The lens stretches along the direction to the axis less than across it.
        let expected = 1.0 / (1.0 + x * x + y * y).sqrt();
        assert!((sky.ellipse().semi_major / expected - 1.0).abs() < 1e-5);
    }
}

#[test]
fn exact_ellipses_of_maps() {
    let turned = |angle: f64, [long, short]: [f64; 2], screen: f64| {
        // Rotation by `angle` of the stretching by (long, short) of a screen turned by `screen`.
        let (s, c) = angle.sin_cos();
        let (t, d) = screen.sin_cos();
        let map = |[x, y]: [f64; 2]| {
            let (u, v) = (long * (d * x + t * y), short * (d * y - t * x));
            [c * u - s * v, s * u + c * v]
        };
        Ellipse::of_map([map([1.0, 0.0]), map([0.0, 1.0])])
    };
    for angle in [-1.5, -0.4, 0.0, 0.9, 1.5] {
        for short in [0.5, -0.5, 1e-9] {
            let ellipse = turned(angle, [3.0, short], 0.7);
            assert!((ellipse.semi_major - 3.0).abs() < 1e-14);
            assert!((ellipse.semi_minor - f64::abs(short)).abs() < 1e-14);
            assert!((ellipse.orientation - angle).abs() < 1e-14, "{ellipse:?} {angle}");
            assert!((ellipse.magnification - 3.0 * short).abs() < 1e-14);
        }
    }
    let nothing = Ellipse::of_map([[0.0; 2]; 2]);
    assert_eq!((nothing.semi_major, nothing.semi_minor), (0.0, 0.0));
}

/// Close to face-on and far out the plane is seen undistorted.
#[test]
fn exact_far_disc() {
    let hole = Kerr::new(0.6).unwrap();
    let observer = at_infinity(0.0);
    let beams = footprint::of_screen(&hole, &observer, &[3e5], &[4e5], 1e-12, 1).unwrap();
    let ellipse = beams.of(0)[0].ellipse();
    assert!((ellipse.semi_major - 1.0).abs() < 1e-5, "{ellipse:?}");
    assert!((ellipse.semi_minor - 1.0).abs() < 1e-5);
    assert!((ellipse.magnification - 1.0).abs() < 1e-5);
}

#[test]
fn what_is_not_allowed_is_named() {
    let hole = Kerr::new(0.6).unwrap();
    let observer = at_infinity(10.0);
    assert!(footprint::of_screen(&hole, &observer, &[1.0], &[], 1e-9, 1).is_err());
    assert!(footprint::of_screen(&hole, &observer, &[1.0], &[f64::NAN], 1e-9, 1).is_err());
    let text = footprint::of_screen(&hole, &observer, &[1.0], &[2.0], 1.0, 1).unwrap_err();
    assert!(text.to_string().contains("tolerance = 1"), "{text}");
    let camera = Camera::new(&hole, inclination(10.0), 9.0, Motion::Zamo).unwrap();
    assert!(footprint::of_camera(&camera, &[f64::INFINITY], &[0.0], 1e-9, 1).is_err());
    assert!(camera.arriving_from([2.0, 0.0, 0.0]).is_err());
}
