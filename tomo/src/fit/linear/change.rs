//! Motion as a weak constraint: emission that changes while matter carries it, at a price.
//!
//! Change of emission along the flow. With ε(X, t) the emission at time t of the matter with label X, its place at a label
//! time, ∂ε/∂t at fixed X is the derivative along the flow. Its integral ∫∫ |∂ε/∂t| dV dt is penalised: a large weight gives a
//! field that matter carries unchanged, a small one a field that is free at each time.

use crate::Error;
use crate::fit::Region;
use crate::fit::loss::regulariser::Shape;
use crate::representation::{Allowed, Knots};

/// Change of emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Times at which fields are given, and what these mean.
    pub knots: Knots,
    /// Factor on ∫∫ |∂ε/∂t| dV dt.
    pub weight: f64,
    /// Region where emission is born, and is at the start; anywhere, if none is given. What matter would carry in from
    /// elsewhere has to be born at the edge then, at the price of all births. Fields that may also fade are not bound to it.
    pub within: Option<Region>,
    /// An emission s, if births that were found are to cost less in the rounds that follow: `weight` · s/(s + e) with e
    /// around them in the round before.
    pub sharpen: Option<f64>,
}

/// Differences are smoothed below this part of the largest emission.
const SMOOTH: f64 = 1e-3;

impl Change {
    /// A field that does not change.
    pub const NONE: Self = Self { knots: Knots::STEADY, weight: 0.0, within: None, sharpen: None };

    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let Knots { count, spacing, .. } = self.knots;
        let check = Error::check;
        check("knots", count as f64, count > 0, "1 or more")?;
        check("spacing of knots", spacing, spacing > 0.0 && spacing.is_finite(), "above 0")?;
        let weight = self.weight;
        check("weight of change", weight, weight >= 0.0 && weight.is_finite(), "0 or above")?;
        let sharpen = self.sharpen.unwrap_or(1.0);
        check("sharpen", sharpen, sharpen > 0.0 && sharpen.is_finite(), "above 0")?;
        Ok(self)
    }

    /// Returns whether there is more than one knot.
    pub fn is_any(&self) -> bool {
        self.knots.count > 1
    }

    /// Returns whether emission may appear and fade.
    pub(super) fn is_free(&self) -> bool {
        self.is_any() && self.knots.allowed == Allowed::Any
    }

    fn is_born(&self) -> bool {
        self.is_any() && self.knots.allowed == Allowed::Births
    }

    /// Returns whether births that were found cost less than others.
    pub(super) fn is_sharpened(&self) -> bool {
        self.is_born() && self.sharpen.is_some()
    }

    /// Returns whether a node of a grid, at the time of its knot, is where emission may be; above and below that, whether some
    /// of its cells are. Nodes beyond the largest radius would be a store that costs nothing: matter falls in from there.
    pub(super) fn allows(&self, position: [f64; 3], spacing: f64) -> bool {
        let within = self.within.filter(|_| self.is_born());
        let higher = |region: Region| Region { z_width: region.z_width + 0.5 * spacing, ..region };
        within.is_none_or(|region| higher(region).holds(position))
    }

    /// Returns the factor of penalties on the field of each knot.
    pub(super) fn share(&self) -> f64 {
        if self.is_born() { 1.0 } else { 1.0 / self.knots.count as f64 }
    }

    /// Values at all knots of a field that is the same at all times.
    pub(super) fn steady(&self, field: &[f64]) -> Vec<f64> {
        // Births add up: what is there at the first knot stays.
        let share = |knot: usize| if knot > 0 && self.is_born() { 0.0 } else { 1.0 };
        let knots = (0..self.knots.count).map(share);
        knots.flat_map(|share| field.iter().map(move |x| share * x)).collect()
    }

    /// Returns the prices beside `weight` of births of all nodes and knots but the first, after a field was found; nothing, if
    /// all cost the same.
    pub(super) fn prices(&self, x: &[f64], shape: Shape) -> Vec<f64> {
        let Some(s) = self.sharpen.filter(|_| self.is_born()) else { return Vec::new() };
        let born = x[..shape.count() * self.knots.count].chunks_exact(shape.count()).skip(1);
        let price = |e: f64| s / (s + e);
        born.flat_map(|field| around(field, shape.nodes)).map(price).collect()
    }

    /// The penalty on values at the nodes of all knots, with cells of this volume (M³); adds its slopes.
    pub(in crate::fit) fn penalty(
        &self,
        x: &[f64],
        cell: f64,
        upper: f64,
        prices: &[f64],
        gradient: &mut [f64],
    ) -> f64 {
        let factor = self.weight * cell;
        if !self.is_any() || factor == 0.0 {
            return 0.0;
        }
        let nodes = x.len() / self.knots.count;
        if self.is_born() {
            // What is there from the beginning has no price.
            return births(factor, &x[nodes..], prices, &mut gradient[nodes..]);
        }
        let epsilon = SMOOTH * upper;
        let mut sum = 0.0;
        for k in nodes..x.len() {
            let difference = x[k] - x[k - nodes];
            let root = difference.hypot(epsilon);
            // Less ε, so that a steady field costs nothing.
            sum += root - epsilon;
            gradient[k] += factor * difference / root;
            gradient[k - nodes] -= factor * difference / root;
        }
        factor * sum
    }
}

/// A field with a half of each number shared with its two neighbours, along each axis.
fn around(field: &[f64], [nx, ny, nz]: [usize; 3]) -> Vec<f64> {
    let mut field = field.to_vec();
    for (stride, n) in [(1, nz), (nz, ny), (ny * nz, nx)] {
        let shared = |k: usize| {
            let place = k / stride % n;
            let before = if place > 0 { field[k - stride] } else { 0.0 };
            let after = if place + 1 < n { field[k + stride] } else { 0.0 };
            0.5 * field[k] + 0.25 * (before + after)
        };
        field = (0..field.len()).map(shared).collect();
    }
    field
}

/// The sum of births times their prices, one without any; adds slopes.
fn births(factor: f64, x: &[f64], prices: &[f64], slopes: &mut [f64]) -> f64 {
    if prices.is_empty() {
        slopes.iter_mut().for_each(|slope| *slope += factor);
        return factor * x.iter().sum::<f64>();
    }
    slopes.iter_mut().zip(prices).for_each(|(slope, price)| *slope += factor * price);
    factor * x.iter().zip(prices).map(|(x, price)| x * price).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::tests::{beside, slope};

    fn change(allowed: Allowed) -> Change {
        let knots = Knots { first: 0.0, spacing: 2.0, count: 3, allowed };
        Change { knots, weight: 0.7, within: None, sharpen: None }
    }

    #[test]
    fn exact_slopes_of_penalties_are_those_of_differences() {
        let x = [1.0, 0.2, 0.5, 2.0, 0.3, 3.0];
        for allowed in [Allowed::Births, Allowed::Any] {
            let change = change(allowed);
            let mut slopes = [0.0; 6];
            change.penalty(&x, 0.1, 1.0, &[], &mut slopes);
            for (k, expected) in slopes.into_iter().enumerate() {
                let difference = slope(1e-6, |h| {
                    change.penalty(&beside(&x, k, h), 0.1, 1.0, &[], &mut [0.0; 6])
                });
                assert!((difference - expected).abs() < 1e-8, "{allowed:?} {k}");
            }
        }
    }

    /// s/(s + e) where e is the emission of a node and, by a half along each axis, of its neighbours.
    #[test]
    fn exact_births_that_were_found_cost_less() {
        let shape = Shape { nodes: [3, 3, 3], spacing: [1.0; 3] };
        let change = Change { sharpen: Some(0.5), ..change(Allowed::Births) };
        let mut x = vec![0.0; 81];
        (x[13], x[27 + 13]) = (9.0, 4.0);
        let prices = change.prices(&x, shape);
        assert_eq!(prices.len(), 54);
        assert!((prices[13] - 0.5 / (0.5 + 4.0 / 8.0)).abs() < 1e-15);
        assert!((prices[14] - 0.5 / (0.5 + 4.0 / 16.0)).abs() < 1e-15);
        assert!((prices[0] - 0.5 / (0.5 + 4.0 / 64.0)).abs() < 1e-15);
        assert!(prices[27..].iter().all(|price| *price == 1.0));
        let mut slopes = vec![0.0; 81];
        let value = change.penalty(&x, 2.0, 1.0, &prices, &mut slopes);
        assert!((value - 0.7 * 2.0 * 4.0 * 0.5).abs() < 1e-14);
        assert!(slopes[..27].iter().all(|slope| *slope == 0.0) && (slopes[40] - 0.7).abs() < 1e-14);
        assert!(Change { sharpen: None, ..change }.prices(&x, shape).is_empty());
    }

    /// ∫∫ |∂ε/∂t| of emission that doubles is the emission that it has before.
    #[test]
    fn exact_penalties_are_total_variations_in_time() {
        let field = [1.0, 1.0, 2.0];
        let found = change(Allowed::Any).penalty(&field, 3.0, 1e-9, &[], &mut [0.0; 3]);
        assert!((found - 0.7 * 3.0).abs() < 1e-9);
        let births =
            change(Allowed::Births).penalty(&[1.0, 0.0, 1.0], 3.0, 1.0, &[], &mut [0.0; 3]);
        assert!((births - 0.7 * 3.0).abs() < 1e-12);
    }
}
