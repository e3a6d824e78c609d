//! Output of verbs at their end: two lines for a person, one JSON object for a script, or a file with `-o -`; and the
//! command line's own help.

use crate::support::{
    done, fail, folder_with, message, new_folder, object, root, scene_path, sets, succeed,
};
use kerrlight_render::image::exr;
use serde_json::json;

const SIZE: [&str; 4] = ["--set", "screen.width=48", "--set", "screen.height=40"];
const RAYS: &str = "spin,inclination_deg,alpha,beta\n0.9,60,-6,1\n0,90,0.5,0\n";

fn rays() -> tempfile::TempDir {
    folder_with("rays.csv", RAYS)
}

#[test]
fn regress_help_fits_a_screen_with_verbs_in_groups() {
    let help = succeed(&root(), &["--help"]);
    assert!(help.lines().count() <= 30, "{help}");
    assert!(help.lines().all(|line| line.chars().count() <= 80), "{help}");
    let at = |word: &str| help.find(word).unwrap_or_else(|| panic!("{word}: {help}"));
    let order = ["Pictures:", "render ", "Rays:", "trace ", "Data:", "observe ", "Fits:", "fit "];
    assert!(order.windows(2).all(|pair| at(pair[0]) < at(pair[1])), "{help}");
    assert_eq!(help, succeed(&root(), &["-h"]));
}

/// A table and the JSON object hold the same numbers, to the last bit.
#[test]
fn exact_rays_as_json_are_those_of_the_table() {
    let folder = rays();
    let trace = ["trace", "--rays", "rays.csv", "--crossings", "2"];
    let found = object(folder.path(), &trace);
    assert_eq!(found["rays"]["outcome"], json!(["escaped", "captured"]));
    assert_eq!(found["rays"]["spin"], json!([0.9, 0.0]));
    let table = succeed(folder.path(), &trace);
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let column = |name: &str| header.iter().position(|other| *other == name).unwrap();
    for (k, row) in lines.enumerate() {
        for j in 0..2 {
            let cell = row[column(&format!("r_{}", j + 1))].parse::<f64>().ok();
            assert_eq!(found["rays"]["r"][k][j].as_f64(), cell, "{table}");
        }
        assert_eq!(found["rays"]["r_min"][k].as_f64(), row[column("r_min")].parse().ok());
    }
    let told = object(folder.path(), &[&trace[..], &["-o", "out.npz"]].concat());
    assert_eq!(told["files"], json!(["out.npz"]));
    assert_eq!(told["count"], 2);
}

/// The critical curve without spin is a circle of radius √27 M.
#[test]
fn exact_critical_curve_as_json() {
    let curve = ["critical-curve", "--spin", "0", "--inclination", "90", "--points", "5"];
    let found = object(&root(), &curve);
    let numbers = |name: &str| -> Vec<f64> {
        found["points"][name].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    assert_eq!([numbers("alpha").len(), numbers("beta").len()], [5, 5]);
    for (alpha, beta) in numbers("alpha").iter().zip(numbers("beta")) {
        assert!((alpha.hypot(beta) - 27f64.sqrt()).abs() < 1e-13, "{alpha} {beta}");
    }
    assert_eq!(succeed(&root(), &curve), succeed(&root(), &[&curve[..], &["-o", "-"]].concat()));
}

/// Bytes through a pipe are those of a file.
#[test]
fn exact_standard_output_carries_the_bytes_of_files() {
    let folder = rays();
    let at = folder.path();
    succeed(at, &["trace", "--rays", "rays.csv", "-o", "rays_out.csv"]);
    let table = done(at, &["trace", "--rays", "rays.csv", "-o", "-"]).stdout;
    assert!(table == std::fs::read(at.join("rays_out.csv")).unwrap());
    succeed(at, &[&["render", "-o", "a.exr", "--preview", "a.png"][..], &SIZE].concat());
    let picture = done(at, &[&["render", "-o", "-"][..], &SIZE].concat());
    assert!(picture.stdout == std::fs::read(at.join("a.exr")).unwrap());
    let said = message(&picture);
    assert!(said.lines().any(|line| line.starts_with("flux ")), "{said}");
    let preview = done(at, &[&["render", "--preview", "-"][..], &SIZE].concat()).stdout;
    assert!(preview == std::fs::read(at.join("a.png")).unwrap());
    let names: Vec<_> = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 4, "{names:?}");
    let both = [&["render", "-o", "-", "--preview", "-"][..], &SIZE].concat();
    assert!(fail(at, &both).contains("given for two outputs"));
    let twice = [&["render", "-o", "-", "--json"][..], &SIZE].concat();
    assert!(fail(at, &twice).contains("standard output"));
}

/// Flux and size of the object are those of the picture's own attributes.
#[test]
fn exact_render_tells_what_the_picture_holds() {
    let folder = tempfile::tempdir().unwrap();
    let told = object(folder.path(), &[&["render"][..], &SIZE].concat());
    assert_eq!(told["files"], json!(["kerrlight.exr", "kerrlight.png"]));
    assert_eq!((&told["width"], &told["height"]), (&json!(48), &json!(40)));
    let bytes = std::fs::read(folder.path().join("kerrlight.exr")).unwrap();
    let (_, attributes) = exr::decode(&bytes).unwrap();
    for key in ["flux", "flux_error", "rays"] {
        assert_eq!(
            told[key].to_string().parse::<f64>().ok(),
            attributes[key].parse().ok(),
            "{key}"
        );
    }
    let found = object(folder.path(), &["inspect", "kerrlight.exr"]);
    assert_eq!((&found["format"], &found["width"]), (&json!("EXR"), &json!(48)));
    assert_eq!(found["attributes"]["flux"], json!(attributes["flux"]));
    let plan = object(folder.path(), &[&["render", "--explain"][..], &SIZE].concat());
    assert!(plan["rays"].as_f64() >= Some(1920.0) && plan["parts"][0]["seconds"].is_number());
}

#[test]
fn regress_movie_ends_with_its_figures() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_path("hot_spots.toml");
    let movie = ["movie", &scene, "--frames", "2", "--duration", "100M"];
    let movie = [&movie[..], &["-o", "film", "--gif", "a.gif"], &SIZE].concat();
    let printed = succeed(folder.path(), &movie);
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(lines.len(), 2, "{printed}");
    assert!(lines[0].starts_with("2 frames, 2 of them rendered in "), "{printed}");
    assert!(lines[0].contains("; flux "), "{printed}");
    assert_eq!(lines[1], "film, a.gif");
    let told = object(folder.path(), &movie);
    assert_eq!((&told["frames"], &told["rendered"]), (&json!(2), &json!(0)));
    assert_eq!((&told["folder"], &told["files"]), (&json!("film"), &json!(["a.gif"])));
    let flux = |k: usize| told["flux"][k].as_f64().unwrap();
    assert!(0.0 < flux(0) && flux(0) <= flux(1));
}

/// The object of a fit is its results.json; the two lines are the verdict and the page.
#[test]
fn exact_fit_ends_with_its_verdict_and_results() {
    let folder = tempfile::tempdir().unwrap();
    let small = sets(&[
        "screen.pixels=16",
        "simulation.movie.frames=8",
        "output.nodes=16",
        "representation={kind=\"grid\",grid.nodes=16}",
        "region.nodes={equal-mino-time={per_ray=40}}",
        "training.steps=5",
        "training.log_every=5",
        "training.start=drawn",
    ]);
    let fit = scene_path("fits/scene_1.toml");
    let words = [&["fit", &fit, "-o", "run"], &small[..]].concat();
    let mut told = object(folder.path(), &words);
    assert_eq!(told["files"][0], "run/report.html");
    assert_eq!(told["folder"], "run");
    for file in told["files"].as_array().unwrap() {
        assert!(folder.path().join(file.as_str().unwrap()).is_file(), "{file}");
    }
    let mut written = crate::fit::results(&folder.path().join("run"));
    written.as_object_mut().unwrap().remove("checksum");
    told.as_object_mut().unwrap().retain(|key, _| !["files", "folder"].contains(&key.as_str()));
    assert_eq!(told, written);
    let seen = object(folder.path(), &["inspect", "run"]);
    assert_eq!(seen["results"]["psnr_db"], written["psnr_db"]);
    assert_eq!(seen["settings"]["screen"]["pixels"], 16);
    assert!(seen["contents"]["report.html"].as_u64() > Some(1000));
    let arrays = object(folder.path(), &["inspect", "run/volume.npz"]);
    assert_eq!(arrays["holds"], "a volume of 16 x 16 x 16 nodes");
    assert_eq!(arrays["arrays"][0]["type"].as_str().map(|t| &t[1..]), Some("f4"));
}

/// Visibilities are the same from a file and through a pipe, and what `inspect` counts of them is what was written.
#[test]
fn exact_visibilities_through_a_pipe_and_as_json() {
    let at = &new_folder();
    let scans = ["--source", "sgra", "--mjd", "57850", "--utc", "9-10", "--frames", "3"];
    let uv = [&["uv", "EHT2017"][..], &scans, &["--tint", "10"]].concat();
    let found = object(at, &uv);
    let count = found["count"].as_u64().unwrap();
    assert_eq!(found["points"]["u"].as_array().unwrap().len() as u64, count);
    assert_eq!(succeed(at, &uv).lines().count() as u64, count + 1);
    std::fs::write(at.join("image.csv"), "0,1\n0.5,0.25\n").unwrap();
    let seen = ["observe", "image.csv", "--fov-uas", "100", "--array", "EHT2017", "--tint", "10"];
    let seen = |to| [&seen[..], &scans, &["-o", to]].concat();
    let told = object(at, &seen("seen.csv"));
    assert_eq!((&told["visibilities"], &told["files"]), (&json!(count), &json!(["seen.csv"])));
    let file = std::fs::read_to_string(at.join("seen.csv")).unwrap();
    assert_eq!(succeed(at, &seen("-")), file);
    let holds = object(at, &["inspect", "seen.csv"]);
    assert_eq!((&holds["rows"], &holds["times"]), (&json!(count), &json!(3)));
    assert_eq!(succeed(at, &["convert", "seen.csv", "-"]), file);
    let told = object(at, &["convert", "seen.csv", "again.csv"]);
    assert_eq!((&told["rows"], &told["flagged"]), (&json!(count), &json!(0)));
}
