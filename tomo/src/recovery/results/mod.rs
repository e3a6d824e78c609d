//! Results of searches, as a run's folder keeps them and as they are told.

mod band;
mod band_words;
mod geometry;
mod geometry_words;
mod held_out;

pub use band::{BandResults, Median, Probabilities, TrueBand, WeighedGeometry};
pub use geometry::{GeometryResults, PerParameter, ResolutionResults, TrialResults};
pub use held_out::{HeldOutResults, HeldValue};
