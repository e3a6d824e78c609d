//! Bands of rows on all cores. Tiles are handed out from the top; whoever ends the last tile of
//! a band puts the band together, so that only a few bands are in memory at any time.

use super::adaptive::{self, Adaptive};
use super::grid::Grid;
use super::pixels::{Pixel, Pixels, half_covered, uniform};
use super::tally::Tally;
use super::workspace::Workspace;
use super::{Progress, Raster, RenderError};
use crate::Error;
use rayon::prelude::*;
use std::iter::from_fn;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// A band of rows.
#[derive(Debug, Clone)]
pub(super) struct Band {
    pub index: usize,
    /// Row by row, of each channel; intensities in the raster's unit.
    pub channels: Vec<Vec<f32>>,
    /// Tally in the scene's unit.
    pub tally: Tally,
}

/// Takes a band at each time, in any order of bands and from several threads.
pub(super) type Sink<'a> = dyn Fn(Vec<Band>) -> Result<(), Error> + Sync + 'a;

/// The pixels of a tile at each time.
type Tile = Vec<Pixels>;

/// The tiles of a band that are there.
type Parts = Vec<Option<Tile>>;

/// Adds a tile to its band; all of them if it was the last.
fn put(band: &Mutex<Parts>, tiles: usize, tile: usize, pixels: Tile) -> Option<Parts> {
    let mut parts = band.lock().unwrap_or_else(PoisonError::into_inner);
    parts.resize(tiles, None);
    parts[tile] = Some(pixels);
    let complete = parts.iter().all(Option::is_some);
    complete.then(|| std::mem::take(&mut *parts))
}

/// Renders the bands `todo` at each of `times` into `sink`. A band is asked for when a thread is free for it. Where
/// `progress` says so it stops after the bands that are under way. Where pixels are refined there is one time, the
/// prepared scene's.
pub(super) fn render_bands(
    raster: &Raster,
    times: &[f64],
    todo: &mut (dyn Iterator<Item = usize> + Send),
    sink: &Sink<'_>,
    progress: &Progress<'_>,
) -> Result<(), Error> {
    let tiles = raster.tiles();
    let mut todo = todo.peekable();
    // The tolerance takes a coarse picture, which a complete journal does not need.
    let tolerance = if todo.peek().is_none() { None } else { raster.tolerance()? };
    let stop = AtomicBool::new(false);
    let open: Vec<Mutex<Parts>> = (0..raster.bands()).map(|_| Mutex::default()).collect();
    // Looked at band by band: one that is begun gets all its tiles.
    let wanted = from_fn(|| if stop.load(Ordering::Relaxed) { None } else { todo.next() });
    let order = wanted.flat_map(|band| (0..tiles).map(move |tile| (band, tile))).par_bridge();
    order.try_for_each_init(Workspace::default, |work, (band, tile)| -> Result<(), Error> {
        let pixels = raster.tile(band, tile, times, tolerance, work)?;
        let Some(parts) = put(&open[band], tiles, tile, pixels) else { return Ok(()) };
        let at = |time: usize| raster.assemble(band, &parts, time);
        sink((0..times.len()).map(at).collect::<Result<_, _>>()?)?;
        if !progress(raster.layout.rows(band).len()) {
            stop.store(true, Ordering::Relaxed);
        }
        Ok(())
    })?;
    if stop.into_inner() { Err(RenderError::Stopped.into()) } else { Ok(()) }
}

impl Raster {
    /// Number of tiles in a band.
    fn tiles(&self) -> usize {
        self.grid.width.div_ceil(self.tile)
    }

    /// The error that each pixel may have, where pixels are refined.
    fn tolerance(&self) -> Result<Option<f64>, Error> {
        let Some(error) = self.scene.screen.image_error else { return Ok(None) };
        Ok(Some(adaptive::tolerance(&self.prepared, &self.grid, error)?))
    }

    fn tile(
        &self,
        band: usize,
        tile: usize,
        times: &[f64],
        tolerance: Option<f64>,
        work: &mut Workspace,
    ) -> Result<Tile, Error> {
        let end = ((tile + 1) * self.tile).min(self.grid.width);
        let columns = tile * self.tile..end;
        let (prepared, grid, rows) = (&self.prepared, &self.grid, self.layout.rows(band));
        let pixels = match tolerance {
            Some(tolerance) => {
                let rings = self.rings.as_ref();
                let refined = Adaptive { prepared, grid, rings, tolerance };
                vec![Pixels::plain(refined.pixels(rows, columns, work)?)]
            }
            None => uniform(prepared, self.rings.as_ref(), grid, rows, columns, times, work)?,
        };
        Ok(pixels)
    }

    /// Sum over the pixels of a band of the error by images of the disc that pass between their rays.
    fn between(&self, pixels: &[Pixel], first: usize) -> f64 {
        let Grid { width, side, .. } = self.grid;
        let passes = |k: usize| &pixels[k].center.passes;
        let mut sum = 0.0;
        for k in 0..pixels.len() {
            let (column, row) = (k % width, k / width);
            let next = [
                (column > 0).then(|| k - 1),
                (column + 1 < width).then_some(k + 1),
                (row > 0).then(|| k - width),
                (k + width < pixels.len()).then_some(k + width),
            ];
            let share = next.map(|other| other.map_or(0.0, |k2| passes(k).between(passes(k2))));
            let covered = half_covered(share);
            // Images that are wider than the rays are apart are met.
            let missed = covered * (1.0 - covered * side as f64).max(0.0);
            if missed > 0.0 {
                let center = self.grid.inside(column, first + row, [0.0; 2]);
                let unknown = 1.0 - pixels[k].known;
                sum += 2.0 * unknown * missed * self.prepared.brightest_disc(center);
            }
        }
        sum
    }

    /// The band from its tiles at the time number `time`.
    fn assemble(&self, index: usize, parts: &Parts, time: usize) -> Result<Band, Error> {
        let (width, rows) = (self.grid.width, self.layout.rows(index).len());
        let parts: Vec<&Pixels> =
            parts.iter().flatten().filter_map(|tile| tile.get(time)).collect();
        let Pixels { pixels, layers } = Pixels::joined(&parts, width, rows);
        let mut channels = Vec::with_capacity(self.channels.len());
        for kind in &self.channels {
            let values = kind.values(&pixels, &layers, self.unit);
            if !values.iter().all(|value| value.is_finite()) {
                return Err(RenderError::NotFinite { channel: kind.name }.into());
            }
            channels.push(values);
        }
        let side = self.scene.screen.image_error.is_none().then_some(self.grid.side);
        let mut tally = Tally::of_band(&pixels, width, side);
        if side.is_some() {
            tally.error += self.between(&pixels, self.layout.rows(index).start);
        }
        Ok(Band { index, channels, tally })
    }
}
