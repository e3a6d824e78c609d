//! Fully connected networks, fused: a tile of points goes through all layers, forward and backward,
//! while its activations are in cache.

mod batch;
mod dense;
mod encoding;
mod layout;
mod output;
mod packed;
mod settings;
#[cfg(test)]
mod tests;
mod tile;

pub use settings::NetworkSettings;

use super::{BuiltIn, Coordinates, Gradient, Groups, Representation, WeightMatrix, Workspace};
use crate::Error;
use batch::{Memory, Way};
use kerrlight_common::simd::{Float, InstructionSet};
use layout::{Layer, Layout};
use output::Cotangents;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A network with positional encoding: `bhnerf` of (x, y, z), `mlp4d` of (t, x, y, z); where emission changes while
/// matter carries it, `bhnerf` has the time as well.
///
/// Parameters are layer after layer, each its kernel (inputs × outputs, row by row) and then its
/// biases; a layer after the skip has the encoded point behind the units of the layer before.
#[derive(Clone, Debug)]
pub struct Network {
    settings: NetworkSettings,
    layout: Layout,
    instruction_set: InstructionSet,
}

impl Network {
    /// A network of these sizes, on the widest instruction set of the machine.
    ///
    /// # Errors
    /// If a size is out of its range.
    pub fn new(settings: NetworkSettings) -> Result<Self, Error> {
        settings.check()?;
        let layout = Layout::new(&settings);
        Ok(Self { settings, layout, instruction_set: InstructionSet::best() })
    }

    /// The same on another instruction set (the portable one where the machine lacks it): results differ
    /// by rounding.
    pub fn on(self, instruction_set: InstructionSet) -> Self {
        let available = instruction_set.available();
        let instruction_set = if available { instruction_set } else { InstructionSet::Portable };
        Self { instruction_set, ..self }
    }

    /// The sizes.
    pub fn settings(&self) -> &NetworkSettings {
        &self.settings
    }

    /// Floating-point operations a point, of multiplying and adding weights alone: forward, and
    /// forward with the gradient of the parameters.
    pub fn operations(&self) -> [usize; 2] {
        let of = |rows: usize, outputs: usize| 2 * rows * outputs;
        let layers = &self.layout.layers;
        let forward: usize = layers.iter().map(|layer| of(layer.inputs, layer.outputs)).sum();
        let units = self.layout.rows.iter().zip(layers).skip(1);
        let back: usize = units.map(|(rows, layer)| of(rows.units, layer.outputs)).sum();
        // The gradient of the weights takes as many as the way forward.
        [forward, 2 * forward + back]
    }

    fn scales<T: Float>(&self) -> [T; 4] {
        let (length, time) = (1.0 / self.settings.length_scale, 1.0 / self.settings.time_scale);
        let first = if self.settings.dimension == 4 { time } else { length };
        [first, length, length, length].map(T::of)
    }
}

impl<T: Float> Representation<T> for Network {
    fn dimension(&self) -> usize {
        self.settings.dimension
    }

    fn is_carried(&self) -> bool {
        self.settings.dimension == 3 || self.settings.carried
    }

    fn built_in(&self) -> Option<BuiltIn<'_>> {
        // Kernels of devices know one scale of the time.
        self.settings.time_span.is_none().then_some(BuiltIn::Network(self))
    }

    fn parameters(&self) -> usize {
        self.layout.parameters()
    }

    /// Returns the matrices of the hidden layers, each with its biases, the weights of an input that is always one.
    fn matrices(&self) -> Vec<WeightMatrix> {
        let of = |layer: &Layer| WeightMatrix {
            offset: layer.offset,
            rows: layer.inputs + 1,
            columns: layer.outputs,
        };
        self.layout.hidden().iter().map(of).collect()
    }

    /// Kernels uniform in ±√(6/inputs) (He et al. 2015), what the BH-NeRF code trains from, layer by layer and row by
    /// row; biases are zero.
    fn initialise(&self, seed: u64, parameters: &mut [T]) {
        assert!(parameters.len() == self.layout.parameters());
        let mut random = Pcg64::seed_from_u64(seed);
        for layer in &self.layout.layers {
            let all = &mut parameters[layer.offset..layer.offset + layer.size()];
            let (kernel, biases) = all.split_at_mut(layer.inputs * layer.outputs);
            let limit = (6.0 / layer.inputs as f64).sqrt();
            kernel.fill_with(|| T::of(random.random_range(-limit..limit)));
            biases.fill(T::zero());
        }
    }

    fn eval(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    ) {
        let memory: &mut Memory<T> = workspace.of();
        memory.run(self, parameters, at, &[], Way::Forward { values, recorded: false });
    }

    fn eval_recorded(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    ) {
        let memory: &mut Memory<T> = workspace.of();
        memory.run(self, parameters, at, &[], Way::Forward { values, recorded: true });
    }

    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let memory: &mut Memory<T> = workspace.of();
        let cotangents = Cotangents::Given(cotangents);
        let way = Way::Both { cotangents, values: None, gradient, recorded: false };
        memory.run(self, parameters, at, &[], way);
    }

    fn vjp_recorded(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let memory: &mut Memory<T> = workspace.of();
        let cotangents = Cotangents::Given(cotangents);
        let way = Way::Both { cotangents, values: None, gradient, recorded: true };
        memory.run(self, parameters, at, &[], way);
    }

    fn eval_vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        groups: Groups<'_, T>,
        values: &mut [T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let memory: &mut Memory<T> = workspace.of();
        let cotangents = Cotangents::Linked(groups.link);
        let way = Way::Both { cotangents, values: Some(values), gradient, recorded: false };
        memory.run(self, parameters, at, groups.starts, way);
    }
}
