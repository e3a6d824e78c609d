//! `kerrlight compare`: cases that are whole, cached, gone on with, or failed and named.

use crate::fit::results;
use crate::support::{
    cramped, fail, fail_with, json, kerrlight, message, new_folder, root, succeed, told,
};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Two grids of different rates, with changes of the words.
pub fn experiment(folder: &Path, changes: &[(&str, &str)]) {
    let fit = root().join("scenes/fits/scene_1.toml");
    let mut text = format!(
        r#"
        title = "Two rates"
        question = "Which rate?"
        seeds = 2
        fit = {fit:?}
        [set]
        screen.pixels = 16
        simulation.movie.frames = 8
        output.nodes = 16
        representation = {{ kind = "grid", grid.nodes = 16 }}
        region.nodes = {{ equal-mino-time = {{ per_ray = 40 }} }}
        training = {{ steps = 30, log_every = 10, start = "drawn" }}
        [[factor]]
        name = "rate"
        key = "representation.grid.rate"
        values = [0.1, 0.4]
        [[table]]
        title = "Quality"
        caption = "PSNR."
        value = "psnr_db"
        rows = ["rate"]
        [[figure]]
        kind = "volumes"
        title = "Volumes"
        caption = "Both rates."
        rows = ["rate"]
        every_seed = true
        [[figure]]
        kind = "volumes"
        title = "Volumes later"
        caption = "Both rates."
        rows = ["rate"]
        later = 0.25
        [[figure]]
        kind = "time"
        title = "Time"
        caption = "Both rates."
        rows = ["rate"]
        "#
    );
    for (old, new) in changes {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    std::fs::write(folder.join("rates.toml"), text).unwrap();
}

pub(crate) fn cases(results: &Value) -> &Vec<Value> {
    results["cases"].as_array().unwrap()
}

/// Checks the page, the table and every case of a finished comparison.
fn check_comparison(at: &Path, first: &Value) {
    assert_eq!(cases(first).len(), 4);
    for case in cases(first) {
        assert_eq!(case["status"], "done");
        // Of an empty volume the error is 1, and it correlates with nothing; its PSNR is high. So few steps find little.
        let [error, correlation] =
            ["nrmse", "correlation"].map(|key| case["results"][key].as_f64().unwrap());
        assert!(error < 1.0 && correlation > 0.05, "{error} {correlation}");
        assert!(case["results"]["peak_memory_mib"].as_f64().unwrap() > 1.0);
        assert_eq!(case["settings"]["training"]["steps"], 30);
        assert!(at.join("out").join(case["folder"].as_str().unwrap()).join("report.html").exists());
    }
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    assert!(
        page.contains("Which rate?") && page.contains("Mean ± standard deviation over 2 seeds")
    );
    assert!(page.contains("data:image/png") && page.contains("<svg"));
    assert!(page.contains("carried along by the true motion"));
    // The truth and a row for every rate: of both seeds, and of the first alone.
    let height = |name: &str| f64::from(image::image_dimensions(at.join(name)).unwrap().1);
    let ratio = height("out/1-volumes.png") / height("out/2-volumes.png");
    assert!((1.4..1.8).contains(&ratio), "{ratio}");
    let table = std::fs::read_to_string(at.join("out/results.csv")).unwrap();
    assert_eq!(table.lines().count(), 5);
}

#[test]
fn exact_cases_are_whole_and_not_done_twice() {
    let at = &new_folder();
    experiment(at, &[]);
    let printed = succeed(at, &["compare", "rates.toml", "-o", "out"]);
    assert!(printed.contains("| rate | PSNR (dB) |"), "{printed}");
    let lines: Vec<&str> = printed.lines().collect();
    let [worth, look_at] = lines[lines.len() - 2..] else { panic!("{printed}") };
    assert!(worth.starts_with("4 of 4 cases done; PSNR (dB) from "), "{worth}");
    assert_eq!(look_at, "out/report.html");
    let first = results(&at.join("out"));
    check_comparison(at, &first);
    // A full folder is not written to by accident; what is done is not done again.
    fail_with(at, &["compare", "rates.toml", "-o", "out"], &["--resume"]);
    let resume = ["compare", "rates.toml", "-o", "out", "--resume"];
    assert!(told(at, &resume).contains("4 cases, 0 of them to be run"));
    assert_eq!(results(&at.join("out")), first);
    // A case whose folder was lost half-way is done again, to the same numbers.
    let lost = at.join("out").join(cases(&first)[2]["folder"].as_str().unwrap());
    std::fs::remove_file(lost.join("report.html")).unwrap();
    std::fs::remove_file(lost.join("results.json")).unwrap();
    assert!(told(at, &resume).contains("4 cases, 1 of them to be run"));
    let again = results(&at.join("out"));
    for (a, b) in cases(&first).iter().zip(cases(&again)) {
        assert_eq!(a["results"]["psnr_db"], b["results"]["psnr_db"]);
    }
    // What another version has found is found anew.
    let file = lost.join("results.json");
    let found = std::fs::read_to_string(&file).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(found.contains(&version), "{found}");
    std::fs::write(&file, found.replace(&version, "\"version\": \"0.0.1\"")).unwrap();
    assert!(told(at, &resume).contains("4 cases, 1 of them to be run"));
    assert!(std::fs::read_to_string(&file).unwrap().contains(&version));
    let aside = PathBuf::from(format!("{}.old-1", lost.display())).join("results.json");
    assert!(std::fs::read_to_string(aside).unwrap().contains("\"version\": \"0.0.1\""));
    // What is chosen to be run does not hide what is known.
    succeed(at, &[&resume[..], &["--only", "rate=0.1", "--seeds", "3"]].concat());
    let more = results(&at.join("out"));
    assert_eq!(cases(&more).len(), 5);
    assert!(cases(&more).iter().all(|case| case["status"] == "done"));
}

#[test]
fn a_case_that_fails_is_named_and_the_others_are_whole() {
    let at = &new_folder();
    experiment(at, &[("[0.1, 0.4]", "[0.1, -0.4]")]);
    let output = kerrlight(at, &["compare", "rates.toml", "-o", "out", "--seeds", "1"]);
    assert_eq!(output.status.code(), Some(1));
    let said = message(&output);
    assert!(said.contains("1 of 2 cases failed: rate -0.4, seed 1"), "{said}");
    let results = results(&at.join("out"));
    assert_eq!(cases(&results)[0]["status"], "done");
    assert_eq!(cases(&results)[1]["status"], "failed");
    assert!(cases(&results)[1]["error"].as_str().unwrap().contains("-0.4"));
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    assert!(page.contains("Failed: rate -0.4, seed 1"));
}

/// A case whose files find no room is a failed case, which is done when there is room.
#[cfg(unix)]
#[test]
fn a_case_that_fills_the_disk_is_named_and_done_later() {
    let at = &new_folder();
    let nodes = [
        ("\"rate\"", "\"nodes\""),
        ("\"representation.grid.rate\"", "\"output.nodes\""),
        ("[0.1, 0.4]", "[128, 16]"),
    ];
    experiment(at, &nodes);
    let words = ["compare", "rates.toml", "-o", "out", "--seeds", "1"];
    let output = cramped(at, 1024, &words);
    let said = message(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("1 of 2 cases failed: nodes 128, seed 1"), "{said}");
    let found = results(&at.join("out"));
    assert_eq!(
        (&cases(&found)[0]["status"], &cases(&found)[1]["status"]),
        (&"failed".into(), &"done".into())
    );
    let error = cases(&found)[0]["error"].as_str().unwrap();
    assert!(error.contains("volume.npz") && error.contains("File too large"), "{error}");
    // The figure of volumes on different grids is refused; the cases are done.
    let said = message(&kerrlight(at, &[&words[..], &["--resume"]].concat()));
    assert!(said.contains("2 cases, 1 of them to be run"), "{said}");
    assert!(cases(&results(&at.join("out"))).iter().all(|case| case["status"] == "done"));
}

/// A fit that is killed in the middle is a failed case; the next run goes on with it.
#[cfg(target_os = "linux")]
#[test]
fn a_killed_case_is_gone_on_with() {
    use crate::signals::{child_of, first_case, signal};
    use crate::support::{start, until};
    let at = &new_folder();
    experiment(at, &[("steps = 30", "steps = 1200"), ("[0.1, 0.4]", "[0.1]")]);
    let words = ["compare", "rates.toml", "-o", "out", "--seeds", "1"];
    let running = start(at, &words);
    until("a fit", || first_case(at).is_some_and(|case| case.join("log.jsonl").exists()));
    signal(child_of(running.id()).expect("a fit"), "-KILL");
    assert_eq!(running.wait_with_output().unwrap().status.code(), Some(1));
    let killed = results(&at.join("out"));
    assert_eq!(cases(&killed)[0]["error"], "killed by signal 9");
    succeed(at, &[&words[..], &["--resume"]].concat());
    assert_eq!(cases(&results(&at.join("out")))[0]["status"], "done");
}

#[test]
fn experiments_are_listed_and_mistakes_are_named() {
    let at = &new_folder();
    let listed = succeed(at, &["compare"]);
    for name in ["representations", "sparsity", "axis-minimum", "velocity-mismatch", "coverage"] {
        assert!(listed.contains(name), "{listed}");
    }
    assert!(fail(at, &["compare", "sparsty"]).contains("there is no experiment sparsty"));
    for (old, new, expected) in [
        ("seeds = 2", "seeds = 0", "seeds = 0 is not allowed"),
        ("[set]", "[set]\nseed = 5", "`seed` is not allowed among the settings"),
        ("seeds = 2", "seed = 2", "unknown field `seed`"),
        ("name = \"rate\"", "name = \"seed\"", "name = \"seed\" is not allowed"),
        ("rows = [\"rate\"]", "rows = [\"rates\"]", "there is no factor \"rates\""),
        ("kind = \"time\"", "kind = \"tim\"", "unknown variant `tim`"),
        (
            "later = 0.25",
            "later = -1.0",
            "later = -1 is not allowed: 0 to 1000 (lengths of the movie)",
        ),
        ("scene_1.toml", "scene_0.toml", "scene_0.toml"),
        ("[0.1, 0.4]", "[-0.1, -0.4]", "no case can be run; rate -0.1, seed 1"),
    ] {
        experiment(at, &[(old, new)]);
        fail_with(at, &["compare", "rates.toml", "-o", "wrong"], &[expected]);
    }
    experiment(at, &[]);
    assert!(fail(at, &["compare", "rates.toml", "--only", "rate=3"]).contains("levels of rate"));
}

/// A quick look says that it is one, shows what ran and not what should have, and concludes nothing.
#[test]
fn exact_a_quick_look_claims_nothing() {
    let at = &new_folder();
    let texts = "seeds = 2\nsetup = [\"30 steps of 16 x 16 pixels.\"]\nreading = [\"The first rate wins.\"]";
    let quick = "[quick.set]\ntraining.steps = 5\nscreen.pixels = 12\n[set]";
    let beside = "caption = \"PSNR.\"\nbeside = [{ name = \"theirs\", values = [77.0] }]";
    experiment(at, &[("seeds = 2", texts), ("[set]", quick), ("caption = \"PSNR.\"", beside)]);
    let words = ["compare", "rates.toml", "--quick", "--seeds", "1"];
    let printed = succeed(at, &[&words[..], &["-o", "quick"]].concat());
    let all = results(&at.join("quick"));
    assert_eq!(all["quick"], true);
    let page = std::fs::read_to_string(at.join("quick/report.html")).unwrap();
    assert!(page.contains("<h1>Two rates (quick look, not a result)</h1>"));
    assert!(page.contains("<strong>Quick look, not a result.</strong>"));
    let tables = std::fs::read_to_string(at.join("quick/tables.md")).unwrap();
    for text in [&page, &tables, &printed] {
        assert!(text.contains("quick look, not a result"), "{text}");
        for claim in ["30 steps", "The first rate wins", "What came out", "theirs", "explained?"] {
            assert!(!text.contains(claim), "{claim}: {text}");
        }
    }
    assert!(tables.contains("| steps that were taken |  | 5 |"), "{tables}");
    assert!(tables.contains("| pixels along each side of an image | screen.pixels | 12 |"));
    // The whole experiment, changed by the command line, has its texts, and says what they are.
    let words =
        ["compare", "rates.toml", "--seeds", "1", "--set", "training.steps=6", "-o", "whole"];
    succeed(at, &words);
    let page = std::fs::read_to_string(at.join("whole/report.html")).unwrap();
    assert!(
        page.contains("30 steps")
            && page.contains("this run has changed it: --set training.steps=6")
    );
    assert!(page.contains("What came out") && page.contains("Do the fits explain their data?"));
    assert_eq!(results(&at.join("whole"))["quick"], false);
}

/// Draws around every fit: their numbers are results, and a case is done with all of them.
#[test]
fn exact_draws_are_results_of_cases() {
    let at = &new_folder();
    let value = ("value = \"psnr_db\"", "value = \"random_nodes_within_95\"");
    experiment(at, &[value]);
    let refused = fail(at, &["compare", "rates.toml", "-o", "out"]);
    assert!(refused.contains("random_nodes_within_95\" needs draws"), "{refused}");
    experiment(at, &[("seeds = 2", "samples = 1\nseeds = 2")]);
    let refused = fail(at, &["compare", "rates.toml", "-o", "out"]);
    assert!(refused.contains("samples = 1 is not allowed: 2 to 1e5 (draws)"), "{refused}");
    let few = |samples| ("seeds = 2", samples);
    experiment(at, &[value, few("samples = 2\nseeds = 1"), ("[0.1, 0.4]", "[0.1]")]);
    succeed(at, &["compare", "rates.toml", "-o", "out"]);
    let first = results(&at.join("out"));
    let within = &cases(&first)[0]["results"]["random_nodes_within_95"];
    assert!((0.0..=1.0).contains(&within.as_f64().unwrap()), "{within}");
    let run = at.join("out").join(cases(&first)[0]["folder"].as_str().unwrap());
    let numbers = json(&run.join("posterior/posterior.json"));
    assert_eq!((&numbers["samples"], &numbers["random_nodes_within_95"]), (&2.into(), within));
    // Without what follows from the draws the case is not done; with it nothing is done again.
    std::fs::remove_file(run.join("posterior/posterior.json")).unwrap();
    for expected in ["1 cases, 1 of them to be run", "1 cases, 0 of them to be run"] {
        let said = told(at, &["compare", "rates.toml", "-o", "out", "--resume"]);
        assert!(said.contains(expected), "{said}");
    }
    assert_eq!(&cases(&results(&at.join("out")))[0]["results"]["random_nodes_within_95"], within);
}

/// Results that no case can have are refused before anything runs.
#[test]
fn wrong_results_are_named_before_anything_runs() {
    let at = &new_folder();
    let value = "value = \"psnr_db\"";
    for (changes, message) in [
        (vec![(value, "value = \"nosuch\"")], "value = \"nosuch\" is not allowed: psnr_db, "),
        (vec![(value, "value = \"chi2.amplitudes\"")], "no loss has data = \"amplitudes\""),
    ] {
        experiment(at, &changes);
        fail_with(at, &["compare", "rates.toml", "-o", "out"], &["table \"Quality\"", message]);
    }
}

/// Tables of χ² have a part for each kind of data where cases compare several, whatever has put them there.
#[test]
fn exact_chi2_of_several_kinds_of_data_has_tables_of_its_own() {
    let at = &new_folder();
    let one = "{ data = \"image\", weight = 1.0, sigma = 1.0 }";
    let two = format!("[{one}, {{ data = \"light-curve\", weight = 1.0, sigma = 1.0 }}]");
    let rate =
        "name = \"rate\"\n        key = \"representation.grid.rate\"\n        values = [0.1, 0.4]";
    let levels = format!(
        "name = \"rate\"\n[[factor.level]]\nname = \"one\"\nset.loss = [{one}]\n[[factor.level]]\nname = \"both\"\n\
         set.loss = {two}"
    );
    let chi2 = ("value = \"psnr_db\"", "value = \"chi2\"");
    let batch = ("start = \"drawn\"", "start = \"drawn\", batch = { frames = 2 }");
    let tables = |words: &[&str], name: &str| {
        succeed(at, &[&["compare", "rates.toml", "--seeds", "1", "-o", name], words].concat());
        std::fs::read_to_string(at.join(name).join("tables.md")).unwrap()
    };
    let is_divided =
        |text: &str| text.contains("Quality: image") && text.contains("Quality: light curve");
    experiment(at, &[chi2, batch]);
    let set = format!("loss={two}");
    let text = tables(&["--set", &set], "set");
    assert!(is_divided(&text) && !text.contains("Quality: χ² per data point\n"), "{text}");
    experiment(at, &[chi2, batch, (rate, &levels)]);
    let text = tables(&[], "mixed");
    assert!(is_divided(&text) && text.contains("Quality: χ² per data point\n"), "{text}");
    let text = tables(&["--only", "rate=both"], "chosen");
    assert!(is_divided(&text) && !text.contains("Quality: χ² per data point\n"), "{text}");
    let text = tables(&["--only", "rate=one"], "other");
    assert!(!is_divided(&text) && text.contains("Quality: χ² per data point\n"), "{text}");
}
