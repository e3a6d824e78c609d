//! Settings of the recovery.

use super::gaussian::cubic;
use super::{FieldKind, PriorOfVoxels};
use crate::fit::{BatchSize, OccupancySettings};
use crate::representation::{Allowed, Degree};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the optimiser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Rule of the steps.
    pub optimiser: Optimiser,
    /// Number of steps, at most.
    pub steps: u64,
    /// Steps over which the rate grows from 0.
    pub ramp: u64,
    /// Data of a step.
    pub batch: BatchSize,
    /// Initial parameters.
    pub start: Start,
    /// A mask that skips dark cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occupancy: Option<OccupancySettings>,
    /// Steps between lines of the log.
    #[schemars(range(min = 1), extend("unit" = "steps"))]
    pub log_every: u64,
    /// Longest time between checkpoints, s.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "seconds"))]
    pub checkpoint_seconds: f64,
}

/// The linear problem of voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// Largest allowed emission.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "the largest emission"))]
    pub upper: f64,
    /// Mean flux of a frame, Jy; needed with closure quantities alone.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "Jy"))]
    pub flux_jy: Option<f64>,
    /// Factor on ∫ |∇e|² dV.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub smoothness: f64,
    /// Factor on ∫ e dV.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub sparsity: f64,
    /// Gaussian or log-normal prior of the voxels: every loss then has the weight 1. Not with `[change]` or
    /// `[quiescent]`.
    pub prior: Option<PriorOfVoxels>,
    /// B-splines between the nodes; a scan of axes and a `[band]` use trilinear voxels.
    #[serde(default = "cubic")]
    pub degree: Degree,
    /// Rounds in which nodes may be admitted again.
    #[serde(default = "rounds")]
    #[schemars(range(min = 1), extend("unit" = "rounds"))]
    pub rounds: usize,
    /// Iterations per round, at most.
    #[serde(default = "iterations")]
    #[schemars(range(min = 1), extend("unit" = "iterations"))]
    pub iterations: usize,
}

impl Linear {
    /// The prior of the voxels, if it is of this kind.
    pub fn prior_of(&self, kind: FieldKind) -> Option<&PriorOfVoxels> {
        self.prior.as_ref().filter(|prior| prior.kind == kind)
    }
}

/// An image on the screen that is the same in every frame, recovered beside the emission; constant fluxes of a light
/// curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuiescentSettings {
    /// Largest brightness, M of emission 1 along a line of sight; of a light curve, the largest |flux|, Jy.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "M of emission; Jy, of a light curve"))]
    pub upper: f64,
    /// Factor on ∫ |∇b|² dA over the screen, b in M and A in M²; needed, but not for light curves.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub smoothness: Option<f64>,
    /// Factor on ∫ b dA; needed, but not for light curves.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub sparsity: Option<f64>,
}

/// Change of emission while matter carries it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChangeSettings {
    /// Changes that are allowed.
    pub allowed: Allowed,
    /// Factor on ∫∫ |∂e/∂t| dV dt along the flow, M³ of emission.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
    /// Longest time between the knots at which the emission is free, M.
    #[schemars(range(min = 1e-6, max = 1e9), extend("unit" = "M"))]
    pub spacing: f64,
    /// An emission s: births found in a round cost s/(s + e) of `weight` in the next. Needs births and
    /// `linear.rounds` of 2 or more.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "an emission"))]
    pub sharpen: Option<f64>,
}

/// Start of the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Start {
    /// Parameters as the representation draws them.
    #[default]
    Drawn,
    /// Fitted to the solution of the linear problem on a coarse grid.
    Linear {
        /// Nodes of the linear problem along each axis.
        nodes: usize,
        /// Every so many-eth frame is used.
        stride: usize,
        /// Steps of each round of the fit to its solution, which ends within 5 % of it or after four rounds.
        steps: u64,
        /// Iterations in place of `linear.iterations`.
        iterations: Option<usize>,
    },
}

/// Axis of the motion, or how to look for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum AxisSearch {
    /// It is `motion.axis`.
    Known {},
    /// It is sought on the whole sphere with coarse linear grids, and learnt from there.
    Scan(AxisScan),
    /// It is learnt from this start.
    From {
        /// Initial axis, a vector of any length.
        start: [f64; 3],
        /// First learning rate of the axis, radians a step.
        #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
        rate: f64,
        /// Last learning rate, reached linearly.
        #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
        last_rate: f64,
    },
}

/// A search of the whole sphere of axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AxisScan {
    /// Directions that are tried.
    #[schemars(range(min = 12, max = 100_000), extend("unit" = "directions"))]
    pub directions: usize,
    /// Frames of the data that are used.
    #[schemars(range(min = 2), extend("unit" = "frames"))]
    pub frames: usize,
    /// Pixels along each side; all of them if more than half.
    #[schemars(range(min = 8), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Nodes along each axis of a second search near the best axis, with all pixels; 32 is a good value for
    /// visibilities.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 8, max = 128), extend("unit" = "nodes along each axis"))]
    pub refine: Option<usize>,
    /// First learning rate of the axis, radians a step; 0 keeps the axis found.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
}

fn rounds() -> usize {
    4
}

fn iterations() -> usize {
    200
}

impl Default for Training {
    fn default() -> Self {
        Self {
            optimiser: Optimiser::Adam,
            steps: 400,
            ramp: 30,
            batch: BatchSize::Frames(8),
            start: Start::Drawn,
            occupancy: None,
            log_every: 25,
            checkpoint_seconds: 60.0,
        }
    }
}

impl Default for AxisSearch {
    fn default() -> Self {
        Self::Known {}
    }
}

impl Default for AxisScan {
    fn default() -> Self {
        Self { directions: 200, frames: 16, pixels: 22, refine: None, rate: 1e-3, last_rate: 1e-5 }
    }
}

/// Rules of steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Optimiser {
    /// Steps along the mean gradient of random parts of the data.
    #[default]
    Adam,
    /// The same for all but the weight matrices of `bhnerf` and `mlp4d`, which step along orthogonal matrices.
    Muon,
}
