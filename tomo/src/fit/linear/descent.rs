//! Minimisation over a box.
//!
//! [`Method::QuasiNewton`]: L-BFGS steps of the numbers that are free to move, projected onto the box
//! (Bertsekas 1982). [`Method::ConjugateGradients`]: conjugate gradients on the free numbers, with
//! proportioning where those on the boundary want to leave it (Dostál & Schöberl 2005, MPRGP), and a projected
//! step where they would leave the box. [`Method::Fista`]: accelerated projected gradients (Beck & Teboulle 2009) with
//! O'Donoghue & Candès's (2015) restart.

use super::quasi_newton::Pairs;
use super::scaled::{Scaled, add, dot};
use core::ops::ControlFlow;
use std::collections::VecDeque;

/// How the box-constrained problem is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// For any convex and smooth function.
    QuasiNewton,
    /// For quadratic functions.
    ConjugateGradients,
    /// For any convex and smooth one.
    Fista,
}

/// Why iterations ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ending {
    /// The projected gradient is small enough.
    Converged,
    /// The value hardly falls any more, by less than noise would change it.
    Settled,
    /// As many iterations as were allowed.
    Exhausted,
    /// No step helps: within rounding of the minimum.
    Rounding,
    /// The caller wanted no more.
    Cancelled,
}

/// When to end.
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
struct Lately(VecDeque<f64>);

impl Lately {
    /// Whether the last iterations lowered the value by less than `part` of it.
    fn is_settled(&mut self, value: f64, part: f64) -> bool {
        self.0.push_back(value);
        let before = if self.0.len() > LATELY { self.0.pop_front() } else { None };
        before.is_some_and(|before| before - value < part * value.abs())
    }
}

/// Told the value and the numbers after each iteration.
pub(super) type Each<'a> = dyn FnMut(f64, &[f64]) -> ControlFlow<()> + 'a;

/// Steps between gradients that are computed anew.
const ANEW: usize = 40;

/// Where a descent ended.
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

    pub fn run(mut self, method: Method, stop: Stop) -> Descended {
        let ending = match method {
            Method::QuasiNewton => self.quasi_newton(stop),
            Method::ConjugateGradients => self.conjugate(stop),
            Method::Fista => self.accelerated(stop),
        };
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

    /// The longest step against a direction that stays in the box.
    fn longest_step(&self, p: &[f64]) -> f64 {
        let of = |(k, (y, p)): (usize, (&f64, &f64))| {
            if *p > 0.0 {
                y / p
            } else if *p < 0.0 {
                (y - self.problem.upper(k)) / p
            } else {
                f64::INFINITY
            }
        };
        self.y.iter().zip(p).enumerate().map(of).fold(f64::INFINITY, f64::min)
    }

    fn tell(&mut self) -> ControlFlow<()> {
        let x = self.problem.to(&self.y);
        (self.each)(self.value, &x)
    }

    fn look(&mut self) {
        self.value = self.problem.value_and_gradient(&self.y, &mut self.gradient);
    }

    fn quasi_newton(&mut self, stop: Stop) -> Ending {
        let (mut pairs, mut lately) = (Pairs::default(), Lately(VecDeque::new()));
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
            self.hold(&mut direction);
            if dot(&direction, &steepest) <= 0.0 {
                pairs.clear();
                direction.clone_from(&steepest);
            }
            let step = if pairs.is_empty() { self.first_step(&direction) } else { 1.0 };
            let (y, gradient) = (self.y.clone(), self.gradient.clone());
            if !self.project(step, &direction) {
                if pairs.is_empty() {
                    return Ending::Rounding;
                }
                pairs.clear();
                continue;
            }
            pairs.push(difference(&self.y, &y), difference(&self.gradient, &gradient));
            if self.tell().is_break() {
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
        let reach = 1e-2 * dot(&self.y, &self.y).sqrt().max(1.0) / length;
        let (mut moved, mut there) = (self.y.clone(), Vec::new());
        add(&mut moved, -reach, direction);
        self.problem.value_and_gradient(&moved, &mut there);
        let bend = difference(&self.gradient, &there);
        let step = reach * dot(&self.gradient, direction) / dot(&bend, direction);
        // Where the function bends down, no step is best: one as long as was looked ahead.
        if step.is_finite() && step > 0.0 { step } else { reach }
    }

    fn conjugate(&mut self, stop: Stop) -> Ending {
        let mut parts = self.parts();
        let size =
            |parts: &Parts| dot(&parts.free, &parts.free) + dot(&parts.leaving, &parts.leaving);
        let enough = size(&parts) * stop.tolerance * stop.tolerance;
        let (mut p, mut product) = (parts.free.clone(), Vec::new());
        for iteration in 0..stop.iterations {
            if size(&parts) <= enough {
                return Ending::Converged;
            }
            if iteration % ANEW == ANEW - 1 {
                self.look();
                parts = self.parts();
                p.clone_from(&parts.free);
            }
            let proportional = dot(&parts.leaving, &parts.leaving) <= dot(&parts.free, &parts.free);
            let direction = if proportional { &p } else { &parts.leaving };
            self.problem.curvature(direction, &mut product);
            let (slope, bend) = (dot(&self.gradient, direction), dot(direction, &product));
            if !(slope > 0.0 && bend > 0.0) {
                return Ending::Rounding;
            }
            let step = slope / bend;
            if step <= self.longest_step(direction) {
                add(&mut self.y, -step, direction);
                add(&mut self.gradient, -step, &product);
                self.value -= 0.5 * step * slope;
                parts = self.parts();
                if proportional {
                    let gamma = dot(&parts.free, &product) / bend;
                    p.iter_mut().zip(&parts.free).for_each(|(p, free)| *p = free - gamma * *p);
                } else {
                    p.clone_from(&parts.free);
                }
            } else {
                let direction = direction.clone();
                if !self.project(step, &direction) && !self.project(step, &parts.free) {
                    return Ending::Rounding;
                }
                parts = self.parts();
                p.clone_from(&parts.free);
            }
            if self.tell().is_break() {
                return Ending::Cancelled;
            }
        }
        Ending::Exhausted
    }

    /// A step against the direction and back into the box, shortened until the value falls.
    fn project(&mut self, step: f64, direction: &[f64]) -> bool {
        let (from, before, gradient) = (self.y.clone(), self.value, self.gradient.clone());
        let mut step = step;
        for _ in 0..12 {
            self.y.clone_from(&from);
            add(&mut self.y, -step, direction);
            self.problem.project(&mut self.y);
            self.look();
            if self.value < before {
                return true;
            }
            step *= 0.25;
        }
        (self.y, self.value, self.gradient) = (from, before, gradient);
        false
    }

    /// The largest second derivative, from steps of gradients.
    fn steepness(&mut self) -> f64 {
        let (y, mut other) = (self.y.clone(), Vec::new());
        let norm = |x: &[f64]| dot(x, x).sqrt();
        let mut direction = self.gradient.clone();
        let mut largest = 0.0f64;
        for _ in 0..8 {
            let length = norm(&direction);
            let reach = 1e-2 * norm(&y).max(1.0) / length.max(f64::MIN_POSITIVE);
            let mut moved = y.clone();
            add(&mut moved, reach, &direction);
            self.problem.value_and_gradient(&moved, &mut other);
            add(&mut other, -1.0, &self.gradient);
            largest = largest.max(norm(&other) / (reach * length));
            direction.clone_from(&other);
        }
        largest
    }

    fn accelerated(&mut self, stop: Stop) -> Ending {
        let mut steepness = self.steepness();
        let enough = stop.tolerance * self.violation();
        let (mut z, mut momentum) = (self.y.clone(), 1.0f64);
        for _ in 0..stop.iterations {
            let before = self.y.clone();
            if !self.from(&z, &mut steepness) {
                return Ending::Rounding;
            }
            let moved: Vec<f64> = self.y.iter().zip(&before).map(|(a, b)| a - b).collect();
            let back = z.iter().zip(&self.y).map(|(z, y)| z - y).zip(&moved).map(|(a, b)| a * b);
            let uphill = back.sum::<f64>() > 0.0;
            let grown = 0.5 * (1.0 + (1.0 + 4.0 * momentum * momentum).sqrt());
            let push = if uphill { 0.0 } else { (momentum - 1.0) / grown };
            momentum = if uphill { 1.0 } else { grown };
            z.clone_from(&self.y);
            add(&mut z, push, &moved);
            self.problem.project(&mut z);
            if self.violation() <= enough {
                return Ending::Converged;
            }
            if self.tell().is_break() {
                return Ending::Cancelled;
            }
        }
        Ending::Exhausted
    }

    /// A projected step from z, as long as the steepness allows, which grows where it was too small.
    fn from(&mut self, z: &[f64], steepness: &mut f64) -> bool {
        let mut of_z = Vec::new();
        let at_z = self.problem.value_and_gradient(z, &mut of_z);
        for _ in 0..40 {
            if !(*steepness > 0.0 && steepness.is_finite()) {
                return false;
            }
            self.y.copy_from_slice(z);
            add(&mut self.y, -1.0 / *steepness, &of_z);
            self.problem.project(&mut self.y);
            self.look();
            let step: Vec<f64> = self.y.iter().zip(z).map(|(y, z)| y - z).collect();
            let model = at_z + dot(&of_z, &step) + 0.5 * *steepness * dot(&step, &step);
            if self.value <= model + 1e-7 * at_z.abs() {
                return true;
            }
            *steepness *= 2.0;
        }
        false
    }

    fn violation(&self) -> f64 {
        let parts = self.parts();
        (dot(&parts.free, &parts.free) + dot(&parts.leaving, &parts.leaving)).sqrt()
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
