//! Parameters of the geometry that are not known.

use super::{FitError, FitFile, GeometrySearch, PriorSettings, Quantity, Within};
use crate::Error;
use crate::fit::geometry::{Free, Parameter, Prior};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Parameters of the geometry that have a prior in place of a value, and the search for them.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownGeometry {
    /// The free parameters.
    pub free: Vec<Free>,
    /// Settings of the search for them.
    pub search: GeometrySearch,
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
        let why = format!("{key}: isotropic is a prior of inclinations; take uniform or normal");
        return Err(FitError::Conflict(why).into());
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
                Some(_) => Err(FitError::Conflict(NOTHING.to_owned()).into()),
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
