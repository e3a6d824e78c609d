//! An emission field with the parameters of a quiescent image behind its own.

use super::Quiescent;
use crate::representation::{Gradient, Groups, Representation, WeightMatrix, Workspace};
use kerrlight_common::simd::Float;
use kerrlight_render::points::Coordinates;

/// A field whose last parameters are those of a [`Quiescent`] image, which emission does not depend on.
pub struct WithStaticImage<T: Float> {
    inner: Box<dyn Representation<T>>,
    columns: usize,
    most: f64,
}

impl<T: Float> WithStaticImage<T> {
    /// A field beside an image.
    pub fn new(inner: Box<dyn Representation<T>>, image: &Quiescent) -> Self {
        Self { inner, columns: image.columns(), most: image.most }
    }

    fn own<'a>(&self, parameters: &'a [T]) -> &'a [T] {
        &parameters[..self.inner.parameters()]
    }

    fn gradient<'a>(&self, gradient: Gradient<'a, T>) -> Gradient<'a, T> {
        let Gradient { parameters, coordinates } = gradient;
        Gradient { parameters: &mut parameters[..self.inner.parameters()], coordinates }
    }
}

impl<T: Float> Representation<T> for WithStaticImage<T> {
    fn dimension(&self) -> usize {
        self.inner.dimension()
    }

    fn is_carried(&self) -> bool {
        self.inner.is_carried()
    }

    fn parameters(&self) -> usize {
        self.inner.parameters() + self.columns
    }

    fn matrices(&self) -> Vec<WeightMatrix> {
        self.inner.matrices()
    }

    /// The image starts dark.
    fn initialise(&self, seed: u64, parameters: &mut [T]) {
        let (own, image) = parameters.split_at_mut(self.inner.parameters());
        self.inner.initialise(seed, own);
        image.fill(T::zero());
    }

    fn project(&self, parameters: &mut [T]) {
        let (own, image) = parameters.split_at_mut(self.inner.parameters());
        self.inner.project(own);
        let (least, most) = (T::zero(), T::of(self.most));
        for x in image {
            // In this order a NaN stays one.
            *x = if *x < least {
                least
            } else if *x > most {
                most
            } else {
                *x
            };
        }
    }

    fn eval(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    ) {
        self.inner.eval(self.own(parameters), at, values, workspace);
    }

    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let gradient = self.gradient(gradient);
        self.inner.vjp(self.own(parameters), at, cotangents, gradient, workspace);
    }

    fn eval_recorded(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    ) {
        self.inner.eval_recorded(self.own(parameters), at, values, workspace);
    }

    fn vjp_recorded(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let gradient = self.gradient(gradient);
        self.inner.vjp_recorded(self.own(parameters), at, cotangents, gradient, workspace);
    }

    fn eval_vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        groups: Groups<'_, T>,
        values: &mut [T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let gradient = self.gradient(gradient);
        self.inner.eval_vjp(self.own(parameters), at, groups, values, gradient, workspace);
    }
}
