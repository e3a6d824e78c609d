//! Channels on request, against closed forms and against other pictures.

use crate::support::scene;
use kerrlight_geodesic::vector::{cross, difference, norm};
use kerrlight_render::emission::sky::{Catalogue, Panorama};
use kerrlight_render::image::{Channel, Picture, exr};
use kerrlight_render::picture::render;
use kerrlight_render::scene::Scene;
use kerrlight_render::transport::Assets;

/// A disc that absorbing gas surrounds, and a spot, with light of all images.
const GEOMETRY: &str = r#"
    hole = { spin = 0.7, mass_msun = 6.5e9, distance_kpc = 16800.0 }
    observer = { inclination_deg = 65.0 }
    screen = { field_of_view_m = 30.0, width = 40, channels = ["default"] }
    effects = { redshift = true, spectral_index = 0.0 }
    tracer = { integrator = "elliptic", tolerance = 1e-8 }
    disc = { outer_edge = 12.0, peak_intensity = 1e-3, opaque = false, color = [1.0, 0.5, 0.25] }

    [gas]
    profile = "gaussian"
    scale_radius = 4.0
    flatness = 1.0
    motion = "keplerian"
    emissivity = 3e-19
    absorptivity = 5e2
    outer_radius = 20.0
    color = [0.2, 0.6, 1.0]

    [[spot]]
    radius = 8.0
    phase_deg = 40.0
    sigma = 0.7
    peak_emissivity = 1e-3
"#;

/// A hole before a sky, without anything else.
const EMPTY: &str = r#"
    hole = { spin = 0.0 }
    observer = { inclination_deg = 90.0 }
    screen = { field_of_view_m = 16.0, width = 64 }
    tracer = { integrator = "elliptic", tolerance = 1e-9 }
    sky.image = { path = "-", brightness = 1.0 }
"#;

/// A disc seen face-on by a distant observer.
const FACE_ON: &str = r#"
    hole = { spin = 0.6 }
    observer = { inclination_deg = 0.0 }
    screen = { field_of_view_m = 30.0, width = 31, samples_per_pixel = 1, rings = "regular-grid" }
    tracer = { integrator = "elliptic", tolerance = 1e-9 }
    disc = { outer_edge = 12.0, peak_intensity = 1.0, opaque = true }
"#;

/// An equirectangular sky with these colours, as functions of the place from 0 to 1 to the right and down.
fn sky(color: impl Fn(f64, f64) -> [f64; 3]) -> Panorama {
    let (width, height) = (256, 128);
    let place = |k: usize, size: usize| (k as f64 + 0.5) / size as f64;
    let at = |k: usize| color(place(k % width, width), place(k / width, height));
    let values = |c: usize| (0..width * height).map(|k| at(k)[c] as f32).collect();
    let channel = |c: usize| Channel { name: ["R", "G", "B"][c].to_owned(), values: values(c) };
    let picture = Picture { width, height, channels: (0..3).map(channel).collect() };
    Panorama::decode(
        &exr::encode(&picture, &exr::Attributes::new(), exr::Style::default()).unwrap(),
    )
    .unwrap()
}

fn asking(text: &str, channels: &str, more: &[&str]) -> Scene {
    let channels = format!("screen.channels=[{channels}]");
    let all: Vec<&str> = more.iter().copied().chain([channels.as_str()]).collect();
    scene(text, &all)
}

fn picture(scene: &Scene, sky: Option<Panorama>) -> Picture {
    render(scene, sky, &|_| true).unwrap().picture
}

fn color<'a>(picture: &'a Picture, layer: &str) -> [&'a [f32]; 3] {
    ["R", "G", "B"].map(|c| {
        let name = if layer.is_empty() { c.to_owned() } else { format!("{layer}.{c}") };
        picture.channel(&name).unwrap()
    })
}

/// Matter holds up a part of a sky of brightness 1: this part is the alpha channel, whatever holds it up.
#[test]
#[ignore = "long"]
fn exact_alpha_is_what_is_missing_of_a_white_sky() {
    for more in [
        &["effects.absorption=true", "screen.samples_per_pixel=4"][..],
        &["disc.opaque=true"],
        &["effects.half_orbits=1"],
        &["screen.rings=\"regular-grid\"", "tracer.integrator=\"taylor-mino\""],
    ] {
        let base = scene(GEOMETRY, &["sky.image={path=\"-\",brightness=1.0}"]);
        let scene = asking(&base.to_toml(), r#""A","coverage","sky""#, more);
        let seen = picture(&scene, Some(sky(|_, _| [1.0; 3])));
        let (alpha, sky) = (seen.channel("A").unwrap(), color(&seen, "sky")[1]);
        for (a, s) in alpha.iter().zip(sky) {
            assert!((a + s - 1.0).abs() < 2e-6, "{more:?}: {a} {s}");
        }
        let partly = alpha.iter().filter(|a| (0.01..0.99).contains(*a)).count();
        assert!(partly > 10 || !more.contains(&"effects.absorption=true"), "{partly}");
        let coverage = seen.channel("coverage").unwrap();
        assert!(alpha.iter().zip(coverage).all(|(a, c)| *c <= 1.000_001 && *a <= c + 1e-6));
    }
}

/// The shadow of a hole without spin has an area of 27π M² (Synge 1966), however many images of matter are included.
#[test]
fn exact_alpha_has_the_area_of_the_shadow() {
    area_of_the_shadow(&["screen.samples_per_pixel=16"]);
    area_of_the_shadow(&["screen.samples_per_pixel=16", "effects.half_orbits=0"]);
}

fn area_of_the_shadow(more: &[&str]) {
    let seen = picture(&asking(EMPTY, r#""A","id","Z""#, more), Some(sky(|_, _| [1.0; 3])));
    let sum: f64 = seen.channel("A").unwrap().iter().map(|a| f64::from(*a)).sum();
    let area = sum * (16.0f64 / 64.0).powi(2);
    assert!((area / (27.0 * core::f64::consts::PI) - 1.0).abs() < 1e-3, "{area}");
    let (id, depth) = (seen.channel("id").unwrap(), seen.channel("Z").unwrap());
    assert!(id.iter().zip(depth).all(|(id, z)| match *id {
        0.0 => *z == 1e10,
        1.0 => (990.0..1060.0).contains(z),
        _ => false,
    }));
}

/// Images add up to the emission, and emission and sky to the whole.
#[test]
fn exact_layers_add_up() {
    let base =
        scene(GEOMETRY, &["sky.image={path=\"-\",brightness=1e-4}", "effects.absorption=true"]);
    let scene = asking(&base.to_toml(), r#""default","emission","sky","n0","n1","n2""#, &[]);
    let seen = picture(&scene, Some(sky(|u, v| [u, v, 1.0])));
    for c in 0..3 {
        let of = |layer: &str| color(&seen, layer)[c];
        let layers = ["", "emission", "sky", "n0", "n1", "n2"].map(of);
        for k in 0..layers[0].len() {
            let [whole, emission, sky, n0, n1, n2] = layers.map(|layer| f64::from(layer[k]));
            assert!(
                (emission + sky - whole).abs() <= 1e-6 * whole,
                "{k}: {emission} {sky} {whole}"
            );
            assert!((n0 + n1 + n2 - emission).abs() <= 1e-6 * emission, "{k}");
        }
        let sums = layers.map(|layer| layer.iter().map(|x| f64::from(*x)).sum::<f64>());
        assert!(sums.iter().all(|sum| *sum > 1e-5 * sums[0]), "{sums:?}");
    }
}

/// Cameras inside the photon shell look outwards as well: every crossing of a plunging disc that nothing dims is an image.
#[test]
fn exact_images_of_a_camera_that_looks_outwards() {
    for (spin, radius) in [(0.0, 2.6), (0.9, 3.3)] {
        let text = format!(
            "hole = {{ spin = {spin} }}
            observer = {{ time = 0.0 }}
            camera = {{ motion = \"zamo\", radius = {radius}, theta_deg = 70.0, phi_deg = 0.0, yaw_deg = 180.0, field_of_view_deg = 150.0 }}
            screen = {{ width = 24, height = 24, rings = \"regular-grid\", channels = [\"default\", \"n0\", \"n1\"] }}
            tracer = {{ integrator = \"elliptic\", tolerance = 1e-8 }}
            disc = {{ outer_edge = 1000.0, peak_intensity = 1.0, opaque = false, plunging = {{ intensity = 1.0, exponent = 0.0 }} }}"
        );
        let seen = picture(&scene(&text, &[]), None);
        let [first, second] = ["n0", "n1"].map(|layer| color(&seen, layer)[1]);
        let crossings = &seen.channel("crossings").unwrap();
        let mut twice = 0;
        for (k, count) in crossings.iter().enumerate() {
            assert_eq!(
                (first[k] > 0.0, second[k] > 0.0),
                (*count >= 1.0, *count >= 2.0),
                "{k}: {count}"
            );
            twice += usize::from(*count >= 2.0);
        }
        assert!(twice > 5, "{twice}");
    }
}

/// Sums of images are pictures whose rays end after as many half-orbits, of every kind of source.
#[test]
fn code_images_are_those_of_half_orbits() {
    let grid = "screen.rings=\"regular-grid\"";
    for more in [
        &[grid][..],
        &[grid, "effects.absorption=true"],
        &[grid, "tracer.integrator=\"dop853-mino\""],
    ] {
        let whole = picture(&asking(GEOMETRY, r#""n0","n1","n2""#, more), None);
        for orders in 0..2 {
            let most = format!("effects.half_orbits={orders}");
            let cut: Vec<&str> = more.iter().copied().chain([most.as_str()]).collect();
            let cut = picture(&asking(GEOMETRY, r#""default""#, &cut), None);
            for c in 0..3 {
                let images: Vec<_> =
                    (0..=orders).map(|n| color(&whole, &format!("n{n}"))[c]).collect();
                let (mut off, mut sum) = (0.0, 0.0);
                for (k, cut) in color(&cut, "")[c].iter().enumerate() {
                    let light: f32 = images.iter().map(|image| image[k]).sum();
                    (off, sum) = (off + f64::from((light - cut).abs()), sum + f64::from(*cut));
                }
                assert!(off < 1e-5 * sum, "{more:?} {orders} {c}: {off} of {sum}");
            }
        }
    }
}

/// Looking a sky up where the map says gives the sky that is seen.
#[test]
fn exact_st_map_finds_the_sky() {
    let turns = |u: f64| (core::f64::consts::TAU * u).sin_cos();
    let wave = |u: f64, v: f64| [0.5 + 0.4 * turns(u).0, 0.5 + 0.4 * turns(u).1, v];
    let seen = picture(
        &asking(EMPTY, r#""sky","st""#, &["screen.rings=\"regular-grid\""]),
        Some(sky(wave)),
    );
    let [u, v, a] = ["st.u", "st.v", "st.a"].map(|name| seen.channel(name).unwrap());
    let sky = color(&seen, "sky");
    let mut open = 0;
    for k in 0..u.len() {
        if a[k] == 0.0 {
            assert_eq!([u[k], v[k], sky[0][k]], [0.0; 3]);
            continue;
        }
        open += 1;
        let expected = wave(f64::from(u[k]), 1.0 - f64::from(v[k]));
        for (sky, expected) in sky.iter().zip(expected) {
            assert!((f64::from(sky[k]) - expected).abs() < 5e-3, "{k}: {} {expected}", sky[k]);
        }
    }
    assert!(open > 2000);
}

/// The footprint of a pixel is the solid angle between the places on the sky of its neighbours.
#[test]
fn exact_footprint_is_the_solid_angle_between_neighbours() {
    let more = [
        "screen.field_of_view_m=40.0",
        "screen.width=200",
        "screen.rings=\"regular-grid\"",
        "hole.spin=0.9",
    ];
    let seen = picture(&asking(EMPTY, r#""st","footprint""#, &more), Some(sky(|_, _| [1.0; 3])));
    let [u, v, a, footprint] =
        ["st.u", "st.v", "st.a", "footprint"].map(|name| seen.channel(name).unwrap());
    let direction = |k: usize| {
        let (azimuth, polar) = (
            core::f64::consts::TAU * (0.5 - f64::from(u[k])),
            core::f64::consts::PI * (1.0 - f64::from(v[k])),
        );
        [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()]
    };
    let mut seen = 0;
    for k in (0..u.len()).filter(|k| (1..199).contains(&(k % 200)) && (1..199).contains(&(k / 200)))
    {
        let (x, y) = (0.2 * ((k % 200) as f64 - 99.5), 0.2 * ((k / 200) as f64 - 99.5));
        if x.hypot(y) < 12.0 || a[k] == 0.0 {
            continue;
        }
        let half = |p: usize, q: usize| difference(direction(p), direction(q)).map(|x| 0.5 * x);
        let area = norm(cross(half(k + 1, k - 1), half(k + 200, k - 200)));
        assert!(
            (f64::from(footprint[k]) / area - 1.0).abs() < 0.02,
            "{x} {y}: {} {area}",
            footprint[k]
        );
        seen += 1;
    }
    assert!(seen > 10_000);
}

/// Light that comes straight out of a hole without spin has dr = dλ (λ affine): depths are differences of radii.
#[test]
fn exact_depth_of_radial_rays() {
    let hole = ["hole.spin=0.0", "screen.width=1", "screen.field_of_view_m=1e-6"];
    let far = picture(&asking(EMPTY, r#""Z""#, &hole), Some(sky(|_, _| [1.0; 3])));
    assert!((far.channel("Z").unwrap()[0] - 998.0).abs() < 1e-3, "{:?}", far.channel("Z"));
    let near = r#"
        hole = { spin = 0.0 }
        camera = { motion = "static", radius = 30.0, theta_deg = 70.0, phi_deg = 0.0, field_of_view_deg = 1e-4 }
        screen = { width = 1, channels = ["Z", "id"] }
        tracer = { integrator = "elliptic", tolerance = 1e-10 }
    "#;
    let near = picture(&scene(near, &[]), None);
    assert!((near.channel("Z").unwrap()[0] - 28.0).abs() < 1e-4, "{:?}", near.channel("Z"));
    assert_eq!(near.channel("id").unwrap(), [1.0]);
}

/// Face-on, the image of a disc turns about the centre with the angular velocity of circular orbits.
#[test]
fn exact_motion_of_a_disc_seen_from_above() {
    let asked = r#""motion","radius","id""#;
    for more in [&[][..], &["effects.slow_light=true"], &["disc.inner_edge=7.0"]] {
        let seen = picture(&asking(FACE_ON, asked, more), None);
        let [u, v, radius, id] =
            ["motion.u", "motion.v", "radius", "id"].map(|name| seen.channel(name).unwrap());
        let mut lit = 0;
        for k in (0..u.len()).filter(|k| id[*k] == 2.0) {
            let (x, y) = ((k % 31) as f64 - 15.0, 15.0 - (k / 31) as f64);
            let rate = 1.0 / (f64::from(radius[k]).powf(1.5) + 0.6);
            // Azimuth 0 is below, seen from the axis with −e_θ upwards; it grows to the right.
            let off = (f64::from(u[k]) + rate * y).hypot(f64::from(v[k]) - rate * x);
            assert!(off < 1e-4 * rate * x.hypot(y), "{x} {y}: {} {}, {rate}", u[k], v[k]);
            lit += 1;
        }
        assert!(lit > 100, "{lit}");
    }
}

/// A spot is where its motion says at another time, seen from the side with light travel times.
#[test]
fn exact_motion_between_two_pictures() {
    let text = r#"
        hole = { spin = 0.5 }
        observer = { inclination_deg = 60.0 }
        screen = { field_of_view_m = 28.0, width = 128, rings = "regular-grid" }
        effects = { half_orbits = 0, slow_light = true }
        tracer = { integrator = "taylor-mino", tolerance = 1e-8 }
        spot = [{ radius = 9.0, phase_deg = 0.0, sigma = 0.25, peak_emissivity = 1.0 }]
    "#;
    for (phase, slow) in [(0.0, true), (70.0, true), (70.0, false), (200.0, true)] {
        let step = 1.0;
        let at = |time: f64| {
            let set = [
                format!("spot.0.phase_deg={phase}"),
                format!("observer.time={time}"),
                format!("effects.slow_light={slow}"),
            ];
            let set: Vec<&str> = set.iter().map(String::as_str).collect();
            picture(&asking(text, r#""default","motion""#, &set), None)
        };
        let mean = |seen: &Picture, of: &dyn Fn(usize) -> f64| {
            let light = seen.channel("intensity").unwrap().iter().map(|x| f64::from(*x));
            let sums = light
                .enumerate()
                .fold((0.0, 0.0), |sums, (k, light)| (sums.0 + light * of(k), sums.1 + light));
            sums.0 / sums.1
        };
        let place = |seen: &Picture| {
            [mean(seen, &|k| (k % 128) as f64), -mean(seen, &|k| (k / 128) as f64)]
        };
        let (before, now, after) = (at(-step), at(0.0), at(step));
        let moved: Vec<f64> =
            place(&after).iter().zip(place(&before)).map(|(b, a)| (b - a) / (2.0 * step)).collect();
        for (name, moved) in ["motion.u", "motion.v"].iter().zip(moved) {
            let channel = now.channel(name).unwrap();
            let said = mean(&now, &|k| f64::from(channel[k]));
            assert!((said - moved).abs() < 0.023, "{phase} {slow} {name}: {said} {moved}");
        }
    }
}

/// Numbers of the sources, and what is refused.
#[test]
fn exact_identifiers_and_refusals() {
    let raster = |scene: &Scene| kerrlight_render::picture::Raster::new(scene, None);
    let scene = asking(GEOMETRY, r#""id""#, &[]);
    let names = raster(&scene).unwrap().identifiers().unwrap();
    assert_eq!(names, "0 sky\n1 hole\n2 disc\n3 gas\n4 spot.0\n");
    let seen = picture(&scene, None);
    let id = seen.channel("id").unwrap();
    assert!((2..=4).all(|source| id.contains(&(source as f32))), "{id:?}");
    let fail = |channels: &str, more: &[&str]| {
        raster(&asking(GEOMETRY, channels, more)).unwrap_err().to_string()
    };
    assert!(fail(r#""sky""#, &[]).contains("no channel `sky`"));
    let said = fail(r#""A""#, &["screen.image_error=1e-2"]);
    assert!(said.contains("A is not there with `screen.image_error`"), "{said}");
}

/// Light of a star at an angle u behind a hole, in units of the Einstein angle of a camera far away: unlensed times
/// (u² + 2)/(u √(u² + 4)), of both images together (Paczyński 1986, ApJ 304, 1, eq. 4).
#[test]
fn paper_stars_are_magnified() {
    let distance: f64 = 3e5;
    let einstein = (4.0 / distance).sqrt();
    let field = 6.0 * einstein.to_degrees();
    let text = format!(
        r#"
        hole = {{ spin = 0.0 }}
        camera = {{ motion = "static", radius = {distance}, theta_deg = 90.0, phi_deg = 0.0, field_of_view_deg = {field} }}
        screen = {{ width = 160, rings = "regular-grid" }}
        tracer = {{ integrator = "elliptic", tolerance = 1e-10 }}
        sky.catalogue = {{ path = "-", brightness = 1.0, psf_fwhm_pixels = 2.0 }}
    "#
    );
    let scene = Scene::parse(&text).unwrap();
    let pixel = scene.pixel_size().to_degrees();
    for u in [0.4, 0.8, 1.5] {
        let star = format!("lon,lat,mag\n180,{},2.5\n", (u * einstein).to_degrees());
        let stars = Some(Catalogue::decode(star.as_bytes()).unwrap());
        let assets = Assets { stars, ..Assets::default() };
        let seen = render(&scene, assets, &|_| true).unwrap().picture;
        let sum: f64 = color(&seen, "")[1].iter().map(|x| f64::from(*x)).sum();
        let magnified = sum * pixel * pixel / 0.1;
        let expected = (u * u + 2.0) / (u * (u * u + 4.0).sqrt());
        assert!((magnified / expected - 1.0).abs() < 0.02, "{u}: {magnified} {expected}");
    }
}

/// Beside the ring, where the image of a faint disc's light runs around the hole, no motion leaves the picture within
/// 1 M, and with 9 and 25 rays a pixel alpha does not exceed 1.
#[test]
fn exact_motion_and_alpha_have_bounds() {
    let side = 31.0;
    for rays in [9, 25] {
        let rays = format!("screen.samples_per_pixel={rays}");
        let more = ["observer.inclination_deg=80", "screen.field_of_view_m=11", &rays];
        let base = scene(FACE_ON, &more);
        let scene = asking(&base.to_toml(), r#""A","coverage","motion""#, &[]);
        let seen = picture(&scene, None);
        let [u, v, alpha] = ["motion.u", "motion.v", "A"].map(|name| seen.channel(name).unwrap());
        let longest = u.iter().zip(v).map(|(u, v)| u.hypot(*v)).fold(0.0, f32::max);
        assert!((0.9 * side..=side * (1.0 + 1e-6)).contains(&longest), "{longest}");
        let most = alpha.iter().copied().fold(0.0, f32::max);
        assert!(most == 1.0 && alpha.iter().all(|a| *a <= 1.0), "{most:e}");
    }
}
