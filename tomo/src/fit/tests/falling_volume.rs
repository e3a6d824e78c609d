//! The forward model against pictures of the same volume, which share neither rays nor formulas.

use crate::fit::{
    Batch, ForwardModel, Motion, Redshift, Region, Sampling, SightlineRequest, Sightlines,
};
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{Axis, Velocity};
use kerrlight_render::scene::{Rotation, Scene, VolumeRegion, VolumeSource};
use kerrlight_render::transport::{Assets, PreparedScene, RayResult, Scratch};
use kerrlight_render::volume::{Volume, VolumeFile};

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
slow_light = true
spectral_index = 0.5
[tracer]
integrator = "taylor-mino"
tolerance = 1e-5
"#;

const TIMES: [f64; 3] = [30.0, 55.0, 90.0];
const SIDE: usize = 24;

/// Pixels of a field 24 M wide.
fn screen() -> (Vec<f64>, Vec<f64>) {
    let along = |k: usize| 24.0 * ((k as f64 + 0.5) / SIDE as f64 - 0.5);
    (0..SIDE * SIDE).map(|k| (along(k % SIDE), along(k / SIDE))).unzip()
}

fn gaussian(center: [f64; 3], sigma: f64, nodes: usize) -> Volume {
    let (low, high) = (center.map(|x| x - 5.0 * sigma), center.map(|x| x + 5.0 * sigma));
    let empty = Volume::new([nodes; 3], low, high, vec![0.0; nodes.pow(3)]).unwrap();
    let value = |x: [f64; 3]| {
        let square: f64 = x.iter().zip(center).map(|(x, c)| ((x - c) / sigma).powi(2)).sum();
        (-0.5 * square).exp() as f32
    };
    let values = (0..nodes.pow(3)).map(|k| value(empty.position(k))).collect();
    Volume::new([nodes; 3], low, high, values).unwrap()
}

/// A volume that falls, with slow light and redshift, has the pixels that a fit has of it: these share neither panels nor
/// bricks, nor the formula of g.
#[test]
fn exact_falling_volumes_are_those_of_fits() {
    compare(gaussian([6.0, 4.0, 1.0], 1.0, 33), 60);
    // A box that ends far from the hole, nearer to which its matter falls.
    compare(gaussian([-6.5, 3.0, 1.0], 0.5, 33), 30);
}

fn compare(volume: Volume, pixels: usize) {
    let (mut scene, hole, since) = (Scene::parse(SCENE).unwrap(), Kerr::new(0.9).unwrap(), 20.0);
    let law = Velocity::Infall { xi: 0.7, beta_r: 0.9, beta_phi: 0.8, drag: None };
    let (r_min, r_max, axis) = (1.6, 11.0, Axis::new([0.3, 0.0, 1.0]).unwrap());
    scene.volume = vec![VolumeSource {
        path: "made here".to_owned(),
        factor: 1.0,
        low: None,
        high: None,
        axis: Some(axis.vector()),
        rotation: Rotation::Law(law.clone()),
        reference_time: Some(since),
        injection_time: None,
        region: Some(VolumeRegion { r_min, r_max, z_width: None }),
        color: [1.0, 0.5, 0.25],
    }];
    let file = VolumeFile { volume: volume.clone(), axis: None };
    let assets = Assets { volumes: vec![file], ..Assets::default() };
    let prepared = PreparedScene::new(&scene, assets).unwrap();
    let (alpha, beta) = screen();
    let mut found = vec![RayResult::default(); alpha.len() * TIMES.len()];
    prepared.observe_block(&alpha, &beta, &TIMES, &mut Scratch::default(), &mut found).unwrap();
    let request = SightlineRequest {
        region: Region { r_min, r_max, z_width: f64::INFINITY },
        sampling: Sampling::Gauss { order: 8, split: 12 },
        delay: true,
        momentum: true,
    };
    let inclination = Inclination::from_degrees(scene.observer.inclination_deg).unwrap();
    let observer = Observer::at_infinity(inclination);
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap();
    let velocity = law.angular(0, 0.9 * axis.vector()[2]).unwrap();
    let motion = Motion { velocity, reference: since, injection: None, times: TIMES.to_vec() };
    let mut model =
        ForwardModel::<f64>::new(&lines, &motion, &hole, Some(Redshift { power: 2.5 })).unwrap();
    model.weigh(axis);
    let movie = model.movie_of(axis, &|x| volume.at(x), &mut Batch::default());
    let most = movie.iter().fold(0.0f64, |most, x| most.max(*x));
    let lit = movie.iter().filter(|x| **x > 0.01 * most).count();
    assert!(most > 0.1 && lit > pixels, "{most} {lit}");
    for (pixel, seen) in movie.iter().zip(&found) {
        let seen = seen.intensity;
        assert!((pixel - seen).abs() < 3e-3 * most, "{pixel} {seen} of {most}");
    }
}
