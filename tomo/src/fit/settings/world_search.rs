//! How a world that is not known is looked for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the world is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldSearch {
    /// Places to begin, all over the priors.
    #[schemars(range(min = 1, max = 1000), extend("unit" = "searches"))]
    pub starts: usize,
    /// The search from each of them.
    pub coarse: WorldView,
    /// The search about the best of their ends.
    pub fine: WorldView,
    /// What the last steps look at, from the world that the fine search has found; none if there are no finer ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finest: Option<WorldSteps>,
    /// Whether the drag of a Keplerian velocity and of `infall` is the spin of each world along the axis.
    pub drag_is_spin: bool,
}

/// How worlds are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldView {
    /// Worlds, at most.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "worlds"))]
    pub worlds: usize,
    /// Voxels along each axis of the volume that is solved for.
    #[schemars(range(min = 2, max = 128), extend("unit" = "voxels along each axis"))]
    pub nodes: usize,
    /// Iterations of each solution over all voxels; the fine search adds up to six times as many over those that shine.
    #[schemars(range(min = 1, max = 10_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Pixels along each side, about.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Frames, about.
    #[schemars(range(min = 2, max = 1_000_000), extend("unit" = "frames"))]
    pub frames: usize,
}

/// How worlds are evaluated where there is no population of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldSteps {
    /// Voxels along each axis of the volume that is solved for.
    #[schemars(range(min = 2, max = 128), extend("unit" = "voxels along each axis"))]
    pub nodes: usize,
    /// Iterations of each solution over all voxels; up to six times as many follow over those that shine.
    #[schemars(range(min = 1, max = 10_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Pixels along each side, about.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Frames, about.
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
