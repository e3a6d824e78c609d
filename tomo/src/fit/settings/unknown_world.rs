//! Parameters of the geometry that are not known.

use super::{FitError, FitFile, LossKind, PriorSettings, Quantity, Within, WorldSearch};
use crate::Error;
use crate::fit::world::{Free, Parameter, Prior, Scanned};
use kerrlight_render::dynamics::{Perturbed, Velocity};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Parameters of the geometry that have a prior in place of a value, and the search for them.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownWorld {
    priors: Vec<(Parameter, PriorSettings)>,
    /// How they are searched for.
    pub search: WorldSearch,
}

/// Parameters of a grid, at most: with more there is no picture of it.
const MOST_SCANNED: usize = 3;
/// Trials of a grid, at most.
const MOST_POINTS: usize = 100_000;

impl UnknownWorld {
    /// The free parameters.
    ///
    /// # Errors
    /// If a prior is no density on possible values.
    pub fn free(&self) -> Result<Vec<Free>, Error> {
        self.priors.iter().map(|(parameter, prior)| free(*parameter, *prior)).collect()
    }

    /// The grid over the parameters that are scanned, empty without any.
    pub fn scanned(&self) -> Vec<Scanned> {
        let of = |(parameter, prior): &(Parameter, PriorSettings)| match *prior {
            PriorSettings::Scanned { from, to, points } => {
                let ends = [from, to].map(|x| x * parameter.unit());
                Some(Scanned::even(*parameter, ends, points))
            }
            _ => None,
        };
        self.priors.iter().filter_map(of).collect()
    }

    fn check_scan(&self) -> Result<(), Error> {
        let scanned = self.scanned();
        let worlds = scanned.iter().map(|scanned| scanned.values.len()).product::<usize>();
        if scanned.len() > MOST_SCANNED || worlds > MOST_POINTS {
            let names: Vec<_> = scanned.iter().map(|scanned| key(scanned.parameter)).collect();
            let why = format!(
                "a scan of {} parameters ({}) and {worlds} points is not allowed: at most {MOST_SCANNED} parameters and \
                 {MOST_POINTS} points",
                scanned.len(),
                names.join(", ")
            );
            return Err(FitError::Conflict(why).into());
        }
        Ok(())
    }
}

/// Why finer steps are refused.
const NO_STEPS: &str = "search.finest is what the last steps look at, and no steps are taken here: they need \
                        screen.ring_rays or images, data in which the volume is a convex problem, and emission that \
                        does not change";

/// Sets draws of the geometry apart from those of the noise.
const DRAWN: u64 = 0x77a1_d5ee_d000_0001;

fn free(parameter: Parameter, settings: PriorSettings) -> Result<Free, Error> {
    let key = key(parameter);
    let prior = settings.prior(parameter.unit()).checked().within(key)?;
    if matches!(prior, Prior::Isotropic { .. }) && parameter != Parameter::Inclination {
        let why = format!(
            "{key}: isotropic is a prior of inclinations; take uniform, normal or log-normal"
        );
        return Err(FitError::Conflict(why).into());
    }
    let ([low, high], [least, most], unit) = (parameter.range(), prior.bounds(), parameter.unit());
    let outside = [least, most]
        .into_iter()
        .find(|x| x.is_finite() && !(low - 1e-9..=high + 1e-9).contains(x));
    if let Some(bad) = outside.filter(|_| !matches!(prior, Prior::LogNormal { .. })) {
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
    pub fn unknown_world(&self) -> Result<Option<UnknownWorld>, Error> {
        let priors: Vec<_> = self
            .quantities()
            .into_iter()
            .filter_map(|(parameter, quantity)| Some((parameter, quantity.prior()?)))
            .collect();
        if let Velocity::Perturbed(Perturbed { of, .. }) = &self.motion.velocity
            && flow(of).into_iter().flatten().any(|quantity| quantity.prior().is_some())
        {
            let why =
                "motion.velocity.perturbed.of: a prior is not allowed in a law that is perturbed";
            return Err(FitError::Conflict(why.to_owned()).into());
        }
        let given = self.search.clone();
        if priors.is_empty() {
            return match given {
                None => Ok(None),
                Some(_) => Err(FitError::Conflict(NOTHING.to_owned()).into()),
            };
        }
        let unknown = UnknownWorld { priors, search: given.unwrap_or_default() };
        unknown.free()?;
        unknown.check_scan()?;
        if unknown.search.finest.is_some() && !self.is_stepped() {
            return Err(FitError::Conflict(NO_STEPS.to_owned()).into());
        }
        Ok(Some(unknown))
    }

    /// Numbers of the geometry that may have a prior.
    fn quantities(&self) -> Vec<(Parameter, Quantity)> {
        let view = [
            (Parameter::Spin, self.hole.spin),
            (Parameter::Inclination, self.observer.inclination_deg),
            (Parameter::PositionAngle, self.observer.position_angle_deg),
        ];
        let flow = flow(&self.motion.velocity).into_iter().flatten().copied();
        view.into_iter().chain(Parameter::FLOW.into_iter().zip(flow)).collect()
    }

    /// The same, to be changed.
    pub(crate) fn quantities_mut(&mut self) -> Vec<(Parameter, &mut Quantity)> {
        let mut all = vec![
            (Parameter::Spin, &mut self.hole.spin),
            (Parameter::Inclination, &mut self.observer.inclination_deg),
            (Parameter::PositionAngle, &mut self.observer.position_angle_deg),
        ];
        if let Velocity::Infall { xi, beta_r, beta_phi, .. } = &mut self.motion.velocity {
            all.extend(Parameter::FLOW.into_iter().zip([xi, beta_r, beta_phi]));
        }
        all
    }

    /// Puts values drawn from the priors in their places, with the seed of the fit.
    pub(super) fn draw(&mut self) -> Result<(), Error> {
        let mut random = Pcg64::seed_from_u64(self.seed ^ DRAWN);
        for (parameter, quantity) in self.quantities_mut() {
            let Some(prior) = quantity.prior() else { continue };
            let drawn = free(parameter, prior)?.prior.quantile(random.random());
            *quantity = Quantity::Value(drawn / parameter.unit());
        }
        Ok(())
    }

    /// The key of the first number that has a prior.
    pub(super) fn first_prior(&self) -> Option<&'static str> {
        let mut all = self.quantities().into_iter();
        all.find(|(_, quantity)| quantity.prior().is_some()).map(|(parameter, _)| key(parameter))
    }

    /// Whether steps along differences of images follow a search.
    fn is_stepped(&self) -> bool {
        let are_smooth = self.screen.ring_rays.is_some()
            || self.loss.iter().all(|loss| loss.data == LossKind::Image);
        are_smooth && self.is_convex() && self.change.is_none()
    }
}

/// ξ, β_r and β_φ of a law that has them.
fn flow(law: &Velocity<Quantity>) -> Option<[&Quantity; 3]> {
    match law {
        Velocity::Infall { xi, beta_r, beta_phi, .. } => Some([xi, beta_r, beta_phi]),
        _ => None,
    }
}

/// What settings call a parameter.
pub(super) fn key(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::Spin => "hole.spin",
        Parameter::Inclination => "observer.inclination_deg",
        Parameter::PositionAngle => "observer.position_angle_deg",
        Parameter::Xi => "motion.velocity.infall.xi",
        Parameter::BetaR => "motion.velocity.infall.beta_r",
        Parameter::BetaPhi => "motion.velocity.infall.beta_phi",
    }
}

/// Why a search without anything to look for is refused.
const NOTHING: &str = "search looks for parameters that have a prior in place of a value, such as \
     `spin = { uniform = [-0.9, 0.9] }` in [hole], and there is none; hole.spin, observer.inclination_deg, \
     observer.position_angle_deg and xi, beta_r and beta_phi of motion.velocity.infall may have one";
