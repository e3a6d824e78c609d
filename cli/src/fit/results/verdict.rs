//! Verdict: whether a fit explains its data, from the residuals of its last state, in words and for other
//! programs.

pub mod parts;
#[cfg(test)]
mod tests;

use crate::report::{Notice, Table, Tone};
use kerrlight_tomo::fit::verdict::{Errors, Outcome, Tested, worst};
pub use kerrlight_tomo::recovery::{DataVerdict, Evidence};
use kerrlight_tomo::recovery::{range_of, short};
use serde_json::{Value, json};

/// Returns the verdict for results.json.
pub fn json(judged: &DataVerdict) -> Value {
    let outcome = match judged.verdict.outcome {
        Outcome::Explained => "explained",
        Outcome::Reproduced => "reproduced",
        Outcome::FitsNoise => "fits-noise",
        Outcome::Unexplained => "unexplained",
    };
    let reasons: Vec<String> = judged.reasons();
    let mut all = json!({
        "outcome": outcome,
        "text": judged.headline(),
        "reasons": reasons,
        "data": judged.terms.iter().map(|(name, tested)| term(judged, name, tested)).collect::<Vec<_>>(),
    });
    if let Some(flux) = &judged.flux {
        all["zero_spacing"] = json!({
            "measured_jy": flux.measured_jy,
            "error_jy": flux.error_jy,
            "model_jy": flux.model_jy,
            "visibilities": flux.count,
        });
    }
    all
}

fn term(judged: &DataVerdict, name: &str, tested: &Tested) -> Value {
    let Tested { statistics, errors, expected } = tested;
    let errors = match errors {
        Errors::Known => "noise",
        Errors::Stated => "stated",
        Errors::Shared => "shared",
        Errors::Assumed => "assumed",
        Errors::Weight => "weight",
    };
    let mut term = json!({
        "data": name,
        "count": statistics.all.count,
        "chi2_per_datum": statistics.chi2(),
        "sigma_is": errors,
        "mean": statistics.mean(),
        "misfit": statistics.misfit(),
        "correlation_in_time": statistics.in_time.correlation(),
        "correlation_in_space": statistics.in_space.correlation(),
    });
    if tested.errors != Errors::Weight {
        term["expected"] =
            json!({ "mean": expected.chi2, "deviation": expected.spread, "taken": expected.taken });
    }
    if let Some((frame, part, chi2)) = worst(statistics.frames.iter().enumerate()) {
        let time = judged.times.get(frame);
        term["worst_frame"] =
            json!({ "frame": frame, "time": time, "chi2_per_datum": chi2, "count": part.count });
    }
    if let Some((stations, part, chi2)) = worst(statistics.groups.iter()) {
        let names = judged.names(stations);
        term["worst_group"] =
            json!({ "stations": names, "chi2_per_datum": chi2, "count": part.count });
    }
    if let Some((station, part, chi2)) = worst(statistics.stations.iter()) {
        let name = judged.names(&[*station]);
        term["worst_station"] =
            json!({ "station": name, "chi2_per_datum": chi2, "count": part.count });
        term["stations"] = json!(parts::station_values(judged, tested));
    }
    term
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
        let Tested { statistics, errors, expected } = tested;
        let number = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.2}"));
        let expected = match errors {
            Errors::Weight => "no noise".to_owned(),
            _ => range_of(expected),
        };
        vec![
            name.clone(),
            statistics.all.count.to_string(),
            statistics.chi2().map_or("–".to_owned(), short),
            expected,
            number(statistics.mean()),
            number(statistics.in_time.correlation()),
            worst_parts(judged, tested),
        ]
    };
    Table {
        title: "Residuals".to_owned(),
        caption: "Model minus data in units of σ, over all frames. With the right model and errors χ² per data point is as \
                  expected, and the mean and the correlation between frames vanish. Fitted parameters lower χ².\
                  "
            .to_owned(),
        head: head.map(str::to_owned).to_vec(),
        rows: judged.terms.iter().map(row).collect(),
        links: Vec::new(),
    }
}

/// The worst station, group of stations and frame with their χ² per data point.
fn worst_parts(judged: &DataVerdict, tested: &Tested) -> String {
    let statistics = &tested.statistics;
    let station = worst(statistics.stations.iter())
        .map(|(station, _, chi2)| format!("{} {}", judged.names(&[*station]), short(chi2)));
    let group = worst(statistics.groups.iter())
        .map(|(stations, _, chi2)| format!("{} {}", judged.names(stations), short(chi2)));
    let frame = worst(statistics.frames.iter().enumerate())
        .map(|(frame, _, chi2)| format!("frame {} {}", frame + 1, short(chi2)));
    [station, group, frame].into_iter().flatten().collect::<Vec<_>>().join(", ")
}
