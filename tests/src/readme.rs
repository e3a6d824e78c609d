//! The commands of the documents: those of README.md and of the tutorials run as they stand, page by page in a fresh
//! copy of the repository; those of the other pages are known to the program.

use crate::documents::{blocks, pages};
use crate::support::{binary, kerrlight, root};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Two ways to call the program.
const RUNS: [&str; 2] = ["cargo run --release -- ", "kerrlight "];

/// A command with what its comment says that it writes.
struct Shown {
    line: String,
    writes: Vec<String>,
}

/// The commands of all ```sh blocks, lines that end in a backslash joined.
fn commands(text: &str) -> Vec<Shown> {
    let joined = |block: &&str| block.replace("\\\n", " ");
    let lines: Vec<String> = blocks(text, "sh").iter().map(joined).collect();
    let lines = lines.iter().flat_map(|block| block.lines());
    lines.filter(|line| !line.trim().is_empty() && !line.starts_with('#')).map(shown).collect()
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

/// Returns the arguments that a command gives to the program, whichever way it calls it.
fn arguments(line: &str) -> Option<&str> {
    RUNS.iter().find_map(|run| line.strip_prefix(run))
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

/// Returns the arguments that make a command take seconds, not minutes; whatever it is, it is printed.
fn shorter(line: &str) -> &'static str {
    let is_whole = line.contains("--resume") || line.contains("--init");
    if is_whole || !line.contains(" fit") {
        return "";
    }
    if line.contains("unknown_geometry.toml") {
        return " --set training.steps=5 --set training.start.linear.steps=20 --set screen.pixels=20 \
                --set screen.ring_rays=2 --set search.starts=1 \
                --set 'search.coarse={trials=20,nodes=12,iterations=15,pixels=20,frames=12}' \
                --set 'search.fine={trials=10,nodes=12,iterations=20,pixels=20,frames=12}'";
    }
    if line.contains("data") || line.contains("my_fit") {
        return " --set training.steps=5 --set output.nodes=24";
    }
    if line.contains("linear") {
        return " --set training.steps=5 --set training.start.linear.steps=20 --set output.nodes=24 \
                --set screen.pixels=12 --set linear.iterations=10";
    }
    // Enough for the flare to be seen to move where its movie is observed.
    " --set training.steps=5 --set training.start.linear.steps=200 --set output.nodes=24 \
     --set screen.pixels=20 --set screen.jy_per_pixel=0.32"
}

fn run(folder: &Path, shown: &Shown) {
    let Some(rest) = arguments(&shown.line) else {
        if ["cargo test", "cargo install", "cargo run"].iter().any(|c| shown.line.starts_with(c)) {
            return eprintln!("skipped, as it compiles: {}", shown.line);
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

fn run_page(path: &Path, text: &str) -> usize {
    let all = commands(text);
    eprintln!("{}: {} commands", path.display(), all.len());
    let folder = tempfile::tempdir().unwrap();
    fresh(folder.path());
    all.iter().for_each(|shown| run(folder.path(), shown));
    all.len()
}

#[test]
#[ignore = "long"]
fn exact_readme_and_tutorials_run_as_written() {
    let tutorials = root().join("docs/tutorials");
    let is_run = |path: &Path| path == root().join("README.md") || path.starts_with(&tutorials);
    let all = pages().into_iter().filter(|(path, _)| is_run(path));
    let count: usize = all.map(|(path, text)| run_page(&path, &text)).sum();
    assert!(count > 20, "only {count} commands are found");
}

/// Commands of all pages, in ```sh blocks.
fn documented() -> Vec<(PathBuf, String)> {
    let of_page = |(path, text): (PathBuf, String)| {
        let lines = commands(&text).into_iter().map(|shown| shown.line);
        let known = lines.filter_map(|line| arguments(&line).map(str::to_owned));
        known.map(move |line| (path.clone(), line)).collect::<Vec<_>>()
    };
    pages().into_iter().flat_map(of_page).collect()
}

/// Verbs, flags and values of the documents' commands are the program's, and files of the repository are there.
#[test]
fn exact_commands_of_documents_are_known() {
    let all = documented();
    assert!(all.len() > 40, "only {} commands are found", all.len());
    for (path, line) in all {
        let name = path.display();
        let words = line.split_whitespace().take_while(|word| ![">", "|"].contains(word));
        let words: Vec<&str> = words.chain(["--help"]).collect();
        let output = kerrlight(&root(), &words);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {line}: {errors}");
        for word in words
            .iter()
            .filter(|word| word.starts_with("scenes/") || word.starts_with("experiments/"))
        {
            assert!(root().join(word).exists(), "{name} names {word}");
        }
    }
}
