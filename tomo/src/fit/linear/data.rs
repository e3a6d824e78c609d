//! The data of a linear problem, and how they are weighted.

use crate::Error;
use crate::fit::FrameTerm;
use kerrlight_common::simd::Float;

/// Data with the weight of their reduced χ².
#[derive(Clone, Copy)]
pub struct Weighted<'a, T: Float> {
    /// Weight of the data.
    pub weight: f64,
    /// The data.
    pub term: &'a dyn FrameTerm<T>,
}

impl<T: Float> Weighted<'_, T> {
    /// Real data in some frames.
    pub(in crate::fit) fn count(&self, frames: &[usize]) -> usize {
        frames.iter().map(|frame| self.term.degrees_of_freedom(*frame)).sum()
    }
}

/// Terms over some frames: Σ weight · χ²/(number of real data in those frames).
pub(super) struct Data<'a, T: Float> {
    terms: Vec<Weighted<'a, T>>,
    /// Real data in the frames.
    pub count: usize,
}

impl<'a, T: Float> Data<'a, T> {
    pub fn new(
        terms: &[Weighted<'a, T>],
        frames: &[usize],
        pixels: usize,
        of_movie: usize,
    ) -> Result<Self, Error> {
        let check = Error::check;
        check("frames", 0.0, !frames.is_empty(), "1 or more")?;
        for frame in frames {
            check("frame", *frame as f64, *frame < of_movie, "one of the movie")?;
        }
        for Weighted { weight, term } in terms {
            let fits = term.pixels() == pixels && term.frames() == of_movie;
            check("pixels of the data", term.pixels() as f64, fits, "those of the rays")?;
            let ok = weight.is_finite() && *weight >= 0.0;
            check("weight of the data", *weight, ok, "0 or above")?;
        }
        let scaled = |data: &Weighted<'a, T>| -> Option<Weighted<'a, T>> {
            let count = data.count(frames);
            let weight = data.weight / count as f64;
            (count > 0 && weight > 0.0).then_some(Weighted { weight, term: data.term })
        };
        let terms: Vec<_> = terms.iter().filter_map(scaled).collect();
        check("data in the frames", 0.0, !terms.is_empty(), "1 or more")?;
        let count = terms.iter().map(|data| data.count(frames)).sum();
        Ok(Self { terms, count })
    }

    /// The same terms over the number of all data: Σ weight · χ²/data, in which a datum counts as its error says.
    pub fn together(mut self, frames: &[usize]) -> Self {
        for data in &mut self.terms {
            data.weight *= data.count(frames) as f64 / self.count as f64;
        }
        self
    }

    pub fn is_quadratic(&self) -> bool {
        self.terms.iter().all(|data| data.term.is_quadratic())
    }

    pub fn is_convex(&self) -> bool {
        self.terms.iter().all(|data| data.term.is_convex())
    }

    /// Returns whether none of the data knows the flux.
    pub fn is_scale_free(&self) -> bool {
        self.terms.iter().all(|data| data.term.is_scale_free())
    }

    /// Names the data.
    pub fn names(&self) -> String {
        let names: Vec<&str> = self.terms.iter().map(|data| data.term.name()).collect();
        names.join(", ")
    }

    /// The first data of a frame whose χ² is no finite number, with it.
    pub fn not_finite(
        &self,
        frame: usize,
        image: &[T],
        gradient: &mut [T],
    ) -> Option<(String, f64)> {
        let value = |data: &Weighted<'a, T>| {
            // Only the value is wanted: with weight 0 the gradient gets nothing.
            let value = data.term.value_and_gradient(frame, image, T::zero(), gradient);
            (data.term.name().to_owned(), value)
        };
        self.terms.iter().map(value).find(|(_, value)| !value.is_finite())
    }

    /// Value of a frame; overwrites the gradient with respect to its pixels.
    pub fn value(&self, frame: usize, image: &[T], gradient: &mut [T]) -> f64 {
        gradient.fill(T::zero());
        let one = |data: &Weighted<'a, T>| {
            let weight = T::of(data.weight);
            data.weight * data.term.value_and_gradient(frame, image, weight, gradient)
        };
        self.terms.iter().map(one).sum()
    }
}
