//! Static images: gradients, rings of known shape, and rings seen through an array with gains.

use crate::data;
use crate::settings::{RingSettings, StartImage, StaticImageFile};
use crate::*;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_tomo::fit::settings::Variability;
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_vlbi::array;
use kerrlight_vlbi::earth::{Frame, Ut1};
use kerrlight_vlbi::noise::{GainErrors, ScatteringKernel, add_thermal_noise, apply_gains};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{ImageGrid, Method, Pulse};
use kerrlight_vlbi::schedule::{self, Clock, Schedule, Setup};
use kerrlight_vlbi::simulate::{self, Movie};
use kerrlight_vlbi::source::Source;

const RADII: RingSettings = RingSettings { least_radius_uas: 5.0, most_radius_uas: 40.0 };

/// A ring of Gaussian cross-section about a centre (east, north), brighter by a factor 1 + a cos(angle − at), µas.
fn ring(
    grid: ImageGrid,
    [diameter, fwhm]: [f64; 2],
    at: [f64; 2],
    [a, angle]: [f64; 2],
) -> Vec<f64> {
    let of = |k: usize| {
        let [east, north] = grid.place_uas(k);
        let (east, north) = (east - at[0], north - at[1]);
        let off = (east.hypot(north) - 0.5 * diameter) / fwhm;
        let turn = east.atan2(north) - angle.to_radians();
        (-4.0 * core::f64::consts::LN_2 * off * off).exp() * (1.0 + a * turn.cos())
    };
    (0..grid.pixels()).map(of).collect()
}

pub(super) fn grid(side: usize) -> ImageGrid {
    ImageGrid::new(side, side, 120.0 * MICROARCSECOND).unwrap()
}

/// The first moment of 1 + a cos is a/2; a narrow ring is as wide as its cross-section.
#[test]
fn exact_numbers_of_a_ring() {
    let grid = grid(120);
    let pixels = ring(grid, [42.0, 8.0], [3.0, -5.0], [0.5, 170.0]);
    let found = Ring::measure(&pixels, grid, &RADII).unwrap();
    assert!((found.diameter_uas - 42.0).abs() < 0.3, "{found:?}");
    assert!((found.width_uas - 8.0).abs() < 0.5, "{found:?}");
    assert!((found.position_angle_deg - 170.0).abs() < 0.5, "{found:?}");
    assert!((found.asymmetry - 0.25).abs() < 0.01, "{found:?}");
    assert!((found.centre_uas[0] - 3.0).abs() < 0.2 && (found.centre_uas[1] + 5.0).abs() < 0.2);
    assert!(found.central_brightness < 0.01 && found.diameter_scatter_uas < 0.7, "{found:?}");
}

/// A dark place with faint light all around it beside a bright spot: every direction has a brightest point, and yet most of
/// the light lies outside.
#[test]
fn exact_a_ring_encloses_the_middle_of_the_light() {
    let grid = grid(90);
    let faint = ring(grid, [20.0, 7.0], [-18.0, -8.0], [0.0, 0.0]);
    let even = Ring::measure(&faint, grid, &RADII).unwrap();
    assert!((even.centre_uas[0] + 18.0).abs() < 0.5, "{even:?}");
    let spot = start::image(StartImage::Gaussian { fwhm_uas: 14.0 }, grid);
    let most = spot.iter().copied().fold(0.0, f64::max);
    let both: Vec<f64> = faint.iter().zip(&spot).map(|(a, b)| a + 6.0 * b / most).collect();
    let found = Ring::measure(&both, grid, &RADII);
    assert!(found.is_none_or(|ring| ring.centre_uas[0] > -10.0), "{found:?}");
}

#[test]
fn exact_a_gaussian_has_no_ring() {
    let grid = grid(60);
    let pixels = start::image(StartImage::Gaussian { fwhm_uas: 40.0 }, grid);
    assert_eq!(Ring::measure(&pixels, grid, &RADII), None);
}

pub(super) const SETTINGS: &str = r#"
title = "a ring"
seed = 1
[image]
pixels = 32
field_uas = 120.0
flux_jy = 0.6
flux_sigma_jy = 0.05
starts = [{ gaussian = { fwhm_uas = 60.0 } }, { ring = { diameter_uas = 50.0, width_uas = 25.0 } }]
iterations = 1000
draws = 6
[data.visibilities]
path = "none"
average_s = 0.0
systematic = 0.01
[instrument.gains]
phases = "known"
amplitude = 0.2
[[loss]]
data = "amplitudes"
weight = 1.0
[[loss]]
data = "closure-phases"
weight = 1.0
[[loss]]
data = "log-closure-amplitudes"
weight = 1.0
[envelope]
fwhm_uas = 60.0
weight = 0.03
[[regulariser]]
kind = "total-variation"
weight = 1e-3
epsilon = 30.0
[ring]
least_radius_uas = 5.0
most_radius_uas = 45.0
"#;

/// Compares a gradient with differences of fourth order along some of the numbers.
pub(super) fn assert_slopes(
    x: &[f64],
    h: f64,
    numbers: &[usize],
    value: impl Fn(&[f64], &mut [f64]) -> f64,
) {
    let mut gradient = vec![0.0; x.len()];
    value(x, &mut gradient);
    let scale = gradient.iter().fold(0.0f64, |most, g| most.max(g.abs()));
    for k in numbers.iter().copied() {
        let at = |step: f64| {
            let mut x = x.to_vec();
            x[k] += step;
            value(&x, &mut vec![0.0; x.len()])
        };
        let found = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        assert!((found - gradient[k]).abs() < 1e-6 * scale, "{k}: {found} {}", gradient[k]);
    }
}

/// Rows without values of a night of M87* at the array of 2017, and hours of UTC of its scans.
pub(super) fn night() -> (Observation, Vec<f64>) {
    let source: Source = "m87".parse().unwrap();
    let setup = Setup {
        frequency_hz: 229.1e9,
        bandwidth_hz: 1.856e9,
        integration_s: 120.0,
        elevation_deg: [10.0, 85.0],
        ut1: Ut1::Table,
        frame: Frame::Catalogue,
    };
    let plan = Schedule { mjd: 57853, clock: Clock::Utc, start_h: 0.5, stop_h: 8.0, scans: 16 };
    let array = array::built_in("EHT2017").unwrap();
    let seen = schedule::observe_affordable(&array, source.position, &plan, &setup).unwrap();
    (seen, plan.hours_utc(setup.ut1).unwrap())
}

/// Gains of 20 % in every scan and no phases at all, then thermal noise.
pub(super) fn spoil(seen: &mut Observation, seed: u64) {
    let gains = GainErrors { scan_amplitude: 0.2, random_phases: true, ..GainErrors::default() };
    apply_gains(seen, &gains, seed);
    add_thermal_noise(seen, seed);
}

/// A ring of 44 µas and 0.6 Jy, brighter in the south, on a grid, and the array of 2017 without any error.
fn clean(grid: ImageGrid) -> (Vec<f64>, Observation) {
    let mut image = ring(grid, [44.0, 16.0], [0.0, 0.0], [0.5, 170.0]);
    let sum: f64 = image.iter().sum();
    image.iter_mut().for_each(|x| *x *= 0.6 / sum);
    let (mut seen, hours) = night();
    let movie = Movie { grid, pixels: image.repeat(hours.len()) };
    simulate::fill(&mut seen, &movie, Pulse::Triangle, &hours, Method::Direct).unwrap();
    (image, seen)
}

/// The same with thermal noise, gains of 20 % in every scan and no phases at all.
fn observed(seed: u64) -> Observation {
    let (_, mut seen) = clean(grid(96));
    spoil(&mut seen, seed);
    seen
}

fn measured(file: &StaticImageFile, seed: u64) -> FitData {
    data::total_intensity(file, observed(seed), "data").unwrap()
}

/// Errors are those of a source that varies, in quadrature; visibilities and errors are those before scattering.
#[test]
fn exact_scattering_and_variability_of_data() {
    let with = |line: &str| {
        let text = SETTINGS.replace("systematic = 0.01", &format!("systematic = 0.01\n{line}"));
        measured(&StaticImageFile::parse(&text).unwrap(), 1)
    };
    let rows = |measured: &FitData| measured.visibilities.as_ref().unwrap().0.rows.clone();
    let plain = with("");
    let law = Variability { jy: 0.02, uv: 2e9, power: 1.25 };
    let varying = with("variability = { jy = 0.02, uv = 2e9, power = 1.25 }");
    let scattered = with("scattering = \"sgra\"");
    assert!(
        varying.has_intrinsic_variability
            && !plain.has_intrinsic_variability
            && !scattered.has_intrinsic_variability
    );
    for ((a, b), c) in rows(&plain).iter().zip(rows(&varying)).zip(rows(&scattered)) {
        let expected = a.noise_sigma[0].hypot(law.sigma(a.uv[0].hypot(a.uv[1])));
        assert!((b.noise_sigma[0] - expected).abs() < 1e-15 && a.products[0] == b.products[0]);
        let factor = ScatteringKernel::sgr_a().transform(a.uv, 229.1e9);
        assert!((c.products[0] * factor - a.products[0]).norm() < 1e-12, "{factor}");
        assert!((c.noise_sigma[0] * factor - a.noise_sigma[0]).abs() < 1e-12 && factor <= 1.0);
    }
}

/// Redrawn data of an image are its own with noise, times gains that scatter as their priors say: 20 % for each station. Their errors
/// are larger by the same.
#[test]
fn exact_redrawn_data_have_gains_of_the_priors() {
    let file = StaticImageFile::parse(SETTINGS).unwrap();
    let (image, seen) = clean(file.image.grid().unwrap());
    let measured = data::total_intensity(&file, seen, "data").unwrap();
    let known = FitData { gains: None, ..measured.without_truth() };
    let drawn = |measured: &FitData, seed: u64| {
        let drawn = data::redrawn(measured, &file.loss, &image, seed).unwrap();
        drawn.visibilities.unwrap().0.rows
    };
    let mut squares = Vec::new();
    for seed in 0..20 {
        for (row, plain) in drawn(&measured, seed).iter().zip(drawn(&known, seed)) {
            let gain = row.noise_sigma[0] / plain.noise_sigma[0];
            let apart = (row.products[0] / gain - plain.products[0]).norm();
            // Gains are those of amplitudes without the bias of noise, 1 as far as that goes.
            assert!(apart < 0.1 * plain.noise_sigma[0], "{apart} {}", plain.noise_sigma[0]);
            squares.push(gain.ln().powi(2));
        }
    }
    let scatter = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((scatter / (0.2 * 2f64.sqrt()) - 1.0).abs() < 0.05, "{scatter}");
}

/// The gradient of everything at once, with gains, beside central differences.
#[test]
fn exact_gradients_of_the_loss() {
    let file = StaticImageFile::parse(SETTINGS).unwrap();
    let measured = measured(&file, 1);
    let grid = file.image.grid().unwrap();
    let terms = measured.visibility_terms::<f64>(&file.loss, grid.pixels()).unwrap();
    let priors = file.priors().unwrap();
    let envelope = Envelope { profile: Profile::Gaussian, fwhm_uas: 60.0 }.shares(grid);
    let problem = ImageProblem {
        terms: &terms,
        frames: (0..measured.times.len()).collect(),
        priors: &priors,
        envelope: Some((&envelope, 0.1)),
        strength: 2.0,
        flux: FluxPrior { jy: 0.6, sigma_jy: 0.05 },
        side: 32,
    };
    let shape = ring(grid, [43.0, 18.0], [0.5, 0.0], [0.5, 165.0]);
    let mut x = problem.parameters_of(&shape.iter().map(|x| x + 0.05).collect::<Vec<_>>());
    x[1024] = 0.02;
    let numbers = [0, 200, 456, 530, 600, 1023, 1024];
    assert_slopes(&x, 1e-4, &numbers, |x, gradient| problem.value_and_gradient(x, gradient));
}

/// A ring is found from closures and amplitudes with gains: its diameter within three stated errors and 2 µas, its
/// brightest direction within 20°, χ² near 1.
#[test]
fn exact_a_ring_is_found_through_gains() {
    let file = StaticImageFile::parse(SETTINGS).unwrap();
    let found = survey(&file, &measured(&file, 2), &[], &|_, _| true).unwrap().unwrap();
    let image = found.found();
    let ring = image.ring.expect("a ring");
    let error = found.ring_error(|ring| ring.diameter_uas).expect("an error");
    let off = (ring.diameter_uas - 44.0).abs();
    assert!(off < 3.0 * error.max(0.3) && off < 2.0, "{ring:?} ± {error}");
    assert!((ring.position_angle_deg - 170.0).abs() < 20.0, "{ring:?}");
    assert!(image.chi2.iter().all(|chi2| (0.6..1.4).contains(chi2)), "{:?}", image.chi2);
}

/// Phases and amplitudes all lost: closures alone find the ring, from a Gaussian.
#[test]
fn exact_closures_alone_find_a_ring() {
    let loss = SETTINGS.find("[[loss]]\ndata = \"amplitudes\"").unwrap();
    let next = SETTINGS.find("[[loss]]\ndata = \"closure-phases\"").unwrap();
    let gains = SETTINGS.find("[instrument.gains]").unwrap();
    let text = [&SETTINGS[..gains], &SETTINGS[next..]].concat();
    assert!(loss < next);
    let file = StaticImageFile::parse(&text.replace("draws = 6\n", "")).unwrap();
    let found = survey(&file, &measured(&file, 3), &[], &|_, _| true).unwrap().unwrap();
    let ring = found.starts[0].ring.expect("a ring");
    assert!((ring.diameter_uas - 44.0).abs() < 3.0, "{ring:?}");
    assert!((ring.position_angle_deg - 170.0).abs() < 25.0, "{ring:?}");
}

/// An optimiser that is stopped is not at a minimum; one that begins where half of the pixels have no light leaves that place and
/// comes to a minimum, if another one: the loss of closures has several.
#[test]
fn exact_the_gradient_says_whether_a_fit_has_converged() {
    let file = StaticImageFile::parse(SETTINGS).unwrap();
    let measured = measured(&file, 2);
    let grid = file.image.grid().unwrap();
    let terms = measured.visibility_terms::<f64>(&file.loss, grid.pixels()).unwrap();
    let envelope = Envelope { profile: Profile::Gaussian, fwhm_uas: 45.0 }.shares(grid);
    let problem = ImageProblem {
        terms: &terms,
        frames: (0..measured.times.len()).collect(),
        priors: &[],
        envelope: Some((&envelope, 1.0)),
        strength: 1.0,
        flux: FluxPrior { jy: 0.6, sigma_jy: 0.05 },
        side: 32,
    };
    let begin = problem.parameters_of(&start::image(file.image.starts[0], grid));
    let solved = |begin: &[f64], most: usize| solve::solve(&problem, begin, most, &|| true);
    assert!(!solved(&begin, 1).unwrap().has_converged);
    let found = solved(&begin, 2000).unwrap();
    assert!(found.has_converged, "{} after {}", found.loss, found.iterations);
    let mut dark = begin.clone();
    (0..1024).filter(|k| k % 32 < 14).for_each(|k| dark[k] -= 60.0);
    let first = problem.value_and_gradient(&dark, &mut vec![0.0; dark.len()]);
    let raised = solved(&dark, 2000).unwrap();
    assert!(raised.has_converged && raised.loss < 0.1 * first, "{} {first}", raised.loss);
}

/// A ring through gains is fitted best by a crescent with its diameter and direction, and not as well by what has no hole.
#[test]
fn exact_shapes_tell_a_ring_from_what_has_no_hole() {
    let file = StaticImageFile::parse(SETTINGS).unwrap();
    let found = fit_shapes(&file, &measured(&file, 2), &|| true).unwrap().unwrap();
    let best = best_shape(found.iter()).unwrap();
    assert_eq!(best.shape, Shape::Crescent, "{found:?}");
    let [diameter, width, direction] = [0, 1, 2].map(|k| best.sizes[k].1);
    assert!((diameter - 44.0).abs() < 2.0 && (width - 16.0).abs() < 5.0, "{diameter} {width}");
    assert!((direction - 170.0).abs() < 10.0, "{direction}");
    for fit in found.iter().filter(|fit| !fit.shape.is_ring()) {
        assert!(fit.criterion > best.criterion + 10.0, "{fit:?}");
    }
}

/// A disc is filled, and two knots leave gaps on the circle that joins them; a crescent that is dark on one side has one gap.
#[test]
fn exact_a_disc_and_a_double_have_no_ring() {
    let grid = grid(60);
    let light = |of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let all = (0..grid.pixels()).map(|k| grid.place_uas(k));
        all.map(|[east, north]| of(east, north)).collect()
    };
    let bell = |x: f64| (-4.0 * core::f64::consts::LN_2 * x * x).exp();
    let disc = light(&|x, y| {
        1.0 / (1.0 + (x.hypot(y) - 30.0).exp()) + 0.2 * bell((x.hypot(y) - 24.0) / 8.0)
    });
    assert_eq!(Ring::measure(&disc, grid, &RADII), None);
    let knot = |x: f64, y: f64| bell(x.hypot(y) / 14.0);
    let double = light(&|x, y| knot(x - 18.0, y) + 0.8 * knot(x + 18.0, y));
    assert_eq!(Ring::measure(&double, grid, &RADII), None);
    let crescent = ring(grid, [42.0, 14.0], [0.0, 0.0], [0.9, 170.0]);
    assert!(Ring::measure(&crescent, grid, &RADII).is_some());
}

/// A watch that says no ends the search without a result; too few frames to hold some out are an error.
#[test]
fn exact_the_search_can_be_stopped() {
    let file = StaticImageFile::parse(SETTINGS).unwrap();
    assert!(survey(&file, &measured(&file, 4), &[], &|_, _| false).unwrap().is_none());
    let text = format!("{SETTINGS}[strength]\nvalues = [0.5, 1.0]\nfolds = 9\n");
    let file = StaticImageFile::parse(&text).unwrap();
    let data = data::total_intensity(&file, observed(4), "data").unwrap();
    let joined = data::joined(vec![("data".to_owned(), data)], "", file.strength.as_ref());
    let error = joined.err().unwrap().to_string();
    assert!(error.contains("strength.folds = 9 is not allowed: 8 at most"), "{error}");
}
