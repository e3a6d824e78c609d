//! Pictures in memory, at several times of observation.

use super::bands::{Band, render_bands};
use super::grid::Grid;
use super::tally::{Summary, Tally};
use super::{Progress, Raster, RenderError, Rendered, resolver};
use crate::Error;
use crate::image::{Channel, Picture};
use crate::scene::Scene;
use std::sync::{Mutex, PoisonError};

/// A picture in its raster's unit of intensity.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Raw {
    /// Row by row, of each channel.
    channels: Vec<Vec<f32>>,
    pub(super) tally: Tally,
}

impl Raw {
    /// Rays that were given up.
    pub fn unresolved(&self) -> u64 {
        self.tally.unresolved
    }

    /// Joins bands in their order.
    fn of(bands: Vec<Band>, channels: usize, pixels: usize) -> Self {
        let tally = bands.iter().map(|band| band.tally).fold(Tally::default(), Tally::plus);
        let mut values = vec![Vec::with_capacity(pixels); channels];
        for band in bands {
            for (all, some) in values.iter_mut().zip(band.channels) {
                all.extend(some);
            }
        }
        Raw { channels: values, tally }
    }
}

impl Raster {
    /// The pictures at `times` of observation (in M), with rays that are traced once for all.
    /// Where pixels are refined there is one time, the prepared scene's.
    pub(crate) fn raw(&self, times: &[f64], progress: &Progress<'_>) -> Result<Vec<Raw>, Error> {
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
        let picture = |bands: Vec<Option<Band>>| {
            Raw::of(bands.into_iter().flatten().collect(), self.channels.len(), pixels)
        };
        Ok(done.into_iter().map(picture).collect())
    }

    /// The factor that gives a picture of `scene` the unit, and the flux, that the scene asks for.
    ///
    /// # Errors
    /// If a flux is requested and there is no light.
    pub(crate) fn unit_factor(&self, scene: &Scene, raw: &Raw) -> Result<f64, Error> {
        Ok(Summary::factor(scene, &raw.tally).map_err(RenderError::NoFlux)?)
    }

    /// A picture of `scene` with its intensity times `factor`.
    ///
    /// # Errors
    /// If a value does not fit then.
    pub(crate) fn rendered(
        &self,
        scene: &Scene,
        mut raw: Raw,
        factor: f64,
    ) -> Result<Rendered, Error> {
        let summary = Summary::new(scene, &raw.tally, factor)?;
        self.rescale(&mut raw.channels, factor);
        let named = self.channels.iter().zip(raw.channels);
        let channels =
            named.map(|(kind, values)| Channel { name: kind.name.to_owned(), values }).collect();
        let (width, height) = (self.grid.width, self.grid.height);
        Ok(Rendered { picture: Picture { width, height, channels }, summary })
    }

    /// Moves to another time of observation, and with it a camera that moves.
    ///
    /// # Errors
    /// If the camera is impossible there.
    pub(crate) fn move_to(&mut self, time: f64) -> Result<(), Error> {
        self.scene.observer.time = time;
        self.prepared.move_to(&self.scene)?;
        self.rings = resolver(&self.scene, &self.prepared);
        self.grid = Grid::new(&self.scene);
        Ok(())
    }

    /// Returns the rendered scene.
    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }
}
