//! A fit with its memory.

use super::device::DeviceRunner;
use super::training::Training;
use crate::fit::loss::change_price::ChangeBuffers;
use crate::fit::loss::objective::{Buffers, Objective};
use crate::representation::{Representation, WeightMatrix};
use kerrlight_common::simd::Float;

/// A fit with its memory.
pub struct Trainer<'a, T> {
    /// Objective that is minimised.
    pub objective: Objective<T>,
    /// The field.
    pub representation: &'a dyn Representation<T>,
    /// Training of the fit.
    pub training: Training,
    /// A device that takes the steps in place of this processor, if there is one.
    pub device: Option<DeviceRunner>,
    pub(in crate::fit) observed: Vec<usize>,
    pub(in crate::fit) buffers: Buffers<T>,
    pub(in crate::fit) changes: ChangeBuffers<T>,
    pub(in crate::fit) gradient: Vec<T>,
    /// Parameters that are matrices.
    pub(in crate::fit) matrices: Vec<WeightMatrix>,
}

impl<'a, T: Float> Trainer<'a, T> {
    /// A fit of a representation.
    pub fn new(
        objective: Objective<T>,
        representation: &'a dyn Representation<T>,
        training: Training,
    ) -> Self {
        let (observed, gradient) =
            (objective.observed(), vec![T::zero(); representation.parameters()]);
        Self {
            objective,
            representation,
            training,
            device: None,
            observed,
            buffers: Buffers::default(),
            changes: ChangeBuffers::default(),
            gradient,
            matrices: representation.matrices(),
        }
    }
}
