//! Tables of leakage.

use super::NoFeeds;
use super::jones::{HANDS, Matrix};
use super::{Leakage, jones, leaked, turns};
use crate::Complex64;
use crate::Error;
use crate::array::Station;
use crate::observation::{Basis, Observation, Row};
use serde::Serialize;

/// Leakage of a station.
#[derive(Debug, Clone, PartialEq)]
pub struct StationLeakage {
    /// Its name.
    pub station: String,
    /// d_R and d_L.
    pub terms: [Complex64; 2],
    /// Standard deviations of the real parts of both (those of the imaginary parts are about the same); NaN where they are
    /// not known.
    pub errors: [f64; 2],
}

/// Leakage of all stations that observe.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LeakageTable {
    /// Leakage of the stations, in the order of the observation.
    pub stations: Vec<StationLeakage>,
}

/// Distance of leakage from the true one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LeakageDistance {
    /// Root mean square of |d − d_true|.
    pub rms: f64,
    /// The largest |d − d_true|.
    pub largest: f64,
    /// Root mean square of |d_true|.
    pub size: f64,
    /// Terms that were compared.
    pub count: usize,
}

impl LeakageTable {
    /// Takes the stations for which `observes` holds.
    pub fn new(
        stations: &[Station],
        leakage: &Leakage,
        errors: &[[f64; 2]],
        observes: impl Fn(usize) -> bool,
    ) -> Self {
        let of = |k: usize| StationLeakage {
            station: stations[k].name.clone(),
            terms: leakage[k],
            errors: errors.get(k).copied().unwrap_or([f64::NAN; 2]),
        };
        let seen = (0..stations.len()).filter(|k| observes(*k));
        Self { stations: seen.map(of).collect() }
    }

    /// d_R and d_L of a station; none if it is not in the table.
    pub fn of(&self, station: &str) -> Option<[Complex64; 2]> {
        self.stations.iter().find(|s| s.station == station).map(|s| s.terms)
    }

    /// Takes the leakage out of RR, LL, RL and LR, whose rotation of feeds has been taken out: V becomes J₁⁻¹ V J₂⁻†, and errors
    /// are those of the sums. Rows without all four products, or with a station that is not in the table, are left out;
    /// their number is returned.
    ///
    /// # Errors
    /// If the products are Stokes parameters, or the observation does not hold what the rotation of feeds follows from.
    pub fn take_out(&self, observation: &mut Observation) -> Result<usize, Error> {
        if observation.basis != Basis::Circular {
            return Err(NoFeeds.into());
        }
        let before = observation.rows.len();
        let terms: Vec<_> = observation.stations.iter().map(|s| self.of(&s.name)).collect();
        let known = |row: &Row| {
            let has_terms = row.stations.iter().all(|k| terms[usize::from(*k)].is_some());
            has_terms && (0..4).all(|k| row.measured(k).is_some())
        };
        observation.rows.retain(known);
        let turns = turns(observation)?;
        for (row, turns) in observation.rows.iter_mut().zip(turns) {
            let [first, second] = [0, 1].map(|k| {
                let terms = terms[usize::from(row.stations[k])].unwrap_or_default();
                inverse(&jones(terms, turns[k]))
            });
            let [rr, ll, rl, lr] = row.products;
            row.noise_sigma = summed(row.noise_sigma, &first, &second);
            row.products = leaked(&[[rr, rl], [lr, ll]], &first, &second);
        }
        observation.history.retain(|line| line != "DCAL: 0");
        observation.history.push("leakage of a table taken out".to_owned());
        Ok(before - observation.rows.len())
    }

    /// Returns the distance of this leakage from the true one; none if no station is in both.
    pub fn distance(&self, truth: &Self) -> Option<LeakageDistance> {
        let pairs = self.stations.iter().filter_map(|s| Some((s.terms, truth.of(&s.station)?)));
        let all: Vec<(Complex64, Complex64)> =
            pairs.flat_map(|(a, b)| [(a[0], b[0]), (a[1], b[1])]).collect();
        let count = all.len();
        let rms = |of: fn(&(Complex64, Complex64)) -> f64| {
            (all.iter().map(|pair| of(pair).powi(2)).sum::<f64>() / count as f64).sqrt()
        };
        (count > 0).then(|| LeakageDistance {
            rms: rms(|(a, b)| (a - b).norm()),
            largest: all.iter().fold(0.0, |most: f64, (a, b)| most.max((a - b).norm())),
            size: rms(|(_, b)| b.norm()),
            count,
        })
    }
}

/// The inverse of [[1, a], [b, 1]].
fn inverse([[_, a], [b, _]]: &Matrix) -> Matrix {
    let one = Complex64::new(1.0, 0.0);
    let over = (one - a * b).inv();
    [[over, -a * over], [-b * over, over]]
}

/// Standard deviations of [`leaked`] products whose parts have these and are independent.
fn summed(sigma: [f64; 4], first: &Matrix, second: &Matrix) -> [f64; 4] {
    HANDS.map(|[p, q]| {
        let part = |([r, s], sigma): ([usize; 2], f64)| {
            (first[p][r].norm() * second[q][s].norm() * sigma).powi(2)
        };
        HANDS.into_iter().zip(sigma).map(part).sum::<f64>().sqrt()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::built_in;
    use crate::noise::apply_leakage;
    use crate::source::Source;

    fn observation() -> Observation {
        let mut observation = Observation::empty(Basis::Circular);
        observation.stations = built_in("EHT2017").unwrap().stations;
        observation.position = Some("sgra".parse::<Source>().unwrap().position);
        observation.mjd = Some(57850);
        let products = [2.0, 2.1, 0.3, -0.2].map(|x| Complex64::new(x, 0.4 * x - 0.1));
        let row = |time_h, stations| Row {
            products,
            noise_sigma: [0.01, 0.02, 0.03, 0.04],
            ..Row::empty(time_h, stations, [1e9, 2e9])
        };
        observation.rows = vec![row(10.0, [0, 1]), row(12.0, [1, 3]), row(12.0, [0, 3])];
        observation
    }

    /// Leakage that is put on is taken out; errors grow by its squares.
    #[test]
    fn exact_leakage_is_taken_out() {
        let before = observation();
        let mut after = before.clone();
        let leakage = apply_leakage(&mut after, 0.05, 7).unwrap();
        assert!((after.rows[1].products[2] - before.rows[1].products[2]).norm() > 0.01);
        let table = LeakageTable::new(&after.stations, &leakage, &[], |_| true);
        assert_eq!(table.take_out(&mut after).unwrap(), 0);
        for (found, row) in after.rows.iter().zip(&before.rows) {
            for k in 0..4 {
                assert!((found.products[k] - row.products[k]).norm() < 1e-14);
                let grown = found.noise_sigma[k] / row.noise_sigma[k];
                assert!((grown - 1.0).abs() < 0.1 && grown != 1.0, "{grown}");
            }
        }
    }

    #[test]
    fn exact_rows_without_leakage_are_left_out() {
        let mut after = observation();
        let leakage = vec![[Complex64::default(); 2]; after.stations.len()];
        after.rows[0].noise_sigma[3] = f64::NAN;
        let table = LeakageTable::new(&after.stations, &leakage, &[], |k| k != 1);
        assert_eq!(table.take_out(&mut after).unwrap(), 2);
        assert_eq!((after.rows.len(), after.rows[0].stations), (1, [0, 3]));
        let mut stokes = Observation::empty(Basis::Stokes);
        assert!(table.take_out(&mut stokes).unwrap_err().to_string().contains("circular feeds"));
    }
}
