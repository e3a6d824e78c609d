//! The geometry that was found, as geometry.json keeps it.

use crate::Error;
use crate::fit::geometry::{Free, Geometry, ModelError, ModelErrors, Parameter, Span, Spread};
use crate::fit::settings::{FitFile, Region, UnknownGeometry};
use crate::fit::setup::{self, FoundGeometry, RaySampling, Resolution, Trial};
use crate::null::or_nan;
use crate::recovery::{Problem, settled};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// χ²/2 above the best below which a search is taken to have ended at the same geometry, however few the data are.
pub(super) const ALIKE: f64 = 3.0;

/// Something of each free parameter, in the units of settings: degrees for angles.
pub type PerParameter<T> = BTreeMap<Parameter, T>;

/// The geometry that was found, with its errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GeometryResults {
    /// The best geometry.
    pub geometry: PerParameter<f64>,
    /// Root mean square difference of the velocity from the true one, over that of the true one.
    pub flow_error: Option<f64>,
    /// Standard deviations; none without a form that tells them.
    pub sigma: PerParameter<Option<f64>>,
    /// True if the data say nothing about a parameter.
    pub open: PerParameter<bool>,
    /// Ends of the 68 % intervals.
    pub interval_68: PerParameter<[f64; 2]>,
    /// Ends of the 95 % intervals.
    pub interval_95: PerParameter<[f64; 2]>,
    /// Part of `sigma` that each part of the model makes itself.
    pub model_error: Option<BTreeMap<String, PerParameter<Option<f64>>>>,
    /// The kind of data for which that is not known.
    pub model_error_left_out: Option<String>,
    /// Correlations of the free parameters, row by row in the order of the settings.
    pub correlation: Option<Vec<Option<f64>>>,
    /// Standard deviation of χ²/2 about its quadratic form.
    pub ripple: Option<f64>,
    /// Ends of the priors.
    pub bounds: PerParameter<[f64; 2]>,
    /// Simulated values.
    pub truth: Option<PerParameter<f64>>,
    /// χ² of the best geometry over the number of data.
    #[serde(deserialize_with = "or_nan")]
    pub chi2_per_datum: f64,
    /// Errors that the search took over those of the data.
    #[serde(deserialize_with = "or_nan")]
    pub noise_factor: f64,
    /// Resolution at which the best geometry was found.
    pub resolution: ResolutionResults,
    /// Searches from places all over the priors.
    pub starts: usize,
    /// Number of searches that ended at the best one.
    pub ended_at_the_best: usize,
    /// Each of them.
    pub trials: Vec<TrialResults>,
}

/// Resolution at which geometries were compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResolutionResults {
    /// Voxels along each axis.
    pub nodes: usize,
    /// Pixels along each side.
    pub pixels: usize,
    /// Rays whose mean a pixel is.
    pub rays_per_pixel: usize,
    /// The same of pixels near the critical curve; none where they are as others.
    #[serde(default)]
    pub ring_rays: Option<usize>,
    /// Panels of a ray for each of the coarsest.
    pub panels: u32,
}

/// One search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialResults {
    /// Geometry at its start.
    pub start: PerParameter<f64>,
    /// Geometry at its end.
    pub end: PerParameter<f64>,
    /// −ln of the probability above that of the best.
    #[serde(deserialize_with = "or_nan")]
    pub above_best: f64,
    /// Geometries that were evaluated.
    pub trials: usize,
    /// True if it ended where no step leads on.
    pub converged: bool,
    /// True if it ended at the best one.
    pub same: bool,
}

/// Something of each free parameter, by its place.
fn each<T>(free: &[Free], of: impl Fn(usize, Parameter) -> T) -> PerParameter<T> {
    let one = |(k, free): (usize, &Free)| (free.parameter, of(k, free.parameter));
    free.iter().enumerate().map(one).collect()
}

impl Geometry {
    /// Returns the free parameters in the units of settings.
    pub fn values(&self, free: &[Free]) -> PerParameter<f64> {
        each(free, |_, parameter| self.get(parameter) / parameter.unit())
    }
}

impl GeometryResults {
    /// Sums up what a search has found.
    ///
    /// # Errors
    /// If the settings that were simulated have none of a motion.
    pub fn new(
        Problem { settings, measured, .. }: &Problem,
        unknown: &UnknownGeometry,
        found: &FoundGeometry,
    ) -> Result<Self, Error> {
        let free = &unknown.free;
        let spread = found.spread.as_ref();
        let sigma = |k: usize| spread.map(|spread| spread.sigma[k]);
        let trials = trials(free, &found.trials, found.noise_factor, &sigma);
        let truth = measured.truth.as_ref().map(|_| setup::true_geometry(settings)).transpose()?;
        let interval = |span: Span| {
            each(free, |k, parameter| {
                let ends = free[k].interval(found.geometry.get(parameter), sigma(k), span);
                ends.map(|end| end / parameter.unit())
            })
        };
        let flow =
            truth.map(|truth| flow_error(settings, [&found.geometry, &truth])).transpose()?;
        Ok(Self {
            geometry: found.geometry.values(free),
            flow_error: flow.flatten(),
            sigma: each(free, |k, parameter| sigma(k).map(|sigma| sigma / parameter.unit())),
            open: each(free, |k, _| spread.is_none_or(|spread| spread.open[k])),
            interval_68: interval(Span::ONE_SIGMA),
            interval_95: interval(Span::NEARLY_ALL),
            model_error: spread.map(|spread| own(free, spread)),
            model_error_left_out: spread.and_then(|spread| spread.own.left_out).map(str::to_owned),
            correlation: spread.map(|of| of.correlation.iter().copied().map(Some).collect()),
            ripple: spread.map(|spread| spread.ripple),
            bounds: each(free, |k, parameter| free[k].bounds().map(|end| end / parameter.unit())),
            truth: truth.map(|truth| truth.values(free)),
            chi2_per_datum: found.reduced_chi2,
            noise_factor: found.noise_factor,
            resolution: found.resolution.into(),
            starts: trials.len(),
            ended_at_the_best: trials.iter().filter(|trial| trial.same).count(),
            trials,
        })
    }

    /// Returns the best geometry, with what is known of the settings; none if it lacks a free parameter.
    pub fn geometry_in(&self, file: &FitFile, free: &[Free]) -> Option<Geometry> {
        free.iter().try_fold(setup::known_geometry(file), |geometry, Free { parameter, .. }| {
            Some(geometry.with(*parameter, self.geometry.get(parameter)? * parameter.unit()))
        })
    }

    /// Returns the errors of the best geometry; none where the search has found none.
    pub fn spread(&self, geometry: Geometry, free: &[Free]) -> Option<Spread> {
        let sigma =
            |Free { parameter, .. }: &Free| Some((*self.sigma.get(parameter)?)? * parameter.unit());
        let open = |Free { parameter, .. }: &Free| self.open.get(parameter).copied();
        let correlation =
            self.correlation.as_ref()?.iter().copied().collect::<Option<Vec<f64>>>()?;
        (correlation.len() == free.len() * free.len()).then_some(())?;
        Some(Spread {
            geometry,
            sigma: free.iter().map(sigma).collect::<Option<_>>()?,
            open: free.iter().map(open).collect::<Option<_>>()?,
            correlation,
            ripple: 0.0,
            own: ModelErrors::default(),
        })
    }
}

impl From<ResolutionResults> for Resolution {
    fn from(results: ResolutionResults) -> Self {
        let ResolutionResults { nodes, pixels, rays_per_pixel, ring_rays: ring, panels } = results;
        let rays = RaySampling { per_side: rays_per_pixel.isqrt(), ring, panels, lattice: 0 };
        Self { nodes, pixels, rays }
    }
}

impl From<Resolution> for ResolutionResults {
    fn from(Resolution { nodes, pixels, rays }: Resolution) -> Self {
        let RaySampling { per_side, ring: ring_rays, panels, .. } = rays;
        Self { nodes, pixels, rays_per_pixel: per_side * per_side, ring_rays, panels }
    }
}

fn trials(
    free: &[Free],
    trials: &[Trial],
    noise_factor: f64,
    sigma: &dyn Fn(usize) -> Option<f64>,
) -> Vec<TrialResults> {
    let least = trials.iter().map(|trial| trial.value).fold(f64::INFINITY, f64::min);
    let one = |trial: &Trial| TrialResults {
        start: trial.start.values(free),
        end: trial.end.values(free),
        above_best: trial.value - least,
        trials: trial.trials,
        converged: has_converged(free, trial, sigma),
        same: is_same(free, trial, trials, noise_factor, sigma),
    };
    trials.iter().map(one).collect()
}

/// Radii at which velocities are compared.
const RADII: usize = 64;

/// Returns the distance of a flow from the true one: the root mean square difference of (dr/dt, r dφ/dt) over the radii of
/// the region, over the root mean square of the true velocity.
fn flow_error(file: &FitFile, trials: [&Geometry; 2]) -> Result<Option<f64>, Error> {
    let [found, truth] = trials;
    let law = |file: &FitFile, geometry| setup::motion(&settled(file, geometry), Vec::new());
    let (found, truth) = (law(file, found)?.velocity, law(&file.simulated()?, truth)?.velocity);
    let Region { r_min, r_max, .. } = file.region;
    let (mut away, mut all) = (0.0, 0.0);
    for k in 0..RADII {
        let r = r_min + (r_max - r_min) * (k as f64 + 0.5) / RADII as f64;
        let [found, truth] = [&found, &truth].map(|law| [law.fall(r), r * law.rate(r)]);
        away += (found[0] - truth[0]).powi(2) + (found[1] - truth[1]).powi(2);
        all += truth[0].powi(2) + truth[1].powi(2);
    }
    let error = (away / all).sqrt();
    // No true velocity, no relative error.
    Ok(error.is_finite().then_some(error))
}

/// Returns the errors of each free parameter by the model itself, part by part, in its unit: at most what is known of it before
/// the data.
fn own(free: &[Free], spread: &Spread) -> BTreeMap<String, PerParameter<Option<f64>>> {
    let part = |error: &ModelError| {
        let moved = each(free, |k, parameter| {
            let variance = error.covariance.get(k * (free.len() + 1))?;
            // Along directions that data leave open nothing but the prior bounds a shift.
            Some(variance.sqrt().min(free[k].prior.deviation()) / parameter.unit())
        });
        (error.source.to_owned(), moved)
    };
    spread.own.known.iter().map(part).collect()
}

/// Returns whether what a search expects farther on is no farther away than a standard deviation of every parameter.
fn has_converged(free: &[Free], trial: &Trial, sigma: &dyn Fn(usize) -> Option<f64>) -> bool {
    trial.further.is_some_and(|further| {
        free.iter().enumerate().all(|(k, Free { parameter, .. })| {
            let apart = parameter.difference(further.get(*parameter), trial.end.get(*parameter));
            sigma(k).is_some_and(|sigma| apart.abs() <= sigma)
        })
    })
}

/// Returns whether a search ended where the best one did: within the 95 % interval about it, or at a geometry that is as
/// probable and nearer than 1.5 of each parameter's scale, the width of a first population.
fn is_same(
    free: &[Free],
    trial: &Trial,
    trials: &[Trial],
    noise_factor: f64,
    sigma: &dyn Fn(usize) -> Option<f64>,
) -> bool {
    let best = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
    best.is_some_and(|best| {
        // What chance makes of χ²/2 of as many data, whose errors are `noise_factor` times those that χ²/N was taken with.
        let chance = (noise_factor * (best.value / best.reduced_chi2).sqrt()).max(ALIKE);
        let above = trial.value - best.value;
        let is_near = |(k, Free { parameter, .. }): (usize, &Free)| {
            let apart = parameter.difference(trial.end.get(*parameter), best.end.get(*parameter));
            let interval = sigma(k).map_or(0.0, |sigma| Span::NEARLY_ALL.deviations * sigma);
            let is_as_probable = above < ALIKE;
            let far = if is_as_probable { 1.5 * parameter.scale() } else { 0.0 };
            apart.abs() <= interval.max(far)
        };
        above <= chance && free.iter().enumerate().all(is_near)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::geometry::Prior;

    #[test]
    fn exact_a_search_ends_at_the_best_geometry_within_its_interval() {
        let prior = Prior::Uniform { low: -0.9, high: 0.9 };
        let free = [Free { parameter: Parameter::Spin, prior }];
        let trial = |spin: f64, value: f64| {
            let end = Geometry::new(spin, 1.0);
            Trial { start: end, end, reduced_chi2: 1.0, value, trials: 1, further: Some(end) }
        };
        // Of 200 data, whose χ²/2 scatters by 10; the interval reaches 0.0196 to each side.
        for (spin, above, expected) in
            [(0.51, 5.0, true), (0.53, 5.0, false), (0.53, 1.0, true), (0.51, 50.0, false)]
        {
            let trials = [trial(0.5, 100.0), trial(spin, 100.0 + above)];
            let same = is_same(&free, &trials[1], &trials, 1.0, &|_| Some(0.01));
            assert_eq!(same, expected, "{spin} {above}");
            assert!(is_same(&free, &trials[0], &trials, 1.0, &|_| None));
        }
        for (further, expected) in [(0.505, true), (0.52, false)] {
            let further = Some(Geometry::new(further, 1.0));
            let trial = Trial { further, ..trial(0.5, 100.0) };
            assert_eq!(has_converged(&free, &trial, &|_| Some(0.01)), expected);
            assert!(!has_converged(&free, &trial, &|_| None));
        }
        let none = Trial { further: None, ..trial(0.5, 100.0) };
        assert!(!has_converged(&free, &none, &|_| Some(0.01)));
    }
}
