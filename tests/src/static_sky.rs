//! Static fits of public EHT data.

use crate::eht_data::{M87, SGRA, data};
use crate::fit::results;
use crate::fit_start::array;
use crate::support::{scene_path, succeed};
use std::path::Path;

/// χ² per datum of amplitudes, closure phases and log closure amplitudes.
fn fitted(folder: &Path, scene: &str, data: &Path) -> [f64; 3] {
    let scene = scene_path(&format!("fits/{scene}"));
    let path = format!("data.visibilities.path={}", data.display());
    succeed(folder, &["fit", &scene, "--set", &path, "-o", "run"]);
    let found = results(&folder.join("run"));
    assert_eq!(found["verdict"]["outcome"], "explained", "{found}");
    ["amplitudes", "closure phases", "log closure amplitudes"]
        .map(|name| found["chi2_per_datum"][name].as_f64().unwrap())
}

/// Mean diameter of the ring in µas: twice the distance from the centre at which the first frame is brightest, over
/// directions.
fn diameter(run: &Path) -> f64 {
    let movie = run.join("movie.npz");
    let (pixels, field) = (array(&movie, "recovered.npy"), array(&movie, "field_uas.npy")[0]);
    let side = 40;
    let at = |x: f64, y: f64| {
        let [i, j] = [y, x].map(|c| (c.floor() as usize).min(side - 2));
        let (a, b) = (y - i as f64, x - j as f64);
        let row = |i: usize| pixels[i * side + j] * (1.0 - b) + pixels[i * side + j + 1] * b;
        row(i) * (1.0 - a) + row(i + 1) * a
    };
    let middle = 0.5 * (side - 1) as f64;
    let peak = |direction: i32| {
        let (sin, cos) = (f64::from(direction) * 5.0).to_radians().sin_cos();
        let light = |r: f64| at(middle + r * cos, middle + r * sin);
        let radii = (40..180).map(|k| 0.1 * f64::from(k));
        radii.max_by(|a, b| light(*a).total_cmp(&light(*b))).unwrap()
    };
    2.0 * (0..72).map(peak).sum::<f64>() / 72.0 * field / side as f64
}

#[test]
fn code_m87_is_a_ring_that_explains_all_its_data() {
    let Some(data) = data(M87) else { return };
    let folder = tempfile::tempdir().unwrap();
    let chi2 = fitted(folder.path(), "m87_static.toml", &data);
    assert!(chi2.iter().all(|chi2| (0.9..1.3).contains(chi2)), "{chi2:?}");
    let ring = diameter(&folder.path().join("run"));
    assert!((38.0..45.0).contains(&ring), "{ring} µas");
}

#[test]
fn code_sgra_is_explained_with_variability_in_its_errors() {
    let Some(data) = data(SGRA) else { return };
    let folder = tempfile::tempdir().unwrap();
    let chi2 = fitted(folder.path(), "sgra_static.toml", &data);
    assert!(chi2.iter().all(|chi2| (0.8..2.0).contains(chi2)), "{chi2:?}");
}
