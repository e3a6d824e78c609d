//! Posterior predictive checks: means over the draws of the probabilities of data that are at least as far from them as the
//! measured ones.

use super::Kept;
use crate::report;
use serde::{Deserialize, Serialize};

/// Probabilities below which data are not what the draws predict.
const WRONG: f64 = 1e-3;

/// Posterior predictive p-values of one kind of data, under a draw or in the mean over all.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Check {
    /// The kind of data.
    pub data: String,
    /// χ² of the measured data over their number.
    pub chi2_per_datum: f64,
    /// Probability of a larger χ² of all data.
    pub larger_chi2: f64,
    /// Probability of a less probable χ² of any baseline, triangle or quadrangle.
    pub larger_on_a_baseline: Option<f64>,
    /// Probability of a less probable χ² of any frame.
    pub larger_in_a_frame: Option<f64>,
    /// The least of the three if the model has an error as large as the verdict of a fit lets pass.
    pub beyond_what_passes: f64,
}

/// Means over the draws, of all kinds of data that every one was compared with.
pub fn checks(draws: &[Kept]) -> Vec<Check> {
    let kinds = draws.first().map_or(&[][..], |draw| &draw.numbers.predicted);
    kinds.iter().filter_map(|kind| check(&kind.data, draws)).collect()
}

fn check(data: &str, draws: &[Kept]) -> Option<Check> {
    let find = |draw: &'_ Kept| draw.numbers.predicted.iter().find(|p| p.data == data).cloned();
    let of: Vec<Check> = draws.iter().map(find).collect::<Option<_>>()?;
    let mean = |value: &dyn Fn(&Check) -> Option<f64>| -> Option<f64> {
        let values: Vec<f64> = of.iter().map(value).collect::<Option<_>>()?;
        Some(values.iter().sum::<f64>() / values.len() as f64)
    };
    Some(Check {
        data: data.to_owned(),
        chi2_per_datum: mean(&|p| Some(p.chi2_per_datum))?,
        larger_chi2: mean(&|p| Some(p.larger_chi2))?,
        larger_on_a_baseline: mean(&|p| p.larger_on_a_baseline),
        larger_in_a_frame: mean(&|p| p.larger_in_a_frame),
        beyond_what_passes: mean(&|p| Some(p.beyond_what_passes))?,
    })
}

impl Check {
    /// Describes it, in words.
    pub fn sentence(&self) -> String {
        let name = match self.data.as_str() {
            "image" => "images".to_owned(),
            name => name.replace('-', " "),
        };
        let least = [Some(self.larger_chi2), self.larger_on_a_baseline, self.larger_in_a_frame];
        let least = least.into_iter().flatten().fold(1.0, f64::min);
        let chi2 = self.chi2_per_datum;
        if self.beyond_what_passes >= WRONG && least < WRONG {
            return format!(
                "Data ({name}) are such as the draws predict, but for an error of the model that is smaller than those of the \
                 data: by chance alone data would be as far off with a probability of {} (χ² {chi2:.2} per data point).",
                probability(least)
            );
        }
        if least < WRONG {
            return format!(
                "Data ({name}) are not what the draws predict: data that are as far off come about with a probability of {} \
                 (χ² {chi2:.2} per data point).",
                probability(least)
            );
        }
        format!(
            "Data ({name}) are such as the draws predict: a larger χ² has a probability of {} (χ² {chi2:.2} per data point).",
            probability(self.larger_chi2)
        )
    }
}

fn probability(p: f64) -> String {
    // A far tail underflows to 0, which is no probability.
    if p < 1e-300 {
        return "less than 1e-300".to_owned();
    }
    if p < 0.01 { format!("{p:.0e}") } else { format!("{p:.2}") }
}

/// All of them for the page; none without any.
pub fn table(checks: &[Check]) -> Option<report::Table> {
    let row = |check: &Check| {
        let cell = |p: Option<f64>| p.map_or("–".to_owned(), probability);
        let chi2 = format!("{:.3}", check.chi2_per_datum);
        let all = [Some(check.larger_chi2), check.larger_on_a_baseline, check.larger_in_a_frame];
        [check.data.clone(), chi2].into_iter().chain(all.map(cell)).collect()
    };
    (!checks.is_empty()).then(|| {
        report::Table::new(
            "Posterior predictive checks",
            "Probability of data that are at least as far from a draw as the measured ones, if the model and the draw are \
             right: by χ² of all data, by the least probable baseline (triangle, quadrangle), and by the least \
             probable frame. Means over the draws. Near 0 the model cannot make such data; near 1 it follows their \
             noise, or their errors are overestimated.",
            ["data", "χ² per data point", "larger χ²", "on a baseline", "in a frame"],
            checks.iter().map(row).collect(),
        )
    })
}
