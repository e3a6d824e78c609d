//! Errors of a geometry: the bowl beneath the ripples, along other rays and with other voxels; and draws of geometries.

use super::detail::Sure;
use super::search_data::{LATTICES, SearchData};
use crate::fit::geometry::{
    Effort, Envelope, Estimate, Free, Geometry, GeometryModel, GeometryProblem, Polished, Spread,
    bounded,
};
use crate::fit::seeds::{OF_POSTERIOR, mixed_seed};
use crate::fit::settings::{FitFile, SearchView, UnknownGeometry};
use crate::fit::setup::{FitData, Result};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Stream of the random numbers of draws.
const DRAWS: u64 = 0x6f70_656e_0000_0000;
/// The number of a look that has the rays of the fit, and as many voxels.
const SAME: u64 = 0;

/// The best geometry near another one, and its χ²/N.
pub(super) fn polished(
    problem: &GeometryProblem<'_, f32>,
    start: &Estimate,
) -> Result<(Polished, f64)> {
    let polished = problem.polish(start)?;
    let reduced = problem.scale * problem.left(&polished.best)?;
    Ok((polished, reduced))
}

/// Voxels of a look over those of the search, along each side, by its number: 0 is the fit's own lattice.
const VOXELS: [f64; 1 + LATTICES] = [1.0, 1.3, 1.15, 0.87, 1.22, 0.93];

/// More voxels or fewer.
fn other_voxels(effort: Effort, number: u64) -> Effort {
    let nodes = (effort.nodes as f64 * VOXELS[number as usize]).round() as usize;
    Effort { nodes: nodes.max(effort.degree.taps()), ..effort }
}

/// How sure a geometry is: the bowl beneath the ripples of the values around, seen along several lattices of rays, with several
/// numbers of voxels and through other pixels; without one, the second derivatives at the best geometry alone. Errors grow
/// with χ²/N where that is above 1.
pub(super) fn surely(
    problem: &GeometryProblem<'_, f32>,
    looks: Looks<'_>,
    polished: &Polished,
    reduced_chi2: f64,
) -> Result<Sure> {
    if polished.covariance.iter().any(|x| !x.is_finite()) {
        return Ok(Sure { geometry: polished.best.geometry, spread: None, reduced_chi2 });
    }
    let inflation = reduced_chi2.max(1.0);
    let envelope = enveloped(problem, looks, polished, inflation)?;
    let envelope = envelope.unwrap_or_else(|| Envelope {
        geometry: polished.best.geometry,
        covariance: polished.covariance.iter().map(|x| x * inflation).collect(),
        ripple: 0.0,
    });
    let Envelope { geometry, covariance, ripple } = envelope;
    let spread = Spread::of_covariance(problem.free, geometry, &covariance, ripple);
    Ok(Sure { geometry, spread: Some(spread), reduced_chi2 })
}

/// Looks at the same data through other models.
#[derive(Clone, Copy)]
pub(super) struct Looks<'a> {
    /// Data through other pixels, and what of the geometry is not known; none where pixels are those of the data.
    pub resampled: Option<(&'a SearchData, &'a UnknownGeometry, &'a SearchView)>,
    /// True if data have the rays of the fit: along others the minimum lies elsewhere, which is no error.
    pub shares_rays: bool,
}

/// The bowl beneath the ripples, along other lattices of rays, each with other voxels, where the data alone decide, and with
/// other pixels, where those are samples only.
fn enveloped(
    problem: &GeometryProblem<'_, f32>,
    Looks { resampled, shares_rays }: Looks<'_>,
    polished: &Polished,
    inflation: f64,
) -> Result<Option<Envelope>> {
    let Some(mut surroundings) = problem.around(polished)? else { return Ok(None) };
    let resampled = resampled.filter(|_| !shares_rays);
    if shares_rays && problem.gaussian.is_some() {
        // Every look would be the same.
        return Ok(surroundings.envelope(problem, inflation));
    }
    let other_voxels = |effort: Effort, number: u64| {
        other_voxels(effort, problem.gaussian.map_or(number, |_| SAME))
    };
    for number in 1..=LATTICES as u64 {
        // Models of other pixels come with the panels of the settings, not those of the search.
        let split = problem.model.split;
        let mut look = |problem: &GeometryProblem<'_, f32>| {
            let lattice = if shares_rays { SAME } else { number };
            let model = &GeometryModel { split, ..problem.model.seen_along(lattice) };
            let effort = other_voxels(problem.effort, number);
            surroundings.look(&GeometryProblem { model, effort, ..*problem })
        };
        let other = resampled
            .and_then(|(seen, ..)| Some((seen.resampled.get(number as usize - 1)?, resampled?)));
        match other {
            None => look(problem)?,
            Some((seen, (_, unknown, view))) => {
                seen.with(unknown, view, problem.scale, problem.memory, look)?;
            }
        }
    }
    Ok(surroundings.envelope(problem, inflation))
}

/// Geometries that the data leave possible: the volume of each is the best one of data with noise once more, in that geometry
/// (its marginal distribution, then what is left of the volume: Rue & Held 2005, section 2.3).
pub struct GeometryPosterior<'a> {
    file: &'a FitFile,
    measured: &'a FitData,
    free: Vec<Free>,
    geometry: Geometry,
    /// A root of the covariance, in the parameters' own units.
    root: DMatrix<f64>,
    open: Vec<bool>,
    /// Noise of a draw over the data's errors.
    factor: f64,
}

impl<'a> GeometryPosterior<'a> {
    /// Takes a geometry whose errors a search has found, in data whose noise is `factor` times their errors.
    ///
    /// # Errors
    /// If a prior is out of its range.
    pub fn new(
        file: &'a FitFile,
        measured: &'a FitData,
        unknown: &UnknownGeometry,
        geometry: Geometry,
        spread: &Spread,
        factor: f64,
    ) -> Result<Self> {
        let Spread { open, sigma, correlation, .. } = spread;
        let n = sigma.len();
        let covariance =
            DMatrix::from_fn(n, n, |a, b| correlation[a * n + b] * sigma[a] * sigma[b]);
        // Parameters that move together exactly have no Cholesky factor: they are drawn apart.
        let apart = || DMatrix::from_diagonal(&DVector::from_column_slice(sigma));
        let root = covariance.cholesky().map_or_else(apart, |factors| factors.l());
        Ok(Self {
            file,
            measured,
            free: unknown.free.clone(),
            geometry,
            root,
            open: open.clone(),
            factor,
        })
    }

    /// Noise of a draw over the data's errors.
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// A draw: the same for the same number. What the data say nothing about is drawn from its prior, the rest from a
    /// normal distribution with the covariance of the geometry; bounds are mirrors.
    pub fn draw(&self, number: u64) -> Geometry {
        let mut random =
            Pcg64::seed_from_u64(mixed_seed(self.file.seed, number, OF_POSTERIOR) ^ DRAWS);
        let normal = |_, _| random.sample::<f64, _>(StandardNormal);
        let normal = DVector::from_fn(self.free.len(), normal);
        let step = &self.root * normal;
        // For all parameters: which of them are open then changes no draw of another.
        let shares: Vec<f64> = self.free.iter().map(|_| random.random()).collect();
        let each = self.free.iter().zip(&shares).enumerate();
        let drawn = each.fold(self.geometry, |geometry, (k, (free, share))| {
            let value = match self.open[k] {
                true => free.quantile(*share),
                false => geometry.get(free.parameter) + step[k],
            };
            geometry.with(free.parameter, value)
        });
        bounded(&self.free, drawn, Free::mirrored)
    }

    /// Data with noise once more.
    ///
    /// # Errors
    /// If there is no room for them.
    pub fn data(&self, number: u64) -> Result<FitData> {
        self.measured.perturbed(&self.file.loss, self.factor, number)
    }
}
