//! `kerrlight compare` as the ranks of one job of MPI.

use crate::shared_folder::{claims, experiment};
use crate::support::{binary, succeed};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// So many ranks on this machine; nothing where there is no `mpirun`.
fn start(at: &Path, ranks: usize, output: &str) -> Option<Child> {
    if Command::new("mpirun").arg("--version").output().is_err() {
        eprintln!("MPI IS NOT TESTED: there is no mpirun");
        return None;
    }
    let mut command = Command::new("mpirun");
    command.current_dir(at).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.args(["--oversubscribe", "--allow-run-as-root", "-n", &ranks.to_string()]);
    command.arg(binary()).args(["compare", "seeds.toml", "-o", output, "--threads", "1"]);
    Some(command.spawn().unwrap())
}

fn same(at: &Path, one: &str, other: &str) {
    for case in std::fs::read_dir(at.join(one).join("cases")).unwrap().flatten() {
        let other = at.join(other).join("cases").join(case.file_name());
        for name in ["fit.toml", "checkpoint.safetensors", "volume.npz", "movie.npz"] {
            let [a, b] = [case.path(), other.clone()].map(|run| run.join(name));
            assert!(
                !case.path().is_dir() || std::fs::read(a).unwrap() == std::fs::read(b).unwrap()
            );
        }
    }
}

/// Any number of ranks finds what one process alone finds, and the first one speaks.
#[test]
#[ignore = "long"]
fn exact_ranks_find_what_one_process_finds() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 8, 10);
    succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    for ranks in [1, 2, 4, 7] {
        let out = format!("out{ranks}");
        let Some(job) = start(at, ranks, &out) else { return };
        let said = job.wait_with_output().unwrap();
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
        let text = String::from_utf8_lossy(&said.stdout);
        assert_eq!(text.matches("8 of 8 cases done").count(), 1, "{text}");
        same(at, "alone", &out);
    }
}

/// Ranks of a job: processes with the program's name below that of `mpirun`.
fn ranks_of(job: &Child) -> Vec<String> {
    let words = ["-o", "pid=,args=", "--ppid", &job.id().to_string()];
    let output = Command::new("ps").args(words).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let ours = text.lines().filter(|line| line.contains("kerrlight"));
    ours.filter_map(|line| Some(line.split_whitespace().next()?.to_owned())).collect()
}

/// A rank that is killed ends the job within 10 s; another number of ranks finishes the folder, to the same bytes.
#[test]
#[ignore = "long"]
fn exact_a_killed_rank_ends_the_job_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 10, 200);
    succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    let mut kills = 0;
    for moment in 0..20 {
        let Some(mut job) = start(at, 2 + moment % 4, "out") else { return };
        std::thread::sleep(Duration::from_millis(300 + 350 * moment as u64));
        let ranks = ranks_of(&job);
        let Some(rank) = ranks.get(moment % ranks.len().max(1)) else { continue };
        Command::new("kill").args(["-9", rank]).status().unwrap();
        let clock = Instant::now();
        while job.try_wait().unwrap().is_none() {
            assert!(clock.elapsed() < Duration::from_secs(10), "the job goes on");
            std::thread::sleep(Duration::from_millis(20));
        }
        let said = job.wait_with_output().unwrap();
        if !said.status.success() {
            assert!(String::from_utf8_lossy(&said.stderr).contains("mpirun"), "a message");
            kills += 1;
        }
    }
    assert!(kills > 3, "{kills}");
    let said = start(at, 3, "out").unwrap().wait_with_output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    assert_eq!(claims(&at.join("out"), ".done"), 10);
    same(at, "alone", "out");
}
