//! The two public nights of Sgr A* with all four products (2017 April 6 and 7), which lie where those of
//! [`crate::eht_data`] do: light curves beside numbers that another program reads, and data that survive being written.

use crate::eht_data::data;
use crate::support::{succeed, told};
use kerrlight_vlbi::files;

const NIGHTS: [&str; 2] = ["096", "097"];

/// Rows of both nights as another program reads them.
const READ: &str = include_str!("../reference/sgra_light_curves.csv");

/// Paths of the two nights; says so where they are missing.
fn nights() -> Option<Vec<std::path::PathBuf>> {
    let name =
        |night| format!("ER6_SGRA_2017_{night}_hi_hops_netcal_LMTcal_10s_ALMArot_dtermcal.uvfits");
    NIGHTS.iter().map(|night| data(&name(night))).collect()
}

/// Sums and differences of products to rounding, of every row of the baseline within a site.
#[test]
fn code_light_curves_are_the_arithmetic_of_the_products() {
    let Some(paths) = nights() else { return };
    let here = tempfile::tempdir().unwrap();
    for (night, (path, count)) in paths.iter().zip([470, 784]).enumerate() {
        let file = path.to_str().unwrap();
        succeed(here.path(), &["convert", file, "curve.csv", "--light-curve"]);
        let text = std::fs::read_to_string(here.path().join("curve.csv")).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|l| l.split(',').collect()).collect();
        assert_eq!(rows.len(), count);
        assert!(rows.iter().all(|row| row[9] == "AA-AP"));
        let expected = READ.lines().filter_map(|line| line.strip_prefix(&format!("{night},")));
        let expected: Vec<Vec<f64>> = expected
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect();
        assert_eq!(expected.len(), 4);
        for expected in expected {
            let day = expected[0];
            let number = |row: &[&str], k: usize| row[k].parse::<f64>().unwrap();
            let row = rows.iter().find(|row| (number(row, 0) - 24.0 * day).abs() < 1e-9);
            let row = row.unwrap_or_else(|| panic!("no row at {day}"));
            let found = [1, 3, 5, 7, 2, 4].map(|k| number(row, k));
            for (found, expected) in found.iter().zip(&expected[1..]) {
                assert!((found - expected).abs() <= 1e-15 + 1e-15 * expected.abs(), "{row:?}");
            }
        }
    }
}

/// Products, errors, stations and times of both nights, through UVFITS and back.
#[test]
fn exact_polarized_nights_survive_a_round_trip() {
    for path in nights().iter().flatten() {
        let (_, data) = files::decode(&std::fs::read(path).unwrap()).unwrap();
        let again = files::read_uvfits(&files::write_uvfits(&data).unwrap()).unwrap();
        assert!(data.is_polarized() && again.is_polarized());
        assert_eq!((&data.stations, data.rows.len()), (&again.stations, again.rows.len()));
        for (a, b) in data.rows.iter().zip(&again.rows) {
            assert_eq!((a.stations, a.products), (b.stations, b.products));
            assert!((a.time_h - b.time_h).abs() < 1e-6, "{} {}", a.time_h, b.time_h);
            let apart = (a.uv[0] - b.uv[0]).hypot(a.uv[1] - b.uv[1]);
            assert!(apart <= 1e-6 * a.uv[0].hypot(a.uv[1]), "{:?} {:?}", a.uv, b.uv);
            for (a, b) in a.noise_sigma.iter().zip(b.noise_sigma) {
                assert!(a.is_nan() && b.is_nan() || (a / b - 1.0).abs() < 1e-7, "{a} {b}");
            }
        }
    }
}

/// The comments above a light curve tell `fit --data` the source.
#[test]
fn exact_a_light_curve_keeps_its_source() {
    let Some(paths) = nights() else { return };
    let here = tempfile::tempdir().unwrap();
    let file = paths[1].to_str().unwrap();
    succeed(here.path(), &["convert", file, "c.csv", "--light-curve", "--comments"]);
    let told = succeed(here.path(), &["fit", "--data", "c.csv", "--print"]);
    assert!(told.contains("mass_msun = 4154000.0"), "{told}");
}

/// No leakage changes nothing, and that of one station the products of its baselines alone; what has a station that is not in
/// the table is left out and counted.
#[test]
fn exact_leakage_of_a_table_is_taken_out_of_a_night() {
    let Some(paths) = nights() else { return };
    let here = tempfile::tempdir().unwrap();
    let file = paths[1].to_str().unwrap();
    let read = |path: &std::path::Path| files::decode(&std::fs::read(path).unwrap()).unwrap().1;
    let before = read(&paths[1]);
    let station = |name: &str| before.stations.iter().position(|s| s.name == name).unwrap() as u16;
    let (alma, lmt) = (station("AA"), station("LM"));
    let cleaned = |of_alma: f64, name: &str| {
        let heading = "station,d_r_re,d_r_im,d_r_error,d_l_re,d_l_im,d_l_error";
        let others = ["AP", "AZ", "PV", "SM", "SP"].map(|name| format!("{name},0,0,,0,0,\n"));
        let table = format!("{heading}\nAA,{of_alma},0,,0,0,\n{}", others.concat());
        std::fs::write(here.path().join("leakage.csv"), table).unwrap();
        let said = told(here.path(), &["convert", file, name, "--leakage", "leakage.csv"]);
        assert!(said.contains("rows have no leakage"), "{said}");
        read(&here.path().join(name))
    };
    let (same, moved) = (cleaned(0.0, "same.uvfits"), cleaned(0.05, "moved.uvfits"));
    let kept: Vec<_> = before.rows.iter().filter(|row| !row.stations.contains(&lmt)).collect();
    assert_eq!((same.rows.len(), moved.rows.len()), (kept.len(), kept.len()));
    for ((before, same), moved) in kept.into_iter().zip(&same.rows).zip(&moved.rows) {
        assert_eq!(before.products, same.products);
        let change = (same.products[2] - moved.products[2]).norm();
        assert_eq!(change > 0.0, before.stations.contains(&alma), "{before:?}");
    }
}
