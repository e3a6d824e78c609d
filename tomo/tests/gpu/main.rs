//! Steps of fits on whatever graphics device there is, against those of the processor.
//!
//! `cargo test --release -p kerrlight-tomo --features wgpu --test gpu -- --nocapture` prints the differences.

mod fits;
mod gradients;
mod problem;

use kerrlight_geodesic::gpu::{self, Compute, GpuError};
use kerrlight_tomo::fit::graphics;
use std::fmt::Display;
use std::io::Write;

/// Says that something is not tested, past the harness, which keeps what passing tests print; with KERRLIGHT_TEST_ALL it
/// fails.
fn skipped(why: impl Display) {
    // What cannot be said is no failure of what was to be tested.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
    let all = std::env::var_os("KERRLIGHT_TEST_ALL").is_some_and(|value| !value.is_empty());
    assert!(!all, "KERRLIGHT_TEST_ALL: {why}");
}

/// The first device; where there is none a test says so and passes.
fn device() -> Option<Compute> {
    match gpu::adapter(None).and_then(|found| graphics::open(&found)) {
        Ok(device) => Some(device),
        Err(error) => {
            assert_eq!(error, GpuError::NoAdapter);
            skipped(error);
            None
        }
    }
}
