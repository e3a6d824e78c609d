//! What of the world is not known.

use super::world::SIMULATED;
use super::{
    Effects, FitError, FitFile, Hole, LossKind, Motion, Observer, Region, Within, WorldSearch,
};
use crate::Error;
use crate::fit::world::{Free, Parameter, Prior, Scanned};
use kerrlight_common::toml_file;
use kerrlight_render::dynamics::Velocity;
use kerrlight_render::polarization::PolarizationLaw;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// Parameters of the world that are not known, each with its prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UnknownWorld {
    /// Prior of the spin, −0.999 to 0.999.
    pub spin: Option<PriorSettings>,
    /// Prior of the inclination, 0 to 180 degrees.
    pub inclination_deg: Option<PriorSettings>,
    /// Prior of the position angle of the spin, degrees east of north, −360 to 360.
    pub position_angle_deg: Option<PriorSettings>,
    /// Prior of ξ of `motion.velocity = { infall = … }`, 0 to 1.
    pub xi: Option<PriorSettings>,
    /// Prior of its β_r, 0 to 1.
    pub beta_r: Option<PriorSettings>,
    /// Prior of its β_φ, 0 to 1.
    pub beta_phi: Option<PriorSettings>,
    /// Simulates a geometry drawn from the priors by the seed, for calibration. With `screen.ring_rays`, along 16 times as
    /// many rays near the critical curve.
    #[serde(default)]
    pub drawn: bool,
    /// How the parameters are searched for.
    #[serde(default)]
    pub search: WorldSearch,
}

/// All that a table `world` may hold.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "its schema is all that is needed of it")]
pub(super) struct WorldKeys {
    hole: Option<Hole>,
    observer: Option<Observer>,
    region: Option<Region>,
    effects: Option<Effects>,
    motion: Option<Motion>,
    polarization: Option<PolarizationLaw>,
    #[schemars(flatten)]
    unknown: UnknownWorld,
}

/// A prior, in the unit of its parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum PriorSettings {
    /// The same everywhere from the first to the second value.
    Uniform([f64; 2]),
    /// A bell curve.
    Normal {
        /// The mean.
        mean: f64,
        /// Standard deviation, above 0. A small one holds a parameter that is known.
        sigma: f64,
    },
    /// A bell curve of the logarithm.
    LogNormal {
        /// The median, above 0.
        median: f64,
        /// Standard deviation of the logarithm, above 0.
        sigma: f64,
    },
    /// Of an inclination: any direction in space between two angles.
    Isotropic([f64; 2]),
    /// The same everywhere from the first to the last value, and looked at on a grid.
    Scanned {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// Values of the grid, 2 to 1000.
        points: usize,
    },
}

impl PriorSettings {
    /// In the unit of [`World`](crate::fit::world::World).
    fn prior(self, unit: f64) -> Prior {
        match self {
            Self::Uniform([low, high]) => Prior::Uniform { low: low * unit, high: high * unit },
            Self::Isotropic([low, high]) => Prior::Isotropic { low: low * unit, high: high * unit },
            Self::Normal { mean, sigma } => {
                Prior::Normal { mean: mean * unit, sigma: sigma * unit }
            }
            Self::LogNormal { median, sigma } => Prior::LogNormal { median: median * unit, sigma },
            Self::Scanned { from, to, .. } => Prior::Uniform { low: from * unit, high: to * unit },
        }
    }
}

/// Parameters of a grid, at most: with more there is no picture of it.
const MOST_SCANNED: usize = 3;
/// Worlds of a grid, at most.
const MOST_POINTS: usize = 100_000;

impl UnknownWorld {
    fn prior(&self, parameter: Parameter) -> Option<PriorSettings> {
        match parameter {
            Parameter::Spin => self.spin,
            Parameter::Inclination => self.inclination_deg,
            Parameter::PositionAngle => self.position_angle_deg,
            Parameter::Xi => self.xi,
            Parameter::BetaR => self.beta_r,
            Parameter::BetaPhi => self.beta_phi,
        }
    }

    /// The free parameters.
    ///
    /// # Errors
    /// If there is none, or a prior is no density on possible values.
    pub fn free(&self) -> Result<Vec<Free>, Error> {
        let given = Parameter::ALL.into_iter().filter_map(|p| Some((p, self.prior(p)?)));
        let free: Vec<Free> = given.map(|(p, prior)| free(p, prior)).collect::<Result<_, _>>()?;
        if free.is_empty() {
            let names = Parameter::ALL.map(Parameter::name).join(", ");
            let why = format!(
                "world.search looks for parameters with a prior, and there is none; give one of {names}"
            );
            return Err(FitError::Conflict(why).into());
        }
        Ok(free)
    }

    /// The grid over the parameters that are scanned, empty without any.
    pub fn scanned(&self) -> Vec<Scanned> {
        let of = |parameter: Parameter| match self.prior(parameter)? {
            PriorSettings::Scanned { from, to, points } => {
                Some(Scanned::even(parameter, [from, to].map(|x| x * parameter.unit()), points))
            }
            _ => None,
        };
        Parameter::ALL.into_iter().filter_map(of).collect()
    }

    fn check_scan(&self) -> Result<(), Error> {
        let scanned = self.scanned();
        for Scanned { parameter, values } in &scanned {
            if !(2..=1000).contains(&values.len()) {
                let key = format!("world.{}.scanned.points", parameter.name());
                return Err(FitError::range(key, values.len(), "2 to 1000").into());
            }
        }
        let worlds = scanned.iter().map(|scanned| scanned.values.len()).product::<usize>();
        if scanned.len() > MOST_SCANNED || worlds > MOST_POINTS {
            let names: Vec<_> = scanned.iter().map(|scanned| scanned.parameter.name()).collect();
            let why = format!(
                "a scan of {} parameters ({}) and {worlds} worlds is not allowed: at most {MOST_SCANNED} parameters and \
                 {MOST_POINTS} worlds",
                scanned.len(),
                names.join(", ")
            );
            return Err(FitError::Conflict(why).into());
        }
        Ok(())
    }

    /// Values drawn from the priors with the seed of a fit, in the units of [`World`](crate::fit::world::World).
    fn drawn_values(&self, seed: u64) -> Result<Vec<(Parameter, f64)>, Error> {
        let mut random = Pcg64::seed_from_u64(seed ^ DRAWN);
        let mut drawn = |free: &Free| (free.parameter, free.prior.quantile(random.random()));
        Ok(self.free()?.iter().map(&mut drawn).collect())
    }

    /// The orientation on the sky that is drawn and is no setting, radians. None if nothing is drawn.
    pub(in crate::fit) fn drawn_view(&self, seed: u64) -> Result<Option<f64>, Error> {
        let all = if self.drawn { self.drawn_values(seed)? } else { Vec::new() };
        let of_view = all.iter().find(|(parameter, _)| *parameter == Parameter::PositionAngle);
        Ok(of_view.map(|(_, value)| *value))
    }

    /// Puts values drawn from the priors into settings.
    pub(super) fn draw(&self, file: &mut FitFile) -> Result<(), Error> {
        for (parameter, value) in self.drawn_values(file.seed)? {
            let value = value / parameter.unit();
            match (parameter, &mut file.motion.velocity) {
                (Parameter::Spin, _) => file.hole.spin = value,
                (Parameter::Inclination, _) => file.observer.inclination_deg = value,
                (Parameter::Xi, Velocity::Infall { xi, .. }) => *xi = value,
                (Parameter::BetaR, Velocity::Infall { beta_r, .. }) => *beta_r = value,
                (Parameter::BetaPhi, Velocity::Infall { beta_phi, .. }) => *beta_phi = value,
                _ => {}
            }
        }
        if let (true, Velocity::Keplerian { drag }) =
            (self.search.drag_is_spin, &mut file.motion.velocity)
        {
            *drag = None;
        }
        Ok(())
    }

    fn check(&self) -> Result<(), Error> {
        self.free()?;
        self.check_scan()
    }
}

/// Why finer steps are refused.
const NO_STEPS: &str = "world.search.finest is what the last steps look at, and no steps are taken here: they need \
                        screen.ring_rays or images, data in which the volume is a convex problem, and emission that \
                        does not change";

/// Sets draws of the world apart from those of the noise.
const DRAWN: u64 = 0x77a1_d5ee_d000_0001;

fn free(parameter: Parameter, settings: PriorSettings) -> Result<Free, Error> {
    let name = parameter.name();
    let prior = settings.prior(parameter.unit()).checked().within(format!("world.{name}"))?;
    if matches!(prior, Prior::Isotropic { .. }) && parameter != Parameter::Inclination {
        let why = format!(
            "world.{name}: isotropic is a prior of inclinations; take uniform, normal or log-normal"
        );
        return Err(FitError::Conflict(why).into());
    }
    let ([low, high], [least, most], unit) = (parameter.range(), prior.bounds(), parameter.unit());
    let outside = [least, most]
        .into_iter()
        .find(|x| x.is_finite() && !(low - 1e-9..=high + 1e-9).contains(x));
    if let Some(bad) = outside.filter(|_| !matches!(prior, Prior::LogNormal { .. })) {
        let allowed = format!("{} to {}", low / unit, high / unit);
        return Err(FitError::range(format!("world.{name}"), bad / unit, &allowed).into());
    }
    Ok(Free { parameter, prior })
}

/// Refuses keys that are neither simulated nor parameters.
fn check_keys(world: &Table) -> Result<(), Error> {
    let names = Parameter::ALL.map(Parameter::name);
    let known = || SIMULATED.iter().chain(&names).chain(&["search", "drawn"]);
    let Some(key) = world.keys().find(|key| !known().any(|name| name == key)) else {
        return Ok(());
    };
    let list: Vec<String> = known().map(|name| format!("`{name}`")).collect();
    let why = format!("world: unknown field `{key}`, expected one of {}", list.join(", "));
    Err(FitError::Conflict(why).into())
}

impl FitFile {
    /// What of the world is not known; none if all is.
    ///
    /// # Errors
    /// If a key of `world` is unknown, or a number out of range.
    pub fn unknown_world(&self) -> Result<Option<UnknownWorld>, Error> {
        check_keys(&self.world)?;
        let keys = self.world.iter().filter(|(key, _)| !SIMULATED.contains(&key.as_str()));
        let table: Table = keys.map(|(key, value)| (key.clone(), value.clone())).collect();
        if table.is_empty() {
            return Ok(None);
        }
        let world: UnknownWorld = toml_file::read_table(&table).within("world")?;
        world.check()?;
        let is_free = |parameter: &Parameter| world.prior(*parameter).is_some();
        let flow = Parameter::FLOW.into_iter().find(is_free);
        if let (Some(parameter), false) =
            (flow, matches!(self.motion.velocity, Velocity::Infall { .. }))
        {
            let why = format!(
                "world.{} is a parameter of `velocity = {{ infall = {{ xi, beta_r, beta_phi }} }}` in [motion], which \
                 is another law here",
                parameter.name()
            );
            return Err(FitError::Conflict(why).into());
        }
        if world.search.finest.is_some() && !self.is_stepped() {
            return Err(FitError::Conflict(NO_STEPS.to_owned()).into());
        }
        self.check_drag(&world)?;
        Ok(Some(world))
    }

    /// Whether steps along differences of images follow a search.
    fn is_stepped(&self) -> bool {
        let are_smooth = self.screen.ring_rays.is_some()
            || self.loss.iter().all(|loss| loss.data == LossKind::Image);
        are_smooth && self.is_convex() && self.change.is_none()
    }

    /// Where the flow follows the hole, it does so in the file as well: a simulation would have another flow otherwise.
    fn check_drag(&self, world: &UnknownWorld) -> Result<(), Error> {
        let Velocity::Keplerian { drag: Some(drag) } = self.motion.velocity else { return Ok(()) };
        let spin = self.hole.spin * self.motion.axis.map_or(1.0, |[.., z]| z);
        if !world.search.drag_is_spin || drag == spin {
            return Ok(());
        }
        let why = format!(
            "motion.velocity.keplerian.drag = {drag} and world.search.drag_is_spin exclude each other where the spin \
             along the axis is {spin}: leave the drag out, `velocity = {{ keplerian = {{}} }}`"
        );
        Err(FitError::Conflict(why).into())
    }
}
