//! The linear polarisation of a static image, found beside its total intensity, which is held: fractions of every pixel's
//! light, a penalty on their slopes whose strength held-out frames choose, and errors from other noise.
//!
//! `problem` (loss and gradient) → `survey` (all that is asked) → `numbers` (what is measured).

mod numbers;
mod problem;
mod survey;
#[cfg(test)]
mod tests;

pub use numbers::LinearPolarization;
pub use problem::PolarizedProblem;
pub use survey::{PolarizedCandidate, PolarizedSurvey, survey_polarized};
