//! A world that is not known: it is found before the emission is fitted in it.

use super::folder::Folder;
use super::journal::Journal;
use super::{failed, world_results, world_scan};
use crate::checksum::sealed;
use crate::interrupt::{Interrupted, Keeper};
use crate::output;
use crate::progress;
use anyhow::{Context, bail};
use kerrlight_tomo::dynamics::Velocity;
use kerrlight_tomo::fit::Motion;
use kerrlight_tomo::fit::settings::{FitFile, Region, UnknownWorld};
use kerrlight_tomo::fit::setup::{self, FoundWorld, Instrument, Measured, Trial};
use kerrlight_tomo::fit::world::{Free, Parameter, Span, Spread, World};
use serde_json::{Map, Value, json};

/// What was found, in the folder of the run.
pub const FILE: &str = "world.json";

/// Settings, rays and motion in the world that was found.
pub struct Placed {
    /// Settings with its spin, inclination and power of g.
    pub file: FitFile,
    /// Rays.
    pub instrument: Instrument,
    /// Motion.
    pub motion: Motion,
    /// The data, where they are not those that were read.
    pub measured: Option<Measured>,
}

/// Finds the world of a fit, or reads it where an earlier run has found it; none if it is known.
pub fn place(
    file: &FitFile,
    instrument: &Instrument,
    measured: &Measured,
    folder: &Folder,
) -> anyhow::Result<Option<Placed>> {
    let Some(unknown) = file.unknown_world()? else { return Ok(None) };
    let path = folder.path().join(FILE);
    if !path.exists() {
        let journal = Journal::open(folder)?;
        let found = search((file, &unknown), measured, &journal, &folder.stopped())?;
        if let Some(scan) = &found.scan {
            let truth = true_world(file, measured)?;
            world_scan::write(folder, scan, truth.as_ref())?;
        }
        let results = results(file, measured, &unknown, &found)?;
        folder.file(FILE)?.write(sealed(results).as_bytes())?;
        journal.end();
    }
    // Read in any case, so that a run that goes on has the same bits.
    let results: Value = serde_json::from_str(&output::read_text(&path)?)
        .with_context(|| format!("{} is damaged: remove it to look again", path.display()))?;
    for line in world_results::lines(&results) {
        eprintln!("{line}");
    }
    let world = world_of(file, &unknown.free()?, &results)
        .with_context(|| format!("{} is damaged: remove it to look again", path.display()))?;
    Ok(Some(placed(file, &unknown, instrument, measured, &world, 0)?))
}

/// Settings, rays (those of this number near the critical curve) and motion in a world.
pub fn placed(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    measured: &Measured,
    world: &World,
    rays: u64,
) -> anyhow::Result<Placed> {
    let (instrument, motion) = setup::in_world(file, unknown, instrument, measured, world, rays)?;
    Ok(Placed { file: settled(file, unknown, world), instrument, motion, measured: None })
}

/// Names and values of the free parameters of a world, in their units.
pub fn values_of(free: &[Free], world: &World) -> Value {
    Value::Object(values(free, |_, parameter| Some(world.get(parameter))))
}

fn search(
    (file, unknown): (&FitFile, &UnknownWorld),
    measured: &Measured,
    journal: &Journal,
    stopped: &str,
) -> anyhow::Result<FoundWorld> {
    let keeper = Keeper::brief(stopped);
    let search = &unknown.search;
    let scanned = unknown.scanned();
    let (searches, each) = match scanned.is_empty() {
        true => (search.starts, search.coarse.worlds),
        false => (1, scanned.iter().map(|scanned| scanned.values.len()).product()),
    };
    let bar = progress::worlds((searches * each + search.fine.worlds) as u64);
    let mut watch = |(k, count): (usize, usize), worlds: usize, best: f64| {
        bar.set_position((k * each + worlds) as u64);
        bar.set_message(format!("search {} of {count}, least chi2/2 {best:.5e}", k + 1));
        !keeper.stopped()
    };
    let found = setup::find_world(file, measured, unknown, journal, &mut watch)
        .map_err(|error| failed::linear(error).context("world.search"))?;
    bar.finish_and_clear();
    found.ok_or_else(|| Interrupted(stopped.to_owned()).into())
}

/// The settings with what was found in place of what was assumed.
fn settled(file: &FitFile, unknown: &UnknownWorld, world: &World) -> FitFile {
    let mut file = file.clone();
    file.hole.spin = world.get(Parameter::Spin);
    file.observer.inclination_deg = world.get(Parameter::Inclination).to_degrees();
    if let Some(power) = &mut file.effects.redshift_power {
        *power = world.get(Parameter::RedshiftPower);
    }
    let follows = unknown.search.drag_is_spin;
    match &mut file.motion.velocity {
        // That of the hole that was found.
        Velocity::Keplerian { drag } if follows => *drag = None,
        Velocity::Infall { xi, beta_r, beta_phi, drag } => {
            for (number, parameter) in [xi, beta_r, beta_phi].into_iter().zip(Parameter::FLOW) {
                *number = world.get(parameter);
            }
            if follows {
                *drag = None;
            }
        }
        Velocity::Profile { angular, radial, .. } if unknown.knots > 0 => {
            let times = |values: &mut [f64], of: fn(u8) -> Parameter| {
                let factors = (0..).map(|knot| world.get(of(knot)));
                values.iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
            };
            times(angular, Parameter::Angular);
            times(radial, Parameter::Radial);
        }
        _ => {}
    }
    file
}

/// Names and values of the free parameters, in their units.
fn values(free: &[Free], of: impl Fn(usize, Parameter) -> Option<f64>) -> Map<String, Value> {
    let one = |(k, free): (usize, &Free)| {
        let value = of(k, free.parameter).map(|value| value / free.parameter.unit());
        (free.parameter.name().to_owned(), json!(value))
    };
    free.iter().enumerate().map(one).collect()
}

/// Where each free parameter lies with a probability, in its unit.
fn intervals(
    free: &[Free],
    world: &World,
    sigma: &dyn Fn(usize) -> Option<f64>,
    span: Span,
) -> Map<String, Value> {
    let one = |(k, free): (usize, &Free)| {
        let ends = free.interval(world.get(free.parameter), sigma(k), span);
        (free.parameter.name().to_owned(), json!(ends.map(|end| end / free.parameter.unit())))
    };
    free.iter().enumerate().map(one).collect()
}

fn results(
    file: &FitFile,
    measured: &Measured,
    unknown: &UnknownWorld,
    found: &FoundWorld,
) -> anyhow::Result<Value> {
    let free = unknown.free()?;
    let world = |world: &World| values(&free, |_, parameter| Some(world.get(parameter)));
    let spread = found.spread.as_ref();
    let sigma = |k: usize| spread.map(|spread| spread.sigma[k]);
    let open = |k: usize| spread.is_none_or(|spread| spread.open[k]);
    let truth = true_world(file, measured)?.map(|truth| world(&truth));
    let least = found.trials.iter().map(|trial| trial.value).fold(f64::INFINITY, f64::min);
    let trial = |trial: &Trial| {
        json!({
            "start": world(&trial.start), "end": world(&trial.end), "above_best": trial.value - least,
            "worlds": trial.worlds, "converged": trial.converged,
            "same": is_same(&free, trial, &found.trials),
        })
    };
    let trials: Vec<Value> = found.trials.iter().map(trial).collect();
    let same = trials.iter().filter(|trial| trial["same"] == true).count();
    let priors = free.iter().map(|free| {
        (free.parameter.name().to_owned(), json!(free.bounds().map(|x| x / free.parameter.unit())))
    });
    let flow = match true_world(file, measured)? {
        Some(truth) => flow_error(file, unknown, [&found.world, &truth])?,
        None => None,
    };
    Ok(json!({
        "world": world(&found.world),
        "flow_error": flow,
        "sigma": values(&free, |k, _| sigma(k)),
        "open": free.iter().enumerate().map(|(k, f)| (f.parameter.name().to_owned(), json!(open(k))))
            .collect::<Map<String, Value>>(),
        "interval_68": intervals(&free, &found.world, &sigma, Span::ONE_SIGMA),
        "interval_95": intervals(&free, &found.world, &sigma, Span::NEARLY_ALL),
        "correlation": spread.map(|spread| spread.correlation.clone()),
        "ripple": spread.map(|spread| spread.ripple),
        "bounds": priors.collect::<Map<String, Value>>(),
        "truth": truth,
        "chi2_per_datum": found.reduced_chi2,
        "noise_factor": found.noise_factor,
        "starts": trials.len(),
        "ended_at_the_best": same,
        "trials": trials,
        "scan": found.scan.as_ref().map(world_scan::json),
    }))
}

/// Radii at which velocities are compared.
const RADII: usize = 64;

/// How far a flow is from the true one: the root mean square difference of (dr/dt, r dφ/dt) over the radii of the region,
/// over the root mean square of the true velocity.
fn flow_error(
    file: &FitFile,
    unknown: &UnknownWorld,
    worlds: [&World; 2],
) -> anyhow::Result<Option<f64>> {
    let laws = worlds.map(|world| setup::motion(&settled(file, unknown, world), Vec::new()));
    let [found, truth] = laws;
    let (found, truth) = (found?.velocity, truth?.velocity);
    let [by, of] = worlds.map(|world| world.get(Parameter::Rotation));
    let Region { r_min, r_max, .. } = file.region;
    let (mut away, mut all) = (0.0, 0.0);
    for k in 0..RADII {
        let r = r_min + (r_max - r_min) * (k as f64 + 0.5) / RADII as f64;
        let [found, truth] = [(&found, by), (&truth, of)]
            .map(|(law, factor)| [factor * law.fall(r), factor * r * law.rate(r)]);
        away += (found[0] - truth[0]).powi(2) + (found[1] - truth[1]).powi(2);
        all += truth[0].powi(2) + truth[1].powi(2);
    }
    let error = (away / all).sqrt();
    Ok(error.is_finite().then_some(error))
}

/// The world of a simulation.
fn true_world(file: &FitFile, measured: &Measured) -> anyhow::Result<Option<World>> {
    Ok(measured.truth.as_ref().map(|_| setup::true_world(file)).transpose()?)
}

/// χ²/2 above the best below which a search is taken to have ended at the same world, however few the data are.
pub const ALIKE: f64 = 3.0;

/// Whether a search ended where the best one did: within 1.5 of each parameter's scale, the width of a first population,
/// and with χ²/2 above the best by no more than its scatter by chance, √(N/2) for N data.
fn is_same(free: &[Free], trial: &Trial, trials: &[Trial]) -> bool {
    let best = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
    best.is_some_and(|best| {
        let data = 2.0 * best.value / best.reduced_chi2;
        let above = trial.value - best.value;
        let is_near = |Free { parameter, .. }: &Free| {
            let apart = parameter.difference(trial.end.get(*parameter), best.end.get(*parameter));
            apart.abs() < 1.5 * parameter.scale()
        };
        above <= (0.5 * data).sqrt().max(ALIKE) && free.iter().all(is_near)
    })
}

/// What a run has found, if its world was not known.
pub fn found(folder: &Folder) -> anyhow::Result<Option<Value>> {
    let path = folder.path().join(FILE);
    if !path.exists() {
        return Ok(None);
    }
    Ok(Some(serde_json::from_str(&output::read_text(&path)?)?))
}

/// How sure a run is of the world that it has found.
pub fn spread_of(free: &[Free], world: World, results: &Value) -> anyhow::Result<Spread> {
    let number = |value: &Value, name: &str| {
        value.as_f64().with_context(|| format!("the search for the world has no {name}"))
    };
    let each = |free: &Free| -> anyhow::Result<(f64, bool)> {
        let name = free.parameter.name();
        let sigma = number(&results["sigma"][name], "errors")?;
        Ok((sigma * free.parameter.unit(), results["open"][name].as_bool().unwrap_or(true)))
    };
    let known: Vec<(f64, bool)> = free.iter().map(each).collect::<anyhow::Result<_>>()?;
    let (sigma, open): (Vec<f64>, Vec<bool>) = known.into_iter().unzip();
    let correlation = results["correlation"].as_array().map_or(&[][..], Vec::as_slice);
    let correlation: Vec<f64> =
        correlation.iter().map(|x| number(x, "correlations")).collect::<anyhow::Result<_>>()?;
    if correlation.len() != free.len() * free.len() {
        bail!("the search for the world has no correlations");
    }
    Ok(Spread { world, sigma, open, correlation, ripple: 0.0, worlds: 0 })
}

/// The world that a run has found.
pub fn world_of(file: &FitFile, free: &[Free], results: &Value) -> anyhow::Result<World> {
    free.iter().try_fold(setup::known_world(file), |world, Free { parameter, .. }| {
        let value = results["world"][parameter.name()].as_f64();
        let value = value.with_context(|| format!("there is no {}", parameter.name()))?;
        Ok(world.with(*parameter, value * parameter.unit()))
    })
}
