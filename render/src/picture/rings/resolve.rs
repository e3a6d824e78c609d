//! Light of squares of a picture, with the rays that photon rings need.

use super::{RingStrata, Stratum};
use crate::Error;
use crate::picture::grid::{Grid, Square};
use crate::picture::workspace::{BLOCK, Workspace};
use crate::transport::{Layers, Mixed, PreparedScene, RayResult};
use kerrlight_geodesic::Outcome;
use rayon::prelude::*;
use std::ops::Range;

/// Resolves the photon rings of a prepared scene.
#[derive(Debug, Clone)]
pub struct Resolver {
    strata: RingStrata,
    /// True if a disc may hide them.
    hides: bool,
}

/// The error of a picture (relative, L1) for which strata are as narrow as where pixels are not refined.
const FINE_ERROR: f64 = 1e-3;

/// Rows from which the rays of rings are estimated where they are likely to be few.
const SAMPLED: usize = 32;

/// Largest ratio of the true error to such an estimate.
const SURE: f64 = 1.5;

/// Strata are widened in so many steps to twice their width.
const STEPS_AN_OCTAVE: f64 = 4.0;

/// Most of these steps: then no square has more than one stratum.
const STEPS: u32 = 40;

/// Rays that a square got besides the one at its centre, at one time.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counted {
    pub rays: u32,
    pub unresolved: u32,
    /// Estimated error of its mean intensity.
    pub error: f64,
}

/// A square that is resolved, and its rays among those of all.
struct Job {
    square: usize,
    rays: Range<usize>,
}

impl Resolver {
    /// Prepares a scene that is seen on a grid, if what it shows has photon rings. They take no more rays than the grid: in
    /// a picture of few pixels strata are wider. Where pixels are refined until the picture is off by `image_error`, the
    /// thin images beside the critical curve are found by their light, and strata are as wide as this error allows.
    pub fn new(prepared: &PreparedScene, grid: &Grid, image_error: Option<f64>) -> Option<Self> {
        let spacing = prepared.ring_spacing()?;
        let strata = RingStrata::new(prepared.hole(), prepared.view(), spacing);
        let (strata, finest) = match image_error {
            Some(error) => (strata.on_curve(), (error / FINE_ERROR).max(1.0)),
            None => (strata, 1.0),
        };
        let hides = prepared.has_opaque_disc();
        Some(Resolver { strata: strata.coarsened(finest), hides }.within(grid))
    }

    /// The same with strata as much wider as it takes for their rays to be no more than those of a grid.
    fn within(self, grid: &Grid) -> Self {
        let most = (grid.width * grid.height * grid.side * grid.side) as u64;
        // A sample of rows first: only near the limit are all of them counted.
        let few = self.rays(grid, grid.height.div_ceil(SAMPLED));
        if few as f64 * SURE < most as f64 || self.rays(grid, 1) <= most {
            return self;
        }
        let (mut fine, mut coarse) = (0, STEPS);
        let coarser = |step: u32| {
            let coarseness = self.strata.coarseness() * (f64::from(step) / STEPS_AN_OCTAVE).exp2();
            Resolver { strata: self.strata.coarsened(coarseness), hides: self.hides }
        };
        while coarse - fine > 1 {
            let middle = (fine + coarse) / 2;
            if coarser(middle).rays(grid, 1) <= most { coarse = middle } else { fine = middle }
        }
        coarser(coarse)
    }

    /// Returns the number of rays of a square, hidden or not, besides that at its centre.
    pub fn count(&self, square: Square) -> usize {
        self.strata.count(square.center, square.size)
    }

    /// Returns the number of rays of the squares of a grid, from those in one row of pixels out of `every`.
    pub fn rays(&self, grid: &Grid, every: usize) -> u64 {
        let Grid { width, height, side, size } = *grid;
        let of_row = |row: usize| {
            let places = (0..width * side * side).map(|k| (k / (side * side), k % (side * side)));
            let square = |(column, k): (usize, usize)| {
                let center = grid.screen(column, row, k % side, k / side);
                self.count(Square { center, size: size / side as f64 }) as u64
            };
            places.map(square).sum::<u64>()
        };
        let rows: Vec<usize> = (0..height).step_by(every).collect();
        let found: u64 = rows.par_iter().map(|row| of_row(*row)).sum();
        found * height as u64 / rows.len() as u64
    }

    /// Replaces the light in `seen`, of rays at the centres of `squares` at each time (square k at time j has the number
    /// j times the count of squares, and k more), by means over the squares where photon rings run through them; and what is
    /// kept of these rays besides, in `layers`.
    pub fn resolve(
        &self,
        prepared: &PreparedScene,
        squares: &[Square],
        times: &[f64],
        seen: &mut [RayResult],
        layers: &mut [Layers],
        work: &mut Workspace,
    ) -> Result<Vec<Counted>, Error> {
        let mut counted = vec![Counted::default(); seen.len()];
        let mut rays = Vec::new();
        let mut jobs = Vec::new();
        for (square, Square { center, size }) in squares.iter().enumerate() {
            let first = rays.len();
            self.strata.place(*center, *size, &mut rays);
            if rays.len() > first {
                jobs.push(Job { square, rays: first..rays.len() });
            }
        }
        if self.hides {
            self.drop_hidden(prepared, squares, seen, &mut jobs, work)?;
        }
        for some in batches(&jobs) {
            work.clear();
            for ray in some.iter().flat_map(|job| &rays[job.rays.clone()]) {
                work.push_ray(ray.x, ray.y);
            }
            let count = work.len();
            work.observe_at(prepared, times)?;
            for j in 0..times.len() {
                let mut first = j * count;
                for job in some {
                    let (strata, own) = (&rays[job.rays.clone()], first..first + job.rays.len());
                    first = own.end;
                    let place = j * squares.len() + job.square;
                    let found = &work.seen[own.clone()];
                    counted[place] = mean(strata, found, &mut seen[place]);
                    let between = between(strata, found);
                    counted[place].error = self.error(strata, found);
                    if between > 0.0 {
                        let light = prepared.brightest_disc(squares[job.square].center);
                        counted[place].error += 2.0 * between * light;
                    }
                    if let Some(layers) = layers.get_mut(place) {
                        layers.mixed = mixed(strata, &work.layers[own]);
                    }
                }
            }
        }
        Ok(counted)
    }

    /// Returns the error of the mean: an edge between two strata is anywhere between their rays, so that a quarter of its
    /// height is the usual error of their common share; errors of edges are independent. Images that are narrower than
    /// strata which were widened may lie within them, as bright as what is next to them.
    fn error(&self, rays: &[Stratum], found: &[RayResult]) -> f64 {
        let pairs = rays.windows(2).zip(found.windows(2));
        let square = |(rays, found): (&[Stratum], &[RayResult])| match (rays, found) {
            ([a, b], [one, other]) => {
                (0.125 * (a.share + b.share) * (one.intensity - other.intensity)).powi(2)
            }
            _ => 0.0,
        };
        let edges = pairs.map(square).sum::<f64>();
        let within = 0.25 * (1.0 - 1.0 / self.strata.coarseness());
        let contrast = within * range(found.iter().map(|ray| ray.intensity));
        let hidden = rays.iter().map(|ray| (contrast * ray.share).powi(2)).sum::<f64>();
        (edges + hidden).sqrt()
    }

    /// Drops squares whose centre and corners all end on the direct image of an opaque disc.
    fn drop_hidden(
        &self,
        prepared: &PreparedScene,
        squares: &[Square],
        seen: &[RayResult],
        jobs: &mut Vec<Job>,
        work: &mut Workspace,
    ) -> Result<(), Error> {
        // Bit 0 alone: the first crossing, of matter that does not plunge.
        let hidden = |seen: &RayResult| seen.outcome == Outcome::Surface && seen.disc_images == 1;
        let asked = |job: &&Job| seen.get(job.square).is_some_and(hidden);
        work.clear();
        for Square { center: (x, y), size } in
            jobs.iter().filter(asked).map(|job| squares[job.square])
        {
            let half = 0.5 * size;
            for (dx, dy) in [(-half, -half), (half, -half), (-half, half), (half, half)] {
                work.push_ray(x + dx, y + dy);
            }
        }
        let corners = work.observe(prepared)?;
        let mut all = corners.chunks_exact(4).map(|four| four.iter().all(hidden));
        jobs.retain(|job| !(asked(&job) && all.next().unwrap_or(false)));
        Ok(())
    }
}

/// Jobs with about a block's worth of rays.
fn batches(jobs: &[Job]) -> impl Iterator<Item = &[Job]> {
    let mut rest = jobs;
    std::iter::from_fn(move || {
        let mut sum = 0;
        let fits = |job: &&Job| {
            sum += job.rays.len();
            sum <= BLOCK
        };
        let count = rest.iter().take_while(fits).count().max(1);
        let (some, others) = rest.split_at_checked(count)?;
        rest = others;
        Some(some)
    })
}

/// The mean over a square in place of what its central ray sees.
fn mean(rays: &[Stratum], found: &[RayResult], seen: &mut RayResult) -> Counted {
    (seen.intensity, seen.rgb, seen.stokes) = (0.0, [0.0; 3], [0.0; 3]);
    let mut counted = Counted { rays: rays.len() as u32, ..Counted::default() };
    for (Stratum { share, .. }, light) in rays.iter().zip(found) {
        seen.intensity += share * light.intensity;
        for (sum, x) in seen.rgb.iter_mut().zip(light.rgb) {
            *sum += *share as f32 * x;
        }
        for (sum, x) in seen.stokes.iter_mut().zip(light.stokes) {
            *sum += share * x;
        }
        counted.unresolved += u32::from(light.outcome.is_unresolved());
    }
    counted
}

/// The same of what is averaged besides.
fn mixed(rays: &[Stratum], found: &[Layers]) -> Mixed {
    let mut mixed = Mixed::default();
    for (Stratum { share, .. }, layers) in rays.iter().zip(found) {
        mixed.add(*share as f32, &layers.mixed);
    }
    mixed
}

/// The share of a square that images of the disc cover between its rays.
fn between(rays: &[Stratum], found: &[RayResult]) -> f64 {
    let pairs = rays.windows(2).zip(found.windows(2));
    let share = |(rays, found): (&[Stratum], &[RayResult])| match (rays, found) {
        ([a, b], [one, other]) => 0.5 * (a.share + b.share) * one.passes.between(&other.passes),
        _ => 0.0,
    };
    pairs.map(share).sum()
}

/// Largest less least.
pub(in crate::picture) fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    high - low
}
