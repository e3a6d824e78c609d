//! The Fourier transform that suits the numbers of pixels and visibilities.

use super::nufft::{cells, check_accuracy, width_of};
use super::{Dtft, Float, ImageGrid, Nufft, Operator, Pulse};
use crate::Error;
use num_complex::Complex;

/// Method of the Fourier transform.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// The sum over pixels.
    Direct,
    /// The fast transform, with errors of at most this times Σ|I|.
    Fast(f64),
    /// The fast transform with that accuracy where it is expected to be faster.
    Cheaper(f64),
}

/// The direct transform or the fast one.
pub enum Transform<T> {
    /// The sum over pixels.
    Direct(Dtft<T>),
    /// Fast transform.
    Fast(Nufft),
}

impl<T: Float> Transform<T> {
    /// The transform to `frames[k]`, the (u, v) in wavelengths that see frame k. The direct one
    /// keeps its exponentials if they fit into `memory_budget` bytes.
    ///
    /// # Errors
    /// If the accuracy is out of range.
    pub fn new(
        grid: ImageGrid,
        pulse: Pulse,
        frames: &[Vec<[f64; 2]>],
        method: Method,
        memory_budget: usize,
    ) -> Result<Self, Error> {
        let fast = |accuracy| Nufft::new(grid, pulse, frames, accuracy).map(Transform::Fast);
        if let Method::Cheaper(accuracy) | Method::Fast(accuracy) = method {
            check_accuracy::<T>(accuracy)?;
        }
        match method {
            Method::Fast(accuracy) => fast(accuracy),
            Method::Cheaper(accuracy) if is_fast_cheaper(grid, frames, accuracy) => fast(accuracy),
            _ => Ok(Transform::Direct(Dtft::new(grid, pulse, frames, memory_budget))),
        }
    }

    /// Names it, in words.
    pub fn describe(&self) -> String {
        match self {
            Transform::Direct(_) => "direct transform".to_owned(),
            Transform::Fast(fast) => {
                format!("fast transform, errors below {:e} of the flux", fast.accuracy())
            }
        }
    }

    /// Returns the grid of pixels, their shape, and the (u, v) of all data, where sums over pixels are direct.
    pub fn direct(&self) -> Option<(ImageGrid, Pulse, Vec<[f64; 2]>)> {
        match self {
            Transform::Direct(direct) => Some(direct.baselines()),
            Transform::Fast(_) => None,
        }
    }

    /// Returns the one that it is.
    fn operator(&self) -> &dyn Operator<T> {
        match self {
            Transform::Direct(direct) => direct,
            Transform::Fast(fast) => fast,
        }
    }
}

/// Time of both transform and adjoint, measured (docs/measurements/interferometry.md), whose ratios matter: a pixel
/// and visibility of the direct transform, N log₂ N of a fast one, a cell of a kernel.
const DIRECT_NS: f64 = 0.6;
const FAST_NS: f64 = 5.0;
const CELL_NS: f64 = 4.0;

/// Returns whether the fast transform is expected to take less time than the direct one whose exponentials are
/// kept.
fn is_fast_cheaper(grid: ImageGrid, frames: &[Vec<[f64; 2]>], accuracy: f64) -> bool {
    let width = width_of(accuracy);
    let [across, rows] = [grid.width, grid.height].map(|pixels| cells(pixels, width) as f64);
    let all = || frames.iter().flatten();
    // Half of the columns at most are kept: beyond half a turn a pixel, u folds back.
    let reach = all().fold(0.0, |most: f64, uv| most.max((uv[0] * grid.pixel_rad).abs())).min(0.5);
    let kept = reach * across + 2.0 * width as f64;
    let of_frame = grid.height as f64 * across * across.log2() + kept * rows * rows.log2();
    let seen = frames.iter().filter(|uv| !uv.is_empty()).count() as f64;
    let visibilities = all().count() as f64;
    let direct = DIRECT_NS * visibilities * grid.pixels() as f64;
    FAST_NS * seen * of_frame + CELL_NS * visibilities * (width * width) as f64 <= direct
}

impl<T: Float> Operator<T> for Transform<T> {
    fn frames(&self) -> usize {
        self.operator().frames()
    }

    fn pixels(&self) -> usize {
        self.operator().pixels()
    }

    fn data(&self) -> usize {
        self.operator().data()
    }

    fn forward(&self, movie: &[T], data: &mut [Complex<T>]) {
        self.operator().forward(movie, data);
    }

    fn adjoint(&self, data: &[Complex<T>], movie: &mut [T]) {
        self.operator().adjoint(data, movie);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance;

    fn choose(pixels: usize, visibilities: usize, method: Method) -> Transform<f64> {
        let grid = ImageGrid::new(pixels, pixels, 1e-9).unwrap();
        let uv = |k: usize| [(k as f64).sin() * 1e9, (k as f64).cos() * 1e9];
        let frames = [(0..visibilities).map(uv).collect(), Vec::new()];
        Transform::new(grid, Pulse::Triangle, &frames, method, usize::MAX).unwrap()
    }

    #[test]
    fn exact_small_images_are_transformed_directly_and_large_ones_fast() {
        let said = |pixels, visibilities, method| choose(pixels, visibilities, method).describe();
        assert_eq!(said(64, 100, Method::Cheaper(1e-10)), "direct transform");
        assert_eq!(said(256, 5000, Method::Direct), "direct transform");
        let fast = "fast transform, errors below 1e-10 of the flux";
        assert_eq!(said(256, 5000, Method::Cheaper(1e-10)), fast);
        assert_eq!(said(8, 1, Method::Fast(1e-10)), fast);
    }

    #[test]
    fn exact_accuracy_is_checked_even_where_it_is_not_used() {
        let grid = ImageGrid::new(4, 4, 1e-9).unwrap();
        let fail = Transform::<f64>::new(grid, Pulse::Delta, &[], Method::Cheaper(7.0), 0);
        assert!(fail.err().unwrap().to_string().contains("accuracy = 7"));
    }

    #[test]
    fn exact_adjoint_of_either() {
        for method in [Method::Direct, Method::Fast(1e-8)] {
            conformance::operator("transform", &choose(20, 50, method), 1e-14);
        }
    }
}
