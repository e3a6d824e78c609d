//! Files that a scene names: what they may refer to, and the ranges of what they hold.

use crate::support::{fail, fail_with, new_folder, told};
use kerrlight_render::volume::{Volume, VolumeFile};
use std::fs;
use std::path::Path;

const SCENE: &str = "hole = { spin = 0.6 }\nobserver = { inclination_deg = 50.0 }\nscreen = { field_of_view_m = 34.0, width = 2 }
effects = { redshift = true, spectral_index = 0.0 }\ntracer = { integrator = \"elliptic\", tolerance = 1e-4 }\n";

fn mesh(folder: &Path, name: &str) {
    let source = "scale = 1.0\nopaque = true\nbrightness = 1.0\nvelocity = \"static\"\n";
    let text = format!("{SCENE}[[mesh]]\npath = \"{name}\"\n{source}");
    fs::write(folder.join("s.toml"), text).unwrap();
}

const RENDER: [&str; 4] = ["render", "s.toml", "-o", "o.exr"];
const TRIANGLE: &str = "v 0 0 5\nv 1 0 5\nv 0 1 5\nf 1 2 3\n";

/// Files that a mesh refers to lie beside it or below it, links followed, unless the user allows
/// more.
#[test]
fn regress_meshes_stay_in_their_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (at, inside) = (folder.path(), folder.path().join("meshes"));
    fs::create_dir_all(inside.join("below")).unwrap();
    for path in [at.join("out.mtl"), inside.join("below/in.mtl")] {
        fs::write(path, "newmtl a\nKd 1 0 0\n").unwrap();
    }
    fs::write(at.join("out.bin"), [0; 36]).unwrap();
    std::os::unix::fs::symlink(at.join("out.mtl"), inside.join("link.mtl")).unwrap();
    let absolute = at.join("out.mtl").display().to_string();
    let gltf =
        r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"%2e%2e/out.bin","byteLength":36}]}"#;
    let libraries = ["../out.mtl", "link.mtl", &absolute, "below/../../out.mtl"];
    let texts = libraries.map(|name| format!("mtllib {name}\n{TRIANGLE}"));
    for text in texts.iter().map(String::as_str).chain([gltf]) {
        fs::write(inside.join("m.obj"), text).unwrap();
        mesh(at, "meshes/m.obj");
        fail_with(at, &RENDER, &["--allow-outside"]);
    }
    fs::write(inside.join("m.obj"), &texts[0]).unwrap();
    assert!(!told(at, &[&RENDER[..], &["--allow-outside"]].concat()).contains("warning: `mesh"));
    fs::write(inside.join("m.obj"), format!("mtllib below/in.mtl\n{TRIANGLE}")).unwrap();
    assert!(!told(at, &RENDER).contains("warning: `mesh"));
    fs::write(inside.join("m.obj"), format!("mtllib none.mtl\n{TRIANGLE}")).unwrap();
    assert!(told(at, &RENDER).contains("line 1: there is no `none.mtl`"));
}

/// Corners and axes of a file have the ranges of the scene's own keys.
#[test]
fn regress_volumes_of_files_have_the_ranges_of_scenes() {
    let at = &new_folder();
    let volume = "path = \"x.npz\"\nfactor = 1.0\nrotation = \"keplerian\"\nreference_time = 0.0\n";
    fs::write(at.join("s.toml"), format!("{SCENE}[[volume]]\n{volume}")).unwrap();
    let write = |size: f64, value: f32, axis: f64| {
        let volume = Volume::new([2; 3], [-size; 3], [size; 3], vec![value; 8]).unwrap();
        let file = VolumeFile { volume, axis: Some([0.0, 0.0, axis]) };
        fs::write(at.join("x.npz"), file.to_npz()).unwrap();
    };
    for size in [1.1e6, 1e20, 1e155, 1e200, 1e300, 1e308] {
        write(size, 1.0, 1.0);
        fail_with(at, &RENDER, &["array low", "[-1e6, 1e6]"]);
    }
    write(10.0, 1e13, 1.0);
    assert!(fail(at, &RENDER).contains("times factor"));
    write(10.0, 1.0, 1e200);
    assert!(fail(at, &RENDER).contains("array axis"));
    write(10.0, 1.0, 2.0);
    told(at, &RENDER);
}
