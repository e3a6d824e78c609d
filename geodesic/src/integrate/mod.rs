//! One ray, step by step: the equations of motion in Mino time, steppers, the run from the screen
//! to the horizon or the sky, and the path that comes of it.

#[cfg(feature = "affine")]
pub(crate) mod affine;
pub(crate) mod assembly;
pub(crate) mod mino;
pub(crate) mod outcome;
pub(crate) mod path;
mod run;
mod runge_kutta;
pub(crate) mod series;
mod stepper;
pub(crate) mod trace;
pub(crate) mod uncertainty;
