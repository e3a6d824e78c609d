//! Adam on the device.

use super::bytes::{floats, words};
use super::kernels::{self, compiled};
use crate::optimise::adam::{BETA, EPSILON};
use crate::representation::WeightMatrix;
use kerrlight_geodesic::gpu::{Bound, Buffer, Commands, Compute, GpuError};

/// Parameters, their gradient and what Adam remembers.
#[derive(Debug)]
pub struct Learning {
    /// The parameters.
    pub parameters: Buffer,
    /// The gradient.
    pub gradient: Buffer,
    /// The mean gradient, or the means that Adam has of it, and of its squares.
    pub moments: [Buffer; 2],
    rule: Buffer,
    learn: Bound,
    count: usize,
    positive: bool,
    /// Values on the device, where they are known: parameters and moments.
    held: [Vec<f32>; 3],
}

/// Invocations in a row of the grid, 64 a workgroup.
const ROW: u32 = 64 * kernels::ROW;

impl Learning {
    /// Takes so many parameters but those of `others`, whose steps are not Adam's; `positive`: they are held at zero
    /// or above.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn new(
        device: &Compute,
        count: usize,
        positive: bool,
        others: &[WeightMatrix],
    ) -> Result<Self, GpuError> {
        let storage = || device.storage(4 * count as u64);
        let (parameters, gradient, moments) = (storage()?, storage()?, [storage()?, storage()?]);
        let rule = device.uniform(&[0; 48])?;
        let kernels = compiled(device, include_str!("shaders/adam.wgsl"), &["learn"])?;
        let left_out = device.storage(4 * count.div_ceil(32) as u64)?;
        device.write(&left_out, &words(&bits(count, others)))?;
        let buffers = [&rule, &gradient, &moments[0], &moments[1], &parameters, &left_out];
        let buffers: Vec<_> = (0..).zip(buffers).collect();
        let learn = device.bind(&kernels[0], &buffers)?;
        let held = Default::default();
        Ok(Self { parameters, gradient, moments, rule, learn, count, positive, held })
    }

    /// Puts parameters and moments there, if they are not there yet.
    ///
    /// # Errors
    /// If the device fails.
    pub fn load(&self, device: &Compute, numbers: [&[f32]; 3]) -> Result<(), GpuError> {
        for ((numbers, held), buffer) in numbers.iter().zip(&self.held).zip(self.buffers()) {
            // Most stretches begin with what the last one has left on the device.
            if held != numbers {
                device.write(buffer, &floats(numbers))?;
            }
        }
        Ok(())
    }

    /// Notes what has come back from there; nothing before a step.
    pub fn hold(&mut self, numbers: [&[f32]; 3]) {
        for (held, numbers) in self.held.iter_mut().zip(numbers) {
            held.clear();
            held.extend_from_slice(numbers);
        }
    }

    /// Puts the numbers of the next step there: its learning rate, and how many steps there are with it.
    ///
    /// # Errors
    /// If the device fails.
    pub fn set(&self, device: &Compute, rate: f64, steps: u64) -> Result<(), GpuError> {
        let unbiased = BETA.map(|beta| 1.0 / (1.0 - beta.powf(steps as f64)));
        let rest = BETA.map(|beta| 1.0 - beta);
        let numbers = [BETA, rest, unbiased, [rate, EPSILON]];
        let mut all: Vec<u32> =
            numbers.as_flattened().iter().map(|x| (*x as f32).to_bits()).collect();
        all.extend([self.count as u32, ROW, u32::from(self.positive), 0]);
        device.write(&self.rule, &words(&all))
    }

    /// Takes the step.
    pub fn learn(&self, commands: &mut Commands) {
        let count = self.count as u32;
        commands.dispatch(&self.learn, [count.min(ROW).div_ceil(64), count.div_ceil(ROW)]);
    }

    /// Parameters and moments.
    pub fn buffers(&self) -> [&Buffer; 3] {
        [&self.parameters, &self.moments[0], &self.moments[1]]
    }
}

/// A bit for each parameter, set in matrices.
fn bits(count: usize, matrices: &[WeightMatrix]) -> Vec<u32> {
    let mut bits = vec![0; count.div_ceil(32)];
    for k in matrices.iter().flat_map(WeightMatrix::range) {
        bits[k / 32] |= 1 << (k % 32);
    }
    bits
}
