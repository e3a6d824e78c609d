//! Bands of a picture and frames of a film, shared by ranks.

use super::{kill_ranks, names, ranks_of, says, start_with};
use crate::support::{root, succeed};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// A scene of the repository.
fn scene(name: &str) -> String {
    root().join("scenes").join(name).display().to_string()
}

/// Names in the folders of a folder.
fn names_below(at: &Path) -> Vec<String> {
    let folders = std::fs::read_dir(at).into_iter().flatten().flatten();
    let inner = folders.flat_map(|folder| std::fs::read_dir(folder.path()).into_iter().flatten());
    inner.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect()
}

/// Any number of ranks renders what one process renders, one of them speaks, and nothing is left beside the file.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_render_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = scene("hot_spots.toml");
    let words =
        |output| ["render", &scene, "-o", output, "--preview", "p.png", "--set", "screen.width=80"];
    succeed(at, &words("alone.exr"));
    let png = std::fs::read(at.join("p.png")).unwrap();
    let alone = std::fs::read(at.join("alone.exr")).unwrap();
    for ranks in [1, 2, 4, 7] {
        let Some(text) = says(at, ranks, &words("out.exr")) else { return };
        assert_eq!(text.matches("flux").count(), 1, "{text}");
        assert!(std::fs::read(at.join("out.exr")).unwrap() == alone, "{ranks} ranks");
        assert!(std::fs::read(at.join("p.png")).unwrap() == png, "{ranks} ranks");
        assert_eq!(names(at), ["alone.exr", "out.exr", "p.png"]);
    }
}

/// Killed ranks lose nothing but the bands under way, and another number of ranks, or one process, goes on.
#[test]
#[ignore = "long"]
fn exact_a_killed_rank_of_mpirun_leaves_its_bands() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = scene("disc_face_on.toml");
    let words = |output| {
        let mut words = vec!["render", &scene, "-o", output, "--threads", "1"];
        words.extend(["--set", "screen.width=640", "--set", "screen.samples_per_pixel=16"]);
        words
    };
    succeed(at, &words("alone.exr"));
    let kills = kill_ranks(|ranks| start_with(at, ranks, &words("out.exr")));
    if kills == 0 {
        return;
    }
    assert!(
        std::fs::read(at.join("out.exr")).unwrap() == std::fs::read(at.join("alone.exr")).unwrap()
    );
    assert_eq!(names(at), ["alone.exr", "out.exr"]);
    // What ranks have left is of use to one process.
    std::fs::remove_file(at.join("out.exr")).unwrap();
    let mut job = start_with(at, 3, &words("out.exr")).unwrap();
    let shared = at.join("out.exr.shared");
    let has_bands = || names_below(&shared).iter().any(|name| name.ends_with(".partial"));
    let clock = Instant::now();
    while !has_bands() && clock.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let ranks = ranks_of(&job);
    let last = ranks.last().expect("40 bands take longer than one");
    Command::new("kill").args(["-9", last]).status().unwrap();
    job.wait().unwrap();
    assert!(has_bands() && !at.join("out.exr").exists());
    succeed(at, &words("out.exr"));
    assert!(
        std::fs::read(at.join("out.exr")).unwrap() == std::fs::read(at.join("alone.exr")).unwrap()
    );
    assert_eq!(names(at), ["alone.exr", "out.exr"]);
}

/// A film with one scale for all frames, which is that of the first, by any number of ranks and after kills.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_render_one_film() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = scene("hot_spots.toml");
    let words = |output: &str| {
        let fixed = ["movie", &scene, "--frames", "13", "--duration", "100", "--gif", "film.gif"];
        let set = ["--set", "screen.width=16", "--set", "screen.total_flux_jy=2.5"];
        let all = [&fixed[..], &set, &["--threads", "1", "-o", output]].concat();
        all.into_iter().map(str::to_owned).collect::<Vec<String>>()
    };
    let alone = words("alone");
    succeed(at, &alone.iter().map(String::as_str).collect::<Vec<_>>());
    let gif = std::fs::read(at.join("film.gif")).unwrap();
    let same = |other: &str| {
        assert_eq!(names(&at.join("alone")), names(&at.join(other)));
        for name in names(&at.join("alone")) {
            let [a, b] = ["alone", other].map(|folder| std::fs::read(at.join(folder).join(&name)));
            assert!(a.unwrap() == b.unwrap(), "{other}/{name}");
        }
        assert!(std::fs::read(at.join("film.gif")).unwrap() == gif);
    };
    for ranks in [1, 2, 4, 7] {
        let output = format!("out{ranks}");
        let Some(text) = says(at, ranks, &words(&output)) else { return };
        assert_eq!(text.matches("13 frames, 13 of them rendered").count(), 1, "{text}");
        same(&output);
    }
    kill_ranks(|ranks| start_with(at, ranks, &words("out")));
    same("out");
}
