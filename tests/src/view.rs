//! The page of `kerrlight view` is whole, small, and has the shaders of the crate in it.

use crate::support::{fail, succeed};
use kerrlight_geodesic::wgsl;

#[test]
fn exact_the_page_has_the_tracer_and_loads_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let told = succeed(folder.path(), &["view", "--web", "page"]);
    assert!(told.contains("page/index.html"), "{told}");
    let page = std::fs::read_to_string(folder.path().join("page/index.html")).unwrap();
    assert!(page.contains(&wgsl::library()) && !page.contains("/*SHADER*/"));
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("import "));
    assert!(page.len() < 5_000_000);
}

#[test]
fn a_folder_that_is_a_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("page"), "no folder").unwrap();
    let told = fail(folder.path(), &["view", "--web", "page"]);
    assert!(told.contains("cannot make the folder page"), "{told}");
}
