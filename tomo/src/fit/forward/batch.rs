//! Nodes of some rays in some frames, pulled back to the reference time.

use super::fall::Fall;
use super::forward_model::{Field, ForwardModel};
use super::occupancy::Occupancy;
use crate::representation::Representation;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::{Axis, Turned, pull_back};
use kerrlight_render::points::{Coordinates, CoordinatesMut};
use rayon::prelude::*;

/// Points of matter that falls, which one thread carries at a time.
const SHARE: usize = 2048;

/// Columns of a batch's points.
#[derive(Clone, Debug, Default)]
pub struct Columns<T> {
    /// Place where the light was emitted; of matter that changes its radius, stretched to the one that it had at the
    /// reference time.
    pub position: [Vec<T>; 3],
    /// When, since the reference time.
    pub time: Vec<T>,
    /// Angles to the reference time.
    pub angle: Vec<T>,
    /// Weight of emission in its pixel.
    pub weight: Vec<T>,
    /// Place of the matter at the reference time.
    pub pulled: [Vec<T>; 3],
    /// Index of each node in the forward model.
    pub node: Vec<u32>,
}

/// (ray, frame) pairs and their nodes, pair after pair. Memory is kept from one batch to the next.
#[derive(Clone, Debug, Default)]
pub struct Batch<T> {
    /// Ray and frame.
    pub pairs: Vec<(u32, u32)>,
    /// Pair k has the nodes `starts[k]..starts[k + 1]`.
    pub starts: Vec<usize>,
    /// The nodes.
    pub columns: Columns<T>,
    /// Buffer for the emission of each node.
    pub values: Vec<T>,
    kept: Vec<bool>,
}

impl<T: Float> Columns<T> {
    fn all(&mut self) -> [&mut Vec<T>; 9] {
        let [x, y, z] = &mut self.position;
        let [a, b, c] = &mut self.pulled;
        [x, y, z, &mut self.time, &mut self.angle, &mut self.weight, a, b, c]
    }

    fn clear(&mut self) {
        self.all().into_iter().for_each(Vec::clear);
        self.node.clear();
    }

    /// Moves node `from` to place `to`.
    fn keep(&mut self, from: usize, to: usize) {
        self.all().into_iter().for_each(|column| column[to] = column[from]);
        self.node[to] = self.node[from];
    }

    fn truncate(&mut self, length: usize) {
        self.all().into_iter().for_each(|column| column.truncate(length));
        self.node.truncate(length);
    }

    /// Stretches positions to the radii that matter had at the reference time, and sets the angles.
    fn carry(&mut self, fall: &Fall) {
        let [x, y, z] = &mut self.position;
        let to = (x.par_iter_mut(), y.par_iter_mut(), z.par_iter_mut(), self.angle.par_iter_mut());
        let from = self.node.par_iter().zip(&self.time);
        to.into_par_iter().zip(from).with_min_len(SHARE).for_each(
            |((x, y, z, angle), (node, time))| {
                let [stretch, turn] = fall.before(*node as usize, time.double());
                // Copies of the batch: the model's own positions stay.
                for x in [x, y, z] {
                    *x = T::of(x.double() * stretch);
                }
                *angle = T::of(turn);
            },
        );
    }

    fn pull_back(&mut self, axis: Axis) {
        let length = self.weight.len();
        self.pulled.iter_mut().for_each(|column| column.resize(length, T::zero()));
        let [x, y, z] = &self.position;
        let [a, b, c] = &mut self.pulled;
        let turned = Turned { points: Coordinates::xyz(x, y, z), angles: &self.angle };
        pull_back(axis, turned, CoordinatesMut::xyz(a, b, c));
    }
}

impl<T: Float> Batch<T> {
    /// The pairs of the batch.
    pub fn set(&mut self, pairs: impl Iterator<Item = (u32, u32)>) {
        self.pairs.clear();
        self.pairs.extend(pairs);
    }

    /// Number of nodes.
    pub fn points(&self) -> usize {
        self.columns.weight.len()
    }

    /// Collects the nodes of the pairs and pulls them back; leaves out those that do not shine yet or
    /// come to lie where nothing does.
    pub fn gather(&mut self, model: &ForwardModel<T>, axis: Axis, occupancy: Option<&Occupancy>) {
        self.collect(model, axis, model.fall.as_ref(), occupancy);
    }

    /// The same with every node of the pairs; where the matter was outside of the region, its place is no number.
    pub fn gather_whole(&mut self, model: &ForwardModel<T>, axis: Axis) {
        self.fill(model);
        if let Some(fall) = &model.fall {
            self.columns.carry(fall);
        }
        self.columns.pull_back(axis);
    }

    /// The same for a field. One of events is not carried along, and sees where light was emitted.
    pub fn gather_field(&mut self, model: &ForwardModel<T>, field: Field<'_, T>) {
        let carried = field.representation.is_carried();
        let fall = model.fall.as_ref().filter(|_| carried);
        self.collect(model, field.axis, fall, field.occupancy);
    }

    /// The same of places and times of emission; nothing is carried along.
    pub fn gather_events(&mut self, model: &ForwardModel<T>) {
        self.fill(model);
        if model.earliest.is_some() {
            // `thin_out` moves all columns together: none may be shorter.
            self.columns.pulled.clone_from(&self.columns.position);
            self.thin_out(model.earliest, None, false);
        }
    }

    /// Collects the nodes of the pairs.
    fn fill(&mut self, model: &ForwardModel<T>) {
        self.columns.clear();
        self.starts.clear();
        self.starts.push(0);
        for &(ray, frame) in &self.pairs {
            let range = model.starts[ray as usize]..model.starts[ray as usize + 1];
            self.columns.push(model, range, model.times[frame as usize]);
            self.starts.push(self.columns.weight.len());
        }
    }

    fn collect(
        &mut self,
        model: &ForwardModel<T>,
        axis: Axis,
        fall: Option<&Fall>,
        occupancy: Option<&Occupancy>,
    ) {
        self.fill(model);
        if let Some(fall) = fall {
            self.columns.carry(fall);
        }
        self.columns.pull_back(axis);
        if occupancy.is_some() || model.earliest.is_some() || fall.is_some() {
            self.thin_out(model.earliest, occupancy, fall.is_some());
        }
    }

    fn thin_out(&mut self, earliest: Option<T>, occupancy: Option<&Occupancy>, falls: bool) {
        let columns = &mut self.columns;
        self.kept.clear();
        let [x, y, z] = &columns.pulled;
        self.kept.extend((0..x.len()).map(|k| {
            earliest.is_none_or(|earliest| columns.time[k] >= earliest)
                // Matter from outside of the region has no place (`Fall::before`).
                && (!falls || x[k].is_finite())
                && occupancy
                    .is_none_or(|mask| mask.holds([x[k].double(), y[k].double(), z[k].double()]))
        }));
        let (mut to, mut from) = (0, 0);
        // A ray that loses all of its nodes keeps an empty range: pairs and starts stay aligned.
        for end in &mut self.starts[1..] {
            while from < *end {
                if self.kept[from] {
                    columns.keep(from, to);
                    to += 1;
                }
                from += 1;
            }
            *end = to;
        }
        columns.truncate(to);
    }

    /// Returns the coordinates of a representation: points pulled back, or events.
    pub fn coordinates<'a>(
        columns: &'a Columns<T>,
        representation: &dyn Representation<T>,
    ) -> Coordinates<'a, T> {
        let carried = representation.is_carried();
        let [x, y, z] = if carried { &columns.pulled } else { &columns.position };
        Coordinates::of(representation.dimension(), &columns.time, [x, y, z])
    }
}

impl<T: Float> Columns<T> {
    fn push(&mut self, model: &ForwardModel<T>, range: core::ops::Range<usize>, time: T) {
        for (to, from) in self.position.iter_mut().zip(&model.position) {
            to.extend_from_slice(&from[range.clone()]);
        }
        self.weight.extend_from_slice(&model.weight[range.clone()]);
        self.node.extend(range.clone().map(|node| node as u32));
        let rates = &model.rate[range.clone()];
        if model.delay.is_empty() {
            self.time.resize(self.weight.len(), time);
            self.angle.extend(rates.iter().map(|rate| *rate * time));
        } else {
            self.time.extend(model.delay[range.clone()].iter().map(|delay| time - *delay));
            // −Ω (time − delay): back from where the matter was when its light left.
            let phases = rates.iter().zip(&model.phase[range]);
            self.angle.extend(phases.map(|(rate, phase)| *rate * time + *phase));
        }
    }
}
