//! Error that single pixels may have so that the picture has no larger one than asked.

use super::{Adaptive, EDGE};
use crate::Error;
use crate::picture::grid::Grid;
use crate::picture::workspace::Workspace;
use crate::transport::PreparedScene;
use rayon::prelude::*;

/// The share of the allowed error for which the tolerance of a pixel is chosen.
const SAFETY: f64 = 0.9;

/// Pixels along a side of the picture by which the tolerance is chosen, at most.
const COARSE: usize = 128;

/// The error that each pixel may have so that the whole picture's relative L1 error stays below
/// `image_error`, from a picture of the same field with at most [`COARSE`] pixels a side.
///
/// Pixels with an edge may be off by [`EDGE`] times as much. From its pixels to k² smaller ones each, the error of smooth ones falls as k^−2; where an edge
/// runs through, k of them have it, with the same error.
pub(in crate::picture) fn tolerance(
    prepared: &PreparedScene,
    grid: &Grid,
    image_error: f64,
) -> Result<f64, Error> {
    let cut = grid.width.max(grid.height).div_ceil(COARSE);
    let coarse = Grid {
        width: grid.width.div_ceil(cut),
        height: grid.height.div_ceil(cut),
        size: grid.size * cut as f64,
        side: 1,
    };
    let uncut = Adaptive { prepared, grid: &coarse, rings: None, tolerance: f64::INFINITY };
    let lines = (0..coarse.height).into_par_iter().map_init(Workspace::default, |work, row| {
        let (pixels, cuts) = uncut.first(row..row + 1, 0..coarse.width, work)?;
        let mut errors: Vec<(f64, f64)> = Vec::with_capacity(pixels.len());
        let k = cut as f64;
        errors.extend(pixels.iter().map(|pixel| (pixel.error / (k * k), k * k)));
        // Those that are to be cut in any case are the ones with an edge.
        for cut in cuts {
            errors[cut.pixel] = (pixels[cut.pixel].error / EDGE, EDGE * k);
        }
        let sum: f64 = pixels.iter().map(|pixel| (pixel.intensity + pixel.missed) * k * k).sum();
        Ok((errors, sum))
    });
    let lines = lines.collect::<Result<Vec<_>, Error>>()?;
    let sum: f64 = lines.iter().map(|(_, sum)| sum).sum();
    let errors = lines.into_iter().flat_map(|(errors, _)| errors).collect();
    Ok(allowed(errors, SAFETY * image_error * sum))
}

/// The largest t with Σ weight min(error, t) ≤ `sum`, of pairs of an error and its weight.
fn allowed(mut errors: Vec<(f64, f64)>, sum: f64) -> f64 {
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = sum;
    let mut weights: f64 = errors.iter().map(|(_, weight)| weight).sum();
    // Errors below the common share leave the rest of theirs to the larger ones.
    for (error, weight) in errors {
        let share = left / weights;
        if error > share {
            return share;
        }
        left -= weight * error;
        weights -= weight;
    }
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_allowed_errors() {
        let errors = vec![(4.0, 1.0), (1.0, 1.0), (3.0, 1.0)];
        assert_eq!(allowed(errors.clone(), 8.0), f64::INFINITY);
        assert_eq!(allowed(errors.clone(), 6.0), 2.5);
        assert_eq!(allowed(errors, 1.5), 0.5);
        assert_eq!(allowed(vec![(0.0, 4.0), (0.0, 1.0)], 0.0), f64::INFINITY);
        assert_eq!(allowed(vec![(1.0, 2.0), (5.0, 4.0)], 10.0), 2.0);
    }
}
