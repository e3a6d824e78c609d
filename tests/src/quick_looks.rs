//! `kerrlight compare --quick` of every experiment that the program carries.

use crate::compare::cases;
use crate::eht_data::{M87, SGRA, SGRA_POLARIZED, data};
use crate::fit::results;
use crate::support::{new_folder, succeed};

/// Returns the changes for an experiment with public data; none, and says so, where the data are not
/// there.
fn on_public_data(name: &str) -> Option<Vec<String>> {
    let (kind, file) = match name {
        "m87-2017" => ("visibilities", M87),
        "sgra-2017" | "sgra-2017-motion" => ("visibilities", SGRA),
        "sgra-2017-polarization" => ("visibilities", SGRA_POLARIZED),
        "sgra-2017-polarimetry" => ("light-curve", SGRA_POLARIZED),
        _ => return Some(Vec::new()),
    };
    let path = data(file)?;
    Some(vec!["--set".to_owned(), format!("data.{kind}.path={}", path.display())])
}

/// Experiments of what the gate looks at: holes, flows and matter that are not known.
const GEOMETRIES: [&str; 3] = ["geometry", "soft-flow", "calibration"];

#[test]
#[ignore = "long"]
fn exact_quick_variants_of_geometries_run() {
    let all = experiments();
    assert!(GEOMETRIES.iter().all(|name| all.iter().any(|known| known == name)), "{all:?}");
    quick_looks(GEOMETRIES.map(str::to_owned).to_vec());
}

#[test]
#[ignore = "long"]
fn exact_quick_variants_of_all_other_experiments_run() {
    let mut names = experiments();
    names.retain(|name| !GEOMETRIES.contains(&name.as_str()));
    assert!(names.len() >= 9, "{names:?}");
    quick_looks(names);
}

/// Names of the experiments that the program carries.
fn experiments() -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let listed = succeed(folder.path(), &["compare"]);
    let names = listed.lines().take_while(|line| !line.is_empty());
    names.filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

/// A look at each of these experiments: all cases are done, every table is filled, the page is whole.
fn quick_looks(names: Vec<String>) {
    let at = &new_folder();
    for name in &names {
        let Some(set) = on_public_data(name) else { continue };
        let words = ["compare", name, "--quick", "-o", name];
        let words = words.into_iter().chain(set.iter().map(String::as_str));
        let printed = succeed(at, &words.collect::<Vec<_>>());
        assert!(printed.contains("| ") && !printed.contains("NaN"), "{name}: {printed}");
        let results = results(&at.join(name));
        assert!(cases(&results).iter().all(|case| case["status"] == "done"), "{name}");
        let page = std::fs::read_to_string(at.join(name).join("report.html")).unwrap();
        for word in ["What was asked", "What was run", "</html>"] {
            assert!(page.contains(word), "{name}: {word}");
        }
    }
}
