//! The small made-up files that the fuzz targets of tests/fuzz start from, read once more: data or
//! an error, never a panic.

use crate::support::root;
use kerrlight_vlbi::{array, files};

fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = root().join("tests/fuzz/corpus").join(target);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{folder:?}: {e}"));
    let mut all: Vec<_> = entries
        .map(|entry| {
            let path = entry.expect("an entry").path();
            (path.display().to_string(), std::fs::read(&path).expect("a readable file"))
        })
        .collect();
    all.sort();
    assert!(all.len() >= 3, "{target}");
    all
}

#[test]
fn regress_corpora_are_read_or_refused() {
    let mut good = 0;
    for (name, bytes) in corpus("uvfits") {
        let result = files::read_uvfits(&bytes);
        assert_eq!(result.is_ok(), name.contains("good"), "{name}: {:?}", result.err());
        good += usize::from(result.is_ok());
    }
    for (target, parse) in
        [("obs_text", files::parse_obs_text as fn(&str) -> _), ("table", files::parse_table)]
    {
        for (name, bytes) in corpus(target) {
            let Ok(text) = core::str::from_utf8(&bytes) else { continue };
            let result = parse(text);
            assert_eq!(result.is_ok(), name.contains("good"), "{name}: {:?}", result.err());
            good += usize::from(result.is_ok());
        }
    }
    for (name, bytes) in corpus("array") {
        let Ok(text) = core::str::from_utf8(&bytes) else { continue };
        assert_eq!(array::parse(text).is_ok(), name.contains("good"), "{name}");
    }
    assert!(good >= 4);
}
