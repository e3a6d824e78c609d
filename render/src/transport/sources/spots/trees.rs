//! Trees of the places that spots can shine from.

use crate::emission::spot::{CUT_OFF, SpotModel};
use crate::emission::spot_parts::SpotPart;
use crate::transport::tree::Tree;
use kerrlight_geodesic::{Kerr, Ray};
use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock};

/// Tree of the places from which all spots can shine: at one time, in a span of time, or ever.
#[derive(Debug)]
pub(in crate::transport) struct SpotTree {
    pub(super) tree: Tree,
    pub(super) parts: Vec<SpotPart>,
}

/// Trees for spans of the time of emission, one after the other and as long each; made when they
/// are first needed. With slow light a ray passes spots at many times, but each place at one.
#[derive(Debug)]
pub(in crate::transport) struct SpotSpans {
    /// Length of a span in M.
    length: f64,
    trees: RwLock<BTreeMap<i64, Arc<SpotTree>>>,
}

/// Number of spots from which on spans are worth their making.
const MANY_SPOTS: usize = 32;

/// Parts of all trees of spans together, about.
const MOST_SPAN_PARTS: f64 = 1_048_576.0;

/// Most trees that are kept.
const MOST_SPANS: usize = 192;

/// Delays that usually differ within a picture, in M.
const USUAL_DELAYS: f64 = 96.0;

impl SpotSpans {
    /// Spans for spots, if they are so many that these are worth it: in one of them a typical spot
    /// moves by a few times its own size.
    pub fn new(spots: &[SpotModel]) -> Option<Self> {
        if spots.len() < MANY_SPOTS {
            return None;
        }
        let own = |spot: &SpotModel| CUT_OFF * spot.sigma() / spot.speed();
        let mut own: Vec<f64> = spots.iter().map(own).collect();
        own.sort_by(f64::total_cmp);
        // With two parts a spot in each, the spans of the usual delays have MOST_SPAN_PARTS.
        let least = USUAL_DELAYS * 2.0 * spots.len() as f64 / MOST_SPAN_PARTS;
        let length =
            (OWN_SIZES * own[own.len() / 2]).clamp(least.max(0.25), LONGEST_SPAN.max(least));
        length.is_finite().then(|| SpotSpans { length, trees: RwLock::default() })
    }

    /// The number of the span that holds a time.
    pub(super) fn number(&self, time: f64) -> i64 {
        (time / self.length).floor() as i64
    }

    /// The tree of a span.
    pub(super) fn tree(&self, spots: &[SpotModel], hole: &Kerr, number: i64) -> Arc<SpotTree> {
        // Nothing that holds the lock can panic halfway through a change.
        let trees = self.trees.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(tree) = trees.get(&number) {
            return tree.clone();
        }
        drop(trees);
        let mut trees = self.trees.write().unwrap_or_else(PoisonError::into_inner);
        // Another thread may have made it between the two locks.
        if trees.len() >= MOST_SPANS && !trees.contains_key(&number) {
            // Time goes on.
            trees.pop_first();
        }
        let start = number as f64 * self.length;
        let span = [start, start + self.length];
        let make = || Arc::new(SpotTree::new(spots, hole, Some(span), span[1]));
        trees.entry(number).or_insert_with(make).clone()
    }
}

/// Distance that a spot moves within a span, in its own half-sizes.
const OWN_SIZES: f64 = 4.0;

/// Longest span in M.
const LONGEST_SPAN: f64 = 16.0;

/// Parts of all spots together, about as many as can be held at once.
const MOST_PARTS: f64 = 262_144.0;

/// Parts of one turn of a spot.
const PARTS_OF_A_TURN: f64 = 64.0;

impl SpotTree {
    /// The spots' places between two times, or all that they ever have, cut up as for `time`.
    pub fn new(spots: &[SpotModel], hole: &Kerr, when: Option<[f64; 2]>, time: f64) -> Self {
        let most = (MOST_PARTS / spots.len().max(1) as f64).clamp(8.0, PARTS_OF_A_TURN);
        let mut parts = Vec::new();
        for (number, spot) in spots.iter().enumerate() {
            spot.parts(number as u32, hole.horizon(), when, time, most, &mut parts);
        }
        let boxes: Vec<_> = parts.iter().map(|p| spots[p.spot as usize].bounds(p)).collect();
        let shells = || spots.iter().map(SpotModel::shell);
        let low = shells().map(|[low, _]| low).fold(f64::INFINITY, f64::min).max(hole.horizon());
        let high = shells().map(|[_, high]| high).fold(0.0, f64::max);
        SpotTree { tree: Tree::new(&boxes, [low, high]), parts }
    }

    /// Returns whether a ray can meet any spot at all.
    pub fn can_be_met(&self, ray: &Ray) -> bool {
        self.tree.can_be_met(ray)
    }
}
