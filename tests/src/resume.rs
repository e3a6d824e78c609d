//! Pictures that are interrupted end in the same bytes.

use crate::support::{
    binary, cramped, fail_with, folder_with, kill, message, scene_path, start, succeed, told, until,
};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Ten bands of a scene whose rays are slow enough to be interrupted.
const SIZE: [&str; 4] = ["--set", "screen.width=40", "--set", "screen.height=160"];

fn arguments(scene: &str) -> Vec<&str> {
    [&["render", scene, "-o", "a.exr", "--preview", "a.png"][..], &SIZE[..]].concat()
}

/// The whole picture of the scene that tests interrupt, and how long it takes.
fn undisturbed() -> &'static (Vec<u8>, Duration) {
    static PICTURE: OnceLock<(Vec<u8>, Duration)> = OnceLock::new();
    PICTURE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        binary();
        let clock = Instant::now();
        succeed(folder.path(), &arguments(&scene_path("hot_spots.toml")));
        let taken = clock.elapsed();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left behind");
        (std::fs::read(folder.path().join("a.exr")).unwrap(), taken)
    })
}

#[test]
fn exact_same_bytes_after_kills_at_twenty_moments() {
    let scene = scene_path("hot_spots.toml");
    let (whole, taken) = undisturbed();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("a.exr");
    let mut resumed = 0;
    for k in 0..20 {
        // Multiples of the golden ratio fall everywhere.
        let moment = taken.mul_f64((0.618_034 * f64::from(k)).fract() * 0.6);
        resumed += usize::from(folder.path().join("a.exr.partial").exists());
        let child = start(folder.path(), &arguments(&scene));
        std::thread::sleep(moment);
        kill(child);
        if output.exists() {
            assert!(std::fs::read(&output).unwrap() == *whole, "a half file after kill {k}");
            std::fs::remove_file(&output).unwrap();
        }
    }
    assert!(resumed > 5, "{resumed} runs went on with another's work");
    succeed(folder.path(), &arguments(&scene));
    assert!(std::fs::read(&output).unwrap() == *whole);
}

/// Ctrl-C keeps what is there and says how to go on; other scenes do not take it up.
#[cfg(unix)]
#[test]
fn exact_same_bytes_after_an_interrupt() {
    let scene = scene_path("hot_spots.toml");
    let (whole, taken) = undisturbed();
    let folder = tempfile::tempdir().unwrap();
    let partial = folder.path().join("a.exr.partial");
    let child = start(folder.path(), &arguments(&scene));
    // Its head alone is not yet a band.
    let head = || std::fs::metadata(&partial).map_or(0, |m| m.len());
    let clock = Instant::now();
    while head() < 4096 && clock.elapsed() < 20 * *taken + Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    crate::signals::signal(child.id(), "-INT");
    let ended = child.wait_with_output().unwrap();
    let said = message(&ended);
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(said.contains("a.exr.partial") && said.contains("same command"), "{said}");
    let kept = std::fs::read(&partial).unwrap();

    let changed = [&arguments(&scene)[..], &["--set", "hole.spin=0.4"]].concat();
    assert!(told(folder.path(), &changed).contains("to another picture"));
    assert!(std::fs::read(folder.path().join("a.exr")).unwrap() != *whole);

    std::fs::write(&partial, kept).unwrap();
    let tiles = [&arguments(&scene)[..], &["--tile", "7", "--threads", "3"]].concat();
    assert!(told(folder.path(), &tiles).contains("bands are done"));
    assert!(std::fs::read(folder.path().join("a.exr")).unwrap() == *whole);
    assert!(!partial.exists());
}

/// A disk that is full (here: a limit on the size of files) loses nothing.
#[cfg(unix)]
#[test]
fn exact_same_bytes_after_a_full_disk() {
    let scene = scene_path("hot_spots.toml");
    let (whole, _) = undisturbed();
    let folder = tempfile::tempdir().unwrap();
    let output = cramped(folder.path(), 16, &arguments(&scene));
    let said = message(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("cannot write") && said.contains("same command"), "{said}");
    assert!(!folder.path().join("a.exr").exists());
    succeed(folder.path(), &arguments(&scene));
    assert!(std::fs::read(folder.path().join("a.exr")).unwrap() == *whole);
}

/// All files of a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let read = |entry: std::fs::DirEntry| std::fs::read(entry.path()).unwrap();
    entries.map(|entry| (entry.file_name().into_string().unwrap(), read(entry))).collect()
}

/// A film of a volume with slow light that is killed again and again ends in the same frames, and
/// leaves nothing else. (Refined pixels: its frames come one by one.)
#[test]
#[ignore = "long"]
fn exact_same_film_of_a_volume_after_kills() {
    let scene = scene_path("volume.toml");
    let size = ["--set", "screen.width=24", "--set", "screen.height=16"];
    let refined = ["--set", "screen.image_error=0.1"];
    let film = ["--frames", "9", "--from", "0", "--to", "80", "-o", "film"];
    let movie = [&["movie", &scene][..], &film, &size, &refined].concat();
    let undisturbed = tempfile::tempdir().unwrap();
    succeed(undisturbed.path(), &movie);
    let whole = files(&undisturbed.path().join("film"));
    assert_eq!(whole.len(), 9);
    let folder = tempfile::tempdir().unwrap();
    let (film, mut kept) = (folder.path().join("film"), 0);
    for k in [0, 2, 3, 6] {
        let child = start(folder.path(), &movie);
        let frame = film.join(format!("frame_{k:04}.exr"));
        until("a frame", || frame.exists());
        kill(child);
        let there = files(&film);
        let frames = there.iter().filter(|(name, _)| name.ends_with(".exr"));
        for (name, bytes) in frames {
            assert!(whole.get(name) == Some(bytes), "{name} after a kill at frame {k}");
            kept += 1;
        }
    }
    assert!((8..36).contains(&kept), "{kept}");
    succeed(folder.path(), &movie);
    assert!(files(&film) == whole);
}

#[test]
fn a_file_in_the_way_of_the_journal_is_spared() {
    let folder = folder_with("a.exr.partial", "somebody's notes");
    fail_with(folder.path(), &["render", "-o", "a.exr"], &["no journal of kerrlight"]);
    let notes = std::fs::read_to_string(folder.path().join("a.exr.partial")).unwrap();
    assert_eq!(notes, "somebody's notes");
}

/// Neither the number of threads nor the size of tiles changes a bit.
#[test]
fn exact_same_bytes_for_any_tile_and_any_number_of_threads() {
    let scene = scene_path("disc_edge_on.toml");
    let folder = tempfile::tempdir().unwrap();
    let base = ["render", &scene, "--set", "screen.width=70", "--set", "screen.height=39"];
    let mut files = Vec::new();
    for [tile, threads] in [["64", "2"], ["1", "3"], ["13", "1"], ["100", "4"]] {
        let more = ["-o", "a.exr", "--tile", tile, "--threads", threads];
        succeed(folder.path(), &[&base[..], &more].concat());
        files.push(std::fs::read(folder.path().join("a.exr")).unwrap());
    }
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]));
}
