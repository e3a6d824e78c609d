//! Cases of a comparison as commands of their own, run by an engine: each once, none lost, the same bytes.

use crate::support::{
    binary, fail, json, kerrlight, kill, message, new_folder, object, root, skipped, start,
    succeed, until,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Small fits: as many as there are seeds.
pub fn experiment(folder: &Path, seeds: usize, steps: usize) {
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
        simulation.movie.frames = 2
        output.nodes = 6
        representation = {{ kind = "grid", grid.nodes = 6 }}
        region.nodes = {{ equal-mino-time = {{ per_ray = 8 }} }}
        training = {{ steps = {steps}, log_every = 10, start = "drawn", checkpoint_seconds = 0.1 }}
        [[factor]]
        name = "rate"
        key = "representation.grid.rate"
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
    let status = object(folder, &["compare", name, "--status"]);
    let failed = status["failed"].as_array().unwrap().len() as u64;
    let count = |key: &str| status[key].as_u64().unwrap();
    [count("done"), count("running"), failed, count("open")]
}

/// Asserts that so many cases are done, and have found what one process finds.
fn as_alone(at: &Path, cases: u64) {
    assert_eq!(counts(at, "out"), [cases, 0, 0, 0]);
    if !at.join("alone").exists() {
        succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    }
    assert_eq!(volumes(&at.join("out")), volumes(&at.join("alone")));
}

/// The commands of --list, four at a time, find what one process finds; once more they run nothing.
fn runs_each_case_once(at: &Path, engine: &str) {
    let script =
        format!("kerrlight compare seeds.toml -o out --list --threads 1 | cut -f 3 | {engine}");
    let written = [(); 2].map(|()| {
        let output = shell(at, &script).output().unwrap();
        assert!(output.status.success(), "{}", message(&output));
        let entries = std::fs::read_dir(at.join("out/cases")).unwrap().flatten();
        let time = |entry: std::fs::DirEntry| {
            let record = entry.path().join("record.json").metadata().ok()?;
            Some((entry.file_name(), record.modified().ok()?))
        };
        entries.filter_map(time).collect::<BTreeMap<_, _>>()
    });
    assert!(written[0].len() == 6 && written[0] == written[1]);
    as_alone(at, 6);
    succeed(at, &["compare", "out", "--collect"]);
    let table = |name: &str| std::fs::read_to_string(at.join(name).join("results.csv")).unwrap();
    assert_eq!(table("out").lines().count(), table("alone").lines().count());
    std::fs::remove_dir_all(at.join("out")).unwrap();
}

#[test]
fn exact_xargs_and_gnu_parallel_run_each_case_once() {
    let folder = tempfile::tempdir().unwrap();
    experiment(folder.path(), 6, 20);
    runs_each_case_once(folder.path(), "xargs -d '\\n' -P 4 -n 1 sh -c");
    let version = Command::new("parallel").arg("--version").output();
    if version.is_ok_and(|output| output.stdout.starts_with(b"GNU parallel")) {
        runs_each_case_once(folder.path(), "parallel -j 4");
    } else {
        skipped("there is no GNU parallel (apt install parallel)");
    }
}

/// Ten thousand cases of which one was run, and two thousand have its results.
#[test]
fn exact_many_cases_are_listed_counted_and_collected() {
    let at = &new_folder();
    experiment(at, 10_000, 20);
    let listed = succeed(at, &["compare", "seeds.toml", "-o", "out", "--list"]);
    let ids: Vec<&str> = listed.lines().map(|line| line.split('\t').next().unwrap()).collect();
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), 10_000);
    assert!(ids[4321].starts_with("0.1_seed4322_"), "{}", ids[4321]);
    succeed(at, &["compare", "seeds.toml", "-o", "out", "--case", ids[0]]);
    let run = |id: &str| at.join("out/cases").join(id);
    for id in &ids[1..2000] {
        std::fs::create_dir(run(id)).unwrap();
        for name in ["results.json", "inputs.json", "report.html"] {
            std::fs::hard_link(run(ids[0]).join(name), run(id).join(name)).unwrap();
        }
    }
    std::fs::write(at.join("out/cases").join(format!("{}.failed", ids[2000])), "why").unwrap();
    assert_eq!(counts(at, "out"), [2000, 0, 1, 7999]);
    succeed(at, &["compare", "out", "--collect"]);
    let all = json(&at.join("out/results.json"));
    let one = json(&run(ids[0]).join("results.json"));
    let cases = all["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 10_000);
    for (k, (case, id)) in cases.iter().zip(&ids).enumerate() {
        assert_eq!(case["folder"], format!("cases/{id}"));
        assert_eq!(case["settings"]["seed"], k + 1);
        let is_one = case.get("results") == Some(&one);
        let is_expected = match k {
            0..2000 => case["status"] == "done" && is_one,
            2000 => case["status"] == "failed" && case["error"] == "why",
            _ => case["status"] == "open" && !is_one,
        };
        assert!(is_expected, "{case}");
    }
    let table = std::fs::read_to_string(at.join("out/results.csv")).unwrap();
    assert_eq!(table.lines().count(), 10_001);
}

/// Of two with one case the second is sent away; a killed one continues to the same bytes.
#[test]
fn exact_a_case_has_one_process_and_survives_kills() {
    let at = &new_folder();
    experiment(at, 1, 3000);
    let listed = succeed(at, &["compare", "seeds.toml", "-o", "out", "--list"]);
    let id = listed.split('\t').next().unwrap();
    let words = ["compare", "seeds.toml", "-o", "out", "--case", id];
    let first = start(at, &words);
    let log = at.join("out/cases").join(id).join("log.jsonl");
    until("a logged step", || log.metadata().map_or(0, |log| log.len()) > 0);
    assert_eq!(kerrlight(at, &words).status.code(), Some(75));
    assert_eq!(counts(at, "out"), [0, 1, 0, 0]);
    kill(first);
    assert_eq!(counts(at, "out"), [0, 0, 0, 1]);
    succeed(at, &words);
    as_alone(at, 1);
    // What is done is done at once, and another name is refused.
    let clock = Instant::now();
    succeed(at, &words);
    assert!(clock.elapsed() < Duration::from_secs(5));
    let error = fail(at, &["compare", "seeds.toml", "-o", "out", "--case", "rate_seed1_00000000"]);
    assert!(error.contains("there is no such case"), "{error}");
}

/// A Slurm of one node that ends with the test.
struct Slurm(PathBuf);

impl Slurm {
    /// Nothing where it is not installed.
    fn start(folder: &Path) -> Option<Self> {
        let slurm = Slurm(folder.join("slurm"));
        let output = slurm.script("start.sh");
        let said = message(&output);
        if output.status.code() == Some(77) {
            skipped(format_args!("Slurm: {said}"));
            return None;
        }
        assert!(output.status.success(), "{said}");
        Some(slurm)
    }

    fn script(&self, name: &str) -> Output {
        let path = root().join("tests/slurm").join(name);
        Command::new("sh").arg(path).arg(&self.0).output().unwrap()
    }

    fn says(&self, folder: &Path, script: &str) -> String {
        let output = shell(folder, script).env("SLURM_CONF", self.0.join("slurm.conf")).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{script}: {}", message(&output));
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        self.script("stop.sh");
    }
}

/// The script of the page.
fn documented_array() -> String {
    let page = std::fs::read_to_string(root().join("docs/reference/cluster.md")).unwrap();
    let from = page.find("#!/bin/sh\n#SBATCH").unwrap();
    page[from..].split("```").next().unwrap().to_owned()
}

/// The array of the page: a task that is killed by `scancel` in the middle is put back into the queue and finishes its case.
#[test]
#[ignore = "minutes, and needs Slurm"]
fn exact_an_array_of_slurm_runs_each_case_once() {
    let at = &new_folder();
    let Some(slurm) = Slurm::start(at) else { return };
    experiment(at, 4, 2000);
    let array =
        documented_array().replace("--cpus-per-task=4\n#SBATCH --mem=4G", "--cpus-per-task=1");
    std::fs::write(at.join("cases.sh"), array).unwrap();
    slurm.says(at, "kerrlight compare seeds.toml -o out --list --threads 1 | cut -f 3 > commands");
    let job = slurm.says(at, "sbatch --parsable --array=1-$(wc -l < commands)%2 cases.sh");
    until("a case runs", || counts_if_begun(at)[1] > 0);
    slurm.says(at, &format!("scancel --full -s KILL {job}_1; scontrol requeue {job}_1 || true"));
    let clock = Instant::now();
    while !slurm.says(at, &format!("squeue -h -j {job}")).is_empty() {
        assert!(clock.elapsed() < Duration::from_secs(500));
        std::thread::sleep(Duration::from_millis(500));
    }
    let told = slurm.says(at, &format!("scontrol show job {job}_1"));
    assert!(told.contains("Restarts=1"), "{told}");
    as_alone(at, 4);
}

fn counts_if_begun(at: &Path) -> [u64; 4] {
    if at.join("out/plan.json").is_file() { counts(at, "out") } else { [0; 4] }
}

/// The rules of `cluster/Snakefile`: one process is killed in the middle, and Snakemake runs the case once more.
#[test]
#[ignore = "minutes, and needs Snakemake"]
fn exact_snakemake_runs_each_case_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    if shell(at, "snakemake --version").output().is_ok_and(|output| !output.status.success()) {
        return skipped("there is no Snakemake (pip install snakemake)");
    }
    experiment(at, 4, 2000);
    let snakefile = root().join("cluster/Snakefile");
    let script = format!(
        "exec snakemake --snakefile {snakefile:?} --cores 2 --retries 3 \
         --config experiment=seeds.toml folder=out 'options=--threads 1'"
    );
    let said = std::fs::File::create(at.join("said")).unwrap();
    let mut engine = shell(at, &script).stderr(said).stdout(Stdio::null()).spawn().unwrap();
    until("a case runs", || {
        assert!(engine.try_wait().unwrap().is_none());
        counts_if_begun(at)[1] > 0
    });
    // The command line of the first case that runs, of this folder alone.
    shell(
        at,
        "for p in /proc/[0-9]*; do [ \"$(readlink $p/cwd)\" = \"$PWD\" ] && \
               tr '\\0' ' ' < $p/cmdline | grep -q '^kerrlight compare .*--case' && \
               kill -9 ${p#/proc/} && break; done",
    )
    .status()
    .unwrap();
    assert!(engine.wait().unwrap().success());
    let said = std::fs::read_to_string(at.join("said")).unwrap();
    assert!(said.contains("Trying to restart job"), "{said}");
    as_alone(at, 4);
}
