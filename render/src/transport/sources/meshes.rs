//! Triangle meshes: where a curved ray meets them, and their light.

use crate::Error;
use crate::emission::mesh::{MeshFile, MeshModel, Triangle};
use crate::scene::Scene;
use crate::transport::chord::ChordBound;
use crate::transport::layers::Origin;
use crate::transport::optics::Optics;
use crate::transport::result::{Accumulator, Place};
use crate::transport::sources::media::DepthProfile;
use crate::transport::tree::{Node, Tree, Walk, WalkScratch};
use kerrlight_geodesic::vector::distance;
use kerrlight_geodesic::{Kerr, Path, PathOfRay, Ray};
use std::ops::ControlFlow;

/// Scratch space of meshes, from ray to ray.
#[derive(Debug, Default)]
pub(in crate::transport) struct MeshScratch {
    walk: WalkScratch,
    /// Triangles that the last ray meets.
    hits: Vec<Hit>,
}

/// All meshes of a scene in one hierarchy.
#[derive(Debug)]
pub(in crate::transport) struct Meshes {
    meshes: Vec<MeshModel>,
    tree: Tree,
    /// Mesh and triangle of each leaf.
    leaves: Vec<[u32; 2]>,
}

/// Intersection of a ray with a triangle.
#[derive(Debug, Clone, Copy)]
struct Hit {
    /// Mino time.
    mino_time: f64,
    leaf: u32,
}

impl Meshes {
    /// The meshes of a scene with their files, if it has any.
    pub fn new(scene: &Scene, files: &[MeshFile], hole: &Kerr) -> Result<Option<Self>, Error> {
        if files.len() != scene.mesh.len() {
            let (value, allowed) = (files.len() as f64, "one file for each [[mesh]]");
            return Err(Error::out_of_range("number of mesh files", value, allowed));
        }
        if files.is_empty() {
            return Ok(None);
        }
        let placed = scene.mesh.iter().zip(files).map(|(mesh, file)| MeshModel::new(mesh, file));
        Ok(Some(Self::of(placed.collect::<Result<_, _>>()?, hole)))
    }

    fn of(meshes: Vec<MeshModel>, hole: &Kerr) -> Self {
        let leaves: Vec<[u32; 2]> = (0u32..)
            .zip(&meshes)
            .flat_map(|(m, mesh)| (0..mesh.triangles.len() as u32).map(move |t| [m, t]))
            .collect();
        let triangles = || meshes.iter().flat_map(|mesh| &mesh.triangles);
        let boxes: Vec<_> = triangles().map(Triangle::bounds).collect();
        let nearest = |[low, high]: &[[f64; 3]; 2]| {
            distance(core::array::from_fn(|k| 0f64.clamp(low[k], high[k])), [0.0; 3])
        };
        let low = boxes.iter().map(nearest).fold(f64::INFINITY, f64::min).max(hole.horizon());
        let corners = triangles().flat_map(|triangle| triangle.corners);
        let high = corners.map(|x| distance(x, [0.0; 3])).fold(0.0, f64::max);
        // A little more, so that a corner is never left out by rounding.
        Meshes {
            tree: Tree::new(&boxes, [low * (1.0 - 1e-9), high * (1.0 + 1e-9)]),
            meshes,
            leaves,
        }
    }

    fn at(&self, leaf: u32) -> (&MeshModel, &Triangle) {
        let [mesh, triangle] = self.leaves[leaf as usize];
        let mesh = &self.meshes[mesh as usize];
        (mesh, &mesh.triangles[triangle as usize])
    }

    /// Fills `hits` with where the path meets triangles, in order, up to the first that hides
    /// the rest, and returns the Mino time of that.
    fn meet_by_tree(
        &self,
        path: &Path,
        bound: &ChordBound,
        scratch: &mut WalkScratch,
        hits: &mut Vec<Hit>,
    ) -> Option<f64> {
        let walk = Walk { tree: &self.tree, path, bound, longest: 8.0 };
        let mut end = None;
        walk.go(f64::INFINITY, scratch, &|_, _, _| true, &mut |ends, leaves| {
            let first = hits.len();
            for leaf in leaves {
                let cut = Cut { path, bound, triangle: self.at(*leaf).1, leaf: *leaf };
                cut.piece(ends, 0, hits);
            }
            hits[first..].sort_by(|a, b| a.mino_time.total_cmp(&b.mino_time));
            let hides = |hit: &Hit| self.at(hit.leaf).0.opaque;
            let Some(last) = hits[first..].iter().position(hides) else {
                return ControlFlow::Continue(());
            };
            hits.truncate(first + last + 1);
            end = hits.last().map(|hit| hit.mino_time);
            ControlFlow::Break(())
        });
        end
    }

    /// The same without the hierarchy: pieces that turn by little are held against every triangle.
    fn meet_every(&self, path: &Path, bound: &ChordBound, hits: &mut Vec<Hit>) -> Option<f64> {
        let [low, high] = self.tree.shell();
        let mut intervals = Vec::new();
        path.intervals_within(low, high, &mut intervals);
        for [from, to] in intervals {
            let pieces = ((to - from) * path.angular_rate() / 0.1).ceil().max(1.0);
            let at = |k: f64| Node::at(path, from + (to - from) * k / pieces);
            for k in 0..pieces as u32 {
                let ends = [at(f64::from(k)), at(f64::from(k + 1))];
                for leaf in 0..self.leaves.len() as u32 {
                    let cut = Cut { path, bound, triangle: self.at(leaf).1, leaf };
                    cut.piece([&ends[0], &ends[1]], 0, hits);
                }
            }
        }
        hits.sort_by(|a, b| a.mino_time.total_cmp(&b.mino_time));
        let last = hits.iter().position(|hit| self.at(hit.leaf).0.opaque)?;
        hits.truncate(last + 1);
        hits.last().map(|hit| hit.mino_time)
    }

    /// Returns whether the path of a ray is needed.
    pub fn need_path(&self, optics: &Optics, ray: &Ray) -> bool {
        optics.one_by_one || self.tree.can_be_met(ray)
    }

    /// Finds where a ray meets triangles; the Mino time of the first that hides the rest.
    pub fn meet(
        &self,
        optics: &Optics,
        PathOfRay { ray, path, tolerance }: PathOfRay<'_>,
        MeshScratch { walk, hits }: &mut MeshScratch,
    ) -> Option<f64> {
        hits.clear();
        let bound = ChordBound::new(&optics.hole, ray, path, tolerance);
        if optics.one_by_one {
            return self.meet_every(path, &bound, hits);
        }
        if self.tree.can_be_met(ray) { self.meet_by_tree(path, &bound, walk, hits) } else { None }
    }

    /// Adds the light of the triangles met up to Mino time `end` behind gas of optical depth D: I = g^{3+α} I_em e^{−D}.
    pub fn add(
        &self,
        optics: &Optics,
        (path, end): (&Path, f64),
        scratch: &MeshScratch,
        depths: &DepthProfile,
        light: &mut Accumulator,
    ) {
        for hit in scratch.hits.iter().take_while(|hit| hit.mino_time <= end) {
            let (mesh, triangle) = self.at(hit.leaf);
            let source = self.source(optics, hit);
            if !mesh.shines() {
                continue;
            }
            let point = path.at(hit.mino_time);
            let (emitted, color) = mesh.light(triangle, point.cartesian());
            let g = match optics.spectral_index {
                Some(_) => mesh.redshift(&optics.hole, &point),
                None => Some(1.0),
            };
            // Where matter cannot move like this there is none that shines.
            let Some(g) = g else { continue };
            let boost = optics.spectral_index.map_or(1.0, |index| g.powf(3.0 + index));
            let intensity = emitted * boost * (-depths.at(hit.mino_time)).exp();
            light.add(intensity, g, color, hit.mino_time);
            let origin = Origin { source, mino_time: hit.mino_time };
            light.mark(intensity, Place::of_point(&point), origin);
        }
    }

    /// The mesh that ends the last ray at a Mino time, if one does.
    pub fn hidden_by(&self, optics: &Optics, scratch: &MeshScratch, time: f64) -> Option<u32> {
        let hit = scratch.hits.iter().find(|hit| hit.mino_time == time)?;
        Some(self.source(optics, hit))
    }

    fn source(&self, optics: &Optics, hit: &Hit) -> u32 {
        optics.numbering.meshes + self.leaves[hit.leaf as usize][0]
    }
}

/// A curved piece of path against one triangle.
struct Cut<'a> {
    path: &'a Path,
    bound: &'a ChordBound,
    triangle: &'a Triangle,
    leaf: u32,
}

/// A piece is halved at most this often (next to the horizon, where it never gets straight).
const DEEPEST: u32 = 40;

/// Pieces that are this close to straight, in units of their radius, are not halved any further: a
/// ray that stays closer to a plane than that, with both ends on one side, does not meet it.
const GRAZING: f64 = 1e-7;

/// Largest distance of an intersection from its triangle's plane, in units of its radius.
const ON_PLANE: f64 = 1e-11;

impl Cut<'_> {
    /// Adds the intersections with a piece: its height above the plane is within the sagitta of
    /// linear, so that it has no root where both ends are farther than that on one side, and just
    /// one where it changes sign and by more than four times that (the slope of the height
    /// is within 4 sagittas per piece of the chord's).
    fn piece(&self, [start, end]: [&Node; 2], depth: u32, hits: &mut Vec<Hit>) {
        let sagitta = self.bound.sagitta([&start.point, &end.point]);
        let (from, to) = (self.triangle.height(start.position), self.triangle.height(end.position));
        // 0 counts as above: a root at the end of a piece is found once, not twice.
        let changes = (from >= 0.0) != (to >= 0.0);
        if !changes && from.abs().min(to.abs()) > sagitta {
            return;
        }
        let once = (to - from).abs() > 4.0 * sagitta;
        let straight = sagitta <= GRAZING * self.bound.reach([&start.point, &end.point]);
        if changes && (once || straight || depth >= DEEPEST) {
            return self.root([start, end], [from, to], sagitta, hits);
        }
        if straight || depth >= DEEPEST {
            return;
        }
        let middle = Node::at(self.path, 0.5 * (start.point.mino_time + end.point.mino_time));
        self.piece([start, &middle], depth + 1, hits);
        self.piece([&middle, end], depth + 1, hits);
    }

    /// The one root on a piece, if it lies inside the triangle.
    fn root(
        &self,
        [start, end]: [&Node; 2],
        [from, to]: [f64; 2],
        sagitta: f64,
        hits: &mut Vec<Hit>,
    ) {
        // Where the chord meets the plane the ray is not farther than this.
        let steep = distance(start.position, end.position) / (to - from).abs();
        let part = from / (from - to);
        let guess: [f64; 3] = core::array::from_fn(|k| {
            start.position[k] + part * (end.position[k] - start.position[k])
        });
        if !self.triangle.holds(guess, sagitta * (1.0 + steep)) {
            return;
        }
        let node = self.refine([start.point.mino_time, end.point.mino_time], [from, to]);
        if self.triangle.holds(node.position, 0.0) {
            hits.push(Hit { mino_time: node.point.mino_time, leaf: self.leaf });
        }
    }

    /// False position with the Illinois rule, on the ray itself.
    fn refine(&self, [mut a, mut b]: [f64; 2], [mut from, mut to]: [f64; 2]) -> Node {
        let mut node = Node::at(self.path, a);
        for _ in 0..100 {
            let time = if to == from { 0.5 * (a + b) } else { (a * to - b * from) / (to - from) };
            // The last two points need not be in order, and rounding may lead out of them.
            let inside = time > a.min(b) && time < a.max(b);
            node = Node::at(self.path, if inside { time } else { 0.5 * (a + b) });
            let height = self.triangle.height(node.position);
            let near = height.abs() <= ON_PLANE / node.point.inverse_radius;
            if near || (b - a).abs() <= f64::EPSILON * b.abs() {
                break;
            }
            if (height >= 0.0) == (to >= 0.0) {
                from *= 0.5;
            } else {
                (a, from) = (b, to);
            }
            (b, to) = (node.point.mino_time, height);
        }
        node
    }
}
