//! Layers of pixels besides their light.

use super::grid::Grid;
use crate::Error;
use crate::transport::{Layers, PreparedScene, Scratch};

/// Adds what is wanted of the central ray of each pixel in a block of rays that has been observed, with `side`² rays a
/// pixel.
pub(super) fn add_central(
    prepared: &PreparedScene,
    grid: &Grid,
    alpha: &[f64],
    beta: &[f64],
    scratch: &mut Scratch,
    layers: &mut [Layers],
) -> Result<(), Error> {
    if !prepared.wanted().central() {
        return Ok(());
    }
    let (rays, samples) = (alpha.len(), grid.side * grid.side);
    for (k, layers) in layers.iter_mut().enumerate() {
        if k % samples == central(grid.side) {
            prepared.add_central(alpha[k % rays], beta[k % rays], grid.size, scratch, layers)?;
            layers.motion = within(grid.width.max(grid.height) as f64, layers.motion);
        }
    }
    Ok(())
}

/// A motion no longer than `most`: images next to the critical curve are infinitely fast where they appear.
fn within(most: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    let length = x.hypot(y);
    if length > most { [x, y].map(|part| part * (most / length)) } else { [x, y] }
}

/// One pixel from its rays, row by row.
pub(super) fn mean(rays: &[Layers], side: usize) -> Layers {
    let mut pixel = rays.get(central(side)).copied().unwrap_or_default();
    pixel.mixed = crate::transport::Mixed::default();
    let share = 1.0 / rays.len() as f32;
    rays.iter().for_each(|ray| pixel.mixed.add(share, &ray.mixed));
    pixel
}

/// Number of the most central of `side`² rays.
pub(super) fn central(side: usize) -> usize {
    side / 2 * side + side / 2
}
