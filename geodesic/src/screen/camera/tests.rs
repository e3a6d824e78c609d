use super::*;
use crate::{Observer, Outcome, Path, Quantities, Tracer};

fn camera(spin: f64, degrees: f64, radius: f64, motion: Motion) -> Camera {
    let inclination = Inclination::from_degrees(degrees).unwrap();
    Camera::new(&Kerr::new(spin).unwrap(), inclination, radius, motion).unwrap()
}

const MOTIONS: [Motion; 4] = [Motion::Static, Motion::Zamo, Motion::Keplerian, Motion::FreeFall];

/// The constants of motion obey both potentials: u'² = U(u) and (dr/dτ)² = R(r) with
/// dr/dτ from the frame.
#[test]
fn exact_constraints_in_every_frame() {
    for motion in MOTIONS {
        for (spin, degrees, radius) in [(0.9, 60.0, 7.0), (0.0, 0.0, 20.0), (-0.5, 90.0, 12.0)] {
            let camera = camera(spin, degrees, radius, motion);
            for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-1.5, 2.0)] {
                let ray = camera.ray(x, y).unwrap();
                let (u, du, a2) = (ray.position[2], ray.velocity[2], spin * spin);
                let quad = a2 - ray.eta - ray.lambda.powi(2);
                let polar = ray.eta + quad * u * u - a2 * u.powi(4);
                assert!((du * du - polar).abs() < 1e-9 * (1.0 + polar.abs()));
                let n = (1.0 + x * x + y * y).sqrt();
                let k = camera.momentum([-1.0 / n, -y / n, x / n]);
                // dr/dτ = √(ΔΣ) k_r/E.
                let hole = camera.hole;
                let scale = (hole.delta(radius) * hole.sigma(radius, u)).sqrt();
                let around = k[2] * camera.girth;
                let energy = camera.lapse + camera.drag * ray.position[0] * around;
                let rate = scale * k[0] / energy / (radius * radius);
                let value = ray.potential.value(1.0 / radius);
                assert!((rate * rate / value - 1.0).abs() < 1e-9, "{motion:?} ({x}, {y})");
            }
        }
    }
}

/// Synge 1966: a static observer at r sees the shadow of a hole without spin under the
/// half-angle ψ with sin²ψ = 27 (1 − 2/r)/r² (beyond 90° inside the photon sphere); an
/// observer in free fall sees it aberrated by v = √(2/r).
#[test]
fn paper_angular_size_of_the_shadow() {
    for r in [2.5, 4.0, 10.0, 100.0f64] {
        let sine = (27.0 * (1.0 - 2.0 / r)).sqrt() / r;
        let at_rest = if r < 3.0 { std::f64::consts::PI - sine.asin() } else { sine.asin() };
        // Aberration gathers directions ahead: cos ψ' = (cos ψ + v)/(1 + v cos ψ).
        let v = (2.0 / r).sqrt();
        let falling = ((at_rest.cos() + v) / (1.0 + v * at_rest.cos())).acos();
        for (motion, expected) in [(Motion::Static, at_rest), (Motion::FreeFall, falling)] {
            let camera = camera(0.0, 40.0, r, motion);
            let captured = |psi: f64| {
                let direction = [-psi.cos(), 0.6 * psi.sin(), 0.8 * psi.sin()];
                let ray = camera.arriving_from(direction).unwrap();
                let mut path = Path::new();
                let tracer = Tracer::new(1e-12).unwrap();
                tracer.trace(&camera.hole, &ray, Quantities::POLAR, &mut path);
                path.outcome() == Outcome::Captured
            };
            let (mut lo, mut hi) = (0.0, std::f64::consts::PI - 1e-6);
            for _ in 0..50 {
                let middle = 0.5 * (lo + hi);
                if captured(middle) { lo = middle } else { hi = middle }
            }
            assert!((lo - expected).abs() < 1e-10, "{motion:?} at {r}: {lo} {expected}");
        }
    }
}

/// Far away a static camera is Bardeen's screen: α = r x, β = r y.
#[test]
fn exact_bardeen_limit() {
    let r = 1e7;
    let camera = camera(0.9, 55.0, r, Motion::Static);
    let hole = Kerr::new(0.9).unwrap();
    let far = Observer::at_infinity(Inclination::from_degrees(55.0).unwrap());
    for (alpha, beta) in [(3.0, 4.0), (-6.0, 0.5)] {
        let (near, ideal) =
            (camera.ray(alpha / r, beta / r).unwrap(), far.ray(&hole, alpha, beta).unwrap());
        assert!((near.lambda - ideal.lambda).abs() < 1e-5);
        assert!((near.eta - ideal.eta).abs() < 1e-5);
        assert!(near.inward && near.velocity[2] * ideal.velocity[2] > 0.0);
    }
}

/// A static observer sees light from infinity blueshifted by 1/√(−g_tt), whatever its
/// direction; one in free fall radially from rest, light from straight behind
/// by 1/(1 + √(2/r)).
#[test]
fn exact_blueshifts() {
    let r = 8.0f64;
    let still = camera(0.0, 70.0, r, Motion::Static);
    for d in [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]] {
        assert!((still.blueshift(d) - 1.0 / (1.0 - 2.0 / r).sqrt()).abs() < 1e-14);
    }
    let falling = camera(0.0, 70.0, r, Motion::FreeFall);
    let behind = falling.blueshift([1.0, 0.0, 0.0]);
    assert!((behind - 1.0 / (1.0 + (2.0 / r).sqrt())).abs() < 1e-14, "{behind}");
}

/// The motions by name are those of their rates.
#[test]
fn exact_named_motions_by_their_rates() {
    let (hole, place) = (Kerr::new(0.6).unwrap(), Inclination::from_degrees(90.0).unwrap());
    let r = 9.0f64;
    // Free fall from rest at infinity: dr/dt = −√(2r(r² + a²)) Δ/A, dφ/dt = ω.
    let area = (r * r + 0.36).powi(2) - 0.36 * hole.delta(r);
    let fall = -(2.0 * r * (r * r + 0.36)).sqrt() * hole.delta(r) / area;
    for (motion, rates) in [
        (Motion::Static, [0.0; 3]),
        (Motion::Keplerian, [0.0, 0.0, 1.0 / (27.0 + 0.6)]),
        (Motion::Zamo, [0.0, 0.0, 1.2 * r / area]),
        (Motion::FreeFall, [fall, 0.0, 1.2 * r / area]),
    ] {
        let named = Camera::new(&hole, place, r, motion).unwrap().velocity;
        let moving = Camera::moving(&hole, place, r, rates).unwrap().velocity;
        for (a, b) in named.iter().zip(moving) {
            assert!((a - b).abs() < 1e-14, "{motion:?} {named:?} {moving:?}");
        }
    }
    assert!(Camera::moving(&hole, place, r, [0.0, 0.2, 0.0]).is_err());
}

/// Special relativity far from the hole, and a motion in θ as good as one in φ: light from
/// ahead is shifted by √((1 + v)/(1 − v)).
#[test]
fn exact_doppler_shift_of_a_polar_motion() {
    let (hole, place) = (Kerr::new(0.9).unwrap(), Inclination::from_degrees(90.0).unwrap());
    let (r, v) = (1e7, 0.5f64);
    let camera = Camera::moving(&hole, place, r, [0.0, v / r, 0.0]).unwrap();
    let ahead = camera.blueshift([0.0, 1.0, 0.0]);
    assert!((ahead - ((1.0 + v) / (1.0 - v)).sqrt()).abs() < 1e-6, "{ahead}");
    assert!((camera.blueshift([0.0, -1.0, 0.0]) * ahead - 1.0).abs() < 1e-6);
}

/// Turned to the right by 90° the camera looks along +e_φ, with the hole on its left; upwards,
/// along −e_θ; and clockwise by 90°, what was to its right is up.
#[test]
fn exact_pointing() {
    use std::f64::consts::FRAC_PI_2;
    let camera = camera(0.5, 80.0, 15.0, Motion::Static);
    let close = |camera: Camera, x: f64, y: f64, expected: [f64; 3]| {
        let d = camera.direction(x, y);
        let off = d.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 2e-9, "{d:?} {expected:?}");
    };
    close(camera.with_pointing(FRAC_PI_2, 0.0, 0.0), 0.0, 0.0, [0.0, 0.0, 1.0]);
    close(camera.with_pointing(FRAC_PI_2, 0.0, 0.0), -1e9, 0.0, [-1.0, 0.0, 0.0]);
    close(camera.with_pointing(0.0, FRAC_PI_2, 0.0), 0.0, 0.0, [0.0, -1.0, 0.0]);
    close(camera.with_pointing(0.0, 0.0, FRAC_PI_2), 0.0, 1e9, [0.0, 0.0, 1.0]);
    close(camera.with_pointing(0.3, 0.2, 0.1), 0.0, 0.0, {
        [-0.3f64.cos() * 0.2f64.cos(), -0.2f64.sin(), 0.3f64.sin() * 0.2f64.cos()]
    });
}

#[test]
fn impossible_cameras_are_refused() {
    let hole = Kerr::new(0.9).unwrap();
    let equator = Inclination::from_degrees(90.0).unwrap();
    assert!(Camera::new(&hole, equator, 1.9, Motion::Static).is_err());
    assert!(Camera::new(&hole, equator, 1.9, Motion::Zamo).is_ok());
    assert!(Camera::new(&hole, equator, 1.3, Motion::Zamo).is_err());
    assert!(Camera::new(&hole, equator, 1.5, Motion::Keplerian).is_err());
    assert!(Camera::new(&hole, equator, f64::NAN, Motion::Zamo).is_err());
}

/// E = α + ω√g_φφ k_φ in the frame of zero angular momentum (Bardeen, Press & Teukolsky 1972): where it is not positive
/// light comes from the horizon, as light of little energy does.
#[test]
fn exact_light_without_energy_at_infinity_comes_from_the_horizon() {
    let (spin, r) = (0.95f64, 1.7f64);
    let hole = Kerr::new(spin).unwrap();
    let camera = camera(spin, 90.0, r, Motion::Zamo);
    let delta = r * r - 2.0 * r + spin * spin;
    let area = (r * r + spin * spin).powi(2) - spin * spin * delta;
    let (lapse, drag) = (r * (delta / area).sqrt(), 2.0 * spin / area.sqrt());
    let (mut dark, mut path) = (0, Path::new());
    let mut beams = crate::footprint::Beams::default();
    let mut look = |direction: [f64; 3]| {
        let ray = camera.arriving_from(direction).unwrap();
        Tracer::new(1e-10).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
        let (x, y) = (direction[2] / -direction[0], -direction[1] / -direction[0]);
        beams = crate::footprint::of_camera(&camera, &[x], &[y], 1e-10, 1).unwrap();
        (ray.is_from_horizon, path.outcome())
    };
    // k = −direction.
    for energy in [-0.2, -1e-3, -1e-9, 0.0, 1e-12, 1e-9, 1e-6, 1e-3] {
        let around = (lapse - energy) / drag;
        let rest = (1.0 - around * around).sqrt();
        for k in 0..12 {
            let (y, x) = (0.1 + 0.5 * f64::from(k)).sin_cos();
            let (from_horizon, outcome) = look([rest * x, rest * y, around]);
            assert_eq!(from_horizon, energy <= 0.0, "{energy} {k}");
            assert_eq!(outcome, Outcome::Captured, "{energy} {k}");
            dark += usize::from(from_horizon);
        }
    }
    assert_eq!(dark, 48);
    assert!(beams.sky.iter().all(Option::is_none));
}

/// A picture from inside the ergosphere has light and darkness, traced in blocks of any kind.
#[test]
fn exact_blocks_from_inside_the_ergosphere_agree_with_single_rays() {
    use crate::{BlockRequest, BlockTracer, Integrator, RayBlock, View};
    struct Nothing;
    impl crate::RayVisitor for Nothing {
        fn take(
            &mut self,
            _: usize,
            _: &crate::TracedRay,
            _: &[crate::PlaneCrossing],
            _: Option<crate::PathOfRay<'_>>,
        ) -> Result<(), Error> {
            Ok(())
        }
    }
    let camera = camera(0.95, 90.0, 1.7, Motion::Zamo).with_pointing(3.1, 0.0, 0.0);
    let (x, y): (Vec<f64>, Vec<f64>) =
        (0..400).map(|k| (0.17 * f64::from(k % 20) - 1.6, 0.17 * f64::from(k / 20) - 1.6)).unzip();
    let request = BlockRequest {
        crossings: 2,
        exit: true,
        beams: true,
        half_orbits: Some(1),
        ..BlockRequest::default()
    };
    for integrator in [Integrator::TaylorMino, Integrator::Elliptic] {
        let tracer = BlockTracer::new(camera.hole, View::Camera(camera), integrator, 1e-8).unwrap();
        let mut block = RayBlock::default();
        tracer.trace(&x, &y, &request, &mut block, &mut Nothing).unwrap();
        let mut seen = [0; 2];
        for (ray, (x, y)) in block.rays().iter().zip(x.iter().zip(&y)) {
            if camera.ray(*x, *y).unwrap().is_from_horizon {
                assert_eq!(
                    (ray.outcome, ray.crossing_count, ray.exit),
                    (Outcome::Captured, 0, None)
                );
                assert_eq!(View::Camera(camera).blueshift(*x, *y), None);
                seen[0] += 1;
            }
            seen[1] += usize::from(ray.outcome == Outcome::Escaped);
        }
        assert!(seen[0] > 20 && seen[1] > 20, "{seen:?}");
    }
}
