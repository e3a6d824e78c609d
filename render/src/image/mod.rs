//! Pictures: columns of float channels, their EXR files, and tone-mapped previews.

pub mod animation;
pub mod canvas;
pub mod colormap;
pub(crate) mod decode;
pub mod exr;
pub mod preview;
pub(crate) mod profile;
pub mod reduce;
pub mod ticks;

/// Shares of linear red, green and blue in the luminance (Rec. 709).
pub(crate) const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// A named channel, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name as in the file.
    pub name: String,
    /// width × height values, in the unit of the channel.
    pub values: Vec<f32>,
}

/// A picture of float channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels from left to right.
    pub width: usize,
    /// Pixels from top to bottom.
    pub height: usize,
    /// The channels.
    pub channels: Vec<Channel>,
}

impl Picture {
    /// The values of a channel, in its unit.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }
}
