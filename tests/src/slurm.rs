//! `kerrlight compare --slurm` with a Slurm of one node.

use crate::shared_folder::{claims, experiment};
use crate::support::{fail, root, succeed};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// A Slurm that ends with the test.
struct Slurm(PathBuf);

impl Slurm {
    /// Nothing where it is not installed.
    fn start(folder: &Path) -> Option<Self> {
        let at = folder.join("slurm");
        let output = script("start.sh", &at);
        let said = String::from_utf8_lossy(&output.stderr);
        if output.status.code() == Some(77) {
            eprintln!("SLURM IS NOT TESTED: {said}");
            return None;
        }
        let slurm = Slurm(at);
        assert!(output.status.success(), "{said}");
        Some(slurm)
    }

    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.0.join("slurm.conf"));
        command
    }

    fn says(&self, program: &str, words: &[&str]) -> String {
        let output = self.command(Path::new(program)).args(words).output().unwrap();
        assert!(output.status.success(), "{program}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        script("stop.sh", &self.0);
    }
}

fn script(name: &str, at: &Path) -> Output {
    let path = root().join("tests/slurm").join(name);
    Command::new("sh").arg(path).arg(at).output().unwrap()
}

fn wait(what: &str, limit: Duration, mut is_so: impl FnMut() -> bool) {
    let clock = Instant::now();
    while !is_so() {
        assert!(clock.elapsed() < limit, "{what} takes too long");
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// Three tasks, of which one is cancelled in the middle: all cases are done, each once.
#[test]
#[ignore = "long"]
fn exact_a_cancelled_task_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let Some(slurm) = Slurm::start(at) else { return };
    experiment(at, 24, 10);
    let mut submit = slurm.command(crate::support::binary());
    submit.current_dir(at).args(["compare", "seeds.toml", "-o", "out", "--json"]);
    let output = submit.args(["--slurm", "--array", "3", "--time", "60"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let job = answer["job"].as_str().unwrap();
    let out = at.join("out");
    wait("the first cases", Duration::from_secs(300), || claims(&out, ".done") >= 3);
    let states = slurm.says("squeue", &["-h", "-r", "-j", job, "-o", "%K %t"]);
    assert_eq!(states.lines().filter(|line| line.ends_with(" R")).count(), 3, "{states}");
    slurm.says("scancel", &[&format!("{job}_2")]);
    wait("the report", Duration::from_secs(900), || slurm.says("squeue", &["-h"]).is_empty());
    assert_eq!(claims(&out, ".done"), 24);
    // What the cancelled task had is taken up, and nothing else is taken twice.
    assert!(claims(&out, ".1") <= 1);
    assert_eq!(claims(&out, ".failed"), 0);
    let results = std::fs::read(out.join("results.json")).unwrap();
    let results: Value = serde_json::from_slice(&results).unwrap();
    let all = results["cases"].as_array().unwrap();
    assert_eq!(all.iter().filter(|case| case["status"] == "done").count(), 24);
    assert!(out.join("report.html").is_file());
    let pids = ["munged", "slurmctld", "slurmd"].map(|name| slurm.0.join(format!("{name}.pid")));
    let pids = pids.map(|path| std::fs::read_to_string(path).unwrap().trim().to_owned());
    drop(slurm);
    for pid in pids {
        // One that is waited for by nobody has ended as well.
        let state = Command::new("ps").args(["-o", "stat=", "-p", &pid]).output().unwrap().stdout;
        assert!(state.is_empty() || state.starts_with(b"Z"), "{pid} is left");
    }
}

/// Scripts are printed without a Slurm, and nothing is written.
#[test]
fn exact_scripts_are_printed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 2, 2);
    let words = ["compare", "seeds.toml", "-o", "out", "--slurm", "--dry-run", "--array", "7"];
    let text = succeed(at, &words);
    assert!(text.contains("#SBATCH --array=1-7\n") && text.contains("--share=leave"), "{text}");
    assert!(!at.join("out").exists());
    let said = fail(at, &[&words[..], &["--time", "soon"]].concat());
    assert!(said.contains("--time \"soon\" is not allowed"), "{said}");
    assert!(fail(at, &["compare", "seeds.toml", "--array", "7"]).contains("--slurm"));
}
