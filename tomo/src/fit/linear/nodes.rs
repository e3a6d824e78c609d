//! Nodes of one grid and of another.

use super::ray_weights::Voxels;
use crate::Error;
use crate::representation::{Representation, Workspace};
use kerrlight_render::points::Coordinates;

/// Values at the nodes of another grid.
///
/// # Errors
/// If a grid has no nodes.
pub fn refined(from: &Voxels, x: &[f64], to: &Voxels) -> Result<Vec<f64>, Error> {
    if from == to {
        return Ok(x.to_vec());
    }
    let nodes: Vec<[f64; 3]> = (0..to.count()).map(|k| to.position(k)).collect();
    let column = |c: usize| {
        // Nodes of the edge lie beyond the field, in the dark: they take the value at its border.
        let margin = from.degree.margin() * from.shape().spacing[c];
        let (low, high) = (from.low[c] + margin, from.high[c] - margin);
        let clamp = |at: &[f64; 3]| at[c].clamp(low, high);
        nodes.iter().map(clamp).collect::<Vec<f64>>()
    };
    let (a, b, c) = (column(0), column(1), column(2));
    // Values of the field stand for factors of the other B-splines, which they are where it is
    // linear.
    let mut values = vec![0.0; nodes.len()];
    from.field()?.eval(x, Coordinates::xyz(&a, &b, &c), &mut values, &mut Workspace::new());
    Ok(values)
}
