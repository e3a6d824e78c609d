//! Effect of Ctrl-C, SIGTERM and SIGKILL on long runs: exit codes, what is kept, and that no process outlives its
//! parent.

use crate::fit::{small, with};
use crate::support::{
    are_the_same, binary, holds, kerrlight, message, new_folder, scene_path, sets, start, succeed,
    until,
};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Sends a signal to a process.
pub fn signal(pid: u32, name: &str) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

/// The fit of a comparison: the only child of its process.
pub fn child_of(parent: u32) -> Option<u32> {
    let path = format!("/proc/{parent}/task/{parent}/children");
    std::fs::read_to_string(path).ok()?.split_whitespace().next()?.parse().ok()
}

/// Returns whether a process is there and not merely waiting to be reaped.
fn runs(pid: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{pid}/stat"));
    status.is_ok_and(|text| !text.rsplit(") ").next().unwrap_or_default().starts_with('Z'))
}

/// Returns whether a process has blocked SIGINT, for which a thread of it waits from then on; told by Linux alone.
fn listens(pid: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigBlk:"));
    let mask = mask.map(|mask| u64::from_str_radix(mask.trim(), 16).expect("a mask"));
    mask.map_or(!cfg!(target_os = "linux"), |mask| mask & 2 != 0)
}

/// State is saved, the code is the signal's, and the run ends in the bytes of one that was left in peace.
#[test]
fn exact_fits_that_are_stopped_end_in_the_same_bytes() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    // Signalled early, so that a fit on a busy machine is not over before the signal comes.
    let long =
        ["training.steps=600", "training.log_every=10", "training.checkpoint_seconds=1000.0"];
    let words = with(&small, &sets(&long));
    succeed(folder.path(), &[&words[..], &["-o", "whole"]].concat());
    for (name, code) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129), ("-XCPU", 152)] {
        let run = folder.path().join(name);
        let child = start(folder.path(), &[&words[..], &["-o", &format!("./{name}")]].concat());
        until("a logged step", || holds(&run.join("log.jsonl"), "\"step\":10"));
        signal(child.id(), name);
        let ended = child.wait_with_output().unwrap();
        let said = message(&ended);
        assert_eq!(ended.status.code(), Some(code), "{said}");
        assert!(said.contains("stopped after step") && said.contains("fit --resume"), "{said}");
        assert!(!run.join("results.json").exists());
        assert!(run.join("checkpoint.safetensors").is_file());
        let resumed = format!("./{name}");
        succeed(folder.path(), &["fit", "--resume", &resumed]);
        let same = ["volume.npz", "movie.npz", "checkpoint.safetensors"];
        are_the_same(folder.path(), ["whole", name], &same);
    }
}

/// Work that keeps nothing ends at once: a fit whose rays are traced, a scan, a linear grid, the sweep of accuracies.
#[test]
fn exact_what_keeps_nothing_ends_at_once() {
    let fit = &scene_path("fits/scene_1.toml");
    let linear = ["--set", "representation=linear-grid", "--set", "linear.iterations=100000"];
    for words in [
        &["fit", fit, "-o", "run", "--set", "screen.pixels=512"][..],
        &[&["fit", fit, "-o", "run"][..], &linear].concat(),
        &["accuracy", "-o", "results"],
        &["accuracy", "-o", "results", "--hard", "10000000"],
        &["render", "--set", "screen.width=4000", "--preview", "a.png"],
        &["trace", "--rays", "-"],
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(binary());
        command.current_dir(folder.path()).args(words).stdout(Stdio::null());
        let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Open until it has ended: what reads it would else see its end, perhaps before the signal.
        let _stdin = child.stdin.take();
        until("it listens", || listens(child.id()));
        // Nothing tells when it is in the middle of its work.
        std::thread::sleep(Duration::from_millis(500));
        let clock = Instant::now();
        signal(child.id(), "-INT");
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), Some(130), "{words:?}: {}", message(&ended));
        // A second when the machine has nothing else to do.
        assert!(clock.elapsed() < Duration::from_secs(30), "{words:?}: {:?}", clock.elapsed());
        assert!(!folder.path().join("run/results.json").exists());
    }
}

/// A comparison of two long fits.
fn experiment(folder: &Path) {
    let long = [("seeds = 2", "seeds = 1"), ("steps = 30", "steps = 1000000")];
    crate::compare::experiment(folder, &long);
}

/// The folder of the first case.
pub fn first_case(folder: &Path) -> Option<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder.join("out/cases")).ok()?.flatten();
    entries.map(|entry| entry.path()).find(|path| path.is_dir())
}

/// Signals to the comparison alone: its fit saves its state and ends, whatever ended the comparison.
#[cfg(target_os = "linux")]
#[test]
fn exact_no_fit_outlives_its_comparison() {
    for (name, code) in [("-INT", Some(130)), ("-TERM", Some(143)), ("-KILL", None)] {
        let at = &new_folder();
        experiment(at);
        let parent = start(at, &["compare", "rates.toml", "-o", "out"]);
        let log = || first_case(at).map(|case| case.join("log.jsonl"));
        until("a step", || log().is_some_and(|log| holds(&log, "psnr_db")));
        let child = child_of(parent.id()).expect("a fit");
        signal(parent.id(), name);
        let ended = parent.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), code, "{name}: {}", message(&ended));
        until("the fit has ended", || !runs(child));
        let step = |at: &Path| {
            let text = std::fs::read_to_string(first_case(at).unwrap().join("log.jsonl")).unwrap();
            text.lines().count()
        };
        let lines = step(at);
        assert!(lines > 0 && first_case(at).unwrap().join("checkpoint.safetensors").is_file());
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(step(at), lines, "nobody writes");
        if code.is_some() {
            let said = message(&ended);
            assert!(said.contains("stopped: 2 cases are not done"), "{said}");
            assert!(holds(&at.join("out/results.json"), "\"open\""));
        }
    }
}

/// A second signal ends at once, and leaves no half-written file behind.
#[test]
fn exact_a_second_signal_ends_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let set = ["--set", "screen.width=3000", "--set", "screen.height=2000", "--tile", "3000"];
    let child = start(folder.path(), &[&["render", "-o", "a.exr"][..], &set].concat());
    let partial = folder.path().join("a.exr.partial");
    until("rendering", || partial.exists());
    let clock = Instant::now();
    signal(child.id(), "-INT");
    std::thread::sleep(Duration::from_millis(20));
    // It may have ended in the meantime.
    let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "{}", message(&ended));
    assert!(clock.elapsed() < Duration::from_secs(30));
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 1, "the journal alone");
}

/// `nohup` works as everywhere.
#[test]
fn exact_a_hangup_that_is_ignored_stays_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let script = format!("trap '' HUP; exec {:?} trace --rays -", binary());
    let mut command = Command::new("sh");
    command.current_dir(folder.path()).args(["-c", &script]).stdout(Stdio::null());
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    let _stdin = child.stdin.take();
    until("it listens", || listens(child.id()));
    signal(child.id(), "-HUP");
    std::thread::sleep(Duration::from_millis(500));
    assert!(child.try_wait().unwrap().is_none(), "still there");
    signal(child.id(), "-TERM");
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert!(!kerrlight(folder.path(), &["trace", "--rays", "none"]).status.success());
}
