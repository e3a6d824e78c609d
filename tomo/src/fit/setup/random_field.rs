//! A truth that is drawn from the prior of voxels.

use super::Result;
use crate::fit::linear::{GaussianField, LogNormalField, Voxels};
use crate::fit::settings::{FieldKind, FieldSettings, FitFile, Negative, Within};
use crate::representation::Spline;

/// Of the random numbers of a truth.
const TRUTH: u64 = 0x7472_7574_6800_0000;

/// A random field that is nowhere negative.
#[derive(Clone)]
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
        settings.check()?;
        let voxels = Voxels::cube(settings.nodes, file.region.r_max, settings.degree);
        let factors = factors(settings, &voxels, file.seed ^ TRUTH).within("truth.field")?;
        Ok(Self { splines: voxels.field().within("truth.field")?, factors })
    }

    /// Emission at a place (M).
    pub fn at(&self, x: [f64; 3]) -> f64 {
        self.splines.at(&self.factors, x)
    }
}

fn factors(settings: &FieldSettings, voxels: &Voxels, seed: u64) -> Result<Vec<f64>> {
    if settings.kind == FieldKind::LogNormal {
        return Ok(LogNormalField::new(settings.law(), voxels)?.drawn(seed));
    }
    let field = GaussianField::new(settings.law(), voxels)?;
    Ok(match settings.negative {
        Some(Negative::Dark) => field.drawn(seed).into_iter().map(|x| x.max(0.0)).collect(),
        _ => field.drawn_between(f64::INFINITY, seed),
    })
}
