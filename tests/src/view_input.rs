//! Touch on the page of `kerrlight view`, and the files that it saves.

use crate::browser::Browser;
use crate::view::{measured, opened};
use kerrlight_render::image::exr;
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

/// Puts the fingers that are down there, in their order.
fn touch(browser: &mut Browser, kind: &str, fingers: &[[f64; 2]]) {
    let point = |(k, [x, y]): (usize, &[f64; 2])| json!({ "x": x, "y": y, "id": k });
    let points: Vec<Value> = fingers.iter().enumerate().map(point).collect();
    let event = json!({ "type": kind, "touchPoints": points });
    browser.call("Input.dispatchTouchEvent", &event);
}

fn number(browser: &mut Browser, name: &str) -> f64 {
    browser.value(&format!("state.{name}")).as_f64().unwrap()
}

/// One finger turns the view, two bring it nearer, a tap follows the ray of its place: what the mouse and the wheel do.
#[test]
#[ignore = "long"]
fn exact_fingers_turn_and_approach_and_pick() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut browser) = opened(folder.path(), &["--set", "spot="], "") else { return };
    let fingers = json!({ "enabled": true, "maxTouchPoints": 2 });
    browser.call("Emulation.setTouchEmulationEnabled", &fingers);
    let names = ["azimuth", "inclination", "field"];
    let [azimuth, inclination, field] = names.map(|name| number(&mut browser, name));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a} {b}");
    touch(&mut browser, "touchStart", &[[400.0, 200.0]]);
    touch(&mut browser, "touchMove", &[[380.0, 200.0]]);
    touch(&mut browser, "touchMove", &[[360.0, 190.0]]);
    touch(&mut browser, "touchEnd", &[]);
    near(number(&mut browser, "azimuth"), azimuth + 0.3 * 40.0);
    near(number(&mut browser, "inclination"), inclination + 0.2 * 10.0);
    near(number(&mut browser, "field"), field);
    // Twice as far apart.
    touch(&mut browser, "touchStart", &[[400.0, 160.0]]);
    touch(&mut browser, "touchStart", &[[400.0, 160.0], [460.0, 160.0]]);
    touch(&mut browser, "touchMove", &[[400.0, 160.0], [500.0, 160.0]]);
    touch(&mut browser, "touchMove", &[[400.0, 160.0], [520.0, 160.0]]);
    touch(&mut browser, "touchEnd", &[[400.0, 160.0]]);
    touch(&mut browser, "touchEnd", &[]);
    near(number(&mut browser, "field"), field / 2.0);
    near(number(&mut browser, "azimuth"), azimuth + 12.0);
    assert_eq!(browser.value("state.pick"), "");
    // A tap.
    let place = browser.value("placeAt({ clientX: 400, clientY: 100 })");
    touch(&mut browser, "touchStart", &[[400.0, 100.0]]);
    touch(&mut browser, "touchEnd", &[]);
    let picked = browser.value("state.pick.split(',').map(Number)");
    for k in 0..2 {
        let [picked, place] = [&picked[k], &place[k]].map(|x| x.as_f64().unwrap());
        assert!((picked - place).abs() <= 5e-6 * place.abs(), "{picked} {place}");
    }
    browser.wait("kerrlight.rests() && kerrlight.ray !== null");
    assert!(browser.problems().is_empty(), "{:?}", browser.problems());
}

/// The bytes of a file that the page saves when a button is clicked.
fn saved(browser: &mut Browser, at: &Path, button: &str, name: &str) -> Vec<u8> {
    let allowed = json!({ "behavior": "allow", "downloadPath": at });
    browser.call("Browser.setDownloadBehavior", &allowed);
    browser.value(&format!("document.getElementById('{button}').click()"));
    let (path, start) = (at.join(name), Instant::now());
    // The browser gives it this name when it is whole.
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{name} was not saved in a minute");
        std::thread::sleep(Duration::from_millis(50));
        browser.value("0");
    }
    std::fs::read(path).unwrap()
}

/// Save PNG writes what is on the screen, marks included; Save EXR the light of each of its pixels.
#[test]
#[ignore = "long"]
fn exact_saved_pictures_are_the_view() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut browser) = opened(folder.path(), &["--set", "spot="], "curve=1") else { return };
    let files = tempfile::tempdir().unwrap();
    let png = saved(&mut browser, files.path(), "save", "kerrlight.png");
    browser.wait("kerrlight.rests()");
    let (saved_png, screen) =
        (image::load_from_memory(&png).unwrap().into_rgb8(), browser.screen());
    let left = browser.value("document.getElementById('canvas').getBoundingClientRect().left");
    let left = left.as_f64().unwrap() as u32;
    assert_eq!(saved_png.width(), screen.width() - left);
    assert_eq!(saved_png.height(), screen.height());
    let mut colors = 0;
    for (x, y, pixel) in saved_png.enumerate_pixels() {
        // The button of the settings lies above.
        if x > 50 || y > 50 {
            assert_eq!(pixel, screen.get_pixel(left + x, y), "({x}, {y})");
            colors += u32::from(pixel.0 != [0; 3]);
        }
    }
    // The curve is blue, the disc is not.
    let blue = saved_png.pixels().filter(|pixel| pixel.0[2] > pixel.0[0]).count();
    assert!(colors > 10_000 && blue > 100, "{colors} {blue}");
    let bytes = saved(&mut browser, files.path(), "exr", "kerrlight.exr");
    let (picture, _) = exr::decode(&bytes).unwrap();
    let light = measured(&mut browser, "recovered", [saved_png.width(), saved_png.height()]);
    for (k, name) in ["R", "G", "B", "intensity"].into_iter().enumerate() {
        let expected: Vec<f32> = light.chunks(4).map(|pixel| pixel[k] as f32).collect();
        assert_eq!(picture.channel(name).unwrap(), expected, "{name}");
    }
    assert!(browser.problems().is_empty(), "{:?}", browser.problems());
}
