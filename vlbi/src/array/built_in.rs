//! Arrays by name: the Event Horizon Telescope of April 2017, and its next generation as it was
//! simulated by Levis et al. (2022, BH-NeRF). Positions (ITRF metres) and 1.3 mm SEFDs (Jy) of the R
//! and L feeds are those of eht-imaging's tables `EHT2017` and `ngEHT`.

use super::{Array, Station};

/// Names of the built-in arrays.
pub const BUILT_IN: [&str; 2] = ["EHT2017", "ngEHT"];

type Row = (&'static str, [f64; 3], [f64; 2]);

/// SEFDs of a station whose feeds are equal.
const fn both(sefd: f64) -> [f64; 2] {
    [sefd, sefd]
}

const PV: Row = ("PV", [5088967.90, -301681.60, 3825015.80], both(3600.0));
const ALMA: Row = ("ALMA", [2225061.164, -5440057.37, -2481681.15], both(70.0));
const SPT: Row = ("SPT", [0.01, 0.01, -6359609.7], both(16900.0));
const APEX: Row = ("APEX", [2225039.53, -5441197.63, -2479303.36], both(4900.0));
const JCMT: Row = ("JCMT", [-5464584.68, -2493001.17, 2150653.98], both(10000.0));
const SMT: Row = ("SMT", [-1828796.20, -5054406.80, 3427865.20], both(14400.0));
const SMA: [f64; 3] = [-5464523.40, -2493147.08, 2150611.75];
const LMT: Row = ("LMT", [-768713.9637, -5988541.7982, 2063275.9472], both(3600.0));

const EHT2017: [Row; 8] = [PV, SMT, ("SMA", SMA, [5600.0, 6500.0]), LMT, ALMA, SPT, APEX, JCMT];

const NG_EHT: [Row; 23] = [
    ALMA,
    APEX,
    JCMT,
    LMT,
    ("SMA", SMA, both(5600.0)),
    SMT,
    SPT,
    PV,
    ("GLT", [1500692.0, -1191735.0, 6066409.0], both(10000.0)),
    ("KP", [-1995678.840, -5037317.697, 3357328.025], both(10000.0)),
    ("BAJA", [-2352576.0, -4940331.0, 3271508.0], both(10000.0)),
    ("BAR", [-2363000.0, -4445000.0, 3907000.0], both(10000.0)),
    ("CAT", [1569000.0, -4559000.0, -4163000.0], both(10000.0)),
    ("CNI", [5311000.0, -1725000.0, 3075000.0], both(10000.0)),
    ("GAM", [5648000.0, 1619000.0, -2477000.0], both(10000.0)),
    ("GARS", [1538000.0, -2462000.0, -5659000.0], both(10000.0)),
    ("HAY", [1521000.0, -4417000.0, 4327000.0], both(10000.0)),
    ("NZ", [-4540000.0, 719000.0, -4409000.0], both(10000.0)),
    ("OVRO", [-2409598.0, -4478348.0, 3838607.0], both(10000.0)),
    ("SGO", [1832000.0, -5034000.0, -3455000.0], both(10000.0)),
    ("CAS", [1373000.0, -3399000.0, -5201000.0], both(10000.0)),
    ("LLA", [2325338.0, -5341460.0, -2599661.0], both(10000.0)),
    ("PIKE", [-1285000.0, -4797000.0, 3994000.0], both(10000.0)),
];

/// A built-in array by its name (upper and lower case count the same).
pub fn built_in(name: &str) -> Option<Array> {
    let rows: &[Row] = match name.to_ascii_lowercase().as_str() {
        "eht2017" => &EHT2017,
        "ngeht" => &NG_EHT,
        _ => return None,
    };
    let station = |&(name, position, sefd): &Row| {
        let position = Some(position);
        Station { position, sefd, ..Station::named(name) }
    };
    Some(Array { stations: rows.iter().map(station).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The feeds that the arrays of Levis et al. (2022) have.
    #[test]
    fn paper_sefds_of_both_feeds() {
        let sefd = |array: &str, name: &str| {
            let stations = built_in(array).unwrap().stations;
            stations.iter().find(|station| station.name == name).unwrap().sefd
        };
        assert_eq!(sefd("EHT2017", "SMA"), [5600.0, 6500.0]);
        assert_eq!(sefd("ngEHT", "SMA"), [5600.0; 2]);
        for array in BUILT_IN {
            assert_eq!(sefd(array, "SMT"), [14400.0; 2], "{array}");
            assert_eq!(sefd(array, "ALMA"), [70.0; 2], "{array}");
            assert_eq!(sefd(array, "LMT"), [3600.0; 2], "{array}");
        }
    }

    /// Stations stand on the Earth: between its polar and equatorial radius plus mountains.
    #[test]
    fn exact_stations_stand_on_the_ground() {
        for name in BUILT_IN {
            let array = built_in(name).unwrap();
            assert_eq!(Array::new(array.stations.clone()).unwrap(), array);
            for station in array.stations {
                let [x, y, z] = station.position.unwrap();
                let radius = (x * x + y * y + z * z).sqrt();
                // The positions of planned stations are given to 1 km.
                assert!((6.3567e6..6.3845e6).contains(&radius), "{} {radius}", station.name);
            }
        }
    }
}
