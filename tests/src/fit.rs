//! `kerrlight fit`, from settings to a report.

use crate::support::{
    are_the_same, fail_with, json, kill, render, replaced, root, scene, sets, start, succeed,
};
use std::path::Path;
use std::time::Instant;

/// A fit of a file with fewer pixels, frames and nodes than BH-NeRF's scene 1 has, so that it takes a moment.
fn small_of(file: &Path) -> Vec<String> {
    let settings = sets(&[
        "screen.pixels=20",
        "region.nodes={equal-mino-time={per_ray=40}}",
        "simulation.movie.frames=16",
        "representation.network.width=32",
        "training.steps=150",
        "training.log_every=50",
        "training.batch={pixels=200}",
        "training.start={linear={nodes=16,stride=2,steps=300}}",
        "output.nodes=24",
    ]);
    let words = ["fit", file.to_str().expect("a name")];
    words.into_iter().chain(settings).map(str::to_owned).collect()
}

pub fn small() -> Vec<String> {
    small_of(&root().join("scenes/fits/scene_1.toml"))
}

/// The same of a file with another text.
pub fn changed(folder: &Path, change: impl Fn(&str) -> String) -> Vec<String> {
    let text = std::fs::read_to_string(root().join("scenes/fits/scene_1.toml")).unwrap();
    let new = change(&text);
    assert!(new != text);
    std::fs::write(folder.join("changed.toml"), new).unwrap();
    small_of(&folder.join("changed.toml"))
}

pub fn with<'a>(small: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    small.iter().map(String::as_str).chain(more.iter().copied()).collect()
}

pub fn results(folder: &Path) -> serde_json::Value {
    json(&folder.join("results.json"))
}

#[test]
fn exact_every_representation_leaves_a_whole_run() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    let kinds = ["bhnerf", "feature-grid", "grid", "linear-grid"];
    for (kind, least) in kinds.map(|kind| (kind, 36.5)) {
        let kind_of = format!("representation={kind}");
        let printed = succeed(folder.path(), &with(&small, &["-o", kind, "--set", &kind_of]));
        assert!(printed.contains("report.html"), "{printed}");
        let run = folder.path().join(kind);
        for file in [
            "fit.toml",
            "log.jsonl",
            "volume.npz",
            "truth.npz",
            "volume.vti",
            "movie.npz",
            "report.html",
        ] {
            assert!(run.join(file).is_file(), "{kind}: {file}");
        }
        let psnr = results(&run)["psnr_db"].as_f64().unwrap();
        assert!(psnr > least, "{kind}: {psnr} dB");
    }
}

/// A field of events has no co-rotating coordinates to mask.
#[test]
fn exact_a_field_of_events_is_fitted_without_a_mask() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    let events = ["-o", "run", "--set", "representation=mlp4d"];
    fail_with(folder.path(), &with(&small, &events), &["training.occupancy"]);
    let events = [&events[..], &["--set", "training.start=drawn"]].concat();
    let unmasked = |text: &str| replaced(text, "[training.occupancy]", "[linear]", "");
    let words = changed(folder.path(), unmasked);
    succeed(folder.path(), &with(&words, &events));
    assert!(results(&folder.path().join("run"))["loss"].as_f64().unwrap().is_finite());
}

/// From the whole sphere.
#[test]
fn exact_an_unknown_axis_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let scan =
        "[axis.scan]\ndirections = 80\nframes = 8\npixels = 12\nrate = 1e-3\nlast_rate = 1e-4\n";
    let words = changed(folder.path(), |text| text.replace("[axis.known]\n", scan));
    succeed(folder.path(), &with(&words, &["-o", "axis"]));
    let run = folder.path().join("axis");
    assert!(run.join("axis_scan.png").is_file() && run.join("axis_scan.csv").is_file());
    let dot = results(&run)["axis_dot_truth"].as_f64().unwrap();
    assert!(dot > 0.99, "{dot}");
}

#[test]
#[ignore = "long"]
fn exact_same_bytes_after_kills_at_twenty_moments() {
    killed_fit(&small(), &["training.steps=200"], 20);
}

/// A mask that is looked at at several times, and a price that is drawn at each step.
#[test]
#[ignore = "long"]
fn exact_same_bytes_after_kills_of_emission_that_changes() {
    let change = "change={allowed=\"any\",weight=0.001,spacing=0.3}";
    let mask = "training.occupancy={cells=12,threshold=0.003,memory=0.8,warm_up=0,every=5}";
    killed_fit(&small(), &["training.steps=60", change, mask], 8);
}

/// Kills a run with these settings at that many moments at least; what goes on ends like what was never killed.
pub fn killed_fit(words: &[String], set: &[&str], moments: u32) {
    let folder = tempfile::tempdir().unwrap();
    let often = sets(&[&["training.checkpoint_seconds=0.02"], set].concat());
    let clock = Instant::now();
    succeed(folder.path(), &with(words, &[&often[..], &["-o", "whole"]].concat()));
    let taken = clock.elapsed();
    let begin = with(words, &[&often[..], &["-o", "killed"]].concat());
    let (mut gone_on, mut kills) = (0, 0);
    // A busy machine is slower than it was: more kills until enough of them hit a run that had gone on.
    while kills < moments || (gone_on < moments / 2 && kills < 200) {
        let run = folder.path().join("killed");
        let words = match run.join("fit.toml").exists() {
            true => vec!["fit", "--resume", "killed"],
            false => begin.clone(),
        };
        gone_on += u32::from(run.join("checkpoint.safetensors").exists());
        let child = start(folder.path(), &words);
        std::thread::sleep(taken.mul_f64((0.618_034 * f64::from(kills)).fract()));
        kill(child);
        kills += 1;
    }
    assert!(gone_on >= moments / 2, "{gone_on} runs went on with another's work");
    succeed(folder.path(), &["fit", "--resume", "killed"]);
    let same = ["volume.npz", "volume.vti", "movie.npz", "checkpoint.safetensors"];
    are_the_same(folder.path(), ["whole", "killed"], &same);
}

#[test]
fn bad_input_is_named_and_nothing_is_begun() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    for (change, said) in [
        ("hole.spin=1.5", "spin = 1.5"),
        ("region.r_max=1.0", "r_max = 1"),
        ("representation.network.rate=-1.0", "representation.network.rate = -1 is not allowed"),
        ("training.batch={frames=0}", "training.batch.frames = 0 is not allowed: at least 1"),
        ("loss.0.sigma=0.0", "loss.0.sigma = 0 is not allowed"),
        ("loss.0.data=visibilities", "pixels work with images only"),
        ("simulation.truth.spot.0.sigma=0.0", "simulation.truth.spot.0.sigma = 0 is not allowed"),
        ("output.nodes=1", "output.nodes = 1"),
        ("simulation.movie.frames=0", "simulation.movie.frames = 0"),
        ("nonsense=1", "unknown field `nonsense`"),
        ("representation=cubes", "representation.kind = \"cubes\" is not allowed: bhnerf"),
    ] {
        fail_with(folder.path(), &with(&small, &["-o", "run", "--set", change]), &[said]);
    }
    std::fs::create_dir(folder.path().join("full")).unwrap();
    std::fs::write(folder.path().join("full/mine.txt"), "mine").unwrap();
    fail_with(folder.path(), &with(&small, &["-o", "full"]), &["not an empty folder"]);
    fail_with(folder.path(), &["fit", "--resume", "full"], &["holds no run"]);
    let text = std::fs::read_to_string(root().join("scenes/fits/scene_1.toml")).unwrap();
    std::fs::write(folder.path().join("a.toml"), text.replace("seed = 1", "seed = 2")).unwrap();
    succeed(folder.path(), &with(&small, &["-o", "run"]));
    fail_with(folder.path(), &["fit", "a.toml", "--resume", "run"], &["differs from the settings"]);
    std::fs::write(folder.path().join("run/checkpoint.safetensors"), b"broken").unwrap();
    fail_with(folder.path(), &["fit", "--resume", "run"], &["checkpoint"]);
}

/// All data that an array gives, together, of the built-in experiment made small.
#[test]
fn exact_visibilities_and_closures_together() {
    let folder = tempfile::tempdir().unwrap();
    let text = succeed(folder.path(), &["fit", "--print"]);
    let more: String = ["amplitudes", "closure-phases", "log-closure-amplitudes"]
        .map(|kind| {
            let least = if kind == "amplitudes" { "" } else { "least_snr = 3.0\n" };
            format!("[[loss]]\ndata = \"{kind}\"\nweight = 0.1\n{least}\n")
        })
        .concat();
    let curve = "[[loss]]\ndata = \"light-curve\"\nweight = 0.1\nsigma = 0.01\n\n";
    let text = text.replace("[representation]", &format!("{more}{curve}[representation]"));
    std::fs::write(folder.path().join("all.toml"), text).unwrap();
    let small = sets(&[
        "screen.pixels=24",
        "simulation.observation.scans=8",
        "representation.network.width=24",
        "training.steps=40",
        "training.log_every=20",
        "training.start=drawn",
        "output.nodes=20",
    ]);
    succeed(folder.path(), &[&["fit", "all.toml", "-o", "run"], &small[..]].concat());
    let found = results(&folder.path().join("run"));
    let chi2 = found["chi2_per_datum"].as_object().unwrap();
    assert_eq!(chi2.len(), 5, "{chi2:?}");
    assert!(chi2.values().all(|value| value.as_f64().is_some_and(f64::is_finite)));
}

/// A sheared spot on a tilted orbit, on 24 × 24 pixels of 1 M.
fn sheared_spot() -> kerrlight_render::scene::Scene {
    let text = std::fs::read_to_string(root().join("scenes/hot_spots.toml")).unwrap();
    let text = text.split("[[spot]]").next().unwrap().to_owned()
        + "[[spot]]\nradius = 7.0\nphase_deg = 200.0\naxis = [0.6, 0.0, 0.8]\nsigma = 0.6\npeak_emissivity = 1.0\nsheared_since = 0.0\n";
    let changes = [
        "screen.width=24",
        "screen.height=24",
        "screen.total_flux_jy=",
        "screen.field_of_view_uas=",
        "screen.field_of_view_m=24.0",
        "screen.channels=[\"intensity\"]",
        "screen.rings=\"regular-grid\"",
        "observer.time=45.0",
    ];
    scene(&text, &changes)
}

/// A fit's pixels of a sheared spot on a tilted orbit, with slow light and redshift, are those of the renderer, which
/// shares neither nodes nor sums with it.
#[test]
fn code_pixels_are_those_of_the_renderer() {
    use kerrlight_geodesic::vector::distance;
    use kerrlight_geodesic::{Inclination, Kerr, Observer};
    use kerrlight_render::dynamics::{AngularVelocity, Axis, Injection};
    use kerrlight_render::emission::spot::SpotModel;
    use kerrlight_tomo::fit::{
        Batch, ForwardModel, Motion, Redshift, Region, Sampling, SightlineRequest, Sightlines,
    };
    let scene = sheared_spot();
    let seen = render(&scene);
    let hole = Kerr::new(0.5).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(60.0).unwrap());
    let at = |k: usize| k as f64 - 11.5;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..24 * 24).map(|k| (at(k % 24), -at(k / 24))).unzip();
    let request = SightlineRequest {
        region: Region { r_min: 0.0, r_max: 11.0, z_width: f64::INFINITY },
        sampling: Sampling::Gauss { order: 8, split: 3 },
        delay: true,
        momentum: true,
    };
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap();
    let motion = Motion {
        velocity: AngularVelocity::Keplerian { drag: 0.4 },
        reference: 0.0,
        injection: Some(Injection { time: 0.0 }),
        times: vec![45.0],
    };
    let power = Redshift { power: 2.0 };
    let mut model = ForwardModel::<f64>::new(&lines, &motion, &hole, Some(power)).unwrap();
    let axis = Axis::new([0.6, 0.0, 0.8]).unwrap();
    model.weigh(axis);
    let center = SpotModel::new(&scene.spot[0], &hole).center(0.0);
    let light = |x: [f64; 3]| (-0.5 * (distance(x, center) / 0.6).powi(2)).exp();
    let movie = model.movie_of(axis, &light, &mut Batch::default());
    let seen = seen.channel("intensity").unwrap();
    let most = seen.iter().fold(0.0f32, |most, x| most.max(*x));
    assert!(most > 0.1, "{most}");
    for (k, (fitted, seen)) in movie.iter().zip(seen).enumerate() {
        let difference = (fitted - f64::from(*seen)).abs() / f64::from(most);
        assert!(difference < 1e-3, "pixel {k}: {fitted} {seen}");
    }
}
