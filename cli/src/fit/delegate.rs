//! A fit whose steps a graphics device takes.

use super::folder::Folder;
use crate::devices::FitDevice;
use anyhow::anyhow;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::{Delegate, DeviceError, Trainer};

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
