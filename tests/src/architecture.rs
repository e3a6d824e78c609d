//! The order of folders is the flow of data: a module imports from what stands before it, and no
//! two files import each other in a circle.

use crate::support::root;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The rooms of a crate in the order in which its `lib.rs` declares them.
fn rooms(source: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(source.join("lib.rs")).unwrap();
    let declared = text.lines().filter_map(|line| {
        let line = line.strip_prefix("pub ").unwrap_or(line);
        Some(line.strip_prefix("mod ")?.strip_suffix(';')?.to_owned())
    });
    declared.collect()
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_string_lossy().into_owned();
        if name == "tests" || name == "tests.rs" {
            continue;
        }
        if entry.is_dir() {
            files(&entry, found);
        } else if name.ends_with(".rs") {
            found.push(entry);
        }
    }
}

/// `numbers::dual` of `src/numbers/dual.rs`, `simd` of `src/simd/mod.rs`.
fn module(source: &Path, file: &Path) -> Vec<String> {
    let relative = file.strip_prefix(source).unwrap().with_extension("");
    let mut parts: Vec<_> =
        relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if parts.last().is_some_and(|last| last == "mod" || last == "lib") {
        parts.pop();
    }
    parts
}

/// The code of a file, without comments and without the tests at its end.
fn code(file: &Path) -> String {
    let text = std::fs::read_to_string(file).unwrap();
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// Paths of a `use` tree, `a::{b, c::d}` as `a::b` and `a::c::d`.
fn leaves(tree: &str, prefix: &str, found: &mut Vec<String>) {
    let mut depth = 0;
    let mut start = 0;
    for (at, letter) in tree.char_indices().chain([(tree.len(), ',')]) {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = tree[start..at].trim();
                start = at + 1;
                match part.split_once('{') {
                    Some((head, rest)) => {
                        let rest = rest.trim_end().trim_end_matches('}');
                        leaves(rest, &format!("{prefix}{}", head.trim()), found);
                    }
                    None if !part.is_empty() => found.push(format!("{prefix}{part}")),
                    None => {}
                }
            }
            _ => {}
        }
    }
}

/// Returns the imports of a file from its own crate, as paths from the root.
fn imports(source: &Path, file: &Path) -> Vec<Vec<String>> {
    let code = code(file);
    let mut paths = Vec::new();
    for rest in code.split("use ").skip(1) {
        if let Some((tree, _)) = rest.split_once(';') {
            leaves(&tree.replace('\n', " "), "", &mut paths);
        }
    }
    let own = module(source, file);
    let is_mod = file.file_name().unwrap() == "mod.rs";
    let inline = code.split("crate::").skip(1).map(|rest| {
        let path = rest.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).next();
        format!("crate::{}", path.unwrap())
    });
    paths.extend(inline);
    let absolute = paths.iter().filter_map(|path| {
        let mut parts: Vec<String> = path.split("::").map(|part| part.trim().to_owned()).collect();
        let mut place = own.clone();
        if !is_mod {
            place.pop();
        }
        match parts.first()?.as_str() {
            "crate" => return Some(parts.split_off(1)),
            "super" => {}
            _ => return None,
        }
        // `super` of a file is its folder; of a folder's `mod.rs`, the folder above.
        if is_mod {
            place.pop();
        }
        parts.remove(0);
        while parts.first().is_some_and(|part| part == "super") {
            place.pop();
            parts.remove(0);
        }
        place.extend(parts);
        Some(place)
    });
    absolute.collect()
}

/// The file that a path leads to: the one of its longest leading part.
fn target<'a>(path: &[String], modules: &'a BTreeMap<Vec<String>, PathBuf>) -> Option<&'a PathBuf> {
    (1..=path.len()).rev().find_map(|length| modules.get(&path[..length]))
}

struct House {
    source: PathBuf,
    rooms: Vec<String>,
    /// File → the files that it imports from.
    arrows: BTreeMap<PathBuf, BTreeSet<PathBuf>>,
}

impl House {
    fn of(name: &str) -> House {
        let source = root().join(name).join("src");
        let mut all = Vec::new();
        files(&source, &mut all);
        let modules: BTreeMap<_, _> =
            all.iter().map(|file| (module(&source, file), file.clone())).collect();
        let arrows = all.iter().map(|file| {
            let found = imports(&source, file);
            let found = found.iter().filter_map(|path| target(path, &modules));
            (file.clone(), found.filter(|to| *to != file).cloned().collect())
        });
        House { arrows: arrows.collect(), rooms: rooms(&source), source }
    }

    fn room(&self, file: &Path) -> Option<usize> {
        let name = module(&self.source, file).into_iter().next()?;
        self.rooms.iter().position(|room| *room == name)
    }

    fn shown(&self, file: &Path) -> String {
        file.strip_prefix(&self.source).unwrap().display().to_string()
    }

    /// Imports from a room that stands later.
    fn backward(&self) -> Vec<String> {
        let mut found = Vec::new();
        for (file, targets) in &self.arrows {
            for target in targets {
                if let (Some(own), Some(other)) = (self.room(file), self.room(target))
                    && other > own
                {
                    found.push(format!("{} -> {}", self.shown(file), self.shown(target)));
                }
            }
        }
        found
    }

    /// Everything that a file reaches by imports.
    fn reaches(&self, from: &Path) -> BTreeSet<&PathBuf> {
        let mut seen = BTreeSet::new();
        let mut next: Vec<&PathBuf> = self.arrows[from].iter().collect();
        while let Some(file) = next.pop() {
            if seen.insert(file) {
                next.extend(&self.arrows[file]);
            }
        }
        seen
    }

    /// Files that import each other in a circle.
    fn circular(&self) -> Vec<String> {
        let circular = self.arrows.keys().filter(|file| self.reaches(file).contains(file));
        circular.map(|file| self.shown(file)).collect()
    }
}

/// Crates whose `lib.rs` declares its rooms in the order of the data, and the least number of imports in them.
const FLOWS: [(&str, usize); 6] = [
    ("geodesic", 150),
    ("common", 10),
    ("render", 300),
    ("vlbi", 150),
    ("tomo", 500),
    ("imaging", 20),
];

#[test]
fn regress_rooms_import_from_what_stands_before() {
    for (name, least) in FLOWS {
        let house = House::of(name);
        let arrows: usize = house.arrows.values().map(BTreeSet::len).sum();
        assert!(arrows > least, "only {arrows} imports found in {name}");
        assert_eq!(house.backward(), [""; 0], "{name}");
    }
}

#[test]
fn regress_no_crate_has_a_circle_of_imports() {
    for name in FLOWS.map(|(name, _)| name).into_iter().chain(["cli"]) {
        assert_eq!(House::of(name).circular(), [""; 0], "{name}");
    }
}

/// The manifest of the geodesic crate inherits nothing, so that a copy of its folder builds; what it repeats is that of
/// the workspace.
#[test]
fn exact_the_geodesic_crate_stands_alone() {
    let read = |file: &str| -> toml::Table {
        std::fs::read_to_string(root().join(file)).unwrap().parse().unwrap()
    };
    let (own, all) = (read("geodesic/Cargo.toml"), read("Cargo.toml"));
    let text = own.to_string();
    assert!(!text.contains("workspace") && !text.contains("path = \"..\""), "{text}");
    let workspace = all["workspace"].as_table().unwrap();
    for (key, value) in workspace["package"].as_table().unwrap() {
        assert_eq!(&own["package"][key], value, "{key}");
    }
    assert_eq!(own["lints"], workspace["lints"]);
    let version = |table: &toml::Value| table.get("version").unwrap_or(table).clone();
    for kind in ["dependencies", "dev-dependencies"] {
        for (name, dependency) in own[kind].as_table().unwrap() {
            if let Some(shared) = workspace["dependencies"].get(name) {
                assert_eq!(version(dependency), version(shared), "{name}");
            }
        }
    }
}
