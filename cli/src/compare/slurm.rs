//! A comparison as a job array of Slurm, whose tasks share the folder.

use super::{Asked, plan};
use crate::answer::Answer;
use crate::output::Output;
use crate::program::Program;
use anyhow::{Context, bail};
use clap::Args;
use std::path::Path;
use std::process::Command;

/// What the batch system is told.
#[derive(Debug, Args)]
pub struct Slurm {
    /// Submit a job array to Slurm that runs the cases
    #[arg(long, conflicts_with_all = ["resume", "share", "status", "collect", "list"])]
    slurm: bool,
    /// Tasks of the array
    #[arg(long, value_name = "N", default_value_t = 4, requires = "slurm", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    array: u32,
    /// Time limit of a task, e.g. 12:00:00
    #[arg(long, value_name = "TIME", requires = "slurm")]
    time: Option<String>,
    /// Slurm's partition
    #[arg(long, value_name = "NAME", requires = "slurm")]
    partition: Option<String>,
    /// Print the scripts and stop
    #[arg(long, requires = "slurm")]
    dry_run: bool,
}

/// What a task may take.
pub type Limits = (Option<u16>, Option<u64>);

/// Seconds before its time limit at which a task is told to stop, to save what it has.
const NOTICE_S: u32 = 120;
/// What a task takes beside its fit, MiB.
const OWN_MIB: u64 = 256;

impl Slurm {
    /// Whether it is asked for.
    pub fn is_wanted(&self) -> bool {
        self.slurm
    }

    /// Begins the folder, unless it is begun, and submits the scripts; or prints them.
    pub fn run(&self, asked: &Asked, program: &Program, limits: Limits) -> anyhow::Result<Answer> {
        let scripts = self.scripts(&asked.folder, program, limits)?;
        if self.dry_run {
            let text = scripts.join("\n");
            return Ok(Answer::text(text).with("scripts", scripts.to_vec()));
        }
        drop(plan::join(&asked.plan, &asked.text, &asked.folder)?);
        self.submit(&asked.folder, &scripts)
    }

    /// The scripts of the array and of the report.
    fn scripts(
        &self,
        folder: &Path,
        program: &Program,
        limits: Limits,
    ) -> anyhow::Result<[String; 2]> {
        self.check()?;
        let folder = std::path::absolute(folder).context("the folder of the results")?;
        if folder.to_string_lossy().contains(['"', '%', '\n']) {
            bail!("{} is not allowed: Slurm reads \" and % in names", folder.display());
        }
        let array = format!("#SBATCH --array=1-{}\n", self.array);
        let all = [(array.as_str(), "%A_%a", "--share=leave"), ("", "%j", "--share")];
        let script = |(array, name, share): (&str, &str, &str)| -> anyhow::Result<String> {
            let head = self.head(&folder, name, limits);
            let command = command(program, &folder, share, limits)?;
            Ok(format!("#!/bin/sh\n{array}{head}exec {command}\n"))
        };
        let [tasks, report] = all.map(script);
        Ok([tasks?, report?])
    }

    fn head(&self, folder: &Path, name: &str, (threads, memory): Limits) -> String {
        let mib = memory.map(|bytes| bytes.div_ceil(1 << 20) + OWN_MIB);
        let options = [
            Some("job-name=kerrlight".to_owned()),
            Some(format!("cpus-per-task={}", threads.unwrap_or(1))),
            mib.map(|mib| format!("mem={mib}M")),
            self.time.as_ref().map(|time| format!("time={time}")),
            self.partition.as_ref().map(|name| format!("partition={name}")),
            Some(format!("signal=B:TERM@{NOTICE_S}")),
            Some(format!("output=\"{}/slurm-{name}.txt\"", folder.display())),
        ];
        options.into_iter().flatten().map(|option| format!("#SBATCH --{option}\n")).collect()
    }

    /// Refuses what a script cannot hold.
    fn check(&self) -> anyhow::Result<()> {
        let allowed = |text: &str, others: &str, least: fn(char) -> bool| {
            !text.is_empty() && text.chars().all(|c| least(c) || others.contains(c))
        };
        if let Some(time) = &self.time
            && !allowed(time, ":-", |c| c.is_ascii_digit())
        {
            bail!("--time {time:?} is not allowed: minutes, H:MM:SS or D-HH:MM:SS");
        }
        if let Some(name) = &self.partition
            && !allowed(name, "-_.,", |c| c.is_ascii_alphanumeric())
        {
            bail!("--partition {name:?} is not allowed: letters, digits and -_.,");
        }
        Ok(())
    }

    /// Writes and submits the scripts of a folder that is begun.
    fn submit(&self, folder: &Path, scripts: &[String; 2]) -> anyhow::Result<Answer> {
        let paths = ["slurm.sh", "slurm-report.sh"].map(|name| folder.join(name));
        for (path, script) in paths.iter().zip(scripts) {
            Output::new(path, "sh")?.write(script.as_bytes())?;
        }
        let tasks = sbatch(&[], &paths[0])?;
        let report = sbatch(&[format!("--dependency=afterany:{tasks}")], &paths[1])?;
        let shown = folder.display();
        let text = format!(
            "{} tasks are job {tasks}, the report is job {report}; see kerrlight compare {shown} --status\n{shown}\n",
            self.array
        );
        Ok(Answer::text(text)
            .with("folder", shown.to_string())
            .with("job", tasks)
            .with("report_job", report)
            .files(paths.iter().map(|path| path.as_path())))
    }
}

/// The command of a task, as a shell reads it.
fn command(
    program: &Program,
    folder: &Path,
    share: &str,
    (threads, memory): Limits,
) -> anyhow::Result<String> {
    let again = program.again()?;
    let mut words: Vec<String> =
        std::iter::once(again.get_program()).chain(again.get_args()).map(quoted).collect();
    words.extend(["compare".to_owned(), quoted(folder.as_os_str()), share.to_owned()]);
    words.push(format!("--threads {}", threads.unwrap_or(1)));
    if let Some(memory) = memory {
        words.push(format!("--memory {memory}"));
    }
    Ok(words.join(" "))
}

fn quoted(word: &std::ffi::OsStr) -> String {
    format!("'{}'", word.to_string_lossy().replace('\'', "'\\''"))
}

/// Submits a script; the number of the job.
fn sbatch(options: &[String], script: &Path) -> anyhow::Result<String> {
    let mut command = Command::new("sbatch");
    let output = command.arg("--parsable").args(options).arg(script).output();
    let output = output.context("cannot run sbatch (--dry-run prints the scripts)")?;
    if !output.status.success() {
        bail!("sbatch: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    // On several clusters the name of one follows.
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    Ok(text.split(';').next().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slurm(time: &str, partition: &str) -> Slurm {
        let (time, partition) = (Some(time.to_owned()), Some(partition.to_owned()));
        Slurm { slurm: true, array: 12, time, partition, dry_run: true }
    }

    #[test]
    fn exact_scripts_hold_what_was_asked() {
        let slurm = slurm("1-12:00:00", "gpu,long");
        let limits = (Some(4), Some(1 << 30));
        let [tasks, report] = slurm.scripts(Path::new("/a/it's"), &Program::new(), limits).unwrap();
        assert!(tasks.starts_with("#!/bin/sh\n#SBATCH --array=1-12\n"), "{tasks}");
        assert!(!report.contains("--array") && report.contains("--share --threads 4"), "{report}");
        for line in ["cpus-per-task=4", "mem=1280M", "time=1-12:00:00", "partition=gpu,long"] {
            assert!(tasks.contains(&format!("#SBATCH --{line}\n")), "{tasks}");
        }
        let ending = r"compare '/a/it'\''s' --share=leave --threads 4 --memory 1073741824";
        assert!(tasks.trim_end().ends_with(ending), "{tasks}");
    }

    #[test]
    fn wrong_times_and_partitions_are_named() {
        let fails = |slurm: Slurm| slurm.check().unwrap_err().to_string();
        assert!(fails(slurm("soon", "a")).contains("--time \"soon\" is not allowed"));
        assert!(fails(slurm("10", "a b")).contains("--partition \"a b\" is not allowed"));
    }
}
