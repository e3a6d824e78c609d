//! A program without graphics devices says so, and how to have them.

use crate::support::{fail, succeed};

#[test]
fn without_the_feature_devices_says_how_to_have_it() {
    let folder = tempfile::tempdir().unwrap();
    let told = succeed(folder.path(), &["devices"]);
    assert!(told.starts_with("cpu") && told.contains("--features gpu"), "{told}");
    let object = succeed(folder.path(), &["devices", "--json"]);
    let object: serde_json::Value = serde_json::from_str(&object).unwrap();
    assert!(object["threads"].as_u64() > Some(0) && object["devices"] == serde_json::json!([]));
    let told = fail(folder.path(), &["render", "--device", "gpu", "-o", "a.exr"]);
    assert!(told.contains("--device gpu") && told.contains("--features gpu"), "{told}");
    let told = fail(folder.path(), &["fit", "--device", "gpu", "-o", "run"]);
    assert!(told.contains("--device gpu") && told.contains("--features gpu"), "{told}");
}
