//! `kerrlight` as the ranks of one job of MPI.

use crate::shared_folder::{claims, experiment};
use crate::support::{binary, root, succeed};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// So many ranks on this machine; nothing where there is no `mpirun`.
fn start(at: &Path, ranks: usize, output: &str) -> Option<Child> {
    start_with(at, ranks, &["compare", "seeds.toml", "-o", output, "--threads", "1"])
}

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

/// Names in a folder.
fn names(at: &Path) -> Vec<String> {
    let mut all: Vec<String> = std::fs::read_dir(at)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    all.sort();
    all
}

/// Names in the folders of a folder.
fn names_below(at: &Path) -> Vec<String> {
    let folders = std::fs::read_dir(at).into_iter().flatten().flatten();
    let inner = folders.flat_map(|folder| std::fs::read_dir(folder.path()).into_iter().flatten());
    inner.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect()
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

/// A scene of the repository.
fn scene(name: &str) -> String {
    root().join("scenes").join(name).display().to_string()
}

/// Any number of ranks renders what one process renders, one of them speaks, and nothing is left beside the file.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_render_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = scene("hot_spots.toml");
    let words =
        |output| ["render", &scene, "-o", output, "--preview", "p.png", "--set", "screen.width=80"];
    succeed(at, &words("alone.exr"));
    let png = std::fs::read(at.join("p.png")).unwrap();
    let alone = std::fs::read(at.join("alone.exr")).unwrap();
    for ranks in [1, 2, 4, 7] {
        let Some(text) = says(at, ranks, &words("out.exr")) else { return };
        assert_eq!(text.matches("flux").count(), 1, "{text}");
        assert!(std::fs::read(at.join("out.exr")).unwrap() == alone, "{ranks} ranks");
        assert!(std::fs::read(at.join("p.png")).unwrap() == png, "{ranks} ranks");
        assert_eq!(names(at), ["alone.exr", "out.exr", "p.png"]);
    }
}

/// Killed ranks lose nothing but the bands under way, and another number of ranks, or one process, goes on.
#[test]
#[ignore = "long"]
fn exact_a_killed_rank_of_mpirun_leaves_its_bands() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = scene("disc_face_on.toml");
    let words = |output| {
        let mut words = vec!["render", &scene, "-o", output, "--threads", "1"];
        words.extend(["--set", "screen.width=640", "--set", "screen.samples_per_pixel=16"]);
        words
    };
    succeed(at, &words("alone.exr"));
    let kills = kill_ranks(|ranks| start_with(at, ranks, &words("out.exr")));
    if kills == 0 {
        return;
    }
    assert!(
        std::fs::read(at.join("out.exr")).unwrap() == std::fs::read(at.join("alone.exr")).unwrap()
    );
    assert_eq!(names(at), ["alone.exr", "out.exr"]);
    // What ranks have left is of use to one process.
    std::fs::remove_file(at.join("out.exr")).unwrap();
    let mut job = start_with(at, 3, &words("out.exr")).unwrap();
    let shared = at.join("out.exr.shared");
    let has_bands = || names_below(&shared).iter().any(|name| name.ends_with(".partial"));
    let clock = Instant::now();
    while !has_bands() && clock.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let ranks = ranks_of(&job);
    let last = ranks.last().expect("40 bands take longer than one");
    Command::new("kill").args(["-9", last]).status().unwrap();
    job.wait().unwrap();
    assert!(has_bands() && !at.join("out.exr").exists());
    succeed(at, &words("out.exr"));
    assert!(
        std::fs::read(at.join("out.exr")).unwrap() == std::fs::read(at.join("alone.exr")).unwrap()
    );
    assert_eq!(names(at), ["alone.exr", "out.exr"]);
}

/// A film with one scale for all frames, which is that of the first, by any number of ranks and after kills.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_render_one_film() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = scene("hot_spots.toml");
    let words = |output: &str| {
        let fixed = ["movie", &scene, "--frames", "13", "--duration", "100", "--gif", "film.gif"];
        let set = ["--set", "screen.width=16", "--set", "screen.total_flux_jy=2.5"];
        let all = [&fixed[..], &set, &["--threads", "1", "-o", output]].concat();
        all.into_iter().map(str::to_owned).collect::<Vec<String>>()
    };
    let alone = words("alone");
    succeed(at, &alone.iter().map(String::as_str).collect::<Vec<_>>());
    let gif = std::fs::read(at.join("film.gif")).unwrap();
    let same = |other: &str| {
        assert_eq!(names(&at.join("alone")), names(&at.join(other)));
        for name in names(&at.join("alone")) {
            let [a, b] = ["alone", other].map(|folder| std::fs::read(at.join(folder).join(&name)));
            assert!(a.unwrap() == b.unwrap(), "{other}/{name}");
        }
        assert!(std::fs::read(at.join("film.gif")).unwrap() == gif);
    };
    for ranks in [1, 2, 4, 7] {
        let output = format!("out{ranks}");
        let Some(text) = says(at, ranks, &words(&output)) else { return };
        assert_eq!(text.matches("13 frames, 13 of them rendered").count(), 1, "{text}");
        same(&output);
    }
    kill_ranks(|ranks| start_with(at, ranks, &words("out")));
    same("out");
}

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

/// Any number of ranks takes the steps of one process, also where jobs are killed and others go on.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_take_parts_of_one_fit() {
    fn words(output: &str) -> [&str; 6] {
        ["fit", "fit.toml", "-o", output, "--threads", "1"]
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let built_in = std::fs::read_to_string(root().join("cli/src/fit/built_in.toml")).unwrap();
    let text = built_in
        .replace("steps = 600", "steps = 150\nparts = 8\ncheckpoint_seconds = 0.1")
        .replace("pixels = 40", "pixels = 20")
        .replace("scans = 64", "scans = 16")
        .replace("rounds = 4", "rounds = 1")
        .replace("nodes = 64", "nodes = 20");
    std::fs::write(at.join("fit.toml"), text).unwrap();
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

/// Hard rays come to the same with any number of ranks and after kills; the sweep, which measures times, is one rank's.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_trace_hard_rays_together() {
    fn words(output: &str) -> [&str; 7] {
        ["accuracy", "--hard", "24000", "-o", output, "--threads", "1"]
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeed(at, &words("alone"));
    let same = |other: &str| {
        assert_eq!(names(&at.join("alone")), names(&at.join(other)), "{other}");
        for name in ["hard.json", "hard.csv"] {
            let [a, b] = ["alone", other].map(|folder| std::fs::read(at.join(folder).join(name)));
            assert!(a.unwrap() == b.unwrap(), "{other}/{name}");
        }
    };
    for ranks in [2, 4] {
        let output = format!("out{ranks}");
        let Some(_) = says(at, ranks, &words(&output)) else { return };
        same(&output);
    }
    kill_ranks(|ranks| start_with(at, ranks, &words("out")));
    same("out");
    let sweep = ["accuracy", "--rays", "8", "-o", "sweep", "--threads", "1"];
    let said = says(at, 3, &sweep).unwrap();
    assert_eq!(names(&at.join("sweep")).len(), 4, "{said}");
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
