//! The Event Horizon Telescope's public data, as UVFITS, against the collaboration's own text
//! tables of the same data. They lie outside the repository: in `../shared/data/eht` beside it, or
//! where KERRLIGHT_EHT_DATA says.

use crate::support::{root, skipped};
use kerrlight_vlbi::files::{self, EhtTable};
use kerrlight_vlbi::observation::{Averaging, Measured, Observation};
use kerrlight_vlbi::products::{ClosureCount, ClosureKind};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// M87*, 2017 April 10: Stokes I.
pub const M87: &str = "SR1_M87_2017_100_hi_hops_netcal_StokesI.uvfits";
/// Sgr A*, 2017 April 7: Stokes I.
pub const SGRA: &str = "ER6_SGRA_2017_097_hi_hops_netcal-LMTcal-besttime_StokesI.uvfits";
/// The same night with all four products.
pub const SGRA_POLARIZED: &str =
    "ER6_SGRA_2017_097_hi_hops_netcal_LMTcal_10s_ALMArot_dtermcal.uvfits";

/// Where public files are looked for.
fn folder() -> PathBuf {
    std::env::var_os("KERRLIGHT_EHT_DATA")
        .map_or_else(|| root().join("../shared/data/eht"), PathBuf::from)
}

/// A public file; says so where it is not there.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = folder().join(name);
    if !path.is_file() {
        skipped(format_args!("there is no {}", path.display()));
    }
    path.is_file().then_some(path)
}

/// All public files of these kinds; says so where there are no files at all.
pub fn all(kinds: &[&str]) -> Vec<PathBuf> {
    let folder = folder();
    let Ok(entries) = std::fs::read_dir(&folder) else {
        skipped(format_args!("there are no public EHT data in {}", folder.display()));
        return Vec::new();
    };
    let is_one =
        |path: &PathBuf| path.extension().is_some_and(|own| kinds.iter().any(|kind| own == *kind));
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let paths: Vec<_> = paths.filter(is_one).collect();
    assert!(!paths.is_empty(), "no {kinds:?} in {}", folder.display());
    paths
}

/// Pairs of UVFITS and text, of files that have both.
pub fn pairs() -> Vec<(PathBuf, PathBuf)> {
    let uvfits = all(&["uvfits"]);
    let pairs = uvfits.iter().map(|path| (path.clone(), path.with_extension("txt")));
    let pairs: Vec<_> = pairs.filter(|(_, text)| text.exists()).collect();
    assert!(uvfits.is_empty() || !pairs.is_empty(), "no .uvfits with .txt of {uvfits:?}");
    pairs
}

fn decode(path: &Path) -> (&'static str, Observation) {
    let bytes = std::fs::read(path).expect("a readable file");
    files::decode(&bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Stokes I by time (in seconds; the quarter keeps whole and half ones off the edge of rounding)
/// and stations in alphabetical order.
fn by_baseline(observation: &Observation) -> HashMap<(i64, String, String), ([f64; 2], Measured)> {
    let mut map = HashMap::new();
    for (row, i) in observation.stokes_i() {
        let [t1, t2] = observation.names(row);
        let key = |a: &str, b: &str| {
            ((row.time_h * 3600.0 + 0.25).round() as i64, a.to_owned(), b.to_owned())
        };
        let before = if t1 < t2 {
            map.insert(key(t1, t2), (row.uv, i))
        } else {
            let i = Measured { visibility: i.visibility.conj(), ..i };
            map.insert(key(t2, t1), (row.uv.map(|x| -x), i))
        };
        assert!(before.is_none(), "{t1}-{t2} at {} h is there twice", row.time_h);
    }
    map
}

/// The tables give amplitudes and errors to 8 decimals, phases to 4, (u, v) in single precision.
#[test]
fn code_eht_tables_agree_visibility_by_visibility() {
    for (uvfits, text) in pairs() {
        let ((format, data), (other, table)) = (decode(&uvfits), decode(&text));
        assert_eq!((format, other), ("UVFITS", "table of visibilities"));
        assert_eq!((&data.source, data.mjd), (&table.source, table.mjd));
        let (data, table) = (by_baseline(&data), by_baseline(&table));
        assert_eq!(data.len(), table.len(), "{}", uvfits.display());
        for (key, (uv, expected)) in &table {
            let (found_uv, found) = data.get(key).unwrap_or_else(|| panic!("{key:?} is missing"));
            for (a, b) in uv.iter().zip(found_uv) {
                assert!((a - b).abs() <= 1.2e-7 * a.abs() + 1e-4, "{key:?}: {a} {b}");
            }
            let (a, b) = (expected.visibility, found.visibility);
            let turn = (a * b.conj()).arg().to_degrees();
            assert!((a.norm() - b.norm()).abs() < 1e-8 + 1e-7 * a.norm(), "{key:?}: {a} {b}");
            assert!(turn.abs() < 1e-4, "{key:?}: {turn}");
            let (a, b) = (expected.noise_sigma, found.noise_sigma);
            assert!((a - b).abs() < 1e-8 + 1e-7 * a, "{key:?}: {a} {b}");
        }
    }
}

/// A published table that is read and written again is the same file, byte for byte; the one made
/// of the UVFITS file differs from it in single precision's rounding of (u, v) and of σ only.
#[test]
fn code_eht_tables_are_written_as_published() {
    for (uvfits, text) in pairs() {
        let published = std::fs::read_to_string(&text).unwrap();
        let table = decode(&text).1;
        let again = files::to_eht_table(&table, EhtTable::Txt).unwrap();
        assert!(again == published, "{}", text.display());
        let csv = files::to_eht_table(&table, EhtTable::Csv).unwrap();
        let of_csv = files::parse_table(&csv).unwrap();
        assert!(files::to_eht_table(&of_csv, EhtTable::Txt).unwrap() == published);
        let own = files::to_eht_table(&decode(&uvfits).1, EhtTable::Txt).unwrap();
        assert_eq!(own.lines().count(), published.lines().count());
        for (own, published) in own.lines().zip(published.lines()) {
            let [a, b] = [own, published].map(|l| l.split_whitespace().collect::<Vec<_>>());
            if published.starts_with('#') {
                assert_eq!(own, published);
                continue;
            }
            let close = |k: usize, relative: f64, absolute: f64| {
                let [a, b] = [a[k], b[k]].map(|cell| cell.parse::<f64>().unwrap());
                (a - b).abs() <= relative * b.abs() + absolute
            };
            let same = a[..3] == b[..3] && a[5..7] == b[5..7];
            let same = same && close(3, 1.2e-7, 1e-4) && close(4, 1.2e-7, 1e-4);
            assert!(same && close(7, 0.0, 1.01e-8), "{own}\n{published}");
        }
    }
}

/// Read, written and read again: the same data, single precision and all.
#[test]
fn exact_eht_files_survive_a_round_trip() {
    for (uvfits, _) in pairs() {
        let (_, data) = decode(&uvfits);
        let again = files::read_uvfits(&files::write_uvfits(&data).unwrap()).unwrap();
        assert_eq!(data.rows.len(), again.rows.len());
        assert_eq!(data.stations, again.stations);
        let (data, again) = (by_baseline(&data), by_baseline(&again));
        for (key, (uv, i)) in &data {
            let (again_uv, again_i) = again[key];
            assert_eq!(i.visibility, again_i.visibility, "{key:?}");
            assert!((i.noise_sigma / again_i.noise_sigma - 1.0).abs() < 1e-7, "{key:?}");
            for (a, b) in uv.iter().zip(again_uv) {
                assert!((a - b).abs() <= 6e-8 * a.abs(), "{key:?}: {a} {b}");
            }
        }
    }
}

/// eht-imaging 1.3.2 of M87*, 2017 April 10: `avg_coherent(300)` and `add_scans()` with `avg_coherent(0, scan_avg=True)`,
/// then `c_phases` and `c_amplitudes(ctype="logcamp")` with `count="min"`. 86 of the averages of scans are not of baselines
/// within a site.
#[test]
fn code_ehtim_averages_keep_closures() {
    let Some(path) = data(M87) else { return };
    let data = decode(&path).1;
    let clock = Averaging::over(300.0);
    let scans = Averaging { seconds: f64::INFINITY, in_scans: true, weighted: true };
    for (averaging, expected) in [(clock, [167, 12, 110, 98]), (scans, [96, 7, 63, 56])] {
        let mean = data.averaged(averaging);
        let mut times: Vec<u64> = mean.rows.iter().map(|row| row.time_h.to_bits()).collect();
        times.dedup();
        let count = |kind| ClosureCount::of(&mean, kind, 0.0).used;
        let [phases, amplitudes] = [ClosureKind::Phase, ClosureKind::LogAmplitude].map(count);
        assert_eq!([mean.rows.len(), times.len(), phases, amplitudes], expected);
    }
    let lengths = data.averaged(scans).rows.into_iter().map(|row| row.uv[0].hypot(row.uv[1]));
    assert_eq!(lengths.filter(|length| *length > 1e8).count(), 86);
}
