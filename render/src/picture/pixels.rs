//! The pixels of a tile, from blocks of rays.

use super::grid::{Grid, Square};
use super::layers;
use super::rings::{Counted, Resolver};
use super::workspace::{BLOCK, Workspace};
use crate::Error;
use crate::transport::{Layers, PreparedScene, RayResult};
use std::ops::Range;

/// A pixel: averages of light, data of its most central ray.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pixel {
    pub intensity: f64,
    pub rgb: [f32; 3],
    /// Q, U, V.
    pub stokes: [f64; 3],
    pub center: RayResult,
    pub unresolved: u32,
    pub rays: u32,
    /// Estimated absolute error of the intensity; 0 where it is not estimated pixel by pixel.
    pub error: f64,
    /// Mean intensity of images of the disc that passed between the first rays, about.
    pub missed: f64,
    /// The share of the pixel whose error that is.
    pub known: f64,
}

/// Pixels of a rectangle, row by row.
#[derive(Debug, Clone, Default)]
pub(super) struct Pixels {
    pub pixels: Vec<Pixel>,
    /// Their other layers: as many, or none.
    pub layers: Vec<Layers>,
}

impl Pixels {
    /// Takes pixels without other layers.
    pub fn plain(pixels: Vec<Pixel>) -> Self {
        Pixels { pixels, layers: Vec::new() }
    }

    /// Tiles beside each other, `width` pixels wide in all.
    pub fn joined(tiles: &[&Pixels], width: usize, rows: usize) -> Self {
        let mut all = Pixels::plain(Vec::with_capacity(width * rows));
        for row in 0..rows {
            for Pixels { pixels, layers } in tiles {
                let columns = pixels.len() / rows;
                let range = row * columns..(row + 1) * columns;
                all.pixels.extend_from_slice(&pixels[range.clone()]);
                all.layers.extend_from_slice(layers.get(range).unwrap_or(&[]));
            }
        }
        all
    }
}

/// The pixels of a rectangle at each of `times`, row by row, with `side`² rays each, which are
/// traced once for all times, and more where `rings` says so.
pub(super) fn uniform(
    prepared: &PreparedScene,
    rings: Option<&Resolver>,
    grid: &Grid,
    rows: Range<usize>,
    columns: Range<usize>,
    times: &[f64],
    work: &mut Workspace,
) -> Result<Vec<Pixels>, Error> {
    let side = grid.side;
    // Whole pixels, about a block's worth of rays: `side`² is at most that.
    let together = (BLOCK / (side * side)).max(1);
    let places: Vec<(usize, usize)> =
        rows.flat_map(|row| columns.clone().map(move |column| (column, row))).collect();
    let mut all = vec![Pixels::plain(Vec::with_capacity(places.len())); times.len()];
    for some in places.chunks(together) {
        work.clear();
        for (column, row) in some {
            for k in 0..side * side {
                let center = grid.screen(*column, *row, k % side, k / side);
                work.push(Square { center, size: grid.size / side as f64 });
            }
        }
        let rays = some.len() * side * side;
        work.observe_at(prepared, times)?;
        let Workspace { alpha, beta, scratch, layers, .. } = &mut *work;
        layers::add_central(prepared, grid, alpha, beta, scratch, layers)?;
        // Rings are traced in the same memory, and would overwrite what was seen.
        let mut seen = std::mem::take(&mut work.seen);
        let mut layers = std::mem::take(&mut work.layers);
        let counted = match rings {
            Some(rings) => {
                let squares = std::mem::take(&mut work.squares);
                rings.resolve(prepared, &squares, times, &mut seen, &mut layers, work)?
            }
            None => Vec::new(),
        };
        let mut counted = counted.chunks_exact(side * side);
        for (all, seen) in all.iter_mut().zip(seen.chunks_exact(rays)) {
            for rays in seen.chunks_exact(side * side) {
                let more = counted.next().unwrap_or_default();
                all.pixels.push(with_rings(mean(rays, side), more));
            }
        }
        for (all, layers) in all.iter_mut().zip(layers.chunks_exact(rays)) {
            all.layers
                .extend(layers.chunks_exact(side * side).map(|rays| layers::mean(rays, side)));
        }
        (work.seen, work.layers) = (seen, layers);
    }
    Ok(all)
}

/// The share of a square that images of the disc cover which lie between its centre and its neighbours on the left, on
/// the right, above and below, on so much of the way to each. One that runs aslant lies between both kinds.
pub(super) fn half_covered([left, right, above, below]: [f64; 4]) -> f64 {
    0.5 * (left + right).max(above + below)
}

/// A pixel with what is known of the squares around its rays.
fn with_rings(mut pixel: Pixel, squares: &[Counted]) -> Pixel {
    let share = 1.0 / (squares.len() as f64).max(1.0);
    let mut error2 = 0.0;
    for square in squares.iter().filter(|square| square.rays > 0) {
        pixel.rays += square.rays;
        pixel.unresolved += square.unresolved;
        pixel.known += share;
        error2 += (share * square.error).powi(2);
    }
    pixel.error = error2.sqrt();
    pixel
}

/// One pixel from its rays, row by row.
fn mean(rays: &[RayResult], side: usize) -> Pixel {
    let mut pixel = Pixel {
        center: rays.get(layers::central(side)).copied().unwrap_or_default(),
        rays: rays.len() as u32,
        ..Pixel::default()
    };
    for ray in rays {
        pixel.intensity += ray.intensity;
        for (sum, light) in pixel.rgb.iter_mut().zip(ray.rgb) {
            *sum += light;
        }
        for (sum, x) in pixel.stokes.iter_mut().zip(ray.stokes) {
            *sum += x;
        }
        pixel.unresolved += u32::from(ray.outcome.is_unresolved());
    }
    pixel.intensity /= rays.len() as f64;
    pixel.stokes = pixel.stokes.map(|x| x / rays.len() as f64);
    pixel.rgb = pixel.rgb.map(|c| c / rays.len() as f32);
    pixel
}
