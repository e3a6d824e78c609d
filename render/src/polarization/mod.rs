//! Polarised synchrotron emission: the magnetic field of the gas, the light that it makes, and
//! the direction in which that light is polarised on the screen.
//!
//! A source knows the photon, the gas and the field at a point of a ray; [`view`] tells g, the
//! angle between ray and field, and the position angle on the screen; a [`PowerLaw`] makes
//! [`Stokes`] parameters of them.
//!
//! Conventions (docs/method/polarization.md): position angles χ are of the electric vector, from north
//! (+β) towards east (−α); Q = P cos 2χ, U = P sin 2χ; V > 0 is right-handed (IAU 1973): the
//! electric vector turns from north to east. Nothing is absorbed, and Faraday rotation and
//! conversion are left out.

mod field;
mod gas;
mod law;

mod synchrotron;
#[cfg(test)]
mod tests;
mod view;

pub use field::MagneticField;
pub use gas::Gas;
pub use kerrlight_common::stokes::{Stokes, StokesParameter};
pub use law::{Components, FieldFrame, MixedField, Normalisation, PolarizationLaw};
pub use synchrotron::PowerLaw;
pub use view::{SynchrotronView, view, view_at};
