//! Place of the emission: its first moments about the axis, given the data.
//!
//! With q = ∫ e exp(iφ) ρ dρ dφ dz and p = ∫ e exp(iφ) ρ² dρ dφ dz the azimuth is arg q, and the radius Re(p q̄)/|q|². Both are
//! linear in e, hence Gaussian for every band; the angle and the quotient are taken to first order. Emission that goes round
//! evenly has neither.

use super::background::Whitening;
use super::evidence::Lower;
use super::field::{BandCovariance, part, some};
use super::{Band, CurveRows};
use crate::Error;
use crate::null::or_nan;
use core::f64::consts::TAU;
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};
use serde::{Deserialize, Serialize};

/// A mean and its standard deviation.
pub type Normal = [f64; 2];

/// Place of the emission of one band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// ln of its weight.
    pub ln: f64,
    /// Distance from the axis, M.
    pub radius: Normal,
    /// Azimuth at the reference time, radians.
    pub azimuth: Normal,
}

/// Median and 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Half of the probability is below.
    #[serde(deserialize_with = "or_nan")]
    pub median: f64,
    /// 2.5 % are below.
    #[serde(deserialize_with = "or_nan")]
    pub low: f64,
    /// 97.5 % are below.
    #[serde(deserialize_with = "or_nan")]
    pub high: f64,
}

/// Returns the places of the emission of bands, given the data that are used (over their standard deviations). Bands come with
/// the ln of their weights; those of the same radius, width and length one after the other, among these those of the same
/// background.
///
/// # Errors
/// If a band has no node.
pub fn places(curve: &CurveRows, data: &[f64], bands: &[(Band, f64)]) -> Result<Vec<Place>, Error> {
    let used = curve.numbers(true);
    let values = some(data, &used);
    let alike = |a: &(Band, f64), b: &(Band, f64)| {
        let Band { radius, width, length, .. } = a.0;
        Band { radius, width, length, ..b.0 } == b.0
    };
    let mut all = Vec::new();
    for bands in bands.chunk_by(alike) {
        let none =
            || Error::out_of_range("radius of the band", bands[0].0.radius, "that of any node");
        let field = curve.seen(&bands[0].0).ok_or_else(none)?;
        for bands in bands.chunk_by(|a, b| a.0.background == b.0.background) {
            let whitening = Whitening::new(curve, &bands[0].0.background, &used)?;
            let seen = Used::new(&field, &used, &values, &whitening);
            for bands in bands.chunk_by(|a, b| a.0.power == b.0.power) {
                let lower = Lower::new(&seen.covariance, bands[0].0.power).ok_or_else(none)?;
                let columns = lower.solved(&seen.columns);
                all.extend(bands.iter().map(|(band, ln)| seen.place(&columns, band, *ln)));
            }
        }
    }
    Ok(all)
}

/// Quantities of the data that are used, in front of a background.
struct Used {
    covariance: DMatrix<f64>,
    /// Moments, uniform emission, data.
    columns: DMatrix<f64>,
    own: Matrix4<f64>,
}

impl Used {
    fn new(
        seen: &BandCovariance,
        used: &[usize],
        values: &DVector<f64>,
        whitening: &Whitening,
    ) -> Self {
        let moments = part(&seen.moments, used, &[0, 1, 2, 3]);
        let mut columns: Vec<DVector<f64>> =
            moments.column_iter().map(|column| column.into_owned()).collect();
        columns.extend([some(seen.uniform.as_slice(), used), values.clone()]);
        Self {
            covariance: whitening.covariance(&part(&seen.covariance, used, used)),
            columns: whitening.columns(DMatrix::from_columns(&columns)),
            own: Matrix4::from_fn(|a, b| seen.own[(a, b)]),
        }
    }

    /// The place of one band, from columns over the factor of its covariance without the mean.
    fn place(&self, columns: &DMatrix<f64>, band: &Band, ln: f64) -> Place {
        let uniform = columns.column(4);
        let strength = band.power * band.mean * band.mean;
        // Sherman & Morrison: the mean is one direction more of the covariance.
        let more = strength / (1.0 + strength * uniform.norm_squared());
        let product = |a: usize, b: usize| {
            let [a, b] = [a, b].map(|k| columns.column(k));
            a.dot(&b) - more * a.dot(&uniform) * b.dot(&uniform)
        };
        let mean = Vector4::from_fn(|k, _| band.power * product(k, 5));
        // Emission that goes round evenly has no moments: the mean adds nothing to theirs.
        let covariance =
            Matrix4::from_fn(|a, b| band.power * (self.own[(a, b)] - band.power * product(a, b)));
        let [radius, azimuth] = polar(&mean, &covariance);
        Place { ln, radius, azimuth }
    }
}

/// Radius and azimuth of moments (q, p), with their deviations to first order.
fn polar(mean: &Vector4<f64>, covariance: &Matrix4<f64>) -> [Normal; 2] {
    let [c, s, x, y] = [mean[0], mean[1], mean[2], mean[3]];
    let square = (c * c + s * s).max(f64::MIN_POSITIVE);
    let radius = (x * c + y * s) / square;
    let of_azimuth = Vector4::new(-s, c, 0.0, 0.0) / square;
    let of_radius = Vector4::new(x - 2.0 * radius * c, y - 2.0 * radius * s, c, s) / square;
    let deviation = |slope: Vector4<f64>| slope.dot(&(covariance * slope)).max(0.0).sqrt();
    [[radius, deviation(of_radius)], [s.atan2(c), deviation(of_azimuth)]]
}

/// Azimuth (radians) and radius (M) of all places together: mixtures of normal distributions. The interval of an azimuth
/// that is not known is 2π wide.
pub fn together(places: &[Place]) -> Option<[Interval; 2]> {
    let most = places.iter().map(|place| place.ln).fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = places.iter().map(|place| (place.ln - most).exp()).collect();
    let of = |numbers: fn(&Place) -> Normal| -> Vec<(f64, Normal)> {
        weights.iter().copied().zip(places.iter().map(numbers)).collect()
    };
    let radius = quantiles(&of(|place| place.radius))?;
    let mut azimuths = of(|place| place.azimuth);
    let (sin, cos) = azimuths.iter().fold((0.0, 0.0), |(s, c), (weight, [at, _])| {
        (s + weight * at.sin(), c + weight * at.cos())
    });
    let middle = sin.atan2(cos);
    // Within half a turn of their middle, azimuths on both sides of ±π are neighbours.
    for (_, [at, _]) in &mut azimuths {
        let (sin, cos) = (*at - middle).sin_cos();
        *at = middle + sin.atan2(cos);
    }
    let mut azimuth = quantiles(&azimuths)?;
    azimuth.low = azimuth.low.max(azimuth.median - 0.5 * TAU);
    azimuth.high = azimuth.high.min(azimuth.median + 0.5 * TAU);
    Some([azimuth, radius])
}

/// Quantiles of a mixture of weighted normal distributions.
fn quantiles(parts: &[(f64, Normal)]) -> Option<Interval> {
    let sum: f64 = parts.iter().map(|part| part.0).sum();
    // 9 standard deviations leave 2e-19 of a normal distribution outside.
    let reach =
        |(_, [mean, deviation]): &(f64, Normal)| [mean - 9.0 * deviation, mean + 9.0 * deviation];
    let low = parts.iter().map(|part| reach(part)[0]).fold(f64::INFINITY, f64::min);
    let high = parts.iter().map(|part| reach(part)[1]).fold(f64::NEG_INFINITY, f64::max);
    if !(sum > 0.0 && low.is_finite() && high.is_finite()) {
        return None;
    }
    let below = |x: f64| {
        let of = |(weight, [mean, deviation]): &(f64, Normal)| match *deviation > 0.0 {
            // `erfc` keeps its digits where little lies below.
            true => weight * 0.5 * libm::erfc((mean - x) / (deviation * core::f64::consts::SQRT_2)),
            false => weight * f64::from(u8::from(x >= *mean)),
        };
        parts.iter().map(of).sum::<f64>() / sum
    };
    let quantile = |share: f64| {
        let (mut low, mut high) = (low, high);
        // 2⁻⁶⁰ of the range is below rounding.
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if below(middle) < share { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    };
    Some(Interval { median: quantile(0.5), low: quantile(0.025), high: quantile(0.975) })
}
