//! Steps of one fit and draws of its posterior, shared by ranks.

use super::{kill_ranks, names, says, start_with};
use crate::support::{binary, root, succeed};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Draws are those of one process, whoever draws them, also right after a fit.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_draw_what_one_process_draws() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("fit.toml"), crate::posterior::settings()).unwrap();
    let kind = ["--set", "representation=linear-grid", "--set", "representation.nodes=20"];
    succeed(at, &[&["fit", "fit.toml", "-o", "alone", "--samples", "6"][..], &kind].concat());
    let same = |other: &str| {
        let [a, b] = ["alone", other].map(|run| at.join(run).join("posterior"));
        assert_eq!(names(&a), names(&b), "{other}");
        // Pages and records have times.
        let timeless = |name: &String| !name.ends_with("html") && name != "record.json";
        for name in names(&a).into_iter().filter(timeless) {
            assert!(
                std::fs::read(a.join(&name)).unwrap() == std::fs::read(b.join(&name)).unwrap(),
                "{other}/{name}"
            );
        }
    };
    let words = [&["fit", "fit.toml", "-o", "together", "--samples", "6"][..], &kind].concat();
    let Some(text) = says(at, 3, &words) else { return };
    assert_eq!(text.matches("posterior/report.html").count(), 1, "{text}");
    same("together");
    for ranks in [1, 2, 4, 7] {
        std::fs::remove_dir_all(at.join("together/posterior")).unwrap();
        says(at, ranks, &["posterior", "together", "--samples", "6"]).unwrap();
        same("together");
    }
    std::fs::remove_dir_all(at.join("together/posterior")).unwrap();
    let draw = ["posterior", "together", "--samples", "6", "--threads", "1"];
    kill_ranks(|ranks| start_with(at, ranks, &draw));
    same("together");
}

/// The built-in fit, smaller, in parts and with many checkpoints.
pub fn small() -> String {
    let built_in = std::fs::read_to_string(root().join("cli/src/fit/built_in.toml")).unwrap();
    built_in
        .replace("steps = 600", "steps = 150\nparts = 8\ncheckpoint_seconds = 0.1")
        .replace("pixels = 40", "pixels = 20")
        .replace("scans = 64", "scans = 16")
        .replace("rounds = 4", "rounds = 1")
        .replace("nodes = 64", "nodes = 20")
}

/// Any number of ranks takes the steps of one process, also where jobs are killed and others go on.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_take_parts_of_one_fit() {
    fn words(output: &str) -> [&str; 6] {
        ["fit", "fit.toml", "-o", output, "--threads", "1"]
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("fit.toml"), small()).unwrap();
    succeed(at, &words("alone"));
    let same = |other: &str| {
        for name in ["checkpoint.safetensors", "volume.npz", "movie.npz"] {
            let [a, b] = ["alone", other].map(|run| std::fs::read(at.join(run).join(name)));
            assert!(a.unwrap() == b.unwrap(), "{other}/{name}");
        }
        assert!(!at.join(other).join("ranks.json").exists());
    };
    for ranks in [1, 2, 4, 7] {
        let output = format!("out{ranks}");
        let Some(text) = says(at, ranks, &words(&output)) else { return };
        assert_eq!(text.matches("report.html").count(), 1, "{text}");
        same(&output);
    }
    kill_ranks(|ranks| {
        if at.join("out/fit.toml").exists() {
            return start_with(at, ranks, &["fit", "--resume", "out", "--threads", "1"]);
        }
        let _ = std::fs::remove_dir_all(at.join("out"));
        start_with(at, ranks, &words("out"))
    });
    same("out");
}

/// Without a launcher that ends the job, the others end it: at once, and with one message.
#[test]
#[ignore = "long"]
fn exact_ranks_end_a_fit_that_has_lost_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let rank = |rank: usize| {
        let mut command = Command::new(binary());
        command.current_dir(at).args(["fit", "-o", "out", "--threads", "1"]);
        command.args(["--set", "training.parts=3", "--set", "training.log_every=1"]);
        command.envs([("PMI_RANK", rank.to_string()), ("PMI_SIZE", "3".to_owned())]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let mut ranks = [0, 1, 2].map(rank);
    let has_steps = || std::fs::read(at.join("out/log.jsonl")).is_ok_and(|log| log.len() > 1000);
    let clock = Instant::now();
    while !has_steps() {
        assert!(clock.elapsed() < Duration::from_secs(300), "no steps");
        std::thread::sleep(Duration::from_millis(20));
    }
    ranks[2].kill().unwrap();
    let clock = Instant::now();
    let said = ranks.map(|rank| rank.wait_with_output().unwrap());
    assert!(clock.elapsed() < Duration::from_secs(10), "{:?}", clock.elapsed());
    assert_eq!(said[0].status.code(), Some(1));
    assert_eq!(said[1].status.code(), Some(1));
    let text: String =
        said.iter().map(|said| String::from_utf8_lossy(&said.stderr).into_owned()).collect();
    assert_eq!(text.matches("error:").count(), 1, "{text}");
    assert!(text.contains("rank 2 is gone") && text.contains("fit --resume out"), "{text}");
}
