//! Images of a field of emission: the sum over the nodes of every ray.

use super::batch::Batch;
use super::forward_model::{Field, ForwardModel};
use super::stokes::Planes;
use crate::representation::Workspace;
use kerrlight_common::simd::Float;

impl<T: Float> ForwardModel<T> {
    /// Images of these frames, one after the other: `movie` is overwritten. [`weigh`](Self::weigh) comes first.
    pub fn movie(
        &self,
        field: Field<'_, T>,
        frames: &[usize],
        batch: &mut Batch<T>,
        workspace: &mut Workspace,
        movie: &mut [T],
    ) {
        assert_eq!(movie.len(), frames.len() * self.pixels);
        for (frame, image) in frames.iter().zip(movie.chunks_exact_mut(self.pixels)) {
            self.gather_frame(field, *frame, batch);
            let at = Batch::coordinates(&batch.columns, field.representation);
            field.representation.eval(field.parameters, at, &mut batch.values, workspace);
            self.sum_rays(batch, image);
            self.add_quiescent(field, image);
        }
    }

    /// The same with memory of their own.
    pub fn images(&self, field: Field<'_, T>, frames: &[usize]) -> Vec<T> {
        let mut movie = vec![T::zero(); frames.len() * self.pixels];
        self.movie(field, frames, &mut Batch::default(), &mut Workspace::new(), &mut movie);
        movie
    }

    /// The image of one frame, whose gradient ([`vjp_recorded`](crate::representation::Representation::vjp_recorded) of the batch) comes next: `image` is
    /// overwritten.
    pub fn image_recorded(
        &self,
        field: Field<'_, T>,
        frame: usize,
        batch: &mut Batch<T>,
        workspace: &mut Workspace,
        image: &mut [T],
    ) {
        self.gather_frame(field, frame, batch);
        let at = Batch::coordinates(&batch.columns, field.representation);
        field.representation.eval_recorded(field.parameters, at, &mut batch.values, workspace);
        self.sum_rays(batch, image);
        self.add_quiescent(field, image);
    }

    /// Adds the emission that does not move to the images of a frame.
    fn add_quiescent(&self, field: Field<'_, T>, image: &mut [T]) {
        if let Some(quiescent) = &self.quiescent {
            quiescent.add(field.parameters, image);
        }
    }

    /// All nodes of a frame, and room for their values.
    fn gather_frame(&self, field: Field<'_, T>, frame: usize, batch: &mut Batch<T>) {
        batch.set((0..self.rays()).map(|ray| (ray as u32, frame as u32)));
        batch.gather_field(self, field);
        batch.values.resize(batch.points(), T::zero());
    }

    /// Values of all rays summed into their pixels.
    fn sum_rays(&self, batch: &Batch<T>, image: &mut [T]) {
        image.fill(T::zero());
        for (ray, range) in batch.starts.windows(2).enumerate() {
            let range = range[0]..range[1];
            if let Some(planes) = &self.planes {
                self.add_planes(planes, ray, range, batch, image);
                continue;
            }
            let sum = batch.columns.weight[range.clone()].iter().zip(&batch.values[range]);
            let sum: T = sum.map(|(w, e)| *w * *e).sum();
            self.put(image, ray, sum);
        }
    }

    /// A ray's light into its pixel.
    pub(in crate::fit) fn put<U: core::ops::AddAssign>(
        &self,
        image: &mut [U],
        ray: usize,
        light: U,
    ) {
        let pixel = &mut image[self.pixel[ray] as usize];
        // A pixel of an image has one ray: the nodes of several are grouped as those of one.
        if self.is_flux { *pixel += light } else { *pixel = light }
    }

    /// A ray's light into its pixels of all images.
    fn add_planes(
        &self,
        planes: &Planes<T>,
        ray: usize,
        range: core::ops::Range<usize>,
        batch: &Batch<T>,
        image: &mut [T],
    ) {
        let pixel = self.pixel[ray] as usize;
        for k in range {
            let light = batch.columns.weight[k] * batch.values[k];
            for (plane, factor) in planes.of(batch.columns.node[k]).iter().enumerate() {
                image[pixel + plane * planes.stride] += light * *factor;
            }
        }
    }
}
