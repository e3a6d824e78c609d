//! Pictures of volumes, spots and meshes, whose light is summed along paths of the device.

use super::{decoded, difference, folder, scene, succeed};
use kerrlight_render::image::Picture;
use std::path::Path;

/// Changes of a scene, and how far some channels may be from those of the processor: the sum of the differences by the
/// sum of the values.
type Case = (&'static [&'static str], &'static [(&'static str, f64)]);

/// A camera in place of the observer and the screen.
const CAMERA: [&str; 3] = [
    "observer={time=45.0}",
    "camera={motion=\"keplerian\",radius=20.0,theta_deg=60.0,phi_deg=20.0,field_of_view_deg=60.0}",
    "screen={width=32,height=32}",
];

/// A picture on a device, and what is said of it.
fn picture(folder: &Path, name: &str, changes: &[&str], device: &str) -> (Picture, String) {
    let (path, file) = (scene(name), format!("{device}.exr"));
    let mut words = vec!["render", path.to_str().unwrap(), "-o", &file, "--device", device];
    words.extend(changes.iter().flat_map(|change| ["--set", change]));
    let told = succeed(folder, &words);
    (decoded(&folder.join(&file)), told)
}

/// Renders a scene on both devices. No channel may be off by more than is allowed, and not all of them may be the same:
/// then nothing has come from the device.
fn check(name: &str, changes: &[&str], allowed: &[(&str, f64)]) {
    let Some(folder) = folder() else { return };
    let (cpu, _) = picture(folder.path(), name, changes, "cpu");
    let (gpu, told) = picture(folder.path(), name, changes, "gpu");
    assert!(told.contains("in floats"), "{told}");
    let moves = allowed.iter().any(|(channel, _)| channel.starts_with("motion"));
    assert_eq!(told.contains("on this processor"), moves, "{name} {changes:?}: {told}");
    let mut most = 0.0f64;
    for (channel, allowed) in allowed {
        let apart = difference(&cpu, &gpu, channel);
        println!("{name} {changes:?}: {channel} differs by {apart:.1e}");
        assert!(apart < *allowed, "{name} {changes:?}: {channel} differs by {apart:e}");
        most = most.max(apart);
    }
    assert!(most > 0.0, "{name} {changes:?}: nothing was traced on the device");
}

#[test]
fn code_volumes_are_those_of_the_processor() {
    let places = [("radius", 1e-6), ("azimuth", 2e-6), ("delay", 1e-5)];
    let whole = [&[("intensity", 1e-5), ("redshift", 5e-7)], &places[..]].concat();
    let small = ["screen.width=40", "screen.height=40"];
    check("volume.toml", &small, &whole);
    check(
        "volume.toml",
        &[&regular()[..], &["effects.slow_light=false"]].concat(),
        &[("intensity", 3e-5)],
    );
    // Errors of the scene's own tolerance, 1e-4, are larger than those of floats.
    let fine = "tracer.tolerance=1e-7";
    for change in ["observer.radius=100.0", "tracer.integrator=\"taylor-mino\""] {
        check("volume.toml", &[&regular()[..], &[change, fine]].concat(), &[("intensity", 2e-6)]);
    }
    let seen = [&CAMERA[..], &[fine]].concat();
    check("volume.toml", &seen, &[("intensity", 2e-6), ("redshift", 1e-7)]);
}

/// A picture of few rays.
fn regular() -> [&'static str; 3] {
    ["screen.width=32", "screen.height=32", "screen.rings=\"regular-grid\""]
}

#[test]
fn code_spots_are_those_of_the_processor() {
    let places = [("radius", 8e-7), ("azimuth", 2e-7), ("delay", 2e-6)];
    let whole = [&[("intensity", 5e-6), ("redshift", 1e-7)], &places[..]].concat();
    check("hot_spots.toml", &["screen.width=40", "screen.height=40"], &whole);
    let cases: [Case; 7] = [
        (&["effects.slow_light=false"], &[("intensity", 5e-6)]),
        (&["effects.redshift=false", "effects.spectral_index="], &[("intensity", 5e-6)]),
        (&["effects.half_orbits=0"], &[("intensity", 5e-6)]),
        (
            &["screen.channels=[\"n0\",\"n1\",\"n2\",\"motion\"]"],
            &[("n0.R", 5e-6), ("n1.R", 5e-6), ("n2.R", 5e-6), ("motion.u", 5e-5)],
        ),
        (
            &["effects.polarization=true", "magnetic_field={vertical=1.0,radial=0.2,toroidal=0.3}"],
            &[("intensity", 5e-6), ("Q", 5e-6), ("U", 5e-6)],
        ),
        (
            &["observer.radius=100.0", "tracer.integrator=\"elliptic\""],
            &[("intensity", 5e-6), ("delay", 2e-6)],
        ),
        (&["observer.inclination_deg=0.0"], &[("intensity", 5e-6)]),
    ];
    for (changes, allowed) in cases {
        check("hot_spots.toml", &[&regular(), changes].concat(), allowed);
    }
    check("hot_spots.toml", &CAMERA, &[("intensity", 5e-6), ("redshift", 1e-7)]);
}

/// A disc and a spot before a sky, a mesh, and a spot in gas that absorbs.
#[test]
fn code_mixed_scenes_are_those_of_the_processor() {
    let wide = ["screen.width=48", "screen.height=27", "screen.samples_per_pixel=1"];
    let light = [("intensity", 5e-7), ("emission.R", 5e-7), ("sky.R", 1e-4), ("coverage", 1e-6)];
    let images = [("n0.R", 1e-6), ("n1.R", 1e-6), ("n2.R", 1e-6), ("motion.u", 5e-6)];
    check("compositing.toml", &wide, &[light, images].concat());
    check("mesh.toml", &wide, &[("intensity", 6e-8), ("redshift", 3e-8), ("radius", 4e-7)]);
    let spot = "spot=[{radius=7.0,phase_deg=30.0,sigma=0.6,peak_emissivity=1.0}]";
    let in_gas = [&regular()[..], &[spot]].concat();
    check("gold2020/test5.toml", &in_gas, &[("intensity", 1e-6), ("optical_depth", 2e-6)]);
}

/// Rays of a film are traced once for all frames.
#[test]
fn code_films_of_spots_are_those_of_the_processor() {
    let Some(folder) = folder() else { return };
    let path = scene("hot_spots.toml");
    let frames = ["cpu", "gpu"].map(|device| {
        let times = ["--frames", "3", "--from", "0", "--to", "30", "-o", device];
        let size = ["--set", "screen.width=24", "--set", "screen.height=24"];
        let words = ["movie", path.to_str().unwrap(), "--device", device];
        succeed(folder.path(), &[&words[..], &times, &size].concat());
        let frame = |k| folder.path().join(device).join(format!("frame_000{k}.exr"));
        [0, 1, 2].map(|k| decoded(&frame(k)))
    });
    for (cpu, gpu) in frames[0].iter().zip(&frames[1]) {
        let apart = difference(cpu, gpu, "intensity");
        println!("a frame of hot_spots.toml: intensity differs by {apart:.1e}");
        assert!(apart > 0.0 && apart < 4e-6, "{apart:e}");
    }
}

#[test]
fn what_stays_on_the_processor_is_said() {
    let Some(folder) = folder() else { return };
    let tiny = ["screen.width=8", "screen.height=6"];
    for (name, change, said) in [
        ("camera_orbit.toml", "effects.ray_bundles=true", "on this processor: ray bundles"),
        ("disc_face_on.toml", "effects.lensing=false", "on this processor: everything"),
        ("hot_spots.toml", "screen.channels=[\"Z\"]", "on this processor: the channel Z"),
        ("hot_spots.toml", "screen.channels=[\"footprint\"]", "the channel footprint"),
        ("volume.toml", "screen.channels=[\"motion\"]", "the channels motion"),
    ] {
        let changes = [&tiny[..], &[change]].concat();
        let (_, told) = picture(folder.path(), name, &changes, "gpu");
        assert!(told.contains(said), "{name} {change}: {told}");
    }
}
