//! Fits that graphics devices do not compute.

use crate::Error;
use crate::fit::learning::device::DeviceError;
use crate::fit::learning::training::Training;
use crate::fit::loss::objective::Objective;
use crate::representation::Representation;

/// Refuses what is not done on a device, with the key that asks for it.
///
/// # Errors
/// Names the first such key.
pub fn check(
    objective: &Objective<f32>,
    representation: &dyn Representation<f32>,
    training: &Training,
) -> Result<(), Error> {
    let model = &objective.model;
    for (asked, key, what) in [
        (training.change.is_some(), "change", "emission that changes while matter carries it is"),
        (model.planes.is_some(), "polarization", "Stokes parameters are"),
        (representation.built_in().is_none(), "representation.kind", "this representation is"),
    ] {
        if asked {
            let why =
                format!("{key}: {what} not computed on graphics devices, the processor does it");
            return Err(DeviceError(why).into());
        }
    }
    Ok(())
}
