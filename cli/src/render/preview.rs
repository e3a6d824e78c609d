//! How the PNG shows a picture.

use clap::{Args, ValueEnum};
use kerrlight_tomo::image::colormap::Colormap;
use kerrlight_tomo::image::preview::{Look, Stretch};
use kerrlight_tomo::scene::Scene;

/// Options of the PNG.
#[derive(Debug, Args)]
pub struct PreviewOptions {
    /// Colours of the PNG: a map of the intensity, or `color` for the R, G, B channels
    /// [default: afmhot-us, color where the scene has a sky]
    #[arg(long, value_name = "MAP")]
    colormap: Option<Colors>,
    /// How intensity is stretched over the colour map
    #[arg(long, default_value = "linear")]
    stretch: StretchName,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Colors {
    AfmhotUs,
    Afmhot,
    Inferno,
    Magma,
    Viridis,
    Gray,
    Color,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum StretchName {
    Linear,
    Sqrt,
    Log,
}

impl PreviewOptions {
    /// What the PNG of `scene` shows.
    pub fn look(&self, scene: &Scene) -> Look {
        let stretch = match self.stretch {
            StretchName::Linear => Stretch::Linear,
            StretchName::Sqrt => Stretch::Sqrt,
            StretchName::Log => Stretch::Log,
        };
        let default = if scene.sky.is_some() { Colors::Color } else { Colors::AfmhotUs };
        let map = match self.colormap.unwrap_or(default) {
            Colors::Color => return Look::Color,
            Colors::AfmhotUs => Colormap::AfmhotUs,
            Colors::Afmhot => Colormap::Afmhot,
            Colors::Inferno => Colormap::Inferno,
            Colors::Magma => Colormap::Magma,
            Colors::Viridis => Colormap::Viridis,
            Colors::Gray => Colormap::Gray,
        };
        Look::Intensity(map, stretch)
    }
}
