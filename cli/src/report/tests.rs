//! Pages of spots that turn about a tilted axis, read as text.

mod browser;

use super::*;
use kerrlight_render::dynamics::AngularVelocity;
use kerrlight_render::volume::projection::Surroundings;
use kerrlight_render::volume::slices::Through;
use kerrlight_render::volume::{Shown, Volume};
use std::f64::consts::TAU;

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
    let rates = rates(&AngularVelocity::bhnerf(), [2.0, 5.0]);
    let time_unit = "orbits at 3.5 M".to_owned();
    Motion { axis: XI, rates, times: [0.0, 1.0], reference: 0.0, time_unit }
}

fn text(words: &str) -> String {
    words.to_owned()
}

fn loss() -> LinePlot {
    let curve = |name: &str, scale: f64| {
        let points = (0..200).map(f64::from).map(|k| [k, scale * (-k / 40.0).exp()]);
        Series::new(name, points.collect(), Marks::Line)
    };
    LinePlot {
        title: text("Loss"),
        caption: text("Mean square of residuals while the fit went on."),
        x: Axis::new("step", ""),
        y: Axis { log: true, ..Axis::new("loss", "Jy²") },
        series: vec![curve("image", 1.0), curve("visibilities", 0.3)],
    }
}

fn amplitudes() -> LinePlot {
    let model = |x: f64| 1.2 * (-x * x / 18.0).exp() + 0.02;
    let at = |k: i32| 0.05 * f64::from(k);
    let data = |k: i32| [at(k), model(at(k)) * (1.0 + 0.1 * f64::from(k * 7919 % 13 - 6) / 6.0)];
    let data = Series::new("data", (0..180).map(data).collect(), Marks::Points);
    let points = (0..180).map(|k| [at(k), model(at(k))]).collect();
    LinePlot {
        title: text("Data and model"),
        caption: text(
            "Amplitudes of the data with errors of one σ, and of the recovered emission.",
        ),
        x: Axis::new("baseline", "Gλ"),
        y: Axis { log: true, ..Axis::new("|V|", "Jy") },
        series: vec![data.with_errors(vec![0.03; 180]), Series::new("model", points, Marks::Line)],
    }
}

fn setting(key: &str, value: &str, meaning: &str) -> Setting {
    Setting { key: text(key), value: text(value), meaning: text(meaning) }
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
        slices(&shown, Through::Maximum, 2.0, None, unit).unwrap(),
    ];
    Report {
        title: text("Four spots around a hole without spin"),
        notice: Some(Notice {
            tone: Tone::Plain,
            headline: text("A test <of> itself."),
            text: vec![text("Nothing was fitted.")],
        }),
        summary: vec![
            text(
                "Which emission around the hole explains the movie? This page is a test of itself.",
            ),
            text("\"Recovered\" is no fit here: it is the truth, 25 % wider and 20 % fainter."),
        ],
        results: vec![
            Outcome {
                name: "NRMSE",
                value: text("0.41"),
                unit: "",
                meaning: "0 is perfect, 1 is what an empty volume has",
            },
            Outcome {
                name: "PSNR",
                value: text("36.2"),
                unit: "dB",
                meaning: "an empty volume has 28.48 dB",
            },
        ],
        settings: vec![setting("spin", "0", ""), setting("fov", "16", "M")],
        drawings: Vec::new(),
        parts: vec![Part { heading: "How <to> read it", text: vec![text("Slowly.")] }],
        tables: Vec::new(),
        details: vec![Table {
            title: text("All"),
            caption: text("Links."),
            head: vec![text("case"), text("PSNR")],
            rows: vec![vec![text("a & b"), text("1")]],
            links: vec![text("cases/a&b/report.html")],
        }],
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
const FETCHING: [&str; 7] =
    ["https:", "url(h", "@import", "fetch(", "XMLHttpRequest", "import(", "<link"];

#[test]
fn exact_page_needs_nothing_else() {
    let page = report(24).html().unwrap();
    for word in FETCHING {
        assert!(!page.contains(word), "{word}");
    }
    // Links are for whoever follows them.
    assert_eq!(page.matches("href=").count(), page.matches("<a href=\"cases/a&amp;b/").count());
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
    for id in [
        "notice\" class=\"plain\" role=\"note",
        "summary",
        "results",
        "three-dimensions",
        "pictures",
        "plots",
        "settings",
    ] {
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
    let notice = page.notice.as_mut().unwrap();
    (notice.headline, notice.text) = (text(bad), vec![text(bad)]);
    (page.settings[0].key, page.details[0].links[0]) = (text(bad), text(bad));
    (page.results[0].meaning, page.parts[0].heading) = (bad, bad);
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
    assert!(html.matches("&lt;/script&gt;&lt;b a=").count() >= 16);
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
    // A page of a finished fit is written without the figure.
    let (svg, caption) = plot.draw("a-").unwrap();
    assert!(svg.is_empty() && caption.ends_with("There is no point to show."), "{caption}");
}

#[test]
fn exact_joined_points_have_one_line_through_their_means() {
    let drawn = |marks, points: &[[f64; 2]]| {
        let mut plot = loss();
        (plot.series[0].points, plot.series[0].marks) = (points.to_vec(), marks);
        // The same axes for all.
        plot.series[1].points = vec![[0.0, 0.1], [4.0, 1.0]];
        plot.series[1].marks = Marks::Points;
        plot.draw("a-").unwrap().0
    };
    let count = |svg: &str, tag: &str| svg.matches(tag).count();
    let twice = [[1.0, 0.2], [1.0, 0.6], [2.0, 0.9], [3.0, 0.2], [3.0, 0.6]];
    let (points, joined) = (drawn(Marks::Points, &twice), drawn(Marks::Joined, &twice));
    assert_eq!(count(&points, "<circle"), count(&joined, "<circle"));
    assert_eq!(count(&points, "<path") + 1, count(&joined, "<path"));
    let means = drawn(Marks::Line, &[[1.0, 0.4], [2.0, 0.9], [3.0, 0.4]]);
    let line =
        |svg: &str| svg.split("<path d=\"").nth(1).unwrap().split('"').next().map(str::to_owned);
    assert_eq!(line(&joined), line(&means));
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
