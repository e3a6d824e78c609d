//! Probability of a geometry, given the light curve of a flare that orbits in a band: the emission is marginalised, not
//! fitted.
//!
//! Emission is thought of as env(x) (μ + g(x)) a with a Gaussian random field g of unit variance, the envelope
//! env = exp(−½ [((ρ − ρ₀)/w)² + (z/h)²]) of a circle of radius ρ₀ about the z axis, and an amplitude a. A light curve
//! is linear in it, so that the probability of the data, with g integrated out, is a Gaussian with a known covariance:
//! geometries in which data could be explained by many fields, but need not, are not preferred for it. Fields may be
//! negative here; μ is a standard deviation of their mean.
//!
//! Fields live on rings and layers, and their correlation is exp(−d²/2ℓ²) with d² = (ρ − ρ′)² + (z − z′)² +
//! 4ρ₀² sin²((φ − φ′)/2): a product of one factor for each coordinate, whose parts are few.

mod background;
mod evidence;
mod field;
mod place;
mod rows;
#[cfg(test)]
mod tests;

pub use background::{Background, Sampling, expected_background};
pub use evidence::{UNLIKELY, Weighed, evidence, validation, without_flare};
pub use place::{Interval, Normal, Place, places, together};
pub use rows::{CurveRows, PolarGrid};

use crate::Error;
use serde::{Deserialize, Serialize};

/// Prior of the emission: all combinations of these, each as probable.
#[derive(Clone, Debug, PartialEq)]
pub struct BandPrior {
    /// ρ₀, M.
    pub radii: Vec<f64>,
    /// w, M.
    pub widths: Vec<f64>,
    /// h, M.
    pub height: f64,
    /// Correlation lengths of the field, M.
    pub lengths: Vec<f64>,
    /// a², over that with which the model's mean square is that of the data.
    pub powers: Vec<f64>,
    /// μ.
    pub means: Vec<f64>,
    /// Backgrounds, each of which may be there.
    pub backgrounds: Vec<Background>,
}

impl BandPrior {
    /// Powers of amplitudes from 0.03 to 30, and means up to twice the field's deviation;
    /// nothing else shines.
    pub fn usual(radii: Vec<f64>, widths: Vec<f64>, lengths: Vec<f64>, height: f64) -> Self {
        let powers = [0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0].to_vec();
        let (means, backgrounds) = (vec![0.0, 0.5, 1.0, 2.0], vec![Background::NONE]);
        Self { radii, widths, height, lengths, powers, means, backgrounds }
    }

    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let height = [self.height];
        let lists: [(&'static str, &[f64]); 5] = [
            ("radii", &self.radii),
            ("widths", &self.widths),
            ("height", &height),
            ("lengths", &self.lengths),
            ("powers", &self.powers),
        ];
        for (field, list) in lists {
            let bad = list.iter().find(|x| !(**x > 0.0 && x.is_finite()));
            if let Some(bad) = bad.copied().or(list.is_empty().then_some(f64::NAN)) {
                return Err(Error::out_of_range(field, bad, "above 0, one or more"));
            }
        }
        let ok = !self.means.is_empty() && self.means.iter().all(|x| *x >= 0.0 && x.is_finite());
        Error::check("means", f64::NAN, ok, "0 or above, one or more")?;
        Error::check("backgrounds", 0.0, !self.backgrounds.is_empty(), "one or more")?;
        Ok(self)
    }
}

/// One of the combinations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// ρ₀, M.
    pub radius: f64,
    /// w, M.
    pub width: f64,
    /// h, M.
    pub height: f64,
    /// Correlation length, M.
    pub length: f64,
    /// a² of the rows' unit of emission.
    pub power: f64,
    /// μ.
    pub mean: f64,
    /// Background.
    #[serde(skip)]
    pub background: Background,
}

impl Band {
    /// One that is nowhere and does not shine.
    pub const DARK: Self = Self {
        radius: 0.0,
        width: 0.0,
        height: 0.0,
        length: 0.0,
        power: 0.0,
        mean: 0.0,
        background: Background::NONE,
    };
}
