//! Ranks on a disk that is full, and the same job once there is room: in a file system of memory, of a mount of its own.

use super::start_with;
use crate::shared_folder::{claims, experiment};
use crate::support::{binary, root, succeed};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Mounts a disk of $SIZE in `disk`, runs $FIRST of $PROGRAM there, gives it room, and runs $SECOND. What both say goes to
/// `first` and `second`; the results come to `kept`.
const SCRIPT: &str = r#"
mkdir -p disk kept
mount -t tmpfs -o size="$SIZE" none disk || exit 99
cp input/* disk/
job() { (cd disk && mpirun --oversubscribe --allow-run-as-root -n "$RANKS" "$PROGRAM" "$@") ; }
job $FIRST > first 2>&1; echo $? > first.code
mount -o remount,size=200M disk
job $SECOND > second 2>&1; echo $? > second.code
cp -r disk/. kept/
"#;

/// Runs a job of ranks on a disk of `kib`, which is too small, and another with room there; nothing where no disk can be
/// mounted or there is no `mpirun`. The first ends with one message.
fn twice(at: &Path, kib: u64, ranks: usize, first: &[&str], second: &[&str]) -> Option<()> {
    start_with(at, 1, &["--version"])?.wait().unwrap();
    let mut command = Command::new("unshare");
    command.args(["--mount", "--map-root-user", "--user", "sh", "-c", SCRIPT]).current_dir(at);
    command.env("PROGRAM", binary()).env("SIZE", format!("{kib}k"));
    command.env("RANKS", ranks.to_string());
    command.env("FIRST", first.join(" ")).env("SECOND", second.join(" "));
    if command.output().unwrap().status.code() == Some(99) {
        eprintln!("A FULL DISK IS NOT TESTED: nothing can be mounted here");
        return None;
    }
    let read = |name: &str| std::fs::read_to_string(at.join(name)).unwrap();
    let said = read("first");
    assert_ne!(read("first.code").trim(), "0", "the disk was large enough: {said}");
    let errors = said.lines().filter(|line| line.starts_with("error: ")).collect::<Vec<_>>();
    assert_eq!(errors.len(), 1, "one message: {said}");
    assert_eq!(said.matches("No space left on device").count(), 1, "{said}");
    assert_eq!(read("second.code").trim(), "0", "{}", read("second"));
    Some(())
}

/// KiB of a folder.
fn size(at: &Path, name: &str) -> u64 {
    let said = Command::new("du").args(["-sk", name]).current_dir(at).output().unwrap();
    let text = String::from_utf8(said.stdout).unwrap();
    text.split_whitespace().next().unwrap().parse().unwrap()
}

/// A folder with `input`, which is copied to the disk.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("input");
    std::fs::create_dir(&input).unwrap();
    (folder, input)
}

fn whole(at: &Path, name: &str) -> Vec<u8> {
    std::fs::read(at.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Bands of a picture: what was there of it is of use once there is room.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_render_on_after_a_full_disk() {
    let (folder, input) = folder();
    let at = folder.path();
    std::fs::copy(root().join("scenes/disc_face_on.toml"), input.join("scene.toml")).unwrap();
    let words = ["render", "scene.toml", "-o", "out.exr", "--set", "screen.width=320"];
    succeed(&input, &words);
    let alone = whole(at, "input/out.exr");
    std::fs::remove_file(input.join("out.exr")).unwrap();
    let kib = alone.len() as u64 / 2048;
    if twice(at, kib, 3, &words, &words).is_some() {
        assert!(whole(at, "kept/out.exr") == alone);
    }
}

/// Cases of an experiment: those that were done stay done.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_compare_on_after_a_full_disk() {
    let (folder, input) = folder();
    let at = folder.path();
    experiment(&input, 8, 10);
    let words = ["compare", "seeds.toml", "-o", "out", "--threads", "1"];
    succeed(at, &["compare", "input/seeds.toml", "-o", "alone"]);
    if twice(at, size(at, "alone") / 2, 4, &words, &words).is_some() {
        assert_eq!(claims(&at.join("kept/out"), ".done"), 8);
        super::compare::same(at, "alone", "kept/out");
    }
}

/// A fit: it resumes from its last checkpoint.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_fit_on_after_a_full_disk() {
    let (folder, input) = folder();
    let at = folder.path();
    std::fs::write(input.join("fit.toml"), super::fits::small()).unwrap();
    // Checkpoints say where paths start: where the disk will be.
    std::fs::create_dir(at.join("disk")).unwrap();
    std::fs::copy(input.join("fit.toml"), at.join("disk/fit.toml")).unwrap();
    succeed(&at.join("disk"), &["fit", "fit.toml", "-o", "../alone", "--threads", "1"]);
    let first = ["fit", "fit.toml", "-o", "out", "--threads", "1"];
    let second = ["fit", "--resume", "out", "--threads", "1"];
    if twice(at, size(at, "alone") * 3 / 5, 3, &first, &second).is_some() {
        for name in ["checkpoint.safetensors", "volume.npz", "movie.npz"] {
            let [a, b] = ["alone", "kept/out"].map(|run| whole(at, &format!("{run}/{name}")));
            assert!(a == b, "{name}: {} and {} bytes", a.len(), b.len());
        }
    }
}
