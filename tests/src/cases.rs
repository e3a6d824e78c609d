//! Cases of a comparison as commands of their own, run by an engine: each once, none lost, the same bytes.

use crate::support::{binary, fail, kerrlight, root, succeed};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Small fits: as many as there are seeds.
fn experiment(folder: &Path, seeds: usize, steps: usize) {
    let fit = root().join("scenes/fits/scene_1.toml");
    let text = format!(
        r#"
        title = "Seeds"
        question = "Which?"
        seeds = {seeds}
        fit = {fit:?}
        [set]
        screen.pixels = 6
        screen.width = 30.0
        region.r_min = 3.0
        region.r_max = 4.2
        movie.frames = 2
        output.nodes = 6
        representation = {{ kind = "grid", nodes = 6 }}
        region.nodes = {{ equal-mino-time = {{ per_ray = 8 }} }}
        training = {{ steps = {steps}, log_every = 10, start = "drawn", checkpoint_seconds = 0.1 }}
        [[factor]]
        name = "rate"
        key = "training.grid_rate"
        values = [0.1]
        "#
    );
    std::fs::write(folder.join("seeds.toml"), text).unwrap();
}

/// A command of the shell that finds the program by its name.
fn shell(folder: &Path, script: &str) -> Command {
    let folders = binary().parent().into_iter().map(Path::to_owned);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(folders.chain(std::env::split_paths(&path))).unwrap();
    let mut command = Command::new("sh");
    command.current_dir(folder).args(["-c", script]).env("PATH", path);
    command
}

/// Volumes that cases have found, by their names.
fn volumes(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let cases = std::fs::read_dir(folder.join("cases")).unwrap().flatten();
    let volume = |case: std::fs::DirEntry| {
        let bytes = std::fs::read(case.path().join("volume.npz")).ok()?;
        Some((case.file_name().into_string().unwrap(), bytes))
    };
    cases.filter_map(volume).collect()
}

fn counts(folder: &Path, name: &str) -> [u64; 4] {
    let status: Value =
        serde_json::from_str(&succeed(folder, &["compare", name, "--status", "--json"])).unwrap();
    let failed = status["failed"].as_array().unwrap().len() as u64;
    let count = |key: &str| status[key].as_u64().unwrap();
    [count("done"), count("running"), failed, count("open")]
}

/// The commands of --list, four at a time, find what one process finds; once more they run nothing.
#[test]
fn exact_xargs_runs_each_case_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 6, 20);
    succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    let script = "kerrlight compare seeds.toml -o out --list --threads 1 | cut -f 3 \
                  | xargs -d '\\n' -P 4 -n 1 sh -c";
    let written = [(); 2].map(|()| {
        let output = shell(at, script).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let entries = std::fs::read_dir(at.join("out/cases")).unwrap().flatten();
        let time = |entry: std::fs::DirEntry| {
            let record = entry.path().join("record.json").metadata().ok()?;
            Some((entry.file_name(), record.modified().ok()?))
        };
        entries.filter_map(time).collect::<BTreeMap<_, _>>()
    });
    assert!(written[0].len() == 6 && written[0] == written[1]);
    assert_eq!(counts(at, "out"), [6, 0, 0, 0]);
    assert_eq!(volumes(&at.join("out")), volumes(&at.join("alone")));
    succeed(at, &["compare", "out", "--collect"]);
    let table = |name: &str| std::fs::read_to_string(at.join(name).join("results.csv")).unwrap();
    assert_eq!(table("out").lines().count(), table("alone").lines().count());
}

fn start(folder: &Path, words: &[&str]) -> Child {
    let mut command = Command::new(binary());
    command.current_dir(folder).args(words).stdin(Stdio::null());
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Of two with one case the second is sent away; a killed one continues to the same bytes.
#[test]
fn exact_a_case_has_one_process_and_survives_kills() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 1, 3000);
    let listed = succeed(at, &["compare", "seeds.toml", "-o", "out", "--list"]);
    let id = listed.split('\t').next().unwrap();
    let words = ["compare", "seeds.toml", "-o", "out", "--case", id];
    let mut first = start(at, &words);
    let (clock, log) = (Instant::now(), at.join("out/cases").join(id).join("log.jsonl"));
    while log.metadata().map_or(0, |log| log.len()) == 0 {
        assert!(clock.elapsed() < Duration::from_secs(120) && first.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(kerrlight(at, &words).status.code(), Some(75));
    assert_eq!(counts(at, "out"), [0, 1, 0, 0]);
    first.kill().unwrap();
    first.wait().unwrap();
    assert_eq!(counts(at, "out"), [0, 0, 0, 1]);
    succeed(at, &words);
    assert_eq!(counts(at, "out"), [1, 0, 0, 0]);
    succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    assert_eq!(volumes(&at.join("out")), volumes(&at.join("alone")));
    // What is done is done at once, and another name is refused.
    let clock = Instant::now();
    succeed(at, &words);
    assert!(clock.elapsed() < Duration::from_secs(5));
    let error = fail(at, &["compare", "seeds.toml", "-o", "out", "--case", "rate_seed1_00000000"]);
    assert!(error.contains("there is no such case"), "{error}");
}
