//! Steps of fits on whatever graphics device there is, against those of the processor.
//!
//! `cargo test --release -p kerrlight-tomo --features wgpu --test gpu -- --nocapture` prints the differences.

mod fits;
mod gradients;
mod problem;

use kerrlight_geodesic::gpu::{self, Compute, GpuError};
use kerrlight_tomo::fit::graphics;

/// The first device; where there is none a test says so and passes.
fn device() -> Option<Compute> {
    match gpu::adapter(None).and_then(|found| graphics::open(&found)) {
        Ok(device) => Some(device),
        Err(error) => {
            assert_eq!(error, GpuError::NoAdapter);
            eprintln!("SKIPPED, nothing was tested: {error}");
            None
        }
    }
}
