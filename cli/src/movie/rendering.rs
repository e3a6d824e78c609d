//! The frames that are missing, batch by batch.

use super::frames::Sequence;
use crate::interrupt::{Interrupted, SignalGuard};
use crate::progress;
use indicatif::ProgressBar;
use kerrlight_geodesic::RayDevice;
use kerrlight_render::Error;
use kerrlight_render::picture::{Frame, Raster, RenderError};
use std::path::Path;
use std::time::Instant;

/// A film under way.
pub struct Rendering<'a> {
    film: &'a mut Raster,
    sequence: &'a mut Sequence,
    folder: &'a Path,
    bar: ProgressBar,
}

impl<'a> Rendering<'a> {
    /// Takes the frames in `folder`.
    pub fn new(film: &'a mut Raster, sequence: &'a mut Sequence, folder: &'a Path) -> Self {
        let batches = sequence.missing().len().div_ceil(film.batch());
        let bar = progress::bar((batches * sequence.height()) as u64);
        Self { film, sequence, folder, bar }
    }

    /// Renders what is missing and counts it.
    pub fn run(mut self) -> anyhow::Result<usize> {
        let (missing, start) = (self.sequence.missing(), Instant::now());
        if self.sequence.lacks_scale() {
            let keeper = SignalGuard::brief(self.there());
            let first = self.frames(&[self.sequence.time(0)], &keeper)?;
            first.iter().try_for_each(|first| self.sequence.scale_like(self.film, first))?;
        }
        let most = self.film.batch();
        missing.chunks(most).try_for_each(|batch| self.batch(batch))?;
        self.bar.finish_and_clear();
        let (count, seconds) = (missing.len(), start.elapsed().as_secs_f64());
        let there = self.sequence.wanted().len() - count;
        eprintln!("{count} frames rendered in {seconds:.2} s, {there} were there");
        let unresolved = self.sequence.unresolved(&missing);
        if unresolved > 0 {
            eprintln!("warning: {unresolved} rays unresolved, shown as dark");
        }
        Ok(count)
    }

    fn batch(&mut self, batch: &[usize]) -> anyhow::Result<()> {
        // A guard for each batch: its words count the frames that are there by now.
        let keeper = SignalGuard::brief(self.there());
        let times: Vec<f64> = batch.iter().map(|k| self.sequence.time(*k)).collect();
        let frames = self.frames(&times, &keeper)?;
        self.sequence.write(self.film, batch, frames)
    }

    fn frames(&mut self, times: &[f64], keeper: &SignalGuard) -> anyhow::Result<Vec<Frame>> {
        let bar = &self.bar;
        let frames = self.film.frames(times, &|rows| {
            bar.inc(rows as u64);
            !keeper.stopped()
        });
        match frames {
            Err(Error::Render(RenderError::Stopped)) => {
                self.bar.finish_and_clear();
                Err(Interrupted(self.there()).into())
            }
            Err(error) => {
                let failure = self.film.device().and_then(RayDevice::failure);
                let told = failure.map(|failure| {
                    format!("{failure}; {}, or with --device cpu into another folder", self.there())
                });
                Err(told.map_or(error.into(), anyhow::Error::msg))
            }
            Ok(frames) => Ok(frames),
        }
    }

    /// Describes the progress, and how to resume.
    fn there(&self) -> String {
        let all = self.sequence.wanted().len();
        let done = all - self.sequence.missing().len();
        let folder = self.folder.display();
        format!(
            "stopped: {done} of {all} frames are in {folder}; run the same command again to resume"
        )
    }
}
