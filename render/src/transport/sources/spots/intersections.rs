//! Intersections of rays with spots.

use super::light::SpotRay;
use super::trees::{SpotSpans, SpotTree};
use super::{DEEPEST, SpotScratch, Spots};
use crate::transport::chord::ChordBound;
use crate::transport::tree::{Node, Walk, WalkScratch};
use kerrlight_geodesic::{Path, PathOfRay};
use std::ops::ControlFlow;

/// Light that one spot may send along a piece of path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Intersections {
    pub spot: u32,
    piece: [f64; 2],
}

impl Spots {
    /// Fills `scratch.met`, by spots and along the ray.
    pub(super) fn meet(
        &self,
        time: f64,
        tree: &SpotTree,
        seen: &SpotRay<'_>,
        scratch: &mut SpotScratch,
    ) {
        let SpotScratch { walk, met, intervals, .. } = scratch;
        let (optics, PathOfRay { ray, path, tolerance }) = (seen.optics, seen.along);
        let bound = ChordBound::new(&optics.hole, ray, path, tolerance);
        let intersections = Meeting { spots: self, seen, time, path, bound };
        let [low, high] = tree.tree.shell();
        path.intervals_within(low, high, intervals);
        met.clear();
        for &[from, to] in intervals.iter() {
            let to = to.min(seen.end);
            if from >= to {
                continue;
            }
            let ends = [&Node::at(path, from), &Node::at(path, to)];
            match self.spans.as_deref() {
                Some(spans) => intersections.by_spans(spans, tree, ends, 0, walk, met),
                None => intersections.through(tree, ends, walk, met),
            }
        }
        met.sort_by(|a, b| a.spot.cmp(&b.spot).then(a.piece[0].total_cmp(&b.piece[0])));
    }
}

/// A ray on its way through the trees, seen at one time.
struct Meeting<'a> {
    spots: &'a Spots,
    seen: &'a SpotRay<'a>,
    time: f64,
    path: &'a Path,
    bound: ChordBound,
}

impl Meeting<'_> {
    /// The first and the last time at which light that is seen passed a piece.
    fn times(&self, ends: [&Node; 2]) -> [f64; 2] {
        let [early, late] =
            [ends[1], ends[0]].map(|node| self.seen.optics.emission_time(self.time, &node.point));
        // Delays are taken to be as uncertain as positions.
        let error = self.bound.error(self.bound.reach(ends.map(|node| &node.point)));
        [early - error, late + error]
    }

    /// Adds what a piece of the path meets in a tree.
    fn through(
        &self,
        tree: &SpotTree,
        ends: [&Node; 2],
        walk: &mut WalkScratch,
        met: &mut Vec<Intersections>,
    ) {
        let slow = self.seen.optics.slow_light;
        // With slow light short pieces tell much about the time.
        let longest = if slow { 2.0 } else { 8.0 };
        let shines = |leaf: u32, ends: [&Node; 2], epsilon: f64| {
            let part = &tree.parts[leaf as usize];
            let spot = &self.spots.models[part.spot as usize];
            let when = if slow { self.times(ends) } else { [self.time; 2] };
            // Without slow light the tree is of this very time.
            (!slow || spot.shines_from(part, when))
                && spot.comes_near(ends.map(|node| node.position), epsilon, when)
        };
        let through = Walk { tree: &tree.tree, path: self.path, bound: &self.bound, longest };
        through.between(ends, walk, &shines, &mut |ends, leaves| {
            let piece = ends.map(|node| node.point.mino_time);
            let spot = |leaf: &u32| tree.parts[*leaf as usize].spot;
            met.extend(leaves.iter().map(|leaf| Intersections { spot: spot(leaf), piece }));
            ControlFlow::Continue(())
        });
    }

    /// The same in trees for spans of time: halves a piece until its light is of two of them at
    /// most, or else asks the tree of all times.
    fn by_spans(
        &self,
        spans: &SpotSpans,
        ever: &SpotTree,
        [start, end]: [&Node; 2],
        depth: u32,
        walk: &mut WalkScratch,
        met: &mut Vec<Intersections>,
    ) {
        let [first, last] = self.times([start, end]).map(|time| spans.number(time));
        if last.saturating_sub(first) <= 1 {
            for number in first..=last {
                let tree = spans.tree(&self.spots.models, &self.seen.optics.hole, number);
                self.through(&tree, [start, end], walk, met);
            }
            return;
        }
        if depth >= DEEPEST {
            return self.through(ever, [start, end], walk, met);
        }
        let middle = 0.5 * (start.point.mino_time + end.point.mino_time);
        let middle = Node::at(self.path, middle);
        self.by_spans(spans, ever, [start, &middle], depth + 1, walk, met);
        self.by_spans(spans, ever, [&middle, end], depth + 1, walk, met);
    }
}

/// Pieces that one spot was met on, one after the other and apart from each other.
pub(super) fn join(met: &[Intersections], pieces: &mut Vec<[f64; 2]>) {
    pieces.clear();
    for Intersections { piece: [from, to], .. } in met {
        match pieces.last_mut() {
            Some(last) if *from <= last[1] => last[1] = last[1].max(*to),
            _ => pieces.push([*from, *to]),
        }
    }
}
