//! Common parts of the verbs of interferometry: arguments, files of visibilities, plots, images.

pub mod arguments;
pub mod image_files;
pub mod movie_files;
pub mod plots;
pub mod scene_movie;

use crate::output::{self, Output};
use crate::paths;
use anyhow::{Context, bail};
use clap::ValueEnum;
use kerrlight_vlbi::files::{self, EhtTable};
use kerrlight_vlbi::observation::{Observation, Repeats};
use kerrlight_vlbi::polarimetry::derotate;
use std::path::Path;

/// Reads visibilities in any format; the rotation of feeds is taken out of those that say that they have it.
pub fn read(path: &Path) -> anyhow::Result<Observation> {
    let decoded = files::decode(&output::read(path)?);
    let (_, mut observation) = decoded.with_context(|| path.display().to_string())?;
    let says = || format!("{} says FRCAL: 0", path.display());
    match derotate(&mut observation) {
        Ok(true) => eprintln!("note: {}: the rotation of feeds is taken out", says()),
        Ok(false) => {}
        Err(error) => eprintln!("warning: {}, and the rotation of feeds stays: {error}", says()),
    }
    Ok(observation)
}

/// Says of rows that are there more than once what becomes of them where times are compared.
pub fn warn_of_repeats(name: &str, observation: &Observation) {
    let Repeats { rows, copies } = observation.repeats();
    if rows > 0 {
        eprintln!(
            "warning: {name}: {rows} rows have the baseline, channel and time of another: {copies} copies are dropped, {} are averaged with it",
            rows - copies
        );
    }
}

/// Tells what a file says of its own calibration and errors.
pub fn note_cautions(name: &str, observation: &Observation) {
    let all: Vec<&str> = observation.cautions().collect();
    if !all.is_empty() {
        eprintln!("note: {name} says: {}", all.join("; "));
    }
}

/// Formats in which visibilities are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Written {
    /// UVFITS (.uvfits, .fits)
    Uvfits,
    /// eht-imaging's text (.txt)
    ObsText,
    /// kerrlight's CSV (.csv)
    Csv,
    /// The EHT's public csv, total intensity (--format only)
    EhtCsv,
    /// The EHT's public txt, total intensity (--format only)
    EhtTxt,
}

impl Written {
    /// The format of a file: `asked`, or what the name's ending says.
    fn of(path: &Path, asked: Option<Self>) -> anyhow::Result<Self> {
        let by_name = match paths::ending(path).as_str() {
            "uvfits" | "fits" => Written::Uvfits,
            "txt" => Written::ObsText,
            "csv" => Written::Csv,
            _ => bail!(
                "output {} must end in .uvfits, .txt (eht-imaging's text) or .csv",
                path.display()
            ),
        };
        let format = asked.unwrap_or(by_name);
        // Texts may have each other's endings, but no text is UVFITS.
        if (format == Written::Uvfits) != (by_name == Written::Uvfits) {
            bail!("output {}: its ending is not that of --format", path.display());
        }
        Ok(format)
    }
}

/// A file of visibilities to be written.
pub struct ObservationFile {
    pub output: Output,
    format: Written,
    comments: bool,
}

impl ObservationFile {
    /// Checks the place before any work is done. The format is `format`, by default that of the
    /// name's ending, and CSV on standard output. With `comments` kerrlight's CSV tells settings.
    pub fn new(path: &Path, format: Option<Written>, comments: bool) -> anyhow::Result<Self> {
        let format = match (output::is_pipe(path), format) {
            (true, format) => format.unwrap_or(Written::Csv),
            (false, format) => Written::of(path, format)?,
        };
        if comments && format != Written::Csv {
            bail!("--comments is for kerrlight's CSV: output {} is not one", path.display());
        }
        Ok(ObservationFile { output: Output::or_pipe(path, &[])?, format, comments })
    }

    /// Returns whether more than Stokes I is written.
    fn keeps_polarization(&self) -> bool {
        matches!(self.format, Written::Uvfits | Written::ObsText)
    }

    /// Counts the rows that are written.
    pub fn rows_of(&self, observation: &Observation) -> usize {
        match self.keeps_polarization() {
            true => observation.rows.len(),
            false => observation.stokes_i().count(),
        }
    }

    /// Says that the polarisation of an input does not fit into the format.
    pub fn warn_of_polarization(&self, observation: &Observation, input: &str) {
        if observation.is_polarized() && !self.keeps_polarization() {
            eprintln!(
                "warning: {} has Stokes I alone: the polarisation of {input} is left out; .uvfits keeps it",
                self.output.shown().display()
            );
        }
    }

    /// Writes.
    pub fn write(&self, observation: &Observation) -> anyhow::Result<()> {
        let text = |text: String| text.into_bytes();
        let bytes = match self.format {
            Written::Uvfits => files::write_uvfits(observation),
            Written::ObsText => files::to_obs_text(observation).map(text),
            Written::Csv => files::to_csv(observation, self.comments).map(text),
            Written::EhtCsv => files::to_eht_table(observation, EhtTable::Csv).map(text),
            Written::EhtTxt => files::to_eht_table(observation, EhtTable::Txt).map(text),
        };
        let shown = self.output.shown().display();
        self.output.write(&bytes.with_context(|| format!("cannot write {shown}"))?)
    }
}
