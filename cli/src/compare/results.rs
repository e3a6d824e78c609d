//! Results of a case on pages: numbers, a small part of its results.json.

use super::labels::{ONE_CHI2, RESULTS, result, verdict_of};
use serde_json::Value;

/// Numbers of a case by their names, and its verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Results {
    /// Numbers by their places in [`RESULTS`].
    numbers: Vec<(u8, f64)>,
    /// χ² of each kind of data.
    chi2: Vec<(String, f64)>,
    /// Verdict: whether the case explains its data, in a word or two.
    pub verdict: &'static str,
}

impl Results {
    /// Takes the results of a fit.
    pub fn of(results: &Value) -> Self {
        let known = RESULTS.iter().enumerate();
        let number = |(k, (key, ..)): (usize, &(&str, _, _, _))| {
            Some((u8::try_from(k).ok()?, result(results, key)?))
        };
        let kinds = results["chi2_per_datum"].as_object().into_iter().flatten();
        let chi2 = |(kind, _): (&String, _)| {
            let name = kind.replace(' ', "-");
            let chi2 = result(results, &format!("{ONE_CHI2}{name}"))?;
            Some((name, chi2))
        };
        Results {
            numbers: known.filter_map(number).collect(),
            chi2: kinds.filter_map(chi2).collect(),
            verdict: verdict_of(results),
        }
    }

    /// One of them.
    pub fn get(&self, value: &str) -> Option<f64> {
        if let Some(kind) = value.strip_prefix(ONE_CHI2) {
            return self.chi2.iter().find(|(name, _)| name == kind).map(|(_, x)| *x);
        }
        self.number(RESULTS.iter().position(|(key, ..)| *key == value)?)
    }

    /// Returns the number of a place in [`RESULTS`].
    pub fn number(&self, place: usize) -> Option<f64> {
        self.numbers.iter().find(|(k, _)| usize::from(*k) == place).map(|(_, x)| *x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn exact_numbers_are_those_of_the_fit() {
        let all = json!({
            "psnr_db": 3.5, "nrmse": null, "steps": 7, "verdict": {"outcome": "explained"},
            "chi2_per_datum": {"amplitudes": 1.5, "closure phases": 2.5},
        });
        let results = Results::of(&all);
        for value in ["psnr_db", "nrmse", "steps", "chi2", "chi2.amplitudes", "chi2.closure-phases"]
        {
            assert_eq!(results.get(value), result(&all, value), "{value}");
        }
        assert_eq!((results.get("steps"), results.verdict), (Some(7.0), "yes"));
        assert!(RESULTS.len() <= 1 + usize::from(u8::MAX));
    }
}
