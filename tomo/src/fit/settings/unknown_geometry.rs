//! Parameters of the geometry that are not known, and the search for them.

use super::{FitError, FitFile, PriorSettings, Quantity, Within, refuse};
use crate::Error;
use crate::fit::geometry::{Free, Parameter, Prior};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the geometry that have a prior in place of a value, and the search for them.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownGeometry {
    /// The free parameters.
    pub free: Vec<Free>,
    /// Settings of the search for them.
    pub search: GeometrySearch,
}

/// Search for parameters that have a prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GeometrySearch {
    /// Searches that start from places all over the priors.
    #[schemars(range(min = 1, max = 1000), extend("unit" = "searches"))]
    pub starts: usize,
    /// The searches from all starts.
    pub coarse: SearchView,
    /// The last search, around the best of their ends. Where χ² is smooth, these are steps from all ends, and the
    /// resolution grows from this one as the data ask for.
    pub fine: SearchView,
}

impl Default for GeometrySearch {
    fn default() -> Self {
        let coarse = SearchView { trials: 100, nodes: 16, iterations: 30, pixels: 20, frames: 16 };
        let fine = SearchView { trials: 60, nodes: 36, iterations: 80, pixels: 40, frames: 20 };
        Self { starts: 8, coarse, fine }
    }
}

/// Evaluation of geometries.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchView {
    /// Trials per search, at most.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "trials"))]
    pub trials: usize,
    /// Voxels along each axis.
    #[schemars(range(min = 2, max = 128), extend("unit" = "voxels along each axis"))]
    pub nodes: usize,
    /// Iterations for the volume of each trial.
    #[schemars(range(min = 1, max = 10_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Pixels along each side; all of them if more than half. For visibilities `fine` takes any number above half.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Approximate number of frames used.
    #[schemars(range(min = 2, max = 1_000_000), extend("unit" = "frames"))]
    pub frames: usize,
}

/// Sets draws of the geometry apart from those of the noise.
const DRAWN: u64 = 0x77a1_d5ee_d000_0001;

fn free(
    (parameter, key, settings): (Parameter, &'static str, PriorSettings),
) -> Result<Free, Error> {
    // Numbers that are refused are told as they stand in the settings.
    settings.prior(1.0).checked().within(key)?;
    let prior = settings.prior(parameter.unit());
    if matches!(prior, Prior::Isotropic { .. }) && parameter != Parameter::Inclination {
        refuse!("{key}: isotropic is a prior of inclinations; take uniform or normal");
    }
    let ([low, high], [least, most], unit) = (parameter.range(), prior.bounds(), parameter.unit());
    let outside = [least, most]
        .into_iter()
        // An end in degrees may be beyond the range in radians by a rounding.
        .find(|x| x.is_finite() && !(low - 1e-9..=high + 1e-9).contains(x));
    if let Some(bad) = outside {
        let allowed = format!("{} to {}", low / unit, high / unit);
        return Err(FitError::range(key, bad / unit, &allowed).into());
    }
    Ok(Free { parameter, prior })
}

impl FitFile {
    /// Parameters of the geometry that are not known; none if all are.
    ///
    /// # Errors
    /// If a prior is out of range, or settings of the search contradict the data.
    pub fn unknown_geometry(&self) -> Result<Option<UnknownGeometry>, Error> {
        let all = self.quantities().into_iter();
        let priors = all.filter_map(|(p, key, q)| Some((p, key, q.prior()?)));
        let free: Vec<Free> = priors.map(free).collect::<Result<_, _>>()?;
        let given = self.search.clone();
        if free.is_empty() {
            return match given {
                None => Ok(None),
                Some(_) => refuse!("{NOTHING}"),
            };
        }
        Ok(Some(UnknownGeometry { free, search: given.unwrap_or_default() }))
    }

    /// Puts values drawn from the priors in their places, with the seed of the fit.
    pub(super) fn draw(&mut self) -> Result<(), Error> {
        let mut random = Pcg64::seed_from_u64(self.seed ^ DRAWN);
        for (parameter, key, quantity) in self.quantities_mut() {
            let Some(prior) = quantity.prior() else { continue };
            let drawn = free((parameter, key, prior))?.quantile(random.random());
            *quantity = Quantity::Value(drawn / parameter.unit());
        }
        Ok(())
    }

    /// The key of the first number that has a prior.
    pub(super) fn first_prior(&self) -> Option<&'static str> {
        let mut all = self.quantities().into_iter();
        all.find(|(.., quantity)| quantity.prior().is_some()).map(|(_, key, _)| key)
    }
}

/// Reason why a search without anything to look for is refused.
const NOTHING: &str = "search looks for parameters that have a prior in place of a value, such as \
     `spin = { uniform = [-0.9, 0.9] }` in [hole], and there is none; hole.spin, observer.inclination_deg, \
     observer.position_angle_deg and xi, beta_r and beta_phi of motion.velocity.infall may have one";
