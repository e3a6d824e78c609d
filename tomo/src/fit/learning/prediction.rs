//! Movies and emission of a fit.

use super::state::Progress;
use super::trainer::Trainer;
use crate::Error;
use crate::fit::forward::forward_model::{Field, Motion};
use crate::fit::loss::objective::Buffers;
use crate::representation::Representation;
use kerrlight_common::frames::Frames;
use kerrlight_common::simd::Float;

impl<T: Float> Progress<T> {
    /// The field that has been learnt so far.
    pub fn field<'a>(&'a self, representation: &'a dyn Representation<T>) -> Field<'a, T> {
        let Progress { parameters, axis, occupancy, .. } = self;
        Field { representation, parameters, axis: *axis, occupancy: occupancy.as_ref() }
    }
}

// In single precision, that of programs: what is generic is compiled anew in every program that uses it.
impl Trainer<'_, f32> {
    /// The movie of these frames, with the mask of what shines or without.
    pub fn movie(&mut self, now: &Progress<f32>, frames: &[usize], masked: bool) -> Vec<f32> {
        self.objective.model.weigh(now.axis);
        let mut movie = vec![0.0; frames.len() * self.objective.model.pixels()];
        let mut field = now.field(self.representation);
        field.occupancy = field.occupancy.filter(|_| masked);
        let Buffers { batch, workspace, .. } = &mut self.buffers;
        self.objective.model.movie(field, frames, batch, workspace, &mut movie);
        movie
    }

    /// The movie of these frames, with the mask, in memory or in a file.
    ///
    /// # Errors
    /// If there is no room for it.
    pub fn images(&mut self, now: &Progress<f32>, frames: &[usize]) -> Result<Frames<f32>, Error> {
        // Frame by frame: all of them may be more than memory holds.
        Frames::made(frames.len(), self.objective.model.pixels(), |sink| {
            frames.iter().try_for_each(|frame| sink(&self.movie(now, &[*frame], true)))
        })
        .map_err(Error::Common)
    }

    /// Emission at points at the reference time.
    pub fn emission(&mut self, now: &Progress<f32>, points: [&[f32]; 3]) -> Vec<f32> {
        self.buffers.emission(self.representation, &now.parameters, 0.0, points)
    }

    /// Emission at points (M) at another time, M since the reference time; `motion` is that of the forward model.
    pub fn emission_at(
        &mut self,
        now: &Progress<f32>,
        motion: &Motion,
        time: f64,
        points: [&[f32]; 3],
    ) -> Vec<f32> {
        let matter = motion.matter(now.axis, time, points);
        let points = match self.representation.is_carried() {
            true => [0, 1, 2].map(|c| matter[c].as_slice()),
            false => points,
        };
        self.buffers.emission(self.representation, &now.parameters, time, points)
    }
}
