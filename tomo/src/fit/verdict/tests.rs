//! Residuals whose law is known.

use super::*;
use kerrlight_vlbi::data_terms::Residual;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

pub(super) fn residual(value: f64, datum: f64, stations: &[u16]) -> Residual {
    Residual { value, datum, freedom: 1.0, stations: stations.to_vec() }
}

/// Baselines of four stations, real and imaginary part, in so many frames: (frame, number, noise) to a residual.
fn baselines(frames: usize, of: impl Fn(usize, usize, f64) -> f64) -> Statistics {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let mut frame = |k: usize| -> Vec<Residual> {
        let pairs = (0..4u16).flat_map(|a| (a + 1..4).flat_map(move |b| [[a, b], [a, b]]));
        let noise = |(at, pair): (usize, [u16; 2])| {
            residual(of(k, at, StandardNormal.sample(&mut random)), 10.0, &pair)
        };
        pairs.enumerate().map(noise).collect()
    };
    let frames: Vec<_> = (0..frames).map(&mut frame).collect();
    Statistics::of(frames, 1)
}

fn verdict(statistics: Statistics, errors: Errors) -> Verdict {
    judge([Tested::gaussian(statistics, errors)].iter(), None)
}

#[test]
fn exact_noise_about_the_truth_is_explained() {
    for errors in [Errors::Known, Errors::Stated, Errors::Assumed] {
        for frames in [1, 3, 40, 2000] {
            let found = verdict(baselines(frames, |_, _, noise| noise), errors);
            assert_eq!(found, Verdict { outcome: Outcome::Explained, reasons: vec![] });
        }
    }
    let pixels = (0..20).map(|k| {
        let mut random = Pcg64Mcg::seed_from_u64(k);
        (0..256).map(|_| residual(StandardNormal.sample(&mut random), 1.0, &[])).collect()
    });
    let found = verdict(Statistics::of(pixels, 16), Errors::Assumed);
    assert_eq!(found.outcome, Outcome::Explained, "{:?}", found.reasons);
}

/// Sums by hand: two frames of three baselines, one of them not there in the second.
#[test]
fn exact_statistics_are_sums() {
    let one = |value: f64, stations: [u16; 2]| residual(value, 2.0, &stations);
    let frames = [
        vec![one(1.0, [0, 1]), one(2.0, [0, 2]), one(-3.0, [1, 2])],
        vec![one(4.0, [0, 1]), one(-1.0, [1, 2])],
    ];
    let found = Statistics::of(frames, 1);
    assert_eq!((found.all.count(), found.chi2()), (5, Some(31.0 / 5.0)));
    assert_eq!(found.mean(), Some(0.6));
    assert_eq!(found.misfit(), Some((31.0f64 / 20.0).sqrt()));
    assert_eq!(found.groups[&vec![0, 1]], Part { freedom: 2.0, chi2: 17.0 });
    assert_eq!(found.stations[&2], Part { freedom: 3.0, chi2: 14.0 });
    assert_eq!(found.frames[1], Part { freedom: 2.0, chi2: 17.0 });
    // (1, 4) and (−3, −1).
    assert_eq!(found.in_time.correlation(), Some(7.0 / (10.0f64 * 17.0).sqrt()));
    let plain = |value| residual(value, 0.0, &[]);
    let image = Statistics::of([[1.0, 2.0, 3.0, 4.0].map(plain).to_vec()], 2);
    assert_eq!((image.in_space.count(), image.misfit()), (2, None));
    assert_eq!(image.in_space.correlation(), Some(14.0 / (10.0f64 * 20.0).sqrt()));
}

#[test]
fn exact_what_is_wrong_is_named() {
    let of = |f: fn(usize, usize, f64) -> f64| verdict(baselines(60, f), Errors::Known);
    let only = |found: Verdict, outcome: Outcome| {
        assert_eq!(found.outcome, outcome, "{:?}", found.reasons);
        found.reasons[0].fault.clone()
    };
    let large = only(of(|_, _, noise| 1.5 * noise), Outcome::Unexplained);
    assert_eq!(large, Fault::Large);
    let small = only(of(|_, _, noise| 0.7 * noise), Outcome::FitsNoise);
    assert_eq!(small, Fault::Small);
    let mean = only(of(|_, _, noise| 0.85 * noise + 0.5), Outcome::Unexplained);
    assert!(matches!(mean, Fault::Mean(mean) if (mean - 0.5).abs() < 0.1), "{mean:?}");
    let slow = only(
        of(|frame, at, noise| 0.7 * (noise + (0.3 * frame as f64 + at as f64).sin() * 1.3)),
        Outcome::Unexplained,
    );
    assert!(matches!(slow, Fault::InTime(_)), "{slow:?}");
    let one = only(
        of(|_, at, noise| if at == 3 { 2.0 * noise } else { 0.85 * noise }),
        Outcome::Unexplained,
    );
    assert!(matches!(&one, Fault::Group(stations, _) if stations[..] == [0, 2]), "{one:?}");
    let nan = only(of(|_, _, _| f64::NAN), Outcome::Unexplained);
    assert_eq!(nan, Fault::NotFinite);
    assert_eq!(verdict(Statistics::default(), Errors::Known).outcome, Outcome::Unexplained);
}

/// The verdict on single baselines, triangles and frames alone.
fn of_groups(tested: &Tested) -> Verdict {
    let mut found = Verdict { outcome: Outcome::Explained, reasons: vec![] };
    judge_groups(0, tested, &mut found);
    found
}

/// A baseline with few data, within what chance gives it, hides none with many that is beyond.
#[test]
fn exact_each_baseline_is_judged_by_its_own_limit() {
    let mut statistics = Statistics::default();
    statistics.groups.insert(vec![0, 1], Part { freedom: 30.0, chi2: 30.0 * 2.25 });
    statistics.groups.insert(vec![0, 2], Part { freedom: 500.0, chi2: 500.0 * 2.1 });
    statistics.all = Part { freedom: 530.0, chi2: 530.0 };
    let found = of_groups(&Tested::gaussian(statistics, Errors::Known));
    let faults: Vec<&Fault> = found.reasons.iter().map(|reason| &reason.fault).collect();
    assert_eq!(faults, [&Fault::Group(vec![0, 2], 2.1)]);
}

/// A triangle of faint stations whose χ² is 3 in the mean over draws of the noise is no worse than others are at 1, and
/// another one at 3 is.
#[test]
fn exact_each_triangle_is_expected_to_be_as_its_draws_are() {
    let of = |weak: f64, strong: f64| {
        let mut statistics = Statistics::default();
        let parts = [(vec![0, 1, 2], weak), (vec![0, 1, 3], strong)];
        for (stations, chi2) in parts {
            statistics.groups.insert(stations, Part { freedom: 100.0, chi2: 100.0 * chi2 });
        }
        statistics.all = Part { freedom: 200.0, chi2: 100.0 * (weak + strong) };
        statistics
    };
    let draws = [of(2.8, 0.95), of(3.1, 1.0), of(3.1, 1.05)];
    let judged = |weak: f64, strong: f64| {
        let tested = Tested::gaussian(of(weak, strong), Errors::Known).among(&draws);
        (of_groups(&tested), tested.predicted().unwrap().groups.unwrap())
    };
    let (right, probability) = judged(3.2, 0.98);
    assert!(right.reasons.is_empty() && probability > 0.1, "{right:?} {probability}");
    let (wrong, probability) = judged(3.0, 3.0);
    assert!(matches!(&wrong.reasons[0].fault, Fault::Group(at, _) if at[..] == [0, 1, 3]));
    assert!(probability < 1e-6, "{probability}");
}

/// Errors of calibration last: only their size is judged.
#[test]
fn exact_calibration_may_be_correlated_in_time() {
    let slow = baselines(60, |frame, at, noise| {
        0.6 * (noise + (0.3 * frame as f64 + at as f64).sin() * 1.6)
    });
    assert_eq!(verdict(slow.clone(), Errors::Stated).outcome, Outcome::Explained);
    assert_eq!(verdict(slow, Errors::Known).outcome, Outcome::Unexplained);
}

/// Errors that many data share make χ² small, and residuals alike; they do not make it large.
#[test]
fn exact_shared_errors_are_judged_by_size_alone() {
    let of = |size: f64| {
        verdict(baselines(60, |frame, _, _| size * (0.3 * frame as f64).sin()), Errors::Shared)
    };
    assert_eq!(of(0.2).outcome, Outcome::Explained);
    assert_eq!(of(3.0).outcome, Outcome::Unexplained);
}

/// χ² of 24,000 data scatters by 0.009: 0.97 is less than a right model has.
#[test]
fn exact_less_than_a_right_model_has_is_noise() {
    let of = |size: f64, errors: Errors| {
        let residuals = baselines(2000, |_, _, noise| size.sqrt() * noise);
        Tested::gaussian(residuals, errors).follows_noise()
    };
    assert!(!of(1.0, Errors::Known) && of(0.96, Errors::Known) && of(0.96, Errors::Stated));
    assert!(!of(0.96, Errors::Shared) && !of(0.96, Errors::Weight));
}

/// A linear grid that has used up half of the data halves χ²; a quarter of it is too little all the same.
#[test]
fn exact_what_parameters_take_is_expected() {
    let of = |size: f64, taken: f64| {
        let mut residuals = baselines(60, |_, _, noise| size.sqrt() * noise);
        residuals.taken = taken;
        verdict(residuals, Errors::Known).outcome
    };
    assert_eq!(
        [of(0.6, 0.0), of(0.6, 0.5), of(0.3, 0.5)],
        [Outcome::FitsNoise, Outcome::Explained, Outcome::FitsNoise]
    );
    assert_eq!(of(1.2, 0.5), Outcome::Unexplained);
}

/// 147,000 pixels with an error of the model of 0.2 σ: the fit and its posterior say the same.
#[test]
fn exact_a_fit_and_its_draws_are_judged_alike() {
    let frames = |size: f64| {
        let mut random = Pcg64Mcg::seed_from_u64(8);
        let mut pixel = move || {
            let noise: f64 = StandardNormal.sample(&mut random);
            residual(size.sqrt() * noise, 9.0, &[])
        };
        (0..100).map(move |_| (0..1470).map(|_| pixel()).collect::<Vec<_>>())
    };
    for (size, outcome) in [(1.05, Outcome::Explained), (1.3, Outcome::Unexplained)] {
        let tested = Tested::gaussian(Statistics::of(frames(size), 42), Errors::Assumed);
        let found = tested.predicted().unwrap();
        assert!(found.all < 1e-6, "{found:?}");
        assert_eq!(found.beyond < 1e-3, outcome == Outcome::Unexplained, "{found:?}");
        assert_eq!(judge([tested].iter(), None).outcome, outcome);
    }
}

/// σ of noise-free data is a weight: how much of the data is left over is what counts.
#[test]
fn exact_noise_free_data_are_judged_by_what_is_left_over() {
    let of = |size: f64| verdict(baselines(9, move |_, _, noise| size * noise), Errors::Weight);
    assert_eq!(of(1e-3).outcome, Outcome::Reproduced);
    assert_eq!(of(0.9).outcome, Outcome::Reproduced);
    let left = of(3.0);
    assert_eq!(left.outcome, Outcome::Unexplained);
    assert!(matches!(left.reasons[0].fault, Fault::Misfit(part) if (part - 0.3).abs() < 0.05));
}

#[test]
fn exact_flux_at_zero_spacing_has_to_be_there() {
    let right = Tested::gaussian(baselines(60, |_, _, noise| noise), Errors::Stated);
    let of = |model_jy| ZeroSpacing { measured_jy: 2.3, error_jy: 0.02, model_jy, count: 30 };
    assert_eq!(judge([&right].into_iter(), Some(of(2.15))).outcome, Outcome::Explained);
    let missing = judge([&right].into_iter(), Some(of(1.6)));
    assert_eq!(missing.reasons, [Reason { term: None, fault: Fault::Flux }]);
    assert_eq!(missing.outcome, Outcome::Unexplained);
}
