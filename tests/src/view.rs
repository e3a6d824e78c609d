//! The page of `kerrlight view`: its files, and what a browser makes of it beside what `render` makes of its scene.

use crate::browser::{Browser, address};
use crate::support::{
    after, fail, fail_with, folder_with, kill, message, scene_path, sets, start, succeed,
};
use kerrlight_geodesic::wgsl;
use kerrlight_geodesic::{
    Camera, Inclination, Kerr, Motion, Observer, Outcome, Quantities, Tracer,
};
use kerrlight_render::image::Picture;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_render::image::exr;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;

#[test]
fn exact_the_page_has_the_tracer_and_loads_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let told = succeed(folder.path(), &["view", "--web", "page"]);
    assert!(told.contains("page/index.html"), "{told}");
    let page = std::fs::read_to_string(folder.path().join("page/index.html")).unwrap();
    assert!(page.contains(&wgsl::library()) && !page.contains("{{"));
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("import "));
    assert!(!page.contains("src=") && page.len() < 5_000_000);
}

#[test]
fn a_folder_that_is_a_file() {
    let folder = folder_with("page", "no folder");
    fail_with(folder.path(), &["view", "--web", "page"], &["cannot make the folder page"]);
}

#[test]
fn a_folder_without_a_fit() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("run")).unwrap();
    fail_with(folder.path(), &["view", "run", "--web", "page"], &["run: no scene.toml"]);
    let told = fail(folder.path(), &["view", "--set", "hole.spin=2", "--web", "page"]);
    assert!(told.contains("hole.spin") && told.contains("-1 to 1"), "{told}");
}

/// Size of the window; the settings take 236 pixels of it.
const WINDOW: [u32; 2] = [660, 320];

/// Writes the page of a scene and opens it; none where there is no browser.
pub fn opened(folder: &Path, words: &[&str], fragment: &str) -> Option<Browser> {
    succeed(folder, &[&["view", "--web", "page"], words].concat());
    let page = format!("{}#{fragment}", address(&folder.join("page/index.html")));
    let mut browser = Browser::open(&page, WINDOW)?;
    browser.wait("!!window.kerrlight?.rests()");
    Some(browser)
}

/// The picture that the page's own command renders, a ray a pixel.
fn rendered(folder: &Path, browser: &mut Browser, [width, height]: [u32; 2]) -> Picture {
    let command = browser.value(&format!("command({width}, {height})"));
    let words = command.as_str().unwrap().strip_prefix("kerrlight ").unwrap();
    let plain = "--set screen.rings=regular-grid --set screen.samples_per_pixel=1";
    let script = format!("exec \"$@\" {words} {plain}");
    let ended = after(folder, &script, &[]);
    assert!(ended.status.success(), "{script}: {}", message(&ended));
    exr::decode(&std::fs::read(folder.join("view.exr")).unwrap()).unwrap().0
}

/// Light of the page: R, G, B and intensity of each pixel.
pub fn measured(browser: &mut Browser, panel: &str, [width, height]: [u32; 2]) -> Vec<f64> {
    let asked = format!("kerrlight.gpu.measure('{panel}', {width}, {height}).then(x => [...x])");
    let Value::Array(light) = browser.value(&asked) else { panic!("no light") };
    light.iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The sum of the differences of two pictures by the sum of one, and the share of pixels that are off by a hundredth of
/// the largest value.
fn difference(page: &[f64], render: &[f32]) -> [f64; 2] {
    let (mut apart, mut sum, mut far) = (0.0, 0.0, 0.0);
    let most = f64::from(render.iter().copied().fold(0.0, f32::max));
    for (a, b) in page.iter().zip(render) {
        let off = (a - f64::from(*b)).abs();
        apart += off;
        sum += f64::from(b.abs());
        far += f64::from(u8::from(off > 0.01 * most));
    }
    [apart / sum, far / page.len() as f64]
}

/// Compares a channel of the page's light with that of the picture which the page's command renders, for rays on a grid of
/// 48 x 40; what is allowed is the summed difference and the share of pixels that are off.
fn compare(words: &[&str], fragment: &str, channel: (usize, &str), allowed: [f64; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut browser) = opened(folder.path(), words, fragment) else { return };
    let size = [48, 40];
    let light = measured(&mut browser, "recovered", size);
    let picture = rendered(folder.path(), &mut browser, size);
    let of_page: Vec<f64> = light.chunks(4).map(|pixel| pixel[channel.0]).collect();
    let [apart, far] = difference(&of_page, picture.channel(channel.1).unwrap());
    eprintln!(
        "{words:?} {fragment}: {} differs by {apart:.1e}, {far:.1e} of the pixels are off",
        channel.1
    );
    assert!(apart < allowed[0] && far <= allowed[1], "{words:?} {fragment}: {apart:e} {far:e}");
    assert!(browser.problems().is_empty(), "{:?}", browser.problems());
}

const INTENSITY: (usize, &str) = (3, "intensity");

/// The browser shows the picture that `render` makes, in the colours of its map: without a word on the console.
#[test]
fn code_the_page_draws_what_render_draws() {
    let folder = tempfile::tempdir().unwrap();
    let dark = ["--set", "spot="];
    let Some(mut browser) = opened(folder.path(), &dark, "") else { return };
    let box_of = "(b => [b.left, b.top, b.width, b.height])(document.getElementById('canvas').getBoundingClientRect())";
    let place: Vec<u32> = browser
        .value(box_of)
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap() as u32)
        .collect();
    let (screen, size) = (browser.screen(), [place[2], place[3]]);
    let white = browser.value("GIVEN.white").as_f64().unwrap();
    let picture = rendered(folder.path(), &mut browser, size);
    let (table, intensity) = (Colormap::AfmhotUs.table(), picture.channel("intensity").unwrap());
    let mut off = Vec::new();
    for (k, value) in intensity.iter().enumerate() {
        let (x, y) = (k as u32 % size[0], k as u32 / size[0]);
        // The button of the settings lies above.
        if x < 50 && y < 50 {
            continue;
        }
        let shade = (f64::from(*value) / white).clamp(0.0, 1.0) * (table.len() - 1) as f64;
        let seen = screen.get_pixel(place[0] + x, place[1] + y).0;
        let pairs = seen.iter().zip(table[shade as usize]);
        off.push(pairs.map(|(a, b)| a.abs_diff(b)).max().unwrap());
    }
    off.sort_unstable();
    let at = |part: f64| off[(part * (off.len() - 1) as f64) as usize];
    eprintln!(
        "of 255, pixels differ by {} (median), {} (98 of 100), {} (largest)",
        at(0.5),
        at(0.98),
        at(1.0)
    );
    assert!(off.len() > 60_000 && at(0.5) <= 2 && at(0.98) <= 8, "{} {}", at(0.5), at(0.98));
    assert!(screen.pixels().any(|pixel| pixel.0[0] > 200), "the page is dark");
    assert!(browser.problems().is_empty(), "{:?}", browser.problems());
}

/// Discs, spots, volumes and skies, on the screen of an observer and through a camera, with and without lensing.
#[test]
#[ignore = "long"]
fn code_light_of_the_page_is_that_of_render() {
    compare(&["--set", "spot="], "", INTENSITY, [2e-4, 0.002]);
    compare(&[], "time=12", INTENSITY, [2e-3, 0.002]);
    compare(&[&scene_path("hot_spots.toml")], "", INTENSITY, [5e-3, 0.003]);
    compare(&[&scene_path("volume.toml")], "", INTENSITY, [2e-2, 0.01]);
    compare(&[&scene_path("volume.toml")], "lensing=0", INTENSITY, [2e-2, 0.01]);
    compare(
        &[&scene_path("volume.toml")],
        "kind=camera&radius=25&inclination=70&azimuth=30",
        INTENSITY,
        [2e-2, 0.01],
    );
    compare(
        &["--set", "spot="],
        "kind=camera&radius=12&inclination=80&spin=0.9",
        INTENSITY,
        [5e-4, 0.003],
    );
    compare(&[&scene_path("sky_checker.toml")], "", (1, "G"), [3e-2, 0.06]);
}

/// Matter that plunges, by its light and by its colours as a black body, from afar and from a camera that moves.
#[test]
#[ignore = "long"]
fn code_discs_plunge_and_glow_as_those_of_render() {
    let plunging = scene_path("disc_plunging.toml");
    compare(&[&plunging], "", INTENSITY, [5e-4, 0.002]);
    compare(&[&plunging], "spin=0.9&inclination=80", INTENSITY, [5e-4, 0.002]);
    let hot = [&plunging, "--set", "disc.peak_temperature_k=6000"];
    for channel in [(0, "R"), (2, "B")] {
        compare(&hot, "", channel, [2e-3, 0.004]);
        compare(&hot, "kind=camera&radius=20&inclination=70", channel, [2e-3, 0.004]);
    }
}

/// Gas of every motion, thin and thick, and what shines in and behind it.
#[test]
#[ignore = "long"]
fn code_gas_of_the_page_is_that_of_render() {
    let [thin, thick] = ["test3", "test5"].map(|name| scene_path(&format!("gold2020/{name}.toml")));
    // Scene units are not those of the picture's intensity, which has a unit.
    let red = (0, "R");
    compare(&[&thin], "", red, [2e-5, 0.0]);
    compare(&[&thin], "kind=camera&radius=25&inclination=70", red, [2e-5, 0.0]);
    for motion in ["keplerian", "free-fall"] {
        compare(&[&thin, "--set", &format!("gas.motion={motion}")], "", red, [2e-5, 0.0]);
    }
    compare(&[&thick], "", red, [1e-4, 0.0]);
    // Its light grows like 1/g towards the horizon.
    compare(&[&scene_path("gold2020/test1.toml")], "", red, [3e-3, 0.002]);
    let more = [
        "gas.emissivity=1e-19",
        "disc={outer_edge=12.0,peak_intensity=2e-5,opaque=true}",
        "spot=[{radius=8.0,phase_deg=90.0,sigma=0.7,peak_emissivity=1e-5}]",
    ];
    compare(&[&[thick.as_str()], &sets(&more)[..]].concat(), "", red, [2e-4, 0.002]);
}

/// The ray of a picked place has the constants, the fate and the crossings of the tracer in doubles, and turns where its
/// radial potential is 0.
#[test]
#[ignore = "long"]
fn code_a_picked_ray_is_that_of_the_tracer() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["--set", "spot=", "--set", "hole.spin=0.9"];
    let Some(mut browser) = opened(folder.path(), &words, "pick=8,2&curve=1") else { return };
    let ray = browser.value("kerrlight.ray");
    let number = |name: &str| ray[name].as_f64().unwrap();
    let hole = Kerr::new(0.9).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(67.0).unwrap());
    let expected = observer.ray(&hole, 8.0, 2.0).unwrap();
    let mut path = kerrlight_geodesic::Path::new();
    Tracer::new(1e-12).unwrap().trace(&hole, &expected, Quantities::ALL, &mut path);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 2e-5 * b.abs().max(1.0), "{a} {b}");
    close(number("lambda"), expected.lambda);
    close(number("eta"), expected.eta);
    assert!(path.outcome() == Outcome::Escaped && ray["outcome"] == 1);
    let crossings: Vec<f64> = path.equatorial_crossings().collect();
    assert_eq!(ray["crossings"].as_array().unwrap().len(), crossings.len());
    for (found, time) in ray["crossings"].as_array().unwrap().iter().zip(crossings) {
        let point = path.at(time);
        close(found["r"].as_f64().unwrap(), point.radius());
        let turn = found["azimuth"].as_f64().unwrap() - point.azimuth;
        close(turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round(), 0.0);
        close(found["delay"].as_f64().unwrap(), point.delay);
    }
    let (r, lambda, eta) = (number("turning"), expected.lambda, expected.eta);
    let potential = (r * r + 0.81 - 0.9 * lambda).powi(2)
        - (r * r - 2.0 * r + 0.81) * (eta + (lambda - 0.9).powi(2));
    assert!(potential.abs() < 1e-4 * r.powi(4), "{potential} at {r}");
    assert!(ray["path"].as_array().unwrap().len() > 50);
    let shown = browser.value("document.getElementById('numbers').textContent");
    assert!(shown.as_str().unwrap().contains("escapes to the sky"), "{shown}");
    // A click picks, a key takes it back, the address holds the view.
    let click =
        |kind: &str| json!({ "type": kind, "x": 300, "y": 100, "button": "left", "clickCount": 1 });
    for kind in ["mousePressed", "mouseReleased"] {
        browser.call("Input.dispatchMouseEvent", &click(kind));
    }
    browser.wait("kerrlight.rests() && state.pick !== '8,2' && location.hash.includes('pick=')");
    browser.call("Input.dispatchKeyEvent", &json!({ "type": "keyDown", "key": "Escape" }));
    browser.wait("kerrlight.rests() && kerrlight.ray === null && !location.hash.includes('pick=')");
    assert!(browser.problems().is_empty(), "{:?}", browser.problems());
}

/// Rays a little inside of the page's critical curve fall, rays a little outside escape: on a screen and through a lens.
#[test]
#[ignore = "long"]
fn exact_the_critical_curve_parts_rays() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut browser) = opened(folder.path(), &["--set", "spot="], "spin=0.8") else { return };
    let hole = Kerr::new(0.8).unwrap();
    let place = Inclination::from_degrees(67.0).unwrap();
    let observer = Observer::at_infinity(place);
    let camera = Camera::new(&hole, place, 9.0, Motion::Static).unwrap();
    let setup = "{ motion: 'static', axes: cameraAxes(0, 0, 0) }";
    let at = "{ radius: 9, theta: 67 * RADIANS }";
    let fate = |ray: kerrlight_geodesic::Ray| {
        let mut path = kerrlight_geodesic::Path::new();
        Tracer::new(1e-10).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
        path.outcome()
    };
    for lens in [false, true] {
        let camera_of_page = if lens { setup } else { "null" };
        let curve = browser.value(&format!("criticalCurve(0.8, {at}, {camera_of_page})"));
        let points: Vec<[f64; 2]> = serde_json::from_value(curve).unwrap();
        assert!(points.len() > 800);
        let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
        let middle = [mean(0), mean(1)];
        for (share, expected) in [(0.999, Outcome::Captured), (1.001, Outcome::Escaped)] {
            for point in points.iter().step_by(7) {
                let [x, y] = [0, 1].map(|k| middle[k] + share * (point[k] - middle[k]));
                let ray = if lens { camera.ray(x, y) } else { observer.ray(&hole, x, y) };
                assert_eq!(fate(ray.unwrap()), expected, "{share} of {point:?}, lens: {lens}");
            }
        }
    }
}

/// A fit's folder: what was recovered, moving with its matter, beside the truth and the data.
#[test]
#[ignore = "long"]
fn code_the_page_of_a_fit_has_volume_truth_and_data() {
    let folder = tempfile::tempdir().unwrap();
    let settings = sets(&[
        "screen.pixels=12",
        "simulation.movie.frames=6",
        "representation=bhnerf",
        "representation.network.width=16",
        "training.steps=20",
        "training.start={linear={nodes=10,stride=1,steps=60}}",
        "output.nodes=20",
    ]);
    let fit = scene_path("fits/flare_images.toml");
    succeed(folder.path(), &[&["fit", &fit, "-o", "run"], &settings[..]].concat());
    let Some(mut browser) = opened(folder.path(), &["run"], "") else { return };
    let files = ["index.html", "volumes.js"].map(|name| folder.path().join("page").join(name));
    assert!(std::fs::metadata(&files[0]).unwrap().len() < 5_000_000 && files[1].is_file());
    assert_eq!(browser.value("panels().join()"), "recovered,truth,data");
    assert_eq!(browser.value("GIVEN.data.times.length"), 6);
    let size = [40, 40];
    let recovered = measured(&mut browser, "recovered", size);
    let picture = rendered(folder.path(), &mut browser, size);
    let of_page: Vec<f64> = recovered.chunks(4).map(|pixel| pixel[3]).collect();
    let [apart, far] = difference(&of_page, picture.channel("intensity").unwrap());
    eprintln!(
        "of what was recovered, light differs by {apart:.1e}, {far:.1e} of the pixels are off"
    );
    assert!(apart < 1e-2 && far < 0.01, "{apart:e} {far:e}");
    assert_ne!(measured(&mut browser, "truth", size), recovered);
    // Playing moves the time, and matter with it.
    let start = browser.value("state.time");
    browser.value("document.getElementById('play').click()");
    browser.wait(&format!("state.time > {start}"));
    browser.value("document.getElementById('play').click()");
    browser.wait("kerrlight.rests()");
    assert_ne!(measured(&mut browser, "recovered", size), recovered);
    assert!(browser.problems().is_empty(), "{:?}", browser.problems());
}

/// Without --web the page is served to this computer, until the program is ended.
#[test]
fn exact_the_page_is_served() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["view", "--web", "page"]);
    let expected = std::fs::read_to_string(folder.path().join("page/index.html")).unwrap();
    let mut server = start(folder.path(), &["view", "--no-browser"]);
    let mut told = String::new();
    BufReader::new(server.stderr.take().unwrap()).read_line(&mut told).unwrap();
    let address = told.strip_prefix("http://").unwrap().split('/').next().unwrap().to_owned();
    let answer = |request: &str, host: &str| {
        let mut stream = TcpStream::connect(&address).unwrap();
        stream.write_all(format!("{request} HTTP/1.1\r\n{host}\r\n").as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    let own = format!("Host: {address}\r\n");
    let page = answer("GET /?x#y", &own);
    let elsewhere = ["GET /../Cargo.toml", "POST /", "GET"].map(|asked| answer(asked, &own));
    // A name of another's that leads to this computer (DNS rebinding), and none.
    let named = |host: &str| answer("GET /", host);
    let foreign = ["Host: evil.example:80\r\n", "Host: 127.0.0.1.evil.example\r\n", ""].map(named);
    let local = ["host: LOCALHOST:9\r\n", "Host: [::1]:80\r\n"].map(named);
    kill(server);
    assert!(foreign.iter().all(|answer| answer.starts_with("HTTP/1.1 403")), "{foreign:?}");
    assert!(local.iter().all(|answer| answer.starts_with("HTTP/1.1 200")), "{local:?}");
    assert!(page.starts_with("HTTP/1.1 200 OK") && page.ends_with(&expected));
    assert!(elsewhere.iter().all(|answer| answer.starts_with("HTTP/1.1 404")), "{elsewhere:?}");
}
