//! What the verbs of interferometry share: arguments, files of visibilities, plots, images.

pub mod arguments;
pub mod image_files;
pub mod movie_files;
pub mod plots;
pub mod scene_movie;

use crate::output::{self, Output};
use anyhow::{Context, bail};
use kerrlight_tomo::interferometry::files::{self, Format};
use kerrlight_tomo::interferometry::observation::Observation;
use std::path::Path;

/// Reads visibilities in any format.
pub fn read(path: &Path) -> anyhow::Result<(Format, Observation)> {
    files::decode(&output::read(path)?).with_context(|| path.display().to_string())
}

/// A file of visibilities to be written, its format by the ending of its name.
pub struct ObservationFile {
    output: Output,
    format: Format,
}

impl ObservationFile {
    /// Checks the place before any work is done.
    pub fn new(path: &Path) -> anyhow::Result<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let format = match extension.to_ascii_lowercase().as_str() {
            "uvfits" | "fits" => Format::Uvfits,
            "txt" => Format::ObsText,
            "csv" => Format::Table,
            _ => bail!(
                "output {} must end in .uvfits, .txt (eht-imaging's text) or .csv",
                path.display()
            ),
        };
        Ok(ObservationFile { output: Output::new(path, "")?, format })
    }

    /// Refuses to take the place of a file that is read.
    pub fn spares(&self, input: &Path) -> anyhow::Result<()> {
        self.output.spares(input)
    }

    /// Writes.
    pub fn write(&self, observation: &Observation) -> anyhow::Result<()> {
        let bytes = match self.format {
            Format::Uvfits => files::write_uvfits(observation),
            Format::ObsText => files::to_obs_text(observation).map(String::into_bytes),
            Format::Table => Ok(files::to_csv(observation).into_bytes()),
        };
        let shown = self.output.shown().display();
        self.output.write(&bytes.with_context(|| format!("cannot write {shown}"))?)?;
        output::print(&format!("{shown}\n"))
    }
}
