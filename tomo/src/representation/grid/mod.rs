//! Voxels, trilinear in between.

pub(super) mod cells;
pub(super) mod scatter;
#[cfg(test)]
pub(in crate::representation) mod tests;

use super::{
    Activation, BuiltIn, Coordinates, CoordinatesMut, Gradient, Groups, Representation, Workspace,
};
use crate::Error;
use cells::{Geometry, Products, Values, check_box};
use kerrlight_common::simd::{Float, InstructionSet, dispatch};
use scatter::{Contribution, Scatter};

/// Shape of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridSettings {
    /// Nodes along x, y and z.
    pub nodes: [usize; 3],
    /// Coordinates of the first node, M.
    pub low: [f64; 3],
    /// Coordinates of the last node, M.
    pub high: [f64; 3],
    /// Activation from the interpolated number to emission. With [`Activation::Linear`] parameters are
    /// held at zero or above.
    pub activation: Activation,
    /// Initial value of all parameters.
    pub initial: f64,
}

/// A grid of numbers, interpolated linearly along each axis and then put through the activation.
///
/// Parameters are the nodes' numbers, z fastest, then y, then x. Outside the box the emission is
/// zero. The gradient with respect to the coordinates is that of the cell a point lies in.
#[derive(Clone, Debug)]
pub struct Grid {
    settings: GridSettings,
    instruction_set: InstructionSet,
}

/// Points that one thread takes at a time.
const SHARE: usize = 2048;
/// Points whose contributions are sorted at a time: they stay in cache.
const BLOCK: usize = if cfg!(test) { 1000 } else { 32_768 };

impl Grid {
    /// A grid of this shape.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn new(settings: GridSettings) -> Result<Self, Error> {
        let check = Error::check;
        for nodes in settings.nodes {
            check("nodes", nodes as f64, (2..=2048).contains(&nodes), "2 to 2048 along each axis")?;
        }
        check_box(settings.low, settings.high)?;
        let total: usize = settings.nodes.iter().product();
        check("nodes", total as f64, total <= 1 << 30, "2^30 in all")?;
        let linear = settings.activation == Activation::Linear;
        let ok = settings.initial.is_finite() && (settings.initial >= 0.0 || !linear);
        check("initial", settings.initial, ok, "a finite number, not negative if linear")?;
        Ok(Self { settings, instruction_set: InstructionSet::best() })
    }

    /// The same on another instruction set (the portable one where the machine lacks it): results differ
    /// by rounding.
    pub fn on(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set, ..self }
    }

    /// The shape.
    pub fn settings(&self) -> &GridSettings {
        &self.settings
    }

    fn check<T>(&self, parameters: &[T], at: &Coordinates<'_, T>, numbers: usize) {
        assert!(parameters.len() == self.settings.nodes.iter().product::<usize>());
        assert!(at.dimension() == 3 && at.len() == numbers);
    }

    fn values<T: Float>(&self, parameters: &[T], at: Coordinates<'_, T>, values: &mut [T]) {
        if at.len() > SHARE {
            let middle = halfway(at.len());
            let (left, right) = values.split_at_mut(middle);
            let (of_left, of_right) = (at.range(0..middle), at.range(middle..at.len()));
            let more = || self.values(parameters, of_right, right);
            rayon::join(|| self.values(parameters, of_left, left), more);
            return;
        }
        let (geometry, activation) = (self.geometry(), self.settings.activation);
        dispatch(self.instruction_set, Values { geometry, activation, parameters, at, values });
    }

    fn products<T: Float>(&self, share: Share<'_, T>) {
        if share.at.len() > SHARE {
            let (left, right) = share.halves();
            rayon::join(|| self.products(left), || self.products(right));
            return;
        }
        let (geometry, activation) = (self.geometry(), self.settings.activation);
        dispatch(self.instruction_set, Products { geometry, activation, share });
    }

    fn geometry<T: Float>(&self) -> Geometry<T> {
        let GridSettings { nodes, low, high, .. } = &self.settings;
        Geometry::new(*nodes, *low, *high)
    }
}

/// A multiple of all lanes near the middle.
fn halfway(points: usize) -> usize {
    // Only the last share then ends with a register that is not full, the slow case.
    (points / 2).next_multiple_of(kerrlight_common::simd::MAX_LANES)
}

/// Share of a batch that one thread turns into contributions to nodes.
struct Share<'a, T> {
    parameters: &'a [T],
    at: Coordinates<'a, T>,
    contributions: &'a mut [Contribution<T>],
    /// Emission, if wanted.
    values: Option<&'a mut [T]>,
    /// Gradients with respect to coordinates, if wanted, and the cotangents that they need.
    coordinates: Option<(CoordinatesMut<'a, T>, &'a [T])>,
}

impl<T> Share<'_, T> {
    fn halves(self) -> (Self, Self) {
        let Share { parameters, at, contributions, values, coordinates } = self;
        let middle = halfway(at.len());
        let (of_left, of_right) = (at.range(0..middle), at.range(middle..at.len()));
        let (contributions, more) = contributions.split_at_mut(middle);
        let (values, more_values) = values.map(|all| all.split_at_mut(middle)).unzip();
        let both = coordinates.map(|(all, cotangents)| {
            let (one, two) = all.split_at(middle);
            let (first, second) = cotangents.split_at(middle);
            ((one, first), (two, second))
        });
        let (coordinates, more_coordinates) = both.unzip();
        let left = Share { parameters, at: of_left, contributions, values, coordinates };
        let (values, coordinates) = (more_values, more_coordinates);
        (left, Share { parameters, at: of_right, contributions: more, values, coordinates })
    }
}

/// Memory kept from batch to batch.
#[derive(Default)]
struct Memory<T> {
    scatter: Scatter<T>,
    cotangents: Vec<T>,
}

impl<T: Float> Memory<T> {
    fn vjp(
        &mut self,
        grid: &Grid,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
    ) {
        grid.check(parameters, &at, cotangents.len());
        let Gradient { parameters: sums, mut coordinates } = gradient;
        assert!(sums.len() == parameters.len());
        assert!(
            coordinates.as_ref().is_none_or(|all| all.len() == at.len() && all.dimension() == 3)
        );
        for start in (0..at.len()).step_by(BLOCK) {
            let range = start..(start + BLOCK).min(at.len());
            let (at, cotangents) = (at.range(range.clone()), &cotangents[range.clone()]);
            let (ours, rest) = coordinates.take().map(|all| all.split_at(range.len())).unzip();
            coordinates = rest;
            let coordinates = ours.map(|all| (all, cotangents));
            let contributions = self.scatter.contributions(range.len());
            grid.products(Share { parameters, at, contributions, values: None, coordinates });
            self.scatter.add_to(cotangents, sums, grid.settings.nodes);
        }
    }

    /// Values and products, the cell of each point found once.
    fn eval_vjp(
        &mut self,
        grid: &Grid,
        parameters: &[T],
        at: Coordinates<'_, T>,
        groups: Groups<'_, T>,
        mut values: &mut [T],
        sums: &mut [T],
    ) {
        for (some, range) in groups.blocks(BLOCK) {
            let (ours, rest) = values.split_at_mut(range.len());
            values = rest;
            let at = at.range(range.clone());
            let contributions = self.scatter.contributions(range.len());
            let wanted = Some(&mut *ours);
            let share = Share { parameters, at, contributions, values: wanted, coordinates: None };
            grid.products(share);
            self.cotangents.resize(range.len(), T::zero());
            (groups.link)(some, ours, &mut self.cotangents);
            self.scatter.add_to(&self.cotangents, sums, grid.settings.nodes);
        }
    }
}

impl<T: Float> Representation<T> for Grid {
    fn dimension(&self) -> usize {
        3
    }

    fn built_in(&self) -> Option<BuiltIn<'_>> {
        Some(BuiltIn::Grid(self))
    }

    fn parameters(&self) -> usize {
        self.settings.nodes.iter().product()
    }

    fn initialise(&self, _seed: u64, parameters: &mut [T]) {
        assert!(parameters.len() == self.settings.nodes.iter().product::<usize>());
        parameters.fill(T::of(self.settings.initial));
    }

    fn project(&self, parameters: &mut [T]) {
        if self.settings.activation == Activation::Linear {
            // In this order a NaN stays one.
            parameters.iter_mut().for_each(|x| *x = if *x < T::zero() { T::zero() } else { *x });
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
        self.values(parameters, at, values);
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
        self.check(parameters, &at, values.len());
        assert!(gradient.parameters.len() == parameters.len());
        let memory: &mut Memory<T> = workspace.of();
        // Slopes of coordinates need cotangents while cells are at hand, cotangents all values of a
        // ray: that takes two passes.
        if gradient.coordinates.is_none() {
            return memory.eval_vjp(self, parameters, at, groups, values, gradient.parameters);
        }
        self.values(parameters, at, values);
        let mut cotangents = core::mem::take(&mut memory.cotangents);
        cotangents.resize(at.len(), T::zero());
        (groups.link)(0..groups.starts.len().saturating_sub(1), values, &mut cotangents);
        memory.vjp(self, parameters, at, &cotangents, gradient);
        memory.cotangents = cotangents;
    }
}
