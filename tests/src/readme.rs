//! The commands of the documents: those of README.md run as they stand, in their order, in a fresh copy of the
//! repository; those of docs/ are known to the program.

use crate::support::{binary, kerrlight, root};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const RUN: &str = "cargo run --release -- ";

/// A command with what its comment says that it writes.
struct Shown {
    line: String,
    writes: Vec<String>,
}

/// The commands of all ```sh blocks, lines that end in a backslash joined.
fn commands(text: &str) -> Vec<Shown> {
    let blocks = text.split("```sh\n").skip(1).map(|rest| rest.split("\n```").next().unwrap());
    let joined: Vec<String> = blocks.map(|block| block.replace("\\\n", " ")).collect();
    joined.iter().flat_map(|block| block.lines()).map(shown).collect()
}

fn shown(line: &str) -> Shown {
    let (line, comment) = line.split_once(" # ").unwrap_or((line, ""));
    let mut writes: Vec<String> = Vec::new();
    if let Some(list) = comment.trim().strip_prefix("writes ") {
        writes.extend(list.split(" and ").map(str::to_owned));
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    if let Some(at) = words.iter().position(|word| *word == "convert") {
        writes.extend(words.get(at + 2).map(|name| (*name).to_owned()));
    }
    for pair in words.windows(2) {
        if ["-o", "--preview", "--plot", "--gif", ">"].contains(&pair[0]) {
            writes.push(pair[1].to_owned());
        }
    }
    Shown { line: line.trim().to_owned(), writes }
}

/// A copy of all files that git tracks.
fn fresh(to: &Path) {
    let list = Command::new("git").current_dir(root()).args(["ls-files", "-z"]).output();
    let list = list.expect("git runs");
    assert!(list.status.success(), "git lists the files of a clone");
    let list = String::from_utf8(list.stdout).expect("names in UTF-8");
    for name in list.split('\0').filter(|name| root().join(name).is_file()) {
        let target = to.join(name);
        std::fs::create_dir_all(target.parent().unwrap()).unwrap();
        std::fs::copy(root().join(name), target).unwrap();
    }
}

/// What is added to a command so that it takes seconds, not minutes; whatever it is, it is printed.
fn shorter(line: &str) -> &'static str {
    let is_whole = line.contains("--resume") || line.contains("--init");
    if line.contains(" fit") && !is_whole {
        return " --set training.steps=5 --set output.nodes=24";
    }
    ""
}

fn run(folder: &Path, shown: &Shown) {
    let Some(rest) = shown.line.strip_prefix(RUN) else {
        if shown.line.starts_with("cargo test") {
            return eprintln!("skipped, as it is what runs now: {}", shown.line);
        }
        assert!(!shown.line.starts_with("cargo"), "{}: no way to run it here", shown.line);
        return check(folder, shown, &shown.line, "");
    };
    let more = shorter(&shown.line);
    check(folder, shown, &format!("'{}' {rest}{more}", binary().display()), more);
}

fn check(folder: &Path, shown: &Shown, script: &str, more: &str) {
    let begun = Instant::now();
    let output = Command::new("bash").current_dir(folder).args(["-c", script]).output();
    let output = output.expect("bash runs");
    let seconds = begun.elapsed().as_secs_f64();
    let shortened = if more.is_empty() { "" } else { ", shortened by" };
    eprintln!("{seconds:5.1} s: {}{shortened}{more}", shown.line);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", shown.line);
    for name in &shown.writes {
        let is_new = |path: &Path| {
            let written = std::fs::metadata(path).and_then(|data| data.modified());
            written.is_ok_and(|at| at.elapsed().is_ok_and(|age| age.as_secs_f64() < seconds + 5.0))
        };
        assert!(is_new(&folder.join(name)), "{} does not write {name}: {errors}", shown.line);
    }
}

#[test]
fn exact_readme_runs_as_written() {
    let folder = tempfile::tempdir().unwrap();
    fresh(folder.path());
    let all = commands(&std::fs::read_to_string(root().join("README.md")).unwrap());
    assert!(all.len() > 20, "only {} commands are found", all.len());
    all.iter().for_each(|shown| run(folder.path(), shown));
}

/// Commands of docs/, in blocks of code: with ` cargo run --release -- ` or `kerrlight` in front.
fn documented() -> Vec<(String, Vec<String>)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(root().join("docs")).expect("docs") {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "md") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap().replace("\\\n", " ");
        for line in text.lines() {
            let indented = line.strip_prefix("    ");
            let command = indented.and_then(|line| line.strip_prefix("kerrlight "));
            let command = command.or(indented.unwrap_or(line).strip_prefix(RUN));
            let Some(command) = command else { continue };
            let command = command.split(" # ").next().unwrap();
            let words = command.split_whitespace().map(str::to_owned).collect();
            all.push((path.display().to_string(), words));
        }
    }
    all
}

/// Verbs, flags and values of the documents' commands are the program's, and files of the repository are there.
#[test]
fn exact_commands_of_documents_are_known() {
    let all = documented();
    assert!(all.len() > 10, "only {} commands are found", all.len());
    for (name, words) in all {
        let mut arguments: Vec<&str> = words.iter().map(String::as_str).collect();
        arguments.push("--help");
        let output = kerrlight(&root(), &arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {}: {errors}", words.join(" "));
        for word in words
            .iter()
            .filter(|word| word.starts_with("scenes/") || word.starts_with("experiments/"))
        {
            assert!(root().join(word).exists(), "{name} names {word}");
        }
    }
}
