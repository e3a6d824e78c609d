//! A fit whose steps a graphics device takes.

use super::folder::Folder;
use super::work::Prepared;
use crate::devices::FitDevice;
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::{Delegate, DeviceError, Trainer};

/// Refuses a device that does not do this fit, before anything is written.
pub fn check(work: &Prepared<'_>, device: Option<&FitDevice>) -> anyhow::Result<()> {
    let Some((check, _)) = device else { return Ok(()) };
    match work {
        Prepared::Image(_) => {
            bail!("--device: a static image is fitted on the processor; leave it out")
        }
        Prepared::Emission(prepared) => prepared.check_device(*check).context("--device"),
    }
}

/// The device, ready for this fit; says what it does.
pub fn delegate(
    (_, take): FitDevice,
    file: &FitFile,
    trainer: &Trainer<'_, f32>,
) -> anyhow::Result<Delegate<f32>> {
    let device = take(&trainer.objective, trainer.representation, &trainer.training)?;
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
    let path = folder.path().display();
    anyhow!(
        "{error}; step {step} is kept, go on from there on the processor: kerrlight fit --resume {path}"
    )
}

#[cfg(test)]
mod tests;
