//! A static image of measured visibilities: positive pixels, a prior on their flux, penalties whose strength data choose
//! that are held out, gains solved for beside every image, and errors from measurements of the image with other noise.
//!
//! `start` → `problem` (loss and gradient) → `solve` (one minimum) → `survey` (all that is asked) → `ring` (what is
//! measured) → `polarized` (Q and U beside it).

mod beam;
mod polarized;
mod problem;
mod ring;
mod shapes;
mod solve;
mod start;
mod survey;
#[cfg(test)]
mod tests;

pub use beam::blurred;
pub use polarized::{
    LinearPolarization, PolarizedCandidate, PolarizedProblem, PolarizedSurvey, survey_polarized,
};
pub use problem::{FluxPrior, ImageProblem};
pub use ring::Ring;
pub use shapes::{Shape, ShapeFit, fit_shapes};
pub use solve::Solution;
pub use survey::{Candidate, Stage, Survey, SurveyWatch, survey};
