//! Pixels that get as many rays as their light needs: cells of a pixel are cut into four, again
//! and again, where they are estimated to be off by most.
//!
//! A pixel starts with the ray at its centre. It is cut if one of its eight neighbours sees
//! another lensing band (number of crossings of the equatorial plane), another image of the disc,
//! another fate of the ray or emission where it sees none, or if second differences say that its mean is off by more
//! than the tolerance, or if photon rings run through it: then each part that they run through has rays along
//! them in place of one ray. Neighbours beyond a tile are traced again, so that no pixel
//! depends on the tiles.

mod cell;
mod cell_map;
mod cut;
mod light;
mod tolerance;

pub(super) use tolerance::tolerance;

use super::grid::{Grid, Square};
use super::pixels::{Pixel, half_covered};
use super::rings::{Counted, Resolver, range};
use super::workspace::Workspace;
use crate::Error;
use crate::transport::{PreparedScene, RayResult};
use cell::Cell;
use cut::Cut;
use light::Light;
use std::ops::Range;

/// Cells are cut at most this often: the smallest are 1/128 of a pixel wide.
const DEEPEST: u32 = 6;

/// The light between two lensing bands that no ray has met, in terms of what is around.
const HIDDEN: f64 = 1.0 / 16.0;

/// Ratio of the error of a pixel with an edge to that of a smooth one: it takes so many more rays that each of them
/// gains less.
const EDGE: f64 = 8.0;

/// Scene and pixels, with the error that each pixel may have.
pub(super) struct Adaptive<'a> {
    pub prepared: &'a PreparedScene,
    pub grid: &'a Grid,
    /// Resolver of photon rings, in pixels and in parts of pixels.
    pub rings: Option<&'a Resolver>,
    pub tolerance: f64,
}

impl Adaptive<'_> {
    /// The pixels of a rectangle, row by row.
    pub fn pixels(
        &self,
        rows: Range<usize>,
        columns: Range<usize>,
        work: &mut Workspace,
    ) -> Result<Vec<Pixel>, Error> {
        let (mut pixels, mut cuts) = self.first(rows, columns, work)?;
        let middles = self.middles(&pixels, &mut cuts, work)?;
        work.clear();
        for cut in &cuts {
            push_quarters(work, self.grid, cut, [0.0; 2], 0);
        }
        let seen = self.sample(work)?;
        for ((cut, middle), seen) in cuts.iter_mut().zip(&middles).zip(seen.chunks_exact(4)) {
            cut.add([0.0; 2], 0, middle, seen);
        }
        // One level of all pixels at a time, so that their rays fill blocks.
        while !cuts.is_empty() {
            let mut going = Vec::with_capacity(cuts.len());
            for mut cut in cuts {
                let worst = cut.worst(self.tolerance);
                if worst == 0 {
                    cut.finish(&mut pixels[cut.pixel]);
                } else {
                    let parents = cut.cells.split_off(cut.cells.len() - worst);
                    going.push((cut, parents));
                }
            }
            cuts = self.deeper(going, work)?;
        }
        Ok(pixels)
    }

    /// Returns the light of the first rays of pixels that are cut, or the mean where photon rings run through them.
    fn middles(
        &self,
        pixels: &[Pixel],
        cuts: &mut [Cut],
        work: &mut Workspace,
    ) -> Result<Vec<Light>, Error> {
        let mut seen: Vec<RayResult> = cuts.iter().map(|cut| pixels[cut.pixel].center).collect();
        let square = |cut: &Cut| self.grid.square(cut.column, cut.row, [0.0; 2], 1.0);
        let squares: Vec<Square> = cuts.iter().map(square).collect();
        let counted = self.resolve(&squares, &mut seen, work)?;
        for (cut, counted) in cuts.iter_mut().zip(&counted) {
            cut.rays += counted.rays;
            cut.unresolved += counted.unresolved;
        }
        Ok(seen.iter().zip(&counted).map(Light::new).collect())
    }

    /// The light of the squares of `work`.
    fn sample(&self, work: &mut Workspace) -> Result<Vec<Light>, Error> {
        let mut seen = work.observe(self.prepared)?.to_vec();
        let squares = work.squares.clone();
        let counted = self.resolve(&squares, &mut seen, work)?;
        Ok(seen.iter().zip(&counted).map(Light::new).collect())
    }

    fn resolve(
        &self,
        squares: &[Square],
        seen: &mut [RayResult],
        work: &mut Workspace,
    ) -> Result<Vec<Counted>, Error> {
        let Some(rings) = self.rings else { return Ok(vec![Counted::default(); seen.len()]) };
        rings.resolve(self.prepared, squares, &[self.prepared.time()], seen, &mut [], work)
    }

    /// Traces the quarters of the quarters of `parents`.
    fn deeper(
        &self,
        going: Vec<(Cut, Vec<Cell>)>,
        work: &mut Workspace,
    ) -> Result<Vec<Cut>, Error> {
        work.clear();
        for (cut, parents) in &going {
            for parent in parents {
                for center in Cell::places(parent.center, parent.level) {
                    push_quarters(work, self.grid, cut, center, parent.level + 1);
                }
            }
        }
        let lights = self.sample(work)?;
        let mut seen = lights.chunks_exact(4);
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

    /// One ray a pixel, and which pixels are to be cut.
    fn first(
        &self,
        rows: Range<usize>,
        columns: Range<usize>,
        work: &mut Workspace,
    ) -> Result<(Vec<Pixel>, Vec<Cut>), Error> {
        let Self { grid, rings, tolerance, .. } = *self;
        // With the neighbours that there are.
        let around = |range: &Range<usize>, count: usize| {
            range.start.saturating_sub(1)..(range.end + 1).min(count)
        };
        let (wide, high) = (around(&columns, grid.width), around(&rows, grid.height));
        work.clear();
        for row in high.clone() {
            for column in wide.clone() {
                work.push(grid.square(column, row, [0.0; 2], 1.0));
            }
        }
        let seen = work.observe(self.prepared)?;
        let light: Vec<Light> = seen.iter().map(Light::of_ray).collect();
        let place =
            |column: usize, row: usize| (row - high.start) * wide.len() + column - wide.start;
        let (mut pixels, mut cuts) = (Vec::new(), Vec::new());
        for row in rows {
            for column in columns.clone() {
                let center = seen[place(column, row)];
                let neighbor = |dx: isize, dy: isize| {
                    let to = |k: usize, d: isize, range: &Range<usize>| {
                        // At the edge of the picture a pixel is its own neighbour.
                        k.saturating_add_signed(d).clamp(range.start, range.end - 1)
                    };
                    &light[place(to(column, dx, &wide), to(row, dy, &high))]
                };
                let around =
                    core::array::from_fn(|k| *neighbor(k as isize % 3 - 1, k as isize / 3 - 1));
                let Estimate { mut error, contrast, bright, at_disc, between } = estimate(&around);
                let disc = if at_disc {
                    self.prepared.brightest_disc(grid.inside(column, row, [0.0; 2]))
                } else {
                    0.0
                };
                let missed = between * disc;
                error += 2.0 * missed;
                let ring = || {
                    let square = grid.square(column, row, [0.0; 2], 1.0);
                    rings.is_some_and(|rings| rings.count(square) > 0)
                };
                if contrast.is_some() || error > tolerance || ring() {
                    let (pixel, edge) = (pixels.len(), contrast.is_some());
                    let whole = Cut { pixel, column, row, ..Cut::default() };
                    cuts.push(Cut { bright, edge, disc, around, ..whole });
                }
                pixels.push(Pixel { missed, ..of_one_ray(center, error) });
            }
        }
        Ok((pixels, cuts))
    }
}

/// One ray into each quarter of a cell.
fn push_quarters(work: &mut Workspace, grid: &Grid, cut: &Cut, center: [f64; 2], level: u32) {
    for place in Cell::places(center, level) {
        work.push(grid.square(cut.column, cut.row, place, 0.5f64.powi(level as i32 + 1)));
    }
}

/// Estimate of a pixel from its first ray and those of its neighbours.
struct Estimate {
    error: f64,
    /// Range of intensities if a neighbour is of another kind.
    contrast: Option<f64>,
    /// Largest intensity.
    bright: f64,
    /// True if an edge of the disc runs through.
    at_disc: bool,
    /// The share of the pixel that images of the disc cover which lie between the rays.
    between: f64,
}

/// Twice the midpoint rule's (D_xx + D_yy)/24 where all is smooth, a quarter of the range where
/// it is not, and what may hide between lensing bands.
fn estimate(lights: &[Light; 9]) -> Estimate {
    let at = |dx: isize, dy: isize| &lights[(4 + dx + 3 * dy) as usize];
    let value = |dx, dy| at(dx, dy).intensity;
    let middle = at(0, 0);
    let second = |a: f64, b: f64| (a - 2.0 * middle.intensity + b).abs();
    let smooth = second(value(-1, 0), value(1, 0)) + second(value(0, -1), value(0, 1));
    let bright = lights.iter().map(|light| light.intensity).fold(0.0, f64::max);
    let other = lights.iter().any(|light| light.kind != middle.kind);
    let contrast = other.then(|| range(lights.iter().map(|light| light.intensity)));
    let mut error = smooth / 12.0;
    if let Some(contrast) = contrast {
        error = error.max(0.25 * contrast);
    }
    if lights.iter().any(|light| light.other_band(middle)) {
        error = error.max(HIDDEN * bright);
    }
    let of_disc = |light: &Light| (light.kind.disc_images, light.kind.sides);
    let at_disc = lights.iter().any(|light| of_disc(light) != of_disc(middle));
    let between = [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(dx, dy)| at(dx, dy).between(middle));
    Estimate { error, contrast, bright, at_disc, between: half_covered(between) }
}

/// A pixel that one ray stands for.
fn of_one_ray(center: RayResult, error: f64) -> Pixel {
    Pixel {
        intensity: center.intensity,
        rgb: center.rgb,
        stokes: center.stokes,
        center,
        unresolved: u32::from(center.outcome.is_unresolved()),
        rays: 1,
        error,
        missed: 0.0,
        known: 1.0,
    }
}
