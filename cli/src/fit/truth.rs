//! Emission that is simulated.

use super::config::{FitFile, Spot};
use super::setup::{self, Instrument};
use anyhow::{Context, anyhow, bail};
use kerrlight_geodesic::vector::{distance, rotate};
use kerrlight_tomo::dynamics::{AngularVelocity, Axis};
use kerrlight_tomo::emission::glyph::{Glyph, GlyphShape};
use kerrlight_tomo::fit::{Batch, Chain};

/// The emission that is simulated.
pub struct Truth {
    spots: Vec<Spot>,
    glyphs: Vec<Glyph>,
    axis: Axis,
    velocity: AngularVelocity,
}

impl Truth {
    /// Of settings that have a truth and an axis.
    pub fn new(file: &FitFile) -> anyhow::Result<Self> {
        let missing =
            || anyhow!("truth is missing: there is nothing to simulate; {}", super::data::SPOT);
        let truth = file.truth.as_ref().ok_or_else(missing)?;
        if truth.spot.is_empty() && truth.glyph.is_empty() {
            bail!("truth is empty; {}", super::data::SPOT);
        }
        for (k, spot) in truth.spot.iter().enumerate() {
            let numbers = [spot.sigma, spot.amplitude, spot.wound_for];
            let finite = numbers.iter().chain(&spot.center).all(|x| x.is_finite());
            if !finite || spot.sigma <= 0.0 || spot.amplitude < 0.0 {
                bail!("truth.spot {k}: finite numbers with sigma above 0 and amplitude 0 or above");
            }
        }
        let missing = || anyhow!("motion.axis is missing: a simulation needs it; {}", setup::AXIS);
        let axis = setup::known_axis(file)?.ok_or_else(missing)?;
        let glyph = |(k, of): (usize, &super::config::Glyph)| {
            let shape = GlyphShape {
                letter: of.letter,
                center: of.center,
                height: of.height,
                thickness: of.thickness,
                softness: of.softness,
                amplitude: of.amplitude,
            };
            Glyph::new(&shape, axis.vector()).with_context(|| format!("truth.glyph {k}"))
        };
        Ok(Self {
            spots: truth.spot.clone(),
            glyphs: truth.glyph.iter().enumerate().map(glyph).collect::<anyhow::Result<_>>()?,
            axis,
            velocity: setup::motion(file, Vec::new())?.velocity,
        })
    }

    /// Emission at the reference time.
    pub fn at(&self, x: [f64; 3]) -> f64 {
        // Spots that were wound up for the same time share the rotation.
        let mut turned = (0.0, x);
        let light = |spot: &Spot| {
            if spot.wound_for != turned.0 {
                let rate = self.velocity.rate(distance(x, [0.0; 3]));
                let back = rotate(self.axis.vector(), -rate * spot.wound_for, x);
                turned = (spot.wound_for, back);
            }
            let offset = distance(turned.1, spot.center) / spot.sigma;
            spot.amplitude * (-0.5 * offset * offset).exp()
        };
        let of_glyphs: f64 = self.glyphs.iter().map(|glyph| glyph.at(x, 0.0)).sum();
        self.spots.iter().map(light).sum::<f64>() + of_glyphs
    }

    /// Whether every amplitude is 0: data of noise alone.
    pub fn is_dark(&self) -> bool {
        self.spots.iter().all(|spot| spot.amplitude == 0.0)
            && self.glyphs.iter().all(Glyph::is_dark)
    }

    /// Its axis.
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// Its movie, in double precision.
    pub fn movie(
        &self,
        file: &FitFile,
        instrument: &Instrument,
        times: &[f64],
    ) -> anyhow::Result<Vec<f64>> {
        let motion = setup::motion(file, times.to_vec())?;
        let Instrument { lines, hole, redshift, .. } = instrument;
        let mut chain = Chain::<f64>::new(lines, &motion, hole, *redshift)?;
        chain.weigh(self.axis);
        Ok(chain.movie_of(self.axis, &|x| self.at(x), &mut Batch::default()))
    }
}
