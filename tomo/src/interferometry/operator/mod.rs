//! Linear measurements of images, each with its exact adjoint, in single and double precision.

mod dtft;
mod grid;
mod matrix;
mod nufft;
mod plain;
mod transform;

pub use dtft::Dtft;
pub use grid::{ImageGrid, Pulse};
pub use nufft::Nufft;
pub use plain::{FullImage, LightCurve};
pub use transform::{Method, Transform};

pub use crate::simd::Float;

/// A linear map from movies to data.
///
/// A movie is `frames` images one after the other, each of `pixels` values in Jy/pixel, row by row
/// from the top (north), each row from the left (east).
pub trait Operator<T: Float>: Sync {
    /// A number of the data: `T` or `Complex<T>`.
    type Datum;

    /// Images of a movie.
    fn frames(&self) -> usize;

    /// Pixels of an image.
    fn pixels(&self) -> usize;

    /// How many data.
    fn data(&self) -> usize;

    /// data = F movie; what was in `data` is overwritten.
    fn forward(&self, movie: &[T], data: &mut [Self::Datum]);

    /// movie += Fᵀ data, the adjoint under the inner products Σ x y of movies and Re Σ x̄ y of
    /// data.
    ///
    /// With the gradient of a function of the data, defined by df = Re Σ ḡ dV, this adds its
    /// gradient with respect to the pixels.
    fn adjoint(&self, data: &[Self::Datum], movie: &mut [T]);
}
