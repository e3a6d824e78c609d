//! Parameters to start from.

use super::layout::Layer;
use super::settings::Initialisation;
use kerrlight_common::simd::Float;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Standard deviation of a normal distribution that is cut at two of its own.
const TRUNCATED: f64 = 0.879_625_661_034_239_8;

/// Draws all kernels, layer by layer and row by row; biases are zero.
pub fn initialise<T: Float>(
    layers: &[Layer],
    how: Initialisation,
    seed: u64,
    parameters: &mut [T],
) {
    let mut random = Pcg64::seed_from_u64(seed);
    for layer in layers {
        let all = &mut parameters[layer.offset..layer.offset + layer.size()];
        let (kernel, biases) = all.split_at_mut(layer.inputs * layer.outputs);
        kernel.fill_with(|| T::of(draw(&mut random, how, layer.inputs as f64)));
        biases.fill(T::zero());
    }
}

fn draw(random: &mut Pcg64, how: Initialisation, inputs: f64) -> f64 {
    match how {
        Initialisation::HeUniform => {
            let limit = (6.0 / inputs).sqrt();
            random.random_range(-limit..limit)
        }
        Initialisation::LecunNormal => loop {
            let x: f64 = random.sample(StandardNormal);
            if x.abs() < 2.0 {
                break x / TRUNCATED / inputs.sqrt();
            }
        },
    }
}
