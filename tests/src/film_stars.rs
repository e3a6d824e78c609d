//! Stars of films: unresolved ones neither flicker nor lose light.

use crate::film::STARS;
use crate::support::{root, scene};
use kerrlight_geodesic::vector::dot;
use kerrlight_geodesic::{Camera, Kerr, footprint};
use kerrlight_render::emission::sky::SkyModel;
use kerrlight_render::picture::Raster;
use kerrlight_render::scene::Scene;
/// An image of a star: which one, with which parity, where in pixels, and its exact flux on the
/// picture plane.
struct Image {
    star: usize,
    mirrored: bool,
    place: [f64; 2],
    flux: f64,
    magnification: f64,
}

/// Two coordinates of the picture plane.
type Plane = [f64; 2];

/// A beam's map from the picture plane to the sky, solved for a direction: the step on the plane.
fn step_to(sky: &footprint::Sky, star: [f64; 3]) -> Plane {
    let [right, up] = sky.frame();
    let map = [sky.by_first, sky.by_second].map(|v| [dot(v, right), dot(v, up)]);
    let (p, q) = (dot(star, right), dot(star, up));
    let det = map[0][0] * map[1][1] - map[0][1] * map[1][0];
    [(p * map[1][1] - q * map[1][0]) / det, (q * map[0][0] - p * map[0][1]) / det]
}

/// The beams of points of a camera's picture on the sky.
fn beams(camera: &Camera, places: &[Plane]) -> Vec<Option<footprint::Sky>> {
    let [x, y] = [0, 1].map(|c| places.iter().map(|p| p[c]).collect::<Vec<f64>>());
    footprint::of_camera(camera, &x, &y, 1e-9, 0).unwrap().sky
}

/// The stars that pixels' beams cover, and where in the picture they may be.
fn covered(
    camera: &Camera,
    centers: &[Plane],
    size: f64,
    stars: &[([f64; 3], f64)],
) -> Vec<(usize, Plane)> {
    let mut found = Vec::new();
    for (sky, place) in beams(camera, centers).iter().zip(centers) {
        let Some(sky) = sky else { continue };
        for (star, (direction, _)) in stars.iter().enumerate() {
            if dot(*direction, sky.direction) > 0.9 {
                let [dx, dy] = step_to(sky, *direction);
                if dx.abs().max(dy.abs()) <= 0.55 * size {
                    found.push((star, [place[0] + dx, place[1] + dy]));
                }
            }
        }
    }
    found
}

/// All images of stars in a frame, by Newton's method from every pixel whose beam covers a star.
fn images(scene: &Scene, stars: &[([f64; 3], f64)]) -> Vec<Image> {
    let hole = Kerr::new(scene.hole.spin).unwrap();
    let config = scene.camera.as_ref().unwrap();
    let camera = config.camera(&hole, scene.observer.time).unwrap();
    let (width, height) = (scene.screen.width as usize, scene.screen.rows() as usize);
    let size = scene.pixel_size();
    let middle = [0.5 * width as f64, 0.5 * height as f64];
    let center = |k: usize| {
        let (column, row) = ((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
        [(column - middle[0]) * size, (middle[1] - row) * size]
    };
    let centers: Vec<Plane> = (0..width * height).map(center).collect();
    let mut found = covered(&camera, &centers, size, stars);
    let mut images: Vec<Image> = Vec::new();
    for round in 0..4 {
        let places: Vec<Plane> = found.iter().map(|f| f.1).collect();
        for ((star, place), sky) in found.iter_mut().zip(beams(&camera, &places)) {
            let Some(sky) = sky else { continue };
            let (direction, flux) = stars[*star];
            let [x, y] = *place;
            let [dx, dy] = step_to(&sky, direction);
            if round < 3 {
                *place = [x + dx, y + dy];
                continue;
            }
            if dx.hypot(dy) > 1e-3 * size {
                // Next to a fold of the lens map there may be no image.
                continue;
            }
            let area = sky.ellipse().magnification;
            let place = [x / size + middle[0] - 0.5, middle[1] - 0.5 - y / size];
            let near = |i: &Image| {
                i.star == *star && (i.place[0] - place[0]).hypot(i.place[1] - place[1]) < 0.01
            };
            if !images.iter().any(near) {
                images.push(Image {
                    star: *star,
                    mirrored: area < 0.0,
                    place,
                    flux: flux / area.abs(),
                    magnification: (1.0 + x * x + y * y).powf(-1.5) / area.abs(),
                });
            }
        }
    }
    images
}

/// Relative errors of the light around images of single stars, and their changes from frame to frame; images closer to
/// another or to the edge than a beam reaches are left out.
fn photometry(text: &str, overrides: &[&str], frames: u32, most: f64) -> (Vec<f64>, Vec<f64>) {
    const APART: f64 = 6.5;
    let mut scene = scene(text, overrides);
    let Some(SkyModel::Stars(field)) = SkyModel::new(scene.sky.as_ref().unwrap(), None, None)
    else {
        panic!("a field of stars");
    };
    let stars = field.catalogue();
    let mut film = Raster::new(&scene, None).unwrap();
    let (mut errors, mut changes) = (Vec::new(), Vec::new());
    let mut before: Vec<(usize, bool, f64)> = Vec::new();
    for k in 0..frames {
        scene.observer.time = f64::from(k);
        let frame = film.frames(&[scene.observer.time], &|_| true).unwrap().remove(0);
        let picture = film.rendered(frame, 1.0).unwrap().picture;
        let (width, height) = (picture.width as f64, picture.height as f64);
        let light = picture.channel("G").unwrap();
        let all = images(&scene, &stars);
        let mut now = Vec::new();
        for (i, image) in all.iter().enumerate() {
            let [x, y] = image.place;
            let inside = x > APART && y > APART && x < width - APART && y < height - APART;
            let far =
                |other: &Image| (other.place[0] - x).abs().max((other.place[1] - y).abs()) > APART;
            let single = all.iter().enumerate().all(|(j, other)| i == j || far(other));
            if !(inside && single && image.magnification < most) {
                continue;
            }
            let size = scene.pixel_size();
            let mut sum = 0.0;
            for row in (y.round() as usize - 3)..=(y.round() as usize + 3) {
                for column in (x.round() as usize - 3)..=(x.round() as usize + 3) {
                    sum += f64::from(light[row * picture.width + column]) * size * size;
                }
            }
            let ratio = sum / image.flux;
            let same = |b: &&(usize, bool, f64)| (b.0, b.1) == (image.star, image.mirrored);
            changes.extend(before.iter().find(same).map(|b| ratio - b.2));
            errors.push(ratio - 1.0);
            now.push((image.star, image.mirrored, ratio));
        }
        before = now;
    }
    (errors, changes)
}

fn largest(values: &[f64]) -> f64 {
    values.iter().map(|v| v.abs()).fold(0.0, f64::max)
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// From frame to frame of a camera on an orbit, stars an eighth of a pixel large keep their flux
/// within 1 %, and it is the flux times the lens's magnification; seen by single rays they blink.
#[test]
fn exact_unresolved_stars_do_not_flicker() {
    let (off, changes) = photometry(STARS, &[], 24, 3.0);
    assert!(off.len() >= 20 && changes.len() >= 12, "{} {}", off.len(), changes.len());
    assert!(largest(&changes) < 0.01, "{}", largest(&changes));
    assert!(largest(&off) < 0.01, "{}", largest(&off));
    let (_, blinking) = photometry(STARS, &["effects.ray_bundles=false"], 24, 3.0);
    assert!(rms(&blinking) > 1.0, "{}", rms(&blinking));
}

/// The same for 100 frames, there and in front of the hole.
#[test]
#[ignore = "long"]
fn exact_unresolved_stars_over_100_frames() {
    let hole: [&str; 5] = [
        "camera.yaw_deg=0",
        "camera.field_of_view_deg=50",
        "sky.stars.count=400",
        "screen.width=80",
        "screen.height=54",
    ];
    let around = "around the hole";
    for (name, more, most, frames) in
        [("beside the hole", &[][..], 3.0, 100), (around, &hole[..], 3.0, 40)]
    {
        for (way, bundles) in [("with", "true"), ("without", "false")] {
            let bundles = format!("effects.ray_bundles={bundles}");
            let overrides = [more, &[bundles.as_str()][..]].concat();
            let (off, changes) = photometry(STARS, &overrides, frames, most);
            assert!(changes.len() > 20, "{}", changes.len());
            println!(
                "{name}, magnified up to {most}, {way} bundles: {} images, flux off by {:.2e} rms, \
                 {:.2e} at most; from frame to frame {:.2e} rms, {:.2e} at most",
                off.len(),
                rms(&off),
                largest(&off),
                rms(&changes),
                largest(&changes)
            );
            match (bundles.ends_with("true"), name == around) {
                (true, _) => assert!(largest(&changes) < 0.01 && rms(&off) < 0.01, "{name}"),
                (false, false) => assert!(rms(&changes) > 1.0, "{name}"),
                // There single rays miss every star in every frame.
                (false, true) => assert!(rms(&off) > 0.99, "{name}"),
            }
        }
    }
}

/// The same in the middle of the film of `scenes/camera_orbit.toml`, with its pixels, its lens and
/// its stars, but fewer of these so that they can be told apart.
#[test]
fn exact_unresolved_stars_of_the_orbit_around_the_hole() {
    let text = std::fs::read_to_string(root().join("scenes/camera_orbit.toml")).unwrap();
    // Half the field of 70 degrees on its plane: 2 atan(tan(35 degrees)/2).
    let middle = ["screen.width=160", "screen.height=100", "camera.field_of_view_deg=38.592"];
    let stars = ["sky.stars.count=1000"];
    let (off, changes) = photometry(&text, &[&middle[..], &stars].concat(), 8, 3.0);
    println!(
        "{} images, flux off by {:.2e} rms, {:.2e} at most; from frame to frame {:.2e} rms, {:.2e} \
         at most",
        off.len(),
        rms(&off),
        largest(&off),
        rms(&changes),
        largest(&changes)
    );
    assert!(changes.len() > 20 && largest(&changes) < 0.01);
}
