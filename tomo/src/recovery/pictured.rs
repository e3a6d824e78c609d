//! The movie of a fit, whatever its data see.

use super::Fit;
use super::steps::named;
use crate::Error;
use crate::fit::{Batch, Observable, State};
use crate::representation::Workspace;
use kerrlight_common::frames::Frames;

impl Fit<'_, '_> {
    /// Images of total intensity of all frames, of which data see `seen`.
    ///
    /// # Errors
    /// If they are larger than memory and cannot be written.
    pub fn pictured(&self, state: &State<f32>, seen: &Frames<f32>) -> Result<Frames<f32>, Error> {
        if self.instrument.seen == Observable::Images {
            return Ok(seen.clone());
        }
        let mut model = self.instrument.pictured::<f32>(self.motion)?;
        let now = &state.now;
        model.weigh(now.axis);
        let field = now.field(self.trainer.representation);
        let (mut batch, mut workspace) = (Batch::default(), Workspace::new());
        let mut image = vec![0.0; model.pixels()];
        let quiescent = self.quiescent_light(state);
        let frames = Frames::made(model.frames(), model.pixels(), |sink| {
            (0..model.frames()).try_for_each(|frame| {
                model.movie(field, &[frame], &mut batch, &mut workspace, &mut image);
                image.iter_mut().zip(&quiescent).for_each(|(pixel, light)| *pixel += light);
                sink(&image)
            })
        })?;
        Ok(frames)
    }

    /// The light of what does not move in the images of total intensity; nothing where it is not recovered.
    pub fn quiescent_light(&self, state: &State<f32>) -> Vec<f32> {
        let is_image =
            matches!(self.instrument.seen, Observable::Images | Observable::StokesImages(_));
        match self.trainer.objective.model.quiescent().filter(|_| is_image) {
            Some(image) => image.images(&state.now.parameters)[..image.pixels].to_vec(),
            None => Vec::new(),
        }
    }

    /// Refuses a movie whose χ² is no finite number, or that is dark where dark is no result.
    pub(super) fn check(&self, frames: &[usize], movie: &Frames<f32>) -> Result<(), Error> {
        let objective = &self.trainer.objective;
        if let Some(fault) = objective.fault() {
            return Err(Error::Failed(fault.to_owned()));
        }
        if let Some(found) = objective.not_finite(frames, movie)? {
            return Err(Error::Failed(named(found)));
        }
        // A convex χ² may be least in the dark; other data have no slope there to leave it by.
        if !self.file.is_convex() && is_dark(movie)? {
            let data = objective.names().join(", ");
            return Err(Error::Failed(format!(
                "the recovered emission is zero everywhere, where {data} have no gradient: start from a nonzero field, e.g. with training.start.linear"
            )));
        }
        Ok(())
    }
}

fn is_dark(movie: &Frames<f32>) -> Result<bool, Error> {
    for image in movie.images() {
        if image?.iter().any(|pixel| *pixel != 0.0) {
            return Ok(false);
        }
    }
    Ok(true)
}
