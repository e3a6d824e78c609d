use super::*;
use crate::scene::{Scene, Spot};

mod blocks;
mod discs;
mod meshes;
mod volumes;

const SCENE: &str = r#"
[hole]
spin = 0.9
mass_msun = 4.154e6
distance_kpc = 8.178
[observer]
inclination_deg = 70
time = 30.0
[screen]
field_of_view_m = 24.0
width = 16
height = 16
[effects]
redshift = true
spectral_index = 0.0
[tracer]
integrator = "taylor-mino"
tolerance = 1e-7
"#;

pub(super) fn scene(set: &[&str]) -> Scene {
    let text = set.iter().fold(SCENE.to_owned(), |text, assignment| {
        crate::scene::apply_override(&text, assignment).unwrap()
    });
    Scene::parse(&text).unwrap()
}

/// Spots of many sizes on many orbits, spread evenly by the fractional parts of multiples of
/// irrational numbers.
fn spots(count: u32, sheared_since: Option<f64>) -> Vec<Spot> {
    let part = |k: u32, number: f64| (f64::from(k) * number + 0.3).fract();
    (0..count)
        .map(|k| Spot {
            radius: 4.5 + 6.0 * part(k, 2f64.sqrt()),
            phase_deg: 360.0 * part(k, 3f64.sqrt()),
            axis: match k % 3 {
                0 => [0.0, 0.0, 1.0],
                1 => [part(k, 5f64.sqrt()) - 0.5, part(k, 7f64.sqrt()) - 0.5, 0.4],
                _ => [0.1, 0.3, -1.0],
            },
            sigma: 0.02 + 0.5 * part(k, 11f64.sqrt()).powi(3),
            peak_emissivity: 1.0 + part(k, 13f64.sqrt()),
            sheared_since: sheared_since.filter(|_| k % 2 == 0),
            color: [1.0, 0.5, 0.1],
        })
        .collect()
}

fn screen(side: u32, width: f64) -> (Vec<f64>, Vec<f64>) {
    let along = |k: u32| width * ((f64::from(k) + 0.5) / f64::from(side) - 0.5);
    (0..side * side).map(|k| (along(k % side), along(k / side))).unzip()
}

/// Light of 24² rays, and how they were traced.
fn traced(prepared: &PreparedScene, times: &[f64]) -> (Vec<RayResult>, Scratch) {
    let (alpha, beta) = screen(24, 24.0);
    let mut seen = vec![RayResult::default(); alpha.len() * times.len()];
    let mut scratch = Scratch::default();
    prepared.observe_block(&alpha, &beta, times, &mut scratch, &mut seen).unwrap();
    (seen, scratch)
}

fn observe(prepared: &PreparedScene, times: &[f64]) -> Vec<RayResult> {
    traced(prepared, times).0
}

/// The tree leaves out only what is dark: to the last bit the same light, from the same places,
/// as when every spot is asked along every ray.
#[test]
fn exact_tree_against_every_spot() {
    let mut lit = 0;
    for (count, since) in [(1, None), (30, None), (30, Some(-200.0)), (300, Some(0.0))] {
        for spin in ["0.0", "0.9", "-0.9"] {
            for slow in ["true", "false"] {
                let mut scene =
                    scene(&[&format!("hole.spin={spin}"), &format!("effects.slow_light={slow}")]);
                scene.spot = spots(count, since);
                let prepared = PreparedScene::new(&scene, None).unwrap();
                let times = [30.0, 47.0];
                let found = observe(&prepared, &times);
                let expected = observe(&prepared.one_by_one(), &times);
                lit += found.iter().filter(|seen| seen.intensity > 0.0).count();
                let differ = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "{count} spots, {since:?}, a = {spin}, slow light {slow}");
            }
        }
    }
    assert!(lit > 2_000, "{lit}");
}

/// Rays that turn outside of all spots are known without a path; none that sees light is.
#[test]
fn exact_rays_that_cannot_meet_a_spot() {
    let mut scene = scene(&[]);
    scene.spot = spots(40, None);
    let prepared = PreparedScene::new(&scene, None).unwrap();
    let tree = prepared.spots.tree(&prepared.optics, 30.0).unwrap();
    let (alpha, beta) = screen(24, 40.0);
    let all = prepared.clone().one_by_one();
    let (mut out, mut lit) = (0, 0);
    for (alpha, beta) in alpha.iter().zip(&beta) {
        let ray = prepared.view().ray(prepared.hole(), *alpha, *beta).unwrap();
        let light = |scene: &PreparedScene| {
            scene.observe(*alpha, *beta, &mut Scratch::default()).unwrap().intensity
        };
        lit += u32::from(light(&prepared) > 0.0);
        if !tree.can_be_met(&ray) {
            out += 1;
            assert_eq!(light(&all), 0.0);
        }
    }
    assert!(out > 150 && lit > 20, "{out} {lit}");
}

/// Rays of the closed form that pass a spot's radii are traced by steps only where they may meet its
/// light: to the last bit the same light as when all of them are, and most of them are not.
#[test]
fn exact_sighting_of_single_spots() {
    let (mut lit, mut stepped, mut all) = (0, 0, 0);
    for k in 0..24 {
        let since = Some([-20.0, -200.0, 0.0][k % 3]);
        for (spin, inclination) in [("0.0", 20), ("0.9", 70), ("-0.98", 88)] {
            let mut scene = scene(&[
                &format!("hole.spin={spin}"),
                &format!("observer.inclination_deg={inclination}"),
                &format!("effects.slow_light={}", k % 4 < 2),
                "tracer.integrator=\"elliptic\"",
            ]);
            scene.spot = vec![spots(24, since).swap_remove(k)];
            scene.spot[0].sigma = scene.spot[0].sigma.max(0.15);
            scene.spot[0].radius -= if k % 5 == 0 { 2.0 } else { 0.0 };
            let prepared = PreparedScene::new(&scene, None).unwrap();
            let times = [30.0, 47.0];
            let (found, scratch) = traced(&prepared, &times);
            let expected = observe(&prepared.one_by_one(), &times);
            for (found, expected) in found.iter().zip(&expected) {
                let light = |seen: &RayResult| (seen.intensity, seen.redshift, seen.radius);
                assert_eq!(light(found), light(expected), "spot {k}, a = {spin}, {inclination}");
                lit += u32::from(found.intensity > 0.0);
            }
            let rays = scratch.rays.rays();
            stepped += rays.iter().filter(|ray| ray.with_path || ray.stepped).count();
            all += rays.len();
        }
    }
    assert!(lit > 2_000 && 3 * stepped < all, "{lit} lit, {stepped} of {all} stepped");
}

/// The same where gas dims the spot: rays that miss it keep the nodes of the closed form.
#[test]
fn exact_sighting_of_a_spot_in_gas_that_absorbs() {
    let gas = "gas={profile=\"gaussian\",scale_radius=10.0,flatness=3.0,motion=\"keplerian\",\
               emissivity=3e-18,absorptivity=1e5,outer_radius=60.0}";
    let set =
        ["effects.absorption=true", "tracer.integrator=\"elliptic\"", "tracer.tolerance=1e-10"];
    let mut scene = scene(&[&[gas][..], &set].concat());
    scene.spot = spots(1, None);
    (scene.spot[0].sigma, scene.spot[0].peak_emissivity) = (0.2, 1e-6);
    let prepared = PreparedScene::new(&scene, None).unwrap();
    let (found, scratch) = traced(&prepared, &[30.0]);
    let expected = observe(&prepared.one_by_one(), &[30.0]);
    let largest = expected.iter().fold(0.0f64, |most, seen| most.max(seen.intensity));
    let apart = found.iter().zip(&expected).map(|(a, b)| (a.intensity - b.intensity).abs());
    let apart = apart.fold(0.0f64, f64::max);
    // Panels along a path begin elsewhere than those of the closed form.
    assert!(largest > 0.0 && apart < 1e-7 * largest, "{apart:e} of {largest:e}");
    assert!(expected.iter().all(|seen| seen.optical_depth > 0.0));
    let rays = scratch.rays.rays();
    let stepped = rays.iter().filter(|ray| ray.stepped).count();
    assert!(stepped > 10 && 2 * stepped < rays.len(), "{stepped} of {}", rays.len());
}

/// A thin layer shines, and absorbs, in proportion to its thickness: none of it lies between the nodes.
#[test]
fn exact_thin_gas_is_met_by_every_ray_that_crosses_it() {
    let sums = |flatness: f64, inclination: u32| {
        let gas = format!(
            "gas={{profile=\"gaussian\",scale_radius=10.0,flatness={flatness},motion=\"keplerian\",\
             emissivity=3e-18,absorptivity=1e5,outer_radius=60.0}}"
        );
        let tilt = format!("observer.inclination_deg={inclination}");
        let set = [&gas, &tilt, "effects.absorption=true", "tracer.tolerance=1e-5"];
        let seen = observe(&PreparedScene::new(&scene(&set), None).unwrap(), &[0.0]);
        let sum = |of: fn(&RayResult) -> f64| flatness * seen.iter().map(of).sum::<f64>();
        [sum(|seen| seen.intensity), sum(|seen| seen.optical_depth)]
    };
    for inclination in [5, 60] {
        let [light, depth] = sums(300.0, inclination);
        let [thin, of_thin] = sums(1000.0, inclination);
        assert!((of_thin / depth - 1.0).abs() < 3e-4, "{of_thin} {depth}");
        // Thicker gas dims itself more.
        assert!((0.0..0.01).contains(&(thin / light - 1.0)), "{thin:e} {light:e}");
    }
}
