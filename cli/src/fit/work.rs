//! Kinds of fits that a file asks for: emission around a hole, or a static image.

use super::init;
use super::posterior;
use super::run;
use super::static_image;
use crate::changed::Changed;
use crate::devices::FitDevice;
use anyhow::{Context, bail};
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::recovery::Problem;
use kerrlight_tomo::representation::Registry;
use std::path::Path;

/// Settings of either.
#[derive(Debug, PartialEq)]
pub enum Work {
    /// Emission around a hole.
    Emission(Box<FitFile>),
    /// A static image.
    Image(Box<StaticImageFile>),
}

/// The same with its data, and all that can be found wrong found.
pub enum Prepared {
    /// Emission around a hole.
    Emission(Box<Problem>),
    /// A static image.
    Image(Box<static_image::Prepared>),
}

impl Prepared {
    /// Refuses a device that does not do this fit, before anything is written.
    pub fn check_device(&self, device: Option<&FitDevice>) -> anyhow::Result<()> {
        let Some((check, _)) = device else { return Ok(()) };
        match self {
            Prepared::Image(_) => {
                bail!("--device: a static image is fitted on the processor; leave it out")
            }
            Prepared::Emission(prepared) => run::check_device(prepared, *check).context("--device"),
        }
    }
}

impl Work {
    /// The settings in a text: a table `image` makes them those of a static image.
    pub fn read(text: &str) -> anyhow::Result<Self> {
        Self::parse(text).map_err(init::explained)
    }

    /// The same with changes.
    pub fn read_changed(changed: &Changed<'_>) -> anyhow::Result<Self> {
        changed.read(Self::parse, init::explained)
    }

    fn parse(text: &str) -> Result<Self, Error> {
        Ok(match StaticImageFile::is_static_image(text) {
            true => Work::Image(Box::new(StaticImageFile::parse(text)?)),
            false => Work::Emission(Box::new(FitFile::parse(text)?)),
        })
    }

    /// Reads its data, whose relative paths start from `base_dir`.
    pub fn prepared(self, base_dir: &Path, registry: &Registry) -> anyhow::Result<Prepared> {
        Ok(match self {
            Work::Emission(file) => {
                Prepared::Emission(Box::new(run::problem(*file, base_dir, registry)?))
            }
            Work::Image(file) => {
                Prepared::Image(Box::new(static_image::Prepared::new(*file, base_dir)?))
            }
        })
    }

    /// Refuses draws from a posterior where there is none.
    pub fn check_draws(&self) -> anyhow::Result<()> {
        match self {
            Work::Emission(file) => posterior::check(file),
            Work::Image(_) => {
                bail!("--samples is for emission: image.draws has those of a static image")
            }
        }
    }
}
