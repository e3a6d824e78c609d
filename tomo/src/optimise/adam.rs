//! Adam (Kingma & Ba 2015, arXiv:1412.6980, algorithm 1).

use kerrlight_common::simd::{Float, InstructionSet, Lanes, Task, dispatch};
use rayon::prelude::*;

/// Decay rates β₁ of the mean gradient and β₂ of the mean square: those of the paper and of BH-NeRF.
pub const BETA: [f64; 2] = [0.9, 0.999];
/// ε, which is added to the root of the mean square, in units of the gradient: that of the paper and of BH-NeRF.
pub const EPSILON: f64 = 1e-8;

/// All that Adam remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct AdamState<T> {
    /// Steps taken.
    pub steps: u64,
    /// Mean gradient, one number a parameter.
    pub first: Vec<T>,
    /// Mean square, one number a parameter.
    pub second: Vec<T>,
}

impl<T: Float> AdamState<T> {
    /// Creates a state with zero moments.
    pub fn new(parameters: usize) -> Self {
        Self { steps: 0, first: vec![T::zero(); parameters], second: vec![T::zero(); parameters] }
    }

    /// Counts a step and returns its number.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub(super) fn begin(&mut self, gradient: &[T], parameters: &[T]) -> u64 {
        let count = parameters.len();
        assert!(gradient.len() == count);
        assert!(self.first.len() == count && self.second.len() == count);
        self.steps += 1;
        self.steps
    }

    /// One step with learning rate `rate` (in units of the parameters), by all threads.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn step(&mut self, rate: f64, gradient: &[T], parameters: &mut [T]) {
        let steps = self.begin(gradient, parameters);
        let moments = [&mut self.first[..], &mut self.second[..]];
        update(rate, gradient, steps, moments, parameters);
    }
}

/// Parameters that one thread takes at a time.
const SHARE: usize = 16_384;

/// Step number `steps`, counted from 1, of parameters with these moments.
pub(super) fn update<T: Float>(
    rate: f64,
    gradient: &[T],
    steps: u64,
    [first, second]: [&mut [T]; 2],
    parameters: &mut [T],
) {
    let constants = Constants::of(rate, steps);
    let set = InstructionSet::best();
    let moments = first.par_chunks_mut(SHARE).zip(second.par_chunks_mut(SHARE));
    let all = parameters.par_chunks_mut(SHARE).zip(gradient.par_chunks(SHARE)).zip(moments);
    all.for_each(|((parameters, gradient), (first, second))| {
        dispatch(set, Update { constants, gradient, first, second, parameters });
    });
}

#[derive(Clone, Copy)]
struct Constants<T> {
    beta: [T; 2],
    rest: [T; 2],
    unbiased: [T; 2],
    rate: T,
    epsilon: T,
}

impl<T: Float> Constants<T> {
    fn of(rate: f64, steps: u64) -> Self {
        let power = |beta: f64| beta.powf(steps as f64);
        Self {
            beta: BETA.map(T::of),
            // In double precision: 1 − 0.999 in single is wrong in the fifth digit.
            rest: BETA.map(|beta| T::of(1.0 - beta)),
            // Moments that begin at 0 are too small by 1 − βᵗ.
            unbiased: BETA.map(|beta| T::of(1.0 / (1.0 - power(beta)))),
            rate: T::of(rate),
            epsilon: T::of(EPSILON),
        }
    }
}

struct Update<'a, T> {
    constants: Constants<T>,
    gradient: &'a [T],
    first: &'a mut [T],
    second: &'a mut [T],
    parameters: &'a mut [T],
}

impl<T: Float> Task<T> for Update<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let Constants { beta, rest, unbiased, rate, epsilon } = self.constants;
        let s = V::splat;
        let load = |x: &[T]| V::load_or(x, T::zero());
        let moments = self.first.chunks_mut(V::LANES).zip(self.second.chunks_mut(V::LANES));
        let parameters = self.parameters.chunks_mut(V::LANES);
        let all = parameters.zip(self.gradient.chunks(V::LANES)).zip(moments);
        for ((parameters, gradient), (first, second)) in all {
            let g = load(gradient);
            let m = load(first).mul_add(s(beta[0]), g * s(rest[0]));
            let v = load(second).mul_add(s(beta[1]), g * g * s(rest[1]));
            let root = (v * s(unbiased[1])).sqrt() + s(epsilon);
            let x = load(parameters) - s(rate) * (m * s(unbiased[0])) / root;
            m.store(first);
            v.store(second);
            x.store(parameters);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use core::ops::Range;

    #[test]
    fn exact_steps_of_a_constant_gradient() {
        // Both moments, freed of their bias, are g and g²: every step is rate · g/(|g| + ε).
        let gradient: Vec<f64> = (0..77).map(|k| (f64::from(k) - 38.0) * 1e-7).collect();
        let (mut x, mut state) = (vec![1.0; 77], AdamState::new(77));
        for step in 1..=50 {
            state.step(0.01, &gradient, &mut x);
            for (x, g) in x.iter().zip(&gradient) {
                let expected = 1.0 - 0.01 * f64::from(step) * g / (g.abs() + 1e-8);
                assert!((x - expected).abs() < 1e-13, "{step}: {x} {expected}");
            }
        }
    }

    #[test]
    fn exact_third_step_of_three_gradients() {
        let (gradients, mut x) = ([1.0, -3.0, 2.0], [0.5f64]);
        let mut state = AdamState::new(1);
        for (k, g) in gradients.iter().enumerate() {
            let before = x[0];
            state.step(0.1, &[*g], &mut x);
            let (mut m, mut v) = (0.0, 0.0);
            for (j, g) in gradients[..=k].iter().enumerate() {
                let age = (k - j) as i32;
                m += 0.1 * 0.9f64.powi(age) * g;
                v += 0.001 * 0.999f64.powi(age) * g * g;
            }
            let t = k as i32 + 1;
            let (m, v) = (m / (1.0 - 0.9f64.powi(t)), v / (1.0 - 0.999f64.powi(t)));
            assert!((x[0] - (before - 0.1 * m / (v.sqrt() + 1e-8))).abs() < 1e-14);
        }
    }

    /// Takes steps of `count` parameters without and with a break, on one and on several threads, to the same bits.
    pub fn repeats(count: usize, step: impl Fn(u64, &mut AdamState<f32>, &mut [f32]) + Sync) {
        let run = |threads: usize, steps: Range<u64>, x: &mut [f32], state: &mut AdamState<f32>| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| steps.for_each(|k| step(k, state, x)));
        };
        let (mut x, mut state) = (vec![1.0; count], AdamState::new(count));
        run(1, 0..6, &mut x, &mut state);
        let (mut y, mut first) = (vec![1.0; count], AdamState::new(count));
        run(3, 0..2, &mut y, &mut first);
        let AdamState { steps, first, second } = first;
        let mut again = AdamState { steps, first, second };
        run(2, 2..6, &mut y, &mut again);
        assert!(x == y && state == again);
    }

    #[test]
    fn regress_same_bits_on_any_threads_and_after_a_break() {
        let count = 3 * SHARE + 5;
        repeats(count, |step, state, x| {
            let gradient = (0..count as u64).map(|k| ((k * 7 + step * 13) % 101) as f32 - 50.0);
            state.step(1e-3, &gradient.collect::<Vec<f32>>(), x);
        });
    }
}
