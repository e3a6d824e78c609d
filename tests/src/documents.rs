//! Documents that cannot rot: the links, anchors and paths that they name exist, and their settings are TOML.

use crate::support::root;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// All pages: the READMEs, the changelog and docs/ with its folders.
pub fn pages() -> Vec<(PathBuf, String)> {
    let mut files =
        ["README.md", "CHANGELOG.md", "geodesic/README.md"].map(|p| root().join(p)).to_vec();
    collect(&root().join("docs"), &mut files);
    files.into_iter().map(|path| (path.clone(), read(&path))).collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).expect("a folder of docs/");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "md") {
            files.push(path);
        }
    }
}

/// The text of a page.
pub fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Lines of a page outside its fenced blocks of code.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut in_code = false;
    text.lines().filter(move |line| {
        let is_fence = line.starts_with("```");
        in_code ^= is_fence;
        !in_code && !is_fence
    })
}

/// The fenced blocks of code in a language.
pub fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let start = format!("```{language}\n");
    text.split(start.as_str()).skip(1).map(|rest| rest.split("\n```").next().unwrap()).collect()
}

/// Targets of the links of a page that stay in the repository.
fn links(text: &str) -> Vec<&str> {
    let of_line = |line| str::split(line, "](").skip(1).filter_map(|rest| rest.split(')').next());
    prose(text).flat_map(of_line).filter(|link| !link.contains("://")).collect()
}

/// The anchors of a page's headings, as GitHub and mdBook derive them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen = BTreeSet::new();
    for line in prose(text).filter(|line| line.starts_with('#')) {
        let anchor = anchor(line.trim_start_matches('#').trim());
        let repeated = (1..).map(|k| format!("{anchor}-{k}"));
        let mut names = std::iter::once(anchor.clone()).chain(repeated);
        seen.insert(names.find(|name| !seen.contains(name)).unwrap());
    }
    seen
}

fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn exact_anchors_are_those_of_github() {
    let text =
        "# A fit's file\n```sh\n# no heading\n```\n## `--set` & co\n## Results\n## Results\n";
    let expected = ["a-fits-file", "--set--co", "results", "results-1"];
    assert_eq!(anchors(text), expected.map(str::to_owned).into());
}

/// Links between pages and within them; those of docs/ stay there, as the site has nothing else.
#[test]
fn regress_links_in_documents_exist() {
    let mut seen = 0;
    for (path, text) in pages() {
        let name = path.display();
        for link in links(&text) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target =
                if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(target.exists(), "{name} links to {link}");
            let docs = root().join("docs");
            let target = target.canonicalize().unwrap();
            let leaves =
                path.starts_with(&docs) && !target.starts_with(docs.canonicalize().unwrap());
            assert!(!leaves, "{name} links to {link}, which the site does not have");
            let known = anchor.is_empty() || anchors(&read(&target)).contains(anchor);
            assert!(known, "{name} links to {link}: no such heading");
            seen += 1;
        }
    }
    assert!(seen > 100, "only {seen} links found");
}

/// Words in backticks that look like paths of this repository.
#[test]
fn regress_paths_in_documents_exist() {
    const TOPS: [&str; 8] =
        ["geodesic/", "tomo/", "cli/", "validation/", "tests/", "scenes/", "docs/", "experiments/"];
    let mut seen = 0;
    for (path, text) in pages() {
        for word in text.split('`').skip(1).step_by(2) {
            if TOPS.iter().any(|top| word.starts_with(top)) && !word.contains([' ', '*']) {
                assert!(root().join(word).exists(), "{} names {word}", path.display());
                seen += 1;
            }
        }
    }
    assert!(seen > 50, "only {seen} paths found");
}

/// Every page of docs/ is in the table of contents, once.
#[test]
fn regress_all_pages_are_in_the_contents() {
    let docs = root().join("docs");
    let summary = read(&docs.join("SUMMARY.md"));
    let mut listed: Vec<PathBuf> =
        links(&summary).into_iter().map(|link| docs.join(link)).collect();
    listed.sort();
    let mut there: Vec<PathBuf> = pages().into_iter().map(|(path, _)| path).collect();
    there.retain(|path| path.starts_with(&docs) && !path.ends_with("SUMMARY.md"));
    there.sort();
    assert_eq!(listed, there);
}

/// Blocks of settings are TOML.
#[test]
fn regress_settings_in_documents_are_toml() {
    let mut seen = 0;
    for (path, text) in pages() {
        for block in blocks(&text, "toml") {
            let table = block.parse::<toml::Table>();
            assert!(table.is_ok(), "{}: {}: {block}", path.display(), table.unwrap_err());
            seen += 1;
        }
    }
    assert!(seen > 3, "only {seen} blocks found");
}
