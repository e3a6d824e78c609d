//! A tile of points on its way through all layers and back, in cache.

use super::super::workspace::Lines;
use super::super::{Coordinates, CoordinatesMut};
use super::Network;
use super::dense::{Backward, Forward, Matrix, MatrixMut, Weights};
use super::encoding::{Encode, encode_vjp};
use super::layout::Rows;
use super::output::{Cotangents, Output, OutputBackward};
use super::packed::Packed;
use core::ops::Range;
use kerrlight_common::simd::{Float, dispatch};

/// Points of a tile. Activations of four layers of 128 and their gradients then take half a
/// megabyte, the second-level cache of a core.
pub const POINTS: usize = 120;

/// A multiple of the rows of a block of every instruction set.
const BLOCK: usize = 12;

/// Activations of a tile of points: all that the way back needs.
#[derive(Default)]
pub struct Activations<T> {
    points: usize,
    /// Rows of each layer, the encoded points first.
    rows: Vec<Lines<T>>,
    values: Lines<T>,
    /// Slopes of the activation; then times the cotangents.
    slopes: Lines<T>,
}

/// Memory of one tile.
#[derive(Default)]
pub struct Tile<T> {
    /// Activations of the points at hand.
    pub passed: Activations<T>,
    /// Gradients with respect to what a layer gives and takes, in turns.
    cotangents: [Lines<T>; 2],
    /// Gradient with respect to the encoded points.
    encoded: Lines<T>,
    /// Gradient of the output layer.
    output: Lines<T>,
}

impl<T: Float> Activations<T> {
    /// Makes room for `points`.
    pub fn resize(&mut self, network: &Network, points: usize) {
        let points = points.next_multiple_of(BLOCK);
        let layout = &network.layout;
        self.rows.resize_with(layout.rows.len(), Lines::default);
        for (lines, rows) in self.rows.iter_mut().zip(&layout.rows) {
            lines.resize(points * rows.stride);
        }
        self.values.resize(points);
        self.slopes.resize(points);
    }

    /// Bytes that `points` take.
    pub fn bytes(network: &Network, points: usize) -> usize {
        let row: usize = network.layout.rows.iter().map(|rows| rows.stride).sum();
        points.next_multiple_of(BLOCK) * (row + 2) * size_of::<T>()
    }

    /// Values of the points.
    pub fn values(&self) -> &[T] {
        &self.values.read()[..self.points]
    }

    /// Values of the points; slopes of the activation are kept if `backward`.
    pub fn forward(
        &mut self,
        network: &Network,
        packed: &Packed<T>,
        at: Coordinates<'_, T>,
        backward: bool,
    ) {
        let (set, layout, points) = (network.instruction_set, &network.layout, at.len());
        self.points = points;
        let output = MatrixMut { numbers: self.rows[0].all(), stride: layout.rows[0].stride };
        let (scales, degree) = (&packed.scales[..at.dimension()], network.settings.degree);
        dispatch(set, Encode { at, scales, part: packed.part, degree, output });
        for (k, layer) in layout.hidden().iter().enumerate() {
            let (before, after) = self.rows.split_at_mut(k + 1);
            let input = matrix(&before[k], layout.rows[k]);
            let output = MatrixMut { numbers: after[0].all(), stride: layout.rows[k + 1].stride };
            let (inputs, outputs, panels) = (layer.inputs, layer.outputs, packed.kernel(k));
            dispatch(set, Forward { points, input, inputs, panels, outputs, output });
            // After the layer, whose last panel writes zeros behind its units.
            append(matrix(&before[0], layout.rows[0]), after[0].all(), layout.rows[k + 1], points);
        }
        let input = matrix(&self.rows[layout.hidden().len()], layout.last_rows());
        let slopes = if backward { &mut self.slopes.all()[..points] } else { &mut [] };
        let (activation, shift) = (network.settings.activation, T::of(network.settings.shift));
        let (weights, values) = (packed.output(), &mut self.values.all()[..points]);
        dispatch(set, Output { input, weights, activation, shift, values, slopes });
    }
}

impl<T: Float> Tile<T> {
    /// Makes room for `points`; of a forward pass alone, or both ways.
    pub fn resize(&mut self, network: &Network, points: usize, backward: bool) {
        self.passed.resize(network, points);
        if backward {
            let (points, layout) = (points.next_multiple_of(BLOCK), &network.layout);
            let widest = layout.rows.iter().map(|rows| rows.stride).max().unwrap_or(0);
            self.cotangents.iter_mut().for_each(|lines| lines.resize(points * widest));
            self.encoded.resize(points * layout.rows[0].stride);
            self.output.resize(layout.last_rows().stride);
        }
    }

    /// Returns the cotangents of the values, after [`Activations::forward`].
    pub fn cotangents(
        &mut self,
        cotangents: Cotangents<'_, T>,
        groups: Range<usize>,
        range: Range<usize>,
    ) {
        let Activations { points, values, slopes, .. } = &mut self.passed;
        let slopes = &mut slopes.all()[..*points];
        let cotangents = match cotangents {
            Cotangents::Given(all) => &all[range],
            Cotangents::Linked(link) => {
                // Free until the way back begins.
                let made = &mut self.cotangents[0].all()[..*points];
                link(groups, &values.read()[..*points], made);
                &*made
            }
        };
        // From here on slopes are those of the loss with the output before its activation.
        for (slope, cotangent) in slopes.iter_mut().zip(cotangents) {
            *slope *= *cotangent;
        }
    }

    /// Adds the gradient (or overwrites that of parameters), after [`Self::cotangents`].
    pub fn backward(
        &mut self,
        network: &Network,
        packed: &Packed<T>,
        parameters: &mut [T],
        overwrite: bool,
        coordinates: Option<CoordinatesMut<'_, T>>,
    ) {
        let (layout, wanted) = (&network.layout, coordinates.is_some());
        self.output_backward(network, packed, parameters, overwrite, wanted);
        for k in (0..layout.hidden().len()).rev() {
            self.weights(network, k, parameters, overwrite);
            if wanted && (k == 0 || layout.skip == Some(k)) {
                let stride = layout.rows[0].stride;
                let output = MatrixMut { numbers: self.encoded.all(), stride };
                let cotangent = matrix(&self.cotangents[0], layout.rows[k + 1]);
                let (points, units) = (self.passed.points, layout.hidden()[k].outputs);
                // Encoded points are not rectified, and the two layers that take them add up.
                let (panels, outputs, activations) = (packed.encoded(k), layout.encoded, None);
                dispatch(
                    network.instruction_set,
                    Backward { points, cotangent, units, panels, activations, outputs, output },
                );
            }
            if k > 0 {
                self.units(network, packed, k);
            }
        }
        if let Some(mut gradient) = coordinates {
            let rows = matrix(&self.passed.rows[0], layout.rows[0]);
            let cotangents = matrix(&self.encoded, layout.rows[0]);
            let (scales, part) = (&packed.scales[..gradient.dimension()], packed.part);
            encode_vjp(rows, cotangents, scales, part, network.settings.degree, &mut gradient);
        }
    }

    /// Gradient of a hidden layer's parameters.
    fn weights(&mut self, network: &Network, k: usize, parameters: &mut [T], overwrite: bool) {
        let (layout, layer) = (&network.layout, network.layout.hidden()[k]);
        let (points, inputs, outputs) = (self.passed.points, layer.inputs, layer.outputs);
        let input = matrix(&self.passed.rows[k], layout.rows[k]);
        let cotangent = matrix(&self.cotangents[0], layout.rows[k + 1]);
        let gradient = &mut parameters[layer.offset..layer.offset + layer.size()];
        let task = Weights { points, input, inputs, cotangent, outputs, gradient, overwrite };
        dispatch(network.instruction_set, task);
    }

    /// Gradient with respect to the units before a hidden layer, which is then the one at hand.
    fn units(&mut self, network: &Network, packed: &Packed<T>, k: usize) {
        let (layout, points) = (&network.layout, self.passed.points);
        let (units, outputs) = (layout.hidden()[k].outputs, layout.rows[k].units);
        let activations = Some(matrix(&self.passed.rows[k], layout.rows[k]));
        let [from, to] = &mut self.cotangents;
        let cotangent = matrix(from, layout.rows[k + 1]);
        let output = MatrixMut { numbers: to.all(), stride: layout.rows[k].stride };
        let panels = packed.transposed(k);
        dispatch(
            network.instruction_set,
            Backward { points, cotangent, units, panels, activations, outputs, output },
        );
        self.cotangents.swap(0, 1);
    }

    /// The output layer's part, and where the others start from.
    fn output_backward(
        &mut self,
        network: &Network,
        packed: &Packed<T>,
        parameters: &mut [T],
        overwrite: bool,
        wanted: bool,
    ) {
        let (layout, last) = (&network.layout, network.layout.hidden().len());
        let (weights, cotangents) =
            (packed.output(), &self.passed.slopes.read()[..self.passed.points]);
        let gradient = &mut self.output.all()[..weights.len()];
        gradient.fill(T::zero());
        let input = matrix(&self.passed.rows[last], layout.last_rows());
        let output = MatrixMut { numbers: self.cotangents[0].all(), stride: input.stride };
        let task = OutputBackward { cotangents, input, weights, output, gradient };
        dispatch(network.instruction_set, task);
        let layer = layout.output();
        let to = &mut parameters[layer.offset..layer.offset + layer.size()];
        for (to, x) in to.iter_mut().zip(self.output.read()) {
            *to = if overwrite { *x } else { *to + *x };
        }
        if wanted {
            self.encoded.all().fill(T::zero());
        }
        if wanted && layout.skip == Some(last) {
            let weights = &weights[layout.last_rows().units..][..layout.encoded];
            let rows = self.encoded.all().chunks_mut(layout.rows[0].stride);
            for (row, cotangent) in rows.zip(&self.passed.slopes.read()[..self.passed.points]) {
                row.iter_mut().zip(weights).for_each(|(x, w)| *x = *cotangent * *w);
            }
        }
    }
}

fn matrix<T: Float>(lines: &Lines<T>, rows: Rows) -> Matrix<'_, T> {
    Matrix { numbers: lines.read(), stride: rows.stride }
}

/// Appends the inputs behind the units of a row: the encoded point after a skip, and a one.
fn append<T: Float>(encoded: Matrix<'_, T>, rows: &mut [T], format: Rows, points: usize) {
    let from = encoded.numbers.chunks(encoded.stride);
    for (row, from) in rows.chunks_mut(format.stride).zip(from).take(points) {
        let appended = format.columns - format.units;
        row[format.units..format.columns].copy_from_slice(&from[..appended]);
        row[format.columns] = T::one();
    }
}
