//! `kerrlight`: from scene files to lensed images of black holes, and from data to emission.

use std::process::ExitCode;

fn main() -> ExitCode {
    kerrlight_cli::Program::new().run()
}
