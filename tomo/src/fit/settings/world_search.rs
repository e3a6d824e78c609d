//! How a world that is not known is looked for.

use super::FitError;
use crate::Error;
use serde::{Deserialize, Serialize};

/// How the world is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldSearch {
    /// Places to begin, all over the priors.
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldView {
    /// Worlds, at most.
    pub worlds: usize,
    /// Voxels along each axis of the volume that is solved for.
    pub nodes: usize,
    /// Iterations of each solution over all voxels; the fine search adds up to six times as many over those that shine.
    pub iterations: usize,
    /// Pixels along each side, about.
    pub pixels: usize,
    /// Frames, about.
    pub frames: usize,
}

/// How worlds are evaluated where there is no population of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldSteps {
    /// Voxels along each axis of the volume that is solved for.
    pub nodes: usize,
    /// Iterations of each solution over all voxels; up to six times as many follow over those that shine.
    pub iterations: usize,
    /// Pixels along each side, about.
    pub pixels: usize,
    /// Frames, about.
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

    /// Refuses numbers out of their ranges.
    ///
    /// # Errors
    /// The first one.
    pub(super) fn check(&self) -> Result<(), Error> {
        let within = |key: &str, value: usize, [low, high]: [usize; 2]| {
            let allowed = format!("{low} to {high}");
            let key = format!("world.search.{key}");
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(Error::from(FitError::range(key, value, &allowed)))
            }
        };
        within("starts", self.starts, [1, 1000])?;
        let finest = self.finest().map(|view| ("finest", view));
        for (name, view) in [("coarse", self.coarse), ("fine", self.fine)].into_iter().chain(finest)
        {
            within(&format!("{name}.worlds"), view.worlds, [1, 1_000_000])?;
            within(&format!("{name}.nodes"), view.nodes, [2, 128])?;
            within(&format!("{name}.iterations"), view.iterations, [1, 10_000])?;
            within(&format!("{name}.pixels"), view.pixels, [2, 4096])?;
            within(&format!("{name}.frames"), view.frames, [2, 1_000_000])?;
        }
        Ok(())
    }
}
