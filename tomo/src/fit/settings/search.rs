//! Search for a geometry that is not known.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Search for parameters that have a prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GeometrySearch {
    /// Searches that start from places all over the priors.
    #[schemars(range(min = 1, max = 1000), extend("unit" = "searches"))]
    pub starts: usize,
    /// The searches from all starts.
    pub coarse: SearchView,
    /// The last search, around the best of their ends. Where χ² is smooth, these are steps from all ends, and the
    /// resolution grows from this one as the data ask for.
    pub fine: SearchView,
}

impl Default for GeometrySearch {
    fn default() -> Self {
        let coarse = SearchView { trials: 100, nodes: 16, iterations: 30, pixels: 20, frames: 16 };
        let fine = SearchView { trials: 60, nodes: 36, iterations: 80, pixels: 40, frames: 20 };
        Self { starts: 8, coarse, fine }
    }
}

/// Evaluation of geometries.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchView {
    /// Trials per search, at most.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "trials"))]
    pub trials: usize,
    /// Voxels along each axis.
    #[schemars(range(min = 2, max = 128), extend("unit" = "voxels along each axis"))]
    pub nodes: usize,
    /// Iterations for the volume of each trial.
    #[schemars(range(min = 1, max = 10_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Pixels along each side; all of them if more than half. For visibilities `fine` takes any number above half.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Approximate number of frames used.
    #[schemars(range(min = 2, max = 1_000_000), extend("unit" = "frames"))]
    pub frames: usize,
}
