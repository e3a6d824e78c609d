//! A fit whose steps a graphics device takes.

use super::api::assigned;
use super::folder::Folder;
use super::work::Work;
use crate::devices::FitDevice;
use anyhow::anyhow;
use kerrlight_tomo::fit::settings::{FitFile, Kind, Optimiser};
use kerrlight_tomo::fit::{Delegate, DeviceError, Trainer};

/// Settings of a new run on a device, where networks take Adam's steps in place of Muon's; says so. They become the run's own,
/// so that it may resume on a processor.
pub fn settings(text: String) -> anyhow::Result<String> {
    // What is wrong with a text is told where it is read for good.
    let Ok(Work::Emission(file)) = Work::read(&text) else { return Ok(text) };
    let is_network = matches!(file.representation.kind, Kind::Bhnerf | Kind::Mlp4d);
    if file.training.optimiser != Optimiser::Muon || !is_network {
        return Ok(text);
    }
    eprintln!(
        "note: training.optimiser = \"muon\" is for the processor: on a device, networks take Adam's steps"
    );
    assigned(&text, "training.optimiser=adam")
}

/// The device, ready for this fit; says what it does.
pub fn delegate(
    (_, take): FitDevice,
    file: &FitFile,
    trainer: &Trainer<'_, f32>,
    folder: &Folder,
) -> anyhow::Result<Delegate<f32>> {
    let taken = take(&trainer.objective, trainer.representation, &trainer.training);
    let device = taken.map_err(|error| anyhow!("{error:#}; {}", elsewhere(folder)))?;
    let rest = match &trainer.objective.data.others[..] {
        [] => String::new(),
        others => {
            let names: Vec<&str> = others.iter().map(|other| other.term.name()).collect();
            format!("; on this processor: {}", names.join(", "))
        }
    };
    eprintln!("steps on {} in floats{rest}", device.name());
    Ok(Delegate::new(device, file.training.log_every, file.training.steps))
}

/// What is told when a device fails, after the checkpoint.
pub fn failed(error: DeviceError, step: u64, folder: &Folder) -> anyhow::Error {
    anyhow!("{error}; step {step} is kept; {}", elsewhere(folder))
}

/// How to go on without the device.
fn elsewhere(folder: &Folder) -> String {
    format!("on the processor: kerrlight fit --resume {}", folder.path().display())
}

#[cfg(test)]
mod tests;
