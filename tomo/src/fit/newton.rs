//! Quasi-Newton steps of a fit, of its parameters and, where it is learnt, its axis.

use super::objective::Loss;
use super::state::{Outcome, Progress};
use super::steps::Place;
use super::trainer::Trainer;
use crate::optimise::{Lbfgs, LbfgsState, Step};
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;

/// The axis of a vector behind the parameters, and the vector's length.
fn axis_of<T: Float>(vector: &[T]) -> Option<(Axis, f64)> {
    let [x, y, z] = *vector else { return None };
    let vector = [x, y, z].map(T::double);
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    Some((Axis::new(vector).ok()?, length))
}

impl<T: Float> Trainer<'_, T> {
    /// One step. The axis is learnt as a vector of any length behind the parameters: the loss does not depend on
    /// the length.
    ///
    /// # Errors
    /// The loss, if it is not finite at the parameters.
    pub(super) fn quasi_newton(
        &mut self,
        rule: Lbfgs,
        now: &mut Progress<T>,
    ) -> Result<Outcome, f64> {
        let learnt = self.training.learns_axis(self.representation);
        let mut numbers = now.parameters.clone();
        if learnt {
            numbers.extend(now.axis.vector().map(T::of));
        }
        let memory = || LbfgsState::new(numbers.len(), rule.memory);
        let mut memory = now.lbfgs.take().unwrap_or_else(memory);
        let (taken, loss) = self.search(rule, now, &mut memory, &mut numbers);
        let count = now.parameters.len();
        let outcome = match taken {
            Step::NotFinite => Err(memory.value.unwrap_or(f64::NAN)),
            Step::NoDescent => Ok(Outcome::Converged),
            Step::Taken { value, .. } => {
                now.parameters.copy_from_slice(&numbers[..count]);
                if let Some((axis, length)) = axis_of(&numbers[count..]) {
                    now.axis = axis;
                    // The gradient of the vector of length 1 that the next step begins with.
                    memory.numbers[count..count + 3].iter_mut().for_each(|g| *g *= T::of(length));
                }
                now.loss = value;
                now.step += 1;
                Ok(Outcome::Done(loss))
            }
        };
        now.lbfgs = Some(memory);
        outcome
    }

    /// A step with the loss that it came to; once more along the gradient alone, where none helps.
    fn search(
        &mut self,
        rule: Lbfgs,
        now: &Progress<T>,
        memory: &mut LbfgsState<T>,
        numbers: &mut [T],
    ) -> (Step, Loss) {
        let (count, occupancy) = (now.parameters.len(), self.mask(now));
        let (mut last, mut points) = (Loss::default(), 0);
        let mut objective = |x: &[T], gradient: &mut [T]| {
            let (parameters, vector) = x.split_at(count);
            let (axis, length) = axis_of(vector).unwrap_or((now.axis, 1.0));
            let mut of_axis = [0.0; 3];
            last = self.loss(Place { parameters, axis, occupancy, step: 0 }, &mut of_axis);
            points += last.points;
            gradient[..count].copy_from_slice(&self.gradient);
            let slopes = gradient[count..].iter_mut().zip(axis.tangent(of_axis));
            slopes.for_each(|(out, slope)| *out = T::of(slope / length));
            last.total
        };
        let mut taken = rule.step(&mut objective, memory, numbers);
        if taken == Step::NoDescent && memory.pairs > 0 {
            memory.pairs = 0;
            taken = rule.step(&mut objective, memory, numbers);
        }
        (taken, Loss { points, ..last })
    }
}
