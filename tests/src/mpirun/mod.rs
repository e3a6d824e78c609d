//! `kerrlight` as the ranks of one job of MPI.

mod accuracy;
mod compare;
mod fits;
mod full_disk;
mod pictures;

use crate::support::{binary, succeed};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn start_with(at: &Path, ranks: usize, words: &[impl AsRef<OsStr>]) -> Option<Child> {
    if Command::new("mpirun").arg("--version").output().is_err() {
        eprintln!("MPI IS NOT TESTED: there is no mpirun");
        return None;
    }
    let mut command = Command::new("mpirun");
    command.current_dir(at).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.args(["--oversubscribe", "--allow-run-as-root", "-n", &ranks.to_string()]);
    command.arg(binary()).args(words);
    Some(command.spawn().unwrap())
}

/// What a job says that must succeed; nothing where there is no `mpirun`.
fn says(at: &Path, ranks: usize, words: &[impl AsRef<OsStr>]) -> Option<String> {
    let said = start_with(at, ranks, words)?.wait_with_output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    Some(String::from_utf8(said.stdout).unwrap())
}

/// Ranks of a job: processes with the program's name below that of `mpirun`.
fn ranks_of(job: &Child) -> Vec<String> {
    let words = ["-o", "pid=,args=", "--ppid", &job.id().to_string()];
    let output = Command::new("ps").args(words).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let ours = text.lines().filter(|line| line.contains("kerrlight"));
    ours.filter_map(|line| Some(line.split_whitespace().next()?.to_owned())).collect()
}

/// Names in a folder.
fn names(at: &Path) -> Vec<String> {
    let mut all: Vec<String> = std::fs::read_dir(at)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    all.sort();
    all
}

/// Jobs with a killed rank, at most.
const JOBS: usize = 40;

/// Kills a rank of the jobs that `start` starts, each a little later than in the one before, until one ends before that or is
/// left alone; how many were killed. A job ends within 10 s of that, and mpirun says why.
fn kill_ranks(start: impl Fn(usize) -> Option<Child>) -> usize {
    let after = |k: usize| Duration::from_millis(200 + 70 * k as u64);
    let kills = (0..JOBS)
        .take_while(|k| start(2 + k % 4).is_some_and(|job| ends_by_kill(job, *k, after(*k))));
    let kills = kills.count();
    println!("{kills} jobs with a killed rank");
    if kills == JOBS {
        let said = start(3).unwrap().wait_with_output().unwrap();
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    }
    kills
}

/// Kills rank k of a job so long after its beginning, which ends within seconds; whether the job had not been finished
/// before.
fn ends_by_kill(mut job: Child, k: usize, after: Duration) -> bool {
    std::thread::sleep(after);
    let mut ranks = ranks_of(&job);
    while ranks.is_empty() && job.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
        ranks = ranks_of(&job);
    }
    if let Some(rank) = ranks.get(k % ranks.len().max(1)) {
        Command::new("kill").args(["-9", rank]).status().unwrap();
    }
    let clock = Instant::now();
    while job.try_wait().unwrap().is_none() {
        assert!(clock.elapsed() < Duration::from_secs(10), "the job goes on");
        std::thread::sleep(Duration::from_millis(20));
    }
    let said = job.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&said.stderr);
    // A rank that is killed before it has begun to be kerrlight is said to have ended by itself.
    let told = text.contains("mpirun") || text.contains("the job has been aborted");
    assert!(said.status.success() || told, "a message: {text}");
    !said.status.success()
}

/// A wrong scene is told once, and a rank that is told to be alone is.
#[test]
#[ignore = "long"]
fn wrong_scenes_of_mpirun_are_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let words = ["render", "-o", "out.exr", "--set", "hole.spin=2"];
    let Some(job) = start_with(at, 4, &words) else { return };
    let said = job.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&said.stderr);
    assert!(!said.status.success());
    assert_eq!(text.matches("is not allowed").count(), 1, "{text}");
    let alone = Command::new(binary())
        .current_dir(at)
        .args(["render", "-o", "out.exr", "--set", "screen.width=16", "--set", "screen.height=16"])
        .envs([("KERRLIGHT_ALONE", "1"), ("PMI_RANK", "1"), ("PMI_SIZE", "2")])
        .output()
        .unwrap();
    assert!(alone.status.success() && !alone.stdout.is_empty());
    // Verbs that ranks do not share are each rank's own.
    let table = ["critical-curve", "--spin", "0.5", "--inclination", "60", "--points", "9"];
    let rank = [("PMI_RANK", "1"), ("PMI_SIZE", "2")];
    let own = Command::new(binary()).args(table).envs(rank).output().unwrap();
    assert_eq!(String::from_utf8(own.stdout).unwrap(), succeed(at, &table));
}
