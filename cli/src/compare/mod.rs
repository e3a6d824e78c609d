//! `kerrlight compare`: many fits that differ in named factors, in one command.

mod cases;
mod experiment;
mod figures;
mod labels;
mod listing;
mod map;
mod one;
mod page;
mod plan;
mod quick;
mod ran;
mod recipe;
mod results;
mod runner;
mod source;
mod status;
mod summary;
mod tables;
mod verdicts;

use crate::Arguments;
use crate::answer::Answer;
use crate::interrupt::{Interrupted, SignalGuard};
use crate::lock::Lock;
use crate::output::Output;
use crate::plain;
use crate::program::Program;
use crate::progress;
use crate::record::Recorder;
use crate::session;
use anyhow::{Context, bail};
use cases::{Case, Status};
use clap::Args;
use experiment::Experiment;
pub use one::Busy;
use page::Page;
pub use plan::Plan;
use rayon::prelude::*;
use recipe::Choice;
use runner::Runner;
use serde_json::{Value, json};
use source::Source;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::Duration;
use summary::Summary;

/// Arguments of `kerrlight compare`.
#[derive(Debug, Args)]
pub struct Compare {
    /// A built-in experiment [default: list them], a file (.toml), or a folder of results
    experiment: Option<PathBuf>,
    /// Folder of the results [default: the experiment's name]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    /// Resume in an existing folder: finished cases are not run again
    #[arg(long)]
    resume: bool,
    /// Run this case alone, as --list names it, in a folder that other processes may use too
    #[arg(long, value_name = "ID", conflicts_with = "resume")]
    case: Option<String>,
    /// Count the cases of a folder that are done, running, failed and open
    #[arg(long, conflicts_with_all = ["resume", "case", "list"])]
    status: bool,
    /// Write the report of the cases that are done so far
    #[arg(long, conflicts_with_all = ["resume", "case", "list", "status"])]
    collect: bool,
    /// List the cases, one a line: ID, expected cost, and the command that runs it
    #[arg(long, conflicts_with = "case")]
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
    pub fn run(&self, arguments: &Arguments, program: &Program) -> anyhow::Result<Answer> {
        let Some(name) = &self.experiment else { return Ok(listing::experiments()) };
        let mut asked = self.asked(name, program)?;
        let folder = asked.folder.clone();
        if let Some(id) = &self.case {
            return run_one(id, &asked, arguments, program);
        }
        let chosen = cases::expand(&asked.experiment, &asked.source, &asked.choice)?;
        if self.status {
            return status::show(&folder, &chosen, asked.experiment.samples(asked.choice.quick));
        }
        // First, because the check refuses one χ² for several kinds of data.
        ran::split_chi2(&mut asked.experiment, &chosen);
        let Asked { experiment, choice, source, .. } = &asked;
        ran::check(experiment, &chosen).with_context(|| name.display().to_string())?;
        // One wrong case fails by itself; where all are wrong, nothing is begun.
        if let [first, ..] = &chosen[..]
            && let Some(why) = first.early_error()
            && chosen.iter().all(|case| case.early_error().is_some())
        {
            bail!("{}: no case can be run; {}: {why}", name.display(), first.name());
        }
        if self.list {
            return Ok(listing::cases(chosen, &self.command(&asked, arguments)));
        }
        // Cases that are not run need no data.
        if !self.collect {
            ran::check_data(&chosen)?;
        }
        let recorder = Recorder::of_process();
        let lock = self.enter(&asked)?;
        let draws = experiment.samples(choice.quick);
        let runner = Runner::new(&folder, arguments, program, draws, lock)?;
        // The report is written anew: what earlier runs of this folder found has to stay in it.
        let cases = if choice.seeds.is_some() || !choice.only.is_empty() {
            let all = Choice { seeds: None, only: Vec::new(), ..choice.clone() };
            with_known(chosen, cases::expand(experiment, source, &all)?, &runner)
        } else {
            chosen
        };
        runner.check_inputs(&cases)?;
        let failed = if self.collect { None } else { Some(run(&cases, &runner, &folder)?) };
        let status = |case: &Case| match runner.known(case) {
            Status::Open => match &failed {
                Some(failed) => failed.get(&case.slug()).cloned(),
                // Others may still run some.
                None => one::failure(&folder, case),
            }
            .map_or(Status::Open, Status::Failed),
            status => status,
        };
        let (shown, left_out) = match choice.quick {
            true => quick::look(experiment),
            false => (experiment.clone(), Vec::new()),
        };
        let is_all = choice.seeds.is_none() && choice.only.is_empty();
        let is_done = |case| matches!(status(case), Status::Done(_));
        if self.collect && is_all && !cases.iter().any(is_done) {
            status::refuse_others(&folder, &cases)?;
        }
        let file = Output::new(&folder.join("results.json"), "")?;
        let summary = Summary::written(&shown, &cases, status, choice.quick, &file)?;
        let page = Page { choice, summary: &summary };
        let tables = page.write(&runner, &folder, left_out)?;
        recorder.write_into(&folder)?;
        Ok(end(&tables, &summary, &folder, self.collect))
    }

    /// The command that runs the same cases in the same folder.
    fn command(&self, asked: &Asked, arguments: &Arguments) -> Vec<String> {
        let name = self.experiment.iter().map(|name| name.display().to_string());
        let mut words: Vec<String> = ["kerrlight".to_owned(), "compare".to_owned()].into();
        words.extend(name);
        words.extend(["-o".to_owned(), asked.folder.display().to_string()]);
        let mut add = |option: &str, value: String| words.extend([option.to_owned(), value]);
        let Choice { seeds, only, set, quick, .. } = &self.choice;
        seeds.iter().for_each(|seeds| add("--seeds", seeds.to_string()));
        only.iter().for_each(|only| add("--only", only.clone()));
        set.iter().for_each(|set| add("--set", set.clone()));
        arguments.threads.iter().for_each(|threads| add("--threads", threads.to_string()));
        arguments.memory.iter().for_each(|memory| add("--memory", memory.to_string()));
        words.extend(quick.then(|| "--quick".to_owned()));
        words
    }

    /// Returns what is asked for: by an experiment, or by a folder in which one was begun.
    fn asked(&self, name: &Path, program: &Program) -> anyhow::Result<Asked> {
        let begun = if name.is_dir() { Plan::load(name)? } else { None };
        let (plan, text, folder) = match begun {
            Some((plan, text)) => {
                // Nothing changes what a folder was begun with.
                if self.choice != Choice::default() {
                    bail!(
                        "{} has its cases: --seeds, --only, --set and --quick go with an experiment",
                        name.display()
                    );
                }
                match &self.output {
                    Some(other) => (plan.again(), text, other.clone()),
                    None => (plan, text, name.to_owned()),
                }
            }
            None => {
                let (source, text) = Source::find(name)?;
                (Plan::new(&source, &self.choice)?, text, self.folder_for(name))
            }
        };
        let experiment = Experiment::parse(&text).with_context(|| name.display().to_string())?;
        let (source, choice) = (plan.base.clone(), plan.choice(&program.registry));
        Ok(Asked { plan, text, experiment, source, choice, folder })
    }

    fn folder_for(&self, name: &Path) -> PathBuf {
        let stem =
            name.file_stem().map_or("compare".into(), |stem| stem.to_string_lossy().into_owned());
        self.output.clone().unwrap_or_else(|| PathBuf::from(format!("kerrlight-{stem}")))
    }

    /// Enters the folder: new or resumed. A report takes no lock.
    fn enter(&self, asked: &Asked) -> anyhow::Result<Option<Lock>> {
        let folder = &asked.folder;
        let begun = Plan::load(folder)?;
        if self.collect {
            let Some(_) = begun else { return Err(status::no_comparison(folder)) };
            return Ok(None);
        }
        let lock = if self.resume {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make the folder {}", folder.display()))?;
            Lock::take(folder, plan::BUSY, Duration::ZERO)?
        } else {
            Lock::of_new(folder, plan::BUSY, plan::FILE, |_| false)?
        };
        asked.plan.write(folder, &asked.text)?;
        Ok(Some(lock))
    }
}

/// Cases that are asked for, and the folder of their results.
struct Asked {
    plan: Plan,
    text: String,
    experiment: Experiment,
    source: Source,
    choice: Choice,
    folder: PathBuf,
}

/// Runs one case of a folder in which others may run others.
fn run_one(
    id: &str,
    asked: &Asked,
    arguments: &Arguments,
    program: &Program,
) -> anyhow::Result<Answer> {
    let Asked { plan, text, experiment, source, choice, folder } = asked;
    let case = cases::find(experiment, source, choice, id)?;
    ran::check_data(std::slice::from_ref(&case))?;
    let lock = plan::join(plan, text, folder)?;
    let draws = experiment.samples(choice.quick);
    let runner = Runner::new(folder, arguments, program, draws, Some(lock))?;
    one::run(&case, &runner, folder)
}

/// The chosen cases, and those that an earlier run of the same folder has done beside them.
fn with_known(chosen: Vec<Case>, all: Vec<Case>, runner: &Runner<'_>) -> Vec<Case> {
    let wanted: HashSet<String> = chosen.iter().map(Case::slug).collect();
    // The look for a folder comes first: most cases of a large experiment have no results to read.
    let is_shown = |case: &Case| {
        wanted.contains(&case.slug())
            || (runner.run_of(case).is_dir() && matches!(runner.known(case), Status::Done(_)))
    };
    let mut cases: Vec<Case> = all.into_par_iter().filter(is_shown).collect();
    let known: HashSet<String> = cases.iter().map(Case::slug).collect();
    // Seeds beyond the experiment's own are among the chosen cases only.
    cases.extend(chosen.into_iter().filter(|case| !known.contains(&case.slug())));
    cases
}

/// Runs what is not done yet, until a signal; why which of them failed.
fn run(
    cases: &[Case],
    runner: &Runner<'_>,
    folder: &Path,
) -> anyhow::Result<HashMap<String, String>> {
    let keeper = SignalGuard::saving("stopping after the fit's step; a second signal ends at once");
    let is_to_do = |case: &&Case| !matches!(runner.known(case), Status::Done(_));
    let is_wrong = |case: &&Case| case.early_error().is_some();
    let (wrong, open): (Vec<&Case>, Vec<&Case>) =
        cases.par_iter().filter(is_to_do).partition(is_wrong);
    eprintln!("{} cases, {} of them to be run", cases.len(), open.len());
    for case in wrong {
        eprintln!("failed: {}: {}", case.name(), case.early_error().unwrap_or_default());
    }
    let bar = progress::counting(open.len() as u64, "case");
    let mut failed = HashMap::new();
    for case in open {
        if keeper.stopped() {
            break;
        }
        bar.set_message(plain::line(&case.name()).into_owned());
        bar.tick();
        let status = runner.run(case, &keeper);
        bar.inc(u64::from(status != Status::Open));
        session::reached(&bar);
        if let Err(error) = one::keep_failure(folder, case, &status) {
            bar.suspend(|| eprintln!("warning: {}", plain::reasons(&error)));
        }
        if let Status::Failed(why) = status {
            bar.suspend(|| eprintln!("failed: {}: {why}", case.name()));
            failed.insert(case.slug(), why);
        }
    }
    bar.finish_and_clear();
    Ok(failed)
}

/// The tables, how many cases are done and which of them are best and worst, and where to look.
fn end(tables: &str, summary: &Summary, folder: &Path, is_early: bool) -> Answer {
    let files = page::files(folder);
    let failed = summary.failed().map(|(case, why)| json!({"name": case.name(), "error": why}));
    let answer = Answer::text(format!("{tables}{}\n{}\n", summary.worth(), files[0].display()))
        .with("folder", folder.display().to_string())
        .files(files.iter().map(PathBuf::as_path))
        .with("cases", summary.all.len())
        .with("done", summary.done().count())
        .with("failed", failed.collect::<Vec<_>>())
        .with_all(summary.extremes().map_or(Value::Null, |extremes| extremes.json()));
    match failure(summary, folder).filter(|_| !is_early) {
        Some(error) => answer.failing(error),
        None => answer,
    }
}

/// Returns the error of a command whose cases are not done or failed.
fn failure(summary: &Summary, folder: &Path) -> Option<anyhow::Error> {
    if summary.open() > 0 {
        let (open, folder) = (summary.open(), plain::word(folder));
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
