//! Polarised light against closed forms, published formulas and other codes.

use super::*;
use kerrlight_geodesic::flow::{keplerian_redshift, rotating_redshift};
use kerrlight_geodesic::vector::{cross, dot, norm};
use kerrlight_geodesic::{
    Inclination, Kerr, Observer, Path, PathPoint, Quantities, Ray, ScreenPoint, Tracer, ZamoFrame,
};
use std::f64::consts::{FRAC_PI_2, PI};

const SPINS: [f64; 5] = [0.0, 0.5, 0.94, -0.94, 1.0];

/// Gas without angular momentum, at rest in its frame.
const STILL: Gas = Gas([1.0, 0.0, 0.0, 0.0]);

/// Gas that moves in the equatorial plane of the frame along cos χ e_r + sin χ e_φ: the fluid of Narayan et al. 2021, eq. 8,
/// and Gelles et al. 2021.
fn boosted(speed: f64, chi: f64) -> Gas {
    let (sin, cos) = chi.sin_cos();
    Gas::with_velocity([speed * cos, 0.0, speed * sin]).unwrap()
}

/// A ray at its first crossing of the equatorial plane.
struct Hit {
    hole: Kerr,
    ray: Ray,
    screen: ScreenPoint,
    point: PathPoint,
    frame: ZamoFrame,
    photon: [f64; 4],
}

fn hit_at(spin: f64, degrees: f64, alpha: f64, beta: f64, part: Option<f64>) -> Hit {
    let hole = Kerr::new(spin).unwrap();
    let inclination = Inclination::from_degrees(degrees).unwrap();
    let ray = Observer::at_infinity(inclination).ray(&hole, alpha, beta).unwrap();
    let mut path = Path::new();
    Tracer::new(1e-13).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
    let time = match part {
        Some(part) => part * path.mino_total(),
        None => path.equatorial_crossings().next().unwrap(),
    };
    let point = path.at(time);
    let frame = ZamoFrame::of(&hole, &point).unwrap();
    let photon = frame.covariant(point.momentum(&hole, ray.lambda));
    let screen = ScreenPoint::new(&hole, inclination.sin(), alpha, beta);
    Hit { hole, ray, screen, point, frame, photon }
}

fn hit(spin: f64, degrees: f64, alpha: f64, beta: f64) -> Hit {
    hit_at(spin, degrees, alpha, beta, None)
}

impl Hit {
    fn view(&self, gas: Gas, field: MagneticField) -> SynchrotronView {
        let field = field.at(&self.frame);
        view(&self.frame, &self.screen, self.photon, gas, field).unwrap()
    }
}

fn field(vertical: f64, radial: f64, toroidal: f64) -> MagneticField {
    MagneticField { vertical, radial, toroidal }
}

/// χ of a view, in (−π/2, π/2].
fn evpa(view: &SynchrotronView) -> f64 {
    0.5 * view.direction[1].atan2(view.direction[0])
}

/// The difference of two position angles.
fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b) / PI;
    PI * (d - d.round())
}

/// g by the four-velocities is g by the closed forms of the flows.
#[test]
fn exact_redshifts() {
    for spin in SPINS {
        for (degrees, alpha, beta) in [(60.0, -9.0, 3.0), (17.0, 7.0, -6.0), (90.0, 8.0, 1.0)] {
            let hit = hit(spin, degrees, alpha, beta);
            let gas = Gas::keplerian(&hit.hole, &hit.frame).unwrap();
            let g = hit.view(gas, field(1.0, 0.0, 0.0)).redshift;
            let expected = keplerian_redshift(&hit.hole, hit.point.radius(), hit.ray.lambda);
            assert!((g / expected.unwrap() - 1.0).abs() < 1e-11, "a = {spin}");
            let hit = hit_at(spin, degrees, alpha, beta, Some(0.35));
            let omega = [0.01, -0.02, 0.03];
            let gas = Gas::rotating(&hit.frame, &hit.point, omega).unwrap();
            let g = hit.view(gas, field(1.0, 0.0, 0.0)).redshift;
            let expected = rotating_redshift(&hit.hole, &hit.point, omega).unwrap();
            assert!((g / expected - 1.0).abs() < 1e-11, "a = {spin}: {g} {expected}");
        }
    }
}

/// A contravariant velocity, and the same by its components in the frame.
#[test]
fn exact_boyer_lindquist_components() {
    let hit = hit(0.7, 50.0, -7.0, 4.0);
    let r = hit.point.radius();
    let omega = 1.0 / (r.powf(1.5) + 0.7);
    let (gtt, gtp, gpp) = (-1.0 + 2.0 / r, -1.4 / r, r * r + 0.49 + 0.98 / r);
    let time = 1.0 / (-(gtt + 2.0 * gtp * omega + gpp * omega * omega)).sqrt();
    let model = field(0.3, -0.5, 0.8);
    let momentum = hit.point.momentum(&hit.hole, hit.ray.lambda);
    let velocity = [time, 0.0, 0.0, time * omega];
    let seen = view_at(&hit.hole, &hit.screen, [r, 0.0], momentum, velocity, &model).unwrap();
    let expected = hit.view(Gas::keplerian(&hit.hole, &hit.frame).unwrap(), model);
    assert!((seen.redshift - expected.redshift).abs() < 1e-12);
    assert!(apart(evpa(&seen), evpa(&expected)).abs() < 1e-12);
    let inside = view_at(&hit.hole, &hit.screen, [1.5, 0.0], momentum, velocity, &model);
    assert_eq!(inside, None);
}

/// Seen face-on the pattern turns with the position on the ring, for every flow and field; of gas at
/// rest without spin, a toroidal field makes radial ticks, a vertical or radial one tangential ticks.
#[test]
fn exact_face_on_symmetry() {
    for spin in SPINS {
        for model in [field(1.0, 0.0, 0.0), field(0.0, 1.0, 0.0), field(0.3, 0.5, -0.8)] {
            let twist = |position: f64| {
                // The position angle of the point, east of north.
                let (east, north) = position.sin_cos();
                let hit = hit(spin, 0.0, -7.0 * east, 7.0 * north);
                let seen = hit.view(boosted(0.4, 1.9), model);
                (apart(evpa(&seen), position), seen)
            };
            let (first, seen) = twist(0.3);
            for position in [1.0, 2.5, 4.0, 6.1] {
                let (angle, other) = twist(position);
                assert!(apart(angle, first).abs() < 1e-10, "a = {spin}: {angle} {first}");
                assert!((other.redshift - seen.redshift).abs() < 1e-11);
                assert!((other.sin_pitch - seen.sin_pitch).abs() < 1e-10);
            }
        }
    }
    for (model, twist) in [
        (field(0.0, 0.0, 1.0), 0.0),
        (field(1.0, 0.0, 0.0), FRAC_PI_2),
        (field(0.0, 1.0, 0.0), FRAC_PI_2),
    ] {
        for position in [0.3f64, 2.5, 4.0] {
            let hit = hit(0.0, 0.0, -7.0 * position.sin(), 7.0 * position.cos());
            let at_rest = [0.0, 0.0, hit.frame.orbital_velocity(0.0)];
            let seen = hit.view(Gas::with_velocity(at_rest).unwrap(), model);
            assert!(apart(evpa(&seen), position + twist).abs() < 1e-11, "{model:?}");
        }
    }
}

/// Far from the hole: E along k × B in flat space, whatever the spin.
#[test]
fn exact_flat_space_far_away() {
    let (x, y) = (3e7, -2e7);
    for spin in SPINS {
        for degrees in [20.0f64, 75.0, 130.0] {
            let (s, c) = degrees.to_radians().sin_cos();
            let hit = hit(spin, degrees, y, -x * c);
            let size = f64::hypot(x, y);
            let (er, ep) = ([x / size, y / size, 0.0], [-y / size, x / size, 0.0]);
            for model in [field(1.0, 0.0, 0.0), field(0.0, 1.0, 0.0), field(0.4, -0.5, 0.7)] {
                let b: [f64; 3] = std::array::from_fn(|i| {
                    let z = if i == 2 { model.vertical } else { 0.0 };
                    model.radial * er[i] + model.toroidal * ep[i] + z
                });
                let k = [s, 0.0, c];
                let e = cross(k, b);
                // North (−cos i, 0, sin i), east −ŷ.
                let expected = (-e[1]).atan2(-c * e[0] + s * e[2]);
                let seen = hit.view(STILL, model);
                assert!(apart(evpa(&seen), expected).abs() < 1e-6, "a = {spin}, i = {degrees}");
                let strength = norm(b);
                assert!((seen.cos_pitch - dot(k, b) / strength).abs() < 1e-6);
                assert!((seen.sin_pitch - norm(e) / strength).abs() < 1e-6);
                assert!((seen.slant * c.abs() - 1.0).abs() < 1e-6);
            }
        }
    }
}

/// Narayan et al. 2021 (arXiv:2105.01804), eqs. 5–28, with the exact impact parameter in place of
/// Beloborodov's: k by the angles in the plane of the ray, Lorentz matrices, f = k × B/|k|, and the
/// rotation by κ = r[(kᵗfʳ − kʳfᵗ) + …] of a hole without spin. Returns (e_α, e_β) and I.
fn narayan(hit: &Hit, [alpha, beta]: [f64; 2], speed: f64, chi: f64, b: [f64; 3]) -> [f64; 3] {
    let r = hit.point.radius();
    let lapse = (1.0 - 2.0 / r).sqrt();
    let impact = alpha.hypot(beta);
    // Axes r, φ, z. The photon leaves under the angle whose sine is b √(1 − 2/r)/r with e_r.
    let sine = impact * lapse / r;
    let k_phi = hit.ray.lambda / r;
    let k_z = (impact * impact - hit.ray.lambda.powi(2)).max(0.0).sqrt() / r;
    let k = [1.0 / lapse, (1.0 - sine * sine).sqrt() / lapse, k_phi, k_z];
    let gamma = 1.0 / (1.0 - speed * speed).sqrt();
    let boost = |v: [f64; 4], speed: f64| {
        let (s, c) = chi.sin_cos();
        let along = v[1] * c + v[2] * s;
        let more = (gamma - 1.0) * along - gamma * speed * v[0];
        [gamma * (v[0] - speed * along), v[1] + c * more, v[2] + s * more, v[3]]
    };
    let kf = boost(k, speed);
    let f = cross([kf[1], kf[2], kf[3]], b).map(|x| x / kf[0]);
    let f = boost([0.0, f[0], f[1], f[2]], -speed);
    let (k_theta, f_theta) = (-k[3], -f[3]);
    let k1 = r * (k[0] * f[1] - k[1] * f[0]);
    let k2 = -r * (k[2] * f_theta - k_theta * f[2]);
    let (nu, norm) = (-alpha, impact * impact);
    let e = [(beta * k2 - nu * k1) / norm, (beta * k1 + nu * k2) / norm];
    let intensity = kf[0].powi(-4) * (e[0] * e[0] + e[1] * e[1]) * kf[0] / kf[3];
    [e[0], e[1], intensity]
}

#[test]
fn paper_ring_without_spin() {
    let law = PowerLaw::new(1.0, None).unwrap();
    for (degrees, alpha, beta) in
        [(20.0, 5.0, -3.0), (20.0, -6.0, 1.0), (70.0, -7.0, -0.5), (50.0, 6.0, 3.0)]
    {
        let hit = hit(0.0, degrees, alpha, beta);
        // Outgoing rays only, as in the paper.
        assert!(hit.photon[1] > 0.0);
        for (speed, chi) in [(0.0, 0.0), (0.3, -FRAC_PI_2), (0.4, -2.6), (0.7, 2.0)] {
            for [br, bp, bz] in [[0.0, 0.0, 1.0], [0.87, 0.5, 0.0], [0.3, -0.5, 0.8]] {
                let [ea, eb, intensity] = narayan(&hit, [alpha, beta], speed, chi, [br, bp, bz]);
                let seen = hit.view(boosted(speed, chi), field(bz, br, bp));
                let layer = law.of_layer(&seen).unwrap();
                assert!((layer.i / intensity - 1.0).abs() < 1e-9, "{} {intensity}", layer.i);
                let expected = (-ea).atan2(eb);
                assert!(apart(layer.evpa(), expected).abs() < 1e-9, "{seen:?} {expected}");
                assert!((layer.linear() / layer.i - 0.75).abs() < 1e-12);
            }
        }
    }
}

/// The Julia package Krang (test/polarization): a = 0.01, i = 0.01°, (α, β) = (5, 5), vertical
/// field, gas at rest: χ = −3π/4 to 1e-3.
#[test]
fn code_krang_vertical_field() {
    let hit = hit(0.01, 0.01, 5.0, 5.0);
    let seen = hit.view(STILL, field(1.0, 0.0, 0.0));
    assert!(apart(evpa(&seen), -0.75 * PI).abs() < 1e-3, "{}", evpa(&seen));
}

/// The Python script published with Gelles et al. 2021 (`getevec`, boost 0.4 towards χ, α_ν = 1, times
/// the ℓ_p = p^t/|p^z| that it has in a comment), fed with the radius of the crossing: I for |B| = 1
/// and EVPA.
#[test]
fn code_gelles_rings_with_spin() {
    let law = PowerLaw::new(1.0, None).unwrap();
    for ([spin, degrees, chi], model, [alpha, beta], [intensity, angle]) in [
        (
            [0.94, 60.0, -120.0],
            field(0.3, 0.6, 0.7),
            [-6.1875, 2.0625],
            [0.08961506342820157, 2.8153515583442115],
        ),
        (
            [0.94, 60.0, -120.0],
            field(0.3, 0.6, 0.7),
            [4.3125, 5.4375],
            [0.5138155209922454, 1.7219446055438605],
        ),
        (
            [0.5, 17.0, -150.0],
            field(0.0, 0.87, 0.5),
            [-6.1875, 5.0625],
            [0.2055422089702871, 2.9580709497826376],
        ),
        (
            [0.5, 17.0, -150.0],
            field(0.0, 0.87, 0.5),
            [5.0625, -3.9375],
            [0.16118553530270338, -0.14869240332896536],
        ),
    ] {
        let hit = hit(spin, degrees, alpha, beta);
        let seen = hit.view(boosted(0.4, f64::to_radians(chi)), model);
        let layer = law.of_layer(&seen).unwrap() * seen.field.powi(-2);
        assert!((layer.i / intensity - 1.0).abs() < 1e-9, "a = {spin}: {}", layer.i);
        assert!(apart(layer.evpa(), angle).abs() < 1e-9, "a = {spin}: {}", layer.evpa());
    }
}

/// The picture from below is the mirror image of that from above where the field is mirrored
/// (an axial vector), and that of a hole that turns the other way likewise.
#[test]
fn exact_mirrors() {
    let law = PowerLaw::new(0.7, Some(200.0)).unwrap();
    let seen = |spin: f64, degrees: f64, alpha: f64, beta: f64, spin_speed: f64, b: [f64; 3]| {
        let hit = hit(spin, degrees, alpha, beta);
        let gas = Gas::with_velocity([-0.2, 0.0, spin_speed]).unwrap();
        law.of_layer(&hit.view(gas, field(b[0], b[1], b[2]))).unwrap()
    };
    for spin in [0.0, 0.5, 0.94, 1.0] {
        let above = seen(spin, 40.0, -5.0, 4.0, 0.5, [0.3, 0.7, -0.6]);
        // Reflected at the equatorial plane: B_z stays, B_r and B_φ change sign, and V.
        let below = seen(spin, 140.0, -5.0, -4.0, 0.5, [0.3, -0.7, 0.6]);
        // Reflected at the meridian of the observer: B_φ stays.
        let other = seen(-spin, 40.0, 5.0, 4.0, -0.5, [-0.3, -0.7, -0.6]);
        for mirrored in [below, other] {
            assert!((mirrored.i / above.i - 1.0).abs() < 1e-9, "a = {spin}");
            assert!((mirrored.q - above.q).abs() < 1e-9 * above.i);
            assert!((mirrored.u + above.u).abs() < 1e-9 * above.i);
            assert!((mirrored.v + above.v).abs() < 1e-9 * above.i);
        }
        assert!(above.u.abs() > 0.01 * above.i && above.v.abs() > 1e-4 * above.i);
    }
}

/// Off the plane and beside the axis nothing breaks: the direction of a field that is smooth there is
/// that of the neighbouring ray on the other side.
#[test]
fn exact_across_the_axis() {
    for spin in SPINS {
        let across = |alpha: f64| {
            let hit = hit_at(spin, 60.0, alpha, 6.0, Some(0.55));
            hit.view(STILL, field(1.0, 0.0, 0.0))
        };
        let [left, middle, right] = [-1e-7, 0.0, 1e-7].map(across);
        for side in [left, right] {
            assert!(apart(evpa(&side), evpa(&middle)).abs() < 1e-6, "a = {spin}");
            assert!((side.sin_pitch - middle.sin_pitch).abs() < 1e-6);
        }
    }
}

#[test]
fn impossible_input_is_refused() {
    assert!(PowerLaw::new(-0.4, None).is_err());
    assert!(PowerLaw::new(f64::NAN, None).is_err());
    assert!(PowerLaw::new(1.0, Some(0.0)).is_err());
    assert!(field(0.0, 0.0, 0.0).check().is_err());
    assert!(field(1.0, f64::NAN, 0.0).check().is_err());
    assert!(field(1.0, 0.0, -0.5).check().is_ok());
    let hit = hit(0.0, 60.0, -9.0, 3.0);
    assert_eq!(Gas::with_velocity([0.8, 0.0, 0.8]), None);
    let nowhere = view(&hit.frame, &hit.screen, [f64::NAN; 4], STILL, [1.0, 0.0, 0.0]);
    assert_eq!(nowhere, None);
    // Without a field there is no light, and no NaN.
    let dark = view(&hit.frame, &hit.screen, hit.photon, STILL, [0.0; 3]).unwrap();
    let law = PowerLaw::new(1.0, Some(100.0)).unwrap();
    assert_eq!(law.emissivity(&dark), Stokes::default());
}
