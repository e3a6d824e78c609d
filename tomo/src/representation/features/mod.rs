//! Features on grids of several resolutions, and a small network that turns them into emission.

mod kernels;
mod layout;
#[cfg(test)]
pub(in crate::representation) mod tests;

use super::grid::cells::{Geometry, check_box};
use super::grid::scatter::Scatter;
use super::{
    Activation, BuiltIn, Coordinates, CoordinatesMut, Gradient, Groups, Representation, Workspace,
};
use crate::Error;
use core::ops::Range;
use kernels::{Backward, Corners, Forward};
use kerrlight_common::simd::{Float, InstructionSet, dispatch};
use layout::{FEATURES, Layout, MAX_LEVELS, WIDTH};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Shape of a [`FeatureGrid`].
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureGridSettings {
    /// Cells of the coarsest grid along each axis; every further one has twice as many.
    pub coarsest: usize,
    /// Number of grids, 1 to 6.
    pub levels: usize,
    /// Coordinates of the first node of all grids, M.
    pub low: [f64; 3],
    /// Coordinates of the last node, M.
    pub high: [f64; 3],
    /// Activation from the network's output to emission: [`Activation::Sigmoid`] or [`Activation::Softplus`].
    pub activation: Activation,
    /// Initial bias of the output: far below 0 it is dark.
    pub initial: f64,
}

/// Two features on the nodes of each of several grids, interpolated linearly along each axis, are the inputs of a network of two hidden layers of
/// 16 rectified units and one output, which is put through the activation; zero outside the box.
///
/// The grids are those of Müller et al. 2022 (Instant Neural Graphics Primitives, ACM Trans. Graph. 41, 102), without hashing, as
/// no grid here is too large to be held whole.
///
/// Parameters are the features, grid by grid from the coarsest, feature by feature, z fastest; then the network's, layer by layer, a
/// row of weights for each input and then the biases.
#[derive(Clone, Debug)]
pub struct FeatureGrid {
    settings: FeatureGridSettings,
    layout: Layout,
    instruction_set: InstructionSet,
}

/// Points that one thread takes at a time.
const SHARE: usize = 512;
/// Points whose gradients are kept at a time.
// Small in tests, so that a few thousand points fill several blocks.
const BLOCK: usize = if cfg!(test) { 1000 } else { 32_768 };
/// Features start from uniform numbers of this size.
const FAINT: f64 = 1e-2;

impl FeatureGrid {
    /// Numbers on each node of a grid.
    pub const FEATURES: usize = FEATURES;
    /// Units of each of the two hidden layers.
    pub const WIDTH: usize = WIDTH;

    /// Grids and a network of this shape.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn new(settings: FeatureGridSettings) -> Result<Self, Error> {
        let check = Error::check;
        let FeatureGridSettings { coarsest, levels, low, high, .. } = &settings;
        check("levels", *levels as f64, (1..=6).contains(levels), "1 to 6")?;
        let finest = coarsest.saturating_mul(1 << (levels - 1));
        check("coarsest", *coarsest as f64, *coarsest >= 1, "1 or more cells")?;
        check("coarsest", *coarsest as f64, finest <= 512, "at most 512 cells of the finest grid")?;
        check_box(*low, *high)?;
        check("initial", settings.initial, settings.initial.is_finite(), "a finite number")?;
        let positive = settings.activation != Activation::Linear;
        check("activation", 0.0, positive, "sigmoid or softplus: a network's output has any sign")?;
        let layout = Layout::new(*coarsest, *levels);
        Ok(Self { settings, layout, instruction_set: InstructionSet::best() })
    }

    /// The same on another instruction set (the portable one where the machine lacks it): results differ by
    /// rounding.
    pub fn on(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set, ..self }
    }

    /// The shape.
    pub fn settings(&self) -> &FeatureGridSettings {
        &self.settings
    }

    fn check<T>(&self, parameters: &[T], at: &Coordinates<'_, T>, numbers: usize) {
        assert!(parameters.len() == self.layout.parameters());
        assert!(at.dimension() == 3 && at.len() == numbers);
    }

    fn check_gradient<T>(&self, at: &Coordinates<'_, T>, gradient: &Gradient<'_, T>) {
        assert!(gradient.parameters.len() == self.layout.parameters());
        let coordinates = gradient.coordinates.as_ref();
        assert!(coordinates.is_none_or(|all| all.len() == at.len() && all.dimension() == 3));
    }

    /// The grids, coarsest first, and places that are not used.
    fn geometries<T: Float>(&self) -> [Geometry<T>; MAX_LEVELS] {
        let FeatureGridSettings { low, high, .. } = &self.settings;
        let geometry = |nodes: usize| Geometry::new([nodes; 3], *low, *high);
        core::array::from_fn(|level| geometry(self.layout.nodes(level)))
    }
}

/// Parameters and settings with which every part of a batch is computed.
#[derive(Clone, Copy)]
struct Field<'a, T> {
    grid: &'a FeatureGrid,
    geometries: &'a [Geometry<T>],
    parameters: &'a [T],
}

/// Memory kept from batch to batch.
#[derive(Default)]
struct Memory<T> {
    scatter: Scatter<T>,
    values: Vec<T>,
    cotangents: Vec<T>,
    /// Values that the way back needs, a share of points after the other.
    kept: Vec<T>,
    /// dL/dfeature of each point, all features of a point side by side.
    slopes: Vec<T>,
    /// Gradients of the network, a share of points after the other.
    network: Vec<T>,
    /// dL/dx of each point.
    pulls: Vec<[T; 3]>,
}

impl<T: Float> Memory<T> {
    fn vjp(
        &mut self,
        field: Field<'_, T>,
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
    ) {
        let Gradient { parameters: sums, mut coordinates } = gradient;
        let mut values = core::mem::take(&mut self.values);
        for start in (0..at.len()).step_by(BLOCK) {
            let range = start..(start + BLOCK).min(at.len());
            let (ours, rest) = coordinates.take().map(|all| all.split_at(range.len())).unzip();
            coordinates = rest;
            values.resize(range.len(), T::zero());
            self.forward(field, at.range(range.clone()), &mut values);
            self.backward(field, at.range(range.clone()), &cotangents[range], sums, ours);
        }
        self.values = values;
    }

    /// Goes through the network once.
    fn eval_vjp(
        &mut self,
        field: Field<'_, T>,
        at: Coordinates<'_, T>,
        groups: Groups<'_, T>,
        values: &mut [T],
        gradient: Gradient<'_, T>,
    ) {
        let Gradient { parameters: sums, mut coordinates } = gradient;
        let mut cotangents = core::mem::take(&mut self.cotangents);
        for (some, range) in groups.blocks(BLOCK) {
            let (ours, rest) = coordinates.take().map(|all| all.split_at(range.len())).unzip();
            coordinates = rest;
            let (at, values) = (at.range(range.clone()), &mut values[range.clone()]);
            self.forward(field, at, values);
            cotangents.resize(range.len(), T::zero());
            (groups.link)(some, values, &mut cotangents);
            self.backward(field, at, &cotangents, sums, ours);
        }
        self.cotangents = cotangents;
    }

    /// Values of a block of points, and what the way back needs.
    fn forward(&mut self, field: Field<'_, T>, at: Coordinates<'_, T>, values: &mut [T]) {
        let each = SHARE * field.grid.layout.kept();
        self.kept.resize(at.len().div_ceil(SHARE) * each, T::zero());
        let shares = values.par_chunks_mut(SHARE).zip(self.kept.par_chunks_mut(each));
        shares.enumerate().for_each(|(share, (values, kept))| {
            field.values(at.range(share_of(share, values.len())), values, Some(kept));
        });
    }

    /// Adds the gradients of the block that went forward last.
    fn backward(
        &mut self,
        field: Field<'_, T>,
        at: Coordinates<'_, T>,
        cotangents: &[T],
        sums: &mut [T],
        coordinates: Option<CoordinatesMut<'_, T>>,
    ) {
        self.through_network(field, at, coordinates.is_some(), cotangents, sums);
        self.add_to_nodes(field, at, sums);
        if let Some(mut coordinates) = coordinates {
            for (k, column) in coordinates.columns().iter_mut().enumerate() {
                column.iter_mut().zip(&self.pulls).for_each(|(sum, pull)| *sum += pull[k]);
            }
        }
    }

    /// Gradients of features and of the network. The network's are summed share by share, always in the same order.
    fn through_network(
        &mut self,
        Field { grid, geometries, parameters }: Field<'_, T>,
        at: Coordinates<'_, T>,
        wanted: bool,
        cotangents: &[T],
        sums: &mut [T],
    ) {
        let layout = &grid.layout;
        let (inputs, each) = (layout.inputs(), layout.network());
        let shares = at.len().div_ceil(SHARE);
        self.slopes.resize(at.len() * inputs, T::zero());
        self.network.resize(shares * each, T::zero());
        // Even where slopes of places are not wanted: their chunks tell how long each share is.
        self.pulls.resize(at.len(), [T::zero(); 3]);
        let outputs =
            self.slopes.par_chunks_mut(SHARE * inputs).zip(self.network.par_chunks_mut(each));
        let outputs = outputs.zip(self.pulls.par_chunks_mut(SHARE));
        let shares = outputs.zip(self.kept.par_chunks(SHARE * layout.kept())).enumerate();
        shares.for_each(|(share, (((slopes, network), pulls), kept))| {
            let range = share_of(share, pulls.len());
            let (at, cotangents) = (at.range(range.clone()), &cotangents[range]);
            let pulls = wanted.then_some(pulls);
            let task = Backward {
                layout,
                geometries,
                parameters,
                at,
                cotangents,
                kept,
                slopes,
                network,
                pulls,
            };
            dispatch(grid.instruction_set, task);
        });
        let sums = &mut sums[layout.network_start()..];
        for share in self.network.chunks(each) {
            sums.iter_mut().zip(share).for_each(|(sum, part)| *sum += *part);
        }
    }

    /// Adds the gradients of features to the nodes around each point.
    fn add_to_nodes(
        &mut self,
        Field { grid, geometries, .. }: Field<'_, T>,
        at: Coordinates<'_, T>,
        sums: &mut [T],
    ) {
        let inputs = grid.layout.inputs();
        for (level, geometry) in geometries.iter().enumerate() {
            let contributions = self.scatter.contributions(at.len());
            contributions.par_chunks_mut(SHARE).enumerate().for_each(|(share, contributions)| {
                let at = at.range(share_of(share, contributions.len()));
                dispatch(grid.instruction_set, Corners { geometry, at, contributions });
            });
            // Both features of a level lie on the same nodes and take one order of the points.
            self.scatter.sort(geometry.nodes);
            for feature in 0..FEATURES {
                let slope = |point: usize| self.slopes[point * inputs + level * FEATURES + feature];
                let plane = &mut sums[grid.layout.plane(level, feature)];
                self.scatter.add_sorted(slope, plane, geometry.nodes);
            }
        }
    }
}

impl<T: Float> Field<'_, T> {
    fn values(&self, at: Coordinates<'_, T>, values: &mut [T], kept: Option<&mut [T]>) {
        let Field { grid, geometries, parameters } = *self;
        let (layout, activation) = (&grid.layout, grid.settings.activation);
        let task = Forward { layout, geometries, activation, parameters, at, values, kept };
        dispatch(grid.instruction_set, task);
    }
}

/// The points of a share that has this many.
fn share_of(share: usize, points: usize) -> Range<usize> {
    share * SHARE..share * SHARE + points
}

impl<T: Float> Representation<T> for FeatureGrid {
    fn dimension(&self) -> usize {
        3
    }

    fn built_in(&self) -> Option<BuiltIn<'_>> {
        Some(BuiltIn::FeatureGrid(self))
    }

    fn parameters(&self) -> usize {
        self.layout.parameters()
    }

    /// Faint features, weights uniform within ±√(6/inputs) (He et al. 2015), no biases but that of the output.
    fn initialise(&self, seed: u64, parameters: &mut [T]) {
        assert!(parameters.len() == self.layout.parameters());
        let mut random = Pcg64::seed_from_u64(seed);
        let (features, network) = parameters.split_at_mut(self.layout.network_start());
        features.fill_with(|| T::of(random.random_range(-FAINT..FAINT)));
        let [first, second, last] = self.layout.kernels();
        network.fill(T::zero());
        for (kernel, inputs) in [(first, self.layout.inputs()), (second, WIDTH), (last, WIDTH)] {
            let limit = (6.0 / inputs as f64).sqrt();
            network[kernel].fill_with(|| T::of(random.random_range(-limit..limit)));
        }
        if let Some(bias) = network.last_mut() {
            *bias = T::of(self.settings.initial);
        }
    }

    fn eval(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        _workspace: &mut Workspace,
    ) {
        self.check(parameters, &at, values.len());
        let geometries = &self.geometries()[..self.settings.levels];
        let field = Field { grid: self, geometries, parameters };
        values.par_chunks_mut(SHARE).enumerate().for_each(|(share, values)| {
            field.values(at.range(share_of(share, values.len())), values, None);
        });
    }

    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        self.check(parameters, &at, cotangents.len());
        self.check_gradient(&at, &gradient);
        let geometries = &self.geometries()[..self.settings.levels];
        let field = Field { grid: self, geometries, parameters };
        workspace.of::<Memory<T>>().vjp(field, at, cotangents, gradient);
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
        self.check(parameters, &at, values.len());
        self.check_gradient(&at, &gradient);
        let geometries = &self.geometries()[..self.settings.levels];
        let field = Field { grid: self, geometries, parameters };
        workspace.of::<Memory<T>>().eval_vjp(field, at, groups, values, gradient);
    }
}
