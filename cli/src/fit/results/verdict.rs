//! Verdict: whether a fit explains its data, from the residuals of its last state, in words and for other
//! programs.

pub mod parts;
#[cfg(test)]
mod tests;

use crate::report::{Notice, Table, Tone};
use kerrlight_tomo::fit::verdict::{Errors, Outcome, Part, Tested, ZeroSpacing, worst};
pub use kerrlight_tomo::recovery::{DataVerdict, Evidence};
use kerrlight_tomo::recovery::{range_of, short};
use serde::Serialize;
use std::collections::BTreeMap;

/// The verdict, as results.json has it.
#[derive(Serialize)]
pub struct VerdictResults {
    outcome: Outcome,
    text: String,
    reasons: Vec<String>,
    data: Vec<TermResults>,
    #[serde(skip_serializing_if = "Option::is_none")]
    zero_spacing: Option<ZeroSpacing>,
}

/// Residuals of one kind of data.
#[derive(Serialize)]
struct TermResults {
    data: String,
    count: usize,
    chi2_per_datum: Option<f64>,
    sigma_is: Errors,
    mean: Option<f64>,
    misfit: Option<f64>,
    correlation_in_time: Option<f64>,
    correlation_in_space: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<ExpectedChi2>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_frame: Option<WorstFrame>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_group: Option<WorstGroup>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_station: Option<WorstStation>,
    /// χ² per data point by station.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    stations: BTreeMap<String, Option<f64>>,
}

#[derive(Serialize)]
struct ExpectedChi2 {
    mean: f64,
    deviation: f64,
    taken: f64,
}

#[derive(Serialize)]
struct WorstFrame {
    frame: usize,
    time: Option<f64>,
    chi2_per_datum: f64,
    count: usize,
}

#[derive(Serialize)]
struct WorstGroup {
    stations: String,
    chi2_per_datum: f64,
    count: usize,
}

#[derive(Serialize)]
struct WorstStation {
    station: String,
    chi2_per_datum: f64,
    count: usize,
}

impl From<&DataVerdict> for VerdictResults {
    fn from(judged: &DataVerdict) -> Self {
        let term = |(name, tested): &(String, Tested)| TermResults::new(judged, name, tested);
        Self {
            outcome: judged.verdict.outcome,
            text: judged.headline(),
            reasons: judged.reasons(),
            data: judged.terms.iter().map(term).collect(),
            zero_spacing: judged.flux,
        }
    }
}

impl TermResults {
    fn new(judged: &DataVerdict, name: &str, tested: &Tested) -> Self {
        let Tested { statistics, errors, expected, .. } = tested;
        let expected =
            ExpectedChi2 { mean: expected.chi2, deviation: expected.spread, taken: expected.taken };
        let frame = worst(statistics.frames.iter().enumerate());
        let station =
            |(station, part): (&u16, &Part)| (judged.names(&[*station]), part.per_datum());
        Self {
            data: name.to_owned(),
            count: statistics.all.count(),
            chi2_per_datum: statistics.chi2(),
            sigma_is: *errors,
            mean: statistics.mean(),
            misfit: statistics.misfit(),
            correlation_in_time: statistics.in_time.correlation(),
            correlation_in_space: statistics.in_space.correlation(),
            expected: (*errors != Errors::Weight).then_some(expected),
            worst_frame: frame.map(|(frame, part, chi2_per_datum)| {
                let time = judged.times.get(frame).copied();
                WorstFrame { frame, time, chi2_per_datum, count: part.count() }
            }),
            worst_group: worst(statistics.groups.iter()).map(|(group, part, chi2_per_datum)| {
                let stations = judged.names(group);
                WorstGroup { stations, chi2_per_datum, count: part.count() }
            }),
            worst_station: worst(statistics.stations.iter()).map(|(at, part, chi2_per_datum)| {
                let station = judged.names(&[*at]);
                WorstStation { station, chi2_per_datum, count: part.count() }
            }),
            stations: statistics.stations.iter().map(station).collect(),
        }
    }
}

/// Returns the notice at the top of the page.
pub fn notice(judged: &DataVerdict) -> Notice {
    let tone = match judged.verdict.outcome {
        Outcome::Explained => Tone::Good,
        Outcome::Reproduced => Tone::Plain,
        Outcome::FitsNoise | Outcome::Unexplained => Tone::Bad,
    };
    let mut text = Vec::new();
    if judged.verdict.outcome == Outcome::Unexplained {
        let wrong = match judged.is_static {
            true => {
                "the source changed, the field is too small, penalties are too strong, or the error bars are wrong"
            }
            false => {
                "the settings (spin, inclination, motion, region), the error bars or the training are wrong"
            }
        };
        text.push(format!(
            "What follows is the best solution of this fit, but not a description of the source: {wrong}."
        ));
    }
    if judged.terms.iter().any(|(_, tested)| tested.errors == Errors::Assumed) {
        text.push("σ is assumed in the settings, not measured; χ² depends on it.".to_owned());
    }
    Notice { tone, headline: judged.headline(), text }
}

/// Residuals of all kinds of data.
pub fn table(judged: &DataVerdict) -> Table {
    let head = [
        "data",
        "number",
        "χ² per data point",
        "expected",
        "mean, σ",
        "correlation in time",
        "worst",
    ];
    let row = |(name, tested): &(String, Tested)| {
        let Tested { statistics, errors, expected, .. } = tested;
        let number = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.2}"));
        let expected = match errors {
            Errors::Weight => "no noise".to_owned(),
            _ => range_of(expected),
        };
        vec![
            name.clone(),
            statistics.all.count().to_string(),
            statistics.chi2().map_or("–".to_owned(), short),
            expected,
            number(statistics.mean()),
            number(statistics.in_time.correlation()),
            worst_parts(judged, tested),
        ]
    };
    Table::new(
        "Residuals",
        "Model minus data in units of σ, over all frames. With the right model and errors χ² per data point is as \
         expected, and the mean and the correlation between frames vanish. Fitted parameters lower χ².",
        head,
        judged.terms.iter().map(row).collect(),
    )
}

/// The worst station, group of stations and frame with their χ² per data point.
fn worst_parts(judged: &DataVerdict, tested: &Tested) -> String {
    let statistics = &tested.statistics;
    let station = worst(statistics.stations.iter())
        .map(|(station, _, chi2)| format!("{} {}", judged.names(&[*station]), short(chi2)));
    let group = worst(statistics.groups.iter())
        .map(|(stations, _, chi2)| format!("{} {}", judged.names(stations), short(chi2)));
    let frame = worst(statistics.frames.iter().enumerate())
        .map(|(frame, _, chi2)| format!("frame {frame} {}", short(chi2)));
    [station, group, frame].into_iter().flatten().collect::<Vec<_>>().join(", ")
}
