//! Fits that are resumed: with the data, settings and state they had, alone, or not at all.

use crate::fit::{results, with};
use crate::fit_bad_luck::movie;
use crate::support::{
    are_the_same, fail, fail_with, holds, kerrlight, kill, killed, new_folder, root, sets, start,
    succeed, told, until,
};
use std::path::Path;

/// An array of telescopes as a file, and the words of a fit of what it sees.
fn of_an_array(at: &Path) -> Vec<&'static str> {
    let sites = "#Site X Y Z SEFDR SEFDL FR_PAR FR_ELEV FR_OFF DR_RE DR_IM DL_RE DL_IM\n\
                 AA 2225061.164 -5440057.37 -2481681.15 90 90 1 0 0 0 0 0 0\n\
                 LM -768713.9637 -5988541.7982 2063275.9472 600 600 1 0 0 0 0 0 0\n\
                 AZ -1828796.2 -5054406.8 3427865.2 11000 11000 1 0 0 0 0 0 0\n\
                 SP 0.01 0.01 -6359609.7 5000 5000 1 0 0 0 0 0 0\n";
    std::fs::write(at.join("array.txt"), sites).unwrap();
    let settings = sets(&[
        "simulation.observation.array=array.txt",
        "representation=grid",
        "representation.grid.nodes=12",
        "screen.pixels=12",
        "simulation.observation.scans=6",
        "training.steps=400",
        "training.log_every=10",
        "training.checkpoint_seconds=0.02",
        "training.start=drawn",
        "output.nodes=16",
    ]);
    [&["fit"], &settings[..]].concat()
}

/// Returns the message of a `fit --resume run` that must be refused and must change nothing. What the kill has cut short
/// in the middle of writing is no file of the run, and may go.
fn refused(at: &Path) -> String {
    let all = || {
        let entries = std::fs::read_dir(at.join("run")).unwrap().flatten();
        let whole = entries.filter(|e| !e.file_name().to_string_lossy().starts_with(".kerrlight-"));
        let mut files: Vec<_> =
            whole.map(|entry| (entry.path(), std::fs::read(entry.path()).unwrap())).collect();
        files.sort();
        files
    };
    let before = all();
    let message = fail(at, &["fit", "--resume", "run"]);
    assert!(all() == before, "{message}");
    message
}

#[cfg(unix)]
#[test]
fn exact_changed_inputs_and_damaged_state_are_refused() {
    let at = &new_folder();
    let words = of_an_array(at);
    succeed(at, &[&words[..], &["-o", "whole"]].concat());
    assert!(results(&at.join("whole"))["inputs"].to_string().contains("array.txt"));
    let logged = || holds(&at.join("run/log.jsonl"), "psnr_db");
    killed(at, &[&words[..], &["-o", "run"]].concat(), "a logged step", logged);
    // A bit of every file that decides what follows.
    let restored = |name: &str, said: &str| {
        let path = at.join(name);
        let bytes = std::fs::read(&path).unwrap();
        for place in [bytes.len() / 3, bytes.len() / 2, bytes.len() - 2] {
            let mut flipped = bytes.clone();
            flipped[place] ^= 1;
            std::fs::write(&path, flipped).unwrap();
            let message = refused(at);
            assert!(message.contains(said), "{name}, byte {place}: {message}");
        }
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let message = refused(at);
        assert!(message.contains(said), "{name}, cut: {message}");
        std::fs::remove_file(&path).unwrap();
        let gone = kerrlight(at, &["fit", "--resume", "run"]);
        std::fs::write(&path, &bytes).unwrap();
        gone.status.code()
    };
    assert_eq!(restored("array.txt", "array.txt has changed since run was begun"), Some(2));
    assert_eq!(restored("run/fit.toml", "fit.toml was changed or damaged"), Some(2));
    assert_eq!(restored("run/inputs.json", "run"), Some(2));
    let path = at.join("run/checkpoint.safetensors");
    let bytes = std::fs::read(&path).unwrap();
    for place in [4, 40, 300, bytes.len() / 2, bytes.len() - 1] {
        let mut flipped = bytes.clone();
        flipped[place] ^= 4;
        std::fs::write(&path, flipped).unwrap();
        let message = refused(at);
        assert!(message.contains("checkpoint.safetensors (restore it, or remove it"), "{message}");
    }
    std::fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
    assert!(refused(at).contains("remove it to start over"));
    // Of the same fit with other settings.
    succeed(at, &[&words[..], &["-o", "other", "--set", "representation.grid.rate=2e-3"]].concat());
    std::fs::copy(at.join("other/checkpoint.safetensors"), &path).unwrap();
    assert!(refused(at).contains("belongs to a run with other settings"));
    std::fs::write(&path, &bytes).unwrap();
    succeed(at, &["fit", "--resume", "run"]);
    are_the_same(at, ["whole", "run"], &["volume.npz", "movie.npz"]);
}

/// A movie with one number changed is another movie. `-o` takes an empty folder, as its help says.
#[test]
fn exact_a_changed_movie_is_refused() {
    let at = &new_folder();
    let mut words = movie(at, "0.5");
    words[1] = "changed.toml".to_owned();
    let path = at.join("frame.csv");
    let image = std::fs::read_to_string(&path).unwrap();
    std::fs::create_dir(at.join("run")).unwrap();
    let help = succeed(at, &["fit", "--help"]);
    assert!(help.contains("new or empty"), "{help}");
    succeed(at, &with(&words, &["-o", "run", "--set", "training.steps=5"]));
    std::fs::write(&path, image.replacen("0.5", "0.7", 1)).unwrap();
    let message = refused(at);
    assert!(message.contains("frame.csv has changed since run was begun"), "{message}");
    std::fs::remove_file(&path).unwrap();
    assert!(refused(at).contains("frame.csv"));
    std::fs::write(&path, &image).unwrap();
    succeed(at, &["fit", "--resume", "run"]);
    // The same words in another folder name another movie.
    let text = std::fs::read_to_string(at.join("run/fit.toml")).unwrap();
    let (_, text) = text.split_once('\n').unwrap();
    std::fs::create_dir(at.join("other")).unwrap();
    std::fs::write(at.join("other/frame.csv"), image.replacen("0.5", "0.7", 1)).unwrap();
    for name in ["again.toml", "other/again.toml"] {
        std::fs::write(at.join(name), text).unwrap();
    }
    let said = ["differs from the settings", "its paths start from", "other"];
    fail_with(at, &["fit", "other/again.toml", "--resume", "run"], &said);
    for same in ["again.toml", "other/../again.toml", "run/fit.toml"] {
        succeed(at, &["fit", same, "--resume", "run"]);
    }
}

/// Two processes in one folder: the second is refused, and a lock does not survive a kill.
#[test]
fn exact_a_folder_belongs_to_one_process() {
    let at = &new_folder();
    let mut words = of_an_array(at);
    words.extend(["--set", "training.steps=1000000", "-o", "run"]);
    let child = start(at, &words);
    until("a checkpoint", || at.join("run/checkpoint.safetensors").exists());
    let resume = ["fit", "--resume", "run"];
    assert!(fail(at, &resume).contains("run is in use: another kerrlight fits in it"));
    assert!(fail(at, &words).contains("is not an empty folder"));
    kill(child);
    // Not the lock is in the way now.
    let mut array = std::fs::read_to_string(at.join("array.txt")).unwrap();
    array.push_str("# changed\n");
    std::fs::write(at.join("array.txt"), array).unwrap();
    assert!(fail(at, &resume).contains("array.txt has changed"));
}

/// The same of a comparison: one at a time, and cases of other data are not mixed with those that are there.
#[cfg(unix)]
#[test]
fn exact_comparisons_are_resumed_alone_with_the_same_data() {
    let at = &new_folder();
    of_an_array(at);
    let array = at.join("array.txt");
    let text = format!(
        r#"
        title = "Rates"
        question = "Which?"
        seeds = 1
        fit = {:?}
        [set]
        simulation.observation.array = {array:?}
        simulation.observation.scans = 8
        screen.pixels = 12
        output.nodes = 12
        training = {{ steps = 4, log_every = 2, start = "drawn" }}
        [[factor]]
        name = "rate"
        key = "representation.network.rate"
        values = [1e-4, 2e-4]
        "#,
        root().join("cli/src/fit/built_in.toml")
    );
    std::fs::write(at.join("rates.toml"), &text).unwrap();
    let only = ["compare", "rates.toml", "-o", "out", "--only"];
    succeed(at, &[&only[..], &["rate=0.0001"]].concat());
    let resume = ["compare", "rates.toml", "-o", "out", "--resume"];
    let sites = std::fs::read_to_string(&array).unwrap();
    std::fs::write(&array, sites.replace("11000", "12000")).unwrap();
    let before = std::fs::read(at.join("out/results.json")).unwrap();
    fail_with(at, &resume, &["array.txt has changed since"]);
    assert!(std::fs::read(at.join("out/results.json")).unwrap() == before);
    std::fs::write(&array, sites).unwrap();
    // Damaged results of a case are made again, from its checkpoint.
    let cases = std::fs::read_dir(at.join("out/cases")).unwrap().flatten();
    let case = cases.map(|entry| entry.path()).find(|path| path.is_dir()).unwrap();
    let path = case.join("results.json");
    let mut flipped = std::fs::read(&path).unwrap();
    let at_digit = flipped.iter().rposition(u8::is_ascii_digit).unwrap();
    flipped[at_digit] ^= 1;
    std::fs::write(&path, flipped).unwrap();
    let said = told(at, &resume);
    assert!(said.contains("2 cases, 2 of them to be run"), "{said}");
    let lock = std::fs::File::open(at.join("out/lock")).unwrap();
    lock.try_lock().unwrap();
    assert!(fail(at, &resume).contains("another kerrlight compares in it"));
}
