//! Redshift factors of matter that orbits, plunges or falls.

pub mod flow;
pub mod infall;
pub mod plunge;
