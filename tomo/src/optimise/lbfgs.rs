//! L-BFGS (Nocedal & Wright 2006, algorithms 7.4 and 7.5), step by step, its gradient at hand for whoever decides when to end.

use super::line_search::{Point, search};
use std::collections::VecDeque;

/// Value at the parameters; overwrites the gradient.
pub type Objective<'a> = dyn FnMut(&[f64], &mut [f64]) -> f64 + 'a;

/// Limited-memory quasi-Newton steps, for losses that do not change from step to step.
#[derive(Clone, Debug)]
pub struct Lbfgs {
    /// Gradient at the parameters, once the loss is known.
    pub gradient: Vec<f64>,
    /// Loss at the parameters, dimensionless, once known.
    pub value: Option<f64>,
    memory: usize,
    /// Steps and differences of gradients, the newest first.
    pairs: VecDeque<[Vec<f64>; 2]>,
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// y += a x.
pub(crate) fn add(y: &mut [f64], a: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

pub(crate) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

impl Lbfgs {
    /// Takes no step yet; `memory` pairs of steps and gradient differences are kept.
    pub fn new(parameters: usize, memory: usize) -> Self {
        Self { gradient: vec![0.0; parameters], value: None, memory, pairs: VecDeque::new() }
    }

    /// −H g by the two-loop recursion.
    fn quasi_newton(&self) -> Vec<f64> {
        let mut g = self.gradient.clone();
        let mut alphas = Vec::with_capacity(self.pairs.len());
        for [s, y] in &self.pairs {
            let alpha = dot(s, &g) / dot(s, y);
            add(&mut g, -alpha, y);
            alphas.push(alpha);
        }
        if let Some([s, y]) = self.pairs.front() {
            // Scale of the first matrix, from the newest pair (equation 7.20).
            let scale = dot(s, y) / dot(y, y);
            g.iter_mut().for_each(|x| *x *= scale);
        }
        for ([s, y], alpha) in self.pairs.iter().zip(alphas).rev() {
            let beta = dot(y, &g) / dot(s, y);
            add(&mut g, alpha - beta, s);
        }
        g.iter_mut().for_each(|x| *x = -*x);
        g
    }

    /// A direction and the slope along it; forgets the pairs where rounding has spoilt them.
    fn direction(&mut self) -> (Vec<f64>, f64) {
        let direction = self.quasi_newton();
        let slope = dot(&direction, &self.gradient);
        if slope < 0.0 {
            return (direction, slope);
        }
        self.pairs.clear();
        (self.gradient.iter().map(|g| -g).collect(), -dot(&self.gradient, &self.gradient))
    }

    /// One step: the loss at its end. None if no step length helps (a minimum within rounding, or a gradient that is not
    /// one), or loss or gradient is not a number; the parameters are unchanged then.
    ///
    /// # Panics
    /// If the parameters are not as many as before, or nothing may be kept.
    pub fn step(&mut self, objective: &mut Objective<'_>, parameters: &mut [f64]) -> Option<f64> {
        assert!(self.memory > 0 && self.gradient.len() == parameters.len());
        let gradient = &mut self.gradient;
        let value = *self.value.get_or_insert_with(|| objective(parameters, gradient));
        let had_pairs = !self.pairs.is_empty();
        let (direction, slope) = self.direction();
        if !value.is_finite() || !slope.is_finite() {
            return None;
        }
        // A gradient has no length of its own: the first trial moves the parameters by 1 in all.
        let first = if self.pairs.is_empty() { 1.0 / slope.abs().sqrt() } else { 1.0 };
        let (mut trial, mut gradient) = (parameters.to_vec(), vec![0.0; parameters.len()]);
        let evaluate = |length: f64| {
            trial.copy_from_slice(parameters);
            add(&mut trial, length, &direction);
            let value = objective(&trial, &mut gradient);
            Point { length, value, slope: dot(&gradient, &direction) }
        };
        let start = Point { length: 0.0, value, slope };
        let found = if slope < 0.0 { search(start, first, evaluate) } else { None };
        let Some(at) = found else {
            if !had_pairs {
                return None;
            }
            // Pairs that no longer fit may be why no step helps: once more along the gradient.
            self.pairs.clear();
            return self.step(objective, parameters);
        };
        // The step as it was rounded, not as it was meant: the gradients are those of its two ends.
        let pair = [difference(&trial, parameters), difference(&gradient, &self.gradient)];
        let curvature = dot(&pair[0], &pair[1]);
        // Directions are divided by the curvature: one of the size of rounding would spoil them.
        if curvature > f64::EPSILON * dot(&pair[1], &pair[1]) {
            self.pairs.truncate(self.memory - 1);
            self.pairs.push_front(pair);
        }
        self.gradient = gradient;
        parameters.copy_from_slice(&trial);
        self.value = Some(at.value);
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(x: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let mut value = 0.0;
        for k in 0..x.len() - 1 {
            let (a, b) = (x[k + 1] - x[k] * x[k], 1.0 - x[k]);
            value += 100.0 * a * a + b * b;
            gradient[k] -= 2.0 * (200.0 * a * x[k] + b);
            gradient[k + 1] += 200.0 * a;
        }
        value
    }

    /// Steps until the loss is below `enough` or none helps, and how many.
    fn minimise(objective: &mut Objective<'_>, x: &mut [f64], enough: f64) -> usize {
        let mut lbfgs = Lbfgs::new(x.len(), 10);
        let mut last = f64::INFINITY;
        for step in 0..2000 {
            let Some(value) = lbfgs.step(objective, x) else { return step };
            assert!(value < last);
            last = value;
            if value < enough {
                return step + 1;
            }
        }
        panic!("{last:e} after 2000 steps")
    }

    #[test]
    fn exact_minimum_of_quadratics() {
        // ½ Σ λₖ (xₖ − k)², condition number 100.
        let scale = |k: usize| 10f64.powf(2.0 * k as f64 / 29.0);
        let mut objective = |x: &[f64], gradient: &mut [f64]| {
            let mut value = 0.0;
            for k in 0..x.len() {
                let off = x[k] - k as f64;
                gradient[k] = scale(k) * off;
                value += 0.5 * scale(k) * off * off;
            }
            value
        };
        let mut x = vec![0.0; 30];
        let steps = minimise(&mut objective, &mut x, 1e-16);
        assert!(steps < 150, "{steps}");
        x.iter().enumerate().for_each(|(k, x)| assert!((x - k as f64).abs() < 1e-7, "{k} {x}"));
    }

    #[test]
    fn exact_minimum_of_rosenbrock() {
        for count in [2, 10, 100] {
            let mut x: Vec<f64> = (0..count).map(|k| if k % 2 == 0 { -1.2 } else { 1.0 }).collect();
            let steps = minimise(&mut rosenbrock, &mut x, 1e-16);
            // Algorithm 7.4 with bisection for the step length takes 35, 82 and 544.
            assert!(steps < 600, "{count}: {steps}");
            // All ones; for 4 to 30 variables there is a second minimum near x₀ = −1.
            let other = count == 10 && (x[0] + 0.99).abs() < 0.01;
            assert!(other || x.iter().all(|x| (x - 1.0).abs() < 1e-6), "{x:?}");
        }
    }

    #[test]
    fn a_loss_that_is_not_a_number_is_said_to_be_none() {
        let mut objective = |_: &[f64], gradient: &mut [f64]| {
            gradient.fill(1.0);
            f64::NAN
        };
        assert_eq!(Lbfgs::new(2, 10).step(&mut objective, &mut [1.0, 2.0]), None);
    }
}
