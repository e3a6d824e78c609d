//! Volumes against hot spots, closed forms and themselves with finer panels.

use super::*;
use crate::emission::medium::{CellSize, Emission, Moment, PathSegment};
use crate::emission::medium::{Medium, Part};
use crate::emission::spot::SpotModel;
use crate::scene::{Rotation, Velocity, VolumeSource};
use crate::volume::Volume;
use crate::volume::VolumeFile;
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{Kerr, Quantities};
use std::sync::Arc;

/// `value` on the nodes of a box.
fn volume(nodes: usize, [low, high]: [[f64; 3]; 2], value: impl Fn([f64; 3]) -> f64) -> VolumeFile {
    let empty = Volume::new([nodes; 3], low, high, vec![0.0; nodes.pow(3)]).unwrap();
    let values = (0..nodes.pow(3)).map(|k| value(empty.position(k)) as f32).collect();
    VolumeFile { volume: Volume::new([nodes; 3], low, high, values).unwrap(), axis: None }
}

fn around(center: [f64; 3], reach: f64) -> [[f64; 3]; 2] {
    [center.map(|x| x - reach), center.map(|x| x + reach)]
}

fn gaussian(center: [f64; 3], sigma: f64, nodes: usize) -> VolumeFile {
    volume(nodes, around(center, 5.0 * sigma), |x| {
        let square: f64 = x.iter().zip(center).map(|(x, c)| ((x - c) / sigma).powi(2)).sum();
        (-0.5 * square).exp()
    })
}

fn source(rotation: Rotation, axis: [f64; 3], since: f64) -> VolumeSource {
    VolumeSource {
        path: "made here".to_owned(),
        factor: 1.0,
        low: None,
        high: None,
        axis: Some(axis),
        rotation,
        reference_time: Some(since),
        injection_time: None,
        region: None,
        color: [1.0, 0.5, 0.25],
    }
}

fn prepared(mut scene: Scene, source: VolumeSource, file: VolumeFile) -> PreparedScene {
    scene.volume = vec![source];
    PreparedScene::new(&scene, Assets { volumes: vec![file], ..Assets::default() }).unwrap()
}

fn spot(axis: [f64; 3], sheared_since: Option<f64>) -> Spot {
    Spot {
        radius: 7.0,
        phase_deg: 40.0,
        axis,
        sigma: 0.8,
        peak_emissivity: 1.0,
        sheared_since,
        color: [1.0, 0.5, 0.25],
    }
}

/// Relative L1 distance of intensities, of intensity-weighted redshifts, and of colours and Q.
fn distances(found: &[RayResult], expected: &[RayResult]) -> [f64; 4] {
    let mut sums = [[0.0; 2]; 4];
    for (a, b) in found.iter().zip(expected) {
        let row = |x: &RayResult| {
            [x.intensity, x.intensity * x.redshift, f64::from(x.rgb[1]), x.stokes[0]]
        };
        for (sum, (a, b)) in sums.iter_mut().zip(row(a).into_iter().zip(row(b))) {
            *sum = [sum[0] + (a - b).abs(), sum[1] + b.abs()];
        }
    }
    sums.map(|[miss, all]| if all > 0.0 { miss / all } else { miss })
}

const TIMES: [f64; 3] = [30.0, 55.0, 90.0];

/// Distances of a spot's pictures from those of the volume with so many nodes.
fn against_spot(nodes: usize, sheared: bool, axis: [f64; 3], set: &[&str]) -> [f64; 4] {
    let mut with_spot = scene(set);
    let since = 10.0;
    let one = spot(axis, sheared.then_some(since));
    let model = SpotModel::new(&one, &Kerr::new(0.9).unwrap());
    let (reference, rotation) = if sheared {
        (since, Rotation::Keplerian)
    } else {
        // A spot that keeps its shape turns like a rigid body.
        let omega = model.angular_velocity(7.0);
        let rate = omega.iter().zip(axis).map(|(a, b)| a * b).sum::<f64>();
        let rate = rate / axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        (0.0, Rotation::Law(Velocity::PowerLaw { radius: 7.0, rate, exponent: 0.0 }))
    };
    let center = model.center(reference);
    let mut source = source(rotation, axis, reference);
    source.injection_time = sheared.then_some(since);
    let found = prepared(with_spot.clone(), source, gaussian(center, 0.8, nodes));
    with_spot.spot = vec![one];
    let expected = observe(&PreparedScene::new(&with_spot, None).unwrap(), &TIMES);
    assert!(expected.iter().filter(|seen| seen.intensity > 0.01).count() > 30);
    distances(&observe(&found, &TIMES), &expected)
}

/// A Gaussian on the nodes of a cube is the spot, but for linear interpolation: (h/σ)²/12 of its
/// second derivatives, four times less for half the cells. Rigid and sheared, about any axis, with
/// every effect that a volume knows, on both ways to trace rays.
#[test]
fn exact_gaussian_volumes_are_hot_spots() {
    let tilted = [0.6, 0.0, 0.8];
    let fast = "tracer.integrator=\"elliptic\"";
    let cases: [(bool, [f64; 3], &[&str]); 5] = [
        (false, [0.0, 0.0, 1.0], &["effects.redshift=false"]),
        (false, tilted, &["effects.slow_light=true", fast]),
        (true, [0.0, 0.0, 1.0], &["effects.slow_light=true"]),
        (true, tilted, &["effects.redshift=false", fast]),
        (true, [0.0, 0.0, -1.0], &[fast]),
    ];
    for (sheared, axis, set) in cases {
        let set = [&["tracer.tolerance=1e-4"], set].concat();
        let [coarse, fine] = [17, 33].map(|n| against_spot(n, sheared, axis, &set));
        for k in 0..3 {
            assert!(fine[k] < 0.02, "{set:?} {sheared}: {fine:?}");
            let ratio = coarse[k] / fine[k];
            assert!(fine[k] == 0.0 || (3.0..5.0).contains(&ratio), "{set:?} {sheared}: {ratio}");
        }
    }
}

/// Polarised too.
#[test]
fn exact_polarized_volumes_are_hot_spots() {
    let field = ["effects.polarization=true", "magnetic_field.vertical=1.0"];
    let more =
        ["magnetic_field.radial=0.3", "magnetic_field.toroidal=0.4", "tracer.tolerance=1e-4"];
    let set = [&field[..], &more].concat();
    let set = [&set[..], &["effects.spectral_index=1.0"]].concat();
    let [coarse, fine] = [17, 33].map(|n| against_spot(n, true, [0.6, 0.0, 0.8], &set));
    assert!(fine[0] < 0.02 && fine[3] < 0.03, "{fine:?}");
    assert!((3.0..5.0).contains(&(coarse[3] / fine[3])), "{coarse:?} {fine:?}");
}

/// The chord of a straight ray through the cube |x| < 3.
fn chord_of_cube(offset: [f64; 3], direction: [f64; 3]) -> f64 {
    let mut ends = [f64::NEG_INFINITY, f64::INFINITY];
    for (x, d) in offset.iter().zip(direction) {
        if d == 0.0 {
            if x.abs() > 3.0 {
                return 0.0;
            }
            continue;
        }
        let (near, far) = ((-3.0 * d.signum() - x) / d, (3.0 * d.signum() - x) / d);
        ends = [ends[0].max(near), ends[1].min(far)];
    }
    (ends[1] - ends[0]).max(0.0)
}

/// Cells that are too fine for the finest panels shine as much among several times as at one.
#[test]
fn exact_fine_cells_far_away_shine_at_all_times() {
    let scene = scene(&["effects.lensing=false", "effects.redshift=false"]);
    let (sin, cos) = 70f64.to_radians().sin_cos();
    let file = volume(64, around([50.0 * sin, 0.0, 50.0 * cos], 0.25), |_| 1.0);
    let still =
        VolumeSource { reference_time: None, ..source(Rotation::None, [0.0, 0.0, 1.0], 0.0) };
    let prepared = prepared(scene, still, file);
    let seen = |times: &[f64]| -> Vec<f64> {
        let mut seen = vec![RayResult::default(); times.len()];
        let scratch = &mut Scratch::default();
        prepared.observe_block(&[0.03], &[0.02], times, scratch, &mut seen).unwrap();
        seen.iter().map(|seen| seen.intensity).collect()
    };
    let one = seen(&TIMES[..1])[0];
    assert!(one > 0.2, "{one}");
    assert_eq!(seen(&TIMES), [one; 3]);
}

/// Without lensing the picture of a uniform box or ball is its chords: exactly up to the last
/// cell on either side, whose edge lies somewhere in a panel.
#[test]
fn exact_chords_of_uniform_bodies() {
    let set = ["effects.lensing=false", "effects.redshift=false", "tracer.tolerance=1e-6"];
    let scene = scene(&set);
    let (sin, cos) = 70f64.to_radians().sin_cos();
    let center = [2.0, -6.0, 1.0];
    let at = |alpha: f64, beta: f64| {
        let origin = [-cos * beta, alpha, sin * beta];
        let offset: [f64; 3] = core::array::from_fn(|k| origin[k] - center[k]);
        (offset, [sin, 0.0, cos])
    };
    let slab = |alpha: f64, beta: f64| {
        let (offset, direction) = at(alpha, beta);
        chord_of_cube(offset, direction)
    };
    let ball = |alpha: f64, beta: f64| {
        let (offset, direction) = at(alpha, beta);
        let along: f64 = offset.iter().zip(direction).map(|(x, d)| x * d).sum();
        let square: f64 = offset.iter().map(|x| x * x).sum::<f64>() - along * along;
        2.0 * (9.0 - square).max(0.0).sqrt()
    };
    let inside =
        |x: [f64; 3]| x.iter().zip(center).map(|(x, c)| (x - c).powi(2)).sum::<f64>() < 9.0;
    let cube = volume(41, around(center, 3.0), |_| 1.0);
    let round = volume(61, around(center, 3.1), |x| f64::from(u8::from(inside(x))));
    // Half a cell on each side for the ball's steps.
    for (file, exact, allowed) in [
        (cube, &slab as &dyn Fn(f64, f64) -> f64, 0.02),
        (round, &ball as &dyn Fn(f64, f64) -> f64, 0.2),
    ] {
        let still =
            VolumeSource { reference_time: None, ..source(Rotation::None, [0.0, 0.0, 1.0], 0.0) };
        let prepared = prepared(scene.clone(), still, file);
        let (mut lit, mut sum, mut bias) = (0, 0.0, 0.0);
        for k in 1..200 {
            let part = |f: f64| 6.0 * ((f64::from(k) * f).fract() - 0.5);
            let (alpha, beta) = (center[1] + part(0.754_877), sin - 2.0 * cos + part(0.569_840));
            let expected = exact(alpha, beta);
            if expected < 2.0 {
                // A grazing ray's chord is as uncertain as the steps.
                continue;
            }
            let found = prepared.observe(alpha, beta, &mut Scratch::default()).unwrap().intensity;
            assert!((found - expected).abs() < allowed, "({alpha}, {beta}): {found} {expected}");
            lit += u32::from(expected > 0.0);
            (sum, bias) = (sum + expected, bias + found - expected);
        }
        assert!(lit > 80 && (bias / sum).abs() < 0.005, "{lit} {}", bias / sum);
    }
}

/// The medium with panels of a part of its cells.
#[derive(Debug)]
struct Finer(Arc<dyn Medium>, f64);

impl Medium for Finer {
    fn part(&self) -> Part {
        self.0.part()
    }
    fn sphere(&self) -> f64 {
        self.0.sphere()
    }
    fn cell_size(&self) -> Option<CellSize> {
        self.0.cell_size().map(|cell| CellSize { size: self.1 * cell.size, ..cell })
    }
    fn quantities(&self) -> Quantities {
        self.0.quantities()
    }
    fn color(&self) -> [f32; 3] {
        self.0.color()
    }
    fn scale(&self) -> f64 {
        self.0.scale()
    }
    fn four_velocity(&self, r: f64, u: f64, azimuth: f64) -> Option<[f64; 4]> {
        self.0.four_velocity(r, u, azimuth)
    }
    fn changes(&self) -> bool {
        self.0.changes()
    }
    fn may_shine(&self, segment: &PathSegment, moment: Moment) -> bool {
        self.0.may_shine(segment, moment)
    }
    fn absorbs(&self) -> bool {
        self.0.absorbs()
    }
    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, moment: Moment, out: &mut Emission) {
        self.0.fill(nodes, lambda, moment, out);
    }
}

/// The error of the quadrature, against panels an eighth as long: small against that of
/// interpolation, 5e-3 for this volume.
#[test]
fn regress_panels_resolve_cells() {
    let center = [5.0, 3.0, 1.0];
    for (tolerance, allowed) in [("1e-2", 1e-3), ("1e-7", 1e-4)] {
        for integrator in ["elliptic", "taylor-mino"] {
            let tracer = format!("tracer.integrator=\"{integrator}\"");
            let tolerance = format!("tracer.tolerance={tolerance}");
            let scene = scene(&[&tolerance, &tracer, "effects.slow_light=true"]);
            let source = source(Rotation::Keplerian, [0.0, 0.6, 0.8], 0.0);
            let coarse = prepared(scene, source, gaussian(center, 0.8, 33));
            let mut fine = coarse.clone();
            fine.media = coarse
                .media
                .clone()
                .map(|medium| Arc::new(Finer(medium, 0.125)) as Arc<dyn Medium>);
            fine.optics.tolerance = 1e-9;
            let [miss, ..] = distances(&observe(&coarse, &[60.0]), &observe(&fine, &[60.0]));
            println!("{integrator}, {tolerance}: {miss:e}");
            assert!(miss < allowed, "{integrator}, {tolerance}: {miss:e}");
        }
    }
}

/// A volume before its time, or empty, is dark; negative values and missing files are refused.
#[test]
fn exact_darkness_and_refusals() {
    let early = VolumeSource {
        injection_time: Some(500.0),
        ..source(Rotation::Keplerian, [0.0, 0.0, 1.0], 0.0)
    };
    let dark =
        prepared(scene(&["effects.slow_light=true"]), early, gaussian([6.0, 0.0, 0.0], 0.8, 17));
    assert!(observe(&dark, &TIMES).iter().all(|seen| seen.intensity == 0.0));
    let still = || source(Rotation::None, [0.0, 0.0, 1.0], 0.0);
    let empty = prepared(scene(&[]), still(), volume(3, around([0.0; 3], 8.0), |_| 0.0));
    assert!(observe(&empty, &TIMES).iter().all(|seen| seen.intensity == 0.0));
    let mut wrong = scene(&[]);
    wrong.volume = vec![still()];
    let negative = volume(3, around([0.0; 3], 8.0), |x| x[0]);
    let error = PreparedScene::new(&wrong, Assets { volumes: vec![negative], ..Assets::default() });
    let text = error.unwrap_err().to_string();
    assert_eq!(text, "least value of the volume = -8 is not allowed: 0 or more");
    let text = PreparedScene::new(&wrong, None).unwrap_err().to_string();
    assert!(text.contains("one file for each [[volume]]"), "{text}");
}
