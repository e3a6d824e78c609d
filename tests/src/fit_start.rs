//! Starts of a fit (`--init`), and its results for other verbs: a scene, and a movie that telescopes see.

use crate::fit::results;
use crate::fit_data::{FEW, observed};
use crate::support::{fail, fail_with, new_folder, scene_path, sets, succeed, words_of};
use kerrlight_render::image::exr;
use std::path::Path;

/// A fit of few rays with many nodes on each, so that its own sums are as good as a scene's; the axis is tilted, light
/// takes its time, matter moves at a drawn velocity and shines from some time on.
fn fit(folder: &Path) {
    let law = "{perturbed={of={keplerian={drag=0.3}},deviation=0.01,correlation_length=2.0,radii=[2.0,10.0]}}";
    let law = format!("motion.velocity={law}");
    let settings = sets(&[
        "screen.pixels=16",
        "region.nodes={gauss={order=8,split=24}}",
        "region.z_width=2.5",
        "effects.redshift_power=2.5",
        &law,
        "motion.axis=[0.5,0.3,0.8]",
        "motion.injection_time=-8.0",
        "simulation.movie={frames=5,from=-5.0,to=60.0}",
        "representation=linear-grid",
        "representation.linear-grid.nodes=24",
        "training.start=drawn",
        // What a scene has between its nodes.
        "linear={upper=3.0,rounds=1,iterations=8,degree=\"linear\"}",
        "output.nodes=24",
    ]);
    let file = scene_path("fits/flare_images.toml");
    succeed(folder, &[&["fit", &file, "-o", "run"], &settings[..]].concat());
}

pub fn array(path: &Path, name: &str) -> Vec<f64> {
    let file = std::fs::File::open(path).unwrap();
    let mut archive = zip::ZipArchive::new(file).unwrap();
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut archive.by_name(name).unwrap(), &mut bytes).unwrap();
    let array = npyz::NpyFile::new(&bytes[..]).unwrap();
    match array.dtype().descr().contains("f4") {
        true => array.into_vec::<f32>().unwrap().into_iter().map(f64::from).collect(),
        false => array.into_vec::<f64>().unwrap(),
    }
}

/// Results of a fit for other verbs.
#[test]
fn exact_runs_are_scenes_movies_and_data() {
    let folder = tempfile::tempdir().unwrap();
    fit(folder.path());
    scene_of_a_run_is_its_movie(folder.path());
    movie_of_a_run_is_observed(folder.path());
    starters_of_images_ask_for_what_is_missing(folder.path());
}

/// The picture of a run's scene is the frame of its movie, and its film the others.
fn scene_of_a_run_is_its_movie(path: &Path) {
    let movie = path.join("run/movie.npz");
    let (frames, times) = (array(&movie, "recovered.npy"), array(&movie, "time.npy"));
    let intensity = |name: &str| -> Vec<f64> {
        let (picture, _) = exr::decode(&std::fs::read(path.join(name)).unwrap()).unwrap();
        picture.channel("intensity").unwrap().iter().map(|x| f64::from(*x)).collect()
    };
    // Without the line that scales it to Jy/uas^2 the picture is in Jy a pixel of the fit.
    // One ray in the middle of each pixel, as the fit has it.
    let small = sets(&["screen.width=16", "screen.total_flux_jy=", "screen.rings=regular-grid"]);
    let span = ["--frames", "5", "--from=-5", "--to=60", "-o", "film"];
    succeed(path, &[&["movie", "run/scene.toml"][..], &small, &span].concat());
    let mean = frames.iter().sum::<f64>() / 5.0;
    for (k, frame) in frames.chunks(256).enumerate() {
        let picture = intensity(&format!("film/frame_{k:04}.exr"));
        let off: f64 = picture.iter().zip(frame).map(|(a, b)| (a - b).abs()).sum();
        // What is left is the sums of the fit at the edges of cells and of the region.
        assert!(mean > 0.0 && off < 0.005 * mean, "frame {k}: {} of the light", off / mean);
    }
    succeed(path, &[&["render", "run/scene.toml", "-o", "a.exr"][..], &small].concat());
    let scene = std::fs::read_to_string(path.join("run/scene.toml")).unwrap();
    let shown =
        times.iter().position(|time| scene.contains(&format!("\ntime = {time:?}"))).unwrap();
    assert_eq!(intensity("a.exr"), intensity(&format!("film/frame_{shown:04}.exr")));
}

/// Telescopes see a fit's movie with the field and the times that it has.
fn movie_of_a_run_is_observed(path: &Path) {
    fn see<'a>(more: &[&'a str]) -> Vec<&'a str> {
        let line = "observe run/movie.npz --array EHT2017 --source sgra --mjd 57851 --frames 3 --tint 30 --elevation 10-85";
        [&words_of(line)[..], more].concat()
    }
    // 65 M of Sgr A* are 22.16 minutes.
    let hours = array(&path.join("run/movie.npz"), "hours.npy");
    assert!((hours[4] - 65.0 * 20.4604 / 3600.0).abs() < 1e-4, "{hours:?}");
    succeed(path, &see(&["--utc", "12.9-13.2", "--frame-times", "own", "-o", "a.csv"]));
    let field = array(&path.join("run/movie.npz"), "field_uas.npy")[0].to_string();
    succeed(
        path,
        &see(&["--utc", "12.9-13.2", "--frame-times", "own", "--fov-uas", &field, "-o", "b.csv"]),
    );
    let read = |name: &str| std::fs::read_to_string(path.join(name)).unwrap();
    assert_eq!(read("a.csv"), read("b.csv"));
    fail_with(path, &see(&["--utc", "12.9-13.2", "-o", "c.csv"]), &["--frame-times"]);
}

/// The starter file of the built-in experiment is the built-in experiment.
#[test]
fn exact_starter_of_the_built_in_experiment() {
    let path = &new_folder();
    succeed(path, &["fit", "--init"]);
    let table = |text: &str| text.parse::<toml::Table>().unwrap();
    let text = std::fs::read_to_string(path.join("my_fit.toml")).unwrap();
    assert_eq!(table(&text), table(&succeed(path, &["fit", "--print"])));
    assert!(fail(path, &["fit", "--init"]).contains("my_fit.toml exists"));
    assert!(
        fail(path, &["fit", "--init", "nowhere.uvfits", "-o", "x.toml"]).contains("nowhere.uvfits")
    );
}

/// Data of a source that is known here are fitted at once; of another one when the user has filled in what is missing.
#[test]
fn exact_starters_of_visibilities_run() {
    let path = &new_folder();
    for (source, name) in [("sgra", "a"), ("12.5,12.4", "b")] {
        let (data, toml) = (format!("{name}.uvfits"), format!("{name}.toml"));
        observed(path, source, &data);
        succeed(path, &["fit", "--init", &data, "--model", "volume", "-o", &toml]);
        let fit = [&["fit", &toml, "-o", name][..], &FEW].concat();
        if source == "sgra" {
            succeed(path, &fit);
            continue;
        }
        for (line, missing) in [
            ("# inclination_deg = 60.0", "inclination_deg"),
            ("# mass_msun = 4.154e6", "hole.mass_msun is missing"),
            ("# distance_kpc = 8.178", "hole.distance_kpc is missing"),
        ] {
            fail_with(path, &fit, &[missing]);
            let text = std::fs::read_to_string(path.join(&toml)).unwrap();
            assert!(text.contains(line), "{text}");
            std::fs::write(path.join(&toml), text.replacen(line, &line[2..], 1)).unwrap();
        }
        succeed(path, &fit);
    }
}

/// Images: what they do not tell is requested, key by key.
fn starters_of_images_ask_for_what_is_missing(path: &Path) {
    succeed(path, &["fit", "--init", "run/movie.npz", "-o", "images.toml"]);
    let few =
        ["--set", "training.steps=2", "--set", "output.nodes=8", "--set", "training.start=drawn"];
    let fit = [&["fit", "images.toml", "-o", "again"][..], &few].concat();
    let mut filled = 0;
    loop {
        let text = std::fs::read_to_string(path.join("images.toml")).unwrap();
        let Some((before, rest)) = text.split_once("# FILL IN") else { break };
        let (reason, rest) = rest.split_once('\n').unwrap();
        let key = rest.split_whitespace().nth(1).unwrap();
        let message = fail(path, &fit);
        assert!(message.contains("missing"), "{key}: {message}");
        let rest = rest.strip_prefix("# ").unwrap();
        std::fs::write(path.join("images.toml"), format!("{before}#{reason}\n{rest}")).unwrap();
        filled += 1;
    }
    assert_eq!(filled, 10);
    succeed(path, &fit);
    // Sums of higher order are nearer to those of twice the nodes, and what counts is said.
    let errors = [2, 4, 12].map(|order| {
        let set = format!("region.nodes={{gauss={{order={order},split=1}}}}");
        let name = format!("order_{order}");
        let words =
            ["fit", "images.toml", "-o", &name, "--set", &set, "--set", "loss.0.sigma=2e-7"];
        let told = succeed(path, &[&words[..], &few].concat());
        let error = results(&path.join(&name))["quadrature_error"].as_f64().unwrap();
        assert_eq!(told.contains("Sums along rays are off by"), error > 0.3, "{error}: {told}");
        error
    });
    assert!(errors[0] > 2.0 * errors[1] && errors[1] > 2.0 * errors[2], "{errors:?}");
}
