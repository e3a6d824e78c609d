//! Numbers of the closure quantities of the data that a fit uses.

use kerrlight_tomo::fit::settings::{Loss, LossKind};
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_vlbi::products::{ClosureCount, ClosureKind};
use serde::Serialize;

/// The counts of every loss of closure quantities.
fn counts<'a>(measured: &FitData, losses: &'a [Loss]) -> Vec<(&'a Loss, ClosureCount)> {
    let Some((observation, _)) = &measured.visibilities else { return Vec::new() };
    let count = |loss: &'a Loss| {
        let kind = match loss.data {
            LossKind::ClosurePhases => ClosureKind::Phase,
            LossKind::LogClosureAmplitudes => ClosureKind::LogAmplitude,
            _ => return None,
        };
        Some((loss, ClosureCount::of(observation, kind, loss.least_snr.unwrap_or(0.0))))
    };
    losses.iter().filter_map(count).collect()
}

/// A sentence for each of them.
pub fn sentences(measured: &FitData, losses: &[Loss]) -> Vec<String> {
    let sentence = |(loss, count): &(&Loss, ClosureCount)| {
        let ClosureCount { used, possible, of_scans } = count;
        let label = loss.data.label();
        let least = match loss.least_snr {
            Some(least) if used < possible => format!(" (baselines above {least} σ)"),
            _ => String::new(),
        };
        let torn = of_scans.map_or(String::new(), |of_scans| {
            format!(
                "; averages of scans have {of_scans}: here baselines of a scan have different times, which average_s makes one"
            )
        });
        format!("{used} of {possible} independent {label} are used{least}{torn}")
    };
    counts(measured, losses).iter().map(sentence).collect()
}

/// Closure quantities of a loss, as results.json has them.
#[derive(Serialize)]
pub struct ClosureResults {
    data: &'static str,
    #[serde(flatten)]
    count: ClosureCount,
}

/// Returns them for results.json.
pub fn results(measured: &FitData, losses: &[Loss]) -> Vec<ClosureResults> {
    let one =
        |(loss, count): (&Loss, ClosureCount)| ClosureResults { data: loss.data.name(), count };
    counts(measured, losses).into_iter().map(one).collect()
}
