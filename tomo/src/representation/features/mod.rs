//! Features on grids of several resolutions, and a small network that turns them into emission.

mod kernels;
mod layout;
#[cfg(test)]
mod tests;

use super::grid::cells::{Axis, Geometry};
use super::grid::scatter::Scatter;
use super::{Activation, Coordinates, Gradient, Groups, Representation, Workspace};
use crate::simd::{InstructionSet, Scalar, dispatch};
use kernels::{Backward, Corners, Values};
use kerrlight_geodesic::OutOfRange;
use layout::{FEATURES, Layout, MAX_LEVELS, WIDTH};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Shape of a [`FeatureGrid`].
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureGridSettings {
    /// Cells of the coarsest grid along each axis; every further one has twice as many.
    pub coarsest: usize,
    /// How many grids, 1 to 6.
    pub levels: usize,
    /// Coordinates of the first node of all grids, M.
    pub low: [f64; 3],
    /// Coordinates of the last node, M.
    pub high: [f64; 3],
    /// From the network's output to emission: [`Activation::Sigmoid`] or [`Activation::Softplus`].
    pub activation: Activation,
    /// What the bias of the output starts from: far below 0 it is dark.
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
const BLOCK: usize = if cfg!(test) { 1000 } else { 32_768 };
/// Features start from uniform numbers of this size.
const FAINT: f64 = 1e-2;

impl FeatureGrid {
    /// Grids and a network of this shape.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn new(settings: FeatureGridSettings) -> Result<Self, OutOfRange> {
        let check = |field, value, ok, allowed| {
            if ok { Ok(()) } else { Err(OutOfRange { field, value, allowed }) }
        };
        let FeatureGridSettings { coarsest, levels, low, high, .. } = &settings;
        check("levels", *levels as f64, (1..=6).contains(levels), "1 to 6")?;
        let finest = coarsest.saturating_mul(1 << (levels - 1));
        check("coarsest", *coarsest as f64, *coarsest >= 1, "1 or more cells")?;
        check("coarsest", *coarsest as f64, finest <= 512, "at most 512 cells of the finest grid")?;
        for axis in 0..3 {
            check("low", low[axis], low[axis].is_finite(), "a finite number")?;
            let above = high[axis].is_finite() && high[axis] > low[axis];
            check("high", high[axis], above, "above low")?;
        }
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

    /// The grids, coarsest first, and places that are not used.
    fn geometries<T: Scalar>(&self) -> [Geometry<T>; MAX_LEVELS] {
        let FeatureGridSettings { low, high, .. } = &self.settings;
        let geometry = |nodes: usize| {
            let axis = |k: usize| Axis {
                low: T::of(low[k]),
                per_length: T::of((nodes - 1) as f64 / (high[k] - low[k])),
                cells: T::of((nodes - 1) as f64),
            };
            Geometry { axes: [axis(0), axis(1), axis(2)], nodes: [nodes; 3] }
        };
        core::array::from_fn(|level| geometry(self.layout.nodes(level)))
    }
}

/// What is kept from batch to batch.
#[derive(Default)]
struct Memory<T> {
    scatter: Scatter<T>,
    /// dL/dfeature of each point, all features of a point side by side.
    slopes: Vec<T>,
    /// Gradients of the network, a share of points after the other.
    network: Vec<T>,
    /// dL/dx of each point.
    pulls: Vec<[T; 3]>,
    cotangents: Vec<T>,
}

impl<T: Scalar + Default> Memory<T> {
    fn vjp(
        &mut self,
        grid: &FeatureGrid,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
    ) {
        let Gradient { parameters: sums, mut coordinates } = gradient;
        let geometries = &grid.geometries()[..grid.settings.levels];
        for start in (0..at.len()).step_by(BLOCK) {
            let range = start..(start + BLOCK).min(at.len());
            let (here, cotangents) = (at.range(range.clone()), &cotangents[range.clone()]);
            let wanted = coordinates.is_some();
            self.through_network(grid, geometries, parameters, (here, wanted), cotangents, sums);
            self.add_to_nodes(grid, geometries, here, sums);
            if let Some(coordinates) = &mut coordinates {
                for (k, column) in coordinates.columns().iter_mut().enumerate() {
                    let column = column[range.clone()].iter_mut();
                    column.zip(&self.pulls).for_each(|(sum, pull)| *sum += pull[k]);
                }
            }
        }
    }

    /// Gradients of features and of the network. The network's are summed share by share, always in the same order.
    fn through_network(
        &mut self,
        grid: &FeatureGrid,
        geometries: &[Geometry<T>],
        parameters: &[T],
        (at, wanted): (Coordinates<'_, T>, bool),
        cotangents: &[T],
        sums: &mut [T],
    ) {
        let (inputs, each) = (grid.layout.inputs(), grid.layout.network());
        let shares = at.len().div_ceil(SHARE);
        self.slopes.resize(at.len() * inputs, T::zero());
        self.network.resize(shares * each, T::zero());
        self.pulls.resize(at.len(), [T::zero(); 3]);
        let outputs =
            self.slopes.par_chunks_mut(SHARE * inputs).zip(self.network.par_chunks_mut(each));
        outputs.zip(self.pulls.par_chunks_mut(SHARE)).enumerate().for_each(
            |(share, ((slopes, network), pulls))| {
                let range = share * SHARE..((share + 1) * SHARE).min(at.len());
                let (at, cotangents) = (at.range(range.clone()), &cotangents[range]);
                let (layout, activation) = (&grid.layout, grid.settings.activation);
                let task = Backward {
                    layout,
                    geometries,
                    activation,
                    parameters,
                    at,
                    cotangents,
                    slopes,
                    network,
                    pulls: wanted.then_some(pulls),
                };
                dispatch(grid.instruction_set, task);
            },
        );
        let sums = &mut sums[grid.layout.network_start()..];
        for share in self.network.chunks(each) {
            sums.iter_mut().zip(share).for_each(|(sum, part)| *sum += *part);
        }
    }

    /// Adds the gradients of features to the nodes around each point.
    fn add_to_nodes(
        &mut self,
        grid: &FeatureGrid,
        geometries: &[Geometry<T>],
        at: Coordinates<'_, T>,
        sums: &mut [T],
    ) {
        let inputs = grid.layout.inputs();
        for (level, geometry) in geometries.iter().enumerate() {
            let contributions = self.scatter.contributions(at.len());
            contributions.par_chunks_mut(SHARE).enumerate().for_each(|(share, contributions)| {
                let from = share * SHARE;
                let at = at.range(from..from + contributions.len());
                dispatch(grid.instruction_set, Corners { geometry, at, contributions });
            });
            self.scatter.sort(geometry.nodes);
            for feature in 0..FEATURES {
                let slope = |point: usize| self.slopes[point * inputs + level * FEATURES + feature];
                let plane = &mut sums[grid.layout.plane(level, feature)];
                self.scatter.add_sorted(slope, plane, geometry.nodes);
            }
        }
    }
}

impl<T: Scalar + Default> Representation<T> for FeatureGrid {
    fn dimension(&self) -> usize {
        3
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
        values.par_chunks_mut(SHARE).enumerate().for_each(|(share, values)| {
            let from = share * SHARE;
            let at = at.range(from..from + values.len());
            let (layout, activation) = (&self.layout, self.settings.activation);
            let task = Values { layout, geometries, activation, parameters, at, values };
            dispatch(self.instruction_set, task);
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
        assert!(gradient.parameters.len() == parameters.len());
        let coordinates = gradient.coordinates.as_ref();
        assert!(coordinates.is_none_or(|all| all.len() == at.len() && all.dimension() == 3));
        let memory: &mut Memory<T> = workspace.of();
        memory.vjp(self, parameters, at, cotangents, gradient);
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
        self.eval(parameters, at, values, workspace);
        let memory: &mut Memory<T> = workspace.of();
        let mut cotangents = core::mem::take(&mut memory.cotangents);
        cotangents.resize(at.len(), T::zero());
        (groups.link)(0..groups.starts.len().saturating_sub(1), values, &mut cotangents);
        self.vjp(parameters, at, &cotangents, gradient, workspace);
        let memory: &mut Memory<T> = workspace.of();
        memory.cotangents = cotangents;
    }
}
