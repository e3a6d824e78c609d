//! Pages of spots that turn about a tilted axis, read as text and, where there is one, by a browser.

use super::*;
use kerrlight_tomo::dynamics::{self, AngularVelocity, Turned, pull_back};
use kerrlight_tomo::points::{Coordinates, CoordinatesMut};
use kerrlight_tomo::volume::projection::Surroundings;
use kerrlight_tomo::volume::slices::Through;
use kerrlight_tomo::volume::vti::{self, Field};
use kerrlight_tomo::volume::{Shown, Volume};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const XI: [f64; 3] = [0.5, 0.0, -0.866_025_403_784_438_6];

/// Four spots at 3.5 M, as in scene "4" of BH-NeRF (Levis et al. 2022), of a width and a brightness.
fn spots(nodes: usize, sigma: f64, peak: f64) -> Volume {
    let centre = |phase: f64| {
        let (sin, cos) = (-TAU * phase / 127.0).sin_cos();
        let [x, z] = [3.5 * 0.75f64.sqrt(), 1.75];
        // ξ × start has length 3.5 and points along y: the start is at right angles to ξ.
        let across = XI[2] * x - XI[0] * z;
        [x * cos, across * sin, z * cos]
    };
    let centres = [60.0, 75.0, 105.0, 0.0].map(centre);
    let light = |point: [f64; 3]| -> f64 {
        let square = |c: &[f64; 3]| point.iter().zip(c).map(|(x, c)| (x - c).powi(2)).sum::<f64>();
        centres.iter().map(|c| peak * (-square(c) / (2.0 * sigma * sigma)).exp()).sum()
    };
    let volume = |values| Volume::new([nodes; 3], [-5.0; 3], [5.0; 3], values).unwrap();
    let empty = volume(vec![0.0; nodes.pow(3)]);
    volume((0..nodes.pow(3)).map(|k| light(empty.position(k)) as f32).collect())
}

fn motion() -> Motion {
    let flow = AngularVelocity::bhnerf();
    let rates = (0..40).map(|k| 2.0 + 0.08 * f64::from(k)).map(|r| [r, flow.rate(r)]).collect();
    let time_unit = "orbits at 3.5 M".to_owned();
    Motion { axis: XI, rates, times: [0.0, 1.0], reference: 0.0, time_unit }
}

fn text(words: &str) -> String {
    words.to_owned()
}

fn loss() -> LinePlot {
    let curve = |name: &str, scale: f64| Series {
        name: text(name),
        points: (0..200).map(f64::from).map(|k| [k, scale * (-k / 40.0).exp()]).collect(),
        errors: Vec::new(),
        marks: Marks::Line,
    };
    LinePlot {
        title: text("Loss"),
        caption: text("Mean square of residuals while the fit went on."),
        x: Axis { label: text("step"), unit: text(""), log: false },
        y: Axis { label: text("loss"), unit: text("Jy²"), log: true },
        series: vec![curve("image", 1.0), curve("visibilities", 0.3)],
    }
}

fn amplitudes() -> LinePlot {
    let model = |x: f64| 1.2 * (-x * x / 18.0).exp() + 0.02;
    let at = |k: i32| 0.05 * f64::from(k);
    let data = |k: i32| [at(k), model(at(k)) * (1.0 + 0.1 * f64::from(k * 7919 % 13 - 6) / 6.0)];
    let series = |name: &str, points: Vec<[f64; 2]>, errors: Vec<f64>, marks| Series {
        name: text(name),
        points,
        errors,
        marks,
    };
    LinePlot {
        title: text("Data and model"),
        caption: text(
            "Amplitudes of the data with errors of one σ, and of the recovered emission.",
        ),
        x: Axis { label: text("baseline"), unit: text("Gλ"), log: false },
        y: Axis { label: text("|V|"), unit: text("Jy"), log: true },
        series: vec![
            series("data", (0..180).map(data).collect(), vec![0.03; 180], Marks::Points),
            series("model", (0..180).map(|k| [at(k), model(at(k))]).collect(), vec![], Marks::Line),
        ],
    }
}

/// A page as a fit would fill it. What is called recovered is the truth, wider and fainter.
fn report(nodes: usize) -> Report {
    let (recovered, truth) = (spots(nodes, 0.5, 0.8), spots(nodes, 0.4, 1.0));
    let unit = "scene unit";
    let shown =
        [Shown { name: "recovered", volume: &recovered }, Shown { name: "truth", volume: &truth }];
    let around = Surroundings { hole_radius: 2.0, axis: XI, ring_radius: 5.0, half_width: 5.5 };
    let figures = vec![
        projections(&shown, &around, unit).unwrap(),
        slices(&shown, Through::Maximum, 2.0, unit).unwrap(),
    ];
    let outcome = |name: &str, value: &str, unit: &str, meaning: &str| Outcome {
        name: text(name),
        value: text(value),
        unit: text(unit),
        meaning: text(meaning),
    };
    let setting = |key: &str, value: &str, unit: &str| Setting {
        key: text(key),
        value: text(value),
        unit: text(unit),
    };
    Report {
        title: text("Four spots around a hole without spin"),
        summary: vec![
            text(
                "Which emission around the hole explains the movie? This page is a test of itself.",
            ),
            text("\"Recovered\" is no fit here: it is the truth, 25 % wider and 20 % fainter."),
        ],
        results: vec![
            outcome("NRMSE", "0.41", "", "0 is perfect, 1 is what an empty volume has"),
            outcome("PSNR", "36.2", "dB", "an empty volume has 28.48 dB"),
        ],
        settings: vec![setting("spin", "0", ""), setting("fov", "16", "M")],
        figures,
        plots: vec![loss(), amplitudes()],
        view: Some(View3d {
            recovered,
            truth: Some(truth),
            unit: unit.to_owned(),
            motion: Some(motion()),
            hole_radius: 2.0,
            r_max: 5.0,
        }),
    }
}

/// Attributes and functions that make a browser fetch something.
const FETCHING: [&str; 8] =
    ["https:", "href=", "url(h", "@import", "fetch(", "XMLHttpRequest", "import(", "<link"];

#[test]
fn exact_page_needs_nothing_else() {
    let page = report(24).html().unwrap();
    for word in FETCHING {
        assert!(!page.contains(word), "{word}");
    }
    // Namespaces of SVG are names, nobody loads them.
    let spaces = page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count();
    assert_eq!(page.matches("http:").count(), spaces);
    // Names of clip paths, each of them on the page once.
    assert_eq!(page.matches("url(").count(), page.matches("\"url(#plot").count());
    let names: Vec<&str> =
        page.split(" id=\"").skip(1).filter_map(|s| s.split('"').next()).collect();
    let unique: std::collections::BTreeSet<&&str> = names.iter().collect();
    assert_eq!(unique.len(), names.len());
    assert_eq!(page.matches("src=").count(), page.matches("src=\"data:image/png;base64,").count());
    assert_eq!(page.matches("<svg").count(), 2);
    for id in ["summary", "results", "three-dimensions", "pictures", "plots", "settings"] {
        assert_eq!(page.matches(&format!("<section id=\"{id}\">")).count(), 1, "{id}");
    }
}

/// Text that would be markup, in every place that takes text.
#[test]
fn exact_all_text_is_escaped() {
    let bad = "</script><b a='\"'>&";
    let mut page = report(8);
    page.title = text(bad);
    page.summary = vec![text(bad)];
    let [setting, outcome] = [&mut page.settings[0].key, &mut page.results[0].meaning];
    (*setting, *outcome) = (text(bad), text(bad));
    page.figures[0].alt = text(bad);
    page.figures[0].caption = text(bad);
    for plot in &mut page.plots {
        for place in [&mut plot.title, &mut plot.caption, &mut plot.x.label, &mut plot.y.unit] {
            *place = text(bad);
        }
        plot.series[0].name = text(bad);
    }
    let view = page.view.as_mut().unwrap();
    view.unit = text(bad);
    view.motion.as_mut().unwrap().time_unit = text(bad);
    let html = page.html().unwrap();
    assert!(!html.contains("<b a="));
    assert_eq!(html.matches("</script>").count(), 2);
    assert!(html.matches("&lt;/script&gt;&lt;b a=").count() >= 12);
}

#[test]
fn exact_bytes_of_the_view_are_the_volume() {
    let page = report(12);
    let html = page.html().unwrap();
    let data = html.split_once("id=\"scene\">").unwrap().1.split_once("</script>").unwrap().0;
    let scene: serde_json::Value = serde_json::from_str(data).unwrap();
    let scale = scene["scale"].as_f64().unwrap();
    let view = page.view.as_ref().unwrap();
    for (volume, known) in [&view.recovered, view.truth.as_ref().unwrap()].into_iter().zip(0..) {
        let bytes = base64::decode(scene["volumes"][known]["bytes"].as_str().unwrap()).unwrap();
        assert_eq!(bytes.len(), volume.values().len());
        for (byte, value) in bytes.iter().zip(volume.x_fastest()) {
            let error = scale * f64::from(*byte) / 255.0 - f64::from(value);
            assert!(error.abs() <= 0.5001 * scale / 255.0, "{error}");
        }
    }
    // x is the fastest: the second byte is the second node along x.
    let second = view.recovered.values()[12 * 12];
    assert_eq!(view.recovered.x_fastest().nth(1), Some(second));
}

#[test]
fn exact_points_that_cannot_be_shown_are_counted() {
    let mut plot = loss();
    plot.series[0].points[3][1] = 0.0;
    plot.series[0].points[4][1] = f64::NAN;
    plot.series[1].points = (0..6001).map(|k| [f64::from(k), 1.0]).collect();
    let (svg, caption) = plot.draw("a-").unwrap();
    assert!(caption.contains("2 points that are not finite or not above 0"), "{caption}");
    assert!(caption.contains("Of visibilities one point in 3 is drawn"), "{caption}");
    assert!(svg.starts_with("<svg") && svg.contains("viewBox=\"0 0 ") && !svg.contains("NaN"));
    plot.series.truncate(1);
    plot.series[0].errors = vec![1.0];
    let error = plot.draw("a-").unwrap_err().to_string();
    assert_eq!(error, "series \"image\": 1 errors are not allowed: none or 200");
    (plot.series[0].points, plot.series[0].errors) = (vec![[0.0, -1.0]], vec![]);
    assert_eq!(plot.draw("a-").unwrap_err().to_string(), "plot \"Loss\" has no point to show");
}

#[test]
fn wrong_numbers_of_the_view_are_named() {
    let wrong = |change: fn(&mut View3d), field: &str| {
        let mut page = report(4);
        change(page.view.as_mut().unwrap());
        let error = page.html().unwrap_err().to_string();
        assert!(error.starts_with(field), "{error}");
    };
    wrong(|view| view.r_max = f64::NAN, "r_max = NaN");
    wrong(|view| view.hole_radius = -1.0, "hole_radius = -1");
    wrong(|view| view.motion.as_mut().unwrap().axis = [0.0; 3], "axis");
    wrong(|view| view.motion.as_mut().unwrap().times = [1.0, 1.0], "times");
    wrong(|view| view.motion.as_mut().unwrap().rates.clear(), "rates");
}

/// A browser that can be run without a screen, if there is one.
fn browser() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders = std::env::var_os("PATH")?;
    let all = std::env::split_paths(&folders).flat_map(|f| names.map(|name| f.join(name)));
    all.into_iter().find(|path| path.is_file())
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

/// What the browser makes of the page, as HTML.
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
        Field { name: "emission", volume: &view.recovered },
        Field { name: "emission_truth", volume: view.truth.as_ref().unwrap() },
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
    let Some(browser) = browser() else {
        eprintln!("no chromium in PATH: the page was made, but no browser has looked at it");
        return;
    };
    let found = dump(&browser, folder.path(), "time=0.5&azimuth=70&volume=truth");
    assert!(["ready: webgl2", "ready: fallback"].contains(&status(&found)), "{}", status(&found));
    assert!(found.contains("<output id=\"time-text\">0.5 orbits at 3.5 M</output>"));
    assert_eq!(found.matches("type=\"radio\"").count(), 2);
    let found = dump(&browser, folder.path(), "renderer=fallback");
    assert_eq!(status(&found), "ready: fallback");
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

/// What the viewer turns to a time looks as what the fit's own dynamics carry there.
#[test]
fn code_viewer_moves_matter_as_the_fit_does() {
    let Some(browser) = browser() else {
        eprintln!("no chromium in PATH: nobody has looked how the viewer moves matter");
        return;
    };
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
    for renderer in ["renderer=fallback", ""] {
        let known = picture(&format!("volume=truth&{renderer}"));
        let turned = picture(&format!("volume=recovered&time=0.4&{renderer}"));
        let still = picture(&format!("volume=recovered&time=0&{renderer}"));
        let [error, change] = [difference(&known, &turned), difference(&known, &still)];
        eprintln!("{renderer} {error:.2} of 255, without motion {change:.2}");
        assert!(error < 0.1 * change && change > 5.0, "{renderer} {error} {change}");
    }
}
