//! The binary as a user runs it.

use crate::support::{done, folder_with, message, object, scene_path, succeed};
use kerrlight_render::image::exr;

const SIZE: [&str; 4] = ["--set", "screen.width=48", "--set", "screen.height=40"];

#[test]
fn render_without_a_scene_says_so_and_writes_both_files() {
    let folder = tempfile::tempdir().unwrap();
    let output = done(folder.path(), &[&["render"][..], &SIZE[..]].concat());
    assert!(message(&output).contains("built-in scene"));
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 2, "{told}");
    assert!(lines[0].starts_with("flux ") && lines[0].contains("48 x 40 pixels"), "{told}");
    assert_eq!(lines[1], "kerrlight.exr, kerrlight.png");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    let bytes = std::fs::read(folder.path().join("kerrlight.exr")).unwrap();
    let (picture, attributes) = exr::decode(&bytes).unwrap();
    assert_eq!((picture.width, picture.height), (48, 40));
    let names = "R G B intensity redshift crossings radius azimuth delay outcome";
    assert!(names.split(' ').all(|name| picture.channel(name).is_some()));
    for name in ["version", "scene", "scene_resolved", "intensity_unit"] {
        assert!(attributes.contains_key(name), "{name}");
    }
    let text = succeed(folder.path(), &["inspect", "kerrlight.exr"]);
    for part in ["48 x 40", "intensity", "outcome", "spin = 0.5", "intensity_unit: scene unit"] {
        assert!(text.contains(part), "{part} in {text}");
    }
}

/// Attributes in the EXR are enough to render it again, to the same bytes.
#[test]
fn exact_rendering_again_from_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_path("hot_spots.toml");
    let more = ["--set", "hole.spin=-0.25", "-o", "a.exr"];
    succeed(folder.path(), &[&["render", &scene][..], &SIZE[..], &more[..]].concat());
    succeed(folder.path(), &["render", "a.exr", "-o", "b.exr", "--threads", "1"]);
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(read("a.exr") == read("b.exr"));
}

#[test]
fn trace_reads_columns_in_any_order() {
    let table =
        "# rays\nbeta,note,inclination_deg,alpha,spin\n1.0,x,60,-6,0.9\n# more\n0.5,y,90,0,0\n";
    let folder = folder_with("rays.csv", table);
    let text = succeed(folder.path(), &["trace", "--rays", "rays.csv", "--crossings", "1"]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        "spin,inclination_deg,alpha,beta,outcome,crossings,mino_total,r_min,mino_1,r_1,phi_1,delay_1,integrator,tolerance"
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

/// Of the ray along the equator without spin dr is the affine parameter: weights sum up to the way from a sphere to the
/// horizon, or from a radius to another. At the observer p_θ = β.
#[test]
fn trace_places_samples_and_weighs_them() {
    let heading = "spin,inclination_deg,alpha,beta\n";
    let folder = folder_with("radial.csv", format!("{heading}0,90,0,0\n"));
    std::fs::write(folder.path().join("bent.csv"), format!("{heading}0.9,60,7,3\n")).unwrap();
    let numbers = |file: &str, options: &str, column: &str| {
        let mut words = vec!["trace", "--observer", "100", "--rays", file];
        words.extend(options.split(' '));
        let table = object(folder.path(), &words);
        let row = table["rays"][column][0].as_array().expect(column);
        row.iter().filter_map(|number| number.as_f64()).collect::<Vec<f64>>()
    };
    let within = numbers("radial.csv", "--within 20 --samples 50 --weights", "sample_weight");
    assert_eq!(within.len(), 50);
    assert!((within.iter().sum::<f64>() - 18.0).abs() < 1e-9, "{within:?}");
    let between = numbers("radial.csv", "--between 6 30 --samples 12 --weights", "sample_weight");
    assert_eq!(between.len(), 12);
    assert!((between.iter().sum::<f64>() - 24.0).abs() < 1e-5, "{between:?}");
    let radii = numbers("bent.csv", "--between 6 30 --samples 6", "sample_r");
    assert!(radii.len() == 12 && radii.iter().all(|r| (6.0..30.0).contains(r)), "{radii:?}");
    let polar = numbers("bent.csv", "--samples 6 --momentum", "sample_p_theta");
    assert!(polar.len() == 6 && (polar[0] - 3.0).abs() < 1e-9, "{polar:?}");
    let radial = numbers("bent.csv", "--samples 6 --momentum", "sample_p_r");
    assert!(radial[0] > 0.0 && radial[5] < 0.0, "{radial:?}");
}

#[test]
fn npz_holds_an_array_a_column() {
    let table = "spin,inclination_deg,alpha,beta\n0.9,60,-6,1\n-0.5,30,2,8\n";
    let folder = folder_with("rays.csv", table);
    let arguments = ["trace", "--rays", "rays.csv", "--samples", "5", "-o", "out.npz"];
    succeed(folder.path(), &arguments);
    let bytes = std::fs::read(folder.path().join("out.npz")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    for name in ["spin.npy", "outcome.npy", "r.npy", "sample_theta.npy"] {
        assert!(text.contains(name), "{name}");
    }
    assert!(text.contains("(2, 3") && text.contains("(2, 5"), "shapes");
}
