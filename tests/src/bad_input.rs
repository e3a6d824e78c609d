//! Bad input gets one clear message, exit code 2, and nothing written.

use crate::support::{
    fail, fail_with, folder_with, kerrlight, message, new_folder, root, sets, succeed, told,
    words_of,
};

#[test]
fn files_that_cannot_be_read() {
    let path = &new_folder();
    fail_with(path, &["render", "nowhere.toml"], &["nowhere.toml", "No such file"]);
    assert!(fail(path, &["render", "."]).contains("directory"));
    assert!(fail(path, &["inspect", "nowhere.exr"]).contains("nowhere.exr"));
    std::fs::write(path.join("text.exr"), "no picture").unwrap();
    assert!(fail(path, &["inspect", "text.exr"]).contains("not an EXR"));
    std::fs::write(path.join("binary.toml"), [0xff, 0xfe, 0x00]).unwrap();
    assert!(fail(path, &["render", "binary.toml"]).contains("UTF-8"));
}

#[test]
fn outputs_that_cannot_be_written() {
    let path = &new_folder();
    std::fs::create_dir(path.join("folder.exr")).unwrap();
    assert!(fail(path, &["render", "-o", "folder.exr"]).contains("is a directory"));
    assert!(fail(path, &["render", "-o", "no/such/a.exr"]).contains("no directory no/such"));
    assert!(fail(path, &["render", "-o", "a.jpg"]).contains("must end in .exr"));
    assert!(fail(path, &["render", "--preview", "a.exr"]).contains("must end in .png"));
}

#[test]
fn scenes_that_are_none() {
    let path = &new_folder();
    let good = std::fs::read_to_string(root().join("scenes/disc_face_on.toml")).unwrap();
    let run = |text: &str| {
        std::fs::write(path.join("scene.toml"), text).unwrap();
        fail(path, &["render", "scene.toml", "-o", "a.exr"])
    };
    let line = |find: &str| good.lines().position(|l| l.contains(find)).unwrap() + 1;
    let message = run(&good.replace("spin = 0.0", "spin = 1.2"));
    let expected =
        format!("line {}: `hole.spin` = 1.2 is not allowed: -1 to 1 (a/M)", line("spin ="));
    assert!(message.contains("scene.toml") && message.contains(&expected), "{message}");
    assert!(run(&good.replace("width = 512", "width = 0")).contains("`screen.width` = 0"));
    assert!(run(&good.replace("width = 512", "width = 1000000000")).contains("1 to 16384"));
    let message = run(&good.replace("width = 512", "width = 512\nchannels = [\"G\", \"g\"]"));
    assert!(message.contains("no channel `g`; it has R, G, B, intensity"), "{message}");
    assert!(run(&good[..good.len() / 2 + 3]).contains("scene.toml"));
    let message = run(&good.replace("opaque = true", "opake = true"));
    assert!(
        message.contains(&format!("line {}", line("opaque"))) && message.contains("opake"),
        "{message}"
    );
    assert!(
        run(&good.replace("outer_edge = 30.0", "outer_edge = \"wide\"")).contains("outer_edge")
    );
    // Truncated anywhere, a scene is an error or a scene, never a panic.
    for end in (0..good.len()).step_by(17).filter(|end| good.is_char_boundary(*end)) {
        let _ = kerrlight_render::scene::Scene::parse(&good[..end]);
    }
}

/// A picture of nothing is announced; masses and angles without meaning are refused.
#[test]
fn pictures_that_mean_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let render = |setting: &str| {
        let small = ["--set", "screen.width=8", "--set", "screen.height=8", "-o", "a.exr"];
        let output =
            kerrlight(folder.path(), &[&["render", "--set", setting], &small[..]].concat());
        (output.status.code(), message(&output))
    };
    for (setting, said) in [
        ("hole.mass_msun=1e300", "`hole.mass_msun` = 1e300 is not allowed: 1e-20 to 1e15"),
        ("hole.distance_kpc=1e300", "1e-9 to 1e12 (kpc)"),
        ("spot.0.phase_deg=1e300", "-3600 to 3600 (degrees)"),
    ] {
        let (code, error) = render(setting);
        assert!(code == Some(2) && error.contains(said), "{setting}: {error}");
    }
    let (code, error) = render("disc.peak_intensity=0");
    assert!(code == Some(0) && !error.contains("no light"), "{error}");
    let (code, error) = render("screen.field_of_view_uas=0.01");
    assert!(code == Some(0) && error.contains("no light of the scene's disc"), "{error}");
}

#[test]
fn skies_that_are_no_pictures() {
    let good = std::fs::read_to_string(root().join("scenes/sky_image.toml")).unwrap();
    let folder = folder_with("scene.toml", good);
    let path = folder.path();
    fail_with(path, &["render", "scene.toml"], &["sky.image.path", "graticule.png"]);
    std::fs::write(path.join("graticule.png"), b"\x89PNG\r\n\x1a\n garbage").unwrap();
    fail_with(path, &["render", "scene.toml"], &["graticule.png", "picture"]);
}

/// An error of the file is the file's, with its line; one of an assignment has no line, as nobody has seen the text that
/// it makes.
#[test]
fn exact_lines_are_those_of_the_file() {
    let path = &new_folder();
    let fit = std::fs::read_to_string(root().join("scenes/fits/scene_1.toml")).unwrap();
    let scene = "[hole]\nspin = 0.5\n\n[disc]\nouter_edge = 9\n";
    let line = |text: &str, what: &str| {
        1 + text.lines().position(|line| line.starts_with(what)).expect("a line")
    };
    let write = |name: &str, text: &str| std::fs::write(path.join(name), text).unwrap();
    write("f.toml", &fit);
    write("s.toml", scene);
    let (wrong_fit, wrong_scene) =
        (fit.replace("steps = 400", "steps = -400"), scene.replace("outer_edge", "colour"));
    write("wrong_f.toml", &wrong_fit);
    write("wrong_s.toml", &wrong_scene);
    for (fit, name) in [("f.toml", "e.toml"), ("wrong_f.toml", "wrong_e.toml")] {
        let text = format!(
            "title = \"A\"\nquestion = \"B\"\nseeds = 1\nfit = {fit:?}\n[set]\nhole.spin = 0.1\n"
        );
        write(name, &text);
    }
    let [steps, colour] = [line(&wrong_fit, "steps"), line(&wrong_scene, "colour")];
    let (steps, colour) = (
        format!("wrong_f.toml: line {steps}: training.steps"),
        format!("wrong_s.toml: line {colour}: "),
    );
    let new = "with --set hole.mass=1: hole: unknown field `mass`";
    for (words, said) in [
        ("fit wrong_f.toml", steps.as_str()),
        ("fit wrong_f.toml --set observer.radius=900 --set hole.spin=0.1", &steps),
        ("fit f.toml --set hole.mass=1", &format!("f.toml {new}")),
        ("fit f.toml --set hole.spin=7", "f.toml with --set hole.spin=7: hole.spin = 7 is not"),
        ("render wrong_s.toml", &colour),
        ("render wrong_s.toml --set observer.azimuth_deg=1", &colour),
        ("render s.toml --set hole.mass=1", &format!("s.toml {new}")),
        ("compare wrong_e.toml --list", &steps),
        (
            "compare e.toml --list --set hole.mass=1",
            "f.toml with the settings of the case: hole: unknown",
        ),
    ] {
        let mut words = words_of(words);
        words.extend(["-o", if words[0] == "render" { "x.exr" } else { "x" }]);
        let error = fail(path, &words);
        assert!(error.contains(said), "{words:?}: {error}");
        assert!(said.contains("line ") || !error.contains("line "), "{words:?}: {error}");
    }
}

#[test]
fn overrides_and_arguments_that_make_no_sense() {
    let path = &new_folder();
    assert!(fail(path, &["render", "--set", "hole.spin"]).contains("key.path=value"));
    fail_with(path, &["render", "--set", "hole.spin=2"], &["--set hole.spin=2", "-1 to 1"]);
    assert!(fail(path, &["render", "--set", "hole.color=2"]).contains("color"));
    fail(path, &["render", "--colormap", "jet"]);
    for limit in ["nan", "-1"] {
        let error = fail(path, &["convert", "a.uvfits", "b.csv", "--uv-min", limit]);
        assert!(error.contains("is not allowed: wavelengths"), "{error}");
    }
    fail(path, &["paint"]);
    fail(path, &["render", "--threads", "0"]);
}

#[test]
fn tables_of_rays_that_are_none() {
    let path = &new_folder();
    let run = |text: &str| {
        std::fs::write(path.join("rays.csv"), text).unwrap();
        fail(path, &["trace", "--rays", "rays.csv", "-o", "out.csv"])
    };
    assert!(run("spin,alpha,beta\n").contains("inclination_rad"));
    let head = "spin,inclination_deg,alpha,beta\n# comment\n";
    let message = run(&format!("{head}0.5,60,1,2\n0.5,60,x,2\n"));
    assert!(message.contains("line 4") && message.contains("`alpha`"), "{message}");
    let message = run(&format!("{head}1.5,60,1,2\n"));
    assert!(message.contains("line 3") && message.contains("spin = 1.5"), "{message}");
    assert!(run(&format!("{head}0.5,60,nan,2\n")).contains("alpha"));
    assert!(run(&format!("{head}0.5,200,1,2\n")).contains("inclination"));
    assert!(run(&format!("{head}0.5,60,1\n")).contains("line 3"));
    std::fs::write(path.join("rays.csv"), head).unwrap();
    assert!(fail(path, &["trace", "--rays", "rays.csv", "--tolerance", "1"]).contains("tolerance"));
}

/// Nothing that is read is written over.
#[test]
fn outputs_spare_inputs() {
    let folder = folder_with("rays.csv", "spin,inclination_deg,alpha,beta\n0.5,60,1,2\n");
    let path = folder.path();
    fail_with(path, &["trace", "--rays", "rays.csv", "-o", "rays.csv"], &["rays.csv is an input"]);
    for name in ["sky_image.toml", "graticule.png"] {
        std::fs::copy(root().join("scenes").join(name), path.join(name)).unwrap();
    }
    let arguments = ["render", "sky_image.toml", "--preview", "graticule.png"];
    assert!(fail(path, &arguments).contains("is an input"));
    let small = ["--set", "screen.width=8", "--set", "screen.height=8", "-o", "a.exr"];
    succeed(path, &[&["render"][..], &small[..]].concat());
    assert!(fail(path, &["render", "a.exr", "-o", "a.exr"]).contains("is an input"));
    let mut permissions = std::fs::metadata(path.join("a.exr")).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(path.join("a.exr"), permissions).unwrap();
    assert!(fail(path, &[&["render"][..], &small[..]].concat()).contains("not a writable file"));
}

/// Values that no 32-bit channel holds, and fluxes that cannot be had.
#[test]
fn pictures_that_cannot_be() {
    let path = &new_folder();
    let run = |assignments: &[&str]| {
        let small = ["render", "--set", "screen.width=8", "--set", "screen.height=8"];
        fail(path, &[&small[..], &sets(assignments)].concat())
    };
    assert!(run(&["disc.peak_intensity=1e39"]).contains("0 to 1e12"));
    assert!(run(&["spot.0.sheared_since=-1e4"]).contains("wound up"));
    let dark = ["disc.peak_intensity=0", "spot.0.peak_emissivity=0", "screen.total_flux_jy=1"];
    assert!(run(&dark).contains("cannot be met"));
    let bright = ["screen.total_flux_jy=1e30", "hole.distance_kpc=1e12"];
    let field = ["screen.field_of_view_uas=", "screen.field_of_view_m=30"];
    assert!(run(&[&bright[..], &field[..]].concat()).contains("32-bit"));
    assert!(run(&["observer.radius=1e300"]).contains("10 to 1e9 (M), or inf"));
}

/// Volumes that are none: the key, the file, the array and what is wrong with it.
#[test]
fn volumes_that_are_none() {
    let text = std::fs::read_to_string(root().join("scenes/volume.toml")).unwrap();
    let folder = folder_with("scene.toml", text);
    fail_with(folder.path(), &["render", "scene.toml"], &["`volume.0.path`", "volume.npz"]);
    std::fs::write(folder.path().join("volume.npz"), b"no archive").unwrap();
    fail_with(folder.path(), &["render", "scene.toml"], &["volume.npz", "not an npz"]);
    std::fs::copy(root().join("scenes/volume.npz"), folder.path().join("volume.npz")).unwrap();
    let high = ["--set", "volume.0.low=[0.0, 0.0, 0.0]", "--set", "volume.0.high=[1.0, 0.0, 1.0]"];
    let text = fail(folder.path(), &[&["render", "scene.toml"], &high[..]].concat());
    assert!(text.contains("`volume.0.high`") && text.contains("above low"), "{text}");
}

/// A picture knows its files: rendered again with others, it says so.
#[test]
fn files_that_have_changed_are_told() {
    let at = &new_folder();
    for name in ["mesh.toml", "ring_and_moon.obj", "ring_and_moon.mtl"] {
        std::fs::copy(root().join("scenes").join(name), at.join(name)).unwrap();
    }
    let small = ["--set", "screen.width=16", "--set", "screen.height=10"];
    let words = [&["render", "mesh.toml", "-o", "first.exr"][..], &small[..]].concat();
    succeed(at, &words);
    let said = |name: &str| {
        told(at, &["render", "first.exr", "-o", name]).contains("the picture will differ")
    };
    assert!(!said("second.exr"));
    let mesh = at.join("ring_and_moon.obj");
    let text = std::fs::read_to_string(&mesh).unwrap();
    std::fs::write(&mesh, text + "# changed\n").unwrap();
    assert!(said("third.exr"));
}

/// Spheres so large that rounding of the radius makes the density rough: it used to halve parts without end.
#[test]
fn samples_within_huge_spheres_end() {
    let rays = "spin,inclination_deg,alpha,beta\n0.5,60,3,2\n0.9,30,-4,1\n";
    let folder = folder_with("rays.csv", rays);
    for radius in ["1e6", "1e9"] {
        let words = ["trace", "--rays", "rays.csv", "--samples", "3", "--within", radius];
        let table = succeed(folder.path(), &words);
        assert!(!table.contains("NaN"), "{table}");
    }
    let words = ["trace", "--rays", "rays.csv", "--samples", "3", "--within", "1e300"];
    assert!(fail(folder.path(), &words).contains("1 to 1e9 (M)"));
}
