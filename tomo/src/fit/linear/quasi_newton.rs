//! Second derivatives of L-BFGS, on the numbers that are free to move (Nocedal & Wright 2006, algorithm
//! 7.4).
//!
//! Which numbers are free changes from step to step; products are therefore taken over those of the moment.
//! [`Lbfgs`](crate::optimise::Lbfgs) has no bounds.

use crate::optimise::add;
use std::collections::VecDeque;

/// Pairs that are kept.
const MEMORY: usize = 16;

/// Steps and differences of gradients, the oldest first.
#[derive(Default)]
pub(super) struct Pairs(VecDeque<(Vec<f64>, Vec<f64>)>);

impl Pairs {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Takes up a pair whose curvature is positive.
    pub fn push(&mut self, step: Vec<f64>, bend: Vec<f64>) {
        let curvature: f64 = step.iter().zip(&bend).map(|(s, b)| s * b).sum();
        if curvature > 0.0 {
            if self.0.len() == MEMORY {
                self.0.pop_front();
            }
            self.0.push_back((step, bend));
        }
    }

    /// H g over the numbers of which g is not zero; zero for the others.
    pub fn direct(&self, gradient: &[f64]) -> Vec<f64> {
        let free: Vec<bool> = gradient.iter().map(|g| *g != 0.0).collect();
        let product = |a: &[f64], b: &[f64]| -> f64 {
            let all = a.iter().zip(b).zip(&free);
            all.map(|((a, b), free)| if *free { a * b } else { 0.0 }).sum()
        };
        let curvatures: Vec<f64> = self.0.iter().map(|(s, b)| product(s, b)).collect();
        // Over the numbers that are free now a pair may have no positive curvature any more.
        let useful = |k: &usize| curvatures[*k] > 0.0;
        let mut direction = gradient.to_vec();
        let mut parts = vec![0.0; self.0.len()];
        for k in (0..self.0.len()).rev().filter(useful) {
            let (step, bend) = &self.0[k];
            parts[k] = product(step, &direction) / curvatures[k];
            add(&mut direction, -parts[k], bend);
        }
        if let Some(last) = (0..self.0.len()).rev().find(useful) {
            let bend = &self.0[last].1;
            // Scale of the first matrix, from the newest pair (equation 7.20).
            let scale = curvatures[last] / product(bend, bend);
            direction.iter_mut().for_each(|d| *d *= scale);
        }
        for k in (0..self.0.len()).filter(useful) {
            let (step, bend) = &self.0[k];
            let part = product(bend, &direction) / curvatures[k];
            add(&mut direction, parts[k] - part, step);
        }
        direction.iter_mut().zip(&free).for_each(|(d, free)| *d = if *free { *d } else { 0.0 });
        direction
    }
}
