//! How a geometry that is not known is searched for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How parameters that have a prior are searched for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WorldSearch {
    /// Searches that start from places all over the priors.
    #[schemars(range(min = 1, max = 1000), extend("unit" = "searches"))]
    pub starts: usize,
    /// The searches from all starts.
    pub coarse: WorldView,
    /// The last search, around the best of their ends.
    pub fine: WorldView,
    /// The steps from the best geometry of `fine`; as `fine` without it. Needs `screen.ring_rays` or images, and
    /// data in which the volume is a convex problem.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finest: Option<WorldSteps>,
}

impl Default for WorldSearch {
    fn default() -> Self {
        let coarse = WorldView { worlds: 400, nodes: 16, iterations: 30, pixels: 20, frames: 16 };
        let fine = WorldView { worlds: 60, nodes: 36, iterations: 80, pixels: 40, frames: 20 };
        Self { starts: 8, coarse, fine, finest: None }
    }
}

/// How worlds are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldView {
    /// Trials per search, at most.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "worlds"))]
    pub worlds: usize,
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

/// How worlds are evaluated where there is no population of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldSteps {
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

impl WorldSearch {
    /// What the last steps look at, if it is finer than what the search before them does. They count no worlds: the number
    /// is that of this search.
    pub(crate) fn finest(&self) -> Option<WorldView> {
        let WorldView { worlds, .. } = self.fine;
        let view = |WorldSteps { nodes, iterations, pixels, frames }| WorldView {
            worlds,
            nodes,
            iterations,
            pixels,
            frames,
        };
        self.finest.map(view)
    }
}
