//! `kerrlight fit` with bad input and bad luck: one clear message, and nothing lost or half-written.

use crate::fit::{changed, results, small, with};
use crate::support::{
    are_the_same, cramped, fail, fail_with, files, message, new_folder, replaced, scene_path, sets,
    skipped, start, succeed, told,
};
use std::path::Path;

/// At whatever file it strikes; what was there is still there, and the run goes on to the same bytes.
#[cfg(unix)]
#[test]
fn exact_a_full_disk_loses_nothing() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    succeed(folder.path(), &with(&small, &["-o", "whole"]));
    let whole = folder.path().join("whole");
    let size =
        |name: &str| std::fs::metadata(whole.join(name)).unwrap().len().div_ceil(1024) as u32;
    assert!(size("fit.toml") + 4 < size("checkpoint.safetensors"));
    let run = folder.path().join("run");
    // No checkpoint; then no report.
    let first = cramped(folder.path(), size("fit.toml") + 4, &with(&small, &["-o", "run"]));
    assert_eq!(first.status.code(), Some(2), "{}", message(&first));
    let said = message(&first);
    assert!(said.contains("checkpoint.safetensors") && said.contains("File too large"), "{said}");
    assert_eq!(files(&run), ["fit.toml", "inputs.json", "lock", "log.jsonl"]);
    let second = cramped(folder.path(), size("report.html") - 1, &["fit", "--resume", "run"]);
    assert_eq!(second.status.code(), Some(2), "{}", message(&second));
    assert!(message(&second).contains("report.html"), "{}", message(&second));
    assert!(!run.join("report.html").exists() && run.join("checkpoint.safetensors").exists());
    assert!(!files(&run).iter().any(|name| name.starts_with(".kerrlight")));
    succeed(folder.path(), &["fit", "--resume", "run"]);
    let same = ["volume.npz", "movie.npz", "checkpoint.safetensors"];
    are_the_same(folder.path(), ["whole", "run"], &same);
}

#[cfg(unix)]
#[test]
fn exact_a_read_only_folder_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    let closed = folder.path().join("closed");
    std::fs::create_dir(&closed).unwrap();
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(closed.join("probe"), "").is_ok() {
        return skipped("this user may write everywhere: a read-only folder cannot be made");
    }
    for name in ["closed", "closed/run"] {
        fail_with(folder.path(), &with(&small, &["-o", name]), &["closed"]);
    }
}

/// Settings that cannot be meant, with the line they stand in.
#[test]
fn bad_settings_are_named_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, said) in [
        ("seed = 1", "seed = -1", "line 4"),
        ("seed = 1", "seed = \"one\"", "line 4"),
        ("seed = 1", "seed = 1\ncolour = 2", "unknown field `colour`"),
        ("spin = 0.0", "spin = true", "line 7"),
        ("weight = 1.0", "weight = -1.0", "loss.0.weight = -1 is not allowed: 1e-12 to 1e12"),
        ("weight = 1.0", "weight = nan", "loss.0.weight = NaN"),
        ("sigma = 1.0", "sigma = -0.5", "loss.0.sigma = -0.5 is not allowed"),
        ("sigma = 0.4", "sigma = inf", "simulation.truth.spot.0.sigma = inf"),
        ("[[simulation.truth.spot]]", "[[simulation.truth.spots]]", "spot"),
        (
            "kind = \"bhnerf\"",
            "kind = \"feature-grid\"\nactivation = \"linear\"",
            "representation.activation = linear is not allowed",
        ),
        (
            "kind = \"bhnerf\"",
            "kind = \"feature-grid\"\nfeature-grid.levels = 0",
            "representation.feature-grid.levels = 0 is not allowed: 1 to 6",
        ),
    ] {
        let words = changed(folder.path(), |text| text.replacen(from, to, 1));
        let words: Vec<String> = match to.contains("seed") || to.contains("spin") {
            // Overrides would be laid out anew: the file as it is.
            true => words[..2].to_vec(),
            false => words,
        };
        fail_with(folder.path(), &with(&words, &["-o", "run"]), &[said]);
    }
    let words = changed(folder.path(), |text| {
        "loss = []\n".to_owned() + &replaced(text, "[[loss]]", "[representation]", "")
    });
    fail_with(folder.path(), &with(&words, &["-o", "run"]), &["loss is empty"]);
}

/// A movie in text, a row of numbers a line, with a change to one of its numbers.
pub fn movie(folder: &Path, pixel: &str) -> Vec<String> {
    let row = |k: usize| {
        let flux = |c: usize| if k == 5 && c == 7 { pixel } else { "0.01" };
        (0..20).map(flux).collect::<Vec<_>>().join(",") + "\n"
    };
    std::fs::write(folder.join("frame.csv"), (0..20).map(row).collect::<String>()).unwrap();
    let data = "[data.movie]\npath = \"frame.csv\"\nfrom = 0.0\nto = 0.0\n\n";
    let mut words = changed(folder, |text| replaced(text, "[simulation", "[[loss]]", data));
    let simulated = |word: &String| word.starts_with("simulation.");
    let at = words.iter().position(simulated).unwrap();
    words.drain(at - 1..=at);
    words
}

#[test]
fn bad_movies_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for pixel in ["nan", "inf", "-inf"] {
        fail_with(folder.path(), &with(&movie(folder.path(), pixel), &["-o", "run"]), &["finite"]);
    }
    let words = movie(folder.path(), "0.5");
    let words = with(&words, &["-o", "run", "--set", "screen.pixels=24"]);
    fail_with(folder.path(), &words, &["has 20 x 20 pixels, but screen.pixels says 24 x 24"]);
}

/// Numbers that are not defined are none and explained, in the results and on the page.
#[test]
fn exact_a_dark_truth_is_said_to_be_one() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    for kind in ["representation=bhnerf", "representation=grid", "representation=linear-grid"] {
        let name = kind.split_once('=').unwrap().1;
        let dark = ["-o", name, "--set", "simulation.truth.spot.0.amplitude=0.0", "--set", kind];
        succeed(folder.path(), &with(&small, &dark));
        let run = folder.path().join(name);
        let found = results(&run);
        assert!(found["psnr_db"].is_null() && found["loss"].as_f64().is_some(), "{found}");
        assert!(found["note"].as_str().unwrap().contains("the truth is dark"), "{found}");
        let page = std::fs::read_to_string(run.join("report.html")).unwrap();
        assert!(page.contains("the truth is dark on all nodes"), "{name}");
        let log = std::fs::read_to_string(run.join("log.jsonl")).unwrap();
        assert!(!log.to_lowercase().contains("nan") && !log.contains("inf"), "{log}");
    }
}

/// A spot outside of the region gives data of nothing, which a fit explains perfectly.
#[test]
fn exact_a_truth_that_nobody_sees_is_refused() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    for setting in ["simulation.truth.spot.0.center=[900.0, 0.0, 0.0]", "motion.injection_time=1e8"]
    {
        let words = with(&small, &["-o", "run", "--set", setting]);
        fail_with(folder.path(), &words, &["the truth is dark in every pixel of every frame"]);
    }
}

/// The source rises late: frames without visibilities are frames without data.
#[test]
fn exact_frames_without_visibilities_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let of = |run: &'static str, elevation: &'static str, gmst: &'static str| {
        let settings = sets(&[
            "screen.pixels=24",
            "simulation.observation.scans=8",
            "representation.network.width=24",
            "training.steps=20",
            "training.start=drawn",
            "output.nodes=20",
            elevation,
            gmst,
        ]);
        [&["fit", "-o", run], &settings[..]].concat()
    };
    let day = of(
        "some",
        "simulation.observation.elevation_deg=[60.0,85.0]",
        "simulation.observation.gmst=[0.0,23.9]",
    );
    let said = told(folder.path(), &day);
    assert!(said.contains("of them fitted)"), "{said}");
    assert!(results(&folder.path().join("some"))["loss"].as_f64().unwrap().is_finite());
    let never = of(
        "none",
        "simulation.observation.elevation_deg=[84.0,85.0]",
        "simulation.observation.gmst=[2.0,2.667]",
    );
    fail_with(folder.path(), &never, &["no two stations see the source"]);
}

/// Measured visibilities: an error of zero is named with its place; without averaging every scan is a frame.
#[test]
fn exact_visibilities_without_errors_are_named() {
    let at = &new_folder();
    let line = |hour: f64, sigma: f64| {
        format!(
            "{hour:.8}      AA     AZ   1900047104.0000  -4939025408.0000  0.14292954    141.7436  {sigma:.8}\n\
             {hour:.8}      AA     LM   1868288384.0000  -3689129984.0000  0.21103669   -122.7523  0.00446794\n"
        )
    };
    let head = "# SRC:SGRA DATE(MJD):57853 FREQ:229.0707GHz\n\
                # time(UTC)      T1     T2   U(lambda)        V(lambda)         Iamp(Jy)    Iphase(d)   Isigma(Jy)\n";
    let write = |sigma: f64| {
        let rows: String = (0..4)
            .map(|k| line(2.01 + 0.1 * f64::from(k), if k == 2 { sigma } else { 0.01 }))
            .collect();
        std::fs::write(at.join("data.txt"), format!("{head}{rows}")).unwrap();
    };
    let fit = scene_path("fits/sgra_visibilities.toml");
    let path = format!("data.visibilities.path={}", at.join("data.txt").display());
    let words = |average: &'static str, out: &'static str| {
        let settings = sets(&[
            "loss=[{data=\"amplitudes\",weight=1.0}]",
            "screen.pixels=12",
            "training.steps=2",
            "training.start=drawn",
            average,
            &path,
        ]);
        [&["fit", &fit, "-o", out], &settings[..]].concat()
    };
    write(0.0);
    let said = fail(at, &words("data.visibilities.average_s=0.0", "out"));
    assert!(said.contains("data.txt: visibility of AA-AZ at 2.210000 h: sigma = 0 Jy"), "{said}");
    write(0.02);
    for (average, frames) in
        [("data.visibilities.average_s=0.0", 4), ("data.visibilities.average_s=720.0", 2)]
    {
        let said = told(at, &words(average, if frames == 4 { "all" } else { "mean" }));
        assert!(said.contains(&format!("; {frames} frames")), "{said}");
    }
}

/// The system makes a folder once: of fits that begin at the same moment each has its own.
#[test]
fn exact_fits_that_begin_at_once_have_a_folder_each() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    let words = with(&small, &["--set", "training.steps=1"]);
    let running: Vec<_> = (0..4).map(|_| start(folder.path(), &words)).collect();
    for mut fit in running {
        assert_eq!(fit.wait().unwrap().code(), Some(0));
    }
    let names = ["kerrlight-fit", "kerrlight-fit-2", "kerrlight-fit-3", "kerrlight-fit-4"];
    assert_eq!(files(folder.path()), names);
    for name in names {
        assert!(folder.path().join(name).join("report.html").is_file(), "{name}");
    }
}

/// A title with a control character is no end of a comment, and nothing that a terminal obeys.
#[test]
fn regress_titles_stand_in_a_line() {
    let (small, folder) = (small(), tempfile::tempdir().unwrap());
    let words = ["-o", "run", "--set", "training.steps=1", "--set", "title=a\u{1b}[31m\nb"];
    let said = told(folder.path(), &with(&small, &words));
    assert!(said.contains("a\\u{1b}[31m\\nb: image"), "{said}");
    let run = folder.path().join("run");
    let scene = std::fs::read_to_string(run.join("scene.toml")).unwrap();
    assert!(scene.lines().next().unwrap().ends_with("a\\u{1b}[31m\\nb"), "{scene}");
    for name in ["scene.toml", "fit.toml", "report.html"] {
        assert!(!std::fs::read_to_string(run.join(name)).unwrap().contains('\u{1b}'), "{name}");
    }
    let refused = fail(folder.path(), &with(&small, &["-o", "new\nline"]));
    assert!(refused.contains("`new\\nline` holds a control character (U+000A)"), "{refused}");
    assert_eq!(files(folder.path()), ["run"]);
}
