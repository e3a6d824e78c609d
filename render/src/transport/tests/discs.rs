//! Matter that plunges from the inner edge of a disc, against closed forms and both ways to trace.

use super::*;
use crate::emission::disc::{DiscModel, Photon};
use crate::polarization::Gas;
use crate::scene::{Disc, Plunging};
use kerrlight_geodesic::{Kerr, ZamoFrame, orbits, plunge::Plunge, vector::dot};

const LAW: Plunging = Plunging { intensity: 0.7, exponent: 1.5 };

pub fn disc(plunging: Option<Plunging>) -> Disc {
    Disc {
        inner_edge: None,
        outer_edge: 12.0,
        peak_intensity: 1.0,
        opaque: true,
        peak_temperature_k: None,
        plunging,
        color: [1.0; 3],
    }
}

fn with_disc(set: &[&str], plunging: Option<Plunging>) -> Scene {
    let mut scene = scene(set);
    scene.disc = Some(disc(plunging));
    scene
}

/// Across the innermost stable orbit g has no step, whichever way light goes: uʳ vanishes there
/// like the power 3/2 of the distance.
#[test]
fn exact_redshift_is_continuous_at_the_innermost_stable_orbit() {
    for a in [-1.0, -0.5, 0.0, 0.5, 0.9, 0.998] {
        let hole = Kerr::new(a).unwrap();
        let model = DiscModel::new(&disc(Some(LAW)), &hole);
        let isco = orbits::isco(&hole);
        for outward in [true, false] {
            let photon = Photon { lambda: 0.8, eta: 2.0, outward };
            let at = |part: f64| model.redshift(isco * (1.0 + part), &photon);
            assert!(model.plunges_at(isco * (1.0 - 1e-8)) && !model.plunges_at(isco));
            let (inside, edge, outside) = (at(-1e-8), at(0.0), at(1e-8));
            assert!((inside / outside - 1.0).abs() < 1e-6, "a = {a}: {inside} {outside}");
            assert!((edge / outside - 1.0).abs() < 1e-6, "a = {a}: {edge} {outside}");
        }
    }
}

/// At the horizon 1/g = (P P' + √R √R')/(r²Δ) − … of outgoing light diverges like 2PP'/(r²Δ), with
/// P = E(r² + a²) − aL of the matter and P' = r² + a² − aλ of the photon; ingoing light keeps its
/// energy.
#[test]
fn exact_redshift_towards_the_horizon() {
    for a in [-0.9, 0.0, 0.5, 0.94] {
        let hole = Kerr::new(a).unwrap();
        let model = DiscModel::new(&disc(Some(LAW)), &hole);
        let flow = Plunge::new(&hole);
        for distance in [1e-5, 1e-7] {
            let r = hole.horizon() * (1.0 + distance);
            let (lambda, square) = (0.8, r * r + a * a);
            let g = |outward| model.redshift(r, &Photon { lambda, eta: 2.0, outward });
            let matter = flow.energy() * square - a * flow.angular_momentum();
            let expected = r * r * hole.delta(r) / (2.0 * matter * (square - a * lambda));
            let miss = (g(true) / expected - 1.0).abs();
            assert!(miss < 30.0 * distance, "a = {a}: {} {expected}", g(true));
            assert!((0.1..10.0).contains(&g(false)), "a = {a}: {}", g(false));
        }
    }
}

/// g is −1/(k·u) with the matter's four-velocity and the photon's momentum in the frame of zero
/// angular momentum.
#[test]
fn exact_redshift_is_the_product_of_momentum_and_velocity() {
    for a in [-0.7, 0.0, 0.9] {
        let hole = Kerr::new(a).unwrap();
        let model = DiscModel::new(&disc(Some(LAW)), &hole);
        for part in [0.1, 0.5, 0.9] {
            let r = hole.horizon() + part * (orbits::isco(&hole) - hole.horizon());
            let frame = ZamoFrame::at(&hole, r, 1.0, 0.0).unwrap();
            let Gas(u) = Gas::of_velocity(&frame, model.plunging_velocity(r).unwrap());
            let (lambda, eta): (f64, f64) = (-1.1, 3.0);
            let sum = r * r + a * a - a * lambda;
            let carter = eta + (lambda - a).powi(2);
            let radial = (sum * sum - hole.delta(r) * carter).sqrt() / hole.delta(r);
            for (outward, sign) in [(true, 1.0), (false, -1.0)] {
                let k = frame.covariant([-1.0, sign * radial, eta.sqrt(), lambda]);
                let energy = u[0] * k[0] - dot([u[1], u[2], u[3]], [k[1], k[2], k[3]]);
                let g = model.redshift(r, &Photon { lambda, eta, outward });
                assert!((g * energy - 1.0).abs() < 1e-10, "a = {a}, r = {r}: {g} {energy}");
            }
        }
    }
}

/// Around a hole without spin E² = 8/9, L = 2√3 and uʳ = −(6/r − 1)^{3/2}/3 (Cunningham 1975): the
/// light of a captured ray moves outward, and g from its impact parameters is that of the picture;
/// so is the intensity, g^{3 + α} times its law.
#[test]
fn exact_picture_of_plunging_matter() {
    let set = ["hole.spin=0.0", "effects.spectral_index=1.0", "tracer.integrator=\"elliptic\""];
    let prepared = PreparedScene::new(&with_disc(&set, Some(LAW)), None).unwrap();
    let sin = 70f64.to_radians().sin();
    let (alpha, beta) = screen(24, 14.0);
    let mut checked = 0;
    for (alpha, beta) in alpha.iter().zip(&beta) {
        let seen = prepared.observe(*alpha, *beta, &mut Scratch::default()).unwrap();
        let (r, b) = (seen.radius, alpha.hypot(*beta));
        if !(2.05..6.0).contains(&r) || b > 5.1 {
            continue;
        }
        let f = 1.0 - 2.0 / r;
        let radial = (1.0 - f * b * b / (r * r)).sqrt() * (6.0 / r - 1.0).powf(1.5) / 3.0;
        let energy = ((8f64 / 9.0).sqrt() + radial) / f + alpha * sin * 12f64.sqrt() / (r * r);
        let miss = (seen.redshift * energy - 1.0).abs();
        assert!(miss < 1e-8, "r = {r}: {} {}", seen.redshift, 1.0 / energy);
        let expected = 0.7 * (r / 6.0).powf(1.5) * energy.powi(-4);
        assert!((seen.intensity / expected - 1.0).abs() < 1e-7, "r = {r}");
        checked += 1;
    }
    assert!(checked > 60, "{checked}");
}

/// In closed form and step by step the same is seen, polarised too: through all crossings of a
/// transparent disc, on the way in and out. Outside nothing differs from a disc that is dark inside.
#[test]
fn exact_plunging_matter_on_both_ways_to_trace() {
    let polarized: &[&str] =
        &["effects.polarization=true", "magnetic_field={vertical=1.0, radial=0.5, toroidal=0.0}"];
    for (more, spin) in [(polarized, "0.3"), (&[], "-0.9")] {
        let look_by = |integrator: &str, plunging| {
            let [tracer, spin] =
                [format!("tracer.integrator=\"{integrator}\""), format!("hole.spin={spin}")];
            let set = [&[&tracer[..], &spin, "tracer.tolerance=1e-10"], more].concat();
            let mut scene = with_disc(&set, plunging);
            scene.disc.as_mut().unwrap().opaque = false;
            observe(&PreparedScene::new(&scene, None).unwrap(), &[0.0])
        };
        let [closed, steps] = ["elliptic", "taylor-mino"].map(|how| look_by(how, Some(LAW)));
        let mut plunging = 0;
        for (a, b) in closed.iter().zip(&steps) {
            assert_eq!(a.disc_images, b.disc_images);
            plunging += u32::from(a.disc_images >> 16 != 0);
            let close = |x: f64, y: f64| (x - y).abs() < 1e-7 * (1.0 + y.abs());
            assert!(close(a.redshift, b.redshift), "{} {}", a.redshift, b.redshift);
            assert!(close(a.intensity, b.intensity), "{} {}", a.intensity, b.intensity);
            assert!(a.stokes.iter().zip(b.stokes).all(|(x, y)| close(*x, y)));
        }
        assert!(plunging > 30, "{plunging}");
        let dark = look_by("elliptic", None);
        for (a, b) in closed.iter().zip(&dark).filter(|(a, _)| a.disc_images >> 16 == 0) {
            // How a ray passes the disc depends on where the disc ends.
            assert_eq!(a, &RayResult { passes: a.passes, ..*b });
        }
    }
}
