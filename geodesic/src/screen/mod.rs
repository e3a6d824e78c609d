//! Observers: Bardeen's screen, and cameras with a place, a motion and a lens. Both turn a point of
//! the picture into a ray's constants of motion and initial data.

pub(crate) mod camera;
pub(crate) mod observer;
pub(crate) mod view;
