//! Posterior predictive checks: how probable data are that are at least as far from a draw of the posterior as the measured
//! ones (Gelman, Meng & Stern 1996, Statistica Sinica 6, 733).
//!
//! For Gaussian errors χ² of data that a draw predicts has a distribution of its own, whatever the draw: no data have to be
//! simulated. The mean over the draws of the probability of a larger one is near 0 where the model cannot make such data,
//! near 1 where it follows their noise.

use super::{EXCESS, Errors, Expected, GROUP_EXCESS, Moments, Part, Statistics, Tested};
use statrs::function::gamma::checked_gamma_ur;

/// Probabilities, under one draw, of data of one kind that are at least as far from it as the measured ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// Probability of χ² of all.
    pub all: f64,
    /// Probability of the least probable χ² among baselines, triangles or quadrangles.
    pub groups: Option<f64>,
    /// Probability of the least probable χ² among frames.
    pub frames: Option<f64>,
    /// The least of the three if the model has an error as large as the verdict of a fit lets pass.
    pub beyond: f64,
}

impl Tested {
    /// Returns the probabilities of these residuals from a draw; none of data whose σ is no error.
    pub fn predicted(&self) -> Option<Predicted> {
        if self.errors == Errors::Weight {
            return None;
        }
        let Expected { chi2, spread, .. } = self.expected;
        let Statistics { all, groups, frames, .. } = &self.statistics;
        let of = |[whole, part]: [f64; 2]| -> Option<[Option<f64>; 3]> {
            // χ² that an error of the model has added is no matter of chance, up to what is let pass.
            let larger = |of: &Part, Moments { mean, spread }: Moments, passed: f64| {
                let added = ((of.per_datum()? - mean).clamp(0.0, passed)) / mean;
                // Over that of Gaussian errors with this mean: that of closure quantities of faint sources is larger.
                let excess = spread / (mean * (2.0 / of.freedom.max(1.0)).sqrt());
                probability_of_larger(of, mean * (1.0 + added), excess)
            };
            let groups = groups.iter().map(|(key, of)| (of, self.of_group(key, of)));
            let frames = frames.iter().enumerate().map(|(k, of)| (of, self.of_frame(k, of)));
            let whole = larger(all, Moments { mean: chi2, spread }, whole * chi2)?;
            Some([
                Some(whole),
                least(groups.filter_map(|(of, expected)| larger(of, expected, part))),
                least(frames.filter_map(|(of, expected)| larger(of, expected, part))),
            ])
        };
        let [all, groups, frames] = of([0.0, 0.0])?;
        let beyond = of([EXCESS, GROUP_EXCESS])?.into_iter().flatten().fold(1.0, f64::min);
        Some(Predicted { all: all?, groups, frames, beyond })
    }
}

/// Returns the probability that χ² of as many data is larger: a gamma distribution with n times the mean of one datum, and
/// √(2 n) times that and `excess` for its standard deviation. χ² of Gaussian data has mean 1 and excess 1. None without
/// data.
fn probability_of_larger(part: &Part, mean: f64, excess: f64) -> Option<f64> {
    if part.count() == 0 || part.chi2.is_nan() {
        return None;
    }
    // A gamma distribution of shape k and scale θ has the mean k θ and the deviation √k θ.
    let shape = 0.5 * part.freedom / (excess * excess);
    let scaled = shape * part.chi2 / (part.freedom * mean);
    // The incomplete gamma function refuses infinity.
    if scaled == f64::INFINITY {
        return Some(0.0);
    }
    checked_gamma_ur(shape, scaled).ok().filter(|p| p.is_finite()).map(|p| p.clamp(0.0, 1.0))
}

/// Returns the probability of the least of independent probabilities, each uniform between 0 and 1: 1 − (1 − p)ⁿ.
fn least(all: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, least) = all.fold((0, 1.0f64), |(count, least), p| (count + 1, least.min(p)));
    // Keeps its digits where p is small.
    (count > 0).then(|| -(f64::from(count) * (-least).ln_1p()).exp_m1())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::verdict::tests::residual;
    use kerrlight_vlbi::data_terms::Residual;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    /// Tables of χ²: upper 5 % points of 1, 10 and 100 degrees of freedom; and a normal distribution for very many.
    #[test]
    fn exact_tails() {
        for (freedom, chi2) in [(1.0, 3.841_458_82), (10.0, 18.307_038_05), (100.0, 124.342_113_4)]
        {
            let found = probability_of_larger(&Part { freedom, chi2 }, 1.0, 1.0).unwrap();
            assert!((found - 0.05).abs() < 1e-8, "{freedom} {found}");
        }
        let freedom = 2e6f64;
        for (deviations, tail) in [(0.0, 0.5), (2.0, 0.022_750)] {
            let chi2 = freedom + deviations * (2.0 * freedom).sqrt();
            let found = probability_of_larger(&Part { freedom, chi2 }, 1.0, 1.0).unwrap();
            assert!((found - tail).abs() < 5e-4, "{found}");
        }
        // Twice the mean, or twice the standard deviation: a quarter of the degrees of freedom.
        let twice = Part { freedom: 40.0, chi2: 2.0 * 18.307_038_05 };
        let found = probability_of_larger(&Part { freedom: 10.0, ..twice }, 2.0, 1.0).unwrap();
        assert!((found - 0.05).abs() < 1e-8);
        let wide = Part { freedom: 40.0, chi2: 4.0 * 18.307_038_05 };
        assert!((probability_of_larger(&wide, 1.0, 2.0).unwrap() - 0.05).abs() < 1e-8);
        assert!(probability_of_larger(&Part::default(), 1.0, 1.0).is_none());
    }

    #[test]
    fn exact_least_of_several() {
        assert!((least([0.5, 0.1].into_iter()).unwrap() - 0.19).abs() < 1e-12);
        let small = least([1e-20, 0.3, 0.9].into_iter()).unwrap();
        assert!((small - 3e-20).abs() < 1e-30);
        assert_eq!(least([0.0, 0.5].into_iter()), Some(0.0));
        assert!(least(std::iter::empty()).is_none());
    }

    /// Noise of 20 frames of 6 baselines, with `offset` in the data of one baseline.
    fn tested(seed: u64, offset: f64) -> Tested {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut datum = |pair: [u16; 2]| {
            let off = if pair == [0, 1] { offset } else { 0.0 };
            residual(random.sample::<f64, _>(StandardNormal) + off, 0.0, &pair)
        };
        let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        let frame = |_| pairs.into_iter().map(&mut datum).collect();
        let frames: Vec<Vec<Residual>> = (0..20).map(frame).collect();
        Tested::gaussian(Statistics::of(frames, 1), Errors::Known)
    }

    /// All three are uniform between 0 and 1 for the right model, and the one of baselines sees what is wrong with one.
    #[test]
    fn exact_probabilities_are_uniform() {
        let all: Vec<Predicted> = (0..400).filter_map(|k| tested(k, 0.0).predicted()).collect();
        assert_eq!(all.len(), 400);
        let kinds: [fn(&Predicted) -> f64; 3] =
            [|p| p.all, |p| p.groups.unwrap(), |p| p.frames.unwrap()];
        for of in kinds {
            let mut sorted: Vec<f64> = all.iter().map(of).collect();
            sorted.sort_by(f64::total_cmp);
            let from = |(k, p): (usize, &f64)| (p - (k as f64 + 0.5) / 400.0).abs();
            // Kolmogorov and Smirnov: more than 0.098 once in a thousand.
            let distance = sorted.iter().enumerate().map(from).fold(0.0, f64::max);
            assert!(distance < 0.098, "{distance}");
        }
        let wrong = tested(1, 2.5).predicted().unwrap();
        assert!(wrong.groups.unwrap() < 1e-6 && wrong.groups.unwrap() < wrong.all, "{wrong:?}");
        assert!(wrong.beyond < 1e-3, "{wrong:?}");
        assert!(Tested { errors: Errors::Weight, ..tested(1, 0.0) }.predicted().is_none());
    }
}
