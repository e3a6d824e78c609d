//! Data of frames, for callers who compute χ² on another device.

use kerrlight_vlbi::data_terms::Comparison;
use kerrlight_vlbi::operator::ImageGrid;

/// Data of a frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Compared {
    /// Nothing.
    Nothing,
    /// The sum of all pixels: a flux (Jy) and 1/σ².
    Flux(f32, f32),
    /// Visibilities of the image.
    Scan {
        /// Grid of pixels.
        sky: ImageGrid,
        /// (u, v) in wavelengths, and the Fourier transform of a pixel there.
        seen: Vec<([f64; 2], f64)>,
        /// Comparison with the data.
        with: Comparison,
    },
}
