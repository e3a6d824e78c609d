//! One case after the other, each a process of its own: what one does wrong, or takes of memory, is its own.

use super::cases::{Case, Status};
use super::labels::RESULTS;
use crate::Arguments;
use crate::checksum::is_whole;
use crate::file_sums::FileSums;
use crate::fit::{Inputs, SETTINGS, from_folder, posterior};
use crate::interrupt::SignalGuard;
use crate::lock::Lock;
use crate::output::{self, Output};
use crate::program::Program;
use crate::threads;
use anyhow::Context;
use rayon::prelude::*;
use serde_json::Value;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::time::Duration;

/// The folders of the cases.
pub struct Runner<'a> {
    folder: PathBuf,
    arguments: &'a Arguments,
    program: &'a Program,
    samples: Option<u32>,
    _lock: Option<Lock>,
}

/// Cases that are looked at together.
pub const TOGETHER: usize = 1024;

/// The folder of the runs in that of the results.
pub const CASES: &str = "cases";

impl<'a> Runner<'a> {
    /// Runs in `cases` of this folder, whose lock is held by those who run any.
    pub fn new(
        folder: &Path,
        arguments: &'a Arguments,
        program: &'a Program,
        samples: Option<u32>,
        lock: Option<Lock>,
    ) -> anyhow::Result<Self> {
        let folder = folder.join(CASES);
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        Ok(Self { folder, arguments, program, samples, _lock: lock })
    }

    /// The run's folder of a case.
    pub fn run_of(&self, case: &Case) -> PathBuf {
        self.folder.join(case.slug())
    }

    /// Returns the status of a case without running it.
    pub fn known(&self, case: &Case) -> Status {
        match finished(&self.run_of(case), self.samples) {
            Some(results) => Status::Done(results),
            None => match case.early_error() {
                Some(error) => Status::Failed(error.to_owned()),
                None => Status::Open,
            },
        }
    }

    /// Refuses cases that have read files which are no longer the same: others would be compared with them.
    pub fn check_inputs(&self, cases: &[Case]) -> anyhow::Result<()> {
        let mut sums = FileSums::default();
        let read = |case: &Case| {
            let run = self.run_of(case);
            let inputs = Inputs::load(&run).ok()?;
            (inputs.version == env!("CARGO_PKG_VERSION")).then_some((run, inputs))
        };
        for some in cases.chunks(TOGETHER) {
            let inputs: Vec<_> = some.par_iter().filter_map(read).collect();
            inputs.iter().try_for_each(|(run, inputs)| inputs.check_files(run, &mut sums))?;
        }
        Ok(())
    }

    /// Runs a case to its end, from where it is; `Open` if a signal has stopped it.
    pub fn run(&self, case: &Case, keeper: &SignalGuard) -> Status {
        let run = &self.run_of(case);
        match self.known(case) {
            Status::Open => {}
            known => return known,
        }
        // With many combinations, not all settings have been checked before.
        if let Some(error) = case.error() {
            return Status::Failed(error.to_owned());
        }
        match self.child(case, run, keeper) {
            Ok((status, _)) if status.success() => match self.known(case) {
                Status::Open => Status::Failed("it ended without results".to_owned()),
                known => known,
            },
            // What stops because it is told to has not failed: a signal may reach it before it reaches this process.
            _ if keeper.stopped() => Status::Open,
            Ok((status, _)) if matches!(status.code(), Some(129 | 130 | 143 | 152)) => Status::Open,
            Ok((status, said)) => Status::Failed(failure(status, &said)),
            Err(error) => Status::Failed(crate::plain::reasons(&error)),
        }
    }

    /// The fit in a process of its own, and what it said.
    fn child(
        &self,
        case: &Case,
        run: &Path,
        keeper: &SignalGuard,
    ) -> anyhow::Result<(ExitStatus, String)> {
        let settings = self.folder.join(format!("{}.toml", case.slug()));
        // Paths start from the root: a case is the same bytes in any folder.
        let text = from_folder(&case.settings().unwrap_or_default(), Path::new("/"));
        Output::new(&settings, "toml")?.write(text.as_bytes())?;
        let mut command = self.program.again()?;
        command.args(["fit", "--stop-with-input"]);
        // What another version has finished, or has not come so far as to have settings, is begun anew.
        let is_foreign = results(run).is_some_and(|(results, _)| !is_ours(&results))
            || !Inputs::load(run).is_ok_and(|inputs| inputs.version == env!("CARGO_PKG_VERSION"));
        if run.join("fit.toml").is_file() && !is_foreign {
            command.arg("--resume").arg(run);
        } else {
            clear(run)?;
            command.arg(&settings).arg("-o").arg(run);
        }
        if let Some(samples) = self.samples {
            command.args(["--samples", &samples.to_string()]);
        }
        if let Some(threads) = self.arguments.threads {
            command.args(["--threads", &threads.to_string()]);
        }
        if let Some(memory) = self.arguments.memory {
            command.args(["--memory", &memory.to_string()]);
        }
        let said = said(run);
        let file =
            File::create(&said).with_context(|| format!("cannot write {}", said.display()))?;
        let child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(file).spawn();
        let status = wait(child.map_err(|error| threads::no_process("the fit", &error))?, keeper)?;
        Ok((status, output::read_text(&said).unwrap_or_default()))
    }
}

/// Between the name of a case and a number: a run that was moved aside.
pub const ASIDE: &str = ".old-";

/// Makes room for a run. What another version has begun is moved aside, and told; what was cut off before it had settings goes.
fn clear(run: &Path) -> anyhow::Result<()> {
    if !run.exists() {
        return Ok(());
    }
    let cannot = || format!("cannot clear {}", run.display());
    if !run.join(SETTINGS).exists() {
        return std::fs::remove_dir_all(run).with_context(cannot);
    }
    let aside = |k: u32| PathBuf::from(format!("{}{ASIDE}{k}", run.display()));
    let free = (1..).map(aside).find(|path| !path.exists());
    let free = free.with_context(cannot)?;
    std::fs::rename(run, &free).with_context(cannot)?;
    eprintln!(
        "warning: {} is of another version or damaged: it is {} now",
        run.display(),
        free.display()
    );
    Ok(())
}

/// The end of a fit, whose input is held open until a signal comes: it is closed then, or by the system if this
/// process is killed, and the fit stops.
fn wait(mut child: Child, keeper: &SignalGuard) -> anyhow::Result<ExitStatus> {
    let mut input = child.stdin.take();
    loop {
        if let Some(status) = child.try_wait().context("cannot wait for the fit")? {
            return Ok(status);
        }
        if keeper.stopped() {
            drop(input.take());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns the path of the messages of a run: beside it.
fn said(run: &Path) -> PathBuf {
    let mut name = run.as_os_str().to_owned();
    name.push(".txt");
    name.into()
}

/// Results of a run of this version that is whole, with what follows from its draws where so many are wanted.
pub fn finished(run: &Path, samples: Option<u32>) -> Option<Value> {
    let (mut results, is_whole_file) = results(run)?;
    // The page is written after results.json: without it the fit was cut short.
    if !is_whole_file || !is_ours(&results) || !run.join("report.html").exists() {
        return None;
    }
    let Some(samples) = samples else { return Some(results) };
    let text = output::read_text(&run.join(posterior::FOLDER).join(posterior::NUMBERS)).ok()?;
    let numbers: Value = serde_json::from_str(&text).ok()?;
    if !is_whole(&text) || numbers["samples"] != samples {
        return None;
    }
    for (key, ..) in RESULTS {
        if let Some(number) = numbers.get(key) {
            results[key] = number.clone();
        }
    }
    Some(results)
}

/// Returns the results of a run, if it has come so far, and whether they are as they were written.
fn results(run: &Path) -> Option<(Value, bool)> {
    let text = output::read_text(&run.join("results.json")).ok()?;
    Some((serde_json::from_str(&text).ok()?, is_whole(&text)))
}

/// Returns whether results are of this version of the program: another may find something else.
fn is_ours(results: &Value) -> bool {
    results["version"] == env!("CARGO_PKG_VERSION")
}

/// Returns the last words of a process that did not succeed.
fn failure(status: ExitStatus, said: &str) -> String {
    // The error is the last line; notes and progress come before it.
    let last = said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        if let Some(signal) = status.signal() {
            return format!("killed by signal {signal}");
        }
    }
    let last = last.strip_prefix("error: ").unwrap_or(last);
    if last.is_empty() { format!("{status}") } else { last.to_owned() }
}
