//! The run: a fit that is followed on the terminal and kept in a folder.

mod kept;
mod record;

use super::data;
use super::failed;
use super::folder::{self, Folder};
use super::results::Estimate;
use crate::answer::Answer;
use crate::devices::{CheckSteps, FitDevice};
use anyhow::bail;
use kept::Kept;
use kerrlight_tomo::fit::settings::{FitFile, Kind};
use kerrlight_tomo::fit::setup;
use kerrlight_tomo::recovery::{Problem, fit_with};
use kerrlight_tomo::representation::Registry;
use std::path::Path;
use std::time::Instant;

/// A fit with its data, of which relative paths start from `base_dir`.
pub fn problem(file: FitFile, base_dir: &Path, registry: &Registry) -> anyhow::Result<Problem> {
    Problem::new(file, registry.clone(), |file, instrument| {
        data::measure(file, instrument, base_dir)
    })
}

/// Refuses a device that does not do this fit.
pub fn check_device(problem: &Problem, check: CheckSteps) -> anyhow::Result<()> {
    let Problem { settings, registry, instrument, measured, motion, .. } = problem;
    if settings.representation.kind == Kind::LinearGrid {
        bail!("representation.kind: a linear-grid is solved on the processor");
    }
    if measured.leakage.is_some() {
        bail!("instrument.leakage: the processor solves for it between steps");
    }
    let times = setup::emission_times(instrument, motion);
    let representation = setup::representation(settings, registry, times)?;
    let training = setup::training(settings, setup::axis(settings)?.1, times)?;
    Ok(check(&problem.objective(instrument, motion, measured)?, &*representation, &training)?)
}

/// Runs a fit from its start or its last checkpoint to its end.
pub fn run(
    problem: &Problem,
    folder: &Folder,
    device: Option<FitDevice>,
) -> anyhow::Result<Answer> {
    let begun = Instant::now();
    let mut kept = Kept::new(problem, folder, device);
    let results = fit_with(problem, &mut kept, |fit, state| {
        Estimate::new(fit, folder).write(fit, state, begun)
    });
    let results = results.map_err(|error| failed::told(error, folder));
    drop(kept);
    let (worth, results) = results?;
    let files = ["report.html", "results.json", "volume.npz", "movie.npz"];
    Ok(folder.answer(&worth, results, &files))
}
