//! Grid of rays.

use crate::scene::Scene;

/// A square of the picture, in the view's coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Square {
    pub center: (f64, f64),
    pub size: f64,
}

/// Pixel centres on a regular grid, rows from the top (largest β), square pixels, `side`² rays
/// a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub width: usize,
    pub height: usize,
    /// Width of a pixel in M.
    pub size: f64,
    pub side: usize,
}

impl Grid {
    pub fn new(scene: &Scene) -> Self {
        Grid {
            width: scene.screen.width as usize,
            height: scene.screen.rows() as usize,
            size: scene.pixel_size(),
            side: scene.screen.samples_per_pixel.isqrt() as usize,
        }
    }

    /// Screen coordinates of ray (i, j) of a pixel, exactly antisymmetric about the centre.
    pub fn screen(&self, column: usize, row: usize, i: usize, j: usize) -> (f64, f64) {
        let along = |pixel: usize, sub: usize, count: usize| {
            // In units of 1/(2·side) of a pixel, so that the centre is an exact 0.
            let twice = 2 * (pixel * self.side + sub) + 1;
            (twice as f64 - (count * self.side) as f64) / (2 * self.side) as f64 * self.size
        };
        (along(column, i, self.width), -along(row, j, self.height))
    }

    /// The square about a point of a pixel (in pixels from its centre to the right and down), `width` of a
    /// pixel wide.
    pub fn square(&self, column: usize, row: usize, place: [f64; 2], width: f64) -> Square {
        Square { center: self.inside(column, row, place), size: width * self.size }
    }

    /// Screen coordinates of a point of a pixel, in pixels from its centre to the right and down.
    pub fn inside(&self, column: usize, row: usize, [x, y]: [f64; 2]) -> (f64, f64) {
        let along = |pixel: usize, count: usize| {
            ((2 * pixel + 1) as f64 - count as f64) / 2.0 // exact
        };
        let alpha = (along(column, self.width) + x) * self.size;
        (alpha, -(along(row, self.height) + y) * self.size)
    }
}
