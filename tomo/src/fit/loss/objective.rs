//! The loss of a field of emission, and its gradient with respect to parameters and axis.

use super::terms::{FrameTerm, ImageTerm};
use crate::fit::forward::batch::Batch;
use crate::fit::forward::forward_model::{Field, ForwardModel};
use crate::representation::{Gradient, Groups, Representation, Workspace};
use core::ops::Range;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::{Cotangents, Turned, pull_back_vjp};
use kerrlight_render::points::{Coordinates, CoordinatesMut};

/// Data of a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// (ray, frame) pairs of images.
    Pixels(Vec<(u32, u32)>),
    /// Whole frames, of all data.
    Frames(Vec<usize>),
}

/// Data with their share in the loss: weight · χ²/(number of data).
pub struct Weighted<D: ?Sized> {
    /// Factor on the mean square of the normalised residuals.
    pub weight: f64,
    /// The data.
    pub term: Box<D>,
}

/// Data of a fit.
pub struct Data<T> {
    /// Images: the only data whose pixels can be taken one by one.
    pub image: Option<Weighted<ImageTerm<T>>>,
    /// All others, which need whole frames.
    pub others: Vec<Weighted<dyn FrameTerm<T>>>,
}

impl<T: Float> Data<T> {
    /// All of them with their weights, the image first.
    pub(in crate::fit) fn terms(&self) -> impl Iterator<Item = (&dyn FrameTerm<T>, f64)> {
        let image = self.image.iter().map(|w| (&*w.term as &dyn FrameTerm<T>, w.weight));
        image.chain(self.others.iter().map(|w| (&*w.term, w.weight)))
    }
}

/// The loss of the data of a step, scaled to that of all data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loss {
    /// Σ weight · χ²/data, and penalties of the representation.
    pub total: f64,
    /// χ² per datum of each kind of data, the image first if there is one.
    pub terms: Vec<f64>,
    /// Cost of change, where a representation has that price.
    pub change: Option<f64>,
    /// Nodes at which emission was evaluated.
    pub points: usize,
}

/// Gradients that are added to.
pub struct Gradients<'a, T> {
    /// Gradient with respect to the parameters.
    pub parameters: &'a mut [T],
    /// Gradient with respect to the axis, along the sphere, if wanted.
    pub axis: Option<&'a mut [f64; 3]>,
}

/// Buffers that are kept from one step to the next.
#[derive(Default)]
pub struct Buffers<T> {
    pub(in crate::fit) batch: Batch<T>,
    pub(in crate::fit) workspace: Workspace,
    image: Vec<T>,
    of_image: Vec<T>,
    cotangents: Vec<T>,
    of_points: [Vec<T>; 4],
    of_weights: Vec<f64>,
}

impl<T> Buffers<T> {
    /// The memory of the representation.
    pub fn workspace(&mut self) -> &mut Workspace {
        &mut self.workspace
    }
}

impl<T: Float> Buffers<T> {
    /// Emission at points (x, y, z) at a time, M since the reference time.
    pub fn emission(
        &mut self,
        representation: &dyn Representation<T>,
        parameters: &[T],
        time: f64,
        points: [&[T]; 3],
    ) -> Vec<T> {
        let times = vec![T::of(time); points[0].len()];
        let mut values = vec![T::zero(); times.len()];
        let at = Coordinates::of(representation.dimension(), &times, points);
        representation.eval(parameters, at, &mut values, &mut self.workspace);
        values
    }
}

/// A forward model with its data.
pub struct Objective<T> {
    /// Model from emission to pixels.
    pub model: ForwardModel<T>,
    /// Data of pixels.
    pub data: Data<T>,
}

impl<T: Float> Objective<T> {
    /// Names of the kinds of data, in the order of [`Loss::terms`].
    pub fn names(&self) -> Vec<&str> {
        self.terms().map(|(term, _)| term.name()).collect()
    }

    /// Frames of which there are any data.
    pub fn observed(&self) -> Vec<usize> {
        let seen =
            |frame: &usize| self.terms().any(|(term, _)| term.degrees_of_freedom(*frame) > 0);
        (0..self.model.frames()).filter(seen).collect()
    }

    pub(in crate::fit) fn terms(&self) -> impl Iterator<Item = (&dyn FrameTerm<T>, f64)> {
        self.data.terms()
    }

    /// Real data of each kind in a typical frame times `frames`: what χ² is divided by.
    pub(in crate::fit) fn data_of(&self, term: &dyn FrameTerm<T>, frames: usize) -> f64 {
        // Frames count by the mean of their data, not by their own: the loss of random frames is
        // then on average that of all data.
        let all: usize = (0..term.frames()).map(|frame| term.degrees_of_freedom(frame)).sum();
        let observed = self.observed().len().max(1);
        (all as f64 / observed as f64 * frames as f64).max(1.0)
    }

    /// The loss of the data of a step; adds its gradient. [`ForwardModel::weigh`] comes first.
    pub fn value_and_gradient(
        &self,
        field: Field<'_, T>,
        drawn: &Drawn,
        mut gradients: Gradients<'_, T>,
        buffers: &mut Buffers<T>,
    ) -> Loss {
        if gradients.axis.is_some() && self.model.is_shifted() {
            buffers.of_weights.clear();
            buffers.of_weights.resize(self.model.points(), 0.0);
        }
        let loss = match drawn {
            Drawn::Pixels(pairs) => self.pixels(field, pairs, &mut gradients, buffers),
            Drawn::Frames(all) => self.frames(field, all, &mut gradients, buffers),
        };
        if let Some(axis) = gradients.axis
            && self.model.is_shifted()
        {
            let slope = self.model.weights_vjp(field.axis, &buffers.of_weights);
            axis.iter_mut().zip(slope).for_each(|(axis, slope)| *axis += slope);
        }
        loss
    }

    fn pixels(
        &self,
        field: Field<'_, T>,
        pairs: &[(u32, u32)],
        gradients: &mut Gradients<'_, T>,
        buffers: &mut Buffers<T>,
    ) -> Loss {
        let Some(Weighted { weight, term }) = &self.data.image else { return Loss::default() };
        assert!(self.model.quiescent.is_none(), "rays do not meet all pixels of a quiescent image");
        // A mean over the pixels of the screen, of which those without a ray are zero for ever.
        let rays = self.model.rays() as f64 / self.model.pixels() as f64;
        let scale = rays * term.inverse_variance().double() / pairs.len() as f64;
        let slope = T::of(2.0 * weight * scale);
        let Buffers { batch, workspace, of_points, of_weights, .. } = buffers;
        batch.set(pairs.iter().copied());
        batch.gather_field(&self.model, field);
        // Both closures below read the batch while values are written.
        let mut values = core::mem::take(&mut batch.values);
        values.resize(batch.points(), T::zero());
        let residual = |group: usize, values: &[T]| {
            let (ray, frame) = batch.pairs[group];
            let weights = &batch.columns.weight[batch.starts[group]..batch.starts[group + 1]];
            let pixel: T = weights.iter().zip(values).map(|(w, e)| *w * *e).sum();
            pixel - term.pixel(frame as usize, self.model.pixel[ray as usize] as usize)
        };
        let link = |groups: Range<usize>, values: &[T], out: &mut [T]| {
            // Groups come in blocks: `values` and `out` begin with the first point of theirs.
            let first = batch.starts[groups.start];
            for group in groups {
                let range = batch.starts[group]..batch.starts[group + 1];
                let here = range.start - first..range.end - first;
                let slope = slope * residual(group, &values[here.clone()]);
                let weights = &batch.columns.weight[range];
                out[here].iter_mut().zip(weights).for_each(|(out, w)| *out = slope * *w);
            }
        };
        let dimension = field.representation.dimension();
        let coordinates = wanted(gradients.axis.is_some(), dimension, batch.points(), of_points);
        let into = Gradient { parameters: gradients.parameters, coordinates };
        let at = Batch::coordinates(&batch.columns, field.representation);
        let groups = Groups { starts: &batch.starts, link: &link };
        field.representation.eval_vjp(field.parameters, at, groups, &mut values, into, workspace);
        let shifted = gradients.axis.is_some() && self.model.is_shifted();
        let mut total = 0.0;
        for (group, ends) in batch.starts.windows(2).enumerate() {
            let range = ends[0]..ends[1];
            let left = residual(group, &values[range.clone()]).double();
            total += left * left;
            // d(loss)/d(weight) of a node is the slope of its pixel times its emission.
            for k in range.filter(|_| shifted) {
                let node = batch.columns.node[k] as usize;
                of_weights[node] += slope.double() * left * values[k].double();
            }
        }
        batch.values = values;
        if let Some(axis) = gradients.axis.as_deref_mut() {
            add_axis(field, batch, of_points, axis);
        }
        let term = scale * total;
        let (total, points) = (weight * term, batch.points());
        Loss { total, terms: vec![term], points, ..Loss::default() }
    }

    fn frames(
        &self,
        field: Field<'_, T>,
        frames: &[usize],
        gradients: &mut Gradients<'_, T>,
        buffers: &mut Buffers<T>,
    ) -> Loss {
        let scales: Vec<f64> =
            self.terms().map(|(term, _)| 1.0 / self.data_of(term, frames.len())).collect();
        let mut loss = Loss { terms: vec![0.0; scales.len()], ..Loss::default() };
        for &frame in frames {
            self.image_of(field, frame, buffers);
            loss.points += buffers.batch.points();
            buffers.of_image.clear();
            buffers.of_image.resize(self.model.pixels(), T::zero());
            for (k, (term, weight)) in self.terms().enumerate() {
                let factor = T::of(weight * scales[k]);
                let value =
                    term.value_and_gradient(frame, &buffers.image, factor, &mut buffers.of_image);
                loss.terms[k] += scales[k] * value;
            }
            // All terms share the image: their slopes add up, and go back through the field once.
            self.back(field, gradients, buffers);
        }
        self.add_terms(&mut loss);
        loss
    }

    /// Makes the loss of its terms.
    pub(in crate::fit) fn add_terms(&self, loss: &mut Loss) {
        let weights = self.terms().map(|(_, weight)| weight);
        loss.total = loss.terms.iter().zip(weights).map(|(term, weight)| term * weight).sum();
    }

    /// One frame into `buffers.image`.
    fn image_of(&self, field: Field<'_, T>, frame: usize, buffers: &mut Buffers<T>) {
        buffers.image.resize(self.model.pixels(), T::zero());
        let Buffers { batch, workspace, image, .. } = buffers;
        self.model.image_recorded(field, frame, batch, workspace, image);
    }

    /// Adds the gradient with respect to the last image to those of the others.
    fn back(
        &self,
        field: Field<'_, T>,
        gradients: &mut Gradients<'_, T>,
        buffers: &mut Buffers<T>,
    ) {
        let Buffers { batch, workspace, of_image, cotangents, of_points, of_weights, .. } = buffers;
        cotangents.resize(batch.points(), T::zero());
        let shifted = gradients.axis.is_some() && self.model.is_shifted();
        for (group, (ray, _)) in batch.pairs.iter().enumerate() {
            let pixel = self.model.pixel[*ray as usize] as usize;
            let range = batch.starts[group]..batch.starts[group + 1];
            // Polarised factors have the redshift of their own law, and a known axis: weights have
            // no slope with respect to it.
            if let Some(planes) = &self.model.planes {
                for k in range {
                    let slope = planes.slope(of_image, pixel, batch.columns.node[k]);
                    cotangents[k] = slope * batch.columns.weight[k];
                }
                continue;
            }
            let slope = of_image[pixel];
            let weights = &batch.columns.weight[range.clone()];
            let into = cotangents[range.clone()].iter_mut();
            into.zip(weights).for_each(|(cotangent, weight)| *cotangent = slope * *weight);
            if shifted {
                for k in range {
                    let node = batch.columns.node[k] as usize;
                    of_weights[node] += slope.double() * batch.values[k].double();
                }
            }
        }
        let dimension = field.representation.dimension();
        let coordinates = wanted(gradients.axis.is_some(), dimension, batch.points(), of_points);
        let into = Gradient { parameters: gradients.parameters, coordinates };
        let at = Batch::coordinates(&batch.columns, field.representation);
        field.representation.vjp_recorded(field.parameters, at, cotangents, into, workspace);
        if let Some(quiescent) = &self.model.quiescent {
            quiescent.back(of_image, gradients.parameters);
        }
        if let Some(axis) = gradients.axis.as_deref_mut() {
            add_axis(field, batch, of_points, axis);
        }
    }
}

/// Buffers for gradients with respect to coordinates, cleared, where they are wanted.
fn wanted<T: Float>(
    wanted: bool,
    dimension: usize,
    points: usize,
    columns: &mut [Vec<T>; 4],
) -> Option<CoordinatesMut<'_, T>> {
    if !wanted {
        return None;
    }
    for column in columns.iter_mut() {
        column.clear();
        column.resize(points, T::zero());
    }
    let [x, y, z, t] = columns;
    Some(CoordinatesMut::of(dimension, t, [x, y, z]))
}

/// Adds the gradient of the axis by way of the points; a field of events has none.
fn add_axis<T: Float>(
    field: Field<'_, T>,
    batch: &Batch<T>,
    of_points: &[Vec<T>; 4],
    gradient: &mut [f64; 3],
) {
    if !field.representation.is_carried() {
        return;
    }
    let [x, y, z] = &batch.columns.position;
    let turned = Turned { points: Coordinates::xyz(x, y, z), angles: &batch.columns.angle };
    let [a, b, c, _] = of_points;
    let none = Cotangents { angles: None, points: None };
    let slope = pull_back_vjp(field.axis, turned, Coordinates::xyz(a, b, c), none);
    gradient.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += slope);
}
