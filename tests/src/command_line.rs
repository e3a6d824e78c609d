//! The binary as a user runs it.

use crate::support::{kerrlight, root, succeed};
use kerrlight_tomo::image::exr;

const SIZE: [&str; 4] = ["--set", "screen.width=48", "--set", "screen.height=40"];

#[test]
fn render_without_a_scene_says_so_and_writes_both_files() {
    let folder = tempfile::tempdir().unwrap();
    let output = kerrlight(folder.path(), &[&["render"][..], &SIZE[..]].concat());
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("built-in scene"));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "kerrlight.exr\nkerrlight.png\n");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    let bytes = std::fs::read(folder.path().join("kerrlight.exr")).unwrap();
    let (picture, attributes) = exr::decode(&bytes).unwrap();
    assert_eq!((picture.width, picture.height), (48, 40));
    let names = [
        "R",
        "G",
        "B",
        "intensity",
        "redshift",
        "crossings",
        "radius",
        "azimuth",
        "delay",
        "outcome",
    ];
    assert!(names.iter().all(|name| picture.channel(name).is_some()));
    for name in ["version", "scene", "scene_resolved", "intensity_unit"] {
        assert!(attributes.contains_key(name), "{name}");
    }
}

/// What is written into the EXR is enough to render it again, to the same bytes.
#[test]
fn exact_rendering_again_from_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let scene = root().join("scenes/hot_spots.toml");
    let scene = scene.to_str().unwrap();
    let more = ["--set", "hole.spin=-0.25", "-o", "a.exr"];
    succeed(folder.path(), &[&["render", scene][..], &SIZE[..], &more[..]].concat());
    succeed(folder.path(), &["render", "a.exr", "-o", "b.exr", "--threads", "1"]);
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(read("a.exr") == read("b.exr"));
}

#[test]
fn inspect_shows_channels_and_settings() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &[&["render", "-o", "a.exr"][..], &SIZE[..]].concat());
    let text = succeed(folder.path(), &["inspect", "a.exr"]);
    for part in ["48 x 40", "intensity", "outcome", "spin = 0.5", "intensity_unit: scene unit"] {
        assert!(text.contains(part), "{part} in {text}");
    }
}

#[test]
fn trace_reads_columns_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let table =
        "# rays\nbeta,note,inclination_deg,alpha,spin\n1.0,x,60,-6,0.9\n# more\n0.5,y,90,0,0\n";
    std::fs::write(folder.path().join("rays.csv"), table).unwrap();
    let text = succeed(folder.path(), &["trace", "--rays", "rays.csv", "--crossings", "1"]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        "spin,inclination_deg,alpha,beta,outcome,crossings,mino_total,r_min,mino_1,r_1,phi_1,delay_1,tolerance"
    );
    assert_eq!(lines.len(), 3);
    assert!(
        lines[1].starts_with("9.0000000000000002e-1,6.0000000000000000e1,")
            && lines[1].contains(",escaped,")
    );
    assert!(lines[2].contains(",captured,"));
    succeed(folder.path(), &["trace", "--rays", "rays.csv", "--crossings", "1", "-o", "out.csv"]);
    assert_eq!(std::fs::read_to_string(folder.path().join("out.csv")).unwrap(), text);
}
