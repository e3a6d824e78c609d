//! Rendering, with a journal beside the EXR or without one.

use super::exr_options::ExrOptions;
use super::partial::Partial;
use super::report;
use crate::interrupt::{Interrupted, SignalGuard};
use crate::output::Output;
use crate::progress;
use anyhow::Context;
use kerrlight_render::Error;
use kerrlight_render::image::Picture;
use kerrlight_render::image::reduce::Reduction;
use kerrlight_render::picture::{AnyJournal, Journal, Raster, RenderError, Summary};
use kerrlight_render::scene::Scene;
use std::io::Cursor;

/// Picture to render.
pub struct Work<'a> {
    pub raster: &'a Raster,
    pub scene: &'a Scene,
    /// The scene as it was given.
    pub text: &'a str,
    /// Name of the scene in messages.
    pub name: &'a str,
    /// Identity of the files that the scene names.
    pub files: &'a str,
    /// Options of the EXR file.
    pub style: &'a ExrOptions,
}

impl Work<'_> {
    /// Renders into an EXR file; an interrupted run is resumed.
    pub fn exr(
        &self,
        exr: &Output,
        identity: &str,
        mut look: Option<Reduction>,
    ) -> anyhow::Result<(Summary, Option<Picture>)> {
        let mut partial = Partial::open(exr, self.raster, identity)?;
        let stopped = format!("stopped; {}", partial.kept());
        let summary = match self.fill(&mut partial.journal, &stopped) {
            Ok(summary) => summary,
            Err(error) => return Err(self.failed(error, partial)),
        };
        let attributes =
            report::attributes(self.scene, self.text, self.files, self.raster, &summary);
        exr.write_with(|file| {
            let journal = &mut partial.journal;
            let look = look.as_mut();
            let style = self.style.style(self.raster.camera());
            Ok(self.raster.write_exr(journal, &summary, &attributes, style, file, look)?)
        })
        .with_context(|| partial.kept())?;
        partial.remove();
        Ok((summary, look.map(Reduction::picture)))
    }

    /// Renders what a preview needs.
    pub fn preview(&self, look: Option<Reduction>) -> anyhow::Result<(Summary, Option<Picture>)> {
        // Without an EXR there is no place to resume from: the journal is in memory.
        let memory = Cursor::new(Vec::new());
        let (mut journal, _) = Journal::open(memory, "", self.raster.bands())?;
        let summary = self.fill(&mut journal, STOPPED).map_err(|error| match error {
            Error::Render(RenderError::Stopped) => Interrupted(STOPPED.to_owned()).into(),
            _ if self.device_failure().is_some() => self.told("nothing is kept"),
            other => anyhow::Error::new(other).context(self.name.to_owned()),
        })?;
        let Some(mut look) = look else { return Ok((summary, None)) };
        self.raster.reduce(&mut journal, &summary, &mut look)?;
        Ok((summary, Some(look.picture())))
    }

    /// Renders all bands that are missing; a signal ends that with `stopped`.
    fn fill(&self, journal: &mut AnyJournal<'_>, stopped: &str) -> Result<Summary, Error> {
        let all = self.raster.bands();
        let bar = progress::bar(all as u64);
        bar.set_position((all - journal.missing().len()) as u64);
        let keeper = SignalGuard::brief(stopped);
        let done = self.raster.fill(journal, &|_| {
            bar.inc(1);
            !keeper.stopped()
        });
        bar.finish_and_clear();
        done?;
        self.raster.summary(journal)
    }

    /// Returns the failure of the graphics device, if there was one.
    fn device_failure(&self) -> Option<String> {
        self.raster.device()?.failure()
    }

    /// The failure of the device, and what is left.
    fn told(&self, left: &str) -> anyhow::Error {
        anyhow::anyhow!("{}; {left}", self.device_failure().unwrap_or_default())
    }

    /// Returns the error of a picture that has not been finished.
    fn failed(&self, error: Error, partial: Partial) -> anyhow::Error {
        match error {
            Error::Render(RenderError::Stopped) => {
                Interrupted(format!("stopped; {}", partial.kept())).into()
            }
            Error::Exr(error) => {
                anyhow::anyhow!("cannot write {}: {error}; {}", partial.shown(), partial.kept())
            }
            _ if self.device_failure().is_some() => {
                self.told(&format!("{}, or with --device cpu to start over", partial.kept()))
            }
            // The scene is at fault: the same picture will never be.
            other => {
                partial.remove();
                anyhow::Error::new(other).context(self.name.to_owned())
            }
        }
    }
}

const STOPPED: &str = "stopped; nothing is kept";
