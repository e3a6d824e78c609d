//! Many pictures of one scene: a film. Under a fixed camera each ray is traced once for a whole
//! batch of frames.

use super::raw::Frame;
use super::{Progress, Raster, Rendered, TILE};
use crate::Error;
use crate::image::exr::CameraMatrices;
use crate::scene::Scene;
use crate::transport::Assets;
use kerrlight_geodesic::RayDevice;
use std::sync::Arc;

/// A film of a scene.
#[derive(Debug)]
pub struct Film {
    raster: Raster,
}

/// A batch has at most this many values: 1 GiB.
const MOST_VALUES: usize = 1 << 28;

/// A batch has at most this many frames: then tracing costs little more than if it were done once
/// for all frames, and little is lost where a film is stopped.
const MOST_FRAMES: usize = 32;

impl Film {
    /// A film of `scene` with the decoded files that it names.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn new(scene: &Scene, assets: impl Into<Assets>) -> Result<Self, Error> {
        Ok(Film { raster: Raster::new(scene, assets)? })
    }

    /// Frames that are rendered together: one if rays differ from frame to frame, else as many as
    /// a GiB holds, at most 32.
    pub fn batch(&self) -> usize {
        if self.one_by_one() {
            return 1;
        }
        let screen = &self.raster.scene().screen;
        let pixels = screen.width as usize * screen.rows() as usize;
        (MOST_VALUES / (pixels * self.raster.names().len().max(1))).clamp(1, MOST_FRAMES)
    }

    /// Returns whether rays have to be traced anew for every frame: the camera moves, or pixels are
    /// refined where the light is.
    fn one_by_one(&self) -> bool {
        self.camera_moves() || self.raster.scene().screen.image_error.is_some()
    }

    fn camera_moves(&self) -> bool {
        self.raster.scene().camera.as_ref().is_some_and(|camera| !camera.key.is_empty())
    }

    /// Returns whether anything in the scene changes with time.
    pub fn changes(&self) -> bool {
        self.camera_moves() || self.raster.scene().changes()
    }

    /// The same with rays traced on a device: see [`Raster::with_device`].
    pub fn with_device(self, device: Arc<dyn RayDevice>) -> Self {
        // A block has a pixel of every frame for each of its rays: wide tiles would take too much memory.
        Film { raster: self.raster.with_device(device).with_tile(TILE) }
    }

    /// Raster of its pictures, with their channels and the device on which rays are traced.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Returns the camera of a frame: see [`Raster::camera`].
    ///
    /// # Errors
    /// If the camera is impossible there.
    pub fn camera(&self, frame: &Frame) -> Result<CameraMatrices, Error> {
        self.raster.camera_at(frame.time)
    }

    /// Factor from the scene's unit of intensity to that of the file, such that the frame has the
    /// scene's flux.
    ///
    /// # Errors
    /// If the frame has no light to be scaled.
    pub fn unit_factor(&self, frame: &Frame) -> Result<f64, Error> {
        self.raster.unit_factor(frame)
    }

    /// The frame as [`render`](crate::picture::render) would give it, but with its intensity times
    /// `factor`: all frames of a film share one.
    ///
    /// # Errors
    /// If a value is too large for 32 bits then.
    pub fn rendered(&self, frame: Frame, factor: f64) -> Result<Rendered, Error> {
        self.raster.rendered(frame, factor)
    }

    /// The pictures at `times` (of observation, in M); where rays differ from frame to frame they are
    /// traced one after the other.
    ///
    /// # Errors
    /// If a value is out of range or too large for 32 bits, or `progress`, which is told of rows,
    /// returned false.
    pub fn frames(&mut self, times: &[f64], progress: &Progress<'_>) -> Result<Vec<Frame>, Error> {
        if !self.one_by_one() {
            return self.raster.raw(times, progress);
        }
        let mut frames = Vec::with_capacity(times.len());
        for time in times {
            self.raster.move_to(*time)?;
            frames.append(&mut self.raster.raw(&[*time], progress)?);
        }
        Ok(frames)
    }
}
