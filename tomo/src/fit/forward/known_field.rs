//! Movies of known fields of emission: the truth of a simulation.

use super::batch::{Batch, Columns};
use super::forward_model::ForwardModel;
use super::stokes::Planes;
use crate::Error;
use kerrlight_common::frames::Sink;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;
use rayon::prelude::*;

impl<T: Float> ForwardModel<T> {
    /// Images in Jy per pixel of a known field e₀(x) (x in M) at the reference time, all frames one after the other.
    pub fn movie_of(
        &self,
        axis: Axis,
        field: &(dyn Fn([f64; 3]) -> f64 + Sync),
        batch: &mut Batch<T>,
    ) -> Vec<f64> {
        collected(|sink| self.images_of(axis, field, batch, sink))
    }

    /// The same, image by image.
    ///
    /// # Errors
    /// Those of `sink`.
    pub fn images_of(
        &self,
        axis: Axis,
        field: &(dyn Fn([f64; 3]) -> f64 + Sync),
        batch: &mut Batch<T>,
        sink: &mut Sink<'_, f64>,
    ) -> Result<(), Error> {
        let gather = |batch: &mut Batch<T>| batch.gather(self, axis, None);
        let emission = |columns: &Columns<T>, k: usize| {
            let [x, y, z] = &columns.pulled;
            field([x[k], y[k], z[k]].map(Float::double))
        };
        self.summed(batch, gather, emission, sink)
    }

    /// The same of a known field e(x, t) of places (M) and times since the reference time (M), whatever moves.
    ///
    /// # Errors
    /// Those of `sink`.
    pub fn images_of_events(
        &self,
        field: &(dyn Fn([f64; 3], f64) -> f64 + Sync),
        batch: &mut Batch<T>,
        sink: &mut Sink<'_, f64>,
    ) -> Result<(), Error> {
        let gather = |batch: &mut Batch<T>| batch.gather_events(self);
        let emission = |columns: &Columns<T>, k: usize| {
            let [x, y, z] = &columns.position;
            field([x[k], y[k], z[k]].map(Float::double), columns.time[k].double())
        };
        self.summed(batch, gather, emission, sink)
    }

    /// Images of the emission at each node of the batches that `gather` makes.
    fn summed(
        &self,
        batch: &mut Batch<T>,
        gather: impl Fn(&mut Batch<T>),
        emission: impl Fn(&Columns<T>, usize) -> f64 + Sync,
        sink: &mut Sink<'_, f64>,
    ) -> Result<(), Error> {
        let mut image = vec![0.0; self.pixels];
        for frame in 0..self.frames() {
            image.fill(0.0);
            batch.set((0..self.rays()).map(|ray| (ray as u32, frame as u32)));
            gather(batch);
            let columns = &batch.columns;
            let light = |k: usize| columns.weight[k].double() * emission(columns, k);
            if let Some(planes) = &self.planes {
                self.add_summed(planes, columns, &batch.starts, &light, &mut image);
                sink(&image)?;
                continue;
            }
            let sum = |range: &[usize]| (range[0]..range[1]).map(light).sum::<f64>();
            // Put into pixels in the order of rays: the same bits on any number of threads.
            let fluxes: Vec<f64> = batch.starts.par_windows(2).map(sum).collect();
            fluxes.into_iter().enumerate().for_each(|(ray, flux)| self.put(&mut image, ray, flux));
            sink(&image)?;
        }
        Ok(())
    }

    /// The light of all nodes into all images.
    fn add_summed(
        &self,
        planes: &Planes<T>,
        columns: &Columns<T>,
        starts: &[usize],
        light: &(impl Fn(usize) -> f64 + Sync),
        image: &mut [f64],
    ) {
        let sum = |range: &[usize]| {
            let mut sums = vec![0.0; planes.count];
            for k in range[0]..range[1] {
                let light = light(k);
                let factors = planes.of(columns.node[k]);
                sums.iter_mut().zip(factors).for_each(|(sum, f)| *sum += light * f.double());
            }
            sums
        };
        let fluxes: Vec<Vec<f64>> = starts.par_windows(2).map(sum).collect();
        for (pixel, fluxes) in self.pixel.iter().zip(fluxes) {
            for (plane, flux) in fluxes.into_iter().enumerate() {
                image[*pixel as usize + plane * planes.stride] += flux;
            }
        }
    }
}

/// All images in memory.
pub(in crate::fit) fn collected(
    make: impl FnOnce(&mut Sink<'_, f64>) -> Result<(), Error>,
) -> Vec<f64> {
    let mut movie = Vec::new();
    // Memory refuses nothing.
    let _ = make(&mut |image: &[f64]| {
        movie.extend_from_slice(image);
        Ok(())
    });
    movie
}
