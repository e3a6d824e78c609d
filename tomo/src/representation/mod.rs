//! Emission as a function of coordinates and parameters.
//!
//! A [`Representation`] gets coordinates: it sees no metric, camera, flow or telescope. Those that matter
//! carries get points that the dynamics have pulled back to the reference time. Parameters
//! are one flat slice that the caller owns; batches are columns of coordinates.
//!
//! [`conformance`] holds what every representation must pass.

mod activation;
mod changing;
pub mod conformance;
mod features;
mod grid;
mod network;
mod registry;
pub(crate) mod spline;
mod workspace;

pub use activation::Activation;
pub use changing::{Allowed, Carrier, Changing, Knots};
pub use features::{FeatureGrid, FeatureGridSettings};
pub use grid::{Grid, GridSettings};
pub use network::{Network, NetworkSettings};
pub use registry::{
    BuildError, BuildRepresentation, FindRepresentation, OwnError, OwnSettings, Registry,
};
pub use spline::{Degree, Spline};
pub use workspace::Workspace;

pub use kerrlight_common::simd::{Float, InstructionSet};
pub use kerrlight_render::points::{Coordinates, CoordinatesMut};

use core::ops::Range;

/// Destination of a vector-Jacobian product; it is added to what is there.
#[derive(Debug)]
pub struct Gradient<'a, T> {
    /// Gradient with respect to the parameters.
    pub parameters: &'a mut [T],
    /// Gradient with respect to the coordinates, if wanted.
    pub coordinates: Option<CoordinatesMut<'a, T>>,
}

/// Parameters that are a matrix: what a layer of a network multiplies its inputs with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WeightMatrix {
    /// Place of its first number among the parameters; row lies behind row.
    pub offset: usize,
    /// Inputs, and a row of biases where there are any.
    pub rows: usize,
    /// Units.
    pub columns: usize,
}

impl WeightMatrix {
    /// Its place among the parameters.
    pub fn range(&self) -> Range<usize> {
        self.offset..self.offset + self.rows * self.columns
    }
}

/// Given a range of groups and the values of their points, writes dL/dvalue of each point. Called from
/// several threads, for every group once.
pub type Link<'a, T> = dyn Fn(Range<usize>, &[T], &mut [T]) + Sync + 'a;

/// One of the representations that are built in: devices that evaluate them have kernels of their own.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum BuiltIn<'a> {
    /// A network.
    Network(&'a Network),
    /// Voxels.
    Grid(&'a Grid),
    /// Features on grids and a network.
    FeatureGrid(&'a FeatureGrid),
}

/// Groups that tie values to cotangents inside a batch: the points of a ray to its pixel.
#[derive(Clone, Copy)]
pub struct Groups<'a, T> {
    /// Group k holds the points `starts[k]..starts[k + 1]`, from 0 to the number of points.
    pub starts: &'a [usize],
    /// Map from values to cotangents.
    pub link: &'a Link<'a, T>,
}

impl<T> Groups<'_, T> {
    /// Groups, and their points, of which there are at most so many, or one group, at a time.
    pub(crate) fn blocks(
        &self,
        points: usize,
    ) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        let starts = self.starts;
        let mut group = 0;
        core::iter::from_fn(move || {
            let first = *starts.get(..starts.len().saturating_sub(1))?.get(group)?;
            let after = starts.partition_point(|start| *start <= first + points) - 1;
            let (from, to) = (group, after.max(group + 1));
            group = to;
            Some((from..to, first..starts[to]))
        })
    }
}

/// An emission field e(x; parameters), evaluated on batches of points by all threads of the current
/// rayon pool.
///
/// Results do not depend on the number of threads, to the last bit; a point's value and its
/// gradient with respect to the coordinates do not depend on its batch either. Fields that do not
/// change allocate nothing once the workspace has seen a batch of the size.
///
/// Lengths that do not fit together are bugs and panic.
///
/// [`Grid`], [`FeatureGrid`] and [`Network`] are built in. One of your own implements the five methods
/// without a default, passes [`conformance`], and enters a [`Registry`] to have a name in fit files.
///
/// ```
/// use kerrlight_tomo::representation::{
///     Activation, Coordinates, Gradient, Grid, GridSettings, Representation, Workspace,
/// };
///
/// let field = Grid::new(GridSettings {
///     nodes: [2, 2, 2],
///     low: [0.0; 3],
///     high: [1.0; 3],
///     activation: Activation::Linear,
///     initial: 0.0,
/// })?;
/// // Node (x, y, z) holds x: then the field is e = x.
/// let parameters = [0.0f64, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
/// let (x, y, z) = ([0.25], [0.5], [0.75]);
/// let at = || Coordinates::xyz(&x, &y, &z);
/// let (mut values, mut workspace) = ([0.0], Workspace::new());
/// field.eval(&parameters, at(), &mut values, &mut workspace);
/// assert!((values[0] - 0.25).abs() < 1e-15);
///
/// // de/dparameter are the weights of trilinear interpolation: they add up to 1.
/// let mut weights = [0.0; 8];
/// let gradient = Gradient { parameters: &mut weights, coordinates: None };
/// field.vjp(&parameters, at(), &[1.0], gradient, &mut workspace);
/// assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
/// # Ok::<(), kerrlight_tomo::Error>(())
/// ```
pub trait Representation<T: Float>: Send + Sync {
    /// Coordinates of a point: 3 (x, y, z) or 4 (t, x, y, z).
    fn dimension(&self) -> usize;

    /// Returns whether a point is given by the place that its matter has at the reference time, rather than by where its
    /// light is emitted: matter then carries the field along. Fields of space alone always are; those of (t, x, y, z) are
    /// fields of events, unless they say so.
    fn is_carried(&self) -> bool {
        self.dimension() == 3
    }

    /// Number of parameters.
    fn parameters(&self) -> usize;

    /// Parameters to start from; the same for the same seed on every machine.
    fn initialise(&self, seed: u64, parameters: &mut [T]);

    /// Returns the parameters that are matrices of which [`Muon`](crate::optimise::Muon) may take its steps, in their
    /// order; all others are learnt by Adam.
    fn matrices(&self) -> Vec<WeightMatrix> {
        Vec::new()
    }

    /// Returns the built-in representation that it is, if it is one that devices may know.
    fn built_in(&self) -> Option<BuiltIn<'_>> {
        None
    }

    /// Moves parameters to the nearest allowed ones, after each step of an optimiser.
    fn project(&self, _parameters: &mut [T]) {}

    /// values = e(x); what was in `values` is overwritten.
    fn eval(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    );

    /// Adds Σ cotangent · de/dparameter, and cotangent · de/dcoordinate of each point where asked.
    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    );

    /// The same as [`eval`](Self::eval) for points whose [`vjp_recorded`](Self::vjp_recorded) comes next: a network
    /// keeps its activations in the workspace.
    fn eval_recorded(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    ) {
        self.eval(parameters, at, values, workspace);
    }

    /// The same as [`vjp`](Self::vjp), to the bit, after [`eval_recorded`](Self::eval_recorded) of the same
    /// parameters and points and nothing else in the same workspace; a network does not pass forward again.
    fn vjp_recorded(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        self.vjp(parameters, at, cotangents, gradient, workspace);
    }

    /// Both at once, for cotangents that depend on the values of the same group only (the pixel at
    /// the end of a ray): overwrites `values`, and adds the product with the cotangents that the link
    /// makes of them.
    ///
    /// Evaluates values and their vector-Jacobian product. The default does one after the other, and takes memory for the
    /// cotangents each time; a network goes through its layers once instead of twice.
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
        let mut cotangents = vec![T::zero(); values.len()];
        (groups.link)(0..groups.starts.len().saturating_sub(1), values, &mut cotangents);
        self.vjp(parameters, at, &cotangents, gradient, workspace);
    }
}
