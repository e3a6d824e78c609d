//! Progress and result of a solution.

use super::certificate::{Certificate, Stationarity};
use super::descent::Ending;
use core::ops::ControlFlow;
use kerrlight_common::simd::Float;

/// State of a solution while iterations go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearProgress {
    /// 0: the coarse problem.
    pub round: usize,
    /// Values, gradients and products so far.
    pub evaluations: usize,
    /// The loss, dimensionless (of the coarse problem, in round 0).
    pub value: f64,
    /// Nodes that count.
    pub nodes: usize,
}

/// A solution.
#[derive(Clone, Debug)]
pub struct LinearSolution<T> {
    /// Emission at the nodes, parameters of the linear grid; knot after knot where it may change.
    pub emission: Vec<T>,
    /// Parameters of what does not move ([`Quiescent`](crate::fit::Quiescent)), where that is recovered.
    pub quiescent: Vec<T>,
    /// Largest distance from the minimum; none if it was cancelled, or the data are not convex in the pixels.
    pub certificate: Option<Certificate>,
    /// Flatness of the function there, if the data are not convex: all that can be said then.
    pub stationarity: Option<Stationarity>,
    /// Reason why the last round ended.
    pub ending: Ending,
    /// Rounds, the coarse problem not counted.
    pub rounds: usize,
    /// Nodes that counted in the last round.
    pub nodes: usize,
    /// Values, gradients and products with second derivatives, those over all nodes included.
    pub evaluations: usize,
    /// Largest bytes of a sparse matrix.
    pub bytes: usize,
}

impl<T: Float> LinearSolution<T> {
    /// All parameters: those of the linear grid, and behind them those of what does not move.
    pub fn parameters(&self) -> Vec<T> {
        [self.emission.as_slice(), &self.quiescent].concat()
    }
}

/// Field that some iterations reached.
#[derive(Clone, Debug)]
pub struct Least {
    /// Emission at all nodes of the grid, and parameters of what does not move behind it.
    pub x: Vec<f64>,
    /// Value of the objective.
    pub value: f64,
}

/// Told how it goes, says whether to go on.
pub type Watch<'a> = dyn FnMut(&LinearProgress) -> ControlFlow<()> + 'a;
