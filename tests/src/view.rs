//! The page of `kerrlight view`: its files, and what a browser makes of it beside what `render` makes of its scene.

use crate::browser::{Browser, address};
use crate::support::{binary, fail, root, succeed};
use kerrlight_geodesic::wgsl;
use kerrlight_tomo::image::Picture;
use kerrlight_tomo::image::colormap::Colormap;
use kerrlight_tomo::image::exr;
use serde_json::Value;
use std::path::Path;
use std::process::Command;

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
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("page"), "no folder").unwrap();
    let told = fail(folder.path(), &["view", "--web", "page"]);
    assert!(told.contains("cannot make the folder page"), "{told}");
}

#[test]
fn a_folder_without_a_fit() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("run")).unwrap();
    let told = fail(folder.path(), &["view", "run", "--web", "page"]);
    assert!(told.contains("run: no scene.toml"), "{told}");
    let told = fail(folder.path(), &["view", "--set", "hole.spin=2", "--web", "page"]);
    assert!(told.contains("hole.spin") && told.contains("[-1, 1]"), "{told}");
}

/// Size of the window; the settings take 236 pixels of it.
const WINDOW: [u32; 2] = [660, 320];

/// Writes the page of a scene and opens it; none where there is no browser.
fn opened(folder: &Path, words: &[&str], fragment: &str) -> Option<Browser> {
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
    let script = format!("exec \"$0\" {words} {plain}");
    let mut shell = Command::new("sh");
    let done = shell.current_dir(folder).args(["-c", &script]).arg(binary()).output().unwrap();
    assert!(done.status.success(), "{script}: {}", String::from_utf8_lossy(&done.stderr));
    exr::decode(&std::fs::read(folder.join("view.exr")).unwrap()).unwrap().0
}

/// Light of the page: R, G, B and intensity of each pixel.
fn measured(browser: &mut Browser, panel: &str, [width, height]: [u32; 2]) -> Vec<f64> {
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

fn scene(name: &str) -> String {
    root().join("scenes").join(name).to_str().unwrap().to_owned()
}

/// What is seen in the browser is the picture that `render` makes, in the colours of its map: without a word on the console.
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
    compare(&[&scene("hot_spots.toml")], "", INTENSITY, [5e-3, 0.003]);
    compare(&[&scene("volume.toml")], "", INTENSITY, [2e-2, 0.01]);
    compare(&[&scene("volume.toml")], "lensing=0", INTENSITY, [2e-2, 0.01]);
    compare(
        &[&scene("volume.toml")],
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
    compare(&[&scene("sky_checker.toml")], "", (1, "G"), [3e-2, 0.06]);
}
