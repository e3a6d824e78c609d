//! Weights of the nodes of a frame's rays in a grid of voxels.

use crate::Error;
use crate::fit::ForwardModel;
use crate::fit::loss::regulariser::Shape;
use crate::representation::spline::{Degree, Spline};
use crate::representation::{Allowed, Knots, Representation, Workspace};
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::{Axis, Turned, pull_back};
use kerrlight_render::points::{Coordinates, CoordinatesMut};

/// A grid of voxels, z fastest, zero outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxels {
    /// Nodes along x, y and z, at least two of each.
    pub nodes: [usize; 3],
    /// Coordinates of the first node, M.
    pub low: [f64; 3],
    /// Coordinates of the last node, M.
    pub high: [f64; 3],
    /// Degree of the interpolation between nodes.
    pub degree: Degree,
}

impl Voxels {
    /// A cube about the hole that reaches `half_width` (M) to each side.
    pub fn cube(nodes: usize, half_width: f64, degree: Degree) -> Self {
        let reach = half_width * degree.reach(nodes);
        Self { nodes: [nodes; 3], low: [-reach; 3], high: [reach; 3], degree }
    }

    /// The same as a representation, whose parameters are the numbers of the nodes.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn field(&self) -> Result<Spline, Error> {
        let Self { nodes, low, high, degree } = *self;
        Spline::new(nodes, low, high, degree)
    }

    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Returns the shape that penalties see.
    pub fn shape(&self) -> Shape {
        // Fewer than two nodes are refused by `field`; until then nothing is divided by 0.
        let spacing = |k: usize| (self.high[k] - self.low[k]) / (self.nodes[k].max(2) - 1) as f64;
        Shape { nodes: self.nodes, spacing: [0, 1, 2].map(spacing) }
    }

    /// Coordinates of a node, M.
    pub fn position(&self, node: usize) -> [f64; 3] {
        let [_, ny, nz] = self.nodes;
        let at = [node / (ny * nz), node / nz % ny, node % nz];
        let spacing = self.shape().spacing;
        core::array::from_fn(|k| self.low[k] + spacing[k] * at[k] as f64)
    }

    /// Returns the offsets from the first node of a cell to all that a point in it takes from, z fastest.
    pub(super) fn corners(&self) -> Vec<usize> {
        let ([_, ny, nz], taps) = (self.nodes, self.degree.taps());
        let node = |k: usize| (k / (taps * taps) * ny + k / taps % taps) * nz + k % taps;
        (0..taps.pow(3)).map(node).collect()
    }
}

/// Values at the nodes of another grid.
///
/// # Errors
/// If a grid has no nodes.
pub fn refined(from: &Voxels, x: &[f64], to: &Voxels) -> Result<Vec<f64>, Error> {
    if from == to {
        return Ok(x.to_vec());
    }
    let nodes: Vec<[f64; 3]> = (0..to.count()).map(|k| to.position(k)).collect();
    let column = |c: usize| {
        // Nodes of the edge lie beyond the field, in the dark: they take the value at its border.
        let margin = from.degree.margin() * from.shape().spacing[c];
        let (low, high) = (from.low[c] + margin, from.high[c] - margin);
        let clamp = |at: &[f64; 3]| at[c].clamp(low, high);
        nodes.iter().map(clamp).collect::<Vec<f64>>()
    };
    let (a, b, c) = (column(0), column(1), column(2));
    // Values of the field stand for factors of the other B-splines, which they are where it is
    // linear.
    let mut values = vec![0.0; nodes.len()];
    from.field()?.eval(x, Coordinates::xyz(&a, &b, &c), &mut values, &mut Workspace::new());
    Ok(values)
}

/// A ray's node in its cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<T> {
    /// First node of the cell; those of the second knot come after those of the first.
    pub corner: u32,
    /// Position in the cell, 0 to 1 along each axis.
    pub within: [T; 3],
    /// Weight of the value there in the pixel.
    pub weight: T,
}

#[derive(Clone, Copy)]
struct Geometry<T> {
    /// Begin of the first cell.
    low: [T; 3],
    per_length: [T; 3],
    /// Cells along each axis.
    cells: [T; 3],
    last: [usize; 3],
    nodes: [usize; 3],
}

impl<T: Float> Geometry<T> {
    fn new(voxels: &Voxels) -> Self {
        let (spacing, margin) = (voxels.shape().spacing, voxels.degree.margin());
        let last = voxels.nodes.map(|n| n - voxels.degree.taps());
        Self {
            low: [0, 1, 2].map(|k| T::of(voxels.low[k] + margin * spacing[k])),
            per_length: [0, 1, 2].map(|k| {
                let cells = (voxels.nodes[k] - 1) as f64;
                T::of(cells / (voxels.high[k] - voxels.low[k]))
            }),
            cells: last.map(|last| T::of((last + 1) as f64)),
            last,
            nodes: voxels.nodes,
        }
    }

    #[inline(always)]
    fn locate(&self, point: [T; 3]) -> Option<(usize, [T; 3])> {
        let (mut corner, mut within) = (0, [T::zero(); 3]);
        for k in 0..3 {
            let u = (point[k] - self.low[k]) * self.per_length[k];
            // Written so that a coordinate that is not a number lies outside.
            if !(u >= T::zero() && u <= self.cells[k]) {
                return None;
            }
            // The far face belongs to the last cell.
            let cell = u.to_u32().map_or(0, |cell| cell as usize).min(self.last[k]);
            within[k] = u - T::of(cell as f64);
            corner = corner * self.nodes[k] + cell;
        }
        Some((corner, within))
    }
}

/// Rays of a frame as they meet the grid.
pub(super) struct Walk<'a, T> {
    pub model: &'a ForwardModel<T>,
    pub voxels: Voxels,
    pub knots: Knots,
    axis: Axis,
    geometry: Geometry<T>,
    /// Least and largest delay of a node.
    delays: [T; 2],
}

/// Memory of a thread.
#[derive(Default)]
pub(super) struct Buffers<T> {
    angles: Vec<T>,
    pulled: [Vec<T>; 3],
    stretched: [Vec<T>; 3],
    places: Vec<Place<T>>,
    /// Indices of these nodes, where there are several images, and the same with their weights in one of
    /// them.
    nodes: Vec<u32>,
    of_plane: Vec<Place<T>>,
}

/// Nodes that are pulled back at a time: they stay in the first caches.
const BLOCK: usize = 4096;

impl<'a, T: Float> Walk<'a, T> {
    /// Takes rays with the weights that they have for the axis.
    pub fn new(model: &'a ForwardModel<T>, axis: Axis, voxels: Voxels, knots: Knots) -> Self {
        let delays = &model.delay;
        let bound = |of: fn(T, T) -> T| delays.iter().copied().reduce(of).unwrap_or(T::zero());
        let delays = [bound(T::min), bound(T::max)];
        Self { model, axis, voxels, knots, geometry: Geometry::new(&voxels), delays }
    }

    /// Hands over the pixel of every ray with those of its nodes that shine and lie in cells that are
    /// wanted (all, without a mask), ray after ray: once for each knot that has a share in the frame.
    pub fn frame(
        &self,
        frame: usize,
        wanted: Option<&[bool]>,
        buffers: &mut Buffers<T>,
        mut ray: impl FnMut(u32, &[Place<T>]),
    ) {
        let nodes = self.voxels.count();
        for knot in 0..self.knots.count {
            let wanted = wanted.map(|wanted| &wanted[knot * nodes..(knot + 1) * nodes]);
            if self.takes_part(knot, frame) && wanted.is_none_or(|wanted| wanted.contains(&true)) {
                self.knot(frame, knot, wanted, buffers, &mut ray);
            }
        }
    }

    /// Returns whether a knot has a share in the light of a frame.
    fn takes_part(&self, knot: usize, frame: usize) -> bool {
        let Knots { first, spacing, count, allowed } = self.knots;
        if count == 1 {
            return true;
        }
        let of_knot = first + knot as f64 * spacing;
        // The light of a frame left over a span of times, one for each node, which the hat or ramp
        // of the knot has to meet.
        let [earliest, latest] =
            [1, 0].map(|k| (self.model.times[frame] - self.delays[k]).double());
        // Before the first knot and after the last one emission stays as it is there.
        let begun = knot == 0 || latest > of_knot - spacing;
        let over = allowed == Allowed::Any && knot + 1 < count && earliest > of_knot + spacing;
        begun && !over
    }

    fn knot(
        &self,
        frame: usize,
        knot: usize,
        wanted: Option<&[bool]>,
        buffers: &mut Buffers<T>,
        ray: &mut impl FnMut(u32, &[Place<T>]),
    ) {
        // A field of births says where matter is at the time of its knot, other fields where it is
        // at the reference time.
        let label = T::of(self.knots.label_time(knot));
        let starts = &self.model.starts;
        let mut first = 0;
        while first < self.model.rays() {
            // Whole rays, as many as fit into a block; a longer one is a block of its own.
            let after = starts.partition_point(|start| *start <= starts[first] + BLOCK) - 1;
            let next = after.max(first + 1);
            self.pull(starts[first]..starts[next], self.model.times[frame] - label, buffers);
            for k in first..next {
                let range = starts[k]..starts[k + 1];
                self.places(range, starts[first], frame, knot, wanted, buffers);
                if !buffers.places.is_empty() {
                    self.hand_over(self.model.pixel[k], buffers, ray);
                }
            }
            first = next;
        }
    }

    /// A ray's nodes to its pixel, or to those of all images.
    fn hand_over(
        &self,
        pixel: u32,
        buffers: &mut Buffers<T>,
        ray: &mut impl FnMut(u32, &[Place<T>]),
    ) {
        let Buffers { places, nodes, of_plane, .. } = buffers;
        let Some(planes) = &self.model.planes else { return ray(pixel, places) };
        for plane in 0..planes.count {
            let weighed = |(place, node): (&Place<T>, &u32)| Place {
                weight: place.weight * planes.of(*node)[plane],
                ..*place
            };
            of_plane.clear();
            of_plane.extend(places.iter().zip(nodes.iter()).map(weighed));
            ray(pixel + (plane * planes.stride) as u32, of_plane);
        }
    }

    fn pull(&self, range: core::ops::Range<usize>, time: T, buffers: &mut Buffers<T>) {
        if self.model.fall.is_some() {
            return self.carry(range, time, buffers);
        }
        let Buffers { angles, pulled, .. } = buffers;
        angles.clear();
        let rates = &self.model.rate[range.clone()];
        if self.model.delay.is_empty() {
            angles.extend(rates.iter().map(|rate| *rate * time));
        } else {
            // −Ω (t − delay): `rate` is −Ω, `phase` is Ω · delay.
            let phases = rates.iter().zip(&self.model.phase[range.clone()]);
            angles.extend(phases.map(|(rate, phase)| *rate * time + *phase));
        }
        pulled.iter_mut().for_each(|column| column.resize(range.len(), T::zero()));
        let [x, y, z] = &self.model.position;
        let points = Coordinates::xyz(&x[range.clone()], &y[range.clone()], &z[range.clone()]);
        let [a, b, c] = pulled;
        pull_back(self.axis, Turned { points, angles }, CoordinatesMut::xyz(a, b, c));
    }

    /// The same of matter that changes its radius.
    fn carry(&self, range: core::ops::Range<usize>, time: T, buffers: &mut Buffers<T>) {
        let (model, Some(fall)) = (self.model, &self.model.fall) else { return };
        let Buffers { angles, pulled, stretched, .. } = buffers;
        angles.clear();
        pulled.iter_mut().for_each(|column| column.resize(range.len(), T::zero()));
        stretched.iter_mut().for_each(Vec::clear);
        for node in range {
            let delay = model.delay.get(node).copied().unwrap_or(T::zero());
            let [stretch, angle] = fall.before(node, (time - delay).double());
            angles.push(T::of(angle));
            for (column, position) in stretched.iter_mut().zip(&model.position) {
                column.push(T::of(stretch * position[node].double()));
            }
        }
        let ([x, y, z], [a, b, c]) = (&*stretched, pulled);
        let turned = Turned { points: Coordinates::xyz(x, y, z), angles };
        pull_back(self.axis, turned, CoordinatesMut::xyz(a, b, c));
    }

    #[inline(always)]
    fn places(
        &self,
        range: core::ops::Range<usize>,
        first: usize,
        frame: usize,
        knot: usize,
        wanted: Option<&[bool]>,
        buffers: &mut Buffers<T>,
    ) {
        let nodes_before = (knot * self.voxels.count()) as u32;
        buffers.places.clear();
        buffers.nodes.clear();
        for node in range {
            let [x, y, z] = &buffers.pulled;
            let k = node - first;
            let Some((corner, within)) = self.geometry.locate([x[k], y[k], z[k]]) else {
                continue;
            };
            if wanted.is_some_and(|mask| !mask[corner]) {
                continue;
            }
            let delay = self.model.delay.get(node).copied().unwrap_or(T::zero());
            let time = self.model.times[frame] - delay;
            let share = self.knots.share(knot, time).0;
            if share > T::zero() && self.model.earliest.is_none_or(|earliest| time >= earliest) {
                let weight = share * self.model.weight[node];
                let corner = nodes_before + corner as u32;
                buffers.places.push(Place { corner, within, weight });
                if self.model.planes.is_some() {
                    buffers.nodes.push(node as u32);
                }
            }
        }
    }
}
