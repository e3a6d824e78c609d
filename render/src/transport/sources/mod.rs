//! The sources of light, one file or folder each: what is prepared of it once, what it needs from
//! ray to ray, and how it adds its light.

pub(super) mod disc;
pub(super) mod media;
pub(super) mod meshes;
pub(super) mod sky;
pub(super) mod spots;
