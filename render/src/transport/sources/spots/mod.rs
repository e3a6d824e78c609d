//! The hot spots.

mod intersections;
mod light;
mod sighting;
mod trees;

pub(in crate::transport) use light::SpotRay;
pub(in crate::transport) use trees::SpotTree;

use crate::emission::spot::SpotModel;
use crate::scene::Scene;
use crate::transport::optics::Optics;
use crate::transport::result::Accumulator;
use crate::transport::tree::WalkScratch;
use intersections::{Intersections, join};
use kerrlight_geodesic::vector::{cross, norm};
use kerrlight_geodesic::{Kerr, Ray};
use light::SpotLight;
use std::sync::{Arc, Mutex, PoisonError};
use trees::SpotSpans;

/// The spots of a scene.
#[derive(Debug, Clone)]
pub(in crate::transport) struct Spots {
    models: Vec<SpotModel>,
    /// Trees over the spots by time of observation, the latest last.
    trees: Arc<Mutex<Trees>>,
    /// Trees over the spots by time of emission, with slow light.
    spans: Option<Arc<SpotSpans>>,
}

/// Trees with the time that they are for.
type Trees = Vec<(f64, Arc<SpotTree>)>;

/// Trees that are kept: as many as a movie's block of frames may need at once.
const MOST_TREES: usize = 256;

/// A piece is halved at most this often.
const DEEPEST: u32 = 24;

/// Scratch space of spots, from ray to ray.
#[derive(Debug, Default)]
pub(in crate::transport) struct SpotScratch {
    walk: WalkScratch,
    met: Vec<Intersections>,
    pieces: Vec<[f64; 2]>,
    intervals: Vec<[f64; 2]>,
}

impl Spots {
    /// The spots of a scene.
    pub fn new(scene: &Scene, hole: &Kerr) -> Self {
        let models: Vec<_> = scene.spot.iter().map(|spot| SpotModel::new(spot, hole)).collect();
        let slow = scene.effects.slow_light.then_some(&models[..]);
        let spans = slow.and_then(SpotSpans::new).map(Arc::new);
        Spots { spans, models, trees: Arc::default() }
    }

    /// Returns the number of spots.
    pub fn len(&self) -> usize {
        self.models.len()
    }

    /// Returns whether there is none.
    pub fn is_empty(&self) -> bool {
        self.models.is_empty()
    }

    /// A spot with its number.
    fn of(&self, number: usize) -> (u32, &SpotModel) {
        (number as u32, &self.models[number])
    }

    /// dx/dt of the matter of spot number `number` at a point, M.
    pub fn velocity(&self, number: usize, x: [f64; 3]) -> [f64; 3] {
        self.models.get(number).map_or([0.0; 3], |spot| cross(spot.angular_velocity(norm(x)), x))
    }

    /// Their sizes by the radii of their orbits.
    pub fn relative_sizes(&self) -> impl Iterator<Item = f64> {
        self.models.iter().map(SpotModel::relative_size)
    }

    /// The tree over the spots for a time of observation. With slow light one tree serves all, of
    /// which only the shell is used where there are trees for spans of time; without, each time has
    /// its own. It is made when it is first needed.
    pub fn tree(&self, optics: &Optics, time: f64) -> Option<Arc<SpotTree>> {
        if self.models.is_empty() || optics.one_by_one {
            return None;
        }
        let (key, at) = if optics.slow_light { (0.0, None) } else { (time, Some([time; 2])) };
        // Nothing that holds the lock can panic halfway through a change.
        let mut trees = self.trees.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, tree)) = trees.iter().rev().find(|(of, _)| *of == key) {
            return Some(tree.clone());
        }
        let tree = Arc::new(SpotTree::new(&self.models, &optics.hole, at, time));
        if trees.len() >= MOST_TREES {
            trees.remove(0);
        }
        trees.push((key, tree.clone()));
        Some(tree)
    }

    /// Returns whether the path of a ray is needed.
    pub fn need_path(&self, ray: &Ray, trees: &[Option<Arc<SpotTree>>]) -> bool {
        trees.iter().any(|tree| match tree {
            Some(tree) => tree.can_be_met(ray),
            None => !self.models.is_empty(),
        })
    }

    /// Adds their light, seen at `time`: ∫ g^{2+α} j Σ dτ. Spots are summed in their order and piece
    /// by piece, less the pieces on which the tree shows that a spot does not shine: to the last bit
    /// what there is without a tree.
    pub fn add(
        &self,
        time: f64,
        tree: Option<&SpotTree>,
        seen: &SpotRay<'_>,
        scratch: &mut SpotScratch,
        light: &mut Accumulator,
    ) {
        let Some(tree) = tree else { return self.add_every(time, seen, scratch, light) };
        if !tree.can_be_met(seen.along.ray) {
            return;
        }
        self.meet(time, tree, seen, scratch);
        let SpotScratch { intervals, met, pieces, .. } = scratch;
        for same in met.chunk_by(|a, b| a.spot == b.spot) {
            join(same, pieces);
            SpotLight::new(self.of(same[0].spot as usize), time, pieces, seen)
                .add(intervals, light);
        }
    }

    /// The same without a tree: every spot along the whole ray.
    fn add_every(
        &self,
        time: f64,
        seen: &SpotRay<'_>,
        scratch: &mut SpotScratch,
        light: &mut Accumulator,
    ) {
        for number in 0..self.models.len() {
            let everywhere = [[0.0, f64::INFINITY]];
            SpotLight::new(self.of(number), time, &everywhere, seen)
                .add(&mut scratch.intervals, light);
        }
    }
}
