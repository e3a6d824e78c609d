//! Words on linear grids, which are solved or started from.

use kerrlight_tomo::fit::linear::{Ending, LinearSolution};
use kerrlight_tomo::fit::settings::{FitFile, Kind};
use kerrlight_tomo::fit::setup::WarmStarted;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// A line of the log.
pub fn solved(solution: &LinearSolution<f32>) -> Value {
    let certificate = solution.certificate.map(|c| {
        json!({
            "value": c.value, "dark": c.dark, "gap": c.gap, "relative_gap": c.relative_gap(),
            "relative_violation": c.relative_violation(), "upper": c.upper,
        })
    });
    let stationarity = solution.stationarity.map(|s| {
        json!({
            "value": s.value, "start": s.start, "relative_violation": s.relative_violation(), "upper": s.upper,
        })
    });
    json!({
        "step": 0,
        "linear": {
            "evaluations": solution.evaluations, "rounds": solution.rounds, "nodes": solution.nodes,
            "bytes": solution.bytes, "ending": format!("{:?}", solution.ending), "statement": statement(solution),
            "certificate": certificate, "stationarity": stationarity,
        },
    })
}

/// A line of the log.
pub fn imprinted(found: &WarmStarted) -> Value {
    json!({
        "step": 0,
        "imprint": { "steps": found.steps, "relative_error": found.relative_error },
    })
}

/// A gap, over the dark field's loss, that certifies nothing.
const LOOSE: f64 = 0.5;

/// States what may be claimed of a solution.
pub fn statement(solution: &LinearSolution<f32>) -> String {
    let stopped = !matches!(solution.ending, Ending::Converged | Ending::Rounding);
    if let Some(certificate) = solution.certificate {
        // The gap counts in losses of the dark field, which is 0 where dark explains the data.
        if certificate.dark == 0.0 {
            return "minimum of a convex problem: the dark field explains the data".to_owned();
        }
        let gap = certificate.relative_gap();
        if !gap.is_finite() {
            return "not a certified minimum: the loss left the range of numbers, as with errors that are far too small"
                .to_owned();
        }
        if gap > LOOSE {
            // No loss is below 0.
            let gap = gap.min(certificate.value / certificate.dark);
            return format!(
                "not a certified minimum: the global one of this convex problem may lie lower by {gap:.1e} of the dark \
                 field's loss"
            );
        }
        return format!(
            "certified minimum of a convex problem: at most {gap:.1e} of the dark field's loss above the global minimum"
        );
    }
    let slope = solution.stationarity.map_or(f64::NAN, |s| s.relative_violation());
    let what = if stopped { "not yet a stationary point" } else { "stationary point" };
    format!(
        "{what}, not certified: the loss is not convex in the emission; gradient {slope:.1e} of its initial size"
    )
}

/// Results of the linear grid.
#[derive(Serialize)]
pub struct Solved {
    /// Statement of what may be claimed of the solution.
    pub statement: String,
    ending: String,
    relative_gap: Option<f64>,
    relative_violation: Option<f64>,
}

/// Numbers of a line of the log.
#[derive(Deserialize)]
struct Logged {
    statement: String,
    ending: String,
    certificate: Option<Flatness>,
    stationarity: Option<Flatness>,
}

/// Distance of a solution from the best one, over that of its start.
#[derive(Deserialize)]
struct Flatness {
    relative_gap: Option<f64>,
    relative_violation: Option<f64>,
}

/// Returns the results of the linear grid, from the log of its run.
pub fn outcome(file: &FitFile, lines: &[Value]) -> Option<Solved> {
    if file.representation.kind != Kind::LinearGrid {
        return None;
    }
    let linear =
        lines.iter().rev().find_map(|line| Logged::deserialize(line.get("linear")?).ok())?;
    let Logged { statement, ending, certificate, stationarity } = linear;
    let flatness = certificate.as_ref().or(stationarity.as_ref());
    Some(Solved {
        statement,
        ending,
        relative_gap: certificate.as_ref().and_then(|of| of.relative_gap),
        relative_violation: flatness.and_then(|of| of.relative_violation),
    })
}
