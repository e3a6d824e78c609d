//! Geometries that were weighed by the light curve of a flare in an orbital band, as band.json keeps them.

use crate::Error;
use crate::fit::BackgroundDatum;
use crate::fit::band::{Background, Band, Interval};
use crate::fit::settings::BackgroundSettings;
use crate::fit::setup::{self, BandGeometry, BandScan};
use crate::null::or_nan;
use crate::recovery::{Choice, Problem};
use serde::{Deserialize, Serialize};

/// Bins of periods.
const BINS: usize = 24;

/// Probabilities of values, in their order.
type Shares = Vec<[f64; 2]>;

/// Geometries and bands, with their probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BandResults {
    /// Angle from the spin to the observer, degrees.
    pub inclination_deg: Median,
    /// Its probabilities.
    pub inclinations: Shares,
    /// Angular velocity over that of the law.
    pub rotation_factor: Probabilities,
    /// Position angle of the spin, degrees east of north.
    pub position_angle_deg: Probabilities,
    /// Probability that matter turns clockwise on the sky.
    pub clockwise: Option<f64>,
    /// Radius of the band, M.
    pub radius: Median,
    /// Its probabilities.
    pub radii: Shares,
    /// The most probable band.
    pub band: Band,
    /// Distance of the emission from the axis, M.
    pub emission_radius: Interval,
    /// Its azimuth at the reference time, degrees.
    pub azimuth_deg: Interval,
    /// Period of the orbit, minutes.
    pub period_min: Median,
    /// Its probabilities.
    pub periods: Shares,
    /// ln of the probability of the data with a flare over that without one.
    pub ln_bayes_factor: Option<f64>,
    /// Background of the flare, where that is assumed.
    pub background: Option<Background>,
    /// Settings at an end of which the background is: others beyond it may be more probable.
    pub background_ends: Vec<String>,
    /// Expected background at all data.
    pub background_jy: Option<Vec<BackgroundDatum>>,
    /// χ² of the samples that were not fitted, over their number.
    pub validation_chi2_per_datum: Option<f64>,
    /// Simulated band.
    pub truth: TrueBand,
    /// All geometries.
    pub geometries: Vec<WeighedGeometry>,
}

/// Median and 95 % interval, with the most probable value where there is one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Median {
    /// The value of the most probable geometry.
    pub best: Option<f64>,
    /// Median and interval.
    #[serde(flatten)]
    pub interval: Interval,
}

/// Probabilities of values, and the most probable one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probabilities {
    /// The value of the most probable geometry.
    #[serde(deserialize_with = "or_nan")]
    pub best: f64,
    /// Values with their probabilities.
    pub probabilities: Shares,
}

/// Simulated band.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueBand {
    /// Angle from the spin to the observer, degrees.
    pub inclination_deg: Option<f64>,
}

/// A geometry: inclination, factor of the rotation, position angle, and ln of its probability over that of the best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeighedGeometry(f64, f64, f64, #[serde(deserialize_with = "or_nan")] f64);

impl BandResults {
    /// Sums up what a search has found.
    ///
    /// # Errors
    /// If the settings that were simulated are not those of a fit.
    pub fn new(Problem { settings: file, .. }: &Problem, scan: &BandScan) -> Result<Self, Error> {
        let best = &scan.geometries[scan.best];
        let inclinations = shares(&scan.geometries, |geometry| geometry.inclination_deg);
        let probabilities = |of: fn(&BandGeometry) -> f64| Probabilities {
            best: of(best),
            probabilities: shares(&scan.geometries, of),
        };
        let weighed = |of: &BandGeometry| {
            let ln = of.ln_posterior - best.ln_posterior;
            WeighedGeometry(of.inclination_deg, of.rotation_factor, of.position_angle_deg, ln)
        };
        let truth = match file.simulation {
            Some(_) => Some(file.simulated()?.observer.inclination_deg.value()),
            None => None,
        };
        let rate = setup::motion(file, Vec::new())?.velocity.rate(best.band.radius);
        let upwards = rate * file.motion.axis.map_or(1.0, |axis| axis[2]);
        let (radii, periods) = (radii(scan), periods(scan));
        let tried = file.band.as_ref().and_then(|band| band.background.as_ref());
        Ok(Self {
            inclination_deg: median(&inclinations, Some(best.inclination_deg)),
            inclinations,
            rotation_factor: probabilities(|geometry| geometry.rotation_factor),
            position_angle_deg: probabilities(|geometry| geometry.position_angle_deg),
            clockwise: Some(clockwise(scan, upwards)),
            radius: median(&radii, Some(best.band.radius)),
            radii,
            band: best.band,
            // A normal distribution may reach below the axis.
            emission_radius: Interval { low: scan.radius.low.max(0.0), ..scan.radius },
            azimuth_deg: azimuth(scan.azimuth),
            period_min: median(&periods, None),
            periods: binned(&periods, BINS),
            ln_bayes_factor: scan.ln_bayes_factor,
            background: scan.background.is_some().then_some(best.band.background),
            background_ends: scan
                .background
                .as_ref()
                .and(tried)
                .map_or_else(Vec::new, |tried| ends(tried, &best.band.background)),
            background_jy: scan.background.clone(),
            validation_chi2_per_datum: scan.validation,
            truth: TrueBand { inclination_deg: truth },
            geometries: scan.geometries.iter().map(weighed).collect(),
        })
    }

    /// Returns what the rest of a fit goes on with; none where no geometry is the best.
    pub fn choice(&self) -> Option<Choice> {
        Some(Choice::Band {
            inclination_deg: self.inclination_deg.best?,
            position_angle_deg: self.position_angle_deg.best,
            rotation_factor: self.rotation_factor.best,
            background: self.background_jy.clone(),
        })
    }

    /// Lists numbers for tables, by keys of results: of 95 % intervals, of the band, and the probability that matter turns as
    /// the law says.
    pub fn numbers(&self) -> [(&'static str, Option<f64>); 16] {
        let (inclination, period) = (self.inclination_deg.interval, self.period_min.interval);
        let (radius, azimuth) = (self.emission_radius, self.azimuth_deg);
        [
            ("band_inclination_deg", Some(inclination.median)),
            ("band_inclination_low_deg", Some(inclination.low)),
            ("band_inclination_high_deg", Some(inclination.high)),
            ("band_radius", Some(radius.median)),
            ("band_radius_low", Some(radius.low)),
            ("band_radius_high", Some(radius.high)),
            ("band_azimuth_deg", Some(azimuth.median)),
            ("band_azimuth_low_deg", Some(azimuth.low)),
            ("band_azimuth_high_deg", Some(azimuth.high)),
            ("band_period_min", Some(period.median)),
            ("band_period_low_min", Some(period.low)),
            ("band_period_high_min", Some(period.high)),
            ("band_ln_bayes_factor", self.ln_against_background()),
            ("band_forward", Some(self.forward())),
            ("band_clockwise", self.clockwise),
            ("band_validation", self.validation_chi2_per_datum),
        ]
    }

    /// Returns the probability that matter turns as the law says.
    pub fn forward(&self) -> f64 {
        let turns = self.rotation_factor.probabilities.iter();
        turns.filter(|[factor, _]| *factor > 0.0).map(|[_, share]| share).sum()
    }
}

/// The settings whose shortest time or largest variation a background has: what is faster or stronger looks like a flare.
fn ends(tried: &BackgroundSettings, found: &Background) -> Vec<String> {
    let least = tried.correlation_min.iter().copied().fold(f64::INFINITY, f64::min);
    let most = tried.variation_jy.iter().copied().fold(0.0, f64::max);
    let are_lists = [&tried.correlation_min, &tried.variation_jy].map(|list| list.len() > 1);
    let mut all = Vec::new();
    if are_lists[0] && found.variation > 0.0 && found.minutes == least {
        all.push("band.background.correlation_min".to_owned());
    }
    if are_lists[1] && found.variation > 0.0 && found.variation == most {
        all.push("band.background.variation_jy".to_owned());
    }
    all
}

/// Shares of the probability of values, in their order.
fn shares(geometries: &[BandGeometry], of: fn(&BandGeometry) -> f64) -> Vec<[f64; 2]> {
    let most =
        geometries.iter().map(|geometry| geometry.ln_posterior).fold(f64::NEG_INFINITY, f64::max);
    let mut all: Vec<[f64; 2]> = Vec::new();
    for geometry in geometries {
        let share = (geometry.ln_posterior - most).exp();
        // Equal values are equal to the bit: they come from the same settings.
        match all.iter_mut().find(|[value, _]| *value == of(geometry)) {
            Some([_, sum]) => *sum += share,
            None => all.push([of(geometry), share]),
        }
    }
    normalised(all)
}

fn normalised(mut all: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let sum: f64 = all.iter().map(|[_, share]| share).sum();
    all.iter_mut().for_each(|[_, share]| *share /= sum);
    all
}

/// Returns the probability of each radius in each geometry, up to a factor.
fn orbits(scan: &BandScan) -> Vec<Vec<f64>> {
    let all = scan.geometries.iter().flat_map(|geometry| geometry.by_radius.iter().copied());
    let most = all.fold(f64::NEG_INFINITY, f64::max);
    let of = |geometry: &BandGeometry| {
        // Directions are spread over the sphere; the floor is for a scan of nothing but a pole.
        let prior = geometry.inclination_deg.to_radians().sin().max(1e-6);
        geometry.by_radius.iter().map(|ln| (ln - most).exp() * prior).collect()
    };
    scan.geometries.iter().map(of).collect()
}

/// Shares of the radii of all geometries.
fn radii(scan: &BandScan) -> Vec<[f64; 2]> {
    let orbits = orbits(scan);
    let share = |k: usize| orbits.iter().map(|of_geometry| of_geometry[k]).sum::<f64>();
    normalised(scan.radii.iter().enumerate().map(|(k, radius)| [*radius, share(k)]).collect())
}

/// Places over which the share of a radius is spread.
const PLACES: usize = 32;

/// Shares of the periods of the orbits of all geometries, minutes; where matter stands still there is none.
fn periods(scan: &BandScan) -> Vec<[f64; 2]> {
    let all = scan.periods_min.iter().zip(orbits(scan));
    normalised(all.flat_map(|(periods, shares)| spread(periods, &shares)).collect())
}

/// Spreads the share of each period half way to those of the next radii: many geometries have the same few.
fn spread(periods: &[f64], shares: &[f64]) -> Vec<[f64; 2]> {
    let mut all = Vec::new();
    let half_way = |k: usize, to: Option<usize>| {
        let other = to.and_then(|to| periods.get(to)).filter(|period| period.is_finite());
        other.map_or(periods[k], |other| 0.5 * (periods[k] + other))
    };
    for (k, share) in shares.iter().enumerate().filter(|(k, _)| periods[*k].is_finite()) {
        let [from, to] = [k.checked_sub(1), Some(k + 1)].map(|to| half_way(k, to));
        let place = |j: usize| from + (to - from) * (j as f64 + 0.5) / PLACES as f64;
        all.extend((0..PLACES).map(|j| [place(j), share / PLACES as f64]));
    }
    all
}

/// Shares in so many bins of the same width, each at its middle.
fn binned(shares: &[[f64; 2]], bins: usize) -> Vec<[f64; 2]> {
    let (Some([low, _]), Some([high, _])) = (shares.first(), shares.last()) else {
        return Vec::new();
    };
    // A single period still needs bins of some width.
    let width = (high - low).max(1e-9 * high.abs()) / bins as f64;
    let mut all: Vec<[f64; 2]> = (0..bins).map(|k| [low + (k as f64 + 0.5) * width, 0.0]).collect();
    for [value, share] in shares {
        all[(((value - low) / width) as usize).min(bins - 1)][1] += share;
    }
    all
}

/// The probability that matter turns clockwise on the sky, where the law of motion turns it so fast, right-handed about the
/// spin.
fn clockwise(scan: &BandScan, upwards: f64) -> f64 {
    let towards = |geometry: &BandGeometry| {
        geometry.rotation_factor * geometry.inclination_deg.to_radians().cos()
    };
    // Seen edge-on there is no sense; standing matter has none.
    let share = |towards: f64| match towards * upwards.signum() * f64::from(upwards != 0.0) {
        x if x.abs() < 1e-9 => 0.5,
        x => f64::from(u8::from(x < 0.0)),
    };
    shares(&scan.geometries, towards).iter().map(|[of, probability]| share(*of) * probability).sum()
}

/// The value below which a part of the probability lies, each share spread evenly half way to its neighbours.
fn quantile(shares: &[[f64; 2]], part: f64) -> f64 {
    let edge = |k: usize| match (k.checked_sub(1).map(|k| shares[k][0]), shares.get(k)) {
        (Some(before), Some([after, _])) => 0.5 * (before + after),
        (None, Some([first, _])) => *first,
        (before, None) => before.unwrap_or(f64::NAN),
    };
    let mut below = 0.0;
    for (k, [_, share]) in shares.iter().enumerate() {
        // Nothing can be interpolated within a share of 0.
        if below + share >= part && *share > 0.0 {
            return edge(k) + (edge(k + 1) - edge(k)) * ((part - below) / share).clamp(0.0, 1.0);
        }
        below += share;
    }
    edge(shares.len())
}

/// Median and 95 % interval.
fn median(shares: &[[f64; 2]], best: Option<f64>) -> Median {
    let [low, median, high] = [0.025, 0.5, 0.975].map(|part| quantile(shares, part));
    Median { best, interval: Interval { median, low, high } }
}

/// An interval of azimuths in degrees, its median in [0°, 360°).
fn azimuth(Interval { median, low, high }: Interval) -> Interval {
    let [median, low, high] = [median, low, high].map(f64::to_degrees);
    // The ends turn with the median: they may lie below 0° and above 360°.
    let turns = median.rem_euclid(360.0) - median;
    Interval { median: median + turns, low: low + turns, high: high + turns }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::linear::Roughness;

    #[test]
    fn exact_bins_hold_all_shares() {
        let bins = binned(&[[1.0, 0.2], [1.5, 0.3], [3.0, 0.5]], 2);
        assert_eq!(bins, [[1.5, 0.5], [2.5, 0.5]]);
        assert_eq!(binned(&[[2.0, 1.0]], 3)[0][1], 1.0);
        assert!(binned(&[], 3).is_empty());
    }

    /// The shortest time and the largest variation of lists are ends of them; one value alone is known.
    #[test]
    fn exact_backgrounds_at_the_end_of_lists_are_named() {
        let tried = |minutes: &[f64]| BackgroundSettings {
            constant_jy: 0.1,
            variation_jy: vec![0.0, 0.05],
            correlation_min: minutes.to_vec(),
            matern: vec![Roughness::Half],
        };
        let found = |minutes, variation| Background { minutes, variation, ..Background::NONE };
        assert_eq!(
            ends(&tried(&[20.0, 60.0]), &found(20.0, 0.02)),
            ["band.background.correlation_min"]
        );
        assert_eq!(ends(&tried(&[20.0]), &found(20.0, 0.05)), ["band.background.variation_jy"]);
        assert!(ends(&tried(&[20.0, 60.0]), &found(60.0, 0.02)).is_empty());
        assert!(ends(&tried(&[1.0, 60.0]), &Background::NONE).is_empty());
    }

    /// However many geometries have a period, it is known no better than the radii are apart.
    #[test]
    fn exact_periods_are_spread_half_way_to_the_next() {
        let of = |shares| spread(&[60.0, 80.0, 120.0, f64::INFINITY], shares);
        let one = of(&[0.0, 1.0, 0.0, 0.0]);
        let shares = normalised([one.clone(), one.clone(), one].concat());
        for (part, expected) in [(0.025, 70.75), (0.5, 85.0), (0.975, 99.25)] {
            let found = quantile(&shares, part);
            assert!((found - expected).abs() < 1.0, "{part}: {found}");
        }
        let last = normalised(of(&[0.0, 0.0, 1.0, 5.0]));
        assert!((quantile(&last, 1.0) - 120.0).abs() < 1.0);
    }

    /// Quantiles of equal shares are those of a straight line.
    #[test]
    fn exact_quantiles_of_shares() {
        let shares: Vec<[f64; 2]> = (0..11).map(|k| [f64::from(k), 1.0]).collect();
        let shares = normalised(shares);
        assert!((quantile(&shares, 0.5) - 5.0).abs() < 1e-12);
        assert!(
            (quantile(&shares, 0.0)).abs() < 1e-12 && (quantile(&shares, 1.0) - 10.0).abs() < 1e-9
        );
        let one = normalised(vec![[3.0, 0.0], [4.0, 1.0], [5.0, 0.0]]);
        assert!(
            (quantile(&one, 0.5) - 4.0).abs() < 1e-12 && (quantile(&one, 0.1) - 3.6).abs() < 1e-12
        );
    }
}
