//! Several processes of `kerrlight compare --share` on one folder.

use crate::support::{binary, fail, kerrlight, root, succeed};
use serde_json::Value;
use std::path::Path;
use std::process::{Child, Command, Stdio};
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
        movie.frames = 2
        output.nodes = 6
        representation = {{ kind = "grid", nodes = 6 }}
        region.nodes = {{ equal-mino-time = {{ per_ray = 8 }} }}
        training = {{ steps = {steps}, log_every = 10, start = "drawn" }}
        [[factor]]
        name = "rate"
        key = "training.grid_rate"
        values = [0.1]
        "#
    );
    std::fs::write(folder.join("seeds.toml"), text).unwrap();
}

fn start(folder: &Path, words: &[&str]) -> Child {
    let mut command = Command::new(binary());
    command.current_dir(folder).args(words).stdin(Stdio::null());
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

fn results(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("results.json")).unwrap()).unwrap()
}

/// Names of the claims that end in `ending`.
pub fn claims(folder: &Path, ending: &str) -> usize {
    let names = std::fs::read_dir(folder.join("shared/claims")).into_iter().flatten().flatten();
    names.filter(|name| name.file_name().to_string_lossy().ends_with(ending)).count()
}

/// Two that share a folder find what one alone finds, and each case is run by one of them.
#[test]
fn exact_two_that_share_find_what_one_finds() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 3, 20);
    succeed(at, &["compare", "seeds.toml", "-o", "alone"]);
    let words = ["compare", "seeds.toml", "-o", "both", "--share"];
    let others = [0, 1].map(|_| start(at, &words));
    let said = others.map(|child| {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stderr).into_owned()
    });
    assert!(said.iter().all(|text| text.contains("3 cases, ")), "{said:?}");
    assert_eq!((claims(&at.join("both"), ".0"), claims(&at.join("both"), ".done")), (3, 3));
    assert_eq!(claims(&at.join("both"), ".1"), 0, "nothing is taken twice");
    let [alone, both] = ["alone", "both"].map(|name| results(&at.join(name)));
    let cases = |results: &Value| results["cases"].as_array().unwrap().clone();
    for (a, b) in cases(&alone).iter().zip(cases(&both)) {
        assert_eq!((&a["folder"], &b["status"]), (&b["folder"], &"done".into()));
        assert_eq!(a["results"]["psnr_db"], b["results"]["psnr_db"]);
        let read = |of: &str, name: &str| {
            std::fs::read(at.join(of).join(a["folder"].as_str().unwrap()).join(name)).unwrap()
        };
        let files =
            ["checkpoint.safetensors", "fit.toml", "inputs.json", "volume.npz", "movie.npz"];
        for name in files {
            assert!(read("alone", name) == read("both", name), "{name}");
        }
    }
    // The folder itself knows its cases; what one alone resumes ends the sharing.
    let told = succeed(at, &["compare", "both", "--status"]);
    assert!(told.starts_with("3 of 3 cases done, 0 failed, 0 open; 0 at work"), "{told}");
    let again = kerrlight(at, &["compare", "both", "--share"]);
    assert!(String::from_utf8_lossy(&again.stderr).contains("3 cases, 0 of them open"));
    let alone = kerrlight(at, &["compare", "both", "--resume"]);
    assert!(String::from_utf8_lossy(&alone.stderr).contains("3 cases, 0 of them to be run"));
    assert!(!at.join("both/shared").exists());
}

/// What does not belong together is refused.
#[test]
fn wrong_ways_to_share_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 2, 2);
    assert!(fail(at, &["compare", "seeds.toml", "--status"]).contains("holds no comparison"));
    assert!(fail(at, &["compare", "seeds.toml", "--collect"]).contains("holds no comparison"));
    assert!(fail(at, &["compare", "seeds.toml", "--share=later"]).contains("[possible values: "));
    std::fs::create_dir(at.join("mine")).unwrap();
    std::fs::write(at.join("mine/notes.txt"), "mine").unwrap();
    let said = fail(at, &["compare", "seeds.toml", "-o", "mine", "--share"]);
    assert!(said.contains("holds other files than a comparison"), "{said}");
    succeed(at, &["compare", "seeds.toml", "-o", "out", "--share"]);
    let other = fail(at, &["compare", "seeds.toml", "-o", "out", "--seeds", "1", "--share"]);
    assert!(other.contains("out has other cases: join it with"), "{other}");
    let more = fail(at, &["compare", "out", "--seeds", "1", "--share"]);
    assert!(more.contains("out has its cases"), "{more}");
}

/// A case that fails is run once by all who share, and again by one who resumes alone; a report can be made at any
/// time.
#[cfg(unix)]
#[test]
fn exact_failures_are_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 1, 5);
    let text = std::fs::read_to_string(at.join("seeds.toml")).unwrap();
    // The volume of the first case is larger than a file may be.
    let text =
        text.replace("\"training.grid_rate\"", "\"output.nodes\"").replace("[0.1]", "[128, 6]");
    std::fs::write(at.join("seeds.toml"), text.replace("output.nodes = 6\n", "")).unwrap();
    let words = ["compare", "seeds.toml", "-o", "out", "--share"];
    let output = crate::support::cramped(at, 2048, &words);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("1 of 2 cases failed: rate 128, seed 1"), "{said}");
    let again = kerrlight(at, &words);
    assert!(String::from_utf8_lossy(&again.stderr).contains("2 cases, 0 of them open"));
    let told = succeed(at, &["compare", "out", "--status"]);
    assert!(told.contains("1 of 2 cases done, 1 failed") && told.contains("failed: rate 128"));
    let json: Value =
        serde_json::from_str(&succeed(at, &["compare", "out", "--status", "--json"])).unwrap();
    assert_eq!((&json["done"], &json["open"]), (&1.into(), &0.into()));
    std::fs::remove_file(at.join("out/report.html")).unwrap();
    succeed(at, &["compare", "out", "--collect"]);
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    assert!(page.contains("Failed: rate 128, seed 1"));
    let resumed = kerrlight(at, &["compare", "out", "--resume"]);
    let said = String::from_utf8_lossy(&resumed.stderr).into_owned();
    assert!(resumed.status.success() && said.contains("2 cases, 1 of them to be run"), "{said}");
}

/// Four processes on one folder, of which one is killed every `pause` and replaced.
fn with_kills(cases: usize, steps: usize, pause: Duration, limit: Duration) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, cases, steps);
    let words = ["compare", "seeds.toml", "-o", "out", "--share", "--threads", "1"];
    let begin = || start(at, &words);
    let mut all: Vec<Child> = (0..4).map(|_| begin()).collect();
    let (clock, mut last, mut kills) = (Instant::now(), Instant::now(), 0);
    while all.iter_mut().any(|child| child.try_wait().unwrap().is_none()) {
        assert!(clock.elapsed() < limit, "they do not end");
        std::thread::sleep(Duration::from_millis(50));
        if last.elapsed() < pause {
            continue;
        }
        // No more than there are cases done: on a busy machine a process would otherwise not live as long as a case takes.
        let done = claims(&at.join("out"), ".done");
        if kills < cases.div_ceil(2) && kills < done + 4 && done < cases {
            all[kills % 4].kill().unwrap();
            all[kills % 4].wait().unwrap();
            all[kills % 4] = begin();
            (last, kills) = (Instant::now(), kills + 1);
        }
    }
    println!("{cases} cases, {kills} kills, {:.1} s", clock.elapsed().as_secs_f64());
    assert!(kills > 0);
    assert_eq!(claims(&at.join("out"), ".done"), cases);
    let found = results(&at.join("out"));
    let all = found["cases"].as_array().unwrap();
    assert_eq!(all.len(), cases);
    assert!(all.iter().all(|case| case["status"] == "done"));
    // A run has one place: none was left behind or came a second time.
    let left = std::fs::read_dir(at.join("out/shared/work")).unwrap().flatten();
    assert_eq!(left.filter(|entry| entry.path().is_dir()).count(), 0);
    let runs = std::fs::read_dir(at.join("out/cases")).unwrap().flatten();
    assert_eq!(runs.filter(|entry| entry.path().is_dir()).count(), cases);
}

#[test]
fn exact_kills_lose_nothing_and_repeat_nothing() {
    with_kills(6, 10, Duration::from_secs(1), Duration::from_secs(300));
}

#[test]
#[ignore = "long"]
fn exact_kills_among_a_thousand_cases() {
    with_kills(1000, 10, Duration::from_secs(3), Duration::from_secs(3 * 3600));
}
