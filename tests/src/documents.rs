//! Documents that cannot rot: paths and commands they name exist.

use crate::support::{kerrlight, root};

fn documents() -> Vec<(String, String)> {
    let mut files = vec![root().join("README.md"), root().join("CHANGELOG.md")];
    let docs = std::fs::read_dir(root().join("docs")).expect("docs");
    files.extend(
        docs.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "md")),
    );
    files
        .into_iter()
        .map(|p| (p.display().to_string(), std::fs::read_to_string(&p).unwrap()))
        .collect()
}

/// Relative links, and words in backticks that look like paths of this repository.
#[test]
fn regress_paths_in_documents_exist() {
    let mut seen = 0;
    for (name, text) in documents() {
        let folder = std::path::Path::new(&name).parent().unwrap().to_owned();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.contains("://") && !link.starts_with('#')) {
            let target = link.split('#').next().unwrap();
            assert!(folder.join(target).exists(), "{name} links to {target}");
            seen += 1;
        }
        for word in text.split('`').skip(1).step_by(2) {
            let tops = [
                "geodesic/",
                "tomo/",
                "cli/",
                "validation/",
                "tests/",
                "scenes/",
                "docs/",
                "experiments/",
            ];
            if tops.iter().any(|top| word.starts_with(top)) && !word.contains([' ', '*']) {
                assert!(root().join(word).exists(), "{name} names {word}");
                seen += 1;
            }
        }
    }
    assert!(seen > 10, "only {seen} paths found");
}

/// Every verb that the documents run has a help page.
#[test]
fn regress_verbs_in_documents_exist() {
    for (name, text) in documents() {
        for rest in text.split("cargo run --release -- ").skip(1) {
            let verb: String =
                rest.chars().take_while(|c| c.is_alphanumeric() || *c == '-').collect();
            let output = kerrlight(&root(), &[verb.as_str(), "--help"]);
            assert!(output.status.success(), "{name} runs {verb}");
        }
    }
}

/// The table of channels in the documents is that of the program.
#[test]
fn regress_channels_are_documented() {
    let text = std::fs::read_to_string(root().join("docs/scenes.md")).unwrap();
    let table = text.split("## Channels of the EXR").nth(1).unwrap();
    for channel in &kerrlight_tomo::render::CHANNELS {
        assert!(table.contains(&format!("`{}`", channel.name)), "{}", channel.name);
    }
}
