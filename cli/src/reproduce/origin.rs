//! What made a file or folder.

use crate::compare::Plan;
use crate::fit::{Inputs, SETTINGS};
use crate::record::{self, Record};
use crate::render::source::Source;
use crate::{assets, output, zarr};
use anyhow::Context;
use std::path::{Path, PathBuf};

/// A command, and how it stands with what it reads.
pub struct Origin {
    /// The words of the command line.
    pub command: Vec<String>,
    /// Where it is to be given; anywhere, if there is none.
    pub folder: Option<PathBuf>,
    /// Version of the program that has made it.
    pub version: String,
    /// How many files it reads.
    pub inputs: usize,
    /// What is wrong with them now.
    pub faults: Vec<String>,
}

impl Origin {
    /// Of a file or a folder.
    ///
    /// # Errors
    /// If it does not tell, or cannot be read.
    pub fn of(path: &Path) -> anyhow::Result<Self> {
        let ends_in = |end: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(end));
        // A store of Zarr belongs to the folder that it lies in.
        if path.is_dir() && !zarr::is_store(path) {
            return Self::of_folder(path)?.with_context(|| nothing(path));
        }
        if ends_in("exr") {
            return Self::of_picture(path);
        }
        if !path.is_dir() {
            output::open(path)?;
        }
        if ends_in("json")
            && path.file_name().is_none_or(|name| name != record::FILE)
            && let Ok(record) = Record::load(path)
        {
            return Ok(Self::of_record(record));
        }
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let folder = folder.unwrap_or(Path::new("."));
        match Self::of_folder(folder)? {
            Some(origin) => Ok(origin),
            None => Self::of_output(path, folder).with_context(|| nothing(path)),
        }
    }

    /// A file that a record in its folder says was written; the record of the file as it is now goes first.
    fn of_output(path: &Path, folder: &Path) -> Option<Self> {
        let full = path.canonicalize().ok()?;
        let names = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
        let mut names: Vec<PathBuf> =
            names.filter(|name| name.extension().is_some_and(|e| e == "json")).collect();
        names.sort();
        let records = names.iter().filter_map(|name| Record::load(name).ok());
        let writes = |record: &Record| record.outputs.iter().find(|out| out.path == full).cloned();
        let mut all: Vec<_> =
            records.filter_map(|record| Some((writes(&record)?.fault(), record))).collect();
        all.sort_by_key(|(fault, _)| fault.is_some());
        let (fault, record) = all.into_iter().next()?;
        if let Some(fault) = fault {
            eprintln!("note: since it was made, {fault}");
        }
        Some(Self::of_record(record))
    }

    /// The folder of a fit, of the draws about it, or of a comparison.
    fn of_folder(folder: &Path) -> anyhow::Result<Option<Self>> {
        if folder.join(SETTINGS).is_file() {
            return Self::of_fit(folder).map(Some);
        }
        if let Some((plan, _)) = Plan::load(folder)? {
            return Self::of_comparison(folder, &plan).map(Some);
        }
        let numbers = folder.join("posterior.json");
        let run = folder.parent().filter(|_| numbers.is_file());
        let Some(run) = run else { return Ok(None) };
        let mut origin = Self::of_fit(run)?;
        let text = output::read_text(&numbers)?;
        let numbers: serde_json::Value = serde_json::from_str(&text).context("posterior.json")?;
        let samples = numbers["samples"].to_string();
        origin.command.extend(["--samples".to_owned(), samples]);
        Ok(Some(origin))
    }

    fn of_fit(run: &Path) -> anyhow::Result<Self> {
        let (inputs, settings) = (Inputs::load(run)?, run.join(SETTINGS));
        let command = ["kerrlight", "fit", &shown(&settings), "-o", &again(run)];
        Ok(Self {
            command: command.map(str::to_owned).to_vec(),
            folder: None,
            version: inputs.version.clone(),
            inputs: inputs.files.len() + 1,
            faults: inputs.faults(run),
        })
    }

    fn of_comparison(folder: &Path, plan: &Plan) -> anyhow::Result<Self> {
        let (mut faults, mut count) = (Vec::new(), 1);
        for case in std::fs::read_dir(folder.join("cases")).into_iter().flatten().flatten() {
            if let Ok(inputs) = Inputs::load(&case.path()) {
                count += inputs.files.len();
                faults.extend(inputs.faults(&case.path()));
            }
        }
        faults.sort();
        faults.dedup();
        let command = ["kerrlight", "compare", &shown(folder), "-o", &again(folder)];
        Ok(Self {
            command: command.map(str::to_owned).to_vec(),
            folder: None,
            version: plan.version().to_owned(),
            inputs: count,
            faults,
        })
    }

    /// A picture carries its scene, and checksums of the files that the scene names.
    fn of_picture(path: &Path) -> anyhow::Result<Self> {
        let source = Source::new(Some(path))?;
        let (_, scene) = source.scene(&[])?;
        let files = assets::load(&scene, &source.folder, &[], assets::Reach::default());
        let before = source.files.as_deref().unwrap_or_default();
        let faults = match &files {
            Err(error) => vec![crate::plain::reasons(error)],
            Ok(files) if files.identity != before => {
                vec![format!("files of the scene have changed: they were {}", before.trim())]
            }
            Ok(_) => Vec::new(),
        };
        let place = path.with_extension("again.exr");
        let command = ["kerrlight", "render", &shown(path), "-o", &shown(&place)];
        Ok(Self {
            command: command.map(str::to_owned).to_vec(),
            folder: None,
            version: source.version.clone().unwrap_or_default(),
            inputs: before.lines().count() + 1,
            faults,
        })
    }

    fn of_record(record: Record) -> Self {
        Self {
            inputs: record.inputs.len(),
            faults: record.inputs.iter().filter_map(record::Entry::fault).collect(),
            command: record.command,
            folder: Some(record.folder),
            version: record.version,
        }
    }
}

fn nothing(path: &Path) -> String {
    format!(
        "{} does not tell what made it: give the folder of a fit or of a comparison, an EXR of kerrlight, a record (--record), or a file with its record beside it",
        path.display()
    )
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A name beside a folder's.
fn again(folder: &Path) -> String {
    let text = shown(folder);
    format!("{}-again", text.trim_end_matches('/'))
}
