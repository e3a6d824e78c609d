//! Weights in the order in which the matrix kernels read them, packed once a batch.

use super::super::workspace::Lines;
use super::Network;
use super::dense::{pack_kernel, pack_transposed, packed_kernel};
use super::layout::LINE;
use kerrlight_common::simd::{Float, panel};

/// Packed weights of all layers.
#[derive(Default)]
pub struct Packed<T> {
    layers: Vec<Panels<T>>,
    output: Lines<T>,
    /// Factors of coordinates, in their order.
    pub scales: [T; 4],
    /// The part of the first that enters without sine and cosine.
    pub part: T,
}

#[derive(Default)]
struct Panels<T> {
    kernel: Lines<T>,
    transposed: Lines<T>,
    encoded: Lines<T>,
}

impl<T: Float> Packed<T> {
    /// Packs what a forward pass needs; what the way back needs if `backward`, as far as the
    /// coordinates if `coordinates`.
    pub fn pack(&mut self, network: &Network, parameters: &[T], backward: bool, coordinates: bool) {
        let (layout, width) = (&network.layout, panel::<T>(network.instruction_set));
        self.layers.resize_with(layout.hidden().len(), Panels::default);
        for (k, (panels, layer)) in self.layers.iter_mut().zip(layout.hidden()).enumerate() {
            let rows = &parameters[layer.offset..layer.offset + layer.size()];
            panels.kernel.resize(packed_kernel(layer.inputs, layer.outputs, width));
            pack_kernel(rows, layer.outputs, width, panels.kernel.all());
            let (units, encoded) = rows.split_at(layout.rows[k].units * layer.outputs);
            // Before the first layer are no units, only the encoded point.
            if backward && k > 0 {
                transpose(units, layer.outputs, width, &mut panels.transposed);
            }
            if coordinates && k == 0 {
                transpose(units, layer.outputs, width, &mut panels.encoded);
            } else if coordinates && layout.skip == Some(k) {
                // Behind the rows of the units are those of the appended point, then the biases.
                let encoded = &encoded[..layout.encoded * layer.outputs];
                transpose(encoded, layer.outputs, width, &mut panels.encoded);
            }
        }
        let output = layout.output();
        self.output.resize((output.inputs + 1).next_multiple_of(LINE));
        self.output.all().fill(T::zero());
        let weights = &parameters[output.offset..output.offset + output.size()];
        self.output.all()[..weights.len()].copy_from_slice(weights);
        self.scales = network.scales();
        self.part = T::of(network.settings.time_part());
    }

    /// Panels of a hidden layer with its bias.
    pub fn kernel(&self, layer: usize) -> &[T] {
        self.layers[layer].kernel.read()
    }

    /// Panels of a hidden layer, transposed, as far as the units of the layer before.
    pub fn transposed(&self, layer: usize) -> &[T] {
        self.layers[layer].transposed.read()
    }

    /// Panels of a hidden layer, transposed, as far as the encoded point.
    pub fn encoded(&self, layer: usize) -> &[T] {
        self.layers[layer].encoded.read()
    }

    /// Weights and bias of the output layer, then zeros.
    pub fn output(&self) -> &[T] {
        self.output.read()
    }
}

fn transpose<T: Float>(kernel: &[T], outputs: usize, width: usize, to: &mut Lines<T>) {
    let inputs = kernel.len() / outputs;
    to.resize(inputs.div_ceil(width) * width * outputs);
    pack_transposed(kernel, outputs, width, to.all());
}
