//! Redshift factors of matter that orbits or plunges.

pub mod flow;
pub mod plunge;
