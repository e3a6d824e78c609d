//! `kerrlight`: from scene files to lensed images of black holes, and from data to emission.

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: kerrlight_cli::Bounded = kerrlight_cli::Bounded;

fn main() -> ExitCode {
    kerrlight_cli::Program::new().run()
}
