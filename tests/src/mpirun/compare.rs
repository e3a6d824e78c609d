//! Cases of an experiment, shared by ranks.

use super::{ends_by_kill, start_with};
use crate::shared_folder::{claims, experiment};
use crate::support::succeed;
use std::path::Path;
use std::process::Child;
use std::time::Instant;

/// So many ranks on this machine; nothing where there is no `mpirun`.
fn start(at: &Path, ranks: usize, output: &str) -> Option<Child> {
    start_with(at, ranks, &["compare", "seeds.toml", "-o", output, "--threads", "1"])
}

/// Whether all cases of two folders have the same bytes.
pub fn same(at: &Path, one: &str, other: &str) {
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

/// Of 20 jobs of 2 to 5 ranks, each of which goes on where the one before was killed, a rank is killed at any moment between
/// the first and the last of a job that is left alone. Each ends within 10 s, and the next ones finish the folder, to the
/// same bytes.
#[test]
#[ignore = "long"]
fn exact_a_killed_rank_ends_the_job_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 10, 200);
    succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    let clock = Instant::now();
    let Some(job) = start(at, 4, "out0") else { return };
    assert!(job.wait_with_output().unwrap().status.success());
    let (whole, mut kills, mut finished) = (clock.elapsed(), 0, 0);
    let check = |output: &str| {
        assert_eq!(claims(&at.join(output), ".done"), 10);
        same(at, "alone", output);
    };
    check("out0");
    let mut started = 0;
    while kills < 20 {
        assert!(started < 200, "{kills} kills in {started} jobs");
        let job = start(at, 2 + started % 4, &format!("out{}", finished + 1)).unwrap();
        // Parts of the golden ratio lie everywhere.
        let moment = whole.mul_f64((0.618_034 * (started + 1) as f64).fract());
        if ends_by_kill(job, started, moment) {
            kills += 1;
        } else {
            // It was done before: a new folder for the next.
            finished += 1;
            check(&format!("out{finished}"));
        }
        started += 1;
    }
    println!("{kills} kills in {started} jobs, {finished} folders finished in between");
    let last = format!("out{}", finished + 1);
    let said = start(at, 3, &last).unwrap().wait_with_output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    check(&last);
}
