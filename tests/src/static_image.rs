//! `kerrlight fit` of a static image, from a file to a ring; and the experiment that does so with public data.

use crate::eht_data;
use crate::fit::results;
use crate::fit_start::array;
use crate::known_skies::bell;
use crate::support::{
    binary, done, fail, fail_with, message, new_folder, scene_path, sets, succeed, told, words_of,
};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::files;
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::products::{ClosureKind, ClosureSet};
use std::path::Path;

/// Stations, times and errors of a night of M87* with gains of 10 % and random phases.
const SEEN: &str = "observe image.csv --fov-uas 120 --array EHT2017 --source m87 --mjd 57853 --utc 0.5-8 --frames 12 --tint 60 --frequency 229.1 --noise thermal --gain-scan 0.1 --random-phases --seed 3 -o data.uvfits";

/// Fewer draws do not tell an error: four in a row may lie together.
const QUICK: [&str; 5] = [
    "image.pixels=24",
    "image.iterations=400",
    "image.draws=8",
    "strength={values=[10.0,30.0],folds=3}",
    "image.starts=[{gaussian={fwhm_uas=60.0}}]",
];

/// Writes 0.6 Jy with this brightness at places to the east and north of the middle of 120 µas, µas.
fn write_image(folder: &Path, side: usize, light: impl Fn(f64, f64) -> f64) {
    let place = |k: usize| 120.0 * ((k as f64 + 0.5) / side as f64 - 0.5);
    let light = |row: usize, column: usize| light(-place(column), -place(row));
    let all = || (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
    let sum: f64 = all().map(|(row, column)| light(row, column)).sum();
    let line = |row: usize| {
        let cells = (0..side).map(|column| format!("{:e}", 0.6 * light(row, column) / sum));
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    let text: String = (0..side).map(line).collect();
    std::fs::write(folder.join("image.csv"), text).unwrap();
}

/// A ring of 42 µas, 16 µas wide and 0.6 Jy, brightest at 170°, as the array of 2017 sees it.
fn observed(folder: &Path) {
    write_image(folder, 60, |east, north| {
        let turn = east.atan2(north) - 170f64.to_radians();
        bell(east.hypot(north) - 21.0, 16.0) * (1.0 + 0.5 * turn.cos())
    });
    succeed(folder, &words_of(SEEN));
}

fn quick<'a>(words: &[&'a str]) -> Vec<&'a str> {
    [&["fit"], words, &sets(&QUICK)].concat()
}

fn number(found: &serde_json::Value, key: &str) -> f64 {
    found[key].as_f64().unwrap_or_else(|| panic!("{key}: {found}"))
}

/// The ring within three stated errors, with all guesses told; the same bytes when the run is begun again.
#[test]
fn exact_a_ring_is_found_at_once() {
    let path = &new_folder();
    observed(path);
    let output = done(path, &quick(&["--data", "data.uvfits", "-o", "run"]));
    let said = message(&output);
    for sentence in [
        "read: data.uvfits: M87*, recognised by position or name",
        "assumed: image.flux_jy = 0.6: published for what is compact",
        "assumed: instrument.gains.table = \"EHT2017\"",
        "assumed: data.visibilities.systematic = 0.01",
    ] {
        assert!(said.contains(sentence), "{sentence}: {said}");
    }
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("The image has a ring of") && told.contains("report.html"), "{told}");
    // RL and LR are noise.
    assert!(!told.contains("polarised") && !path.join("run/polarized.png").exists(), "{told}");
    let run = path.join("run");
    let found = results(&run);
    let (ring, error) =
        (number(&found, "ring_diameter_uas"), number(&found, "ring_diameter_uas_error"));
    assert!((ring - 42.0).abs() < 3.0 * error && error < 3.0, "{ring} ± {error}");
    let turn = number(&found, "ring_position_angle_deg");
    assert!((turn - 170.0).abs() < 20.0, "{turn}");
    for (name, chi2) in found["chi2_per_datum"].as_object().unwrap() {
        assert!((0.5..1.5).contains(&chi2.as_f64().unwrap()), "{name}: {chi2}");
    }
    let pixels = array(&run.join("image.npz"), "recovered.npy");
    assert!((pixels.iter().sum::<f64>() - number(&found, "flux_of_image_jy")).abs() < 1e-5);
    let off = number(&found, "flux_jy") - 0.6;
    assert!(off.abs() < 3.0 * number(&found, "flux_error_jy"), "{off}");
    assert_eq!(array(&run.join("draws.npz"), "draws.npy").len(), 8 * pixels.len());
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    for words in ["What is not concluded", "Held-out frames", "Station gains", "All images"] {
        assert!(page.contains(words), "{words}");
    }
    let first = std::fs::read(run.join("image.npz")).unwrap();
    succeed(path, &["fit", "--resume", "run"]);
    assert_eq!(std::fs::read(run.join("image.npz")).unwrap(), first);
    assert!(succeed(path, &["inspect", "run"]).contains("static image of 24 x 24 pixels"));
    for words in ["Closure phase ", "χ² of amplitudes is the least", "a circle is the beam"] {
        assert!(page.contains(words), "{words}");
    }
    let sky = files::read_fits_image(&std::fs::read(run.join("image.fits")).unwrap()).unwrap();
    for (a, b) in sky.i.pixels.iter().zip(&pixels) {
        assert!((a - b).abs() < 1e-6 * pixels.iter().copied().fold(0.0, f64::max));
    }
    // What it has found can be observed again.
    let again =
        SEEN.replace("image.csv --fov-uas 120", "run/image.npz").replace("data.uv", "again.uv");
    succeed(path, &words_of(&again));
}

/// Two bands of a night with gains of their own make one image: all closure phases of both, the ring within three errors, and a
/// table of gains for each. Other sources and frequencies are refused by name.
#[test]
fn exact_two_bands_make_one_image() {
    let path = &new_folder();
    observed(path);
    let low = SEEN.replace("229.1", "227.1").replace("--seed 3 -o data", "--seed 4 -o low");
    succeed(path, &words_of(&low));
    let words = ["--data", "low.uvfits", "data.uvfits", "--model", "image", "-o", "both"];
    let said = told(path, &quick(&words));
    assert!(said.contains("read: low.uvfits: M87*") && said.contains("read: data.uvfits: M87*"));
    let found = results(&path.join("both"));
    let ring = number(&found, "ring_diameter_uas");
    let error = number(&found, "ring_diameter_uas_error");
    assert!((ring - 42.0).abs() < 3.0 * error + 1.0, "{ring} ± {error}");
    let count = |file: &str| {
        let mut seen = files::decode(&std::fs::read(path.join(file)).unwrap()).unwrap().1;
        // Shorter baselines of M87* are dropped.
        seen.rows.retain(|row| row.uv[0].hypot(row.uv[1]) >= 1e8);
        ClosureSet::of(&seen, ClosureKind::Phase, 0.0)
            .iter()
            .map(|s| s.closures.len())
            .sum::<usize>()
    };
    let possible = found["closures"][0]["possible"].as_u64().unwrap() as usize;
    assert_eq!(possible, count("low.uvfits") + count("data.uvfits"));
    for (table, own) in [("gains.csv", "ALMA"), ("gains_2.csv", "ALMA")] {
        let text = std::fs::read_to_string(path.join("both").join(table)).unwrap();
        assert!(text.contains(own) && !text.contains("(2)"), "{table}: {text}");
        assert!(!text.contains("phase"), "phases that nobody solved for: {table}: {text}");
    }
    let page = std::fs::read_to_string(path.join("both/report.html")).unwrap();
    assert!(page.contains("nothing closes across them") && page.contains("ALMA (2)"));
    let other = SEEN.replace("m87 --mjd", "sgra --mjd").replace("-o data", "-o other");
    succeed(path, &words_of(&other));
    let far = SEEN.replace("229.1", "86.0").replace("-o data", "-o far");
    succeed(path, &words_of(&far));
    for (second, says) in [
        ("other.uvfits", "cannot be one image: they observe"),
        ("far.uvfits", "they are of 229.1 and 86.0 GHz"),
        ("data.uvfits", "is given twice"),
    ] {
        let words = ["fit", "--data", "data.uvfits", second, "--model", "image", "-o", "none"];
        fail_with(path, &words, &[says]);
    }
    for words in
        [&["other.uvfits", "data.uvfits"][..], &["low.uvfits", "data.uvfits", "--model", "volume"]]
    {
        let error = fail(path, &[&["fit", "--data"], words, &["-o", "none"]].concat());
        assert!(error.contains("give --model image"), "{error}");
    }
}

#[test]
fn bad_input_of_a_static_image_is_named_and_nothing_is_begun() {
    let path = &new_folder();
    observed(path);
    for (set, says) in [
        ("image.pixels=4", "image.pixels = 4 is not allowed: 8 to 512"),
        ("image.starts=[]", "length of image.starts = 0 is not allowed"),
        ("hole.spin=0.5", "unknown field `hole`"),
        ("strength.folds=90", "strength.folds = 90 is not allowed: "),
        ("ring.most_radius_uas=90.0", "ring.most_radius_uas = 90 is not allowed"),
        ("data.visibilities.path=nowhere.uvfits", "nowhere.uvfits"),
        ("data.visibilities.path=$KERRLIGHT_EHT_DATA/nowhere.uvfits", "nowhere.uvfits"),
        ("loss=[{data=\"closure-phases\",weight=1.0}]", "image.draws needs a loss of amplitudes"),
        ("loss=[{data=\"light-curve\",weight=1.0}]", "loss 0: data = \"light-curve\" is not for"),
    ] {
        let words = ["fit", "--data", "data.uvfits", "--set", set, "-o", "none"];
        fail_with(path, &words, &[says]);
    }
    let error = fail(path, &["fit", "--data", "data.uvfits", "--samples", "4", "-o", "none"]);
    assert!(error.contains("--samples is for emission"), "{error}");
    succeed(path, &["fit", "--init", "data.uvfits", "-o", "my.toml"]);
    assert!(std::fs::read_to_string(path.join("my.toml")).unwrap().contains("[image]"));
}

/// An experiment whose data are not there ends before it has written anything.
#[test]
fn exact_an_experiment_without_its_data_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, place) in [("m87-2017", "/nowhere"), ("sgra-2017-polarimetry", "")] {
        let mut command = std::process::Command::new(binary());
        command.current_dir(&folder).env("KERRLIGHT_EHT_DATA", place);
        let output = command.args(["compare", name, "--quick", "-o", "out"]).output().unwrap();
        let said = message(&output);
        let says = if place.is_empty() { "KERRLIGHT_EHT_DATA is not set" } else { "is not there" };
        assert!(output.status.code() == Some(2) && said.contains(says), "{said}");
        assert!(!folder.path().join("out").exists());
    }
}

/// The experiment with data of a test in place of the public ones.
#[test]
fn exact_the_experiment_of_m87_has_its_tables() {
    let path = &new_folder();
    observed(path);
    let set = "data.visibilities.path=data.uvfits";
    succeed(path, &["compare", "m87-2017", "--quick", "--set", set, "-o", "out"]);
    let found = results(&path.join("out"));
    let cases = found["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let of = &case["results"];
        let has_draws = case["levels"]["data"] != "closures alone";
        assert_eq!(of["ring_diameter_uas_error"].is_number(), has_draws, "{of}");
        // One Gaussian start, 24 pixels and 120 iterations: too little for closures alone.
        if has_draws {
            let ring = number(of, "ring_diameter_uas");
            assert!((ring - 42.0).abs() < 6.0, "{ring}: {}", case["levels"]);
        } else {
            let phases = number(&of["chi2_per_datum"], "closure phases");
            assert!((0.5..2.0).contains(&phases), "{phases}");
        }
    }
    let page = std::fs::read_to_string(path.join("out/report.html")).unwrap();
    for words in ["Diameter of the ring", "closures alone", "Static images"] {
        assert!(page.contains(words), "{words}");
    }
}

/// Public data: χ² as it is in fits of the image with other noise, and a ring of the published size, bright in the south.
#[test]
#[ignore = "long"]
fn paper_m87_is_a_ring_of_42_microarcseconds() {
    let Some(data) = eht_data::data(eht_data::M87) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = scene_path("fits/m87_image.toml");
    let path = format!("data.visibilities.path={}", data.display());
    succeed(folder.path(), &["fit", &file, "--set", &path, "-o", "run"]);
    let found = results(&folder.path().join("run"));
    for kind in ["amplitudes", "log closure amplitudes", "closure phases"] {
        let chi2 = number(&found["chi2_per_datum"], kind);
        let of_draws = &found["chi2_of_draws"][kind];
        let beyond = (chi2 - number(of_draws, "mean")) / number(of_draws, "deviation");
        assert!((0.75..1.3).contains(&chi2) && beyond.abs() < 2.5, "{kind}: {chi2}, {of_draws}");
    }
    let ring = number(&found, "ring_diameter_uas");
    assert!((38.0..45.0).contains(&ring), "{ring}");
    let turn = number(&found, "ring_position_angle_deg");
    assert!((150.0..200.0).contains(&turn), "{turn}");
}

/// The ring of [`observed`] with 20 % of its light polarised at 30° east of north everywhere; leakage as far as it goes.
fn polarized(folder: &Path, to: &str) {
    observed(folder);
    let data = std::fs::read(folder.join("data.uvfits")).unwrap();
    let mut data = files::read_uvfits(&data).unwrap();
    // The cross hands of an image without polarisation are not measured: they get the errors of the parallel ones.
    for row in &mut data.rows {
        for k in [2, 3] {
            row.products[k] = Complex64::new(0.0, 0.0);
            row.noise_sigma[k] = row.noise_sigma[0];
        }
    }
    let noise = data.clone();
    add_thermal_noise(&mut data, 8);
    for (row, clean) in data.rows.iter_mut().zip(&noise.rows) {
        let m = Complex64::from_polar(0.2, 60f64.to_radians());
        let light = 0.5 * (clean.products[0] + clean.products[1]);
        for (k, factor) in [(2, m), (3, m.conj())] {
            // The thermal noise of this hand alone.
            row.products[k] += factor * light - clean.products[k];
        }
        row.products[0] = clean.products[0];
        row.products[1] = clean.products[1];
    }
    std::fs::write(folder.join(to), files::write_uvfits(&data).unwrap()).unwrap();
}

/// Fraction and position angle through gains and lost phases, from ratios (a file whose name says that leakage was taken out)
/// and from visibilities beside leakage, with numbers in results and page.
#[test]
fn exact_polarisation_of_a_ring_is_found() {
    let path = &new_folder();
    for (file, kind) in [
        ("night_dtermcal.uvfits", "polarimetric ratios"),
        ("night.uvfits", "polarized visibilities"),
    ] {
        polarized(path, file);
        let strength = "polarization.strength={values=[1.0,10.0],folds=3}";
        let words = quick(&["--data", file, "--set", strength, "-o", kind]);
        let told = succeed(path, &words);
        assert!(told.contains("of the light is linearly polarised"), "{told}");
        let found = results(&path.join(kind));
        for (key, truth) in [("net_fraction", 0.2), ("mean_fraction", 0.2), ("net_evpa_deg", 30.0)]
        {
            let value = number(&found, &format!("polarization_{key}"));
            let error = number(&found, &format!("polarization_{key}_error"));
            assert!(
                (value - truth).abs() < 5.0 * error + 0.02 * truth,
                "{kind} {key}: {value} ± {error}"
            );
            assert!(error < 0.2 * truth, "{kind} {key}: {value} ± {error}");
        }
        let chi2 = number(&found["chi2_per_datum"], kind);
        assert!((0.7..1.3).contains(&chi2), "{kind}: {chi2}");
        assert_eq!(found["leakage"].is_object(), kind == "polarized visibilities");
        assert!(path.join(kind).join("polarized.png").is_file());
        let all = array(&path.join(kind).join("image.npz"), "recovered_q.npy");
        assert_eq!(all.len(), 24 * 24);
        let page = std::fs::read_to_string(path.join(kind).join("report.html")).unwrap();
        assert!(
            page.contains("net polarisation") && page.contains("Held-out frames: polarisation")
        );
    }
    for (set, says) in [
        ("polarization.beam_uas=0.0", "polarization.beam_uas = 0 is not allowed"),
        ("polarization.data=\"amplitudes\"", "polarization.data = \"amplitudes\" is not for"),
        ("polarization.strength.folds=90", "polarization.strength.folds = 90 is not allowed: "),
        ("data.visibilities.utc_h=[30.0,31.0]", "data.visibilities.utc_h = [30, 31] leaves no"),
    ] {
        fail_with(path, &["fit", "--data", "night.uvfits", "--set", set, "-o", "none"], &[says]);
    }
}

/// The best 100 minutes of April 7: resolved and net polarisation as published (24 to 28 %; EHT Collaboration 2024, ApJL
/// 964, L25 and L26), within twice the stated errors, and ratios that are explained.
#[test]
#[ignore = "long"]
fn paper_sgr_a_is_polarised_by_a_quarter() {
    let Some(data) = eht_data::data(eht_data::SGRA_POLARIZED) else { return };
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_path("fits/sgra_polarized_image.toml");
    let set = format!("data.visibilities.path={}", data.display());
    succeed(folder.path(), &["fit", &scene, "--set", &set, "-o", "run"]);
    let found = results(&folder.path().join("run"));
    let mean = number(&found, "polarization_mean_fraction");
    let error = number(&found, "polarization_mean_fraction_error");
    assert!((mean - 0.26).abs() < 2.0 * error + 0.02 && error < 0.06, "{mean} ± {error}");
    let chi2 = number(&found["chi2_per_datum"], "polarimetric ratios");
    assert!((0.5..1.1).contains(&chi2), "{chi2}");
}
