//! Minimisation over a box.
//!
//! L-BFGS steps of the numbers that are free to move, projected onto the box (Bertsekas 1982).

use super::quasi_newton::Pairs;
use super::scaled::Scaled;
use crate::optimise::{add, difference, dot};
use core::ops::ControlFlow;
use std::collections::VecDeque;

/// Reason why iterations ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ending {
    /// The projected gradient is small enough.
    Converged,
    /// The value hardly falls any more, by less than noise would change it.
    Settled,
    /// The allowed iterations were used up.
    Exhausted,
    /// No step helps: within rounding of the minimum.
    Rounding,
    /// The caller wanted no more.
    Cancelled,
}

/// Conditions to end.
#[derive(Clone, Copy)]
pub(super) struct Stop {
    pub iterations: usize,
    /// Norm of the projected gradient (in scaled coordinates) against that where the iteration began.
    pub tolerance: f64,
    /// Part of the value by which the last [`LATELY`] iterations must have lowered it.
    pub settled: f64,
}

/// Iterations over which the fall of a value counts.
const LATELY: usize = 10;

/// The last values.
struct RecentValues(VecDeque<f64>);

impl RecentValues {
    /// Returns whether the last iterations lowered the value by less than `part` of it.
    fn is_settled(&mut self, value: f64, part: f64) -> bool {
        self.0.push_back(value);
        let before = if self.0.len() > LATELY { self.0.pop_front() } else { None };
        before.is_some_and(|before| before - value < part * value.abs())
    }
}

/// Told the value after each iteration.
pub(super) type Each<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Result of a descent.
pub(super) struct Descended {
    pub x: Vec<f64>,
    pub value: f64,
    pub ending: Ending,
}

pub(super) struct Descent<'a, 'b> {
    problem: Scaled<'a>,
    each: &'b mut Each<'b>,
    y: Vec<f64>,
    gradient: Vec<f64>,
    value: f64,
}

/// Gradient of the free numbers, and of those on the boundary that want to leave it.
struct Parts {
    free: Vec<f64>,
    leaving: Vec<f64>,
}

impl<'a, 'b> Descent<'a, 'b> {
    pub fn new(mut problem: Scaled<'a>, x: &[f64], each: &'b mut Each<'b>) -> Self {
        let mut y = problem.from(x);
        problem.project(&mut y);
        let mut gradient = Vec::new();
        let value = problem.value_and_gradient(&y, &mut gradient);
        Self { problem, each, y, gradient, value }
    }

    pub fn run(mut self, stop: Stop) -> Descended {
        let ending = self.steps(stop);
        Descended { x: self.problem.to(&self.y), value: self.value, ending }
    }

    fn parts(&self) -> Parts {
        let split = |(k, (y, g)): (usize, (&f64, &f64))| {
            if *y <= 0.0 {
                (0.0, g.min(0.0))
            } else if *y >= self.problem.upper(k) {
                (0.0, g.max(0.0))
            } else {
                (*g, 0.0)
            }
        };
        let (free, leaving) = self.y.iter().zip(&self.gradient).enumerate().map(split).unzip();
        Parts { free, leaving }
    }

    fn steps(&mut self, stop: Stop) -> Ending {
        let (mut pairs, mut lately) = (Pairs::default(), RecentValues(VecDeque::new()));
        let enough = stop.tolerance * self.violation();
        for _ in 0..stop.iterations {
            if self.violation() <= enough {
                return Ending::Converged;
            }
            if lately.is_settled(self.value, stop.settled) {
                return Ending::Settled;
            }
            let Parts { free, leaving } = self.parts();
            let steepest: Vec<f64> = free.iter().zip(&leaving).map(|(a, b)| a + b).collect();
            let mut direction = pairs.direct(&steepest);
            // Second derivatives couple numbers: one at its bound may be led out of the box. Cut
            // off by the projection alone, the step need not lead downhill (Bertsekas 1982).
            self.hold(&mut direction);
            // What was taken out may have been all that led downhill.
            if dot(&direction, &steepest) <= 0.0 {
                pairs.clear();
                direction.clone_from(&steepest);
            }
            // An L-BFGS direction has the length of a Newton step; a gradient has no such length.
            let step = if pairs.is_empty() { self.first_step(&direction) } else { 1.0 };
            let (y, gradient) = (self.y.clone(), self.gradient.clone());
            if !self.project(step, &direction) {
                // Pairs that no longer fit may be why no step helps: once more without them. Where
                // the gradient itself does not help, only rounding is left.
                if pairs.is_empty() {
                    return Ending::Rounding;
                }
                pairs.clear();
                continue;
            }
            pairs.push(difference(&self.y, &y), difference(&self.gradient, &gradient));
            if (self.each)(self.value).is_break() {
                return Ending::Cancelled;
            }
        }
        Ending::Exhausted
    }

    /// Takes out of a direction what would lead out of the box at once.
    fn hold(&self, direction: &mut [f64]) {
        for (k, (d, y)) in direction.iter_mut().zip(&self.y).enumerate() {
            if (*y <= 0.0 && *d > 0.0) || (*y >= self.problem.upper(k) && *d < 0.0) {
                *d = 0.0;
            }
        }
    }

    /// The best step against a direction as far as the gradient a little way along it tells.
    fn first_step(&mut self, direction: &[f64]) -> f64 {
        let length = dot(direction, direction).sqrt();
        // A small part of the field, and a length above 0 where it is dark.
        let reach = 1e-2 * dot(&self.y, &self.y).sqrt().max(1.0) / length;
        let (mut moved, mut there) = (self.y.clone(), Vec::new());
        add(&mut moved, -reach, direction);
        self.problem.value_and_gradient(&moved, &mut there);
        let bend = difference(&self.gradient, &there);
        // Where the slope vanishes if it goes on falling as it does over `reach`.
        let step = reach * dot(&self.gradient, direction) / dot(&bend, direction);
        // Where the function bends down, no step is best: one as long as was looked ahead.
        if step.is_finite() && step > 0.0 { step } else { reach }
    }

    /// A step against the direction and back into the box, shortened until the value falls.
    fn project(&mut self, step: f64, direction: &[f64]) -> bool {
        let (from, before, gradient) = (self.y.clone(), self.value, self.gradient.clone());
        let mut step = step;
        for _ in 0..12 {
            self.y.clone_from(&from);
            add(&mut self.y, -step, direction);
            self.problem.project(&mut self.y);
            self.value = self.problem.value_and_gradient(&self.y, &mut self.gradient);
            if self.value < before {
                return true;
            }
            step *= 0.25;
        }
        (self.y, self.value, self.gradient) = (from, before, gradient);
        false
    }

    fn violation(&self) -> f64 {
        let parts = self.parts();
        (dot(&parts.free, &parts.free) + dot(&parts.leaving, &parts.leaving)).sqrt()
    }
}
