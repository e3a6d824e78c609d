//! Observing from the command line, against eht-imaging 1.3.2 (the recipe is
//! tests/reference/ehtim_visibilities.py) and against itself.

use crate::support::{fail, new_folder, root, succeed, words_of};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::files;
use kerrlight_vlbi::observation::{Observation, Row};
use kerrlight_vlbi::products::{ClosureKind, ClosureSet};
use std::path::Path;

const WHEN: [&str; 10] =
    ["--source", "sgra", "--mjd", "57850", "--utc", "4.0-15.5", "--frames", "128", "--tint", "60"];

/// The image of the recipe in Jy/pixel, rows from the north.
fn pixel(row: i32, column: i32) -> f64 {
    let (x, y) = ((f64::from(column) - 31.5) / 31.5, (f64::from(row) - 31.5) / 31.5);
    let ring = (-((x.hypot(y) - 0.4) / 0.1).powi(2)).exp();
    let waves = 0.01 * f64::from((7 * row + 3 * column) % 5);
    (ring * (1.0 + 0.5 * x - 0.3 * y) + waves) / 150.0
}

/// The image as a grid.
fn write_image(folder: &Path) {
    let mut text = "# Jy/pixel\n".to_owned();
    for row in 0..64 {
        let cells: Vec<String> = (0..64).map(|column| pixel(row, column).to_string()).collect();
        text += &(cells.join(",") + "\n");
    }
    std::fs::write(folder.join("image.csv"), text).unwrap();
}

/// The image with Q = 0.1 I and U = −0.2 I everywhere, as eht-imaging's text.
fn write_polarized_image(folder: &Path) {
    let mut text =
        "# SRC: SgrA\n# FOVX: 64 pix 0.000160 as\n# FOVY: 64 pix 0.000160 as\n".to_owned();
    for (row, column) in (0..64).flat_map(|row| (0..64).map(move |column| (row, column))) {
        let [x, y] = [column, row].map(|k| (31.5 - f64::from(k)) * 2.5e-6);
        let i = pixel(row, column);
        text += &format!("{x:.10} {y:.10} {i} {} {}\n", 0.1 * i, -0.2 * i);
    }
    std::fs::write(folder.join("image.txt"), text).unwrap();
}

fn observe(folder: &Path, array: &str, output: &str, more: &[&str]) {
    let start = ["observe", "image.csv", "--fov-uas", "160", "--array", array, "-o", output];
    succeed(folder, &[&start[..], &WHEN[..], more].concat());
}

fn read(folder: &Path, name: &str) -> Observation {
    files::decode(&std::fs::read(folder.join(name)).unwrap()).unwrap().1
}

/// The row of a baseline at a time, with the stations in this order: (u, v), V, σ.
fn find(data: &Observation, time_h: f64, pair: [&str; 2]) -> ([f64; 2], Complex64, f64) {
    let rows = data.stokes_i().filter(|(row, _)| (row.time_h - time_h).abs() < 1e-6);
    for (row, i) in rows {
        let names = data.names(row);
        if names == pair {
            return (row.uv, i.visibility, i.noise_sigma);
        }
        if names == [pair[1], pair[0]] {
            return (row.uv.map(|x| -x), i.visibility.conj(), i.noise_sigma);
        }
    }
    panic!("no {pair:?} at {time_h}");
}

/// (u, v) to 1e-6 of the longest baseline is requested; both codes agree to 1e-10.
#[test]
fn code_ehtim_visibilities() {
    let folder = tempfile::tempdir().unwrap();
    write_image(folder.path());
    let reference = root().join("tests/reference/ehtim_visibilities.csv");
    let reference = std::fs::read_to_string(reference).unwrap();
    for array in ["EHT2017", "ngEHT"] {
        observe(folder.path(), array, "data.csv", &[]);
        let data = read(folder.path(), "data.csv");
        let mut seen = 0;
        for line in reference.lines().filter(|line| line.starts_with(array)) {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |k: usize| cells[k].parse::<f64>().unwrap();
            assert_eq!(data.rows.len() as f64, number(1), "{array}");
            let (uv, v, sigma) = find(&data, number(2), [cells[3], cells[4]]);
            assert!((uv[0] - number(5)).hypot(uv[1] - number(6)) < 1.0, "{line}: {uv:?}");
            assert!((v - Complex64::new(number(7), number(8))).norm() < 1e-9, "{line}: {v}");
            assert!((sigma / number(9) - 1.0).abs() < 1e-12, "{line}: {sigma}");
            seen += 1;
        }
        assert!(seen > 80, "{array}: {seen}");
    }
}

#[test]
fn code_ehtim_closure_phases() {
    let folder = tempfile::tempdir().unwrap();
    write_image(folder.path());
    observe(folder.path(), "EHT2017", "data.uvfits", &[]);
    observe(folder.path(), "EHT2017", "data.csv", &[]);
    let reference = root().join("tests/reference/ehtim_closure_phases.csv");
    let reference = std::fs::read_to_string(reference).unwrap();
    let data = read(folder.path(), "data.csv");
    let mut seen = 0;
    for set in ClosureSet::of(&data, ClosureKind::Phase, 0.0) {
        for closure in &set.closures {
            let names: Vec<&str> = closure
                .stations
                .iter()
                .map(|k| data.stations[usize::from(*k)].name.as_str())
                .collect();
            for line in reference.lines().skip(1) {
                let cells: Vec<&str> = line.split(',').collect();
                let time: f64 = cells[0].parse().unwrap();
                if (time - set.time_h).abs() > 1e-6
                    || !names.iter().all(|n| cells[1..4].contains(n))
                {
                    continue;
                }
                // A turned triangle has the opposite phase.
                let place = |k: usize| cells[1..4].iter().position(|n| *n == names[k]).unwrap();
                let even = (place(1) + 3 - place(0)) % 3 == 1;
                let found = if even { closure.value } else { -closure.value }.to_degrees();
                let expected: f64 = cells[4].parse().unwrap();
                assert!((found - expected).abs() < 1e-6, "{line}: {found}");
                seen += 1;
            }
        }
    }
    assert!(seen >= 6, "{seen} triangles");
}

/// All formats hold the same data, and noise is that of its seed.
#[test]
fn exact_formats_agree_and_seeds_repeat() {
    let path = &new_folder();
    write_image(path);
    let noise = ["--noise", "thermal", "--seed", "3", "--random-phases", "--gain-scan", "0.1"];
    for name in ["a.csv", "b.csv", "a.uvfits", "a.txt"] {
        observe(path, "EHT2017", name, &noise);
    }
    let bytes = |name: &str| std::fs::read(path.join(name)).unwrap();
    assert!(bytes("a.csv") == bytes("b.csv"));
    let csv = read(path, "a.csv");
    for name in ["a.uvfits", "a.txt"] {
        let other = read(path, name);
        for (row, i) in csv.stokes_i() {
            let (uv, v, sigma) = find(&other, row.time_h, csv.names(row));
            assert!((uv[0] - row.uv[0]).hypot(uv[1] - row.uv[1]) < 2e3, "{name}");
            assert!((v - i.visibility).norm() < 3e-7 && (sigma / i.noise_sigma - 1.0).abs() < 1e-6);
        }
    }
    let history = String::from_utf8_lossy(&bytes("a.uvfits")).into_owned();
    assert!(history.contains("HISTORY  noise Thermal, seed 3"));
    // Through the text and back into UVFITS: what is single precision already stays to the bit.
    succeed(path, &["convert", "a.uvfits", "c.txt"]);
    succeed(path, &["convert", "c.txt", "c.uvfits"]);
    let groups =
        |name: &str| read(path, name).rows.iter().map(|row| row.products).collect::<Vec<_>>();
    for (a, c) in groups("a.uvfits").iter().zip(groups("c.uvfits")) {
        assert!(a.iter().zip(c).all(|(a, c)| (a - c).norm() <= 1e-7 * a.norm()), "{a:?} {c:?}");
    }
}

#[test]
fn exact_convert_flags_and_averages() {
    let path = &new_folder();
    write_image(path);
    observe(path, "EHT2017", "a.uvfits", &[]);
    let flags =
        ["--flag-station", "SPT", "--flag-utc", "4-6", "--uv-min", "1e8", "--uv-max", "8e9"];
    succeed(path, &[&["convert", "a.uvfits", "b.uvfits"][..], &flags[..]].concat());
    let [a, b] = ["a.uvfits", "b.uvfits"].map(|name| read(path, name));
    let stays = |of: &Observation, row: &Row| {
        let length = row.uv[0].hypot(row.uv[1]);
        !of.names(row).contains(&"SPT") && row.time_h > 6.0 && (1e8..8e9).contains(&length)
    };
    assert!(b.rows.iter().all(|row| stays(&b, row)));
    let expected = a.rows.iter().filter(|row| stays(&a, row)).count();
    assert!(0 < expected && expected < a.rows.len() && b.rows.len() == expected, "{expected}");
    succeed(path, &["convert", "b.uvfits", "c.txt", "--average", "3600", "--stokes-i"]);
    let c = read(path, "c.txt");
    assert!(c.rows.len() * 5 < b.rows.len() && c.rows.len() * 14 > b.rows.len());
    let tables = succeed(path, &["inspect", "c.txt"]);
    assert!(tables.contains("eht-imaging text") && tables.contains("SPT"), "{tables}");
}

/// Q and U of the input are in RL and LR; without them RL and LR are not measured, and all else is the same.
#[test]
fn exact_cross_hands_are_those_of_the_input() {
    let path = &new_folder();
    write_image(path);
    write_polarized_image(path);
    observe(path, "EHT2017", "plain.txt", &[]);
    let start = ["observe", "image.txt", "--array", "EHT2017", "-o", "polarized.txt"];
    succeed(path, &[&start[..], &WHEN[..]].concat());
    let [plain, polarized] = ["plain.txt", "polarized.txt"].map(|name| read(path, name));
    assert!(plain.rows.len() > 1000 && plain.rows.len() == polarized.rows.len());
    for (a, b) in plain.rows.iter().zip(&polarized.rows) {
        assert!(a.product(2).is_none() && a.product(3).is_none());
        let i = b.products[0];
        assert!((a.products[0] - i).norm() < 1e-9 && (b.products[1] - i).norm() < 1e-9);
        let (rl, lr) = (Complex64::new(0.1, -0.2) * i, Complex64::new(0.1, 0.2) * i);
        assert!((b.products[2] - rl).norm() < 1e-9 && (b.products[3] - lr).norm() < 1e-9);
        assert!(b.noise_sigma.iter().all(|sigma| *sigma > 0.0));
    }
}

/// How simulated data came about is in files of every kind: what was not scattered is fitted as it is. Averages by the clock do not
/// depend on the precision of times, nor do frames on the order in which their files are named.
#[test]
fn exact_files_of_every_kind_tell_the_same() {
    let path = &new_folder();
    write_image(path);
    let kinds = [("a.uvfits", &[][..]), ("a.txt", &[]), ("a.csv", &["--comments"])];
    for (name, more) in kinds {
        let more = [more, &["--noise", "thermal", "--seed", "3"]].concat();
        let seen = ["observe", "image.csv", "--fov-uas", "160", "-o", name];
        let when = "--array EHT2017 --source sgra --mjd 57850 --utc 10-12 --frames 120 --tint 60";
        succeed(path, &[&seen[..], &words_of(when), &more].concat());
        let starter = format!("{name}.toml");
        succeed(path, &["fit", "--init", name, "--model", "volume", "-o", &starter]);
        let text = std::fs::read_to_string(path.join(&starter)).unwrap();
        assert!(!text.contains("scattering = \"sgra\""), "{name}: {text}");
        let mean = format!("mean_{name}.csv");
        succeed(path, &["convert", name, &mean, "--average", "300"]);
        let times: std::collections::BTreeSet<u64> =
            read(path, &mean).rows.iter().map(|row| row.time_h.to_bits()).collect();
        assert_eq!(times.len(), 24, "{name}");
    }
    let pixel = |k: usize| std::fs::write(path.join(format!("f_{k}.csv")), format!("{k}\n"));
    (1..=3).chain([10]).for_each(|k| pixel(k).unwrap());
    let shell = ["f_1.csv", "f_10.csv", "f_2.csv", "f_3.csv"];
    let seen = "--fov-uas 1 --array EHT2017 --source sgra --mjd 57850 --utc 12-13 --frames 4 --tint 60 -o f.csv";
    succeed(path, &[&["observe"], &shell[..], &words_of(seen)].concat());
    let flux = |k: usize| find(&read(path, "f.csv"), 12.0 + k as f64 / 4.0, ["ALMA", "APEX"]).1.re;
    let fluxes: Vec<f64> = (0..4).map(|k| flux(k).round()).collect();
    assert_eq!(fluxes, [1.0, 2.0, 3.0, 10.0]);
}

#[test]
fn exact_uv_writes_table_and_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["-o", "uv.csv", "--plot", "uv.png"];
    succeed(folder.path(), &[&["uv", "EHT2017"][..], &WHEN[..], &more[..]].concat());
    let table = std::fs::read_to_string(folder.path().join("uv.csv")).unwrap();
    assert!(table.starts_with("time_utc_h,t1,t2,u,v\n") && table.lines().count() == 1706);
    let png = image::load_from_memory(&std::fs::read(folder.path().join("uv.png")).unwrap());
    let png = png.unwrap().to_rgb8();
    // Tracks of many colours on white.
    let colors: std::collections::HashSet<_> = png.pixels().map(|p| p.0).collect();
    assert!(png.width() > 500 && colors.len() > 8, "{}", colors.len());
}

/// A small scene with hot spots that has a flux in Jy.
fn write_scene(folder: &Path) {
    let scene = std::fs::read_to_string(root().join("scenes/hot_spots.toml")).unwrap();
    let scene = [
        "screen.width=24",
        "screen.height=24",
        "screen.samples_per_pixel=1",
        "screen.total_flux_jy=2.5",
    ]
    .iter()
    .fold(scene, |text, change| kerrlight_render::scene::apply_override(&text, change).unwrap());
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
}

/// Three scans in half an hour.
const SHORT: &str =
    "--array EHT2017 --source sgra --mjd 57850 --utc 12.0-12.5 --frames 3 --tint 60";

/// ALMA–`other` at scan k of `SHORT`.
fn alma(data: &Observation, k: usize, other: &str) -> Complex64 {
    find(data, 12.0 + k as f64 / 6.0, ["ALMA", other]).1
}

/// Frames of a scene: a movie whose first frame has the flux of the scene, and that moves.
#[test]
fn exact_scene_through_an_array() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let observe = ["observe", "scene.toml", "-o", "scene.csv"];
    succeed(folder.path(), &[&observe, &words_of(SHORT)[..]].concat());
    let data = read(folder.path(), "scene.csv");
    let flux = |k: usize| alma(&data, k, "APEX").norm();
    assert!((flux(0) - 2.5).abs() < 1e-3, "{}", flux(0));
    assert!((1..3).all(|k| (flux(k) - flux(0)).abs() > 1e-5));
}

/// The scene, and a picture of it for each scan in the folder `frames`.
fn write_frames(path: &Path) {
    write_scene(path);
    std::fs::create_dir(path.join("frames")).unwrap();
    let text = std::fs::read_to_string(path.join("scene.toml")).unwrap();
    let scene = kerrlight_render::scene::Scene::parse(&text).unwrap();
    let seconds = scene.hole.seconds().unwrap();
    for k in 0..3 {
        let time = scene.observer.time + f64::from(k) * 600.0 / seconds;
        let (set, name) = (format!("observer.time={time}"), format!("frames/f_{:03}.exr", 9 + k));
        succeed(path, &["render", "scene.toml", "--set", &set, "-o", &name]);
    }
}

/// The same scene rendered to one EXR a scan is the same movie, but that every picture has the flux
/// of the scene; pictures know their times.
#[test]
fn exact_sequences_of_pictures() {
    let path = &new_folder();
    write_frames(path);
    let observe = |inputs: &[&str], more: &[&str], output: &str| {
        let end = ["-o", output];
        succeed(path, &[&["observe"], inputs, &words_of(SHORT), more, &end[..]].concat());
        read(path, output)
    };
    let expected = observe(&["scene.toml"], &[], "scene.csv");
    let found = observe(&["frames"], &[], "a.csv");
    for k in 0..3 {
        for other in ["LMT", "SPT", "SMT"] {
            let shape = |data: &Observation| alma(data, k, other) / alma(data, k, "APEX");
            let (a, b) = (shape(&expected), shape(&found));
            assert!((a - b).norm() < 1e-6, "{k} {other}: {a} {b}");
        }
    }
    let same = |other: Observation| {
        let rows = other.rows.iter().zip(&found.rows);
        other.rows.len() == found.rows.len() && rows.clone().all(|(a, b)| a.products == b.products)
    };
    assert!(same(observe(&["frames/f_%03d.exr"], &["--frame-times", "own"], "b.csv")));
    assert!(same(observe(&["frames/*.exr"], &["--frame-times", "scans"], "b.csv")));
    let each = ["frames/f_009.exr", "frames/f_010.exr", "frames/f_011.exr"];
    std::fs::write(path.join("hours.txt"), "# UTC\n12\n12.166666666666666\n12.333333333333334\n")
        .unwrap();
    assert!(same(observe(&each, &["--frame-times", "hours.txt"], "b.csv")));
    // Two pictures twice as long apart: the scan between sees the mean of both.
    let two = observe(&[each[0], each[2]], &["--frame-times", "own"], "b.csv");
    let alone = [each[0], each[2]].map(|name| alma(&observe(&[name], &[], "b.csv"), 1, "LMT"));
    assert!((alma(&two, 1, "LMT") - (alone[0] + alone[1]) / 2.0).norm() < 1e-12);
    bad_sequences_are_named(path, each);
}

fn bad_sequences_are_named(path: &Path, each: [&str; 3]) {
    let said = |inputs: &[&str], more: &[&str]| {
        fail(path, &[&["observe"], inputs, &words_of(SHORT), more, &["-o", "c.csv"]].concat())
    };
    assert!(said(&each[..2], &[]).contains("--frame-times"));
    assert!(said(&each[..2], &["--frame-times", "own"]).contains("time of a scan = 12.33"));
    assert!(said(&each, &["--frame-times", "12-12.1"]).contains("time of a scan = 12.16"));
    assert!(said(&["frames/f_009.exr"], &["--frame-times", "own"]).contains("is for movies"));
    assert!(said(&["frames/g_%d.exr"], &[]).contains("there are no files g_*.exr"));
    std::fs::remove_file(path.join("frames/f_010.exr")).unwrap();
    assert!(said(&["frames/f_%03d.exr"], &[]).contains("frame is missing"));
}

#[test]
fn bad_input_is_refused_and_nothing_is_written() {
    let path = &new_folder();
    write_image(path);
    let observe = |change: &dyn Fn(&mut Vec<String>)| {
        let start =
            ["observe", "image.csv", "--fov-uas", "160", "--array", "EHT2017", "-o", "a.csv"];
        let mut all: Vec<String> =
            start.iter().chain(&WHEN).map(|argument| (*argument).to_owned()).collect();
        change(&mut all);
        fail(path, &all.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let with = |name: &str, value: &str| {
        let (name, value) = (name.to_owned(), value.to_owned());
        observe(&move |all: &mut Vec<String>| match all
            .iter()
            .position(|argument| *argument == name)
        {
            Some(k) => all[k + 1].clone_from(&value),
            None => all.extend([name.clone(), value.clone()]),
        })
    };
    assert!(with("--array", "nowhere").contains("array nowhere"));
    assert!(with("--source", "25,0").contains("right ascension = 25"));
    assert!(with("--mjd", "7").contains("41317"));
    let unknown = with("--mjd", "45000");
    assert!(unknown.contains("UT1 - UTC at MJD 45000") && unknown.contains("--ut1-utc"));
    assert!(with("--utc", "15-4").contains("stop = 4"));
    assert!(
        with("--tint", "-1").contains("-1") && with("--tint", "0").contains("integration time = 0")
    );
    assert!(with("--fov-uas", "-5").contains("--fov-uas"));
    assert!(with("--noise", "thermal").contains("--seed"));
    assert!(with("--frames", "0").contains("0"));
    assert!(with("-o", "a.doc").contains("must end in .uvfits"));
    assert!(with("-o", "image.csv").contains("is an input"));
    assert!(with("--elevation", "89-90").contains("no two stations"));
    assert!(fail(path, &["inspect", "image.csv"]).contains("image.csv"));
    assert!(fail(path, &["convert", "image.csv", "b.uvfits"]).contains("time_utc_h"));
    assert!(fail(path, &["convert", "nothing.uvfits", "b.uvfits"]).contains("No such file"));
}

/// Baselines that begin one after the other: averages have one time, and close.
#[test]
fn regress_averages_of_staggered_baselines_close() {
    let path = &new_folder();
    let mut text = "time_utc_h,t1,t2,u,v,re,im,sigma\n".to_owned();
    for (k, pair) in ["A,B", "A,C", "A,D", "B,C", "B,D", "C,D"].into_iter().enumerate() {
        for time in 0..5 {
            let hours = 4.0 + (10.0 * f64::from(time) + k as f64) / 3600.0;
            text += &format!("{hours},{pair},1e9,2e9,0.5,0.1,0.01\n");
        }
    }
    std::fs::write(path.join("a.csv"), text).unwrap();
    succeed(path, &["convert", "a.csv", "mean.csv", "--average", "600"]);
    let mean = read(path, "mean.csv");
    assert!(mean.rows.len() == 6 && mean.rows.iter().all(|row| row.time_h == mean.rows[0].time_h));
    let closures = |kind| ClosureSet::of(&mean, kind, 0.0)[0].closures.len();
    assert_eq!([ClosureKind::Phase, ClosureKind::LogAmplitude].map(closures), [3, 2]);
    assert!((mean.rows[0].noise_sigma[0] - 0.01 / 5f64.sqrt()).abs() < 1e-15);
}
