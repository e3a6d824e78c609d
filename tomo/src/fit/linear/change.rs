//! Motion as a weak constraint: emission that changes while matter carries it, at a price.
//!
//! With ε(X, t) the emission at time t of the matter with label X, its place at a label time, ∂ε/∂t at fixed X is the
//! derivative along the flow. Its integral ∫∫ |∂ε/∂t| dV dt is penalised: a large weight gives a field that matter
//! carries unchanged, a small one a field that is free at each time.

use crate::Error;
use crate::representation::{Allowed, Knots};

/// How emission may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Times at which fields are given, and what these mean.
    pub knots: Knots,
    /// Factor on ∫∫ |∂ε/∂t| dV dt.
    pub weight: f64,
}

/// Differences are smoothed below this part of the largest emission.
const SMOOTH: f64 = 1e-3;

impl Change {
    /// A field that does not change.
    pub const NONE: Self = Self { knots: Knots::STEADY, weight: 0.0 };

    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let Knots { count, spacing, .. } = self.knots;
        let check = |field, value: f64, ok, allowed| {
            if ok { Ok(()) } else { Err(Error::out_of_range(field, value, allowed)) }
        };
        check("knots", count as f64, count > 0, "1 or more")?;
        check("spacing of knots", spacing, spacing > 0.0 && spacing.is_finite(), "above 0")?;
        let weight = self.weight;
        check("weight of change", weight, weight >= 0.0 && weight.is_finite(), "0 or above")?;
        Ok(self)
    }

    /// Whether there is more than one knot.
    pub fn is_any(&self) -> bool {
        self.knots.count > 1
    }

    /// Whether emission may appear and fade.
    pub(super) fn is_free(&self) -> bool {
        self.is_any() && self.knots.allowed == Allowed::Any
    }

    fn is_born(&self) -> bool {
        self.is_any() && self.knots.allowed == Allowed::Births
    }

    /// Whether the penalty is linear, or none.
    pub(super) fn is_quadratic(&self) -> bool {
        !self.is_any() || self.is_born() || self.weight == 0.0
    }

    /// What penalties on the field of each knot are multiplied by.
    pub(super) fn share(&self) -> f64 {
        if self.is_born() { 1.0 } else { 1.0 / self.knots.count as f64 }
    }

    /// Values at all knots of a field that is the same at all times.
    pub(super) fn steady(&self, field: &[f64]) -> Vec<f64> {
        let share = |knot: usize| if knot > 0 && self.is_born() { 0.0 } else { 1.0 };
        let knots = (0..self.knots.count).map(share);
        knots.flat_map(|share| field.iter().map(move |x| share * x)).collect()
    }

    /// The penalty on values at the nodes of all knots, with cells of this volume (M³); adds its slopes.
    pub(super) fn penalty(
        &self,
        x: &[f64],
        (cell, upper): (f64, f64),
        gradient: &mut [f64],
    ) -> f64 {
        let factor = self.weight * cell;
        if !self.is_any() || factor == 0.0 {
            return 0.0;
        }
        let nodes = x.len() / self.knots.count;
        if self.is_born() {
            gradient[nodes..].iter_mut().for_each(|slope| *slope += factor);
            return factor * x[nodes..].iter().sum::<f64>();
        }
        let epsilon = SMOOTH * upper;
        let mut sum = 0.0;
        for k in nodes..x.len() {
            let difference = x[k] - x[k - nodes];
            let root = difference.hypot(epsilon);
            sum += root - epsilon;
            gradient[k] += factor * difference / root;
            gradient[k - nodes] -= factor * difference / root;
        }
        factor * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(allowed: Allowed) -> Change {
        Change { knots: Knots { first: 0.0, spacing: 2.0, count: 3, allowed }, weight: 0.7 }
    }

    #[test]
    fn exact_slopes_of_penalties_are_those_of_differences() {
        let x = [1.0, 0.2, 0.5, 2.0, 0.3, 3.0];
        for allowed in [Allowed::Births, Allowed::Any] {
            let change = change(allowed);
            let mut slopes = [0.0; 6];
            change.penalty(&x, (0.1, 1.0), &mut slopes);
            for k in 0..6 {
                let at = |step: f64| {
                    let mut x = x;
                    x[k] += step;
                    change.penalty(&x, (0.1, 1.0), &mut [0.0; 6])
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((difference - slopes[k]).abs() < 1e-8, "{allowed:?} {k}");
            }
        }
    }

    /// ∫∫ |∂ε/∂t| of emission that doubles is the emission that it has before.
    #[test]
    fn exact_penalties_are_total_variations_in_time() {
        let field = [1.0, 1.0, 2.0];
        let found = change(Allowed::Any).penalty(&field, (3.0, 1e-9), &mut [0.0; 3]);
        assert!((found - 0.7 * 3.0).abs() < 1e-9);
        let births = change(Allowed::Births).penalty(&[1.0, 0.0, 1.0], (3.0, 1.0), &mut [0.0; 3]);
        assert!((births - 0.7 * 3.0).abs() < 1e-12);
    }
}
