//! Pictures in memory, at several times of observation.

use super::bands::{Band, render_bands};
use super::grid::Grid;
use super::tally::{Summary, Tally};
use super::{Progress, Raster, Rendered, resolver};
use crate::Error;
use crate::image::{Channel, Picture};
use crate::scene::Scene;
use std::sync::{Mutex, PoisonError};

/// One picture of a film, in its raster's unit of intensity.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Row by row, of each channel.
    channels: Vec<Vec<f32>>,
    tally: Tally,
    /// Time of observation, in M.
    pub(super) time: f64,
}

impl Frame {
    /// Rays that were given up.
    pub fn unresolved(&self) -> u64 {
        self.tally.unresolved
    }

    /// Joins bands in their order.
    fn of(bands: Vec<Band>, channels: usize, pixels: usize, time: f64) -> Self {
        let tally = bands.iter().map(|band| band.tally).fold(Tally::default(), Tally::plus);
        let mut values = vec![Vec::with_capacity(pixels); channels];
        for band in bands {
            for (all, some) in values.iter_mut().zip(band.channels) {
                all.extend(some);
            }
        }
        Frame { channels: values, tally, time }
    }
}

impl Raster {
    /// The pictures at `times` of observation (in M), with rays that are traced once for all.
    /// Where pixels are refined there is one time, the prepared scene's.
    pub(crate) fn raw(&self, times: &[f64], progress: &Progress<'_>) -> Result<Vec<Frame>, Error> {
        let all: Vec<usize> = (0..self.bands()).collect();
        // Bands come in any order.
        let done = Mutex::new(vec![vec![None; all.len()]; times.len()]);
        let keep = |bands: Vec<Band>| {
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            for (picture, band) in done.iter_mut().zip(bands) {
                let index = band.index;
                picture[index] = Some(band);
            }
            Ok(())
        };
        render_bands(self, times, &mut all.iter().copied(), &keep, progress)?;
        let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        let pixels = self.grid.width * self.grid.height;
        let picture = |(bands, time): (Vec<Option<Band>>, &f64)| {
            Frame::of(bands.into_iter().flatten().collect(), self.channels.len(), pixels, *time)
        };
        Ok(done.into_iter().zip(times).map(picture).collect())
    }

    /// Factor from the scene's unit of intensity to that of the file, such that the frame has the
    /// scene's flux.
    ///
    /// # Errors
    /// If the frame has no light to be scaled.
    pub fn unit_factor(&self, frame: &Frame) -> Result<f64, Error> {
        Summary::factor(&self.scene_at(frame.time), &frame.tally)
    }

    /// The frame as [`render`](crate::picture::render) would give it, but with its intensity times
    /// `factor`: all frames of a film share one.
    ///
    /// # Errors
    /// If a value is too large for 32 bits then.
    pub fn rendered(&self, mut frame: Frame, factor: f64) -> Result<Rendered, Error> {
        let summary = Summary::new(&self.scene_at(frame.time), &frame.tally, factor)?;
        self.rescale(&mut frame.channels, factor);
        let named = self.channels.iter().zip(frame.channels);
        let channels =
            named.map(|(kind, values)| Channel { name: kind.name.to_owned(), values }).collect();
        let (width, height) = (self.grid.width, self.grid.height);
        Ok(Rendered { picture: Picture { width, height, channels }, summary })
    }

    pub(super) fn scene_at(&self, time: f64) -> Scene {
        let mut scene = self.scene.clone();
        scene.observer.time = time;
        scene
    }

    /// Moves to another time of observation, and with it a camera that moves.
    ///
    /// # Errors
    /// If the camera is impossible there.
    pub(super) fn move_to(&mut self, time: f64) -> Result<(), Error> {
        self.scene.observer.time = time;
        self.prepared.move_to(&self.scene)?;
        self.rings = resolver(&self.scene, &self.prepared);
        self.grid = Grid::new(&self.scene);
        Ok(())
    }
}
