//! Limits of the system: threads, a closed standard output; and what is left behind by kills.

use crate::support::{after, folder_with, message, scene_path, succeed};
use std::fs;

const CURVE: [&str; 7] =
    ["critical-curve", "--spin", "0.5", "--inclination", "30", "--points", "3"];

/// The stacks of so many threads do not fit into the address space: what the system says is that of a limit of threads,
/// which does not hold for root.
#[cfg(target_os = "linux")]
#[test]
fn regress_no_more_threads_is_an_error_that_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let cramped = |threads: &str| format!("ulimit -v 400000; {threads} exec \"$@\"");
    let ended = after(folder.path(), &cramped("RAYON_NUM_THREADS=1024"), &CURVE);
    let said = message(&ended);
    assert_eq!(ended.status.code(), Some(2), "{said}");
    for word in ["cannot start 1024 threads", "ulimit -u", "pids.max", "--threads"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    // Threads that would not help are not started.
    let many = [&CURVE[..], &["--threads", "1024"]].concat();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if cores <= 4 {
        let ended = after(folder.path(), &cramped(""), &many);
        assert!(ended.status.success(), "{}", message(&ended));
    }
}

#[cfg(unix)]
#[test]
fn exact_what_cannot_be_printed_is_an_error() {
    let folder = folder_with("r.csv", "spin,inclination_deg,alpha,beta\n0.5,60,1,2\n");
    let uv = ["uv", "ngEHT", "--source", "m87", "--mjd", "57850", "--frames", "2"];
    let uv = [&uv[..], &["--tint", "60", "--utc", "2-4"]].concat();
    let to_pipe = [&CURVE[..], &["-o", "-"]].concat();
    let json = [&CURVE[..], &["--json"]].concat();
    let all = [&CURVE[..], &uv, &to_pipe, &json, &["trace", "--rays", "r.csv"], &["--version"]];
    for words in all {
        let mut ways = vec![("exec \"$@\" >&-", "it is closed")];
        if cfg!(target_os = "linux") {
            ways.push(("exec \"$@\" >/dev/full", "No space left"));
        }
        for (script, reason) in ways {
            let ended = after(folder.path(), script, words);
            let said = message(&ended);
            assert_eq!(ended.status.code(), Some(2), "{words:?} {script}: {said}");
            assert!(said.contains("standard output") && said.contains(reason), "{words:?}: {said}");
        }
    }
    assert!(after(folder.path(), "exec \"$@\" >/dev/null", &CURVE).status.success());
}

/// Files of a film that was killed go, those that somebody writes or that others have made stay.
#[test]
fn exact_leftovers_of_a_killed_film_are_removed_by_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let scene = &scene_path("disc_face_on.toml");
    let words =
        ["movie", scene, "--frames", "2", "--duration", "60", "-o", "m", "--gif", "m.gif", "--png"];
    let words = [&words[..], &["--set", "screen.width=8", "--set", "screen.height=8"]].concat();
    succeed(folder.path(), &words);
    let ours = [
        "m/.kerrlight-frame_0001.png-abcdef",
        "m/.kerrlight-frame_0001.exr-a1B2c3",
        ".kerrlight-m.gif-abcdef",
    ];
    let others = [
        "m/.kerrlight-frame_0001.png-mine.txt",
        ".kerrlight-other.gif-abcdef",
        "m/.kerrlight-frame_0000.exr-busybs",
    ];
    ours.iter().chain(&others).for_each(|name| fs::write(at(name), "x").unwrap());
    fs::remove_file(at("m/frame_0001.exr")).unwrap();
    let busy = fs::File::open(at(others[2])).unwrap();
    busy.try_lock().unwrap();
    succeed(folder.path(), &words);
    assert!(ours.iter().all(|name| !at(name).exists()));
    assert!(others.iter().all(|name| at(name).exists()) && at("m/frame_0001.exr").exists());
}
