//! Pictures: symmetries, signs, and no special rays.

use crate::support::{render, rendered, root, scene, scenes};
use kerrlight_render::image::Picture;
use kerrlight_render::picture::Rendered;

pub const SMALL: [&str; 3] = ["screen.width=65", "screen.height=65", "screen.samples_per_pixel=1"];

pub fn small(text: &str, more: &[&str]) -> Picture {
    let overrides: Vec<&str> = SMALL.iter().chain(more).copied().collect();
    render(&scene(text, &overrides))
}

pub fn file(name: &str) -> String {
    std::fs::read_to_string(root().join("scenes").join(name)).expect("a scene")
}

/// On an odd grid the central ray has α = β = 0, the central column λ = 0.
#[test]
#[ignore = "long"]
fn exact_no_special_rays() {
    for (path, text) in scenes() {
        for inclination in [0, 90, 180] {
            for spin in [0, 1, -1] {
                let camera = text.contains("[camera]");
                let key = if camera { "camera.theta_deg" } else { "observer.inclination_deg" };
                let inclination = format!("{key}={inclination}");
                let spin = format!("hole.spin={spin}");
                // Edges and orbits that fit every spin.
                let mut overrides = vec![inclination.as_str(), spin.as_str()];
                if text.contains("inner_edge = ") {
                    overrides.push("disc.inner_edge=9.5");
                }
                let spots = text.matches("[[spot]]").count();
                overrides.extend((spots > 0).then_some("spot.0.radius=8"));
                overrides.extend((spots > 2).then_some("spot.2.radius=8"));
                let picture = small(&text, &overrides);
                for channel in &picture.channels {
                    let bad = channel.values.iter().position(|v| !v.is_finite());
                    assert_eq!(
                        bad,
                        None,
                        "{} of {} at {overrides:?}",
                        channel.name,
                        path.display()
                    );
                }
                let outcomes = picture.channel("outcome").expect("a channel");
                assert!(outcomes.iter().all(|v| *v < 3.0), "{}: unresolved rays", path.display());
                let lit = picture.channel("G").expect("a channel").iter().any(|v| *v > 0.0);
                // An infinitely thin disc has no edge-on image but for its lensed faces.
                assert!(lit, "{} is dark at {overrides:?}", path.display());
            }
        }
    }
}

/// A disc seen from i and from 180° − i: the same picture upside down.
#[test]
fn exact_mirror_images() {
    let text = file("disc_edge_on.toml");
    let above = small(&text, &["observer.inclination_deg=70"]);
    let below = small(&text, &["observer.inclination_deg=110"]);
    for name in ["intensity", "redshift", "radius", "delay"] {
        let (a, b) = (above.channel(name).unwrap(), below.channel(name).unwrap());
        for row in 0..65 {
            for column in 0..65 {
                let (x, y) = (a[row * 65 + column], b[(64 - row) * 65 + column]);
                assert!((x - y).abs() <= 2e-5 * x.abs().max(1e-3), "{name}: {x} {y}");
            }
        }
    }
}

/// The approaching side of a prograde disc is on the left, blueshifted and brighter; a
/// negative spin leaves the disc's sense alone.
#[test]
fn exact_approaching_side_is_left() {
    for spin in ["hole.spin=0.9", "hole.spin=-0.9"] {
        let overrides = ["observer.inclination_deg=75", "disc.inner_edge=9", spin];
        let picture = small(&file("disc_edge_on.toml"), &overrides);
        let (g, light) =
            (picture.channel("redshift").unwrap(), picture.channel("intensity").unwrap());
        let side = |values: &[f32], columns: std::ops::Range<usize>| -> f64 {
            (0..65)
                .flat_map(|row| columns.clone().map(move |c| (row, c)))
                .map(|(row, column)| f64::from(values[row * 65 + column]))
                .sum()
        };
        assert!(side(light, 0..32) > 2.0 * side(light, 33..65));
        let largest = |columns: std::ops::Range<usize>| {
            (0..65)
                .flat_map(|row| columns.clone().map(move |c| g[row * 65 + c]))
                .fold(0.0, f32::max)
        };
        assert!(largest(0..32) > 1.05 && largest(33..65) < 1.0);
    }
}

/// A spot that starts at azimuth 0 moves to the right in front of the hole: α grows
/// towards +φ.
#[test]
fn exact_spots_move_to_the_right_in_front() {
    let text = file("hot_spots.toml");
    let column = |time: &str| {
        let dark = ["spot.1.peak_emissivity=0", "spot.2.peak_emissivity=0"];
        let overrides = [&[time, "effects.slow_light=false"], &dark[..]].concat();
        let picture = small(&text, &overrides);
        let light = picture.channel("intensity").unwrap();
        let (mut sum, mut moment) = (0.0, 0.0);
        for (k, value) in light.iter().enumerate() {
            sum += f64::from(*value);
            moment += f64::from(*value) * (k % 65) as f64;
        }
        moment / sum
    };
    let (early, late) = (column("observer.time=-4"), column("observer.time=4"));
    assert!(late > early + 3.0, "{early} {late}");
}

/// The flux requested is the flux of the picture.
#[test]
fn exact_total_flux() {
    let scene = scene(&file("hot_spots.toml"), &SMALL);
    let picture = render(&scene);
    let m = kerrlight_common::units::gravitational_angle(4.154e6, 8.178);
    let sum: f64 = picture.channel("intensity").unwrap().iter().map(|v| f64::from(*v)).sum();
    assert!((sum * (scene.pixel_size() * m).powi(2) / 2.4 - 1.0).abs() < 1e-5);
}

/// A face-on disc without spin: at the ISCO g = √(1 − 3/r), at crossing k of radius r the
/// intensity is g⁴ times the flux there.
#[test]
fn exact_face_on_redshift() {
    let picture = small(&file("disc_face_on.toml"), &[]);
    let (g, r) = (picture.channel("redshift").unwrap(), picture.channel("radius").unwrap());
    let mut seen = 0;
    for (g, r) in g.iter().zip(r).filter(|(_, r)| **r > 0.0) {
        assert!((g - (1.0 - 3.0 / r).sqrt()).abs() < 1e-5, "{g} at {r}");
        seen += 1;
    }
    assert!(seen > 1000);
}

/// The integral of a spot's light over the screen: far from the hole, without redshift,
/// the flux of an optically thin Gaussian is (2π)^{3/2} σ³ j, wherever it is, but for
/// magnification and secondary images, which fall with its distance.
#[test]
fn exact_flux_of_a_distant_spot() {
    let text = file("hot_spots.toml");
    let more = [
        "effects.redshift=false",
        "effects.slow_light=false",
        "spot.1.peak_emissivity=0",
        "spot.2.peak_emissivity=0",
        "spot.0.radius=2000",
        "spot.0.sigma=40",
        "spot.0.phase_deg=90",
        "observer.inclination_deg=60",
        "observer.time=0",
    ];
    let text = text
        .replace("total_flux_jy = 2.4      # scales the intensity channel to Jy/uas^2", "")
        .replace("field_of_view_uas = 120.0", "field_of_view_m = 4700.0");
    let overrides = [&["screen.width=301", "screen.height=301"][..], &more[..]].concat();
    let scene = scene(&text, &overrides);
    let picture = render(&scene);
    let sum: f64 = picture.channel("intensity").unwrap().iter().map(|v| f64::from(*v)).sum();
    let flux = sum * scene.pixel_size().powi(2);
    let expected = (2.0 * std::f64::consts::PI).powf(1.5) * 40f64.powi(3);
    assert!((flux / expected - 1.0).abs() < 5e-3, "{flux} {expected}");
}

/// Relative L1 distance of two intensity images.
pub fn distance(picture: &Picture, reference: &Picture) -> f64 {
    let [a, b] = [picture, reference].map(|p| p.channel("intensity").expect("a channel"));
    let off: f64 = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum();
    off / b.iter().map(|b| f64::from(*b)).sum::<f64>()
}

/// Refined pixels are as good as was requested, better than a regular grid of as many rays; the
/// `error` channel adds up to what is stated.
#[test]
fn exact_image_error_is_met() {
    let error = 0.01;
    for name in ["disc_face_on.toml", "disc_edge_on.toml"] {
        let text = file(name);
        let sized = |more: &[&str]| {
            let size = ["screen.width=64", "screen.height=64"];
            scene(&text, &[&size, more].concat())
        };
        let plain = "screen.rings=\"regular-grid\"";
        let reference = render(&sized(&["screen.samples_per_pixel=256", plain]));
        let asked = format!("screen.image_error={error}");
        let scene = sized(&["screen.samples_per_pixel=1", &asked]);
        let Rendered { picture, summary } = rendered(&scene);
        assert!(summary.image_error < error, "{name}: {}", summary.image_error);
        let refined = distance(&picture, &reference);
        assert!(refined < summary.image_error, "{name}: {refined} {}", summary.image_error);
        // A regular grid of as many rays is worse.
        let side = (summary.rays / (64 * 64)).isqrt();
        let grid = format!("screen.samples_per_pixel={}", side * side);
        let uniform = distance(&render(&sized(&[&grid, plain])), &reference);
        assert!(refined < uniform, "{name}: {refined}, {uniform} with {side}² rays");
        let sum = |name: &str| {
            picture.channel(name).expect("a channel").iter().map(|v| f64::from(*v)).sum::<f64>()
        };
        let stated = sum("error") / sum("intensity");
        // The tracer's tolerance comes to it.
        assert!((stated - summary.image_error).abs() < 1e-6, "{stated} {}", summary.image_error);
    }
}

/// The stated error holds where edges of thin images pass between the rays of neighbouring cells, and
/// is no idle one.
#[test]
fn exact_stated_error_of_thin_images() {
    let text = file("disc_edge_on.toml");
    let size = ["screen.width=32", "screen.height=20"];
    let sized = |more: &[&str]| scene(&text, &[&size, more].concat());
    let plain = "screen.rings=\"regular-grid\"";
    let reference = render(&sized(&["screen.samples_per_pixel=1024", plain]));
    let refined = sized(&["screen.samples_per_pixel=1", "screen.image_error=0.003"]);
    let Rendered { picture, summary } = rendered(&refined);
    let (stated, found) = (summary.image_error, distance(&picture, &reference));
    assert!(stated < 0.003 && found < 0.6 * stated && found > 0.05 * stated, "{found} {stated}");
}

/// Channels that are left out are missing, and the others are the same.
#[test]
fn exact_chosen_channels() {
    let text = file("disc_edge_on.toml");
    let all = small(&text, &[]);
    let some = small(&text, &["screen.channels=[\"delay\", \"intensity\"]"]);
    assert_eq!(
        some.channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
        ["intensity", "delay"]
    );
    for channel in &some.channels {
        assert_eq!(all.channel(&channel.name), Some(&channel.values[..]));
    }
}
