//! Penalties on a field of emission beside its data: on its values at the nodes of a probe grid, so that they are
//! the same for every representation. Off by default.

use super::Field;
use super::linear::Prior;
use super::regulariser::Shape;
use super::sightlines::Region;
use crate::representation::{Gradient, Workspace};
use kerrlight_common::simd::Float;
use kerrlight_render::points::Coordinates;

/// Where a field is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// A regular grid of that many nodes along each axis of the cube that holds the region, moved as a whole by a part of
    /// the distance of its nodes that is drawn at each step. Nodes inside the region count.
    Moved {
        /// Along each axis, 2 or more.
        nodes: usize,
    },
    /// A regular grid over that cube, both ends included, all of its nodes: those of a grid of voxels.
    Fixed {
        /// Along each axis, 2 or more.
        nodes: usize,
    },
}

/// What a step draws for a probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw<T> {
    /// By which parts of the distance of nodes the probe is moved, 0 to 1.
    pub offset: [f64; 3],
    /// Time at which a field of events is evaluated, since the reference time.
    pub time: T,
}

/// Penalties and the probe that they look through.
#[derive(Clone, Debug, PartialEq)]
pub struct Penalties {
    /// Which, with their weights.
    pub priors: Vec<Prior>,
    /// Where.
    pub probe: Probe,
    /// Where emission is looked for.
    pub region: Region,
}

/// Buffers that are kept from one step to the next.
#[derive(Default)]
pub struct ProbeBuffers<T> {
    inside: Vec<bool>,
    columns: [Vec<T>; 3],
    time: Vec<T>,
    compact: Vec<T>,
    values: Vec<T>,
    slopes: Vec<T>,
}

impl Probe {
    fn nodes(self) -> usize {
        let (Self::Moved { nodes } | Self::Fixed { nodes }) = self;
        nodes
    }

    /// Distance of nodes in a cube of this half-width.
    fn spacing(self, half: f64) -> f64 {
        match self {
            Self::Moved { nodes } => 2.0 * half / nodes as f64,
            Self::Fixed { nodes } => 2.0 * half / (nodes - 1) as f64,
        }
    }
}

impl Penalties {
    /// Names of the penalties, in the order of their values.
    pub fn names(&self) -> Vec<&'static str> {
        self.priors.iter().map(|prior| prior.regulariser.name()).collect()
    }

    /// Collects the nodes that count.
    fn place<T: Float>(&self, draw: &Draw<T>, buffers: &mut ProbeBuffers<T>) {
        let (n, half) = (self.probe.nodes(), self.region.r_max);
        let (spacing, moved) = match self.probe {
            Probe::Moved { .. } => (self.probe.spacing(half), draw.offset),
            Probe::Fixed { .. } => (self.probe.spacing(half), [0.0; 3]),
        };
        let at = |c: usize, k: usize| (k as f64 + moved[c]) * spacing - half;
        buffers.inside.clear();
        buffers.columns.iter_mut().for_each(Vec::clear);
        for k in 0..n.pow(3) {
            let x = [at(0, k / (n * n)), at(1, k / n % n), at(2, k % n)];
            let counts = matches!(self.probe, Probe::Fixed { .. }) || self.region.holds(x);
            buffers.inside.push(counts);
            if counts {
                buffers.columns.iter_mut().zip(x).for_each(|(column, x)| column.push(T::of(x)));
            }
        }
        buffers.time.clear();
        buffers.time.resize(buffers.columns[0].len(), draw.time);
    }

    /// Weight · penalty of each; adds the gradient with respect to the parameters.
    pub fn value_and_gradient<T: Float>(
        &self,
        field: Field<'_, T>,
        draw: &Draw<T>,
        gradient: &mut [T],
        buffers: &mut ProbeBuffers<T>,
        workspace: &mut Workspace,
    ) -> Vec<f64> {
        self.place(draw, buffers);
        let ProbeBuffers { inside, columns: [x, y, z], time, compact, values, slopes } = buffers;
        let at = match field.representation.dimension() {
            4 => Coordinates::txyz(time, x, y, z),
            _ => Coordinates::xyz(x, y, z),
        };
        compact.clear();
        compact.resize(x.len(), T::zero());
        field.representation.eval(field.parameters, at, compact, workspace);
        for column in [&mut *values, slopes] {
            column.clear();
            column.resize(inside.len(), T::zero());
        }
        let counted = |k: &usize| inside[*k];
        let nodes = || (0..inside.len()).filter(counted);
        nodes().zip(&*compact).for_each(|(k, value)| values[k] = *value);
        let spacing = self.probe.spacing(self.region.r_max);
        let shape = Shape { nodes: [self.probe.nodes(); 3], spacing: [spacing; 3] };
        let of = |prior: &Prior| {
            let Prior { regulariser, weight } = prior;
            regulariser.value_and_gradient_inside(values, shape, Some(inside), *weight, slopes)
        };
        let found = self.priors.iter().map(of).collect();
        nodes().zip(&mut *compact).for_each(|(k, cotangent)| *cotangent = slopes[k]);
        let into = Gradient { parameters: gradient, coordinates: None };
        field.representation.vjp(field.parameters, at, compact, into, workspace);
        found
    }
}
