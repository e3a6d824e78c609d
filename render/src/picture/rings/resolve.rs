//! What squares of a picture see, with the rays that photon rings need.

use super::{RingStrata, Stratum};
use crate::Error;
use crate::picture::grid::Square;
use crate::picture::workspace::Workspace;
use crate::transport::{Layers, Mixed, PreparedScene, RayResult};
use kerrlight_geodesic::Outcome;
use std::ops::Range;

/// Resolves the photon rings of a prepared scene.
#[derive(Debug, Clone)]
pub struct Resolver {
    strata: RingStrata,
    /// Whether a disc may hide them.
    hides: bool,
}

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
    /// Of a prepared scene, if what it shows has photon rings. Where pixels are refined the thin images beside the critical
    /// curve are found by their light.
    pub fn new(prepared: &PreparedScene, refined: bool) -> Option<Self> {
        let spacing = prepared.ring_spacing()?;
        let strata = RingStrata::new(prepared.hole(), prepared.view(), spacing);
        let strata = if refined { strata.on_curve() } else { strata };
        Some(Resolver { strata, hides: prepared.has_opaque_disc() })
    }

    /// How many rays a square gets, hidden or not, besides that at its centre.
    pub fn count(&self, square: Square) -> usize {
        let mut rays = Vec::new();
        self.strata.place(square.center, square.size, &mut rays);
        rays.len()
    }

    /// Replaces the light in `seen`, of rays at the centres of `squares` at each time (square k at time j has the number
    /// j times the count of squares, and k more), by means over the squares where photon rings run through them; and what is
    /// kept of these rays besides, in `layers`.
    pub fn resolve(
        &self,
        prepared: &PreparedScene,
        squares: &[Square],
        times: &[f64],
        (seen, layers): (&mut [RayResult], &mut [Layers]),
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
                work.push_ray((ray.x, ray.y));
            }
            let count = work.len();
            work.observe_at(prepared, times)?;
            for j in 0..times.len() {
                let mut first = j * count;
                for job in some {
                    let (strata, own) = (&rays[job.rays.clone()], first..first + job.rays.len());
                    first = own.end;
                    let place = j * squares.len() + job.square;
                    counted[place] = mean(strata, &work.seen[own.clone()], &mut seen[place]);
                    if let Some(layers) = layers.get_mut(place) {
                        layers.mixed = mixed(strata, &work.layers[own]);
                    }
                }
            }
        }
        Ok(counted)
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
        let hidden = |seen: &RayResult| seen.outcome == Outcome::Surface && seen.disc_images == 1;
        let asked = |job: &&Job| seen.get(job.square).is_some_and(hidden);
        work.clear();
        for Square { center: (x, y), size } in
            jobs.iter().filter(asked).map(|job| squares[job.square])
        {
            let half = 0.5 * size;
            for (dx, dy) in [(-half, -half), (half, -half), (-half, half), (half, half)] {
                work.push_ray((x + dx, y + dy));
            }
        }
        let corners = work.observe(prepared)?;
        let mut all = corners.chunks_exact(4).map(|four| four.iter().all(hidden));
        jobs.retain(|job| !(asked(&job) && all.next().unwrap_or(false)));
        Ok(())
    }
}

/// Rays that are traced together, about.
const BLOCK: usize = 1024;

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
    counted.error = error(rays, found);
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

/// Of the mean: an edge between two strata is anywhere between their rays, so that a quarter of its height
/// is the usual error of their common share; errors of edges are independent.
fn error(rays: &[Stratum], found: &[RayResult]) -> f64 {
    let pairs = rays.windows(2).zip(found.windows(2));
    let square = |(rays, found): (&[Stratum], &[RayResult])| match (rays, found) {
        ([a, b], [one, other]) => {
            (0.125 * (a.share + b.share) * (one.intensity - other.intensity)).powi(2)
        }
        _ => 0.0,
    };
    pairs.map(square).sum::<f64>().sqrt()
}
