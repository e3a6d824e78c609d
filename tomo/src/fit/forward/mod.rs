//! Light of a field along rays: sight lines that are traced once, the motion that carries emission, images.

pub(in crate::fit) mod batch;
pub(in crate::fit) mod fall;
pub(in crate::fit) mod forward_model;
pub(in crate::fit) mod images;
pub(in crate::fit) mod known_field;
pub(in crate::fit) mod occupancy;
pub(in crate::fit) mod pixel_rays;
pub(in crate::fit) mod shift;
pub(in crate::fit) mod sightlines;
pub(in crate::fit) mod stokes;
