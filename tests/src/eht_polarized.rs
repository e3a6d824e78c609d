//! The two public nights of Sgr A* with all four products (2017 April 6 and 7), which lie where those of
//! [`crate::eht_data`] do: light curves beside numbers that another program reads, and data that survive being written.

use crate::eht_data::data;
use crate::support::{succeed, told};
use kerrlight_vlbi::files;

const NIGHTS: [&str; 2] = ["096", "097"];

/// Day fraction (after the half day of MJD), I, Q, U and V of ALMA–APEX (Jy), and errors of I and Q: read by astropy 8.0.2 from
/// the groups of the files, as (RR + LL)/2, (RL + LR)/2, (RL − LR)/2i, (RR − LL)/2, real parts, and errors from the weights.
const READ: [(usize, [f64; 7]); 8] = [
    (
        0,
        [
            0.3500578701496124,
            2.657590627670288,
            -0.13306576758623123,
            0.005145734176039696,
            -0.022040128707885742,
            0.002923167310504855,
            0.0025590608618702997,
        ],
    ),
    (
        0,
        [
            0.4419560134410858,
            2.779981851577759,
            -0.04557214304804802,
            -0.15508251637220383,
            0.01549386978149414,
            0.0029622416900660677,
            0.0025932678022164146,
        ],
    ),
    (
        0,
        [
            0.503993034362793,
            2.5777875185012817,
            -0.05082000605762005,
            -0.20076527446508408,
            0.02281510829925537,
            0.003198332312585218,
            0.00279995169075027,
        ],
    ),
    (
        0,
        [
            0.6061921119689941,
            2.4616135358810425,
            -0.0389024093747139,
            -0.17386049777269363,
            0.031845688819885254,
            0.004508101750634337,
            0.003946577373118794,
        ],
    ),
    (
        1,
        [
            0.16869212687015533,
            2.461053252220154,
            -0.04891686886548996,
            -0.11077269911766052,
            0.005657076835632324,
            0.004591717812351662,
            0.00401977886506137,
        ],
    ),
    (
        1,
        [
            0.21591435372829437,
            2.538185477256775,
            -0.14262183755636215,
            -0.16551295667886734,
            0.017220139503479004,
            0.0035667842053045775,
            0.0031225095986736006,
        ],
    ),
    (
        1,
        [
            0.4668402671813965,
            2.2384445667266846,
            -0.025987536180764437,
            -0.21174748986959457,
            0.021284103393554688,
            0.0030110840052780335,
            0.0026360268021499798,
        ],
    ),
    (
        1,
        [
            0.5989004373550415,
            2.3374016284942627,
            -0.030644436832517385,
            -0.1532798670232296,
            0.01729106903076172,
            0.004839450751451147,
            0.004236653940795591,
        ],
    ),
];

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
        for (_, [day, expected @ ..]) in READ.iter().filter(|(of, _)| *of == night) {
            let number = |row: &[&str], k: usize| row[k].parse::<f64>().unwrap();
            let row = rows.iter().find(|row| (number(row, 0) - 24.0 * day).abs() < 1e-9);
            let row = row.unwrap_or_else(|| panic!("no row at {day}"));
            let found = [1, 3, 5, 7, 2, 4].map(|k| number(row, k));
            for (found, expected) in found.iter().zip(expected) {
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
