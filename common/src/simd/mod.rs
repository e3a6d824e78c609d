//! Support for kernels on SIMD lanes: the lanes of the geodesic crate, their numbers, and
//! elementary functions.

mod float;
pub mod math;

pub use float::Float;
pub use kerrlight_geodesic::simd::lanes::Array;
pub use kerrlight_geodesic::simd::lanes::{InstructionSet, Lanes, MAX_LANES, Task, dispatch};

/// Numbers `T` in two registers, the width of a panel of the matrix kernels.
pub fn panel<T: Float>(set: InstructionSet) -> usize {
    dispatch::<T, _>(set, PanelWidth)
}

struct PanelWidth;

impl<T: Float> Task<T> for PanelWidth {
    type Output = usize;
    #[inline(always)]
    fn run<V: Lanes<T>>(self) -> usize {
        2 * V::LANES
    }
}
