//! `kerrlight reproduce`: its commands make the same bytes, and changed inputs are named.

use crate::cases::experiment;
use crate::support::{binary, fail, kerrlight, succeed};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Runs the command that `reproduce` prints, as a shell reads it.
fn again(at: &Path, of: &str) -> String {
    let line = succeed(at, &["reproduce", of]);
    let line = line.replace("kerrlight ", &format!("'{}' ", binary().display()));
    let output = Command::new("sh").current_dir(at).args(["-c", &line]).output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    line
}

fn same(at: &Path, one: &str, other: &str) {
    let read = |path: &str| std::fs::read(at.join(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
    assert!(read(one) == read(other), "{one} differs");
}

#[cfg(unix)]
#[test]
fn exact_commands_make_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    experiment(at, 1, 3);
    succeed(at, &["compare", "seeds.toml", "-o", "out", "--list"]);
    succeed(at, &["compare", "seeds.toml", "-o", "out"]);
    again(at, "out");
    let case = std::fs::read_dir(at.join("out/cases")).unwrap().flatten();
    let case = case.map(|entry| entry.path()).find(|path| path.is_dir()).unwrap();
    let name = format!("out/cases/{}", case.file_name().unwrap().to_str().unwrap());
    for file in ["fit.toml", "volume.npz", "checkpoint.safetensors"] {
        same(
            at,
            &format!("{name}/{file}"),
            &format!("{name}/{file}").replace("out/", "out-again/"),
        );
    }
    again(at, &format!("{name}/volume.npz"));
    for file in ["fit.toml", "inputs.json", "volume.npz", "checkpoint.safetensors"] {
        same(at, &format!("{name}/{file}"), &format!("{name}-again/{file}"));
    }
    let record = std::fs::read(case.join("record.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    assert!(record["host"].is_string() && record["threads"].as_u64() > Some(0), "{record}");
    // What was changed is named, and the command is told nevertheless.
    let settings = case.join("fit.toml");
    let text = std::fs::read_to_string(&settings).unwrap();
    std::fs::write(&settings, format!("{text}\n")).unwrap();
    let output = kerrlight(at, &["reproduce", &name]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stdout).starts_with("kerrlight fit "));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("cannot be reproduced") && said.contains("fit.toml has changed"),
        "{said}"
    );
}

#[cfg(unix)]
#[test]
fn exact_records_and_pictures_know_their_commands() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("rays.csv"), "spin,inclination_deg,alpha,beta\n0.9,60,-6,1\n").unwrap();
    let words = ["trace", "--rays", "rays.csv", "-o", "table.csv", "--record", "table.json"];
    succeed(at, &words);
    let first = std::fs::read(at.join("table.csv")).unwrap();
    std::fs::remove_file(at.join("table.csv")).unwrap();
    let line = again(at, "table.json");
    assert!(line.starts_with("cd ") && line.contains("trace --rays rays.csv"), "{line}");
    assert!(std::fs::read(at.join("table.csv")).unwrap() == first);
    // The table itself finds its record, and what is not as it was made is said.
    assert_eq!(again(at, "table.csv"), line);
    std::fs::write(at.join("table.csv"), "mine").unwrap();
    let told = kerrlight(at, &["reproduce", "table.csv"]);
    assert!(told.status.success());
    assert!(String::from_utf8_lossy(&told.stderr).contains("table.csv has changed"));
    let record = std::fs::read_to_string(at.join("table.json")).unwrap();
    let record: Value = serde_json::from_str(&record).unwrap();
    assert!(record["inputs"][0]["path"].as_str().unwrap().ends_with("rays.csv"));
    assert!(record["outputs"][0]["path"].as_str().unwrap().ends_with("table.csv"));
    std::fs::write(at.join("rays.csv"), "spin").unwrap();
    // The command is told nevertheless.
    let changed = kerrlight(at, &["reproduce", "table.json"]);
    assert_eq!(changed.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&changed.stderr).contains("rays.csv has changed"));
    succeed(at, &["render", "-o", "a.exr", "--set", "screen.width=16"]);
    again(at, "a.exr");
    same(at, "a.exr", "a.again.exr");
    std::fs::write(at.join("notes.txt"), "mine").unwrap();
    assert!(fail(at, &["reproduce", "notes.txt"]).contains("does not tell what made it"));
}
