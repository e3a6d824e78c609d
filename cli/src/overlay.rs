//! Marks over the PNG of a picture.

use anyhow::{Context, bail};
use clap::Args;
use image::RgbImage;
use kerrlight_render::image::Picture;
use kerrlight_render::image::canvas::Canvas;
use kerrlight_render::image::preview::{self, Look};
use kerrlight_render::image::{overlay, ticks};
use kerrlight_render::scene::Scene;

/// Options of what is drawn over a picture.
#[derive(Debug, Args)]
pub struct OverlayOptions {
    /// Draw a scale bar, in M and for a distant observer in µas, into the PNG
    #[arg(long)]
    scale_bar: bool,
    /// Draw the critical curve into the PNG
    #[arg(long)]
    critical_curve: bool,
    /// Draw ticks along the polarisation, as long as it is strong, into the PNG (needs the
    /// channels Q and U)
    #[arg(long)]
    ticks: bool,
}

/// Ticks from left to right.
const TICKS_ACROSS: usize = 28;

/// The channels that ticks are drawn from.
const POLARIZATION: [&str; 2] = ["Q", "U"];

impl OverlayOptions {
    /// Refuses what a scene does not have, whose channels are `names`.
    pub fn check(&self, scene: &Scene, names: &[&str]) -> anyhow::Result<()> {
        for (given, name) in
            [(self.scale_bar, "--scale-bar"), (self.critical_curve, "--critical-curve")]
        {
            if given && scene.camera.is_some() {
                bail!("{name} needs a screen in M: the scene has a camera with angles");
            }
        }
        if self.critical_curve && !scene.effects.lensing {
            bail!("--critical-curve needs `effects.lensing`: straight rays have no critical curve");
        }
        if self.ticks && POLARIZATION.iter().any(|name| !names.contains(name)) {
            bail!("--ticks: the picture has no channels Q and U");
        }
        Ok(())
    }

    /// Whether any mark is requested.
    pub fn any(&self) -> bool {
        self.scale_bar || self.critical_curve || self.ticks
    }

    /// The channels that marks are drawn from.
    pub fn channels(&self) -> &'static [&'static str] {
        if self.ticks { &POLARIZATION } else { &[] }
    }

    /// The picture in colours with all marks; `white` is the brightest value. A pixel of the
    /// picture may be the mean of `reduced` × `reduced` of the scene's.
    pub fn draw(
        &self,
        scene: &Scene,
        (picture, reduced): (&Picture, usize),
        look: Look,
        white: f32,
    ) -> anyhow::Result<RgbImage> {
        let drawn = preview::draw(picture, look, white).context("cannot draw the picture")?;
        if !self.any() {
            return Ok(drawn);
        }
        let mut canvas = Canvas::of(&drawn).context("the picture is too large to draw on")?;
        // The last boxes of a reduced picture may be cut: the field ends within their pixels.
        let size = [scene.screen.width, scene.screen.rows()].map(|n| f64::from(n) / reduced as f64);
        let pixel = scene.pixel_size() * reduced as f64;
        if self.critical_curve {
            let curve = [scene.hole.spin, scene.observer.inclination_deg];
            overlay::critical_curve(&mut canvas, size, pixel, curve);
        }
        if self.ticks {
            let found = ticks::ticks(picture, TICKS_ACROSS)
                .context("--ticks: the picture has no channels Q and U")?;
            let longest = 1.1 * picture.width as f64 / TICKS_ACROSS as f64;
            ticks::draw(&mut canvas, &found, longest);
        }
        if self.scale_bar {
            let far = scene.observer.radius.is_infinite();
            let angle = scene.hole.angle_uas().filter(|_| far);
            overlay::scale_bar(&mut canvas, size, pixel, angle);
        }
        Ok(canvas.into_picture())
    }
}
