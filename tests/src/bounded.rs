//! Memory is estimated before it is taken: numbers of users and of headers that cannot be meant end in a message that says
//! what would be needed and what there is, never in a signal.

use crate::file_fields::npy;
use crate::support::{
    are_the_same, fail, fail_with, new_folder, replaced, scene_path, sets, succeed,
};
use std::io::Write;
use std::path::Path;

/// A deflated archive of a float32 array of zeros, a thousand times smaller than that.
fn bomb(path: &Path, name: &str, shape: [usize; 3]) {
    let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file(name, options).unwrap();
    let [a, b, c] = shape;
    archive.write_all(&npy("'<f4'", "False", &format!("({a}, {b}, {c})"), &[])).unwrap();
    let zeros = vec![0; 4 << 20];
    let mut left = 4 * a * b * c;
    while left > 0 {
        let some = left.min(zeros.len());
        archive.write_all(&zeros[..some]).unwrap();
        left -= some;
    }
    archive.finish().unwrap();
}

/// The message names what is too large, what it would take and what there is.
fn refused(at: &Path, memory: &str, words: &[&str], said: &str) {
    let message = fail(at, &[&["--memory", memory][..], words].concat());
    assert!(message.contains(said), "{words:?}: {message}");
    let [needs, has] = [" would take ", " the limit is "].map(|text| message.contains(text));
    assert!(needs && has && message.contains("iB"), "{words:?}: {message}");
}

#[test]
fn exact_numbers_that_would_take_too_much_are_named() {
    let at = &new_folder();
    let set = |change: &'static str| ["fit", "-o", "run", "--set", change];
    for (change, said) in [
        ("screen.pixels=4000", "screen.pixels = 4000"),
        ("simulation.observation.scans=1000000", "visibilities of 1000000 scans"),
        ("region.nodes={gauss={order=16,split=4000000}}", "region.nodes"),
        ("output.nodes=512", "output.nodes = 512"),
        ("training.start={linear={nodes=3000,stride=2,steps=10}}", "nodes = 3000"),
    ] {
        refused(at, "2GiB", &set(change), said);
    }
    let nodes =
        [&set("representation=grid")[..], &["--set", "representation.grid.nodes=1000"]].concat();
    refused(at, "2GiB", &nodes, "1000000000 parameters");
    refused(at, "64MiB", &["render", "--set", "screen.width=16384"], "screen.width = 16384");
    let scene = &scene_path("disc_face_on.toml");
    let movie = ["movie", scene, "--frames", "1000000", "--from", "0", "--to", "9", "-o", "m"];
    refused(at, "1GiB", &movie, "1000000 frames");
    let large = ["--set", "screen.width=16384", "--set", "screen.height=16384"];
    let movie = ["movie", scene, "--frames", "2", "--from", "0", "--to", "9", "-o", "m"];
    refused(at, "1GiB", &[&movie[..], &large].concat(), "16384 x 16384 pixels");
    let rays = "spin,inclination_deg,alpha,beta\n".to_owned() + &"0.5,60,5,1\n".repeat(500);
    std::fs::write(at.join("rays.csv"), rays).unwrap();
    let trace = ["trace", "--rays", "rays.csv", "--samples", "100000", "-o", "out.csv"];
    refused(at, "1GiB", &trace, "500 rays with");
    let uv = ["--source", "sgra", "--mjd", "57850", "--utc", "4-15", "--frames", "1000000"];
    let uv = [&["uv", "ngEHT", "--tint", "30", "-o", "uv.csv"][..], &uv].concat();
    refused(at, "256MiB", &uv, "1000000 scans");
}

#[test]
fn exact_files_that_unpack_to_too_much_are_named() {
    let at = &new_folder();
    bomb(&at.join("movie.npz"), "movie.npy", [100, 600, 600]);
    bomb(&at.join("volume.npz"), "emission.npy", [330, 330, 330]);
    assert!(std::fs::metadata(at.join("movie.npz")).unwrap().len() < 1 << 20);
    let array = ["--array", "ngEHT", "--source", "sgra", "--mjd", "57850", "--utc", "4-15"];
    let more = ["--frames", "100", "--tint", "30", "--fov-uas", "160", "-o", "a.uvfits"];
    let observe = |file| [&["observe", file][..], &array, &more].concat();
    refused(at, "200MiB", &observe("movie.npz"), "movie.npz");
    let scene = "[hole]\nspin = 0.5\nmass_msun = 4e6\ndistance_kpc = 8.0\n[observer]\ninclination_deg = 60.0\n\
                 [screen]\nwidth = 8\nheight = 8\nfield_of_view_m = 20.0\n[tracer]\nintegrator = \"elliptic\"\ntolerance = 1e-6\n\
                 [[volume]]\npath = \"volume.npz\"\nfactor = 1.0\nrotation = \"none\"\nlow = [-5, -5, -5]\nhigh = [5, 5, 5]\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let message = fail(at, &["--memory", "200MiB", "render", "scene.toml", "-o", "a.exr"]);
    assert!(message.contains("volume") && message.contains("would take"), "{message}");
    let picture = kerrlight_render::image::Picture {
        width: 3000,
        height: 3000,
        channels: vec![kerrlight_render::image::Channel {
            name: "intensity".to_owned(),
            values: vec![0.0; 9_000_000],
        }],
    };
    let bytes =
        kerrlight_render::image::exr::encode(&picture, &Default::default(), Default::default())
            .unwrap();
    std::fs::write(at.join("large.exr"), bytes).unwrap();
    refused(at, "64MiB", &observe("large.exr"), "3000 x 3000 pixels");
    image::GrayImage::new(6000, 6000).save(at.join("sky.png")).unwrap();
    let sky = "[sky.image]\npath = \"sky.png\"\nbrightness = 1.0\n";
    let text = scene.split("[[volume]]").next().unwrap().to_owned() + sky;
    std::fs::write(at.join("sky.toml"), text).unwrap();
    refused(at, "512MiB", &["render", "sky.toml", "-o", "a.exr"], "a sky of 6000 x 6000 pixels");
}

/// Lack of memory that no estimate has foreseen ends in a message as well, and no half file stays.
#[test]
fn exact_what_was_not_foreseen_ends_in_a_message() {
    let at = &new_folder();
    let curve = ["critical-curve", "--spin", "0.9", "--inclination", "60", "--points", "1000000"];
    let message = fail(at, &[&["--memory", "64MiB"][..], &curve, &["-o", "c.csv"]].concat());
    assert!(message.contains("out of memory") && message.contains("--memory"), "{message}");
    for wrong in ["--memory=0", "--memory=much", "--memory=-4GiB", "--memory=4 XiB"] {
        fail(at, &[wrong, "critical-curve"]);
    }
    let small = ["critical-curve", "--spin", "0.9", "--inclination", "60", "--points", "10"];
    let printed = succeed(at, &[&["--memory", "64MiB"][..], &small].concat());
    assert_eq!(printed.lines().count(), 11);
}

/// A limit of the address space counts too.
#[cfg(target_os = "linux")]
#[test]
fn exact_a_limit_of_the_shell_counts() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["fit", "--set", "screen.pixels=4000"];
    let output = crate::support::after(folder.path(), "ulimit -v 3000000; exec \"$@\"", &words);
    let said = crate::support::message(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("screen.pixels = 4000"), "{said}");
}

/// Few pixels, steps and nodes, with a start.
fn small(start: &'static str) -> Vec<&'static str> {
    sets(&[
        "screen.pixels=16",
        "training.steps=4",
        "output.nodes=12",
        "representation=grid",
        "representation.grid.nodes=12",
        start,
    ])
}

/// Writes settings of a scene without its truth, for data.
fn without_truth(at: &Path, scene: &str) {
    let text = std::fs::read_to_string(scene).unwrap();
    let text = replaced(&text, "[[simulation.truth.spot]]", "[[loss]]", "");
    std::fs::write(at.join("data.toml"), text).unwrap();
}

/// A movie that is larger than its part of the memory is kept in a file, and nothing that comes out is another byte.
#[test]
fn exact_a_movie_in_a_file_gives_the_same_bytes() {
    let at = &new_folder();
    let scene = scene_path("fits/flare_images.toml");
    let set = small("training.start={linear={nodes=12,stride=400,steps=4}}");
    let words = ["fit", &scene, "-o"];
    let nodes = "region.nodes={gauss={order=2,split=1}}";
    // A little more than an eighth of the lesser limit.
    let frames = sets(&["simulation.movie.frames=10500", nodes]);
    for (run, memory) in [("all", "4GiB"), ("little", "160MiB")] {
        succeed(at, &[&["--memory", memory][..], &words, &[run], &set, &frames].concat());
    }
    let names = ["checkpoint.safetensors", "volume.npz", "movie.npz", "movie.png", "truth.npz"];
    are_the_same(at, ["all", "little"], &names);
    // The same of its results as data.
    let data = sets(&["data.movie={path=\"all/movie.npz\",from=0.0,to=120.0}", nodes]);
    without_truth(at, &scene);
    for (run, memory) in [("read", "4GiB"), ("read_little", "160MiB")] {
        let words = ["--memory", memory, "fit", "data.toml", "-o", run];
        succeed(at, &[&words[..], &set, &data].concat());
    }
    are_the_same(at, ["read", "read_little"], &names[..4]);
}

/// A limit that is too small is refused before anything is written, with one that is enough; that is no more than what
/// these fits are known to hold.
#[test]
#[ignore = "long"]
fn exact_the_least_limit_that_is_said_is_enough() {
    let at = &new_folder();
    let images = scene_path("fits/flare_images.toml");
    let images = ["fit", &images];
    let few = ["training.steps=3", "output.nodes=16", "training.start=drawn"];
    let linear =
        ["representation=linear-grid", "representation.linear-grid.nodes=20", "output.nodes=16"];
    let fine = ["screen.pixels=96", "simulation.movie.frames=600"];
    let grid = ["representation=grid", "representation.grid.nodes=20"];
    let cases: [(&[&str], Vec<&str>, f64); 4] = [
        (&images, few.to_vec(), 120.0),
        (&images, linear.to_vec(), 300.0),
        (&images, [&few[..], &fine, &grid].concat(), 400.0),
        (&["fit"], [&few[..], &["training.batch={frames=2}"]].concat(), 160.0),
    ];
    for (k, (words, set, most)) in cases.into_iter().enumerate() {
        let run = format!("run_{k}");
        let words = [words, &["-o", &run], &sets(&set)].concat();
        let message = fail(at, &[&["--memory", "20MiB"][..], &words].concat());
        assert!(message.contains(" = ") && message.contains("the limit is 20.0 MiB"), "{message}");
        let (_, needed) = message.split_once(" would take ").unwrap();
        let (needed, _) = needed.split_once(" of memory").unwrap();
        let number: f64 = needed.strip_suffix(" MiB").unwrap().parse().unwrap();
        assert!(number < most, "{message}");
        succeed(at, &[&["--memory", needed][..], &words].concat());
    }
}

/// Images of one file each are the same data as a movie, by any name and within little memory.
#[test]
fn exact_a_sequence_of_images_is_a_movie() {
    let at = &new_folder();
    let scene = scene_path("fits/flare_images.toml");
    without_truth(at, &scene);
    let set = small("training.start={linear={nodes=12,stride=2,steps=4}}");
    let frames = ["--set", "simulation.movie.frames=12"];
    let words = ["fit", &scene, "-o", "simulated"];
    succeed(at, &[&words[..], &set, &frames].concat());
    let size = ["--set", "screen.width=16", "--set", "screen.height=16"];
    let times = ["--frames", "12", "--from", "0", "--to", "120", "-o", "frames"];
    succeed(at, &[&["movie", "simulated/scene.toml"][..], &times, &size].concat());
    // Of the same numbers, a file for all and one for each.
    std::fs::create_dir(at.join("arrays")).unwrap();
    let bytes = std::fs::read(at.join("simulated/movie.npz")).unwrap();
    let mut archive = kerrlight_common::numpy::Archive::open(&bytes).unwrap();
    let movie = archive.member("data").unwrap().unwrap();
    let (_, values) = kerrlight_common::numpy::read_array(&movie).unwrap();
    std::fs::write(at.join("all.npy"), &movie).unwrap();
    for (k, image) in values.chunks_exact(16 * 16).enumerate() {
        let bytes = kerrlight_common::numpy::write_array(&[16, 16], image.iter().copied());
        std::fs::write(at.join(format!("arrays/f_{k}.npy")), bytes).unwrap();
    }
    let read = |path: &str, memory: &str, run: &str| {
        let path = format!("data.movie={{path={path:?},from=0.0,to=120.0}}");
        let words = ["--memory", memory, "fit", "data.toml", "-o", run, "--set", &path];
        succeed(at, &[&words[..], &set].concat());
        std::fs::read(at.join(run).join("movie.npz")).unwrap()
    };
    let pictures = read("frames", "4GiB", "by_folder");
    assert!(read("frames/frame_%04d.exr", "4GiB", "by_number") == pictures);
    assert!(read("frames/*.exr", "140MiB", "by_star") == pictures);
    let arrays = read("all.npy", "4GiB", "at_once");
    assert!(read("arrays/f_%d.npy", "140MiB", "one_by_one") == arrays && arrays != pictures);
    let inputs = std::fs::read_to_string(at.join("by_folder/inputs.json")).unwrap();
    assert_eq!(inputs.matches("frame_0000.exr").count(), 1, "{inputs}");
    std::fs::remove_file(at.join("frames/frame_0003.exr")).unwrap();
    let path = "data.movie={path=\"frames/frame_%04d.exr\",from=0.0,to=120.0}";
    let words = ["fit", "data.toml", "-o", "gap", "--set", path];
    fail_with(at, &[&words[..], &set].concat(), &["frame_0002.exr is followed by frame_0004.exr"]);
    fail_with(at, &["fit", "--resume", "by_folder"], &["frame_0003.exr"]);
}
