//! Gauss–Newton steps to the best geometry, with the volume solved for in each (variable projection, Golub & Pereyra
//! 1973).
//!
//! Images are differentiated by differences as wide as the ripples that rays next to the critical curve make: exact
//! derivatives are those of single ripples.

use super::covariance::covariance;
use super::problem::{Estimate, Free, GeometryProblem, bounded, crosses_pole};
use super::quadratic_form::in_own_units;
use super::{Geometry, Parameter};
use crate::Error;
use crate::fit::linear::{Profile, Voxels};
use crate::fit::{Field, ForwardModel};
use core::f64::consts::PI;
use kerrlight_common::simd::Float;
use nalgebra::{DMatrix, DVector};

/// End of Gauss–Newton steps.
#[derive(Clone, Debug)]
pub struct Polished {
    /// The best geometry and its volume.
    pub best: Estimate,
    /// Covariance of the free parameters row by row, in their own units: the inverse of half the second derivatives of
    /// χ² with the volume solved for, and of those of the priors; the spread of the priors where the data do not decide.
    pub covariance: Vec<f64>,
    /// Change of the best volume with each free parameter, per its scale.
    pub responses: Vec<Vec<f64>>,
    /// End of a further step; none where there is no bowl.
    pub further: Option<Geometry>,
}

/// Steps, at most.
const STEPS: usize = 12;
/// Conjugate gradients by which the volume follows the geometry, at most.
const FOLLOWING: usize = 300;
/// Half the distance of a difference, in units of [`Parameter::scale`](super::Parameter::scale).
const WIDTH: f64 = 0.1;
/// Parts of a step that are tried.
const PARTS: [f64; 4] = [1.0, 0.5, 0.25, 0.1];
/// Steps that promise to lower the value by less than this are not taken: a tenth of a standard deviation.
const ENOUGH: f64 = 0.005;

/// Slope and second derivatives of the value with respect to the free parameters in units of their scales.
pub(super) struct Bowl {
    pub slopes: DVector<f64>,
    pub bends: DMatrix<f64>,
    /// Responses of the best volume.
    pub responses: Vec<Vec<f64>>,
}

impl Bowl {
    /// The Newton step, and what it promises to lower the value by; none where it is no bowl.
    fn step(&self) -> Option<(DVector<f64>, f64)> {
        let step = -self.bends.clone().cholesky()?.solve(&self.slopes);
        let promise = -0.5 * step.dot(&self.slopes);
        Some((step, promise))
    }
}

impl<T: Float> GeometryProblem<'_, T> {
    /// Steps from a geometry and its volume to the best one near it.
    ///
    /// # Errors
    /// If a number is out of its range, or χ² is not finite.
    pub fn polish(&self, start: &Estimate) -> Result<Polished, Error> {
        // The start may be of other pixels or solved for a shorter time; slopes hold about a volume
        // that is the best one of this problem.
        let mut best = self.solve_from(start.geometry, &start.x)?;
        let mut bowl = self.bowl(&best)?;
        for _ in 0..STEPS {
            let Some(lower) = self.descend(&best, &bowl)? else { break };
            best = lower;
            bowl = self.bowl(&best)?;
        }
        let covariance = self.covariance(&best.geometry, &bowl);
        let further = bowl.step().map(|(step, _)| self.moved(&best.geometry, step.as_slice()));
        Ok(Polished { best, covariance, responses: bowl.responses, further })
    }

    /// The best volume of a geometry, from that of another one.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_from(&self, geometry: Geometry, x: &[f64]) -> Result<Estimate, Error> {
        let forward: ForwardModel<T> = self.model.forward(&geometry)?;
        let least = self.linear(&forward).settled(Some(x), self.effort.patience)?;
        Ok(self.estimate(geometry, least))
    }

    /// The first part of a Newton step that lowers the value; none if none does.
    fn descend(&self, from: &Estimate, bowl: &Bowl) -> Result<Option<Estimate>, Error> {
        let Some((step, _)) = bowl.step().filter(|(_, promise)| *promise >= ENOUGH) else {
            return Ok(None);
        };
        for part in PARTS {
            let step: Vec<f64> = step.iter().map(|step| part * step).collect();
            let geometry = self.moved(&from.geometry, &step);
            // The linear response of the volume leaves little to solve for.
            let x = self.along(from, &bowl.responses, &step);
            let there = self.solve_from(geometry, &x)?;
            if there.value < from.value {
                return Ok(Some(there));
            }
        }
        Ok(None)
    }

    /// Returns the best volume at a distance from another geometry, in units of scales; bounds hold it.
    pub(super) fn along(&self, from: &Estimate, responses: &[Vec<f64>], step: &[f64]) -> Vec<f64> {
        let mut x = from.x.clone();
        for (response, step) in responses.iter().zip(step) {
            x.iter_mut().zip(response).for_each(|(x, moves)| *x += step * moves);
        }
        x.iter_mut().for_each(|x| *x = x.clamp(0.0, self.upper));
        x
    }

    /// A geometry at a distance, in units of the parameters' scales; bounds hold it.
    pub(super) fn moved(&self, from: &Geometry, step: &[f64]) -> Geometry {
        let moved = self.free.iter().zip(step).fold(*from, |geometry, (free, step)| {
            let value = from.get(free.parameter) + step * free.parameter.scale();
            geometry.with(free.parameter, value)
        });
        bounded(self.free, moved, Free::inside)
    }

    /// The largest part of a step, at most all of it, that no bound has to hold.
    pub(super) fn part_within(&self, from: &Geometry, step: &[f64]) -> f64 {
        let part = |(free, step): (&Free, &f64)| {
            let ([low, high], here) = (free.bounds(), from.get(free.parameter));
            let step = step * free.parameter.scale();
            let bound = if step > 0.0 { high } else { low };
            let is_pole = free.parameter == Parameter::Inclination && [0.0, PI].contains(&bound);
            let goes_on = free.is_circle() || is_pole && crosses_pole(self.free, bound);
            if goes_on || step == 0.0 { 1.0 } else { ((bound - here) / step).max(0.0) }
        };
        self.free.iter().zip(step).map(part).fold(1.0, f64::min)
    }

    fn covariance(&self, geometry: &Geometry, bowl: &Bowl) -> Vec<f64> {
        let n = self.free.len();
        let inverse = covariance(self.free, geometry, &bowl.bends, 1.0)
            // Callers ask for finite numbers to learn whether there is a covariance.
            .unwrap_or_else(|| DMatrix::from_diagonal_element(n, n, f64::INFINITY));
        in_own_units(self.free, &inverse)
    }

    /// Slope and second derivatives at a geometry with its best volume.
    pub(super) fn bowl(&self, at: &Estimate) -> Result<Bowl, Error> {
        let forward: ForwardModel<T> = self.model.forward(&at.geometry)?;
        let n = self.free.len();
        let mut moved = self.image_differences(at, &DMatrix::from_diagonal_element(n, n, WIDTH))?;
        moved.iter_mut().flatten().for_each(|x| *x *= T::of(1.0 / WIDTH));
        let Profile { slopes, bends, responses } =
            self.linear(&forward).profile(&at.x, &moved, FOLLOWING)?;
        // Profiles are those of χ², beside a prior those of its mean over the data.
        let half = 0.5 * self.scale * self.unit();
        let mut bowl = Bowl {
            slopes: DVector::from_vec(slopes) * half,
            bends: DMatrix::from_row_slice(n, n, &bends) * half,
            responses,
        };
        for (k, free) in self.free.iter().enumerate() {
            let scale = free.parameter.scale();
            let [slope, bend] = free.curve(at.geometry.get(free.parameter), WIDTH * scale);
            bowl.slopes[k] += slope * scale;
            bowl.bends[(k, k)] += bend * scale * scale;
        }
        Ok(bowl)
    }

    /// Returns the second derivatives with differences of images as wide as some steps to both sides, per step.
    ///
    /// Noise makes the slope of a value between both ends of a step scatter with this variance. They are more than the rise of
    /// that value: the volume follows noise as well, which differs from geometry to geometry.
    pub(super) fn scatter_of_slopes(
        &self,
        at: &Estimate,
        steps: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, Error> {
        let forward: ForwardModel<T> = self.model.forward(&at.geometry)?;
        let differences = self.image_differences(at, steps)?;
        let Profile { bends, .. } =
            self.linear(&forward).profile(&at.x, &differences, FOLLOWING)?;
        let n = steps.ncols();
        Ok(DMatrix::from_row_slice(n, n, &bends) * (0.5 * self.scale * self.unit()))
    }

    /// Returns the change of images of a held volume per step, in units of scales, from differences to both sides as far as bounds
    /// allow.
    fn image_differences(&self, at: &Estimate, steps: &DMatrix<f64>) -> Result<Vec<Vec<T>>, Error> {
        let one = |step: DVector<f64>| -> Result<Vec<T>, Error> {
            let part = |side: f64| side * self.part_within(&at.geometry, (side * &step).as_slice());
            let [back, on] = [part(-1.0), part(1.0)];
            let image = |part: f64| {
                let geometry = self.moved(&at.geometry, (part * &step).as_slice());
                self.images(geometry, &self.voxels(), &at.x)
            };
            let (before, after) = (image(back)?, image(on)?);
            // Between bounds that touch it nothing changes.
            let factor = T::of(if on > back { 1.0 / (on - back) } else { 0.0 });
            Ok(after.iter().zip(&before).map(|(a, b)| (*a - *b) * factor).collect())
        };
        steps.column_iter().map(|step| one(step.into_owned())).collect()
    }

    /// Images of a volume in a geometry, frame after frame.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn images(&self, geometry: Geometry, voxels: &Voxels, x: &[f64]) -> Result<Vec<T>, Error> {
        let forward: ForwardModel<T> = self.model.forward(&geometry)?;
        let representation = &voxels.field()?;
        let parameters = &x.iter().map(|x| T::of(*x)).collect::<Vec<T>>();
        let field = Field { representation, parameters, axis: self.model.axis, occupancy: None };
        Ok(forward.images(field, self.frames))
    }
}
