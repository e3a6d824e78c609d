//! Photon rings of pictures: resolved, at the cost that the requested error asks for.

use crate::pictures::{SMALL, distance, file, small};
use crate::support::{render, rendered, scene};
use kerrlight_geodesic::analytic::CriticalCurve;
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::image::Picture;
use kerrlight_render::picture::{RingStrata, Stratum};
use kerrlight_render::transport::View;

/// A face-on disc without spin: the image n = 2 (5.19 M to 5.23 M) is a fifth of a pixel wide. Pixels that it runs
/// through are what 1024 rays see in them, to 5 %; those of one ray are dots.
#[test]
fn exact_photon_rings_are_resolved() {
    let text = file("disc_face_on.toml");
    let size = ["screen.width=96", "screen.height=96", "screen.field_of_view_m=16.0"];
    let sized = |more: &[&str]| render(&scene(&text, &[&size, more].concat()));
    let reference = sized(&["screen.samples_per_pixel=1024", "screen.rings=\"regular-grid\""]);
    let grid = sized(&["screen.samples_per_pixel=1", "screen.rings=\"regular-grid\""]);
    // Rings take as many rays as the grid at most.
    let resolved = sized(&["screen.samples_per_pixel=4"]);
    let [before, after] = [&grid, &resolved].map(|picture| ring_contrast(picture, &reference));
    assert!(before > 0.5 && after < 0.05, "{before} {after}");
    let [before, after] = [&grid, &resolved].map(|picture| distance(picture, &reference));
    assert!(after < before, "{before} {after}");
}

/// Relative L1 distance of two pictures in the pixels that the critical curve of a hole without spin runs through.
fn ring_contrast(picture: &Picture, reference: &Picture) -> f64 {
    let step = 16.0 / 96.0;
    let near = |k: usize| {
        let at = |k: usize| (k as f64 - 47.5) * step;
        let (x, y) = (at(k % 96).abs(), at(k / 96).abs());
        let half = 0.5 * step;
        let [low, high] = [(x - half).hypot(y - half), (x + half).hypot(y + half)];
        low < 27f64.sqrt() && high > 27f64.sqrt()
    };
    let [a, b] = [picture, reference].map(|p| p.channel("intensity").expect("a channel"));
    let chosen = (0..96 * 96).filter(|k| near(*k));
    let (off, sum) = chosen.fold((0.0, 0.0), |(off, sum), k| {
        (off + f64::from((a[k] - b[k]).abs()), sum + f64::from(b[k]))
    });
    off / sum
}

/// With `screen.rings = "regular-grid"` a pixel is what the ray at its centre sees, bit for bit; with rings
/// resolved the channels of the central ray are the same, and all pixels away from the critical curve.
#[test]
fn exact_regular_grid_is_one_ray_a_pixel() {
    let text = file("hot_spots.toml");
    let flux =
        ["screen.total_flux_jy=", "screen.field_of_view_uas=", "screen.field_of_view_m=24.0"];
    let of = |rings: &str| small(&text, &[&flux[..], &[rings]].concat());
    let grid = of("screen.rings=\"regular-grid\"");
    let resolved = of("screen.rings=\"resolved\"");
    let scene = scene(&text, &[&SMALL[..], &flux].concat());
    let prepared = kerrlight_render::transport::PreparedScene::new(&scene, None).unwrap();
    let at = |k: usize| (k as f64 - 32.0) * 24.0 / 65.0;
    for name in ["redshift", "crossings", "radius", "azimuth", "delay", "outcome"] {
        assert_eq!(grid.channel(name), resolved.channel(name), "{name}");
    }
    let [one, many] = [&grid, &resolved].map(|p| p.channel("intensity").unwrap());
    let mut scratch = kerrlight_render::transport::Scratch::default();
    let mut changed = 0;
    for k in (0..65 * 65).step_by(7) {
        let (x, y) = (at(k % 65), -at(k / 65));
        let seen = prepared.observe(x, y, &mut scratch).unwrap();
        assert_eq!(seen.intensity as f32, one[k], "pixel {k}");
        changed += usize::from(one[k] != many[k]);
        assert!(x.hypot(y) < 12.0 || one[k] == many[k], "pixel {k}");
    }
    assert!(changed > 3, "{changed}");
}

/// Pixels with rings depend neither on tiles nor on the number of threads, and frames of a film rendered
/// together are the single pictures, bit for bit.
#[test]
fn exact_rings_do_not_depend_on_tiles_or_batches() {
    let text = file("hot_spots.toml");
    let flux = ["screen.total_flux_jy=", "screen.width=40", "screen.height=40"];
    let mut scene = scene(&text, &flux);
    let raster = |tile: usize| {
        let raster = kerrlight_render::picture::Raster::new(&scene, None).unwrap().with_tile(tile);
        raster.render(&|_| true).unwrap().picture
    };
    let whole = raster(64);
    assert_eq!(whole, raster(7));
    let mut film = kerrlight_render::picture::Raster::new(&scene, None).unwrap();
    let times = [40.0, 55.0];
    let frames = film.frames(&times, &|_| true).unwrap();
    for (frame, time) in frames.into_iter().zip(times) {
        scene.observer.time = time;
        assert_eq!(film.rendered(frame, 1.0).unwrap().picture, render(&scene), "{time}");
    }
    assert!(whole.channel("intensity").unwrap().iter().any(|light| *light > 0.0));
}

/// However small the picture, rings take no more rays than its grid, and the stated error holds with so few of them.
#[test]
fn exact_rings_of_small_pictures() {
    let text = file("disc_face_on.toml");
    for (width, height, samples) in [(32, 18, 4), (32, 18, 1), (9, 7, 1)] {
        let sized = |samples: u64, rings: &str| {
            let more = [
                format!("screen.width={width}"),
                format!("screen.height={height}"),
                format!("screen.samples_per_pixel={samples}"),
                format!("screen.rings=\"{rings}\""),
            ];
            rendered(&scene(&text, &more.each_ref().map(String::as_str)))
        };
        let (few, many) = (sized(samples, "resolved"), sized(1024, "regular-grid"));
        let grid = width * height * samples;
        assert!(few.summary.rays > grid && few.summary.rays <= 2 * grid, "{}", few.summary.rays);
        let (found, stated) = (distance(&few.picture, &many.picture), few.summary.image_error);
        assert!(found < stated && found > 0.1 * stated, "{width} {samples}: {found} {stated}");
    }
}

/// A transparent annulus of 0.02 M, whose image is narrower than rays are apart: the stated error covers what is missing,
/// and pixels that are refined find it.
#[test]
fn exact_error_of_an_annulus_between_rays() {
    let text = "hole = { spin = 0.5 }
        observer = { inclination_deg = 80.0 }
        screen = { field_of_view_m = 30.0, width = 48, samples_per_pixel = 1 }
        effects = { redshift = true, spectral_index = 0.0 }
        tracer = { integrator = \"elliptic\", tolerance = 1e-8 }
        disc = { inner_edge = 10.0, outer_edge = 10.02, peak_intensity = 1.0, opaque = false }";
    for inclination in ["observer.inclination_deg=80.0", "observer.inclination_deg=17.0"] {
        let of = |more: &[&str]| rendered(&scene(text, &[&[inclination], more].concat())).summary;
        let grid = "screen.rings=\"regular-grid\"";
        let truth = of(&[grid, "screen.samples_per_pixel=1024"]).flux;
        for more in [&[grid][..], &[], &["screen.image_error=0.1"]] {
            let seen = of(more);
            let off = (seen.flux - truth).abs();
            let stated = seen.flux_error;
            assert!(
                off < stated && stated < 4.0 * truth,
                "{more:?}: {} {stated} {truth}",
                seen.flux
            );
        }
        let refined = of(&["screen.image_error=0.1"]);
        assert!(refined.flux > 0.8 * truth && refined.image_error < 0.3, "{refined:?} {truth}");
    }
}

/// Where pixels are refined, strata follow the requested error: a coarse picture takes not even twice the rays that it takes
/// without them.
#[test]
fn exact_rings_follow_the_requested_error() {
    let rays = |rings: &str| {
        let rings = format!("screen.rings=\"{rings}\"");
        let more = [
            "screen.width=32",
            "screen.height=18",
            "screen.samples_per_pixel=1",
            "screen.image_error=0.1",
            &rings,
        ];
        rendered(&scene(&file("disc_face_on.toml"), &more)).summary.rays
    };
    let (resolved, grid) = (rays("resolved"), rays("regular-grid"));
    assert!(resolved < 2 * grid, "{resolved} {grid}");
}

fn ring_strata(spin: f64, degrees: f64) -> (Kerr, Observer, RingStrata) {
    let hole = Kerr::new(spin).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
    (hole, observer, RingStrata::new(&hole, &View::Screen(observer), 0.1))
}

/// Without spin the critical curve is a circle of radius √27: shares of squares inside of it add up to its area,
/// squares larger than the shadow included.
#[test]
fn exact_area_inside_the_critical_curve() {
    let (_, _, strata) = ring_strata(0.0, 50.0);
    for (size, tolerance) in [(0.05, 1e-3), (0.5, 2e-3), (4.0, 2e-2), (40.0, 2e-2)] {
        let at = |k: i32| (f64::from(k) + 0.21) * size;
        let count = (7.0 / size).ceil() as i32;
        let mut inside = 0.0;
        for (row, column) in (-count..=count).flat_map(|r| (-count..=count).map(move |c| (r, c))) {
            let (x, y) = (at(column), at(row));
            let mut rays = Vec::new();
            strata.place((x, y), size, &mut rays);
            if rays.is_empty() {
                rays.push(Stratum { x, y, share: 1.0 });
            }
            let total: f64 = rays.iter().map(|ray| ray.share).sum();
            assert!((total - 1.0).abs() < 1e-9, "{total}");
            let within = |ray: &&Stratum| ray.x.hypot(ray.y) < 27f64.sqrt();
            inside += rays.iter().filter(within).map(|ray| ray.share).sum::<f64>();
        }
        let area = inside * size * size / (27.0 * std::f64::consts::PI);
        assert!((area - 1.0).abs() < tolerance, "{size}: {area}");
    }
}

/// Far from the critical curve there is nothing to be done; on it there are rays on both sides.
#[test]
fn exact_rays_lie_where_the_ring_is() {
    for (spin, degrees) in [(0.0, 0.0), (0.5, 67.0), (0.94, 90.0), (0.99, 60.0), (-0.7, 20.0)] {
        let (hole, observer, strata) = ring_strata(spin, degrees);
        let curve = CriticalCurve::new(&hole, observer.inclination());
        let mut far = Vec::new();
        strata.place((14.0, 3.0), 0.05, &mut far);
        assert!(far.is_empty());
        for angle in [0.3, 1.2, 2.9, 4.0, 6.0] {
            let point = curve.point(angle);
            let mut rays = Vec::new();
            strata.place((point.alpha + 0.01, point.beta - 0.01), 0.05, &mut rays);
            assert!(rays.len() > 40 && rays.len() < 200, "{spin} {degrees}: {}", rays.len());
            let falls =
                |ray: &Stratum| observer.ray(&hole, ray.x, ray.y).unwrap().potential.captures();
            let captured = rays.iter().filter(|ray| falls(ray)).count();
            assert!(captured > 10 && captured < rays.len() - 10, "{spin} {degrees}: {captured}");
        }
    }
}
