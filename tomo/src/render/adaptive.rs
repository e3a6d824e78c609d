//! Pixels that get as many rays as their light needs: cells of a pixel are cut into four, again
//! and again, where they are estimated to be off by most.
//!
//! A pixel starts with the ray at its centre. It is cut if one of its eight neighbours sees
//! another lensing band (number of crossings of the equatorial plane), another image of the disc,
//! another fate of the ray or emission where it sees none, or if second differences say that its mean is off by more
//! than the tolerance. Neighbours beyond a tile are traced again, so that no pixel
//! depends on the tiles.

use super::grid::Grid;
use super::pixels::{Pixel, Workspace};
use crate::transport::{Fate, Glimpse, Stage};
use kerrlight_geodesic::OutOfRange;
use rayon::prelude::*;
use std::ops::Range;

/// Cells are cut at most this often: the smallest are 1/128 of a pixel wide.
const DEEPEST: u32 = 6;

/// A pixel that has got as many rays gets no more.
const MOST_RAYS: u32 = 4096;

/// The share of the allowed error for which the tolerance of a pixel is chosen.
const SAFETY: f64 = 0.9;

/// The light between two lensing bands that no ray has met, in terms of what is around.
const HIDDEN: f64 = 1.0 / 16.0;

/// Pixels along a side of the picture by which the tolerance is chosen, at most.
const COARSE: usize = 128;

/// What a ray adds to its cell.
#[derive(Debug, Clone, Copy, Default)]
struct Light {
    intensity: f64,
    rgb: [f32; 3],
    stokes: [f64; 3],
    kind: Kind,
    unresolved: bool,
}

/// What rays of one smooth piece of the picture have in common.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Kind {
    /// Lensing band and fate.
    band: (u32, Fate),
    /// Images of the disc that are seen.
    disc_images: u32,
    /// Whether there is emission.
    lit: bool,
}

impl Light {
    /// Whether a lensing band or the end of rays lies between two rays.
    fn other_band(&self, other: &Light) -> bool {
        self.kind.band != other.kind.band
    }
}

impl From<&Glimpse> for Light {
    fn from(seen: &Glimpse) -> Self {
        let band = (seen.crossings, seen.fate);
        let (disc_images, lit) = (seen.disc_images, seen.radius > 0.0);
        Light {
            intensity: seen.intensity,
            rgb: seen.rgb,
            stokes: seen.stokes,
            kind: Kind { band, disc_images, lit },
            unresolved: seen.fate == Fate::Unresolved,
        }
    }
}

/// A square part of a pixel whose four quarters have a ray each.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Centre, in pixels from the pixel's.
    center: [f64; 2],
    /// How often the pixel was cut to get it.
    level: u32,
    quarters: [Light; 4],
    /// Estimated error of its share in the pixel's intensity.
    error: f64,
    /// The same of edges that pass between its rays and those of the next cells.
    seam: f64,
}

/// Largest less least.
fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    high - low
}

impl Cell {
    /// `middle` is the ray at its centre, `bright` the largest intensity around.
    ///
    /// A smooth function's mean over the quarters is off by a third of d, the difference
    /// of the quarters' mean and the middle; where an edge runs through, d or the twist t of
    /// the quarters are of the order of its height, and where it is known to (other kinds of
    /// rays), a quarter of the height is about twice the usual error. Between lensing bands
    /// there may be another image that no ray has met, about as bright as what is around, in
    /// a small share of the cell: the next one is narrower by e^γ, 23 without spin.
    fn new(
        center: [f64; 2],
        level: u32,
        middle: &Light,
        quarters: [Light; 4],
        bright: f64,
    ) -> Self {
        let [a, b, c, d] = quarters.map(|light| light.intensity);
        let off = (0.25 * (a + b + c + d) - middle.intensity).abs();
        let twist = (0.25 * (a - b - c + d)).abs();
        let mut error = 0.5 * (off + twist);
        if quarters.iter().any(|light| light.kind != middle.kind) {
            error = error.max(0.25 * range([a, b, c, d, middle.intensity].into_iter()));
        }
        if quarters.iter().any(|light| light.other_band(middle)) {
            error = error.max(HIDDEN * bright);
        }
        Cell { center, level, quarters, error: error * area(level), seam: 0.0 }
    }

    /// Its error, whatever the reason.
    fn total(&self) -> f64 {
        self.error.max(self.seam)
    }

    fn rays(&self) -> impl Iterator<Item = ([f64; 2], &Light)> {
        Self::places(self.center, self.level).into_iter().zip(&self.quarters)
    }

    /// Whether it touches the pixel's border.
    fn is_at_border(&self) -> bool {
        let half = 0.5 * 0.5f64.powi(self.level as i32);
        self.center.iter().any(|x| x.abs() + half > 0.5 - 1e-9)
    }

    /// Centres of the quarters of a cell.
    fn places(center: [f64; 2], level: u32) -> [[f64; 2]; 4] {
        let step = 0.25 * 0.5f64.powi(level as i32);
        let [x, y] = center;
        [[x - step, y - step], [x + step, y - step], [x - step, y + step], [x + step, y + step]]
    }
}

/// Share of a pixel's area.
fn area(level: u32) -> f64 {
    0.25f64.powi(level as i32)
}

/// A pixel that is being cut.
struct Cut {
    /// Which of the tile's.
    pixel: usize,
    column: usize,
    row: usize,
    cells: Vec<Cell>,
    /// Largest intensity of its rays and its neighbours' first ones.
    bright: f64,
    /// The first rays of its neighbours, row by row, its own in the middle.
    around: [Light; 9],
    /// How much neighbours' first rays differ from its rays on their side if none of these is of
    /// their kind: an edge may run through between its border and its outermost rays.
    contrast: f64,
    rays: u32,
    unresolved: u32,
}

impl Cut {
    /// Root of the sum of squares: the errors of cells at an edge are independent.
    fn inner_error(&self) -> f64 {
        self.cells.iter().map(|cell| cell.total().powi(2)).sum::<f64>().sqrt()
    }

    /// What an edge that no ray has told of may do: a quarter of what lies between border and
    /// rays, whose share is 2^−(2 + level).
    fn border_error(&self) -> f64 {
        HIDDEN * self.contrast * 0.5f64.powi(self.border_level() as i32)
    }

    fn border_level(&self) -> u32 {
        let border = self.cells.iter().filter(|cell| cell.is_at_border());
        border.map(|cell| cell.level).min().unwrap_or(0)
    }

    fn error(&self) -> f64 {
        self.inner_error().hypot(self.border_error())
    }

    /// Looks for edges between rays of neighbouring cells and of neighbouring pixels.
    fn find_seams(&mut self) {
        let sides = (0..9).map(|k| [k % 3 - 1, k / 3 - 1]).zip(&self.around);
        let contrast = sides.map(|(side, light)| self.contrast_with(side, light));
        self.contrast = contrast.fold(0.0, f64::max);
        let mut lights = self.cells.iter().flat_map(|cell| &cell.quarters);
        let Some(first) = lights.next() else { return };
        if lights.all(|light| light.kind == first.kind) {
            self.cells.iter_mut().for_each(|cell| cell.seam = 0.0);
            return;
        }
        let raster = Raster::new(&self.cells);
        for k in 0..self.cells.len() {
            self.cells[k].seam = raster.seam(&self.cells, k);
        }
    }

    /// How much the first ray of the neighbour on one side differs from the outermost rays on
    /// that side, 0 if one of them is of its kind.
    fn contrast_with(&self, side: [i32; 2], neighbor: &Light) -> f64 {
        let mut contrast = 0.0f64;
        for cell in self.cells.iter().filter(|cell| cell.is_at_border()) {
            let reach = 0.5 - 0.25 * 0.5f64.powi(cell.level as i32) - 1e-9;
            let outermost = |place: &[f64; 2]| {
                place.iter().zip(side).all(|(x, d)| d == 0 || x * f64::from(d) >= reach)
            };
            for (_, light) in cell.rays().filter(|(place, _)| outermost(place)) {
                if light.kind == neighbor.kind {
                    return 0.0;
                }
                contrast = contrast.max((light.intensity - neighbor.intensity).abs());
            }
        }
        contrast
    }

    /// The cells to be cut next, the worst ones, moved to the end; how many.
    fn worst(&mut self, tolerance: f64) -> usize {
        self.find_seams();
        if self.error() <= tolerance || self.rays >= MOST_RAYS {
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
    fn add(&mut self, center: [f64; 2], level: u32, middle: &Light, seen: &[Glimpse]) {
        let mut quarters = [Light::default(); 4];
        for (place, seen) in quarters.iter_mut().zip(seen) {
            *place = Light::from(seen);
            self.unresolved += u32::from(place.unresolved);
            self.bright = self.bright.max(place.intensity);
        }
        self.rays += 4;
        self.cells.push(Cell::new(center, level, middle, quarters, self.bright));
    }

    /// The pixel's light.
    fn finish(&self, pixel: &mut Pixel) {
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

/// Which cell lies where in a pixel.
struct Raster(Vec<u16>);

impl Raster {
    /// Cells along a side, of the smallest kind.
    const SIDE: usize = 1 << DEEPEST;

    fn new(cells: &[Cell]) -> Self {
        let mut raster = Raster(vec![0; Self::SIDE * Self::SIDE]);
        for (number, cell) in cells.iter().enumerate() {
            let size = Self::SIDE >> cell.level;
            let first = |x: f64| ((x + 0.5) * Self::SIDE as f64) as usize - size / 2;
            let [column, row] = cell.center.map(first);
            for row in row..row + size {
                let start = row * Self::SIDE + column;
                // A pixel has at most MOST_RAYS cells.
                raster.0[start..start + size].fill(number as u16);
            }
        }
        raster
    }

    /// The light of the ray of the quarter that a place lies in, if it is in the pixel.
    fn light<'a>(&self, cells: &'a [Cell], place: [f64; 2]) -> Option<&'a Light> {
        if place.iter().any(|x| x.abs() >= 0.5) {
            return None;
        }
        let [column, row] = place.map(|x| ((x + 0.5) * Self::SIDE as f64) as usize);
        let cell = cells.get(usize::from(*self.0.get(row * Self::SIDE + column)?))?;
        let [x, y] = [0, 1].map(|c| usize::from(place[c] > cell.center[c]));
        cell.quarters.get(2 * y + x)
    }

    /// What edges may do that pass between the rays of cell number `k` and those of the cells
    /// next to it. Between a ray and the border lies half of its quarter; the edge may be anywhere
    /// between this ray and the next cell's, which is taken for a quarter of the quarter.
    fn seam(&self, cells: &[Cell], k: usize) -> f64 {
        let cell = &cells[k];
        let size = 0.5f64.powi(cell.level as i32);
        let quarter = 0.25 * area(cell.level);
        let mut seam = 0.0;
        for (place, light) in cell.rays() {
            for axis in 0..2 {
                let mut across = place;
                // Just over the border, on the level of the ray.
                across[axis] += (place[axis] - cell.center[axis]).signum() * 0.251 * size;
                let next = self.light(cells, across).filter(|next| next.kind != light.kind);
                if let Some(next) = next {
                    seam += 0.25 * quarter * (next.intensity - light.intensity).abs();
                }
            }
        }
        seam
    }
}

/// The pixels of a rectangle, row by row, each estimated to within `tolerance`.
pub(super) fn adaptive(
    stage: &Stage,
    grid: &Grid,
    rows: Range<usize>,
    columns: Range<usize>,
    tolerance: f64,
    work: &mut Workspace,
) -> Result<Vec<Pixel>, OutOfRange> {
    let (mut pixels, mut cuts) = first(stage, grid, rows, columns, tolerance, work)?;
    let middles: Vec<Light> =
        cuts.iter().map(|cut| Light::from(&pixels[cut.pixel].center)).collect();
    work.clear();
    for cut in &cuts {
        push_quarters(work, grid, cut, [0.0; 2], 0);
    }
    let seen = work.look(stage)?;
    for ((cut, middle), seen) in cuts.iter_mut().zip(&middles).zip(seen.chunks_exact(4)) {
        cut.add([0.0; 2], 0, middle, seen);
    }
    while !cuts.is_empty() {
        let mut going = Vec::with_capacity(cuts.len());
        for mut cut in cuts {
            let worst = cut.worst(tolerance);
            if worst == 0 {
                cut.finish(&mut pixels[cut.pixel]);
            } else {
                let parents = cut.cells.split_off(cut.cells.len() - worst);
                going.push((cut, parents));
            }
        }
        cuts = deeper(stage, grid, going, work)?;
    }
    Ok(pixels)
}

/// Traces the quarters of the quarters of `parents`.
fn deeper(
    stage: &Stage,
    grid: &Grid,
    going: Vec<(Cut, Vec<Cell>)>,
    work: &mut Workspace,
) -> Result<Vec<Cut>, OutOfRange> {
    work.clear();
    for (cut, parents) in &going {
        for parent in parents {
            for center in Cell::places(parent.center, parent.level) {
                push_quarters(work, grid, cut, center, parent.level + 1);
            }
        }
    }
    let mut seen = work.look(stage)?.chunks_exact(4);
    let mut cuts = Vec::with_capacity(going.len());
    for (mut cut, parents) in going {
        for parent in parents {
            let places = Cell::places(parent.center, parent.level);
            for (center, middle) in places.into_iter().zip(&parent.quarters) {
                cut.add(center, parent.level + 1, middle, seen.next().unwrap_or_default());
            }
        }
        cuts.push(cut);
    }
    Ok(cuts)
}

fn push_quarters(work: &mut Workspace, grid: &Grid, cut: &Cut, center: [f64; 2], level: u32) {
    for place in Cell::places(center, level) {
        work.push(grid.inside(cut.column, cut.row, place));
    }
}

/// One ray a pixel, and which pixels are to be cut.
fn first(
    stage: &Stage,
    grid: &Grid,
    rows: Range<usize>,
    columns: Range<usize>,
    tolerance: f64,
    work: &mut Workspace,
) -> Result<(Vec<Pixel>, Vec<Cut>), OutOfRange> {
    // With the neighbours that there are.
    let around = |range: &Range<usize>, count: usize| {
        range.start.saturating_sub(1)..(range.end + 1).min(count)
    };
    let (wide, high) = (around(&columns, grid.width), around(&rows, grid.height));
    work.clear();
    for row in high.clone() {
        for column in wide.clone() {
            work.push(grid.inside(column, row, [0.0; 2]));
        }
    }
    let seen = work.look(stage)?;
    let light: Vec<Light> = seen.iter().map(Light::from).collect();
    let place = |column: usize, row: usize| (row - high.start) * wide.len() + column - wide.start;
    let (mut pixels, mut cuts) = (Vec::new(), Vec::new());
    for row in rows {
        for column in columns.clone() {
            let center = seen[place(column, row)];
            let neighbor = |dx: isize, dy: isize| {
                let to = |k: usize, d: isize, range: &Range<usize>| {
                    k.saturating_add_signed(d).clamp(range.start, range.end - 1)
                };
                &light[place(to(column, dx, &wide), to(row, dy, &high))]
            };
            let Estimate { error, contrast, bright } = estimate(neighbor);
            if contrast.is_some() || error > tolerance {
                let around =
                    core::array::from_fn(|k| *neighbor(k as isize % 3 - 1, k as isize / 3 - 1));
                cuts.push(Cut {
                    pixel: pixels.len(),
                    column,
                    row,
                    cells: Vec::new(),
                    bright,
                    around,
                    contrast: 0.0,
                    rays: 0,
                    unresolved: 0,
                });
            }
            pixels.push(Pixel {
                intensity: center.intensity,
                rgb: center.rgb,
                stokes: center.stokes,
                center,
                unresolved: u32::from(center.fate == Fate::Unresolved),
                rays: 1,
                error,
            });
        }
    }
    Ok((pixels, cuts))
}

/// What a pixel's first ray and those of its neighbours say.
struct Estimate {
    error: f64,
    /// Range of intensities if a neighbour is of another kind.
    contrast: Option<f64>,
    /// Largest intensity.
    bright: f64,
}

/// Twice the midpoint rule's (D_xx + D_yy)/24 where all is smooth, a quarter of the range where
/// it is not, and what may hide between lensing bands.
fn estimate<'a>(at: impl Fn(isize, isize) -> &'a Light) -> Estimate {
    let value = |dx, dy| at(dx, dy).intensity;
    let middle = at(0, 0);
    let second = |a: f64, b: f64| (a - 2.0 * middle.intensity + b).abs();
    let smooth = second(value(-1, 0), value(1, 0)) + second(value(0, -1), value(0, 1));
    let around = || (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
    let bright = around().map(|(dx, dy)| value(dx, dy)).fold(0.0, f64::max);
    let other = around().any(|(dx, dy)| at(dx, dy).kind != middle.kind);
    let contrast = other.then(|| range(around().map(|(dx, dy)| value(dx, dy))));
    let mut error = smooth / 12.0;
    if let Some(contrast) = contrast {
        error = error.max(0.25 * contrast);
    }
    if around().any(|(dx, dy)| at(dx, dy).other_band(middle)) {
        error = error.max(HIDDEN * bright);
    }
    Estimate { error, contrast, bright }
}

/// The error that each pixel may have so that the whole picture's relative L1 error stays below
/// `image_error`, from a picture of the same field with at most [`COARSE`] pixels a side.
///
/// From its pixels to k² smaller ones each, the error of smooth ones falls as k^−2; where an edge
/// runs through, k of them have it, with the same error.
pub(super) fn tolerance(stage: &Stage, grid: &Grid, image_error: f64) -> Result<f64, OutOfRange> {
    let cut = grid.width.max(grid.height).div_ceil(COARSE);
    let coarse = Grid {
        width: grid.width.div_ceil(cut),
        height: grid.height.div_ceil(cut),
        size: grid.size * cut as f64,
        side: 1,
    };
    let lines = (0..coarse.height).into_par_iter().map_init(Workspace::default, |work, row| {
        let (rows, columns) = (row..row + 1, 0..coarse.width);
        let (pixels, cuts) = first(stage, &coarse, rows, columns, f64::INFINITY, work)?;
        let mut errors: Vec<(f64, f64)> = Vec::with_capacity(pixels.len());
        let k = cut as f64;
        errors.extend(pixels.iter().map(|pixel| (pixel.error / (k * k), k * k)));
        // Those that are to be cut in any case are the ones with an edge.
        for cut in cuts {
            errors[cut.pixel] = (pixels[cut.pixel].error, k);
        }
        let sum: f64 = pixels.iter().map(|pixel| pixel.intensity * k * k).sum();
        Ok((errors, sum))
    });
    let lines = lines.collect::<Result<Vec<_>, OutOfRange>>()?;
    let sum: f64 = lines.iter().map(|(_, sum)| sum).sum();
    let errors = lines.into_iter().flat_map(|(errors, _)| errors).collect();
    Ok(allowed(errors, SAFETY * image_error * sum))
}

/// The largest t with Σ weight min(error, t) ≤ `sum`, of pairs of an error and its weight.
fn allowed(mut errors: Vec<(f64, f64)>, sum: f64) -> f64 {
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = sum;
    let mut weights: f64 = errors.iter().map(|(_, weight)| weight).sum();
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

    /// Quarters cover the cell; a constant has no error, a linear function none either.
    #[test]
    fn exact_cells() {
        let plane = |[x, y]: [f64; 2]| Light { intensity: 3.0 + x - 2.0 * y, ..Light::default() };
        let places = Cell::places([0.25, -0.25], 1);
        assert_eq!(places[0], [0.125, -0.375]);
        let quarters = places.map(plane);
        let cell = Cell::new([0.25, -0.25], 1, &plane([0.25, -0.25]), quarters, 4.0);
        assert!(cell.error.abs() < 1e-15);
        let bent = |[x, y]: [f64; 2]| Light { intensity: x * x + y * y, ..Light::default() };
        let quarters = Cell::places([0.0; 2], 0).map(bent);
        let cell = Cell::new([0.0; 2], 0, &bent([0.0; 2]), quarters, 0.5);
        // The mean over the pixel is 1/6, that of the quarters' centres 1/8.
        assert!(cell.error >= 1.0 / 6.0 - 1.0 / 8.0);
    }
}
