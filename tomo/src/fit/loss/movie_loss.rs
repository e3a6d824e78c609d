//! Losses of whole movies, without a gradient, and their residuals.

use super::objective::{Loss, Objective};
use super::terms::FrameTerm;
use crate::Error;
use crate::fit::verdict::Statistics;
use kerrlight_common::frames::Frames;
use kerrlight_common::simd::Float;

impl<T: Float> Objective<T> {
    /// Returns the statistics of residuals of images of all frames: for each kind of data, in the order of
    /// [`Self::names`].
    ///
    /// # Errors
    /// If images cannot be read.
    pub fn statistics(&self, movie: &Frames<T>) -> Result<Vec<Statistics>, Error> {
        let width = self.model.pixels().isqrt();
        let of = |(term, _): (&dyn FrameTerm<T>, f64)| {
            let mut all = Statistics::default();
            for (frame, image) in movie.images().enumerate() {
                all.add(term.residuals(frame, &image?), width);
            }
            Ok(all.ended())
        };
        self.terms().map(of).collect()
    }

    /// Returns the distance of two movies of some frames for the data: the root mean square difference of what data are
    /// compared with, over their errors; of the kind of data that tells them apart best.
    pub fn apart(&self, frames: &[usize], [a, b]: [&[T]; 2]) -> f64 {
        let pixels = self.model.pixels();
        let of = |(term, _): (&dyn FrameTerm<T>, f64)| {
            let (mut squares, mut count) = (0.0, 0usize);
            let images = a.chunks_exact(pixels).zip(b.chunks_exact(pixels));
            for (frame, (a, b)) in frames.iter().zip(images) {
                let [a, b] = [a, b].map(|image| term.residuals(*frame, image));
                count += a.len();
                squares += a.iter().zip(&b).map(|(a, b)| (a.value - b.value).powi(2)).sum::<f64>();
            }
            (squares / count.max(1) as f64).sqrt()
        };
        self.terms().map(of).fold(0.0, f64::max)
    }

    /// The loss of images of these frames, without gradient.
    ///
    /// # Errors
    /// If images cannot be read.
    pub fn loss_of(&self, frames: &[usize], movie: &Frames<T>) -> Result<Loss, Error> {
        let mut none = vec![T::zero(); self.model.pixels()];
        let mut loss = Loss::default();
        let observed = self.observed();
        let count = frames.iter().filter(|frame| observed.binary_search(frame).is_ok()).count();
        for (term, weight) in self.terms() {
            let scale = 1.0 / self.data_of(term, count);
            let mut chi2 = 0.0;
            for (frame, image) in frames.iter().zip(movie.images()) {
                // χ² does not depend on the weight; 0 adds no gradient.
                chi2 += term.value_and_gradient(*frame, &image?, T::zero(), &mut none);
            }
            let value = scale * chi2;
            loss.terms.push(value);
            loss.total += weight * value;
        }
        Ok(loss)
    }

    /// The first data, with frame and χ², that are no finite number of images of these frames.
    ///
    /// # Errors
    /// If images cannot be read.
    pub fn not_finite(
        &self,
        frames: &[usize],
        movie: &Frames<T>,
    ) -> Result<Option<(String, usize, f64)>, Error> {
        let mut none = vec![T::zero(); self.model.pixels()];
        for (frame, image) in frames.iter().zip(movie.images()) {
            let image = image?;
            for (term, _) in self.terms() {
                let value = term.value_and_gradient(*frame, &image, T::zero(), &mut none);
                if !value.is_finite() {
                    return Ok(Some((term.name().to_owned(), *frame, value)));
                }
            }
        }
        Ok(None)
    }

    /// Returns the reason why data that were there at the beginning cannot be read any more, if any is so.
    pub fn fault(&self) -> Option<&str> {
        self.terms().find_map(|(term, _)| term.fault())
    }
}
