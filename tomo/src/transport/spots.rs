//! Light of the hot spots.

use super::chord::ChordBound;
use super::glimpse::{Gather, Place};
use super::polarized::share;
use super::tree::{Node, Tree, Walk, WalkScratch};
use super::volume::DepthProfile;
use super::{Scratch, Stage};
use crate::emission::spot::{CUT_OFF, Comoving, SpotModel};
use crate::emission::spot_parts::SpotPart;
use kerrlight_geodesic::flow::rotating_redshift;
use kerrlight_geodesic::quadrature::gauss_4;
use kerrlight_geodesic::{Kerr, Path, PathPoint, Ray, ScreenPoint};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Arc, PoisonError, RwLock};

/// Where all spots can shine from: at one time, in a span of time, or ever.
#[derive(Debug)]
pub(super) struct SpotTree {
    tree: Tree,
    parts: Vec<SpotPart>,
}

/// Trees for spans of the time of emission, one after the other and as long each; made when they
/// are first asked for. With slow light a ray passes spots at many times, but each place at one.
#[derive(Debug)]
pub(super) struct SpotSpans {
    /// Length of a span in M.
    length: f64,
    trees: RwLock<BTreeMap<i64, Arc<SpotTree>>>,
}

/// From so many spots on spans are worth their making.
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
        let least = USUAL_DELAYS * 2.0 * spots.len() as f64 / MOST_SPAN_PARTS;
        let length =
            (OWN_SIZES * own[own.len() / 2]).clamp(least.max(0.25), LONGEST_SPAN.max(least));
        length.is_finite().then(|| SpotSpans { length, trees: RwLock::default() })
    }

    /// The number of the span that holds a time.
    fn number(&self, time: f64) -> i64 {
        (time / self.length).floor() as i64
    }

    /// The tree of a span.
    fn tree(&self, spots: &[SpotModel], hole: &Kerr, number: i64) -> Arc<SpotTree> {
        // Nothing that holds the lock can panic halfway through a change.
        let trees = self.trees.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(tree) = trees.get(&number) {
            return tree.clone();
        }
        drop(trees);
        let mut trees = self.trees.write().unwrap_or_else(PoisonError::into_inner);
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

/// By how many times its own half-size a spot moves within a span.
const OWN_SIZES: f64 = 4.0;

/// Longest span in M.
const LONGEST_SPAN: f64 = 16.0;

/// Parts of all spots together, about as many as can be held at once.
const MOST_PARTS: f64 = 262_144.0;

/// Parts of one turn of a spot.
const PARTS_OF_A_TURN: f64 = 64.0;

/// Light that one spot may send along a piece of path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Met {
    spot: u32,
    piece: [f64; 2],
}

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

    /// Whether a ray can meet any spot at all.
    pub fn can_be_met(&self, ray: &Ray) -> bool {
        self.tree.can_be_met(ray)
    }
}

impl Stage {
    /// Light of the spots between the observer and Mino time `end`: ∫ g^{2+α} j Σ dτ. Spots are
    /// summed in their order and piece by piece as [`add_every_spot`](Self::add_every_spot) does,
    /// less the pieces on which the tree shows that a spot does not shine: the same to the last bit.
    pub(super) fn add_spots(
        &self,
        time: f64,
        tree: &SpotTree,
        (ray, screen): (&Ray, Option<ScreenPoint>),
        scratch: &mut Scratch,
        end: f64,
        gather: &mut Gather,
    ) {
        if !tree.can_be_met(ray) {
            return;
        }
        self.meet_spots(time, tree, ray, scratch, end);
        let Scratch { path, intervals, met, pieces, volume, .. } = scratch;
        let along = AlongRay { lambda: ray.lambda, screen, depths: &volume.profile };
        for same in met.chunk_by(|a, b| a.spot == b.spot) {
            join(same, pieces);
            let spot = &self.spots[same[0].spot as usize];
            self.add_spot(SpotLight::new(spot, time, pieces, along), path, intervals, end, gather);
        }
    }

    /// Fills `scratch.met`, by spots and along the ray.
    fn meet_spots(&self, time: f64, tree: &SpotTree, ray: &Ray, scratch: &mut Scratch, end: f64) {
        let Scratch { path, walk, met, intervals, .. } = scratch;
        let bound = ChordBound::new(&self.hole, ray, path, self.tracer.tolerance());
        let meeting = Meeting { stage: self, time, path, bound };
        let [low, high] = tree.tree.shell();
        path.intervals_within(low, high, intervals);
        met.clear();
        for &[from, to] in intervals.iter() {
            let to = to.min(end);
            if from >= to {
                continue;
            }
            let ends = [&Node::at(path, from), &Node::at(path, to)];
            match self.spot_spans.as_deref() {
                Some(spans) => meeting.by_spans((spans, tree), ends, 0, (walk, met)),
                None => meeting.through(tree, ends, walk, met),
            }
        }
        met.sort_by(|a, b| a.spot.cmp(&b.spot).then(a.piece[0].total_cmp(&b.piece[0])));
    }

    /// As [`add_spots`](Self::add_spots), with every spot asked along the whole ray.
    pub(super) fn add_every_spot(
        &self,
        time: f64,
        (ray, screen): (&Ray, Option<ScreenPoint>),
        scratch: &mut Scratch,
        end: f64,
        gather: &mut Gather,
    ) {
        let Scratch { path, intervals, volume, .. } = scratch;
        let along = AlongRay { lambda: ray.lambda, screen, depths: &volume.profile };
        for spot in &self.spots {
            let light = SpotLight::new(spot, time, &[[0.0, f64::INFINITY]], along);
            self.add_spot(light, path, intervals, end, gather);
        }
    }

    /// Light of one spot on the pieces of the path where it may shine.
    fn add_spot(
        &self,
        mut light: SpotLight<'_>,
        path: &Path,
        intervals: &mut Vec<[f64; 2]>,
        end: f64,
        gather: &mut Gather,
    ) {
        let [lo, hi] = light.spot.shell();
        let before = gather.intensity;
        path.intervals_within(lo.max(self.hole.horizon()), hi, intervals);
        for &[from, to] in intervals.iter() {
            let to = to.min(end);
            if from < to {
                self.add_stretch(path, &mut light, from, to, gather);
            }
        }
        if let Some((_, point)) = light.brightest {
            gather.mark(gather.intensity - before, Place::of_point(&point));
        }
    }

    /// A stretch of the path inside the spot's shell, cut so that no piece turns by much.
    fn add_stretch(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        from: f64,
        to: f64,
        gather: &mut Gather,
    ) {
        let pieces = ((to - from) * path.angular_rate() / LARGEST_TURN).ceil().max(1.0);
        let step = (to - from) / pieces;
        let mut last = None;
        for k in 0..pieces as usize {
            let [start, end] = [k, k + 1].map(|k| from + step * k as f64);
            if !light.can_shine(start, end) {
                last = None;
                continue;
            }
            let start = last.unwrap_or_else(|| self.node(light, path.at(start)));
            let end = self.node(light, path.at(end));
            self.add_piece(path, light, [&start, &end], 0, gather);
            last = Some(end);
        }
    }

    fn node(&self, light: &SpotLight<'_>, point: PathPoint) -> SpotNode {
        let (position, time) = (point.cartesian(), self.emission_time(light.observed, &point));
        SpotNode { point, position, time, carried: light.spot.comoving(position, time) }
    }

    /// Halves a piece until it is short against the spot or lies outside of it, then sums.
    fn add_piece(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        [start, end]: [&SpotNode; 2],
        depth: u32,
        gather: &mut Gather,
    ) {
        let (from, to) = (start.point.mino_time, end.point.mino_time);
        if !light.can_shine(from, to) {
            return;
        }
        let carried = [&start.carried, &end.carried];
        let length = light.spot.comoving_length([start.position, end.position], carried);
        if light.spot.is_missed(carried, length) {
            return;
        }
        if length > light.spot.sigma() && depth < DEEPEST {
            let middle = self.node(light, path.at(0.5 * (from + to)));
            self.add_piece(path, light, [start, &middle], depth + 1, gather);
            self.add_piece(path, light, [&middle, end], depth + 1, gather);
            return;
        }
        for (mino_time, weight) in gauss_4(from, to) {
            self.add_node(&self.node(light, path.at(mino_time)), weight, light, gather);
        }
    }

    /// One node of the quadrature.
    fn add_node(
        &self,
        node: &SpotNode,
        weight: f64,
        light: &mut SpotLight<'_>,
        gather: &mut Gather,
    ) {
        let emissivity = light.spot.emissivity(&node.carried, node.time);
        if emissivity <= 0.0 {
            return;
        }
        let point = &node.point;
        let r = point.radius();
        let g = match self.redshift {
            Some(_) => rotating_redshift(&self.hole, point, light.spot.angular_velocity(r)),
            None => Some(1.0),
        };
        // Where matter cannot move like this there is none.
        let Some(g) = g else { return };
        let mut boost = self.redshift.map_or(1.0, |index| g.powf(2.0 + index));
        let path_length = self.hole.sigma(r, point.cos_theta()) * weight;
        let AlongRay { lambda, screen, depths } = &light.along;
        // Gas in front of it.
        let depth = depths.at(point.mino_time);
        if depth > 0.0 {
            boost *= (-depth).exp();
        }
        if let Some(screen) = screen {
            let omega = light.spot.angular_velocity(r);
            let stokes = self.polarized_spot(point, *lambda, omega, screen);
            boost *= stokes.i;
            gather.add_stokes(boost * emissivity * path_length, share(&stokes));
        }
        gather.add(boost * emissivity * path_length, g, light.spot.color);
        let density = boost * emissivity;
        if light.brightest.is_none_or(|(most, _)| density > most) {
            light.brightest = Some((density, *point));
        }
    }
}

/// A ray on its way through the trees, seen at one time.
struct Meeting<'a> {
    stage: &'a Stage,
    time: f64,
    path: &'a Path,
    bound: ChordBound,
}

impl Meeting<'_> {
    /// The first and the last time at which light that is seen passed a piece.
    fn times(&self, ends: [&Node; 2]) -> [f64; 2] {
        let [early, late] =
            [ends[1], ends[0]].map(|node| self.stage.emission_time(self.time, &node.point));
        let error = self.bound.error(self.bound.reach(ends.map(|node| &node.point)));
        [early - error, late + error]
    }

    /// Adds what a piece of the path meets in a tree.
    fn through(
        &self,
        tree: &SpotTree,
        ends: [&Node; 2],
        walk: &mut WalkScratch,
        met: &mut Vec<Met>,
    ) {
        let slow = self.stage.slow_light;
        // With slow light short pieces tell much about the time.
        let longest = if slow { 2.0 } else { 8.0 };
        let shines = |leaf: u32, ends: [&Node; 2], epsilon: f64| {
            let part = &tree.parts[leaf as usize];
            let spot = &self.stage.spots[part.spot as usize];
            let when = if slow { self.times(ends) } else { [self.time; 2] };
            (!slow || spot.shines_from(part, when))
                && spot.comes_near(ends.map(|node| node.position), epsilon, when)
        };
        let through = Walk { tree: &tree.tree, path: self.path, bound: &self.bound, longest };
        through.between(ends, walk, &shines, &mut |ends, leaves| {
            let piece = ends.map(|node| node.point.mino_time);
            let spot = |leaf: &u32| tree.parts[*leaf as usize].spot;
            met.extend(leaves.iter().map(|leaf| Met { spot: spot(leaf), piece }));
            ControlFlow::Continue(())
        });
    }

    /// The same in trees for spans of time: halves a piece until its light is of two of them at
    /// most, or else asks the tree of all times.
    fn by_spans(
        &self,
        (spans, ever): (&SpotSpans, &SpotTree),
        [start, end]: [&Node; 2],
        depth: u32,
        (walk, met): (&mut WalkScratch, &mut Vec<Met>),
    ) {
        let [first, last] = self.times([start, end]).map(|time| spans.number(time));
        if last.saturating_sub(first) <= 1 {
            for number in first..=last {
                let tree = spans.tree(&self.stage.spots, &self.stage.hole, number);
                self.through(&tree, [start, end], walk, met);
            }
            return;
        }
        if depth >= DEEPEST {
            return self.through(ever, [start, end], walk, met);
        }
        let middle = 0.5 * (start.point.mino_time + end.point.mino_time);
        let middle = Node::at(self.path, middle);
        self.by_spans((spans, ever), [start, &middle], depth + 1, (walk, met));
        self.by_spans((spans, ever), [&middle, end], depth + 1, (walk, met));
    }
}

/// Pieces that one spot was met on, one after the other and apart from each other.
fn join(met: &[Met], pieces: &mut Vec<[f64; 2]>) {
    pieces.clear();
    for Met { piece: [from, to], .. } in met {
        match pieces.last_mut() {
            Some(last) if *from <= last[1] => last[1] = last[1].max(*to),
            _ => pieces.push([*from, *to]),
        }
    }
}

/// What is known of the ray that spots are seen along.
#[derive(Clone, Copy)]
struct AlongRay<'a> {
    lambda: f64,
    /// Its place on the screen, if light is polarised.
    screen: Option<ScreenPoint>,
    /// Optical depth of the gas.
    depths: &'a DepthProfile,
}

/// One spot's light along one ray.
struct SpotLight<'a> {
    spot: &'a SpotModel,
    /// Time of observation.
    observed: f64,
    /// Where it may shine, as intervals of Mino time in order.
    pieces: &'a [[f64; 2]],
    along: AlongRay<'a>,
    /// The brightest point, and its emission per length.
    brightest: Option<(f64, PathPoint)>,
}

impl<'a> SpotLight<'a> {
    fn new(
        spot: &'a SpotModel,
        observed: f64,
        pieces: &'a [[f64; 2]],
        along: AlongRay<'a>,
    ) -> Self {
        SpotLight { spot, observed, pieces, along, brightest: None }
    }

    fn can_shine(&self, from: f64, to: f64) -> bool {
        let behind = self.pieces.partition_point(|piece| piece[1] < from);
        self.pieces.get(behind).is_some_and(|piece| piece[0] <= to)
    }
}

/// A point of the path as a spot sees it.
struct SpotNode {
    point: PathPoint,
    position: [f64; 3],
    /// When the light that is seen passed here.
    time: f64,
    carried: Comoving,
}

/// Largest angle in radians by which a piece of path may turn before it is compared with
/// a spot.
const LARGEST_TURN: f64 = 0.5;

/// A piece is halved at most this often.
const DEEPEST: u32 = 24;
