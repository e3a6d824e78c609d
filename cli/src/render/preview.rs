//! Appearance of a picture as PNG.

use anyhow::bail;
use clap::{Args, ValueEnum};
use kerrlight_render::image::colormap::Colormap;
use kerrlight_render::image::preview::{Look, Stretch};
use kerrlight_render::image::reduce::Reduction;
use kerrlight_render::scene::Scene;

/// Options of the PNG.
#[derive(Debug, Default, Args)]
pub struct PreviewOptions {
    /// Colours of the PNG: a map of the intensity, or `color` for the R, G, B channels
    /// [default: afmhot-us; color where the scene has a sky, a mesh or a disc with the colours of a
    /// black body]
    #[arg(long, value_name = "MAP")]
    colormap: Option<Colors>,
    /// Stretch of intensity over the colour map [default: linear]
    #[arg(long)]
    stretch: Option<StretchName>,
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

/// A preview has at most this many pixels: 4096 × 4096.
const MOST_PIXELS: usize = 1 << 24;

impl PreviewOptions {
    /// The channels that the PNG shows, which must be among `names`.
    pub fn channels(&self, scene: &Scene, names: &[&str]) -> anyhow::Result<Vec<&'static str>> {
        let wanted: &[&str] = match self.look(scene) {
            Look::Intensity(..) => &["intensity"],
            Look::Color if self.stretch.is_some() => {
                bail!(
                    "--stretch is of intensity: the PNG shows R, G, B unless --colormap names a map"
                )
            }
            Look::Color => &["R", "G", "B"],
        };
        if let Some(name) = wanted.iter().find(|name| !names.contains(name)) {
            bail!("the PNG needs the channel {name}, which `screen.channels` leaves out");
        }
        Ok(wanted.to_vec())
    }

    /// Returns the values that the PNG of `scene` shows.
    pub fn look(&self, scene: &Scene) -> Look {
        let stretch = match self.stretch {
            None | Some(StretchName::Linear) => Stretch::Linear,
            Some(StretchName::Sqrt) => Stretch::Sqrt,
            Some(StretchName::Log) => Stretch::Log,
        };
        let disc = scene.disc.as_ref();
        let is_black_body = disc.is_some_and(|disc| disc.peak_temperature_k.is_some());
        let colored = scene.sky.is_some() || !scene.mesh.is_empty() || is_black_body;
        let default = if colored { Colors::Color } else { Colors::AfmhotUs };
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

/// Makes the picture small enough for a PNG with the channels `wanted`.
pub fn reduction(scene: &Scene, names: &[&str], wanted: &[&str]) -> Reduction {
    let (width, height) = (scene.screen.width as usize, scene.screen.rows() as usize);
    let reduction = Reduction::new(width, height, names, wanted, MOST_PIXELS);
    if reduction.factor() > 1 {
        let factor = reduction.factor();
        eprintln!("the PNG is downsampled {factor} x {factor}");
    }
    reduction
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_render::scene::apply_override;

    /// Black bodies have colours of their own, which a map of the intensity would hide.
    #[test]
    fn exact_a_disc_with_a_temperature_is_shown_in_its_colors() {
        let options = PreviewOptions { colormap: None, stretch: None };
        let look = |text: &str| options.look(&Scene::parse(text).unwrap());
        let cold = include_str!("../../../scenes/disc_face_on.toml");
        let hot = apply_override(cold, "disc.peak_temperature_k=8000").unwrap();
        let hot = apply_override(&hot, "effects.redshift=false").unwrap();
        assert_eq!(look(cold), Look::Intensity(Colormap::AfmhotUs, Stretch::Linear));
        assert_eq!(look(&hot), Look::Color);
        let mapped = PreviewOptions { colormap: Some(Colors::Gray), ..options };
        let gray = Look::Intensity(Colormap::Gray, Stretch::Linear);
        assert_eq!(mapped.look(&Scene::parse(&hot).unwrap()), gray);
    }
}
