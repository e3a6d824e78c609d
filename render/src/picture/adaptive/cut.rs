//! A pixel on its way to as many rays as it needs.

use super::cell::{Cell, area};
use super::cell_map::CellMap;
use super::light::Light;
use super::{DEEPEST, EDGE, HIDDEN};
use crate::picture::pixels::Pixel;

/// A pixel that has got as many samples, of a ray each or of several along photon rings, gets no more.
const MOST_SAMPLES: u32 = 4096;

/// A pixel that is being cut.
#[derive(Default)]
pub(super) struct Cut {
    /// Index among the tile's pixels.
    pub(super) pixel: usize,
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) cells: Vec<Cell>,
    /// Largest intensity of its rays and its neighbours' first ones.
    pub(super) bright: f64,
    /// True if a neighbour's first ray sees another piece of the picture.
    pub(super) edge: bool,
    /// The brightest light of the disc, where edges of it are near.
    pub(super) disc: f64,
    /// The first rays of its neighbours, row by row, its own in the middle.
    pub(super) around: [Light; 9],
    /// Difference of neighbours' first rays from its rays on their side if none of these is of their kind: an edge
    /// may run through between its border and its outermost rays.
    pub(super) contrast: f64,
    pub(super) samples: u32,
    pub(super) rays: u32,
    pub(super) unresolved: u32,
}

impl Cut {
    /// Root of the sum of squares: the errors of cells at an edge are independent.
    pub(super) fn inner_error(&self) -> f64 {
        self.cells.iter().map(|cell| cell.total().powi(2)).sum::<f64>().sqrt()
    }

    /// Returns the largest error of an edge that no ray has found: a quarter of what lies between border and rays,
    /// whose share is 2^−(2 + level).
    pub(super) fn border_error(&self) -> f64 {
        HIDDEN * self.contrast * 0.5f64.powi(self.border_level() as i32)
    }

    pub(super) fn border_level(&self) -> u32 {
        let border = self.cells.iter().filter(|cell| cell.is_at_border());
        border.map(|cell| cell.level).min().unwrap_or(0)
    }

    pub(super) fn error(&self) -> f64 {
        self.inner_error().hypot(self.border_error())
    }

    /// Looks for edges between rays of neighbouring cells and of neighbouring pixels.
    pub(super) fn find_seams(&mut self) {
        let sides = (0..9).map(|k| [k % 3 - 1, k / 3 - 1]).zip(&self.around);
        let contrast = sides.map(|(side, light)| self.contrast_with(side, light));
        self.contrast = contrast.fold(0.0, f64::max);
        let mut lights = self.cells.iter().flat_map(|cell| &cell.quarters);
        let Some(first) = lights.next() else { return };
        if lights.all(|light| light.kind == first.kind) {
            self.cells.iter_mut().for_each(|cell| cell.seam = 0.0);
            return;
        }
        let map = CellMap::new(&self.cells);
        for k in 0..self.cells.len() {
            self.cells[k].seam = map.seam(&self.cells, k, self.disc);
        }
    }

    /// Returns the difference of the first ray of the neighbour on one side from the outermost rays on that side, 0
    /// if one of them is of its kind.
    pub(super) fn contrast_with(&self, side: [i32; 2], neighbor: &Light) -> f64 {
        let mut contrast = 0.0f64;
        for cell in self.cells.iter().filter(|cell| cell.is_at_border()) {
            // Outermost rays lie a quarter of their cell inside of the border.
            let reach = 0.5 - 0.25 * 0.5f64.powi(cell.level as i32) - 1e-9;
            let outermost = |place: &[f64; 2]| {
                place.iter().zip(side).all(|(x, d)| d == 0 || x * f64::from(d) >= reach)
            };
            for (_, light) in cell.rays().filter(|(place, _)| outermost(place)) {
                if !light.other_piece(neighbor) {
                    return 0.0;
                }
                let height = (light.intensity - neighbor.intensity).abs();
                contrast = contrast.max(height + self.disc * light.between(neighbor));
            }
        }
        contrast
    }

    /// The cells to be cut next, the worst ones, moved to the end; how many. `tolerance` is that of a smooth pixel.
    pub(super) fn worst(&mut self, tolerance: f64) -> usize {
        let tolerance = if self.edge { EDGE * tolerance } else { tolerance };
        self.find_seams();
        if self.error() <= tolerance || self.samples >= MOST_SAMPLES {
            return 0;
        }
        let may = |cell: &Cell| cell.level < DEEPEST;
        let most = self.cells.iter().filter(|cell| may(cell)).fold(0.0, |m, c| c.total().max(m));
        // The border first where it is what counts.
        let (border, level) = (self.border_error() > self.inner_error(), self.border_level());
        let chosen = |cell: &Cell| {
            let worst = most > 0.0 && cell.total() >= 0.5 * most;
            may(cell) && if border { cell.is_at_border() && cell.level == level } else { worst }
        };
        self.cells.sort_by_key(chosen);
        self.cells.iter().filter(|cell| chosen(cell)).count()
    }

    /// Takes the rays of the quarters of a cell.
    pub(super) fn add(&mut self, center: [f64; 2], level: u32, middle: &Light, seen: &[Light]) {
        let mut quarters = [Light::default(); 4];
        for (place, seen) in quarters.iter_mut().zip(seen) {
            *place = *seen;
            self.rays += place.rays;
            self.unresolved += place.unresolved;
            self.bright = self.bright.max(place.intensity);
        }
        self.samples += 4;
        self.cells.push(Cell::new(center, level, middle, quarters, [self.bright, self.disc]));
    }

    /// The pixel's light.
    pub(super) fn finish(&self, pixel: &mut Pixel) {
        pixel.intensity = 0.0;
        pixel.rgb = [0.0; 3];
        pixel.stokes = [0.0; 3];
        for cell in &self.cells {
            let share = area(cell.level + 1);
            for light in &cell.quarters {
                pixel.intensity += share * light.intensity;
                for (sum, x) in pixel.stokes.iter_mut().zip(light.stokes) {
                    *sum += share * x;
                }
                for (sum, light) in pixel.rgb.iter_mut().zip(light.rgb) {
                    *sum += share as f32 * light;
                }
            }
        }
        pixel.error = self.error();
        pixel.rays += self.rays;
        pixel.unresolved += self.unresolved;
    }
}
