//! A program without graphics devices says so, and how to have them.

use crate::support::{fail, object, succeed};

#[test]
fn without_the_feature_devices_says_how_to_have_it() {
    let folder = tempfile::tempdir().unwrap();
    let told = succeed(folder.path(), &["devices"]);
    assert!(told.starts_with("cpu") && told.contains("--features gpu"), "{told}");
    let found = object(folder.path(), &["devices"]);
    assert!(found["threads"].as_u64() > Some(0) && found["devices"] == serde_json::json!([]));
    let told = fail(folder.path(), &["render", "--device", "gpu", "-o", "a.exr"]);
    assert!(told.contains("--device gpu") && told.contains("--features gpu"), "{told}");
    let told = fail(folder.path(), &["fit", "--device", "gpu", "-o", "run"]);
    assert!(told.contains("--device gpu") && told.contains("--features gpu"), "{told}");
}
