//! Boxes around everything that shines or hides in one place, and the walk of a curved ray
//! through them. The hierarchy is built by `obvhs`; its boxes are those of points r n.

use super::chord::ChordBound;
use glam::Vec3A;
use kerrlight_geodesic::vector::distance;
use kerrlight_geodesic::{Path, PathPoint, Ray};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use std::ops::ControlFlow;

/// An axis-aligned box: its least and its largest corner.
pub type Bounds = [[f64; 3]; 2];

/// A hierarchy of boxes, each a leaf with the number of what it holds.
#[derive(Clone)]
pub struct Tree {
    hierarchy: Bvh2,
    /// Longest edge of each leaf's box, and the median of them.
    sizes: Vec<f64>,
    typical: f64,
    shell: [f64; 2],
    /// Largest effect of rounding to 32 bits on a distance.
    rounding: f32,
}

impl std::fmt::Debug for Tree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tree")
            .field("leaves", &self.sizes.len())
            .field("shell", &self.shell)
            .finish()
    }
}

/// Rounding of 32-bit arithmetic in the test of a chord against a box, relative to the largest
/// coordinate: some units of 2⁻²⁴ (6e-8).
const ROUNDING: f64 = 1e-6;

impl Tree {
    /// The hierarchy of `boxes`, all of them within the radii `shell` about the origin.
    pub fn new(boxes: &[Bounds], shell: [f64; 2]) -> Self {
        let outward = |[low, high]: &Bounds| {
            // Outward, so that no box loses anything to 32 bits.
            let low = low.map(|x| (x as f32).next_down());
            let high = high.map(|x| (x as f32).next_up());
            Aabb::new(Vec3A::from(low), Vec3A::from(high))
        };
        let boxes_32: Vec<Aabb> = boxes.iter().map(outward).collect();
        let edge = |[low, high]: &Bounds| (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let sizes: Vec<f64> = boxes.iter().map(edge).collect();
        let far = boxes.iter().flatten().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
        let hierarchy = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes_32, BvhBuildParams::fast_build(), &mut Default::default())
        };
        let rounding = (2.0 * ROUNDING * far) as f32;
        let mut sorted = sizes.clone();
        sorted.sort_by(f64::total_cmp);
        let typical = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        Tree { hierarchy, sizes, typical, shell, rounding }
    }

    /// Returns whether a ray can come near any leaf at all: whether it enters the shell of radii that holds them. Needs neither
    /// a path nor a position.
    pub fn can_be_met(&self, ray: &Ray) -> bool {
        !self.sizes.is_empty() && enters(ray, self.shell[1])
    }

    /// The radii between which all leaves lie.
    pub fn shell(&self) -> [f64; 2] {
        self.shell
    }

    /// Tells `found` every leaf whose box is within `epsilon` of the chord, until it returns false.
    fn near(&self, [a, b]: [[f64; 3]; 2], epsilon: f64, mut found: impl FnMut(u32) -> bool) {
        let single = |x: [f64; 3]| Vec3A::from(x.map(|x| x as f32));
        let (a, b) = (single(a), single(b));
        let chord = Chord {
            middle: 0.5 * (a + b),
            half: 0.5 * (b - a),
            wide: Vec3A::splat((epsilon as f32).next_up() + self.rounding),
        };
        self.descend(|aabb| chord.touches(aabb), &mut found);
    }

    /// Tells `found` every leaf whose box meets the cube of half-edge `reach` about the origin,
    /// until it returns false.
    fn inside(&self, reach: f64, mut found: impl FnMut(u32) -> bool) {
        let reach = Vec3A::splat((reach as f32).next_up() + self.rounding);
        let cube = Aabb::new(-reach, reach);
        self.descend(|aabb| aabb.intersect_aabb(&cube), &mut found);
    }

    fn descend(&self, touches: impl Fn(&Aabb) -> bool, found: &mut impl FnMut(u32) -> bool) {
        let nodes = &self.hierarchy.nodes;
        // Deeper trees than this do not come out of the builder; if one did, nothing is lost.
        let (mut stack, mut rest) = ([0u32; 64], Vec::new());
        let mut height = usize::from(!nodes.is_empty());
        while height > 0 || !rest.is_empty() {
            let index = if let Some(index) = rest.pop() {
                index
            } else {
                height -= 1;
                stack[height]
            };
            let node = &nodes[index as usize];
            if !touches(node.aabb()) {
                continue;
            }
            if node.is_leaf() {
                let range =
                    node.first_index as usize..(node.first_index + node.prim_count) as usize;
                if !self.hierarchy.primitive_indices[range].iter().all(|leaf| found(*leaf)) {
                    return;
                }
                continue;
            }
            for child in [node.first_index + 1, node.first_index] {
                match stack.get_mut(height) {
                    Some(place) => {
                        *place = child;
                        height += 1;
                    }
                    None => rest.push(child),
                }
            }
        }
    }
}

/// Returns whether a ray comes within a radius; `true` if that is not known.
pub fn enters(ray: &Ray, radius: f64) -> bool {
    let outermost = 1.0 / radius;
    if ray.inverse_radius >= outermost || !ray.inward {
        return true;
    }
    // W falls from 1 to its least value at the barrier: if that is below 0, the ray turns
    // where W vanishes.
    let barrier = ray.potential.barrier.filter(|barrier| barrier.height < 0.0);
    // W is known to rounding: in doubt the ray enters.
    barrier.is_none_or(|barrier| barrier.w >= outermost && ray.potential.value(outermost) > -1e-9)
}

/// A segment that is `wide` on all sides.
struct Chord {
    middle: Vec3A,
    half: Vec3A,
    wide: Vec3A,
}

impl Chord {
    /// Separating axes: the three of the box and their cross products with the segment. It errs
    /// on the side of touching.
    #[inline(always)]
    fn touches(&self, aabb: &Aabb) -> bool {
        let extent = 0.5 * (aabb.max - aabb.min) + self.wide;
        let offset = self.middle - 0.5 * (aabb.min + aabb.max);
        let half = self.half.abs();
        if offset.abs().cmpgt(extent + half).any() {
            return false;
        }
        let swept = offset.cross(self.half).abs();
        let (e, h) = (extent, half);
        let reach = Vec3A::new(e.y * h.z + e.z * h.y, e.z * h.x + e.x * h.z, e.x * h.y + e.y * h.x);
        !swept.cmpgt(reach).any()
    }
}

/// A point of a path with its position.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// The point.
    pub point: PathPoint,
    /// r n.
    pub position: [f64; 3],
}

impl Node {
    /// The path's point at a Mino time.
    pub fn at(path: &Path, mino_time: f64) -> Self {
        let point = path.at(mino_time);
        Node { point, position: point.cartesian() }
    }
}

/// A piece is halved at most this often.
const DEEPEST: u32 = 40;

/// A piece is tested against boxes once it stays within this part of its length, and taken as it is
/// once it stays within this part of the smallest box it met.
const FINE: f64 = 0.25;

/// A long piece that comes near more leaves than this is halved before they are tested.
const MANY: usize = 32;

/// Leaves that are taken as they are where a chord says nothing; more are held against its parts.
const FEW: usize = 8;

/// The walk of one ray through a tree.
pub struct Walk<'a> {
    /// The tree.
    pub tree: &'a Tree,
    /// The ray's path.
    pub path: &'a Path,
    /// Largest distance from its chords.
    pub bound: &'a ChordBound,
    /// Pieces are halved until they are at most this many times as long as the smallest box.
    pub longest: f64,
}

/// Memory of walks.
#[derive(Debug, Default)]
pub struct WalkScratch {
    intervals: Vec<[f64; 2]>,
    leaves: Vec<u32>,
    near: Vec<u32>,
}

impl Walk<'_> {
    /// Tells `visit` of every piece of the path up to Mino time `end` that comes near leaves that
    /// `keep` keeps (it is told how far the piece can be from its chord), and of these leaves, in the order of Mino time, until `visit` breaks off.
    pub fn go(
        &self,
        end: f64,
        scratch: &mut WalkScratch,
        keep: &impl Fn(u32, [&Node; 2], f64) -> bool,
        visit: &mut impl FnMut([&Node; 2], &[u32]) -> ControlFlow<()>,
    ) {
        let mut intervals = std::mem::take(&mut scratch.intervals);
        let [low, high] = self.tree.shell;
        self.path.intervals_within(low, high, &mut intervals);
        for &[from, to] in &intervals {
            let to = to.min(end);
            if from >= to {
                continue;
            }
            let ends = [&Node::at(self.path, from), &Node::at(self.path, to)];
            if self.piece(ends, 0, scratch, keep, visit).is_break() {
                break;
            }
        }
        scratch.intervals = intervals;
    }

    /// The same for the piece of the path between two points.
    pub fn between(
        &self,
        ends: [&Node; 2],
        scratch: &mut WalkScratch,
        keep: &impl Fn(u32, [&Node; 2], f64) -> bool,
        visit: &mut impl FnMut([&Node; 2], &[u32]) -> ControlFlow<()>,
    ) {
        // Broken off or not, it is at its end.
        let _ = self.piece(ends, 0, scratch, keep, visit);
    }

    fn piece(
        &self,
        [start, end]: [&Node; 2],
        depth: u32,
        scratch: &mut WalkScratch,
        keep: &impl Fn(u32, [&Node; 2], f64) -> bool,
        visit: &mut impl FnMut([&Node; 2], &[u32]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let points = [&start.point, &end.point];
        // The tracer's error, which halving does not lessen, counts for the boxes only.
        let sagitta = self.bound.sagitta(points);
        let length = distance(start.position, end.position);
        let last = depth >= DEEPEST || self.bound.winds(points);
        if last || sagitta <= FINE * length {
            let short =
                |size: f64| last || (sagitta <= FINE * size && length <= self.longest * size);
            let most = if short(self.tree.typical) { usize::MAX } else { MANY };
            if self.collect([start, end], most, scratch, keep) {
                let size = self.smallest(&scratch.leaves);
                let Some(size) = size else { return ControlFlow::Continue(()) };
                if short(size) {
                    return visit([start, end], &scratch.leaves);
                }
            }
        }
        let middle = Node::at(self.path, 0.5 * (start.point.mino_time + end.point.mino_time));
        self.piece([start, &middle], depth + 1, scratch, keep, visit)?;
        self.piece([&middle, end], depth + 1, scratch, keep, visit)
    }

    /// The leaves that the piece may meet; false if it gave up because they are too many.
    fn collect(
        &self,
        ends: [&Node; 2],
        most: usize,
        scratch: &mut WalkScratch,
        keep: &impl Fn(u32, [&Node; 2], f64) -> bool,
    ) -> bool {
        scratch.leaves.clear();
        let points = ends.map(|node| &node.point);
        let (epsilon, reach) = (self.bound.distance(points), self.bound.reach(points));
        let mut count = 0;
        let found = |leaf| {
            count += 1;
            if count <= most && keep(leaf, ends, epsilon) {
                scratch.leaves.push(leaf);
            }
            count <= most
        };
        // A chord that the ray may leave by as much as its radius says nothing of where it is.
        if epsilon < reach {
            self.tree.near(ends.map(|node| node.position), epsilon, found);
        } else {
            self.tree.inside(reach + self.bound.error(reach), found);
            if scratch.leaves.len() > FEW {
                scratch.near.clear();
                self.gather(ends, 0, &mut scratch.near);
                scratch.near.sort_unstable();
                scratch.leaves.retain(|leaf| scratch.near.binary_search(leaf).is_ok());
            }
        }
        count <= most
    }

    /// The leaves that the parts of a piece may meet whose chord says nothing of the whole: one that ends next to the
    /// horizon is straight where it begins.
    fn gather(&self, [start, end]: [&Node; 2], depth: u32, leaves: &mut Vec<u32>) {
        let points = [&start.point, &end.point];
        let length = distance(start.position, end.position);
        let reach = self.bound.reach(points);
        let found = |leaf| {
            leaves.push(leaf);
            true
        };
        if self.bound.sagitta(points) <= FINE * length {
            let positions = [start.position, end.position];
            return self.tree.near(positions, self.bound.distance(points), found);
        }
        let inner = 1.0 / start.point.inverse_radius.max(end.point.inverse_radius);
        if depth >= DEEPEST || self.bound.winds(points) && reach <= 1.5 * inner {
            return self.tree.inside(reach + self.bound.error(reach), found);
        }
        let middle = Node::at(self.path, 0.5 * (start.point.mino_time + end.point.mino_time));
        self.gather([start, &middle], depth + 1, leaves);
        self.gather([&middle, end], depth + 1, leaves);
    }

    fn smallest(&self, leaves: &[u32]) -> Option<f64> {
        leaves.iter().map(|leaf| self.tree.sizes[*leaf as usize]).reduce(f64::min)
    }
}
