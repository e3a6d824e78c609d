//! Derivatives of images and losses with respect to the world, for any representation.

use super::fall::Falls;
use super::{Number, Tangents};
use crate::fit::batch::Batch;
use crate::fit::{Field, ForwardModel};
use crate::representation::{Gradient, Workspace};
use kerrlight_common::simd::Float;
use kerrlight_geodesic::Scalar;
use kerrlight_render::dynamics::{Axis, Cotangents, Turned, pull_back_vjp};
use kerrlight_render::points::{Coordinates, CoordinatesMut};

/// What a loss changes by where the points of a batch change.
#[derive(Default)]
pub(crate) struct PointCotangents<T> {
    /// With respect to the places where emission is evaluated, and its times.
    pub coordinates: [Vec<T>; 4],
    /// With respect to the weights.
    pub weights: Vec<T>,
    angles: Vec<T>,
    places: [Vec<T>; 3],
}

impl<T: Float> PointCotangents<T> {
    /// From pulled-back points to the points themselves, with their angles held, and to the angles.
    fn pull(&mut self, batch: &Batch<T>, axis: Axis, carried: bool) {
        let count = batch.points();
        let [a, b, c, _] = &self.coordinates;
        self.angles.clear();
        self.angles.resize(count, T::zero());
        if !carried {
            for (place, coordinate) in self.places.iter_mut().zip([a, b, c]) {
                place.clone_from(coordinate);
            }
            return;
        }
        for place in &mut self.places {
            place.clear();
            place.resize(count, T::zero());
        }
        let [x, y, z] = &batch.columns.position;
        let turned = Turned { points: Coordinates::xyz(x, y, z), angles: &batch.columns.angle };
        let [u, v, w] = &mut self.places;
        let wanted = Cotangents {
            angles: Some(&mut self.angles),
            points: Some(CoordinatesMut::xyz(u, v, w)),
        };
        pull_back_vjp(axis, turned, Coordinates::xyz(a, b, c), wanted);
    }

    /// Hands over, pair after pair of the batch, what the loss changes by per unit of each parameter.
    pub fn contract(
        &mut self,
        model: &ForwardModel<T>,
        batch: &Batch<T>,
        (axis, carried): (Axis, bool),
        tangents: &Tangents,
        mut pair: impl FnMut(usize, &[f64]),
    ) {
        self.pull(batch, axis, carried);
        let falls = tangents.falls.as_ref().filter(|_| carried);
        let free = tangents.free.len();
        let mut sums = vec![0.0; free];
        for group in 0..batch.pairs.len() {
            sums.fill(0.0);
            for point in batch.starts[group]..batch.starts[group + 1] {
                match falls {
                    None => self.point(model, batch, point, tangents, &mut sums),
                    Some(falls) => {
                        let falls = (falls, tangents);
                        self.fallen(model, batch, point, falls, &mut sums);
                    }
                }
            }
            pair(group, &sums);
        }
    }

    /// With respect to the time at which emission is evaluated, of fields that have one.
    fn of_time(&self, point: usize) -> f64 {
        self.coordinates[3].get(point).map_or(0.0, |slope| slope.double())
    }

    /// The same as [`Self::point`] of matter that changes its radius.
    fn fallen(
        &self,
        model: &ForwardModel<T>,
        batch: &Batch<T>,
        point: usize,
        (falls, tangents): (&Falls, &Tangents),
        sums: &mut [f64],
    ) {
        let node = batch.columns.node[point] as usize;
        let moves = &tangents.moves[node * sums.len()..(node + 1) * sums.len()];
        let mut elapsed = Number::constant(batch.columns.time[point].double());
        for (parameter, by) in tangents.free.iter().zip(moves) {
            elapsed.slope[parameter.index()] = by.time;
        }
        let [stretch, angle] = falls.before(node, elapsed);
        let of_place = [0, 1, 2].map(|c| self.places[c][point].double());
        let along: f64 = (0..3).map(|c| of_place[c] * model.position[c][node].double()).sum();
        let (of_weight, of_angle) = (self.weights[point].double(), self.angles[point].double());
        let of_time = self.of_time(point);
        for ((sum, by), parameter) in sums.iter_mut().zip(moves).zip(&tangents.free) {
            let [x, y, z] = by.position;
            let moved = of_place[0] * x + of_place[1] * y + of_place[2] * z;
            let k = parameter.index();
            *sum += stretch.value * moved + along * stretch.slope[k];
            *sum += of_angle * angle.slope[k] + of_weight * by.weight + of_time * elapsed.slope[k];
        }
    }

    #[inline(always)]
    fn point(
        &self,
        model: &ForwardModel<T>,
        batch: &Batch<T>,
        point: usize,
        tangents: &Tangents,
        sums: &mut [f64],
    ) {
        let node = batch.columns.node[point] as usize;
        let rate = model.rate[node].double();
        let of_weight = self.weights[point].double();
        let of_angle = self.angles[point].double();
        let of_place = [0, 1, 2].map(|c| self.places[c][point].double());
        let of_rate = of_angle * batch.columns.time[point].double();
        let of_time = of_angle * rate + self.of_time(point);
        let moves = &tangents.moves[node * sums.len()..(node + 1) * sums.len()];
        for (sum, by) in sums.iter_mut().zip(moves) {
            let [x, y, z] = by.position;
            *sum += of_place[0] * x + of_place[1] * y + of_place[2] * z;
            *sum += of_weight * by.weight + of_rate * by.rate + of_time * by.time;
        }
    }
}

/// Derivatives of images.
#[derive(Default)]
pub struct WorldBuffers<T> {
    batch: Batch<T>,
    workspace: Workspace,
    cotangents: PointCotangents<T>,
    parameters: Vec<T>,
    values: Vec<T>,
}

impl<T: Float> ForwardModel<T> {
    /// What the pixels of a frame change by per unit of each parameter of the world: image after image. Costs an
    /// evaluation of the field with its gradient at every node.
    pub fn image_tangents(
        &self,
        field: Field<'_, T>,
        frame: usize,
        tangents: &Tangents,
        buffers: &mut WorldBuffers<T>,
    ) -> Vec<Vec<T>> {
        let WorldBuffers { batch, workspace, cotangents, parameters, values } = buffers;
        batch.set((0..self.rays()).map(|ray| (ray as u32, frame as u32)));
        batch.gather_field(self, field);
        let (count, dimension) = (batch.points(), field.representation.dimension());
        values.resize(count, T::zero());
        let at = Batch::coordinates(&batch.columns, field.representation);
        field.representation.eval(field.parameters, at, values, workspace);
        for column in &mut cotangents.coordinates {
            column.clear();
        }
        for column in &mut cotangents.coordinates[..dimension] {
            column.resize(count, T::zero());
        }
        // Parameters have gradients too, which nobody looks at.
        parameters.resize(field.parameters.len(), T::zero());
        let [x, y, z, t] = &mut cotangents.coordinates;
        let coordinates = match dimension {
            4 => CoordinatesMut::txyz(t, x, y, z),
            _ => CoordinatesMut::xyz(x, y, z),
        };
        let into = Gradient { parameters, coordinates: Some(coordinates) };
        let weights = &batch.columns.weight;
        field.representation.vjp(field.parameters, at, weights, into, workspace);
        cotangents.weights.clone_from(values);
        let mut images = vec![vec![T::zero(); self.pixels()]; tangents.free.len()];
        let pixels = self.pixel();
        let how = (field.axis, field.representation.is_carried());
        cotangents.contract(self, batch, how, tangents, |group, slopes| {
            let pixel = pixels[batch.pairs[group].0 as usize] as usize;
            for (image, slope) in images.iter_mut().zip(slopes) {
                image[pixel] = T::of(*slope);
            }
        });
        images
    }
}
