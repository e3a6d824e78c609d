//! Scenes of a disc and a sky alone have a shorter way to the same picture.

use super::*;

const DISC: [&str; 3] = ["disc.outer_edge=9.0", "disc.peak_intensity=2.0", "disc.opaque=true"];

/// To the last bit the same as with every question asked, at several times, with rays that have
/// to be traced by steps among them.
#[test]
fn exact_bare_scenes_against_the_general_way() {
    let (clear, shift) = ("disc.opaque=false", "effects.redshift=false");
    let sky = ["sky.checker.field_deg=15.0", "sky.checker.brightness=1.0"];
    let hot = "disc.peak_temperature_k=9000.0";
    let cases: [&[&str]; 7] = [
        &DISC,
        &[&DISC[..], &[shift]].concat(),
        &[&DISC[..], &[clear, "tracer.tolerance=1e-13"]].concat(),
        &[&DISC[..], &[clear, "effects.spectral_index=1.0", hot], &sky].concat(),
        &[&DISC[..], &[shift], &sky].concat(),
        &sky,
        &[&DISC[..], &["observer.radius=40.0", "observer.azimuth_deg=20.0"]].concat(),
    ];
    // Points all over the screen, and next to the critical curve of a hole without spin, α² + β² = 27,
    // where rays lose digits and have many crossings.
    let (mut alpha, mut beta) = screen(24, 24.0);
    for k in 0..64 {
        let radius = 27f64.sqrt() * (1.0 + 1e-3 * f64::from(k).mul_add(-0.4, 1.0).exp());
        let (sin, cos) = (0.7 * f64::from(k)).sin_cos();
        alpha.push(radius * cos);
        beta.push(radius * sin);
    }
    let (times, rays) = ([30.0, 47.0], alpha.len());
    let (mut lit, mut by_steps) = (0, 0);
    for (set, spin) in cases.iter().flat_map(|set| [(set, "hole.spin=0.9"), (set, "hole.spin=0.0")])
    {
        let scene = scene(&[*set, &["tracer.integrator=\"elliptic\"", spin]].concat());
        let prepared = PreparedScene::new(&scene, None).unwrap();
        assert!(prepared.bare, "{set:?}");
        let mut asked = prepared.clone();
        asked.bare = false;
        let mut scratch = Scratch::default();
        let mut observe = |prepared: &PreparedScene| {
            let mut seen = vec![RayResult::default(); 2 * rays];
            prepared.observe_block(&alpha, &beta, &times, &mut scratch, &mut seen).unwrap();
            seen
        };
        let (found, expected) = (observe(&prepared), observe(&asked));
        let differ = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{set:?} {spin}");
        lit += found.iter().filter(|seen| seen.rgb[0] > 0.0).count();
        by_steps += scratch.traced.iter().filter(|traced| traced.by_steps).count();
    }
    assert!(lit > 1_000 && by_steps > 50, "{lit} {by_steps}");
}

/// Whatever asks more of a ray takes the general way.
#[test]
fn exact_only_bare_scenes_are_bare() {
    let field =
        ["magnetic_field.vertical=1.0", "magnetic_field.radial=0.0", "magnetic_field.toroidal=0.0"];
    let cases: [&[&str]; 4] = [
        &["effects.half_orbits=1"],
        &["effects.ray_bundles=true"],
        &["disc.plunging.intensity=1.0", "disc.plunging.exponent=1.0"],
        &[&["effects.polarization=true"], &field[..]].concat(),
    ];
    for set in cases {
        let prepared = PreparedScene::new(&scene(&[&DISC[..], set].concat()), None).unwrap();
        assert!(!prepared.bare, "{set:?}");
    }
    let mut spotted = scene(&DISC);
    spotted.spot = spots(1, None);
    assert!(!PreparedScene::new(&spotted, None).unwrap().bare);
}
