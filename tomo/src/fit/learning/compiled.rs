//! Fits of programs.
//!
//! Fits run in single precision, tests of their derivatives in double. What is generic is compiled anew in every program that
//! uses it; these methods are not, and are compiled here once.

use super::state::{Outcome, Progress, State};
use super::trainer::Trainer;
use crate::Error;
use crate::fit::forward::forward_model::{Field, Motion};
use crate::fit::loss::objective::Buffers;
use crate::representation::Representation;
use kerrlight_common::frames::Frames;
use kerrlight_common::simd::Float;
use kerrlight_render::points::Coordinates;

macro_rules! in_precision {
    ($number:ty) => {
        impl Trainer<'_, $number> {
            /// One step. It depends on the state and the settings alone: not on threads, and not on what
            /// this trainer did before.
            ///
            /// # Errors
            /// If the loss keeps diverging.
            pub fn step(&mut self, state: &mut State<$number>) -> Result<Outcome, Error> {
                self.advance(state)
            }

            /// The movie of these frames, with the mask of what shines or without.
            pub fn movie(
                &mut self,
                now: &Progress<$number>,
                frames: &[usize],
                masked: bool,
            ) -> Vec<$number> {
                self.predict(now, frames, masked)
            }

            /// The same, in memory or in a file.
            ///
            /// # Errors
            /// If there is no room for it.
            pub fn images(
                &mut self,
                now: &Progress<$number>,
                frames: &[usize],
                masked: bool,
            ) -> Result<Frames<$number>, Error> {
                // Frame by frame: all of them may be more than memory holds.
                Frames::made(frames.len(), self.objective.model.pixels(), |sink| {
                    frames.iter().try_for_each(|frame| sink(&self.predict(now, &[*frame], masked)))
                })
                .map_err(Error::Common)
            }

            /// Emission at points at the reference time.
            pub fn emission(
                &mut self,
                now: &Progress<$number>,
                points: [&[$number]; 3],
            ) -> Vec<$number> {
                self.buffers.emission(self.representation, &now.parameters, points)
            }

            /// Emission at points (M) at another time, M since the reference time; `motion` is that of the forward
            /// model.
            pub fn emission_at(
                &mut self,
                now: &Progress<$number>,
                motion: &Motion,
                time: f64,
                points: [&[$number]; 3],
            ) -> Vec<$number> {
                self.emitted(now, motion, time, points)
            }
        }
    };
}

in_precision!(f32);
#[cfg(test)]
in_precision!(f64);

impl<T: Float> Progress<T> {
    /// The field that has been learnt so far.
    pub fn field<'a>(&'a self, representation: &'a dyn Representation<T>) -> Field<'a, T> {
        let Progress { parameters, axis, occupancy, .. } = self;
        Field { representation, parameters, axis: *axis, occupancy: occupancy.as_ref() }
    }
}

impl<T: Float> Trainer<'_, T> {
    fn predict(&mut self, now: &Progress<T>, frames: &[usize], masked: bool) -> Vec<T> {
        self.objective.model.weigh(now.axis);
        let mut movie = vec![T::zero(); frames.len() * self.objective.model.pixels()];
        let mut field = now.field(self.representation);
        field.occupancy = field.occupancy.filter(|_| masked);
        let Buffers { batch, workspace, .. } = &mut self.buffers;
        self.objective.model.movie(field, frames, batch, workspace, &mut movie);
        movie
    }

    fn emitted(
        &mut self,
        now: &Progress<T>,
        motion: &Motion,
        time: f64,
        points: [&[T]; 3],
    ) -> Vec<T> {
        let matter = motion.matter(now.axis, time, points);
        let points = match self.representation.is_carried() {
            true => [0, 1, 2].map(|c| matter[c].as_slice()),
            false => points,
        };
        let times = vec![T::of(time); points[0].len()];
        let at = Coordinates::of(self.representation.dimension(), &times, points);
        let mut values = vec![T::zero(); times.len()];
        let workspace = self.buffers.workspace();
        self.representation.eval(&now.parameters, at, &mut values, workspace);
        values
    }
}
