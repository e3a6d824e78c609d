//! A truth that is drawn from the prior of voxels.

use super::Result;
use crate::fit::linear::{GaussianField, Voxels};
use crate::fit::settings::{FieldSettings, FitFile, Negative, Within};
use crate::representation::Spline;

/// Of the random numbers of a truth.
const TRUTH: u64 = 0x7472_7574_6800_0000;

/// A Gaussian field that is nowhere negative.
pub(super) struct RandomField {
    splines: Spline,
    /// Factors of the B-splines, emission.
    factors: Vec<f64>,
}

impl RandomField {
    /// Drawn with the seed of the fit, in the cube about its region.
    ///
    /// # Errors
    /// If a number is out of range.
    pub fn new(file: &FitFile, settings: &FieldSettings) -> Result<Self> {
        let voxels = Voxels::cube(settings.nodes, file.region.r_max, settings.degree);
        let field = GaussianField::new(settings.law(), &voxels).within("truth.field")?;
        let seed = file.seed ^ TRUTH;
        let factors = match settings.negative {
            Negative::Lifted => field.drawn_between(f64::INFINITY, seed),
            Negative::Dark => field.drawn(seed).into_iter().map(|x| x.max(0.0)).collect(),
        };
        Ok(Self { splines: voxels.field().within("truth.field")?, factors })
    }

    /// Emission at a place (M).
    pub fn at(&self, x: [f64; 3]) -> f64 {
        self.splines.at(&self.factors, x)
    }
}
