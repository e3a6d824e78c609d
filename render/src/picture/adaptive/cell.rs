//! Square parts of pixels and what they may be off by.

use super::HIDDEN;
use super::light::Light;
use crate::picture::pixels::half_covered;
use crate::picture::rings::range;

/// A square part of a pixel whose four quarters have a ray each.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Centre, in pixels from the pixel's.
    pub(super) center: [f64; 2],
    /// Number of times the pixel was cut to get it.
    pub(super) level: u32,
    pub(super) quarters: [Light; 4],
    /// Estimated error of its share in the pixel's intensity.
    pub(super) error: f64,
    /// The same of edges that pass between its rays and those of the next cells.
    pub(super) seam: f64,
}

impl Cell {
    /// `middle` is the ray at its centre, `bright` the largest intensity around, `disc` that of the disc. Images of the
    /// disc that pass between the rays are counted twice: as dark, or as wide as a quarter where one is met.
    ///
    /// A smooth function's mean over the quarters is off by a third of d, the difference
    /// of the quarters' mean and the middle; where an edge runs through, d or the twist t of
    /// the quarters are of the order of its height, and where it is known to (other kinds of
    /// rays), a quarter of the height is about twice the usual error. Between lensing bands
    /// there may be another image that no ray has met, about as bright as what is around, in
    /// a small share of the cell: the next one is narrower by e^γ, 23 without spin.
    pub(super) fn new(
        center: [f64; 2],
        level: u32,
        middle: &Light,
        quarters: [Light; 4],
        [bright, disc]: [f64; 2],
    ) -> Self {
        let [a, b, c, d] = quarters.map(|light| light.intensity);
        let off = (0.25 * (a + b + c + d) - middle.intensity).abs();
        let twist = (0.25 * (a - b - c + d)).abs();
        let mut error = 0.5 * (off + twist);
        if middle.mean.is_some() {
            // Two means over the same square: of the edges that remain the quarters know.
            let own = quarters.iter().map(|light| light.mean.unwrap_or(0.0).powi(2)).sum::<f64>();
            error = off.hypot(0.25 * own.sqrt());
        }
        if quarters.iter().any(|light| light.other_piece(middle)) {
            error = error.max(0.25 * range([a, b, c, d, middle.intensity].into_iter()));
        }
        if quarters.iter().any(|light| light.other_band(middle)) {
            error = error.max(HIDDEN * bright);
        }
        let between = |i: usize, j: usize| quarters[i].between(&quarters[j]);
        let covered = half_covered([between(0, 1), between(2, 3), between(0, 2), between(1, 3)]);
        error += covered * disc;
        Cell { center, level, quarters, error: error * area(level), seam: 0.0 }
    }

    /// Its error, whatever the reason.
    pub(super) fn total(&self) -> f64 {
        self.error.max(self.seam)
    }

    pub(super) fn rays(&self) -> impl Iterator<Item = ([f64; 2], &Light)> {
        Self::places(self.center, self.level).into_iter().zip(&self.quarters)
    }

    /// Returns whether it touches the pixel's border.
    pub(super) fn is_at_border(&self) -> bool {
        let half = 0.5 * 0.5f64.powi(self.level as i32);
        self.center.iter().any(|x| x.abs() + half > 0.5 - 1e-9)
    }

    /// Centres of the quarters of a cell.
    pub(super) fn places(center: [f64; 2], level: u32) -> [[f64; 2]; 4] {
        let step = 0.25 * 0.5f64.powi(level as i32);
        let [x, y] = center;
        [[x - step, y - step], [x + step, y - step], [x - step, y + step], [x + step, y + step]]
    }
}

/// Share of a pixel's area.
pub(super) fn area(level: u32) -> f64 {
    0.25f64.powi(level as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quarters cover the cell; a constant has no error, a linear function none either.
    #[test]
    fn exact_cells() {
        let plane = |[x, y]: [f64; 2]| Light { intensity: 3.0 + x - 2.0 * y, ..Light::default() };
        let places = Cell::places([0.25, -0.25], 1);
        assert_eq!(places[0], [0.125, -0.375]);
        let quarters = places.map(plane);
        let cell = Cell::new([0.25, -0.25], 1, &plane([0.25, -0.25]), quarters, [4.0, 0.0]);
        assert!(cell.error.abs() < 1e-15);
        let bent = |[x, y]: [f64; 2]| Light { intensity: x * x + y * y, ..Light::default() };
        let quarters = Cell::places([0.0; 2], 0).map(bent);
        let cell = Cell::new([0.0; 2], 0, &bent([0.0; 2]), quarters, [0.5, 0.0]);
        // The mean over the pixel is 1/6, that of the quarters' centres 1/8.
        assert!(cell.error >= 1.0 / 6.0 - 1.0 / 8.0);
    }
}
