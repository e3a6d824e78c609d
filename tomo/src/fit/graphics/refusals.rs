//! Fits that graphics devices do not compute.

use crate::Error;
use crate::fit::learning::device::DeviceError;
use crate::fit::learning::training::Training;
use crate::fit::loss::objective::Objective;
use crate::representation::{BuiltIn, Representation};

/// Parameters of a network, at most: kernels have a workgroup for 64 of them, and WebGPU has 65,535 in a row.
const MOST_PARAMETERS: usize = 64 * 65_535;

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
    let is_network = matches!(representation.built_in(), Some(BuiltIn::Network(_)));
    let is_large = is_network && representation.parameters() > MOST_PARAMETERS;
    for (asked, key, what) in [
        (training.change.is_some(), "change", "emission that changes while matter carries it is"),
        (model.planes.is_some(), "polarization", "Stokes parameters are"),
        (representation.built_in().is_none(), "representation.kind", "this representation is"),
        (is_large, "representation.network", "networks of more than 4,194,240 parameters are"),
    ] {
        if asked {
            let why =
                format!("{key}: {what} not computed on graphics devices, the processor does it");
            return Err(DeviceError(why).into());
        }
    }
    Ok(())
}
