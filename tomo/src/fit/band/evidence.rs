//! The probability of data with the field integrated out, and what it says of data that were not used.
//!
//! Gaussian fields are as often negative as positive, and a field of the other sign turns position angles by 90°. Emission is
//! not negative: of all fields those count whose emission is positive in sum. With y the data and t the sum,
//! p(y | t > 0) = 2 p(y) P(t > 0 | y).

use super::background::Whitening;
use super::field::{part, some};
use super::{Background, Band, BandPrior, CurveRows};
use crate::Error;
use nalgebra::{DMatrix, DVector};

/// Probability of data in a geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Weighed {
    /// ln of the mean probability over all combinations, up to what is the same for all geometries.
    pub ln_evidence: f64,
    /// The part of it of each radius, of which only ratios mean anything.
    pub by_radius: Vec<f64>,
    /// The most probable combination.
    pub best: Band,
    /// Combinations that are nearly as probable, with their ln, radius by radius.
    pub likely: Vec<(Band, f64)>,
}

/// Bands and geometries with a ln this far below the best one are not likely, and do not say where the emission is.
pub const UNLIKELY: f64 = 8.0;

/// Returns the probability of each of some data sets (over their standard deviations): of light curves that differ in their
/// values alone.
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
    let views = View::all(curve, data, &prior.backgrounds)?;
    let mut all: Vec<Vec<(usize, Band, f64)>> = vec![Vec::new(); data.len()];
    for (place, radius) in prior.radii.iter().enumerate() {
        for (width, length) in pairs(&prior.widths, &prior.lengths) {
            let (radius, height) = (*radius, prior.height);
            let band = Band { radius, width, height, length, ..Band::DARK };
            // It depends on band and grid alone: the same bands are left out in all geometries.
            let Some(seen) = curve.seen(&band) else { continue };
            let columns = [&seen.uniform, &seen.total].map(|all| some(all.as_slice(), &used));
            let field = Field {
                covariance: part(&seen.covariance, &used, &used),
                columns: DMatrix::from_columns(&columns),
                total: seen.own_total,
            };
            for view in &views {
                for (set, band, ln) in view.weigh(&field, &prior, band) {
                    all[set].push((place, band, ln));
                }
            }
        }
    }
    all.into_iter().map(|all| weighed(&all, prior.radii.len())).collect()
}

/// ln of the probability of each of some data sets without any flare, on the scale of [`Weighed::ln_evidence`]: the mean
/// over all backgrounds.
///
/// # Errors
/// If a background is out of its range.
pub fn without_flare(
    curve: &CurveRows,
    data: &[Vec<f64>],
    backgrounds: &[Background],
) -> Result<Vec<f64>, Error> {
    let views = View::all(curve, data, backgrounds)?;
    let of = |set: usize| {
        let one = |view: &View| {
            -0.5 * (view.sets.column(set).norm_squared() + view.whitening.ln_determinant)
        };
        ln_sum(views.iter().map(one)) - (views.len() as f64).ln()
    };
    Ok((0..data.len()).map(of).collect())
}

/// Response of the data that are used to a random field.
struct Field {
    covariance: DMatrix<f64>,
    /// Response to a field of 1, and the covariance with all emission.
    columns: DMatrix<f64>,
    /// The variance of all emission, and all emission of a field of 1.
    total: [f64; 2],
}

/// The data that are used, as they are in front of a background.
struct View {
    background: Background,
    whitening: Whitening,
    /// A column for each data set.
    sets: DMatrix<f64>,
}

impl View {
    fn all(
        curve: &CurveRows,
        data: &[Vec<f64>],
        backgrounds: &[Background],
    ) -> Result<Vec<Self>, Error> {
        let used = curve.numbers(true);
        let sets: Vec<DVector<f64>> = data.iter().map(|values| some(values, &used)).collect();
        let sets = DMatrix::from_columns(&sets);
        let one = |background: &Background| {
            let whitening = Whitening::new(curve, background, &used)?;
            let sets = whitening.columns(sets.clone());
            Ok(Self { background: *background, whitening, sets })
        };
        backgrounds.iter().map(one).collect()
    }

    /// Number of the data set, band and ln of the probability, for all powers and means of a band with this field.
    fn weigh(&self, field: &Field, prior: &BandPrior, band: Band) -> Vec<(usize, Band, f64)> {
        let covariance = self.whitening.covariance(&field.covariance);
        let columns = self.whitening.columns(field.columns.clone());
        let unit = unit(&covariance, &self.sets);
        let mut all = Vec::new();
        for power in prior.powers.iter().map(|power| power * unit) {
            let Some(lower) = Lower::new(&covariance, power) else { continue };
            let weighed = lower.weigh(&columns, field.total, &self.sets, &prior.means);
            all.extend(weighed.into_iter().map(|(set, mean, ln)| {
                let band = Band { power, mean, background: self.background, ..band };
                (set, band, ln - 0.5 * self.whitening.ln_determinant)
            }));
        }
        all
    }
}

fn pairs<'a>(a: &'a [f64], b: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    a.iter().flat_map(|a| b.iter().map(|b| (*a, *b)))
}

/// The power with which the model's mean square is that of the first data.
fn unit(covariance: &DMatrix<f64>, sets: &DMatrix<f64>) -> f64 {
    // One prior of the amplitude for all sets. In a scan these differ by turns of Q and U with
    // equal errors, which change no norm.
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

    /// Number of the data set, mean, and ln of the probability, of all emission together above 0: the mean is a direction
    /// more.
    fn weigh(
        &self,
        columns: &DMatrix<f64>,
        total: [f64; 2],
        sets: &DMatrix<f64>,
        means: &[f64],
    ) -> Vec<(usize, f64, f64)> {
        let (columns, sets) = (self.solved(columns), self.solved(sets));
        let (direction, emission) = (columns.column(0), columns.column(1));
        let square = direction.norm_squared();
        let mut all = Vec::new();
        for (set, values) in sets.column_iter().enumerate() {
            let chi2 = values.norm_squared();
            let product = values.dot(&direction);
            for mean in means {
                let strength = self.power * mean * mean;
                // (C + s uuᵀ)⁻¹ by Sherman & Morrison, and det (C + s uuᵀ) = `more` det C.
                let more = 1.0 + strength * square;
                let form = chi2 - strength * product * product / more;
                // All emission given the data: its covariance with them is this column times the power.
                let with = emission + direction * (mean * mean * total[1]);
                let along = with.dot(&direction) * strength / more;
                let expected = self.power * (with.dot(&values) - along * product);
                let seen = with.norm_squared() - along * with.dot(&direction);
                let own = total[0] + (mean * total[1]).powi(2);
                let variance = self.power * (own - self.power * seen);
                // Where data leave nothing open, rounding may bring the variance to 0 or below.
                let positive = ln_normal(expected / variance.max(f64::MIN_POSITIVE).sqrt());
                let ln = -0.5 * (form + self.ln_determinant + more.ln());
                all.push((set, *mean, ln + core::f64::consts::LN_2 + positive));
            }
        }
        all
    }
}

/// ln of the normal distribution function.
fn ln_normal(z: f64) -> f64 {
    use core::f64::consts::{LN_2, SQRT_2, TAU};
    match z < -30.0 {
        // `erfc` underflows below −38. The asymptote is off by 1/z², 0.0011 at −30.
        true => -0.5 * (z * z + TAU.ln()) - (-z).ln(),
        false => libm::erfc(-z / SQRT_2).ln() - LN_2,
    }
}

/// ln of the sum of exponentials.
fn ln_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = values.clone().fold(f64::NEG_INFINITY, f64::max);
    // −∞ less −∞ would be no number.
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
    let full = seen.full(band) + curve.of_background(&band.background);
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
