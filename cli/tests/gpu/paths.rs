//! Pictures of volumes, spots and meshes, whose light is summed along paths of the device.

use super::{decoded, difference, folder, scene, succeed};
use kerrlight_tomo::image::Picture;
use std::path::Path;

/// A scene with changes, and how far each of some channels may be from that of the processor: the sum of the
/// differences by the sum of the values.
struct Case {
    scene: &'static str,
    changes: &'static [&'static str],
    allowed: &'static [(&'static str, f64)],
}

const CAMERA: &str =
    "camera={motion=\"keplerian\",radius=20.0,theta_deg=60.0,phi_deg=20.0,field_of_view_deg=60.0}";
const SEEN_BY_CAMERA: [&str; 2] = ["observer={time=45.0}", CAMERA];

/// Pictures on both devices.
fn pictures(folder: &Path, name: &str, changes: &[&str]) -> [Picture; 2] {
    let path = scene(name);
    ["cpu", "gpu"].map(|device| {
        let file = format!("{device}.exr");
        let mut words = vec!["render", path.to_str().unwrap(), "-o", &file, "--device", device];
        words.extend(changes.iter().flat_map(|change| ["--set", change]));
        let told = succeed(folder, &words);
        assert!(device == "cpu" || told.contains("in floats"), "{told}");
        assert!(!told.contains("on this processor"), "{name} {changes:?}: {told}");
        decoded(&folder.join(&file))
    })
}

fn check(Case { scene, changes, allowed }: &Case) {
    let Some(folder) = folder() else { return };
    let [cpu, gpu] = pictures(folder.path(), scene, changes);
    for (channel, allowed) in *allowed {
        let apart = difference(&cpu, &gpu, channel);
        println!("{scene} {changes:?}: {channel} differs by {apart:.1e}");
        assert!(apart < *allowed, "{scene} {changes:?}: {channel} differs by {apart:e}");
    }
    let same = |(channel, _): &&(&str, f64)| difference(&cpu, &gpu, channel) == 0.0;
    assert!(!allowed.iter().all(|case| same(&case)), "nothing was traced on the device");
}

#[test]
fn code_volumes_are_those_of_the_processor() {
    let small = ["screen.width=40", "screen.height=40"];
    let cases: [(&'static [&'static str], &'static [(&'static str, f64)]); 5] = [
        (
            &[],
            &[
                ("intensity", 1.0),
                ("redshift", 1.0),
                ("radius", 1.0),
                ("azimuth", 1.0),
                ("delay", 1.0),
            ],
        ),
        (&["effects.slow_light=false"], &[("intensity", 1.0)]),
        (&["observer.radius=100.0"], &[("intensity", 1.0)]),
        (&["tracer.integrator=\"taylor-mino\"", "tracer.tolerance=1e-7"], &[("intensity", 1.0)]),
        (
            &[SEEN_BY_CAMERA[0], SEEN_BY_CAMERA[1], "screen={width=40,height=40}"],
            &[("intensity", 1.0), ("redshift", 1.0)],
        ),
    ];
    for (changes, allowed) in cases {
        let changes = if changes.iter().any(|c| c.starts_with("screen")) {
            changes.to_vec()
        } else {
            [&small[..], changes].concat()
        };
        check(&Case { scene: "volume.toml", changes: &changes, allowed });
    }
}

#[test]
fn code_spots_are_those_of_the_processor() {
    let small = ["screen.width=40", "screen.height=40"];
    let cases: [(&'static [&'static str], &'static [(&'static str, f64)]); 9] = [
        (
            &[],
            &[
                ("intensity", 1.0),
                ("redshift", 1.0),
                ("radius", 1.0),
                ("azimuth", 1.0),
                ("delay", 1.0),
            ],
        ),
        (&["effects.slow_light=false"], &[("intensity", 1.0)]),
        (&["effects.redshift=false", "effects.spectral_index="], &[("intensity", 1.0)]),
        (&["effects.half_orbits=1"], &[("intensity", 1.0)]),
        (
            &[
                "effects.half_orbits=0",
                "screen.channels=[\"default\",\"n0\",\"n1\",\"Z\",\"motion\",\"id\"]",
            ],
            &[("intensity", 1.0)],
        ),
        (
            &["screen.channels=[\"default\",\"n0\",\"n1\",\"n2\",\"Z\",\"motion\",\"id\"]"],
            &[
                ("intensity", 1.0),
                ("n0.R", 1.0),
                ("n1.R", 1.0),
                ("n2.R", 1.0),
                ("Z", 1.0),
                ("motion.u", 1.0),
                ("id", 1.0),
            ],
        ),
        (
            &["effects.polarization=true", "magnetic_field={vertical=1.0,radial=0.2,toroidal=0.3}"],
            &[("intensity", 1.0), ("Q", 1.0), ("U", 1.0)],
        ),
        (&["observer.radius=100.0", "tracer.integrator=\"elliptic\""], &[("intensity", 1.0)]),
        (
            &[SEEN_BY_CAMERA[0], SEEN_BY_CAMERA[1], "screen={width=40,height=40}"],
            &[("intensity", 1.0), ("redshift", 1.0)],
        ),
    ];
    for (changes, allowed) in cases {
        let changes = if changes.iter().any(|c| c.starts_with("screen={")) {
            changes.to_vec()
        } else {
            [&small[..], changes].concat()
        };
        check(&Case { scene: "hot_spots.toml", changes: &changes, allowed });
    }
}

#[test]
fn code_mixed_scenes_are_those_of_the_processor() {
    for (scene, changes, allowed) in [
        (
            "compositing.toml",
            &["screen.width=48", "screen.height=27", "screen.samples_per_pixel=1"][..],
            &[
                ("intensity", 1.0),
                ("A", 1.0),
                ("Z", 1.0),
                ("coverage", 1.0),
                ("id", 1.0),
                ("emission.R", 1.0),
                ("sky.R", 1.0),
                ("n0.R", 1.0),
                ("n1.R", 1.0),
                ("n2.R", 1.0),
                ("st.u", 1.0),
                ("footprint", 1.0),
                ("motion.u", 1.0),
            ][..],
        ),
        (
            "mesh.toml",
            &["screen.width=48", "screen.height=30", "screen.samples_per_pixel=1"],
            &[("intensity", 1.0), ("redshift", 1.0), ("radius", 1.0)],
        ),
        (
            "gold2020/test5.toml",
            &[
                "screen.width=32",
                "spot=[{radius=7.0,phase_deg=30.0,sigma=0.6,peak_emissivity=1.0}]",
            ],
            &[("intensity", 1.0), ("optical_depth", 1.0)],
        ),
    ] {
        check(&Case { scene, changes, allowed });
    }
}
