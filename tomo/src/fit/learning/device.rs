//! Steps of a fit that something else than this processor takes: a graphics device.
//!
//! Steps on devices. What is drawn, how long steps are, and what is done when the loss diverges is decided here, as ever; the
//! device gets a stretch of steps and gives back what they lead to. Between stretches the whole state is in
//! [`State`](crate::fit::State), so that a checkpoint that one device has written is taken up by another.

use super::state::Progress;
use crate::Error;
use crate::fit::forward::occupancy::Occupancy;
use crate::fit::loss::objective::{Drawn, Loss, Objective};
use kerrlight_render::dynamics::Axis;

/// Failure of a device to take the steps of a fit: it failed, or it does not do what settings ask for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct DeviceError(pub String);

/// Some steps in a row, of which the settings are the same.
pub struct Stretch<'a> {
    /// Forward model, weighed for the axis, and data.
    pub objective: &'a Objective<f32>,
    /// The axis that matter turns about.
    pub axis: Axis,
    /// Outside of it nothing shines.
    pub occupancy: Option<&'a Occupancy>,
    /// Data of each step.
    pub draws: Vec<Drawn>,
    /// Learning rate of each step.
    pub rates: Vec<f64>,
}

/// Result of a stretch of steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// Parameters after the last step.
    pub parameters: Vec<f32>,
    /// Adam's two moments after it.
    pub moments: [Vec<f32>; 2],
    /// Loss of each step, before it was taken.
    pub losses: Vec<Loss>,
    /// Slope of the last loss along the sphere of axes, if the axis is learnt.
    pub of_axis: [f64; 3],
}

/// Takes steps in place of this processor.
pub trait StepDevice: Send {
    /// Its name.
    fn name(&self) -> &str;

    /// Returns whether it makes all residuals, so that nothing but losses comes back before the end of a stretch.
    fn makes_residuals(&self) -> bool;

    /// The most steps of a stretch: one if the axis is learnt.
    fn most(&self) -> usize;

    /// Takes these steps from where parameters and moments are.
    ///
    /// # Errors
    /// If the device fails; the steps are not taken then.
    fn take(&mut self, stretch: &Stretch<'_>, from: &Progress<f32>) -> Result<Taken, Error>;
}

/// A device with the steps that somebody wants to look at.
pub struct DeviceRunner {
    pub(in crate::fit) device: Box<dyn StepDevice>,
    pub(in crate::fit) pause: u64,
    pub(in crate::fit) end: u64,
    /// Steps of a stretch of about half a second.
    pub(in crate::fit) pace: u64,
}

impl DeviceRunner {
    /// A stretch ends at multiples of `pause` steps and at `end`.
    pub fn new(device: Box<dyn StepDevice>, pause: u64, end: u64) -> Self {
        // The first stretch is one step, which tells how many fit into the next.
        Self { device, pause: pause.max(1), end, pace: 1 }
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        self.device.name()
    }
}
