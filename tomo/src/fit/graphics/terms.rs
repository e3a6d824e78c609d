//! Losses of light that comes back from the device.

use crate::fit::loss::objective::{Loss, Objective};
use crate::fit::loss::terms::FrameTerm;
use rayon::prelude::*;

impl Objective<f32> {
    /// A loss to which frames are added.
    pub(super) fn empty_loss(&self) -> Loss {
        Loss { terms: vec![0.0; self.terms().count()], ..Loss::default() }
    }

    /// Adds the terms of frames, some of `whole`, whose rays have this light, frame after frame; dL/dlight of each ray.
    pub(super) fn of_frames(
        &self,
        frames: &[usize],
        whole: usize,
        light: &[f32],
        loss: &mut Loss,
    ) -> Vec<f32> {
        let of_frame = |(frame, light): (&usize, &[f32])| {
            let mut own = self.empty_loss();
            (self.of_rays(*frame, whole, light, &mut own), own.terms)
        };
        let rays = self.model.rays();
        let all: Vec<_> = frames.par_iter().zip(light.par_chunks(rays)).map(of_frame).collect();
        let mut slopes = Vec::with_capacity(light.len());
        // Added up in the order of the frames, whatever thread was first.
        for (own, terms) in all {
            slopes.extend(own);
            loss.terms.iter_mut().zip(terms).for_each(|(sum, own)| *sum += own);
        }
        slopes
    }

    /// Adds the terms of a frame, one of `whole`, whose rays have this light; dL/dlight of each ray.
    fn of_rays(&self, frame: usize, whole: usize, light: &[f32], loss: &mut Loss) -> Vec<f32> {
        let model = &self.model;
        let (mut image, mut of_image) = (vec![0.0; model.pixels()], vec![0.0; model.pixels()]);
        light.iter().enumerate().for_each(|(ray, light)| model.put(&mut image, ray, *light));
        for ((term, weight), sum) in self.terms().zip(&mut loss.terms) {
            let scale = 1.0 / self.data_of(term, whole);
            let factor = (weight * scale) as f32;
            *sum +=
                scale * FrameTerm::value_and_gradient(term, frame, &image, factor, &mut of_image);
        }
        model.pixel().iter().map(|pixel| of_image[*pixel as usize]).collect()
    }
}
