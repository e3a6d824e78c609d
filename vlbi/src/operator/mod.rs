//! Linear measurements of images, each with its exact adjoint, in single and double precision.

mod dtft;
mod grid;
mod nufft;
mod transform;

pub use dtft::Dtft;
pub use grid::{ImageGrid, Pulse};
pub use nufft::Nufft;
pub use transform::{Method, Transform};

pub use kerrlight_common::simd::Float;
use num_complex::Complex;

/// A linear map from movies to data.
///
/// A movie is `frames` images one after the other, each of `pixels` values in Jy/pixel, row by row
/// from the top (north), each row from the left (east).
///
/// [`Transform`] chooses between the direct sum ([`Dtft`]) and the non-uniform FFT ([`Nufft`]) by cost.
/// Lengths that do not fit together are bugs and panic.
///
/// ```
/// use kerrlight_vlbi::operator::{Dtft, ImageGrid, Operator, Pulse};
/// use kerrlight_vlbi::Complex64;
/// use kerrlight_common::units::MICROARCSECOND;
///
/// // A source of 0.6 Jy in the middle pixel, seen on two baselines (u, v in wavelengths).
/// let grid = ImageGrid::new(5, 5, 100.0 * MICROARCSECOND)?;
/// let mut image = vec![0.0; grid.pixels()];
/// image[12] = 0.6;
/// let operator = Dtft::<f64>::new(grid, Pulse::Delta, &[vec![[1e9, 0.0], [3e9, -4e9]]], 1 << 20);
/// let mut seen = vec![Complex64::default(); operator.data()];
/// operator.forward(&image, &mut seen);
/// assert!(seen.iter().all(|v| (v - 0.6).norm() < 1e-15)); // a point at the centre
///
/// // The adjoint is exact: ⟨F x, y⟩ = ⟨x, Fᵀ y⟩.
/// let y = [Complex64::new(0.3, -1.0), Complex64::new(2.0, 0.5)];
/// let mut back = vec![0.0; grid.pixels()];
/// operator.adjoint(&y, &mut back);
/// let left: f64 = seen.iter().zip(&y).map(|(v, y)| (v.conj() * y).re).sum();
/// let right: f64 = image.iter().zip(&back).map(|(x, b)| x * b).sum();
/// assert!((left - right).abs() < 1e-14);
/// # Ok::<(), kerrlight_vlbi::Error>(())
/// ```
pub trait Operator<T: Float>: Sync {
    /// Images of a movie.
    fn frames(&self) -> usize;

    /// Pixels of an image.
    fn pixels(&self) -> usize;

    /// Returns the number of data.
    fn data(&self) -> usize;

    /// data = F movie; what was in `data` is overwritten.
    fn forward(&self, movie: &[T], data: &mut [Complex<T>]);

    /// movie += Fᵀ data, the adjoint under the inner products Σ x y of movies and Re Σ x̄ y of
    /// data.
    ///
    /// Adds the gradient with respect to the pixels of a function of the data, from that with respect
    /// to the data, defined by df = Re Σ ḡ dV.
    fn adjoint(&self, data: &[Complex<T>], movie: &mut [T]);
}
