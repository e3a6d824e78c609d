//! Errors of a geometry: a quadratic form through the values of geometries near the best one.

use super::covariance::covariance;
use super::{Free, Geometry, ModelError, ModelErrors, Sample, bounded};
use nalgebra::{DMatrix, DVector};

/// Errors from the values near the best geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// The lowest point of the quadratic form, inside the bounds.
    pub geometry: Geometry,
    /// Standard deviation of each free parameter, in its own unit.
    pub sigma: Vec<f64>,
    /// True if the data say nothing about a free parameter: its standard deviation is that of its prior.
    pub open: Vec<bool>,
    /// Correlations of the free parameters, row by row.
    pub correlation: Vec<f64>,
    /// Standard deviation of the values about the form: the ripples of χ²/2.
    pub ripple: f64,
    /// Part of `sigma` that the model makes itself.
    pub own: ModelErrors,
}

/// Geometries for each coefficient of the form, at least.
const PLENTY: usize = 2;
/// The form is trusted where it rises by so many ripples.
const CLEAR: f64 = 4.0;

impl Spread {
    /// Fits geometries sorted by their values, of data with this χ²/N at the best; none if there are too few, or the values
    /// have no lowest point that is clear of their ripples.
    ///
    /// The form goes through the fewest of the best geometries over which it rises clearly above the ripples: values that
    /// differ from it because rays next to the critical curve come and go. Ripples of standard deviation s hide the
    /// lowest point within the region where the form rises by s: the covariance is 1 + 2 s times the inverse of its
    /// second derivatives, and χ²/N times that where it is above 1. Directions along which the values do not rise have
    /// the spread of the priors.
    pub fn of(free: &[Free], samples: &[Sample], reduced_chi2: f64) -> Option<Self> {
        let n = free.len();
        let best = samples.first()?;
        let fewest = PLENTY * (n + 1) * (n + 2) / 2;
        let counts = core::iter::successors(Some(fewest), |count| Some(count * 5 / 4 + 1));
        let counts = counts.take_while(|count| *count <= samples.len());
        counts.filter_map(|count| Self::through(free, best, &samples[..count], reduced_chi2)).next()
    }

    /// Moves the errors to a geometry near by, to which another `source` leads: the distance is an error of the model.
    #[must_use]
    pub fn moved(&self, free: &[Free], geometry: Geometry, source: &'static str) -> Self {
        let step = free.iter().map(|Free { parameter, .. }| {
            parameter.difference(geometry.get(*parameter), self.geometry.get(*parameter))
        });
        let step: Vec<f64> = step.collect();
        let both: Vec<f64> = step.iter().flat_map(|a| step.iter().map(move |b| a * b)).collect();
        let mut moved = Self { geometry, ..self.widened(free, &both) };
        moved.own.known.push(ModelError { source, covariance: both });
        moved
    }

    /// Adds errors that the model has of itself.
    #[must_use]
    pub fn beside(self, free: &[Free], own: ModelErrors) -> Self {
        let known = own.known.iter();
        let whole = known.fold(self, |spread, error| spread.widened(free, &error.covariance));
        Self { own, ..whole }
    }

    /// Returns the effect of χ²/2 above that of a right model on errors that have grown with χ²/N already; none if there is no
    /// excess.
    pub fn unexplained(&self, excess: f64, reduced_chi2: f64) -> Option<ModelError> {
        let (n, factor) = (self.sigma.len(), 2.0 * excess / reduced_chi2.max(1.0));
        let of = |a: usize, b: usize| self.correlation[a * n + b] * self.sigma[a] * self.sigma[b];
        let covariance = (0..n * n).map(|k| factor * of(k / n, k % n)).collect();
        (excess > 0.0).then_some(ModelError { source: ModelError::UNEXPLAINED, covariance })
    }

    /// Takes a covariance, row by row in the parameters' own units.
    pub(in crate::fit) fn of_covariance(
        free: &[Free],
        geometry: Geometry,
        covariance: &[f64],
        ripple: f64,
    ) -> Self {
        let n = free.len();
        let whole: Vec<f64> = (0..n).map(|k| covariance[k * n + k].sqrt()).collect();
        let correlation = (0..n * n).map(|k| covariance[k] / (whole[k / n] * whole[k % n]));
        let correlation = correlation.collect();
        // No parameter is less known than before the data.
        let sigma = free.iter().zip(whole).map(|(free, x)| x.min(free.prior.deviation()));
        let sigma: Vec<f64> = sigma.collect();
        let open = free.iter().zip(&sigma).map(|(free, sigma)| free.is_open(*sigma)).collect();
        Self { geometry, sigma, open, correlation, ripple, own: ModelErrors::default() }
    }

    /// Adds errors of this covariance, row by row in the parameters' own units.
    fn widened(&self, free: &[Free], more: &[f64]) -> Self {
        let n = free.len();
        let own = |k: usize| self.correlation[k] * self.sigma[k / n] * self.sigma[k % n];
        let covariance: Vec<f64> = (0..n * n).map(|k| own(k) + more[k]).collect();
        let wide = Self::of_covariance(free, self.geometry, &covariance, self.ripple);
        Self { own: self.own.clone(), ..wide }
    }

    fn through(free: &[Free], best: &Sample, taken: &[Sample], reduced_chi2: f64) -> Option<Self> {
        let n = free.len();
        let form = Form::fit(free, best, taken)?;
        let rise = taken.last()?.value - best.value;
        if rise < CLEAR * form.ripple {
            return None;
        }
        let bends = DMatrix::from_row_slice(n, n, &form.bends);
        let inflation = (1.0 + 2.0 * form.ripple) * reduced_chi2.max(1.0);
        let covariance = covariance(free, &best.geometry, &bends, inflation)?;
        // Errors grow with the inflation, the way to the lowest point does not.
        let lowest = -&covariance * DVector::from_column_slice(&form.slopes) / inflation;
        let sigma = |k: usize| covariance[(k, k)].sqrt();
        let correlation = (0..n * n).map(|at| {
            let (row, column) = (at / n, at % n);
            covariance[(row, column)] / (sigma(row) * sigma(column))
        });
        let unit = |k: usize| free[k].parameter.scale();
        let geometry = (0..n).fold(best.geometry, |geometry, k| {
            // Not beyond the geometries that were evaluated.
            let step = lowest[k].clamp(-form.reach[k], form.reach[k]) * unit(k);
            geometry.with(free[k].parameter, best.geometry.get(free[k].parameter) + step)
        });
        let geometry = bounded(free, geometry, Free::inside);
        Some(Self {
            geometry,
            sigma: (0..n).map(|k| sigma(k) * unit(k)).collect(),
            open: (0..n).map(|k| free[k].is_open(sigma(k) * unit(k))).collect(),
            correlation: correlation.collect(),
            ripple: form.ripple,
            own: ModelErrors::default(),
        })
    }
}

/// c + slopes·u + u·bends·u/2 about the best geometry, u in units of each parameter's scale.
struct Form {
    slopes: Vec<f64>,
    bends: Vec<f64>,
    ripple: f64,
    /// Distances of geometries from the best one.
    reach: Vec<f64>,
}

impl Form {
    fn fit(free: &[Free], best: &Sample, samples: &[Sample]) -> Option<Self> {
        let n = free.len();
        let place = |sample: &Sample| -> Vec<f64> {
            let of = |free: &Free| {
                let (a, b) =
                    (sample.geometry.get(free.parameter), best.geometry.get(free.parameter));
                free.parameter.difference(a, b) / free.parameter.scale()
            };
            free.iter().map(of).collect()
        };
        let places: Vec<Vec<f64>> = samples.iter().map(place).collect();
        let columns = (n + 1) * (n + 2) / 2;
        let row = |u: &Vec<f64>| -> Vec<f64> {
            let squares = (0..n).flat_map(|a| (a..n).map(move |b| (a, b)));
            let squares =
                squares.map(|(a, b)| if a == b { 0.5 * u[a] * u[a] } else { u[a] * u[b] });
            core::iter::once(1.0).chain(u.iter().copied()).chain(squares).collect()
        };
        let rows: Vec<f64> = places.iter().flat_map(row).collect();
        let matrix = DMatrix::from_row_slice(samples.len(), columns, &rows);
        let values = samples.iter().map(|sample| sample.value - best.value);
        let right = DVector::from_iterator(samples.len(), values);
        let solution = matrix.clone().svd(true, true).solve(&right, 1e-10).ok()?;
        let left = (&right - &matrix * &solution).norm_squared();
        let freedom = samples.len().saturating_sub(columns).max(1);
        let mut bends = vec![0.0; n * n];
        let mut at = n + 1;
        for a in 0..n {
            for b in a..n {
                bends[a * n + b] = solution[at];
                bends[b * n + a] = solution[at];
                at += 1;
            }
        }
        let reach = |k: usize| places.iter().fold(0.0f64, |most, u| most.max(u[k].abs()));
        Some(Self {
            slopes: solution.rows(1, n).iter().copied().collect(),
            bends,
            ripple: (left / freedom as f64).sqrt(),
            reach: (0..n).map(reach).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::geometry::Parameter;
    use crate::fit::geometry::tests::uniform;
    use core::f64::consts::PI;

    /// A step along the first parameter widens it alone; one along both makes errors that are nearly those of the step.
    #[test]
    fn exact_a_step_is_part_of_the_error() {
        let free = free();
        let geometry = Geometry::new(0.1, 1.0);
        let spread = Spread {
            geometry,
            sigma: vec![0.03, 0.02],
            open: vec![false, false],
            correlation: vec![1.0, 0.5, 0.5, 1.0],
            ripple: 0.0,
            own: ModelErrors::default(),
        };
        let names = free.map(|free| free.parameter);
        let first =
            spread.moved(&free, geometry.with(names[0], geometry.get(names[0]) + 0.04), "other");
        assert!((first.sigma[0] - 0.05).abs() < 1e-12 && (first.sigma[1] - 0.02).abs() < 1e-12);
        let before = 0.5 * 0.03 * 0.02;
        assert!((first.correlation[1] * 0.05 * 0.02 - before).abs() < 1e-12);
        let far = names.into_iter().fold(geometry, |far, name| far.with(name, far.get(name) + 0.2));
        let both = spread.moved(&free, far, "other");
        assert!(both.correlation[1] > 0.98 && both.geometry == far, "{both:?}");
    }

    fn free() -> [Free; 2] {
        [uniform(Parameter::Spin, -0.9, 0.9), uniform(Parameter::Inclination, 0.0, 3.0)]
    }

    #[test]
    fn exact_covariance_of_a_paraboloid() {
        let free = free();
        let center = Geometry::new(0.31, 1.02);
        // Inverse covariance.
        let (a, b, c) = (1.0 / 0.0025, 300.0, 1.0 / 0.0009);
        let value = |geometry: &Geometry| {
            let x = geometry.get(Parameter::Spin) - 0.31;
            let y = geometry.get(Parameter::Inclination) - 1.02;
            0.5 * (a * x * x + 2.0 * b * x * y + c * y * y)
        };
        let sample = |k: usize| {
            let angle = 2.4 * k as f64;
            let r = 0.1 * ((k + 1) as f64 / 60.0).sqrt();
            let geometry = center.with(Parameter::Spin, 0.31 + 0.02 + r * angle.cos());
            let geometry = geometry.with(Parameter::Inclination, 1.02 + 0.6 * r * angle.sin());
            Sample { geometry, value: value(&geometry) }
        };
        let mut samples: Vec<Sample> = (0..60).map(sample).collect();
        samples.sort_by(|a, b| a.value.total_cmp(&b.value));
        let found = Spread::of(&free, &samples, 0.9).unwrap();
        assert!(found.ripple < 1e-9 && (found.geometry.get(Parameter::Spin) - 0.31).abs() < 1e-9);
        let determinant = a * c - b * b;
        assert!((found.sigma[0] - (c / determinant).sqrt()).abs() < 1e-9);
        assert!((found.sigma[1] - (a / determinant).sqrt()).abs() < 1e-9);
        assert!((found.correlation[1] + b / (a * c).sqrt()).abs() < 1e-9);
        assert!(Spread::of(&free, &samples[..5], 1.0).is_none());
    }

    /// A lowest point beyond south lies on the other side of it, not at the end of the prior.
    #[test]
    fn exact_lowest_points_go_on_around_the_circle() {
        let free = [uniform(Parameter::PositionAngle, -PI, PI)];
        let sample = |k: usize| {
            let angle = PI - 0.03 + 5e-4 * f64::from(k as u32);
            let geometry = Geometry::new(0.0, 1.0).with(Parameter::PositionAngle, angle);
            Sample { geometry, value: 0.5 * ((angle - 181f64.to_radians()) / 0.01).powi(2) }
        };
        let mut samples: Vec<Sample> = (0..60).map(sample).collect();
        samples.sort_by(|a, b| a.value.total_cmp(&b.value));
        let found = Spread::of(&free, &samples, 1.0).unwrap();
        let angle = found.geometry.get(Parameter::PositionAngle).to_degrees();
        // No farther than geometries were looked at.
        assert!((-180.0..-179.0).contains(&angle), "{angle}");
    }

    /// Values that do not depend on the spin.
    #[test]
    fn exact_what_is_not_seen_leaves_the_errors_of_the_rest() {
        let free = free();
        let sample = |k: usize| {
            let (angle, r) = (2.4 * k as f64, 0.1 * ((k + 1) as f64 / 60.0).sqrt());
            let geometry = Geometry::new(0.31 + 4.0 * r * angle.cos(), 1.02 + r * angle.sin());
            let y = geometry.get(Parameter::Inclination) - 1.03;
            Sample { geometry, value: 0.5 * (y / 0.02).powi(2) }
        };
        let mut samples: Vec<Sample> = (0..60).map(sample).collect();
        samples.sort_by(|a, b| a.value.total_cmp(&b.value));
        let found = Spread::of(&free, &samples, 1.0).unwrap();
        assert_eq!(found.open, [true, false]);
        assert!((found.sigma[0] - 1.8 / 12f64.sqrt()).abs() < 1e-9, "{:?}", found.sigma);
        assert!((found.sigma[1] - 0.02).abs() < 1e-5, "{:?}", found.sigma);
        assert!((found.geometry.get(Parameter::Inclination) - 1.03).abs() < 1e-4);
        assert!(found.correlation[1].abs() < 1e-6);
    }
}
