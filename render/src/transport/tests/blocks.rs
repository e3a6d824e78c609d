//! Rays of a block do not depend on each other, however they are traced.

use super::*;

const DISC: [&str; 3] = ["disc.outer_edge=9.0", "disc.peak_intensity=2.0", "disc.opaque=true"];

/// To the last bit the same as ray by ray and time by time, with rays that have to be traced step by
/// step among them.
#[test]
fn exact_blocks_against_single_rays() {
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
    let (mut lit, mut stepped) = (0, 0);
    for (set, spin) in cases.iter().flat_map(|set| [(set, "hole.spin=0.9"), (set, "hole.spin=0.0")])
    {
        let scene = scene(&[*set, &["tracer.integrator=\"elliptic\"", spin]].concat());
        let prepared = PreparedScene::new(&scene, None).unwrap();
        let mut scratch = Scratch::default();
        let mut found = vec![RayResult::default(); 2 * rays];
        prepared.observe_block(&alpha, &beta, &times, &mut scratch, &mut found).unwrap();
        stepped += scratch.rays.rays().iter().filter(|ray| ray.stepped).count();
        for (j, time) in times.into_iter().enumerate() {
            for k in 0..rays {
                let (alpha, beta) = ([alpha[k]], [beta[k]]);
                let mut single = [RayResult::default()];
                prepared.observe_block(&alpha, &beta, &[time], &mut scratch, &mut single).unwrap();
                assert_eq!(single[0], found[j * rays + k], "{set:?} {spin}: ray {k} at {time}");
            }
        }
        lit += found.iter().filter(|seen| seen.rgb[0] > 0.0).count();
    }
    assert!(lit > 1_000 && stepped > 50, "{lit} {stepped}");
}
