//! How a geometry that is not known is searched for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How parameters that have a prior are searched for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GeometrySearch {
    /// Searches that start from places all over the priors.
    #[schemars(range(min = 1, max = 1000), extend("unit" = "searches"))]
    pub starts: usize,
    /// The searches from all starts.
    pub coarse: SearchView,
    /// The last search, around the best of their ends.
    pub fine: SearchView,
    /// The steps from the best geometry of `fine`; as `fine` without it. Needs `screen.ring_rays` or images, and
    /// data in which the volume is a convex problem.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finest: Option<SearchSteps>,
}

impl Default for GeometrySearch {
    fn default() -> Self {
        let coarse = SearchView { trials: 400, nodes: 16, iterations: 30, pixels: 20, frames: 16 };
        let fine = SearchView { trials: 60, nodes: 36, iterations: 80, pixels: 40, frames: 20 };
        Self { starts: 8, coarse, fine, finest: None }
    }
}

/// How geometries are evaluated.
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
    /// Pixels along each side; all of them if more than half. For visibilities `fine` takes any number above half,
    /// `finest` any number.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Approximate number of frames used.
    #[schemars(range(min = 2, max = 1_000_000), extend("unit" = "frames"))]
    pub frames: usize,
}

/// How geometries are evaluated where there is no population of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchSteps {
    /// Voxels along each axis.
    #[schemars(range(min = 2, max = 128), extend("unit" = "voxels along each axis"))]
    pub nodes: usize,
    /// Iterations for each volume.
    #[schemars(range(min = 1, max = 10_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Pixels along each side.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Approximate number of frames used.
    #[schemars(range(min = 2, max = 1_000_000), extend("unit" = "frames"))]
    pub frames: usize,
}

impl GeometrySearch {
    /// What the last steps look at, if it is finer than what the search before them does. They count no geometries: the number
    /// is that of this search.
    pub(crate) fn finest(&self) -> Option<SearchView> {
        let SearchView { trials, .. } = self.fine;
        let view = |SearchSteps { nodes, iterations, pixels, frames }| SearchView {
            trials,
            nodes,
            iterations,
            pixels,
            frames,
        };
        self.finest.map(view)
    }
}
