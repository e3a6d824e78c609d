//! The same pages as a browser shows them, where there is one.

use super::{XI, report, spots};
use crate::output::Output;
use crate::report::{Report, View3d};
use kerrlight_render::dynamics::{self, AngularVelocity, Turned, pull_back};
use kerrlight_render::points::{Coordinates, CoordinatesMut};
use kerrlight_render::volume::{Shown, Volume, vti};
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A browser that can be run without a screen, if there is one.
fn browser() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders = std::env::var_os("PATH")?;
    let all = std::env::split_paths(&folders).flat_map(|f| names.map(|name| f.join(name)));
    let found = all.into_iter().find(|path| path.is_file());
    if found.is_none() {
        skipped("there is no chromium in PATH (apt install chromium)");
    }
    found
}

/// Says that something is not tested, past the harness, which keeps what passing tests print; with KERRLIGHT_TEST_ALL it
/// fails.
fn skipped(why: impl Display) {
    // What cannot be said is no failure of what was to be tested.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
    let all = std::env::var_os("KERRLIGHT_TEST_ALL").is_some_and(|value| !value.is_empty());
    assert!(!all, "KERRLIGHT_TEST_ALL: {why}");
}

/// Runs the browser on the page of a folder and gives back what it printed.
fn browse(browser: &Path, folder: &Path, fragment: &str, switch: &str) -> String {
    let out = folder.join("dump.html");
    let page = format!("file://{}#{fragment}", folder.join("report.html").display());
    let profile = format!("--user-data-dir={}", folder.join("profile").display());
    let mut child = Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader"])
        .args(["--hide-scrollbars", "--window-size=700,900", "--timeout=20000"])
        .args([switch, &profile, &page])
        .stdout(std::fs::File::create(&out).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(120) {
            let _ = child.kill();
            panic!("the browser has not ended after two minutes");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    std::fs::read_to_string(out).unwrap()
}

/// Returns the page as the browser has built it, as HTML.
fn dump(browser: &Path, folder: &Path, fragment: &str) -> String {
    browse(browser, folder, fragment, "--dump-dom")
}

/// The middle of the three-dimensional view as the browser draws it, on a page with nothing above it.
fn drawn(browser: &Path, folder: &Path, fragment: &str) -> Vec<u8> {
    let place = folder.join("screen.png");
    browse(browser, folder, fragment, &format!("--screenshot={}", place.display()));
    let screen = image::open(place).unwrap().into_rgb8();
    let middle = screen.enumerate_pixels();
    let middle = middle.filter(|(x, y, _)| (60..640).contains(x) && (260..640).contains(y));
    middle.flat_map(|(_, _, pixel)| pixel.0).collect()
}

fn status(dump: &str) -> &str {
    let found = dump.split_once("<span id=\"status\" role=\"status\">").unwrap().1;
    found.split_once('<').unwrap().0
}

fn write(report: &Report, folder: &Path) {
    report.write(&Output::new(&folder.join("report.html"), "html").unwrap()).unwrap();
    let view = report.view.as_ref().unwrap();
    let fields = [
        Shown { name: "emission", volume: &view.recovered },
        Shown { name: "emission_truth", volume: view.truth.as_ref().unwrap() },
    ];
    let output = Output::new(&folder.join("emission.vti"), "vti").unwrap();
    output.write_with(|file| Ok(vti::write(file, &fields)?)).unwrap();
}

/// The page runs in a browser, with WebGL2 or without it. `KERRLIGHT_REPORT` is a folder to keep it in, with
/// the volumes for tests/reference/read_vti.py.
#[test]
fn code_page_runs_in_a_browser() {
    let folder = tempfile::tempdir().unwrap();
    let report = report(64);
    write(&report, folder.path());
    if let Some(place) = std::env::var_os("KERRLIGHT_REPORT") {
        write(&report, Path::new(&place));
    }
    let Some(browser) = browser() else { return };
    let found = dump(&browser, folder.path(), "time=0.5&azimuth=70&volume=truth");
    assert!(["ready: webgl2", "ready: fallback"].contains(&status(&found)), "{}", status(&found));
    assert!(found.contains("<output id=\"time-text\">0.5 orbits at 3.5 M</output>"));
    assert_eq!(found.matches("type=\"radio\"").count(), 2);
    assert!(found.contains("(on the ") && found.contains("class=\"still\""));
    let found = dump(&browser, folder.path(), "renderer=fallback");
    assert_eq!(status(&found), "ready: fallback");
    assert!(found.contains("on the CPU: WebGL2 is not used"));
}

/// Emission at a time, from that of the reference time.
fn carried(volume: &Volume, time: f64) -> Volume {
    let axis = dynamics::Axis::new(XI).unwrap();
    let flow = AngularVelocity::bhnerf();
    let value = |k: usize| {
        let point = volume.position(k);
        let ([px, py, pz], angles) = (point.map(|x| [x]), [flow.angle(point, time, 0.0)]);
        let [mut x, mut y, mut z] = [[0.0]; 3];
        let points = Coordinates::xyz(&px, &py, &pz);
        let pulled = CoordinatesMut::xyz(&mut x, &mut y, &mut z);
        pull_back(axis, Turned { points, angles: &angles }, pulled);
        volume.at([x[0], y[0], z[0]]) as f32
    };
    let values = (0..volume.values().len()).map(value).collect();
    Volume::new(volume.nodes(), volume.low(), volume.high(), values).unwrap()
}

/// Matter that the viewer turns to a time looks as what the fit's own dynamics carry there.
#[test]
fn code_viewer_moves_matter_as_the_fit_does() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    let recovered = spots(64, 0.5, 1.0);
    let truth = Some(carried(&recovered, 0.4));
    let view = View3d { recovered, truth, ..report(4).view.unwrap() };
    write(&Report { view: Some(view), ..Report::default() }, folder.path());
    let picture = |fragment: &str| drawn(&browser, folder.path(), fragment);
    let difference = |a: &[u8], b: &[u8]| {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
        sum / a.len() as f64
    };
    // As many rays for all pictures, however fast they are drawn.
    for renderer in ["renderer=fallback&pixels=160", "pixels=160"] {
        let known = picture(&format!("volume=truth&{renderer}"));
        let turned = picture(&format!("volume=recovered&time=0.4&{renderer}"));
        let still = picture(&format!("volume=recovered&time=0&{renderer}"));
        let [error, change] = [difference(&known, &turned), difference(&known, &still)];
        eprintln!("{renderer} {error:.2} of 255, without motion {change:.2}");
        assert!(error < 0.1 * change && change > 5.0, "{renderer} {error} {change}");
    }
}
