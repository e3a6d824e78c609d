//! A truth that is drawn from the prior of voxels.

use super::Result;
use crate::fit::linear::{GaussianField, LogNormalField, Voxels};
use crate::fit::settings::{FieldKind, FieldSettings, FitFile, Negative, Within};
use crate::representation::Spline;

/// Stream of the random numbers of a truth.
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
        let factors =
            factors(settings, &voxels, file.seed ^ TRUTH).within("simulation.truth.field")?;
        Ok(Self { splines: voxels.field().within("simulation.truth.field")?, factors })
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

/// Fields of which the spread is taken, at so many places along each axis of the inner half.
const FIELDS: u64 = 8;
const PLACES: usize = 12;
/// Stream of their random numbers.
const SPREAD: u64 = 0x7370_7265_6164_0000;

/// Standard deviation of the emission at a voxel under `[linear.prior]`, before any data, and of its logarithm where that is
/// normal: none without a prior.
///
/// That of a Gaussian field is smaller than its amplitude, since emission is not
/// negative and not above `linear.upper`; it is that of eight fields.
///
/// # Errors
/// If a number is out of range.
pub fn deviation_of_prior(file: &FitFile) -> Result<Option<f64>> {
    let Some(linear) = &file.linear else { return Ok(None) };
    let Some(prior) = &linear.prior else { return Ok(None) };
    if prior.kind == FieldKind::LogNormal {
        return Ok(Some(prior.amplitude));
    }
    let voxels = Voxels::cube(file.voxel_nodes(), file.region.r_max, linear.degree);
    let field = GaussianField::new(prior.law(), &voxels).within("linear.prior")?;
    let splines = voxels.field().within("linear.prior")?;
    let place = |k: usize| (k as f64 / (PLACES - 1) as f64 - 0.5) * file.region.r_max;
    let places = (0..PLACES.pow(3)).map(|k| [k / PLACES / PLACES, k / PLACES % PLACES, k % PLACES]);
    let places: Vec<[f64; 3]> = places.map(|k| k.map(place)).collect();
    let drawn = |k| {
        let factors = field.drawn_between(linear.upper, SPREAD + k);
        places.iter().map(|x| splines.at(&factors, *x)).collect::<Vec<f64>>()
    };
    let values: Vec<f64> = (0..FIELDS).flat_map(drawn).collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    Ok(Some((values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()))
}
