//! `kerrlight fit`: recovers emission from movies and visibilities.

mod api;
mod band_plots;
mod band_words;
mod closures;
mod data;
mod device_runner;
mod failed;
mod folder;
mod held_out;
mod init;
mod inputs;
mod journal;
mod linear;
pub mod posterior;
mod results;
mod run;
mod searches;
mod static_image;
mod work;

use crate::answer::Answer;
use crate::changed::{self, Changed};
use crate::devices::{FitDevice, StepsOption};
use crate::record::Recorder;
use crate::{interrupt, output, paths, plain, session};
use anyhow::{Context, anyhow, bail};
pub use api::{assigned, check, coverage, sizes, turned, velocities};
pub use band_plots::{loop_plot, of_runs as plots_of_bands};
use clap::Args;
pub use failed::Failed;
use folder::Folder;
pub use inputs::{Inputs, SETTINGS};
use kerrlight_common::toml_file;
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::representation::Registry;
pub use posterior::Posterior;
pub use results::LIGHT_CURVE;
pub use searches::BAND;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Duration;
use work::{Prepared, Work};

/// The experiment that runs without a file.
const BUILT_IN: &str = include_str!("built_in.toml");

/// Arguments of `kerrlight fit`.
#[derive(Debug, Args)]
pub struct Fit {
    /// Fit file; without it a built-in experiment: a flare of Sgr A* seen by the ngEHT
    #[arg(value_name = "FIT.toml")]
    file: Option<PathBuf>,
    /// Folder of the run, new or empty [default: kerrlight-fit, or -2, -3 …]; with --init the file
    /// [default: my_fit.toml]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Fit this file of data (visibilities, images or a light curve) with settings that are guessed from it; every guess
    /// is told, and what cannot be guessed is asked for. Several files of visibilities (bands, days) make one static image
    #[arg(long, value_name = "DATA", num_args = 1.., conflicts_with_all = ["file", "resume", "init"])]
    data: Option<Vec<PathBuf>>,
    /// Change a setting, e.g. training.steps=500; `representation=grid` is short for
    /// representation.kind=grid
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Resume the run in this folder
    #[arg(long, value_name = "FOLDER", conflicts_with = "output")]
    resume: Option<PathBuf>,
    #[command(flatten)]
    device: StepsOption,
    /// Draw N posterior samples of volume and geometry after the fit, as `kerrlight posterior` does
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    samples: Option<u32>,
    /// Write the settings that would be used and stop
    #[arg(long)]
    print: bool,
    /// Print the JSON Schema of fit files, for editors; of static images with --model image
    #[arg(long, conflicts_with_all = ["file", "set", "resume", "print", "data", "init"])]
    schema: bool,
    /// Stop, keeping what there is, when standard input ends: for programs that start fits
    #[arg(long, hide = true)]
    stop_with_input: bool,
    /// Write a commented file to start from, for a fit of these data (visibilities, images or a light curve), or of the
    /// built-in experiment
    #[arg(long, value_name = "DATA", num_args = 0..=1, conflicts_with_all = ["file", "set", "resume", "print"])]
    init: Option<Option<PathBuf>>,
    /// Model for --data or --init: a static image or a volume [default: an image of M87*, and of Sgr A* if it explains
    /// the data]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "image|volume", conflicts_with_all = ["file", "resume"])]
    model: Option<init::Model>,
}

impl Fit {
    /// Fits.
    pub fn run(&self, registry: &Registry) -> anyhow::Result<Answer> {
        if self.schema {
            let keys = match self.model {
                Some(init::Model::Image) => StaticImageFile::keys(),
                _ => FitFile::keys(),
            };
            let text = serde_json::to_string_pretty(keys.schema())?;
            return Ok(Answer::text(format!("{text}\n")).with("schema", keys.schema().clone()));
        }
        if self.stop_with_input {
            interrupt::follow_parent()?;
        }
        if let Some(data) = &self.init {
            return init::write(data.as_deref(), self.output.as_deref(), self.model);
        }
        // A device that is missing is told before any data are read.
        let device = self.device.open()?;
        if let Some(path) = &self.resume {
            let folder = Folder::open(path, self.patience())?;
            let text = &folder.settings;
            self.same(text)?;
            let work = Work::read(text).with_context(|| path.display().to_string())?;
            let read = || work.prepared(&base_dir_of(text), registry);
            let work = inputs::read_again(folder.path(), read)?;
            work.check_device(device.as_ref())?;
            return self.run_all(&work, &folder, device);
        }
        let guess = self.data.as_deref().map(|data| init::guess(data, self.model)).transpose()?;
        let (own, base_dir) = self.settings(guess.as_ref())?;
        let text = self.changed(&own, &base_dir)?;
        let (name, by) = (self.name(), changed::assignments(&self.set));
        let changed = Changed { name: &name, own: &own, text: &text, by: &by };
        if self.print {
            return self.printed(&changed, guess.as_ref(), registry);
        }
        if let (Some(guess), Some(data)) = (&guess, &self.data) {
            // After --set, which may give what nothing can be guessed of.
            guess.check(&text, data)?;
            eprint!("{text}\n{}", guess.sentences(&text));
        }
        let work = Work::read_changed(&changed)?;
        // Told now, not after a fit of hours.
        if self.samples.is_some() {
            work.check_draws()?;
        }
        // Checksums of all that is read tell a resumed run whether it is still the same.
        let (prepared, read) = output::with_reads(|| work.prepared(&base_dir, registry));
        let prepared = prepared?;
        prepared.check_device(device.as_ref())?;
        let text = Self::begun(&text, &base_dir);
        // The folder comes last: refused settings and data leave none behind.
        let folder = match &self.output {
            Some(path) => path.clone(),
            None => Folder::unnamed()?,
        };
        let folder = Folder::create(&folder, &text, Inputs::new(&text, read))?;
        self.run_all(&prepared, &folder, device)
    }

    /// The settings as an answer; those of a program that calls this one have to make sense.
    fn printed(
        &self,
        changed: &Changed<'_>,
        guess: Option<&init::Guess>,
        registry: &Registry,
    ) -> anyhow::Result<Answer> {
        let text = changed.text;
        let is_called = session::is_here();
        let mut guessed = Vec::new();
        if let (Some(guess), Some(data)) = (guess, &self.data) {
            if is_called {
                guess.check(text, data)?;
            }
            guessed.extend(guess.sentences(text).lines().map(str::to_owned));
        }
        if is_called {
            check(changed, registry)?;
        }
        let settings = serde_json::to_value(text.parse::<toml::Table>()?)?;
        Ok(Answer::text(text.to_owned()).with("settings", settings).with("guessed", guessed))
    }

    /// The fit, and the draws that are wanted after it.
    fn run_all(
        &self,
        work: &Prepared,
        folder: &Folder,
        device: Option<FitDevice>,
    ) -> anyhow::Result<Answer> {
        let recorder = recorder(folder);
        let prepared = match work {
            Prepared::Emission(prepared) => prepared,
            Prepared::Image(prepared) => {
                let answer = static_image::run(prepared, folder)?;
                recorder.write_into(folder.path())?;
                return Ok(answer);
            }
        };
        let answer = run::run(prepared, folder, device)?;
        recorder.write_into(folder.path())?;
        let Some(samples) = self.samples else { return Ok(answer) };
        Ok(answer.and("posterior", posterior::draw(prepared, folder, samples)?))
    }

    /// The settings as a run has them.
    fn begun(text: &str, base_dir: &Path) -> String {
        // Settings of a run say so already.
        let text =
            text.strip_prefix(BASE_DIR).and_then(|t| t.split_once('\n')).map_or(text, |(_, t)| t);
        from_folder(text, base_dir)
    }

    /// Returns how long to wait for another process: the fit of a comparison that was killed a moment ago is about to end.
    fn patience(&self) -> Duration {
        Duration::from_secs(if self.stop_with_input { 60 } else { 0 })
    }

    fn name(&self) -> String {
        match (&self.file, &self.data) {
            (Some(file), _) => plain::path(file),
            // Lines that an error names are those of the settings, not of the data.
            (None, Some(data)) => {
                let names: Vec<String> = data.iter().map(|path| plain::path(path)).collect();
                format!("settings guessed from {}", names.join(", "))
            }
            (None, None) if session::settings().is_some() => "settings".to_owned(),
            (None, None) => "built-in experiment".to_owned(),
        }
    }

    /// The text of the settings, without `--set`, and the folder that paths in it start from.
    fn settings(&self, guess: Option<&init::Guess>) -> anyhow::Result<(String, PathBuf)> {
        let (text, base_dir) = match (&self.file, guess) {
            (None, Some(guess)) => (guess.text.clone(), PathBuf::from(".")),
            (None, None) => {
                let given = session::settings().map(placed);
                given.unwrap_or_else(|| (BUILT_IN.to_owned(), PathBuf::from(".")))
            }
            (Some(path), _) => {
                let folder = std::path::absolute(paths::folder_of(path))
                    .with_context(|| path.display().to_string())?;
                placed((
                    output::read_text(path).map_err(|error| not_settings(path, error))?,
                    folder,
                ))
            }
        };
        // It stands in a line of the run's settings.
        plain::check_name(&base_dir.to_string_lossy())?;
        Ok((text, base_dir))
    }

    /// The text of the settings with `--set`.
    fn changed(&self, own: &str, base_dir: &Path) -> anyhow::Result<String> {
        // The built-in experiment has no folder of its own.
        let has_folder = self.file.is_some() || session::settings().is_some();
        let folder = has_folder.then_some(base_dir);
        if !self.set.is_empty() {
            // What is wrong with the file is no fault of --set.
            toml_file::read::<toml::Table>(own).with_context(|| self.name())?;
        }
        self.set.iter().try_fold(own.to_owned(), |text, assignment| {
            assigned(&text, &paths::from_here(assignment, folder)?)
        })
    }

    /// Refuses to resume a run with settings other than its own.
    fn same(&self, text: &str) -> anyhow::Result<()> {
        if !self.set.is_empty() {
            bail!("--resume uses the settings of the run: --set is for a new one");
        }
        let Some(path) = &self.file else { return Ok(()) };
        let (given, folder) = self.settings(None)?;
        if Work::read(&given)? != Work::read(text)? {
            // The settings of a run have a line more at their head: where paths start from.
            let at = text.lines().skip(1).zip(given.lines()).position(|(a, b)| a != b);
            let line = at.map_or(String::new(), |k| format!(", first in line {}", k + 1));
            bail!("{} differs from the settings that the run began with{line}", path.display());
        }
        // The same relative path from another folder is another file.
        let work = |text: &str| Work::read(&whole(text, &folder)?.to_string());
        if work(&given)? != work(text)? {
            let (path, own) = (path.display(), base_dir_of(text));
            bail!(
                "{path} differs from the settings that the run began with: its paths start from {}, not from {}",
                folder.display(),
                own.display()
            );
        }
        Ok(())
    }
}

/// The record of a run, whose command names the settings in its folder where a caller has given them as text.
fn recorder(folder: &Folder) -> Recorder {
    if session::settings().is_none() {
        return Recorder::of_process();
    }
    let (run, settings) = (folder.path(), folder.path().join(SETTINGS));
    let words = ["kerrlight".into(), "fit".into(), settings.into(), "-o".into(), run.into()];
    Recorder::new(words.into())
}

/// The first line of a run's settings.
const BASE_DIR: &str = "# Paths start from ";

/// Settings that say from which folder their paths start.
pub fn from_folder(settings: &str, folder: &Path) -> String {
    format!("{BASE_DIR}{}\n{settings}", folder.display())
}

/// Settings, with the folder that they say themselves where they do.
fn placed((text, folder): (String, PathBuf)) -> (String, PathBuf) {
    let folder = if text.starts_with(BASE_DIR) { base_dir_of(&text) } else { folder };
    (text, folder)
}

/// The folder that paths in a run's settings start from.
fn base_dir_of(text: &str) -> PathBuf {
    let first = text.lines().next().unwrap_or_default();
    PathBuf::from(first.strip_prefix(BASE_DIR).unwrap_or("."))
}

/// Settings with whole paths in place of those from the folder that the text says itself, or else from `folder`.
fn whole(text: &str, folder: &Path) -> anyhow::Result<toml::Table> {
    let (text, folder) = placed((text.to_owned(), folder.to_owned()));
    let mut table = text.parse::<toml::Table>()?;
    paths::resolve(&mut table, &folder);
    Ok(table)
}

/// Returns whether two texts are settings of the same fit, whatever their order and their comments. Relative paths start
/// from the folder that the first line of a text names, where it does, or else from `folder`.
///
/// # Errors
/// If a text is no TOML.
pub fn is_same_fit(one: &str, other: &str, folder: &Path) -> anyhow::Result<bool> {
    Ok(whole(one, folder)? == whole(other, folder)?)
}

/// The error of a file that holds no settings; data are named as such.
fn not_settings(path: &Path, error: anyhow::Error) -> anyhow::Error {
    let mut head = [0; 9];
    let read = output::open(path).and_then(|mut file| Ok(file.read_exact(&mut head)?));
    let is_fits = read.is_ok() && head == *b"SIMPLE  =";
    let shown = plain::path(path);
    match is_fits {
        true => anyhow!(
            "{shown} is a FITS file, no settings: to fit data, `kerrlight fit --data {shown}`"
        ),
        false => error,
    }
}

fn parse(text: &str) -> anyhow::Result<FitFile> {
    if StaticImageFile::is_static_image(text) {
        bail!(
            "there is a table [image]: a static image has no volume, and this needs one; errors of an image are in its report"
        );
    }
    FitFile::parse(text).map_err(init::explained)
}

/// The built-in experiment with changes.
#[cfg(test)]
fn built_in_with(changes: &[&str]) -> FitFile {
    let change = |text: String, change: &&str| assigned(&text, change).unwrap();
    parse(&changes.iter().fold(BUILT_IN.to_owned(), change)).unwrap()
}
