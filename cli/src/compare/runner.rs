//! One case after the other, each a process of its own: what one does wrong, or takes of memory, is its own.

use super::cases::Case;
use crate::output::{self, Output};
use anyhow::Context;
use serde_json::Value;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

/// How a case ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Status {
    /// With these results.
    Done(Value),
    /// With this message.
    Failed(String),
    /// It has not been run, or was interrupted.
    Open,
}

/// The folders of the cases.
pub struct Runner {
    folder: PathBuf,
    threads: Option<usize>,
}

impl Runner {
    /// In `cases` of this folder.
    pub fn new(folder: &Path, threads: Option<usize>) -> anyhow::Result<Self> {
        let folder = folder.join("cases");
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        Ok(Self { folder, threads })
    }

    /// The run's folder of a case.
    pub fn run_of(&self, case: &Case) -> PathBuf {
        self.folder.join(&case.slug)
    }

    /// What is known of a case without running it.
    pub fn known(&self, case: &Case) -> Status {
        if let Err(error) = &case.settings {
            return Status::Failed(error.clone());
        }
        let run = self.run_of(case);
        match results(&run) {
            Some(results) if is_ours(&results) && run.join("report.html").exists() => {
                Status::Done(results)
            }
            _ => Status::Open,
        }
    }

    /// Runs a case to its end, from where it is; `Open` if it was interrupted.
    pub fn run(&self, case: &Case) -> Status {
        match self.known(case) {
            Status::Open => {}
            known => return known,
        }
        match self.child(case) {
            Ok((status, _)) if status.success() => match self.known(case) {
                Status::Open => Status::Open,
                known => known,
            },
            Ok((status, said)) => Status::Failed(failure(status, &said)),
            Err(error) => Status::Failed(format!("{error:#}")),
        }
    }

    /// The fit in a process of its own, and what it said.
    fn child(&self, case: &Case) -> anyhow::Result<(ExitStatus, String)> {
        let run = self.run_of(case);
        let settings = self.folder.join(format!("{}.toml", case.slug));
        let text = case.settings.as_deref().unwrap_or_default();
        Output::new(&settings, "toml")?.write(text.as_bytes())?;
        let program = std::env::current_exe().context("cannot find the program itself")?;
        let mut command = Command::new(program);
        command.arg("fit");
        // What another version has finished, or has not come so far as to have settings, is begun anew.
        let is_foreign = results(&run).is_some_and(|results| !is_ours(&results));
        if run.join("fit.toml").is_file() && !is_foreign {
            command.arg("--resume").arg(&run);
        } else {
            if run.exists() {
                std::fs::remove_dir_all(&run)
                    .with_context(|| format!("cannot clear {}", run.display()))?;
            }
            command.arg(&settings).arg("-o").arg(&run);
        }
        if let Some(threads) = self.threads {
            command.args(["--threads", &threads.to_string()]);
        }
        let said = self.folder.join(format!("{}.txt", case.slug));
        let file =
            File::create(&said).with_context(|| format!("cannot write {}", said.display()))?;
        let status = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(file)
            .status()
            .context("cannot start the fit")?;
        Ok((status, output::read_text(&said).unwrap_or_default()))
    }
}

/// What a run has found, if it has come so far.
fn results(run: &Path) -> Option<Value> {
    let text = output::read_text(&run.join("results.json")).ok()?;
    serde_json::from_str(&text).ok()
}

/// Whether results are of this version of the program: another may find something else.
fn is_ours(results: &Value) -> bool {
    results["version"] == env!("CARGO_PKG_VERSION")
}

/// What a process that did not succeed has said at last.
fn failure(status: ExitStatus, said: &str) -> String {
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
