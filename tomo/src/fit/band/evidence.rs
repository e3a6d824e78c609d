//! The probability of data with the field integrated out, and what it says of data that were not used.

use super::field::{Seen, part, some};
use super::{Band, BandPrior, CurveRows};
use crate::Error;
use nalgebra::{DMatrix, DVector};

/// How probable data are in a world.
#[derive(Clone, Debug, PartialEq)]
pub struct Weighed {
    /// ln of the mean probability over all combinations, up to what is the same for all worlds.
    pub ln_evidence: f64,
    /// The same for each of the radii.
    pub by_radius: Vec<f64>,
    /// The most probable combination.
    pub best: Band,
    /// Its ln.
    pub ln_best: f64,
    /// Combinations that are nearly as probable, with their ln, radius by radius.
    pub likely: Vec<(Band, f64)>,
}

/// Bands and worlds with a ln this far below the best one are not likely, and do not say where the emission is.
pub const UNLIKELY: f64 = 8.0;

/// How probable each of some data sets (over their standard deviations) is: of light curves that differ in their values
/// alone.
///
/// # Errors
/// If a number of the prior is out of its range, or no band has any voxel.
pub fn evidence(
    curve: &CurveRows,
    data: &[Vec<f64>],
    prior: &BandPrior,
) -> Result<Vec<Weighed>, Error> {
    let prior = prior.clone().checked()?;
    let used = curve.numbers(true);
    let sets: Vec<DVector<f64>> = data.iter().map(|values| some(values, &used)).collect();
    let sets = DMatrix::from_columns(&sets);
    let mut all: Vec<Vec<(usize, Band, f64)>> = vec![Vec::new(); data.len()];
    for (place, radius) in prior.radii.iter().enumerate() {
        for (width, length) in pairs(&prior.widths, &prior.lengths) {
            let band = Band {
                radius: *radius,
                width,
                height: prior.height,
                length,
                power: 1.0,
                mean: 0.0,
            };
            let Some(seen) = curve.seen(&band) else { continue };
            let (covariance, uniform) =
                (part(&seen.covariance, &used, &used), some(seen.uniform.as_slice(), &used));
            let unit = unit(&covariance, &sets);
            for power in prior.powers.iter().map(|power| power * unit) {
                let Some(lower) = Lower::new(&covariance, power) else { continue };
                let weighed = lower.weigh(&uniform, &sets, &prior.means);
                for (set, mean, ln) in weighed {
                    all[set].push((place, Band { power, mean, ..band }, ln));
                }
            }
        }
    }
    all.into_iter().map(|all| weighed(&all, prior.radii.len())).collect()
}

fn pairs<'a>(a: &'a [f64], b: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    a.iter().flat_map(|a| b.iter().map(|b| (*a, *b)))
}

/// The power with which the model's mean square is that of the first data.
fn unit(covariance: &DMatrix<f64>, sets: &DMatrix<f64>) -> f64 {
    let square = sets.column(0).norm_squared();
    let trace = covariance.trace();
    if trace > 0.0 { square / trace } else { 1.0 }
}

/// The factor of 1 + power · covariance.
pub(super) struct Lower {
    factor: DMatrix<f64>,
    power: f64,
    ln_determinant: f64,
}

impl Lower {
    pub fn new(covariance: &DMatrix<f64>, power: f64) -> Option<Self> {
        let mut matrix = covariance * power;
        (0..matrix.nrows()).for_each(|k| matrix[(k, k)] += 1.0);
        let factor = matrix.cholesky()?.unpack();
        let ln_determinant = 2.0 * factor.diagonal().iter().map(|x| x.ln()).sum::<f64>();
        Some(Self { factor, power, ln_determinant })
    }

    /// Columns over the factor: their products are those with the inverse of the covariance.
    pub fn solved(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        self.factor.solve_lower_triangular(columns).unwrap_or_else(|| columns * f64::NAN)
    }

    /// Number of the data set, mean, and ln of the probability: the mean is a direction more.
    fn weigh(
        &self,
        uniform: &DVector<f64>,
        sets: &DMatrix<f64>,
        means: &[f64],
    ) -> Vec<(usize, f64, f64)> {
        let direction = self.solved(&DMatrix::from_columns(core::slice::from_ref(uniform)));
        let (direction, sets) = (direction.column(0), self.solved(sets));
        let square = direction.norm_squared();
        let mut all = Vec::new();
        for (set, values) in sets.column_iter().enumerate() {
            let (chi2, along) = (values.norm_squared(), values.dot(&direction));
            for mean in means {
                let strength = self.power * mean * mean;
                let more = 1.0 + strength * square;
                let form = chi2 - strength * along * along / more;
                all.push((set, *mean, -0.5 * (form + self.ln_determinant + more.ln())));
            }
        }
        all
    }
}

/// ln of the sum of exponentials.
fn ln_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        most
    } else {
        most + values.map(|x| (x - most).exp()).sum::<f64>().ln()
    }
}

fn weighed(all: &[(usize, Band, f64)], radii: usize) -> Result<Weighed, Error> {
    let Some((_, best, ln_best)) = all.iter().max_by(|a, b| a.2.total_cmp(&b.2)) else {
        return Err(Error::out_of_range("radii", radii as f64, "bands with any voxel"));
    };
    let of = |place: usize| ln_sum(all.iter().filter(move |one| one.0 == place).map(|one| one.2));
    Ok(Weighed {
        ln_evidence: ln_sum(all.iter().map(|one| one.2)) - (all.len() as f64).ln(),
        by_radius: (0..radii).map(of).collect(),
        best: *best,
        ln_best: *ln_best,
        likely: all
            .iter()
            .filter(|one| one.2 > ln_best - UNLIKELY)
            .map(|one| (one.1, one.2))
            .collect(),
    })
}

/// χ² per datum of the data that were not used, with the values and the covariance that a band expects of them, given
/// the others (all over their standard deviations); none if all were used.
///
/// # Errors
/// If the band has no node.
pub fn validation(curve: &CurveRows, data: &[f64], band: &Band) -> Result<Option<f64>, Error> {
    let none = || Error::out_of_range("radius of the band", band.radius, "that of any node");
    let seen = curve.seen(band).ok_or_else(none)?;
    let (used, others) = (curve.numbers(true), curve.numbers(false));
    if others.is_empty() {
        return Ok(None);
    }
    let full = full(&seen, band);
    let mut inner = part(&full, &used, &used);
    (0..used.len()).for_each(|k| inner[(k, k)] += 1.0);
    let factor = inner.cholesky().ok_or_else(none)?;
    let across = part(&full, &others, &used);
    let left = some(data, &others) - &across * factor.solve(&some(data, &used));
    let mut outer = part(&full, &others, &others) - &across * factor.solve(&across.transpose());
    (0..others.len()).for_each(|k| outer[(k, k)] += 1.0);
    let chi2 = outer.cholesky().map_or(f64::NAN, |outer| left.dot(&outer.solve(&left)));
    Ok(Some(chi2 / others.len() as f64))
}

/// The covariance of all data without noise.
fn full(seen: &Seen, band: &Band) -> DMatrix<f64> {
    let mean = &seen.uniform * seen.uniform.transpose() * (band.mean * band.mean);
    (&seen.covariance + mean) * band.power
}
