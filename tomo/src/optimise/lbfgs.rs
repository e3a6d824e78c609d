//! L-BFGS (Nocedal & Wright 2006, algorithms 7.4 and 7.5).
//!
//! Our own: the crates that there are own their vectors, allocate at every operation or are bound to
//! f64, and none can be stopped and continued with the same bits.

use super::line_search::{Point, Wolfe};
use kerrlight_common::simd::Float;

/// Value at the parameters; overwrites the gradient.
pub type Objective<'a, T> = dyn FnMut(&[T], &mut [T]) -> f64 + 'a;

/// Limited-memory quasi-Newton steps, for losses that do not change from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lbfgs {
    /// Pairs of steps and gradient differences that are kept.
    pub memory: usize,
    /// Evaluations that a step may take.
    pub evaluations: usize,
}

impl Default for Lbfgs {
    fn default() -> Self {
        Self { memory: 10, evaluations: 20 }
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// The loss is smaller.
    Taken {
        /// The loss.
        value: f64,
        /// Times that the objective was asked.
        evaluations: usize,
    },
    /// No step length helps: a minimum within rounding, or a gradient that is not one. The parameters
    /// are unchanged.
    NoDescent,
    /// The loss or the gradient at the parameters is not a number.
    NotFinite,
}

/// All that L-BFGS remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct LbfgsState<T> {
    /// The gradient; then steps; then differences of gradients, a ring of `memory` each.
    pub numbers: Vec<T>,
    /// Pairs taken up so far.
    pub pairs: u64,
    /// Loss at the parameters, dimensionless, once known.
    pub value: Option<f64>,
}

impl<T: Float> LbfgsState<T> {
    /// Creates a state without steps.
    pub fn new(parameters: usize, memory: usize) -> Self {
        Self { numbers: vec![T::zero(); (1 + 2 * memory) * parameters], pairs: 0, value: None }
    }
}

fn dot<T: Float>(a: &[T], b: &[T]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.double() * b.double()).sum()
}

/// y += a x.
fn add<T: Float>(y: &mut [T], a: f64, x: &[T]) {
    let a = T::of(a);
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * *x);
}

/// The ring of pairs.
struct Pairs<'a, T> {
    steps: &'a mut [T],
    differences: &'a mut [T],
    count: usize,
    memory: usize,
    pairs: u64,
}

impl<T: Float> Pairs<'_, T> {
    /// The pair of `age` (0: newest).
    fn pair(&self, age: usize) -> (&[T], &[T]) {
        // + memory, so that nothing is taken below 0.
        let slot = (self.pairs as usize + self.memory - 1 - age) % self.memory;
        let range = slot * self.count..(slot + 1) * self.count;
        (&self.steps[range.clone()], &self.differences[range])
    }

    fn kept(&self) -> usize {
        (self.pairs as usize).min(self.memory)
    }

    /// −H g by the two-loop recursion, in place of g.
    fn direct(&self, g: &mut [T], alphas: &mut [f64]) {
        for (age, alpha) in alphas.iter_mut().enumerate().take(self.kept()) {
            let (s, y) = self.pair(age);
            *alpha = dot(s, g) / dot(s, y);
            add(g, -*alpha, y);
        }
        if self.kept() > 0 {
            let (s, y) = self.pair(0);
            // Scale of the first matrix, from the newest pair (equation 7.20).
            let scale = T::of(dot(s, y) / dot(y, y));
            g.iter_mut().for_each(|x| *x *= scale);
        }
        for age in (0..self.kept()).rev() {
            let (s, y) = self.pair(age);
            let beta = dot(y, g) / dot(s, y);
            add(g, alphas[age] - beta, s);
        }
        g.iter_mut().for_each(|x| *x = -*x);
    }

    /// A direction and the slope along it; forgets the pairs where rounding has spoilt them.
    fn descent(&mut self, gradient: &[T]) -> (Vec<T>, f64) {
        let mut direction = gradient.to_vec();
        self.direct(&mut direction, &mut vec![0.0; self.memory]);
        let slope = dot(&direction, gradient);
        if slope < 0.0 {
            return (direction, slope);
        }
        self.pairs = 0;
        direction.iter_mut().zip(gradient).for_each(|(d, g)| *d = -*g);
        (direction, -dot(gradient, gradient))
    }

    /// Takes up a pair whose curvature is positive.
    fn push(&mut self, step: &[T], difference: &[T]) -> u64 {
        let curvature = dot(step, difference);
        // Directions are divided by the curvature: one of the size of rounding would spoil them.
        if curvature > f64::EPSILON * dot(difference, difference) {
            let slot = self.pairs as usize % self.memory;
            let range = slot * self.count..(slot + 1) * self.count;
            self.steps[range.clone()].copy_from_slice(step);
            self.differences[range].copy_from_slice(difference);
            self.pairs += 1;
        }
        self.pairs
    }
}

impl Lbfgs {
    /// One step.
    ///
    /// # Panics
    /// If the state is not of as many parameters and this memory.
    pub fn step<T: Float>(
        &self,
        objective: &mut Objective<'_, T>,
        state: &mut LbfgsState<T>,
        parameters: &mut [T],
    ) -> Step {
        let (count, memory) = (parameters.len(), self.memory);
        assert!(memory > 0 && state.numbers.len() == (1 + 2 * memory) * count);
        let (gradient, rest) = state.numbers.split_at_mut(count);
        let value = *state.value.get_or_insert_with(|| objective(parameters, gradient));
        let (steps, differences) = rest.split_at_mut(memory * count);
        let mut pairs = Pairs { steps, differences, count, memory, pairs: state.pairs };
        let (mut direction, slope) = pairs.descent(gradient);
        if !value.is_finite() || !slope.is_finite() {
            return Step::NotFinite;
        }
        // A gradient has no length of its own: the first trial moves the parameters by 1 in all.
        let first = if pairs.pairs == 0 { 1.0 / slope.abs().sqrt() } else { 1.0 };
        let (mut trial, mut trial_gradient) = (parameters.to_vec(), vec![T::zero(); count]);
        let mut evaluations = 0;
        let evaluate = |length| {
            evaluations += 1;
            trial.copy_from_slice(parameters);
            add(&mut trial, length, &direction);
            let value = objective(&trial, &mut trial_gradient);
            Point { length, value, slope: dot(&trial_gradient, &direction) }
        };
        // Values for quasi-Newton steps (Nocedal & Wright 2006, section 3.1).
        let wolfe = Wolfe { decrease: 1e-4, curvature: 0.9, evaluations: self.evaluations };
        let start = Point { length: 0.0, value, slope };
        let found = if slope < 0.0 { wolfe.search(start, first, evaluate) } else { None };
        let Some(at) = found else {
            if state.pairs == 0 {
                return Step::NoDescent;
            }
            // Pairs that no longer fit may be why no step helps: once more along the gradient.
            state.pairs = 0;
            return self.step(objective, state, parameters);
        };
        // The step as it was rounded, not as it was meant: the gradients are those of its two ends.
        direction.iter_mut().zip(&trial).zip(&*parameters).for_each(|((d, t), p)| *d = *t - *p);
        gradient.iter_mut().zip(&trial_gradient).for_each(|(g, t)| *g = *t - *g);
        state.pairs = pairs.push(&direction, gradient);
        gradient.copy_from_slice(&trial_gradient);
        parameters.copy_from_slice(&trial);
        state.value = Some(at.value);
        Step::Taken { value: at.value, evaluations }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LBFGS: Lbfgs = Lbfgs { memory: 10, evaluations: 20 };

    fn rosenbrock<T: Float>(x: &[T], gradient: &mut [T]) -> f64 {
        gradient.fill(T::zero());
        let (mut value, hundred, two) = (T::zero(), T::of(100.0), T::of(2.0));
        for k in 0..x.len() - 1 {
            let (a, b) = (x[k + 1] - x[k] * x[k], T::one() - x[k]);
            value += hundred * a * a + b * b;
            gradient[k] -= two * (two * hundred * a * x[k] + b);
            gradient[k + 1] += two * hundred * a;
        }
        value.double()
    }

    /// Steps until the loss is below `enough` or none helps, and how many.
    fn minimise<T: Float>(objective: &mut Objective<'_, T>, x: &mut [T], enough: f64) -> usize {
        let mut state = LbfgsState::new(x.len(), 10);
        let mut last = f64::INFINITY;
        for step in 0..2000 {
            match LBFGS.step(objective, &mut state, x) {
                Step::Taken { value, .. } => {
                    assert!(value < last);
                    last = value;
                    if value < enough {
                        return step + 1;
                    }
                }
                other => {
                    assert_eq!(other, Step::NoDescent);
                    return step;
                }
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
            let mut x: Vec<f32> = vec![-0.5; count];
            minimise(&mut rosenbrock, &mut x, 1e-16);
            assert!(x.iter().all(|x| (x - 1.0).abs() < 0.02), "{x:?}");
        }
    }

    #[test]
    fn regress_same_bits_after_a_break() {
        let run = |breaks: bool| {
            let (mut x, mut state) = (vec![-1.2, 1.0, 0.3], LbfgsState::<f64>::new(3, 10));
            for _ in 0..20 {
                LBFGS.step(&mut rosenbrock, &mut state, &mut x);
                if breaks {
                    let LbfgsState { numbers, pairs, value } = state;
                    state = LbfgsState { numbers, pairs, value };
                }
            }
            (x, state)
        };
        assert_eq!(run(false), run(true));
    }

    #[test]
    fn a_loss_that_is_not_a_number_is_said_to_be_none() {
        let mut objective = |_: &[f64], gradient: &mut [f64]| {
            gradient.fill(1.0);
            f64::NAN
        };
        let mut state = LbfgsState::new(2, 10);
        let step = LBFGS.step(&mut objective, &mut state, &mut [1.0, 2.0]);
        assert_eq!(step, Step::NotFinite);
    }
}
