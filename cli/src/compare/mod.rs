//! `kerrlight compare`: many fits that differ in named factors, in one command.

mod cases;
mod changes;
mod experiment;
mod figures;
mod labels;
mod map;
mod page;
mod quick;
mod ran;
mod runner;
mod source;
mod summary;
mod tables;
mod verdicts;

use crate::answer::Answer;
use crate::interrupt::{Interrupted, Keeper};
use crate::lock::{self, Lock};
use crate::output::Output;
use crate::program::Program;
use crate::progress;
use anyhow::{Context, bail};
use cases::{Case, Choice, Status};
use clap::Args;
use experiment::Experiment;
use page::Page;
use runner::Runner;
use serde_json::{Value, json};
use source::Source;
use std::path::{Path, PathBuf};
use std::time::Duration;
use summary::Summary;

/// Arguments of `kerrlight compare`.
#[derive(Debug, Args)]
pub struct Compare {
    /// An experiment that the program carries, an experiment's file (.toml), or the results of an earlier run
    /// (results.json) to hold against others; without it, the experiments are listed
    experiment: Option<PathBuf>,
    /// Folder of the results [default: the experiment's name]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Seeds of every case
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// Run these cases alone, e.g. scene=1; may be repeated
    #[arg(long, value_name = "FACTOR=LEVEL")]
    only: Vec<String>,
    /// Change a setting of all fits, e.g. training.steps=100
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// A look at whether it runs: few steps, few cases
    #[arg(long)]
    quick: bool,
    /// Resume in an existing folder: finished cases are not run again
    #[arg(long)]
    resume: bool,
    /// Show what changed since an earlier run
    #[arg(long, value_name = "RESULTS")]
    against: Option<PathBuf>,
    /// List the cases and stop
    #[arg(long)]
    list: bool,
}

/// Some cases failed: they are named, and the others are whole.
#[derive(Debug, thiserror::Error)]
#[error("{failed} of {all} cases failed: {names}")]
pub struct Failed {
    failed: usize,
    all: usize,
    names: String,
}

impl Compare {
    /// Runs an experiment.
    pub fn run(
        &self,
        (threads, memory): (Option<u16>, Option<u64>),
        program: &Program,
    ) -> anyhow::Result<Answer> {
        let Some(name) = &self.experiment else { return Ok(list_experiments()) };
        let before = self.against.as_deref().map(changes::read).transpose()?;
        // A folder that is called like an experiment is meant by ./name.
        let is_known = source::built_in().any(|(known, _)| Path::new(known) == name);
        let is_file = name.extension().is_some_and(|e| e == "json");
        if is_file || (!is_known && name.join("results.json").is_file()) {
            let Some(before) = before else {
                bail!("{} are results: give others with --against", name.display());
            };
            let changed = changes::table(&changes::read(name)?, &before)?;
            let answer = Answer::text(tables::markdown(&changed)).with("note", changed.caption);
            return Ok(answer.with("head", changed.head).with("rows", changed.rows));
        }
        let (source, text) = Source::find(name)?;
        let experiment = Experiment::parse(&text).with_context(|| name.display().to_string())?;
        let choice = Choice {
            seeds: self.seeds,
            only: self.only.clone(),
            quick: self.quick,
            set: self.set.clone(),
            registry: program.registry.clone(),
        };
        let chosen = cases::expand(&experiment, &source, &choice)?;
        ran::check(&experiment, &chosen).with_context(|| name.display().to_string())?;
        if let [first, ..] = &chosen[..]
            && chosen.iter().all(|case| case.settings.is_err())
        {
            let why = first.settings.as_ref().err().map(String::as_str).unwrap_or_default();
            bail!("{}: no case can be run; {}: {why}", name.display(), first.name());
        }
        if self.list {
            return Ok(list_cases(&chosen));
        }
        let all = cases::expand(&experiment, &source, &choice.unrestricted())?;
        let (folder, lock) = self.folder(name, &text)?;
        let runner = Runner::new(&folder, (threads, memory), program, lock)?;
        let cases = with_known(chosen, all, &runner);
        runner.check_inputs(&cases)?;
        let summary = run(&cases, &runner);
        let page = Page { experiment: &experiment, choice: &choice, summary: &summary };
        let tables = page.write(&runner, &folder, before.as_ref())?;
        Ok(end(&tables, &summary, &folder))
    }

    /// The folder, new or resumed.
    fn folder(&self, name: &Path, text: &str) -> anyhow::Result<(PathBuf, Lock)> {
        let stem =
            name.file_stem().map_or("compare".into(), |stem| stem.to_string_lossy().into_owned());
        let folder =
            self.output.clone().unwrap_or_else(|| PathBuf::from(format!("kerrlight-{stem}")));
        let shown = folder.display().to_string();
        if !lock::is_free(&folder) && !self.resume {
            bail!(
                "{shown} exists and is not an empty folder: resume it with --resume, or give another with -o"
            );
        }
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("cannot make the folder {shown}"))?;
        let lock = Lock::take(&folder, "compares in", Duration::ZERO)?;
        Output::new(&folder.join("experiment.toml"), "toml")?.write(text.as_bytes())?;
        Ok((folder, lock))
    }
}

fn list_experiments() -> Answer {
    let line = |(name, title): (&str, String)| format!("{name:20} {title}\n");
    let all: String = source::built_in().map(line).collect();
    let entries = source::built_in().map(|(name, title)| json!({"name": name, "title": title}));
    Answer::text(format!("{all}\nRun one with: kerrlight compare NAME\n"))
        .with("experiments", entries.collect::<Vec<_>>())
}

fn list_cases(cases: &[Case]) -> Answer {
    let line = |case: &Case| match &case.settings {
        Ok(_) => format!("{}\n", case.name()),
        Err(error) => format!("{}: {error}\n", case.name()),
    };
    let entry = |case: &Case| json!({"name": case.name(), "error": case.settings.as_ref().err()});
    Answer::text(cases.iter().map(line).collect::<String>())
        .with("cases", cases.iter().map(entry).collect::<Vec<_>>())
}

/// The chosen cases, and those that an earlier run of the same folder has done beside them.
fn with_known(mut chosen: Vec<Case>, all: Vec<Case>, runner: &Runner<'_>) -> Vec<Case> {
    let is_done = |case: &Case| matches!(runner.known(case), Status::Done(_));
    let mut cases = Vec::with_capacity(all.len());
    for case in all {
        match chosen.iter().position(|other| other.slug == case.slug) {
            Some(at) => cases.push(chosen.remove(at)),
            None if is_done(&case) => cases.push(case),
            None => {}
        }
    }
    cases.extend(chosen);
    cases
}

/// Runs what is not done yet, until a signal.
fn run<'a>(cases: &'a [Case], runner: &Runner<'_>) -> Summary<'a> {
    let keeper = Keeper::saving("stopping after the fit's step; a second signal ends at once");
    let mut all: Vec<(&Case, Status)> =
        cases.iter().map(|case| (case, runner.known(case))).collect();
    let open = all.iter().filter(|(_, status)| *status == Status::Open).count();
    eprintln!("{} cases, {open} of them to be run", cases.len());
    for (case, status) in &all {
        if let Status::Failed(why) = status {
            eprintln!("failed: {}: {why}", case.name());
        }
    }
    let bar = progress::cases(open as u64);
    for (case, status) in all.iter_mut().filter(|(_, status)| *status == Status::Open) {
        if keeper.stopped() {
            break;
        }
        bar.set_message(case.name());
        bar.tick();
        *status = runner.run(case, &keeper);
        if let Status::Failed(why) = status {
            bar.suspend(|| eprintln!("failed: {}: {why}", case.name()));
        }
        bar.inc(u64::from(*status != Status::Open));
    }
    bar.finish_and_clear();
    Summary::new(all)
}

/// The tables, how many cases are done and which of them are best and worst, and where to look.
fn end(tables: &str, summary: &Summary, folder: &Path) -> Answer {
    let files = ["report.html", "results.json", "results.csv", "tables.md"];
    let files = files.map(|name| folder.join(name));
    let failed = summary.failed().map(|(case, why)| json!({"name": case.name(), "error": why}));
    let answer = Answer::text(format!("{tables}{}\n{}\n", summary.worth(), files[0].display()))
        .with("folder", folder.display().to_string())
        .files(files.iter().map(PathBuf::as_path))
        .with("cases", summary.all.len())
        .with("done", summary.done().count())
        .with("failed", failed.collect::<Vec<_>>())
        .with_all(summary.extremes().map_or(Value::Null, |extremes| extremes.json()));
    match failure(summary, folder) {
        Some(error) => answer.failing(error),
        None => answer,
    }
}

/// Why the command fails, where cases are not done or failed.
fn failure(summary: &Summary, folder: &Path) -> Option<anyhow::Error> {
    if summary.open() > 0 {
        let (open, folder) = (summary.open(), folder.display());
        let how = format!("resume with the same command, --resume and -o {folder}");
        return Some(Interrupted(format!("stopped: {open} cases are not done; {how}")).into());
    }
    let failed: Vec<String> = summary.failed().map(|(case, _)| case.name()).collect();
    if failed.is_empty() {
        return None;
    }
    let (count, all) = (failed.len(), summary.all.len());
    Some(Failed { failed: count, all, names: failed.join("; ") }.into())
}
