//! Files of data as others write them: visibilities of every kind that the EHT has published, arrays,
//! pictures of the sky, empty files; and where paths of settings start.

use crate::eht_data;
use crate::fit::results;
use crate::support::{
    fail, fail_with, folder_with, kerrlight, message, new_folder, root, scene_path, sets, succeed,
    told,
};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::array::built_in;
use kerrlight_vlbi::earth::{Frame, SourcePosition, Ut1};
use kerrlight_vlbi::files::{self, EhtTable};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::schedule::{Clock, Schedule, Setup, observe};
use std::path::Path;

/// Keys of the smallest fit of visibilities.
const SMALL: [&str; 5] = [
    "screen.pixels=12",
    "training.steps=2",
    "training.batch=\"all\"",
    "output.nodes=16",
    "data.visibilities.average_s=600.0",
];

/// Fits a file for two steps; what went wrong, if something did.
fn fit(folder: &Path, scene: &str, data: &Path, out: &str) -> Result<(), String> {
    let scene = scene_path(&format!("fits/{scene}"));
    let path = format!("data.visibilities.path={}", data.display());
    let words = ["fit", &scene, "-o", out, "--set", &path];
    let output = kerrlight(folder, &[&words[..], &sets(&SMALL)].concat());
    if !output.status.success() {
        return Err(message(&output));
    }
    let found = results(&folder.join(out));
    let chi2 = found["chi2_per_datum"].as_object().unwrap();
    let is_number = |value: &serde_json::Value| value.as_f64().is_some_and(|x| x > 0.0);
    if chi2.len() == 2 && chi2.values().all(is_number) { Ok(()) } else { Err(format!("{chi2:?}")) }
}

/// Every public file that is at hand, UVFITS and tables, as it is.
#[test]
fn exact_public_files_are_fitted_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    for (k, path) in eht_data::all(&["uvfits", "txt", "csv"]).into_iter().enumerate() {
        let is_m87 = path.to_string_lossy().contains("M87");
        let scene = if is_m87 { "m87_visibilities.toml" } else { "sgra_visibilities.toml" };
        let result = fit(folder.path(), scene, &path, &format!("run{k}"));
        assert_eq!(result, Ok(()), "{}", path.display());
    }
}

/// Three scans of five stations (JCMT among them), 12 s apart from each other in time, full polarisation.
fn measured() -> Observation {
    let mut array = built_in("EHT2017").unwrap();
    array.stations.retain(|s| ["ALMA", "APEX", "SMA", "JCMT", "LMT"].contains(&s.name.as_str()));
    let schedule =
        Schedule { mjd: 57850, clock: Clock::Utc, start_h: 11.0, stop_h: 12.0, scans: 3 };
    let setup = Setup {
        frequency_hz: 229e9,
        bandwidth_hz: 1.856e9,
        integration_s: 10.0,
        elevation_deg: [5.0, 85.0],
        ut1: Ut1::Table,
        frame: Frame::Catalogue,
    };
    let mut data = observe(&array, SourcePosition::SGR_A, &schedule, &setup).unwrap();
    data.source = "SGRA".to_owned();
    for (k, row) in data.rows.iter_mut().enumerate() {
        let phase = (k as f64).sin();
        row.products = [0.8, 0.8, 0.05, 0.04].map(|size| Complex64::from_polar(size, phase));
    }
    assert!(data.rows.len() >= 18, "{}", data.rows.len());
    data
}

/// The bytes of an UVFITS file, every group's four (real, imaginary, weight) changed.
fn altered(data: &Observation, change: &dyn Fn(usize, &mut [[f32; 3]; 4])) -> Vec<u8> {
    let mut bytes = files::write_uvfits(data).unwrap();
    let card = |bytes: &[u8], key: &str| {
        let line = bytes.chunks(80).find(|line| line.starts_with(key.as_bytes())).unwrap();
        let text = String::from_utf8_lossy(&line[10..]).into_owned();
        text.split('/').next().unwrap().trim().parse::<usize>().unwrap()
    };
    let (groups, parameters) = (card(&bytes, "GCOUNT"), card(&bytes, "PCOUNT"));
    let end = bytes.chunks(80).position(|line| line.starts_with(b"END ")).unwrap();
    let start = ((end + 1) * 80).next_multiple_of(2880);
    let size = 4 * (parameters + 12);
    for (k, group) in bytes[start..start + groups * size].chunks_mut(size).enumerate() {
        let cells = &mut group[4 * parameters..];
        let number = |at: usize| f32::from_be_bytes(cells[4 * at..4 * at + 4].try_into().unwrap());
        let mut products: [[f32; 3]; 4] =
            core::array::from_fn(|p| core::array::from_fn(|c| number(3 * p + c)));
        change(k, &mut products);
        for (at, value) in products.iter().flatten().enumerate() {
            cells[4 * at..4 * at + 4].copy_from_slice(&value.to_be_bytes());
        }
    }
    bytes
}

const NONE: [f32; 3] = [0.0, 0.0, 0.0];
const PLACEHOLDER: [f32; 3] = [0.0, 0.0, f32::INFINITY];
const NAN: [f32; 3] = [f32::NAN, f32::NAN, 0.0];

/// Change of the four products of a row, whose number is given.
type Change<'a> = Box<dyn Fn(usize, &mut [[f32; 3]; 4]) + 'a>;

/// Returns the changes of files: data that are missing or marked in files of the releases, their
/// pipelines and the programs that flag them.
fn changes(of_jcmt: &[bool]) -> Vec<(&'static str, Change<'_>)> {
    vec![
        ("full polarisation", Box::new(|_, _| ())),
        ("no cross hands", Box::new(|_, p| (p[2], p[3]) = (NONE, NONE))),
        (
            "cross hands with infinite weight",
            Box::new(|_, p| (p[2], p[3]) = (PLACEHOLDER, PLACEHOLDER)),
        ),
        (
            "one hand of JCMT",
            Box::new(|k, p| {
                if of_jcmt[k] {
                    (p[1], p[2]) = (NONE, NONE);
                }
            }),
        ),
        (
            "one hand of JCMT, the other with infinite weight",
            Box::new(|k, p| {
                if of_jcmt[k] {
                    (p[0], p[2], p[3]) = (PLACEHOLDER, PLACEHOLDER, PLACEHOLDER);
                }
            }),
        ),
        (
            "flags as negative weights",
            Box::new(|k, p| {
                if k % 4 == 1 {
                    p.iter_mut().for_each(|product| product[2] *= -1.0);
                }
            }),
        ),
        (
            "flags as NaN of zero weight",
            Box::new(|k, p| {
                if k % 4 == 1 {
                    *p = [NAN; 4];
                }
            }),
        ),
        (
            "rows of nothing but cross hands",
            Box::new(|k, p| {
                if k % 5 == 1 {
                    (p[0], p[1]) = (NAN, NONE);
                }
            }),
        ),
    ]
}

/// Files of all kinds that the releases, their pipelines and the programs that flag them bring, made of
/// one observation, are fitted.
#[test]
#[ignore = "long"]
fn exact_every_kind_of_published_visibilities_is_fitted() {
    let (folder, data) = (tempfile::tempdir().unwrap(), measured());
    let of_jcmt: Vec<bool> =
        data.rows.iter().map(|row| data.names(row).contains(&"JCMT")).collect();
    let cases = changes(&of_jcmt);
    let path = folder.path().join("data.uvfits");
    for (k, (name, change)) in cases.iter().enumerate() {
        std::fs::write(&path, altered(&data, change)).unwrap();
        let result = fit(folder.path(), "sgra_visibilities.toml", &path, &format!("run{k}"));
        assert_eq!(result, Ok(()), "{name}");
    }
    // A hand that counts must have an error.
    let exact = altered(&data, &|_, p| p[0][2] = f32::INFINITY);
    std::fs::write(&path, exact).unwrap();
    let said = fit(folder.path(), "sgra_visibilities.toml", &path, "exact").unwrap_err();
    assert!(said.contains("sigma = 0 Jy is not allowed: above 0"), "{said}");
}

/// A file of one scan; tables, one of them with lines of nan.
#[test]
fn exact_single_scans_and_tables_are_fitted() {
    let (folder, mut data) = (tempfile::tempdir().unwrap(), measured());
    let first = data.rows[0].time_h;
    let of = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        fit(folder.path(), "sgra_visibilities.toml", &path, &format!("run_{name}"))
    };
    let csv = files::to_eht_table(&data, EhtTable::Csv).unwrap();
    assert_eq!(of("data.csv", csv.as_bytes()), Ok(()));
    let mut lines: Vec<String> = csv.lines().map(str::to_owned).collect();
    lines[4] = lines[4].replacen(",0.80000000", ",nan", 1);
    assert!(lines[4].contains("nan"), "{}", lines[4]);
    assert_eq!(of("nan.csv", lines.join("\n").as_bytes()), Ok(()));
    data.rows.retain(|row| row.time_h == first);
    assert_eq!(of("scan.uvfits", &files::write_uvfits(&data).unwrap()), Ok(()));
    data.rows.iter_mut().for_each(|row| row.noise_sigma = [f64::NAN, f64::NAN, 1.0, 1.0]);
    let said = of("cross.uvfits", &files::write_uvfits(&data).unwrap()).unwrap_err();
    assert!(said.contains("there are no visibilities of Stokes I"), "{said}");
}

/// Every kind of file that is read says that it is empty.
#[test]
fn empty_files_are_said_to_be_empty() {
    let path = &new_folder();
    let empty = ["toml", "exr", "csv", "npy", "npz", "fits", "uvfits", "txt", "png", "obj"];
    for extension in empty {
        std::fs::write(path.join(format!("empty.{extension}")), "").unwrap();
    }
    let when =
        ["--source", "sgra", "--mjd", "57850", "--utc", "4-5", "--frames", "2", "--tint", "60"];
    let seen = |input: &'static str| {
        [&["observe", input, "--array", "ngEHT", "-o", "o.uvfits"][..], &when].concat()
    };
    let through = |array: &'static str| [&["uv", array, "-o", "o.csv"][..], &when].concat();
    let sky = scene_path("sky_image.toml");
    let scene = |set: &'static str| vec!["render", &sky, "--set", set, "-o", "o.exr"];
    for (words, name) in [
        (vec!["render", "empty.toml"], "empty.toml"),
        (vec!["render", "empty.exr"], "empty.exr"),
        (vec!["fit", "empty.toml"], "empty.toml"),
        (vec!["compare", "empty.toml"], "empty.toml"),
        (vec!["trace", "--rays", "empty.csv"], "empty.csv"),
        (vec!["convert", "empty.uvfits", "o.csv"], "empty.uvfits"),
        (vec!["inspect", "empty.npz"], "empty.npz"),
        (vec!["inspect", "empty.exr"], "empty.exr"),
        (seen("empty.csv"), "empty.csv"),
        (seen("empty.npy"), "empty.npy"),
        (seen("empty.npz"), "empty.npz"),
        (seen("empty.fits"), "empty.fits"),
        (seen("empty.exr"), "empty.exr"),
        (seen("empty.toml"), "empty.toml"),
        (through("empty.txt"), "empty.txt"),
        (scene("sky.image.path=empty.png"), "empty.png"),
    ] {
        fail_with(path, &words, &[&format!("{name} is empty (0 bytes)")]);
    }
}

/// Paths on the command line start where the user stands, those in a file beside it.
#[test]
fn exact_paths_start_where_they_are_given() {
    let path = &new_folder();
    for name in ["scenes", "skies", "below"] {
        std::fs::create_dir(path.join(name)).unwrap();
    }
    let scene = std::fs::read_to_string(root().join("scenes/sky_image.toml")).unwrap();
    std::fs::write(path.join("scenes/sky.toml"), scene).unwrap();
    std::fs::copy(root().join("scenes/graticule.png"), path.join("skies/sky.png")).unwrap();
    let small = ["--set", "screen.width=8", "--set", "screen.height=6", "-o", "a.exr"];
    let render = |from: &str, scene: &str, set: &str| {
        let words = [&["render", scene, "--set", set][..], &small].concat();
        kerrlight(&path.join(from), &words).status.success()
    };
    assert!(render(".", "scenes/sky.toml", "sky.image.path=skies/sky.png"));
    assert!(render("below", "../scenes/sky.toml", "sky.image.path=../skies/sky.png"));
    assert!(render("skies", "../scenes/sky.toml", "sky={image={path=\"sky.png\",brightness=1.0}}"));
    assert!(!render(".", "scenes/sky.toml", "sky.image.path=../skies/sky.png"));
    std::fs::copy(path.join("skies/sky.png"), path.join("scenes/graticule.png")).unwrap();
    assert!(render(".", "scenes/sky.toml", "screen.samples_per_pixel=1"), "the file's own path");
    let movie = ["movie", "scenes/sky.toml", "--set", "sky.image.path=skies/sky.png"];
    let rest = ["--set", "screen.width=8", "--set", "screen.height=6", "--frames", "1"];
    let rest = [&rest[..], &["--duration", "1", "-o", "frames"]].concat();
    succeed(path, &[&movie[..], &rest].concat());
}

/// Movies, volumes and runs.
#[test]
fn exact_inspect_knows_arrays_and_runs() {
    let path = &new_folder();
    let data = path.join("data.uvfits");
    std::fs::write(&data, files::write_uvfits(&measured()).unwrap()).unwrap();
    assert_eq!(fit(path, "sgra_visibilities.toml", &data, "run"), Ok(()));
    let said = succeed(path, &["inspect", "run"]);
    for part in
        ["run: a fit", "feature-grid", "data.uvfits", "2 of 2", "chi2_per_datum", "volume.npz"]
    {
        assert!(said.contains(part), "{part}: {said}");
    }
    let said = succeed(path, &["inspect", "run/volume.npz"]);
    assert!(said.contains("NPZ, a volume of 16 x 16 x 16 nodes"), "{said}");
    assert!(said.contains("[-10.0, -10.0, -10.0]"), "{said}");
    let said = succeed(path, &["inspect", "run/movie.npz"]);
    assert!(said.contains("frames of 12 x 12 pixels") && said.contains("time"), "{said}");
    std::fs::remove_file(path.join("run/results.json")).unwrap();
    assert!(succeed(path, &["inspect", "run"]).contains("none yet"));
    assert!(fail(path, &["inspect", "."]).contains("folder without fit.toml"));
    std::fs::write(path.join("cut.npy"), b"\x93NUMPY\x01\x00").unwrap();
    assert!(fail(path, &["inspect", "cut.npy"]).contains("cut.npy"));
}

/// Values and ranges in the words of the keys.
#[test]
fn messages_tell_values() {
    let path = &new_folder();
    let scene = scene_path("hot_spots.toml");
    let film = |rest: &[&'static str]| {
        let words = [&["movie", &scene, "-o", "frames"][..], rest].concat();
        fail(path, &words)
    };
    let said = film(&["--frames", "3", "--from", "20", "--to", "5min"]);
    assert!(said.contains("--to 5min is not allowed: later than --from 20M"), "{said}");
    assert!(film(&["--frames", "1", "--from", "1", "--to", "2"]).contains("--frames 1"));
    assert!(film(&["--frames", "3", "--duration=-2h"]).contains("--duration -2h"));
    std::fs::write(path.join("image.csv"), "1,2\n3,4\n").unwrap();
    let seen = ["observe", "image.csv", "--fov-uas", "3e12", "--array", "ngEHT", "-o", "o.uvfits"];
    let when =
        ["--source", "sgra", "--mjd", "57850", "--utc", "4-5", "--frames", "2", "--tint", "60"];
    let said = fail(path, &[&seen[..], &when].concat());
    assert!(
        said.contains("field of view = 3000000000000 is not allowed: microarcseconds"),
        "{said}"
    );
    let said = fail(path, &["trace", "--rays", "rays.csv", "-o", "out.txt"]);
    assert!(said.contains("out.txt must end in .csv or .npz, not in .txt"), "{said}");
}

/// Nights go over midnight.
#[test]
fn exact_flags_over_midnight() {
    let folder = folder_with("data.uvfits", files::write_uvfits(&measured()).unwrap());
    let path = folder.path();
    let convert =
        |interval: &'static str| ["convert", "data.uvfits", "a.csv", "--flag-utc", interval];
    let all = measured().rows.len();
    let third = measured().rows.iter().filter(|row| row.time_h < 11.1).count();
    let said = told(path, &convert("20-11.1"));
    assert!(said.contains(&format!("{} rows, {third} flagged", all - third)), "{said}");
    let said = told(path, &convert("20-10"));
    assert!(said.contains("--flag-utc 20-10: no visibility lies in it"), "{said}");
    fail_with(path, &convert("30-20"), &["30-20 is not allowed"]);
}
