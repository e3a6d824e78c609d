//! Options of EXR files.

use clap::Args;
use core::fmt;
use kerrlight_render::image::exr::{CameraMatrices, Style};

/// Options of EXR files.
#[derive(Debug, Default, Clone, Copy, Args)]
pub struct ExrOptions {
    /// Write colours and alpha as 16-bit floats; all other channels keep 32 bits
    #[arg(long)]
    half: bool,
    /// Write a part for each layer
    #[arg(long)]
    multi_part: bool,
}

impl ExrOptions {
    /// The style of a picture that is taken from some place.
    pub fn style(&self, camera: CameraMatrices) -> Style {
        let (half, multi_part) = (self.half, self.multi_part);
        Style { half, multi_part, camera: Some(camera), frames_per_second: None }
    }
}

/// The options as they are written.
impl fmt::Display for ExrOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.half, self.multi_part) {
            (false, false) => "none",
            (true, false) => "--half",
            (false, true) => "--multi-part",
            (true, true) => "--half --multi-part",
        })
    }
}
