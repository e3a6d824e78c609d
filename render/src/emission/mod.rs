//! Sources of light. A source knows its light in the gas frame and how its gas moves; how light
//! adds up along a ray is the business of [`transport`](crate::transport).

pub mod black_body;
pub mod disc;
pub mod gas;
pub mod medium;
pub mod mesh;
mod occupied;
pub mod page_thorne;
pub mod sky;
pub mod spot;
pub mod spot_parts;
pub mod volume;
