//! Functions that a descent minimises.

/// A convex function of numbers in a box.
pub(super) trait Convex {
    /// Its value; overwrites the gradient.
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut Vec<f64>) -> f64;
    /// Positive numbers that are to the second derivatives as well as is known.
    fn diagonal(&self) -> Vec<f64>;
}
