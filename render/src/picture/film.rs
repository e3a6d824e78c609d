//! Many pictures of one scene: a film. Under a fixed camera each ray is traced once for a whole
//! batch of frames.

use super::raw::Frame;
use super::{Progress, Raster, TILE};
use crate::Error;

/// A batch has at most this many values: 1 GiB.
const MOST_VALUES: usize = 1 << 28;

/// A batch has at most this many frames: then tracing costs little more than if it were done once
/// for all frames, and little is lost where a film is stopped.
const MOST_FRAMES: usize = 32;

impl Raster {
    /// Frames that are rendered together: one if rays differ from frame to frame, else as many as
    /// a GiB holds, at most 32.
    pub fn batch(&self) -> usize {
        if self.one_by_one() {
            return 1;
        }
        let pixels = self.grid.width * self.grid.height;
        (MOST_VALUES / (pixels * self.channels.len().max(1))).clamp(1, MOST_FRAMES)
    }

    /// Returns whether rays have to be traced anew for every frame: the camera moves, or pixels are
    /// refined where the light is.
    fn one_by_one(&self) -> bool {
        self.camera_moves() || self.scene.screen.image_error.is_some()
    }

    fn camera_moves(&self) -> bool {
        self.scene.camera.as_ref().is_some_and(|camera| !camera.key.is_empty())
    }

    /// Returns whether anything in the scene changes with time.
    pub fn changes(&self) -> bool {
        self.camera_moves() || self.scene.changes()
    }

    /// The pictures at `times` (of observation, in M); where rays differ from frame to frame they are
    /// traced one after the other.
    ///
    /// # Errors
    /// If a value is out of range or too large for 32 bits, or `progress`, which is told of rows,
    /// returned false.
    pub fn frames(&mut self, times: &[f64], progress: &Progress<'_>) -> Result<Vec<Frame>, Error> {
        // A block has a pixel of every frame for each of its rays: wide tiles would take too much memory.
        self.tile = self.tile.min(TILE);
        if !self.one_by_one() {
            return self.raw(times, progress);
        }
        let mut frames = Vec::with_capacity(times.len());
        for time in times {
            self.move_to(*time)?;
            frames.append(&mut self.raw(&[*time], progress)?);
        }
        Ok(frames)
    }
}
