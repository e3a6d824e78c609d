//! A fit whose steps a graphics device takes.

use super::folder::Folder;
use crate::devices::FitDevice;
use crate::plain;
use anyhow::anyhow;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::{DeviceError, DeviceRunner, Trainer, checkpoint};

/// The device, ready for this fit; says what it does.
pub fn delegate(
    (_, take): FitDevice,
    file: &FitFile,
    trainer: &Trainer<'_, f32>,
    folder: &Folder,
) -> anyhow::Result<DeviceRunner> {
    let taken = take(&trainer.objective, trainer.representation, &trainer.training);
    let device =
        taken.map_err(|error| anyhow!("{}; {}", plain::reasons(&error), elsewhere(folder)))?;
    let rest = match &trainer.objective.data.others[..] {
        others if !device.makes_residuals() => {
            let names: Vec<&str> = others.iter().map(|other| other.term.name()).collect();
            format!("; on this processor: {}", names.join(", "))
        }
        _ => String::new(),
    };
    eprintln!("steps on {} in floats{rest}", device.name());
    Ok(DeviceRunner::new(device, file.training.log_every, file.training.steps))
}

/// Returns the message when a device fails, after the checkpoint.
pub fn failed(error: DeviceError, folder: &Folder) -> anyhow::Error {
    let header = |bytes: Vec<u8>| checkpoint::header(&bytes).ok();
    let kept = folder.checkpoint().ok().flatten().and_then(header);
    let step = kept.map_or(0, |header| header.step);
    anyhow!("{error}; step {step} is kept; {}", elsewhere(folder))
}

/// Explains how to go on without the device.
fn elsewhere(folder: &Folder) -> String {
    format!("on the processor: kerrlight fit --resume {}", plain::word(folder.path()))
}

#[cfg(test)]
mod tests;
