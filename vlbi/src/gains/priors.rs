//! Priors of gains.

/// Names of the tables that come with the program.
pub const TABLES: [&str; 2] = ["EHT2017", "ngEHT"];

/// The stations of both tables, with their source.
const STATIONS: &str = include_str!("stations.csv");

/// Priors of the gains of an observation's stations.
#[derive(Debug, Clone, PartialEq)]
pub struct GainPriors {
    /// True if phases are free in every scan; they are 0 otherwise.
    pub free_phases: bool,
    /// Standard deviation of ln|g| of each station in a scan; 0: the amplitude is known to be 1.
    pub amplitude_sigma: Vec<f64>,
}

impl GainPriors {
    /// The priors of some of the stations, in this order.
    ///
    /// # Panics
    /// If a station has no prior.
    #[must_use]
    pub fn of(&self, stations: &[u16]) -> Self {
        let sigma = |k: &u16| self.amplitude_sigma[usize::from(*k)];
        Self { amplitude_sigma: stations.iter().map(sigma).collect(), ..*self }
    }
}

/// Standard deviation of ln|g| of a station in one of the [`TABLES`] (upper and lower case count the same); none of
/// a station or a table that is not known.
pub fn table(name: &str, station: &str) -> Option<f64> {
    rows().find_map(|[names, sigma, tables]| {
        (has(names, station) && has(tables, name)).then(|| sigma.parse().ok()).flatten()
    })
}

/// Returns whether two names are those of one station: the same, or the code of published files (`AA`) and the name
/// of the arrays (`ALMA`); upper and lower case count the same.
pub fn is_same_station(a: &str, b: &str) -> bool {
    a.eq_ignore_ascii_case(b) || rows().any(|[names, ..]| has(names, a) && has(names, b))
}

fn rows() -> impl Iterator<Item = [&'static str; 3]> {
    STATIONS.lines().filter(|line| !line.starts_with('#')).filter_map(|line| {
        let mut cells = line.split(',');
        Some([cells.next()?, cells.next()?, cells.next()?])
    })
}

fn has(words: &str, word: &str) -> bool {
    words.split(' ').any(|w| w.eq_ignore_ascii_case(word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::built_in;

    #[test]
    fn exact_codes_of_published_files_name_stations_of_the_arrays() {
        for [code, name] in
            [["AA", "ALMA"], ["AZ", "SMT"], ["JC", "JCMT"], ["SR", "SMA"], ["pv", "PV"]]
        {
            assert!(is_same_station(code, name) && is_same_station(name, code), "{code} {name}");
        }
        assert!(!is_same_station("AA", "APEX") && !is_same_station("XX", "ALMA"));
    }

    #[test]
    fn exact_every_station_of_the_arrays_has_a_prior() {
        for name in TABLES {
            for station in built_in(name).unwrap().stations {
                assert!(table(name, &station.name).unwrap() > 0.0, "{name} {}", station.name);
            }
        }
        assert_eq!(table("eht2017", "LM"), Some(0.6));
        assert_eq!((table("EHT2017", "KP"), table("ngEHT", "KP")), (None, Some(0.1)));
        assert_eq!(table("ngEHT", "NOWHERE"), None);
        assert_eq!(table("elsewhere", "ALMA"), None);
    }
}
