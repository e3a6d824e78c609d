//! Polarised images: gradients, numbers of known patterns, and a spiral of electric vectors seen through an array with
//! gains and leakage.

use super::*;
use crate::data;
use crate::settings::StaticImageFile;
use crate::survey;
use crate::survey::{Stage, SurveyWatch};
use crate::tests::{SETTINGS, assert_slopes, grid, night, spoil};
use core::sync::atomic::{AtomicUsize, Ordering};
use kerrlight_vlbi::noise::apply_leakage;
use kerrlight_vlbi::observation::{Basis, Observation};
use kerrlight_vlbi::operator::{ImageGrid, Method, Operator, Pulse, Transform};
use kerrlight_vlbi::polarimetry::LeakageTable;
use num_complex::Complex;

/// The settings of a static image with those of its polarisation.
fn settings() -> String {
    let text = SETTINGS.replace("draws = 6", "draws = 4");
    format!(
        "{text}[polarization]\ndata = \"polarimetric-ratios\"\nleakage_left = 0.0\nsmoothness = 0.01\niterations = 200\n\
         beam_uas = 10.0\n"
    )
}

/// A ring of 44 µas, 16 µas wide and 0.6 Jy with m = 0.3 e^{i(2φ + 60°)} all around: I, Q and U, Jy.
fn truth(grid: ImageGrid) -> Vec<f64> {
    let light = |k: usize| {
        let [east, north] = grid.place_uas(k);
        let off = (east.hypot(north) - 22.0) / 16.0;
        (-4.0 * core::f64::consts::LN_2 * off * off).exp()
    };
    let sum: f64 = (0..grid.pixels()).map(light).sum();
    let stokes = |part: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..grid.pixels()).map(|k| 0.6 / sum * light(k) * part(k)).collect()
    };
    let twice = |k: usize| {
        let [east, north] = grid.place_uas(k);
        2.0 * east.atan2(north) + 60f64.to_radians()
    };
    [stokes(&|_| 1.0), stokes(&|k| 0.3 * twice(k).cos()), stokes(&|k| 0.3 * twice(k).sin())]
        .concat()
}

/// Simulates a night of the array of 2017, with thermal noise, gains of 20 % and phases that are lost.
fn observed(seed: u64, leakage: Option<f64>) -> Observation {
    let grid = grid(96);
    let mut seen = night().0;
    assert!(seen.basis == Basis::Circular);
    let uv: Vec<[f64; 2]> = seen.rows.iter().map(|row| row.uv).collect();
    let images = vec![uv; 3];
    let sky = Transform::<f64>::new(grid, Pulse::Triangle, &images, Method::Direct, 0).unwrap();
    let mut v = vec![Complex::default(); sky.data()];
    sky.forward(&truth(grid), &mut v);
    let (count, j) = (seen.rows.len(), Complex::<f64>::i());
    for (k, row) in seen.rows.iter_mut().enumerate() {
        let [i, q, u] = [0, 1, 2].map(|stokes| v[stokes * count + k]);
        row.products = [i, i, q + j * u, q - j * u];
    }
    if let Some(amplitude) = leakage {
        apply_leakage(&mut seen, amplitude, seed).unwrap();
    }
    spoil(&mut seen, seed);
    seen
}

/// Numbers of radial, tangential and tilted vectors around a ring, and of one direction everywhere.
#[test]
fn exact_numbers_of_known_patterns() {
    let grid = grid(96);
    let images = truth(grid);
    let found = LinearPolarization::measure(&images, grid, [0.0, 0.0], 1.0);
    assert!(found.net_fraction < 1e-3, "{found:?}");
    assert!((found.mean_fraction - 0.3).abs() < 1e-3 && (found.beta2 - 0.3).abs() < 1e-3);
    assert!((found.beta2_deg - 60.0).abs() < 0.1, "{found:?}");
    // A beam mixes directions.
    let wide = LinearPolarization::measure(&images, grid, [0.0, 0.0], 20.0);
    assert!(wide.mean_fraction < 0.25 && (wide.beta2_deg - 60.0).abs() < 0.1, "{wide:?}");
    let n = grid.pixels();
    let light = &images[..n];
    let even: Vec<f64> = light
        .iter()
        .copied()
        .chain(light.iter().map(|i| 0.1 * i * 50f64.to_radians().cos()))
        .chain(light.iter().map(|i| 0.1 * i * 50f64.to_radians().sin()))
        .collect();
    let found = LinearPolarization::measure(&even, grid, [0.0, 0.0], 20.0);
    assert!((found.net_fraction - 0.1).abs() < 1e-9 && (found.net_evpa_deg - 25.0).abs() < 1e-9);
    assert!((found.mean_fraction - 0.1).abs() < 1e-9 && found.beta2 < 1e-6, "{found:?}");
}

/// Gradients agree with central differences, for ratios and for visibilities with gains.
#[test]
fn exact_gradients_of_the_polarised_loss() {
    for (kind, smoothness) in [("polarimetric-ratios", 0.3), ("polarized-visibilities", 0.0)] {
        let file =
            StaticImageFile::parse(&settings().replace("polarimetric-ratios", kind)).unwrap();
        let measured = data::polarized(&file, observed(1, None), "data");
        let measured = measured.unwrap().unwrap();
        let loss = file.polarization.as_ref().unwrap().loss();
        let grid = file.image.grid().unwrap();
        let terms = measured.visibility_terms::<f64>(&[loss], grid.pixels()).unwrap();
        let light = &truth(grid)[..grid.pixels()];
        let problem = PolarizedProblem {
            term: &*terms[0].term,
            frames: (0..measured.times.len()).collect(),
            light,
            smoothness,
            side: 32,
        };
        let n = problem.parameters();
        let x: Vec<f64> = (0..n).map(|k| 0.4 * (0.37 * k as f64).sin()).collect();
        let numbers = [0, 330, 530, 700, 1024 + 330, 1024 + 600, n - 1];
        assert_slopes(&x, 1e-3, &numbers, |x, gradient| problem.value_and_gradient(x, gradient));
    }
}

fn found(text: &str, seed: u64, leakage: Option<f64>) -> PolarizedSurvey {
    found_while(text, seed, leakage, &|_, _| true).unwrap()
}

fn found_while(
    text: &str,
    seed: u64,
    leakage: Option<f64>,
    goes_on: &SurveyWatch<'_>,
) -> Option<PolarizedSurvey> {
    let file = StaticImageFile::parse(text).unwrap();
    let seen = observed(seed, leakage);
    let measured = data::total_intensity(&file, seen.clone(), "data").unwrap();
    let intensity = survey(&file, &measured, &[], &|_, _| true).unwrap().unwrap();
    let polarized = data::polarized(&file, seen, "data").unwrap().unwrap();
    survey_polarized(&file, &polarized, &intensity, goes_on).unwrap()
}

/// Ratios know the spiral although gains are lost: its angle within 10° and three stated errors, its strength as the beam
/// sees that of the truth, χ² near 1.
#[test]
fn exact_a_spiral_is_found_through_gains() {
    let grid = grid(96);
    let expected = LinearPolarization::measure(&truth(grid), grid, [0.0, 0.0], 10.0);
    let found = found(&settings(), 2, None);
    let numbers = found.found.numbers;
    let error = found.error(|numbers| numbers.beta2_deg, Some(360.0)).unwrap();
    let off = (numbers.beta2_deg - 60.0).abs();
    assert!(off < 10.0 && off < 3.0 * error.max(1.0), "{numbers:?} ± {error}");
    assert!((numbers.beta2 - expected.beta2).abs() < 0.06, "{numbers:?} {expected:?}");
    assert!((0.6..1.4).contains(&found.found.chi2), "{}", found.found.chi2);
    assert_eq!((found.draws.len(), found.leakage.is_none()), (4, true));
}

fn beside_leakage() -> String {
    settings().replace("polarimetric-ratios", "polarized-visibilities").replace(
        "[[loss]]\ndata = \"amplitudes\"",
        "[instrument.leakage]\namplitude = 0.1\nrounds = 8\n[[loss]]\ndata = \"amplitudes\"",
    )
}

/// A watch that says no ends the search without a result, at the first image and in a round of leakage.
#[test]
fn exact_the_search_for_leakage_can_be_stopped() {
    for images in [0, 1, 2] {
        let solved = AtomicUsize::new(0);
        // Told of each image before its steps, with 0, and at its end, with 1.
        let goes_on = |stage: Stage, done: usize| {
            let at_end = stage == Stage::Strengths && done == 1;
            !at_end || solved.fetch_add(1, Ordering::Relaxed) < images
        };
        assert!(found_while(&beside_leakage(), 3, Some(0.05), &goes_on).is_none());
        assert_eq!(solved.load(Ordering::Relaxed), images + 1);
    }
}

/// Visibilities with free gains find it beside leakage of 5 %, and a quarter of that is left of the leakage: what is wrong with
/// total intensity, which is held, ends in it.
#[test]
fn exact_a_spiral_is_found_beside_leakage() {
    let text = beside_leakage();
    let found = found(&text, 3, Some(0.05));
    let numbers = found.found.numbers;
    assert!((numbers.beta2_deg - 60.0).abs() < 12.0, "{numbers:?}");
    let leakage = found.leakage.expect("leakage");
    assert!(leakage.moved < 0.01, "{}", leakage.moved);
    let mut again = observed(3, None);
    let truth = apply_leakage(&mut again, 0.05, 3).unwrap();
    let exact = vec![[0.0; 2]; truth.len()];
    let truth = LeakageTable::new(&again.stations, &truth, &exact, |_| true);
    let distance = leakage.table.distance(&truth).unwrap();
    assert!(distance.rms < 0.3 * distance.size && distance.size > 0.04, "{distance:?}");
    assert!((0.6..1.5).contains(&found.found.chi2), "{}", found.found.chi2);
}

/// Errors for what varies and what leaks are added where they belong; data without Q and U are refused.
#[test]
fn exact_errors_of_polarised_data() {
    let rows = |text: &str| {
        let file = StaticImageFile::parse(text).unwrap();
        let measured = data::polarized(&file, observed(1, None), "data");
        measured.unwrap().unwrap().visibilities.unwrap().0.rows
    };
    let plain = rows(&settings());
    let more = rows(&settings().replace(
        "leakage_left = 0.0",
        "leakage_left = 0.02\nvariability = { jy = 0.01, uv = 2e9, power = 2.0 }",
    ));
    for (a, b) in plain.iter().zip(&more) {
        assert_eq!(a.noise_sigma[0], b.noise_sigma[0]);
        let light = 0.5 * (a.products[0] + a.products[1]).norm();
        let length = a.uv[0].hypot(a.uv[1]);
        let varies = 0.01 / (1.0 + (length / 2e9).powi(2));
        let expected = a.noise_sigma[2].hypot(0.02 * 2f64.sqrt() * light).hypot(varies);
        assert!((b.noise_sigma[2] - expected).abs() < 1e-14);
    }
    let file = StaticImageFile::parse(&settings()).unwrap();
    let intensity = observed(1, None).total_intensity();
    let error = data::polarized(&file, intensity, "data").err().unwrap();
    assert!(error.to_string().contains("there is no RL or LR"), "{error}");
}

#[test]
fn bad_settings_of_polarisation_are_named() {
    for (from, to, says) in [
        ("\"polarimetric-ratios\"", "\"amplitudes\"", "polarization.data = \"amplitudes\" is not"),
        ("smoothness = 0.01", "smoothness = 0.0", "polarization.smoothness = 0 is not allowed"),
        ("beam_uas = 10.0", "", "missing field `beam_uas`"),
        (
            "beam_uas = 10.0",
            "beam_uas = 10.0\nstrength = { values = [1.0], folds = 2 }",
            "length of polarization.strength.values = 1",
        ),
        (
            "[[loss]]\ndata = \"amplitudes\"",
            "[instrument.leakage]\namplitude = 0.1\nrounds = 8\n[[loss]]\ndata = \"amplitudes\"",
            "instrument.leakage needs polarization.data = \"polarized-visibilities\"",
        ),
    ] {
        assert!(settings().contains(from));
        let error = StaticImageFile::parse(&settings().replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(says), "{to}: {error}");
    }
    // Phases that nothing tells.
    let text = settings().replace("polarimetric-ratios", "polarized-visibilities");
    assert!(StaticImageFile::parse(&text).is_ok());
    let (before, gains) = text.split_once("[instrument.gains]").unwrap();
    let (_, after) = gains.split_once("\n[").unwrap();
    let error = StaticImageFile::parse(&format!("{before}[{after}")).unwrap_err().to_string();
    assert!(error.contains("needs [instrument.gains]"), "{error}");
}
