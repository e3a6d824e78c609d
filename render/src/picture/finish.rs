//! Last pass: from bands to files.

use super::bands::{Band, render_bands};
use super::journal::AnyJournal;
use super::tally::Summary;
use super::{Progress, Raster};
use crate::Error;
use crate::image::exr::{Attributes, Layout, Style};
use crate::image::reduce::Reduction;
use exr::error::Result;
use rayon::prelude::*;
use std::io::{Seek, Write};
use std::sync::{Mutex, PoisonError};

/// Pixels that are in memory at once while a file is written.
const WINDOW: usize = 1 << 20;

impl Raster {
    /// Renders what is missing in `journal` into it.
    ///
    /// # Errors
    /// If a value is out of range or does not fit, the journal cannot be written, or
    /// `progress` returned false ([`RenderError::Stopped`](crate::picture::RenderError::Stopped)). What is in the journal stays.
    pub fn fill(
        &self,
        journal: &mut AnyJournal<'_>,
        progress: &Progress<'_>,
    ) -> std::result::Result<(), Error> {
        let todo = journal.missing();
        let journal = Mutex::new(journal);
        let keep = |bands: Vec<Band>| {
            bands.iter().try_for_each(|band| {
                // Compressed before the lock is taken: threads wait for each other only to write.
                let bytes = self.layout.compress(band.index, &band.channels)?.concat();
                let mut journal = journal.lock().unwrap_or_else(PoisonError::into_inner);
                journal.append(band.index, band.tally, &bytes).map_err(exr::error::Error::from)?;
                Ok(())
            })
        };
        render_bands(self, &[self.prepared.time()], &mut todo.into_iter(), &keep, progress)
    }

    /// Summary of the whole picture.
    ///
    /// # Errors
    /// If a flux is requested and there is no light, or a value does not fit after scaling.
    pub fn summary(&self, journal: &AnyJournal<'_>) -> std::result::Result<Summary, Error> {
        let tally = journal.tally();
        Summary::new(&self.scene, &tally, Summary::factor(&self.scene, &tally)?)
    }

    /// Writes the EXR file with settings, in some style.
    ///
    /// # Errors
    /// If the journal is not complete, or on a failure to read or write.
    pub fn write_exr(
        &self,
        journal: &mut AnyJournal<'_>,
        summary: &Summary,
        attributes: &Attributes,
        style: Style,
        out: impl Write + Seek,
        reduction: Option<&mut Reduction>,
    ) -> Result<()> {
        let layout = Layout::new(self.grid.width, self.grid.height, &self.names(), style)?;
        layout.write(out, attributes, |write| {
            self.for_each_band(journal, summary, Some(&layout), reduction, write)
        })
    }

    /// Reduces the picture without writing an EXR file.
    ///
    /// # Errors
    /// If the journal is not complete, or on a failure to read.
    pub fn reduce(
        &self,
        journal: &mut AnyJournal<'_>,
        summary: &Summary,
        reduction: &mut Reduction,
    ) -> Result<()> {
        self.for_each_band(journal, summary, None, Some(reduction), &mut |_, _| Ok(()))
    }

    /// Hands on the compressed bytes of each band in the file's units and layout, from the top, and its
    /// values to the reduction. Several bands are taken apart in parallel.
    fn for_each_band(
        &self,
        journal: &mut AnyJournal<'_>,
        summary: &Summary,
        layout: Option<&Layout>,
        mut reduction: Option<&mut Reduction>,
        each: &mut dyn FnMut(usize, Vec<Vec<u8>>) -> Result<()>,
    ) -> Result<()> {
        let rescale = summary.unit_factor != self.unit;
        let restyle = layout.filter(|layout| rescale || !layout.is_plain());
        let values = reduction.is_some() || rescale || restyle.is_some();
        let bands: Vec<usize> = (0..self.layout.bands()).collect();
        let height = self.layout.rows(0).len();
        for some in bands.chunks((WINDOW / (self.grid.width * height)).max(1)) {
            let read: Vec<Vec<u8>> =
                some.iter().map(|band| Ok(journal.read(*band)?)).collect::<Result<_>>()?;
            let done = read.into_par_iter().zip(some).map(|(bytes, band)| {
                if !values {
                    return Ok((vec![bytes], Vec::new()));
                }
                let mut channels = self.layout.expand(*band, bytes.clone())?;
                self.rescale(&mut channels, summary.unit_factor);
                let bytes = match restyle {
                    Some(layout) => layout.compress(*band, &channels)?,
                    None => vec![bytes],
                };
                Ok((bytes, channels))
            });
            for ((bytes, channels), band) in done.collect::<Result<Vec<_>>>()?.into_iter().zip(some)
            {
                each(*band, bytes)?;
                if let Some(reduction) = &mut reduction {
                    reduction.add(&channels);
                }
            }
        }
        Ok(())
    }

    /// Converts from the raster's unit of intensity to that of the file, which is `factor` times the scene's.
    pub(super) fn rescale(&self, channels: &mut [Vec<f32>], factor: f64) {
        let factor = factor / self.unit;
        if factor == 1.0 {
            return;
        }
        for (kind, values) in self.channels.iter().zip(channels) {
            if kind.scales() {
                values.iter_mut().for_each(|value| *value = (f64::from(*value) * factor) as f32);
            }
        }
    }
}
