//! A world that is not known: it is found before the emission is fitted in it.

use super::folder::Folder;
use super::{failed, world_scan};
use crate::checksum::sealed;
use crate::interrupt::{Interrupted, Keeper};
use crate::output;
use crate::progress;
use anyhow::Context;
use kerrlight_tomo::dynamics::Velocity;
use kerrlight_tomo::fit::Motion;
use kerrlight_tomo::fit::settings::{FitFile, UnknownWorld};
use kerrlight_tomo::fit::setup::{self, FoundWorld, Instrument, Measured, Trial};
use kerrlight_tomo::fit::world::{Free, Parameter, World};
use serde_json::{Map, Value, json};

/// What was found, in the folder of the run.
pub const FILE: &str = "world.json";

const STOPPED: &str = "stopped while the world was looked for: nothing is kept of that";

/// Settings, rays and motion in the world that was found.
pub struct Placed {
    /// Settings with its spin, inclination and power of g.
    pub file: FitFile,
    /// Rays.
    pub instrument: Instrument,
    /// Motion.
    pub motion: Motion,
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
        let found = search(file, measured, &unknown)?;
        if let Some(scan) = &found.scan {
            let truth = true_world(file, measured)?;
            world_scan::write(folder, scan, truth.as_ref())?;
        }
        let results = results(file, measured, &unknown, &found)?;
        folder.file(FILE)?.write(sealed(results).as_bytes())?;
    }
    // Read in any case, so that a run that goes on has the same bits.
    let results: Value = serde_json::from_str(&output::read_text(&path)?)
        .with_context(|| format!("{} is damaged: remove it to look again", path.display()))?;
    for line in lines(&results) {
        eprintln!("{line}");
    }
    let world = world_of(file, &unknown.free()?, &results)
        .with_context(|| format!("{} is damaged: remove it to look again", path.display()))?;
    Ok(Some(placed(file, &unknown, instrument, measured, &world)?))
}

/// Settings, rays and motion in a world.
pub fn placed(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    measured: &Measured,
    world: &World,
) -> anyhow::Result<Placed> {
    let (instrument, motion) = setup::in_world(file, unknown, instrument, measured, world)?;
    Ok(Placed { file: settled(file, unknown, world), instrument, motion })
}

/// Names and values of the free parameters of a world, in their units.
pub fn values_of(free: &[Free], world: &World) -> Value {
    Value::Object(values(free, |_, parameter| Some(world.get(parameter))))
}

fn search(
    file: &FitFile,
    measured: &Measured,
    unknown: &UnknownWorld,
) -> anyhow::Result<FoundWorld> {
    let keeper = Keeper::brief(STOPPED);
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
    let found = setup::find_world(file, measured, unknown, &mut watch)
        .map_err(|error| failed::linear(error).context("world.search"))?;
    bar.finish_and_clear();
    found.ok_or_else(|| Interrupted(STOPPED.to_owned()).into())
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

fn results(
    file: &FitFile,
    measured: &Measured,
    unknown: &UnknownWorld,
    found: &FoundWorld,
) -> anyhow::Result<Value> {
    let free = unknown.free()?;
    let world = |world: &World| values(&free, |_, parameter| Some(world.get(parameter)));
    let spread = found.spread.as_ref();
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
    Ok(json!({
        "world": world(&found.world),
        "sigma": values(&free, |k, _| spread.map(|spread| spread.sigma[k])),
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

/// The world of a simulation.
fn true_world(file: &FitFile, measured: &Measured) -> anyhow::Result<Option<World>> {
    let known = || anyhow::Ok(setup::known_world(&file.simulated()?));
    measured.truth.as_ref().map(|_| known()).transpose()
}

/// Whether a search ended where the best one did: within 1.5 of each parameter's scale, the width of a first population.
fn is_same(free: &[Free], trial: &Trial, trials: &[Trial]) -> bool {
    let best = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
    best.is_some_and(|best| {
        free.iter().all(|Free { parameter, .. }| {
            let apart = parameter.difference(trial.end.get(*parameter), best.end.get(*parameter));
            apart.abs() < 1.5 * parameter.scale()
        })
    })
}

/// χ²/N with digits that tell.
fn reduced(chi2: f64) -> String {
    if chi2 < 5e-3 { format!("{chi2:.1e}") } else { format!("{chi2:.3}") }
}

/// A line for each parameter, and one for the starts.
pub fn lines(results: &Value) -> Vec<String> {
    let Some(world) = results["world"].as_object() else { return Vec::new() };
    let mut lines: Vec<String> = world
        .iter()
        .map(|(name, value)| {
            let value = value.as_f64().unwrap_or(f64::NAN);
            let sure = match results["sigma"][name].as_f64() {
                Some(sigma) => format!("{value:.4} ± {sigma:.4}"),
                None => format!("{value:.4}, of unknown error: the data leave the world open"),
            };
            match results["truth"][name].as_f64() {
                Some(truth) => format!("world.{name} = {sure} (truth {truth:.4})"),
                None => format!("world.{name} = {sure}"),
            }
        })
        .collect();
    lines.extend(small_residuals(results).map(|said| format!("note: {said}")));
    let chi2 = reduced(results["chi2_per_datum"].as_f64().unwrap_or(f64::NAN));
    lines.push(match results["scan"]["worlds"].as_u64() {
        Some(worlds) => format!("world: a grid of {worlds} worlds was scanned; χ²/N = {chi2}"),
        None => format!(
            "world: {} of {} starts ended at the best one; χ²/N = {chi2}",
            results["ended_at_the_best"], results["starts"],
        ),
    });
    lines
}

/// What a run has found, if its world was not known.
pub fn found(folder: &Folder) -> anyhow::Result<Option<Value>> {
    let path = folder.path().join(FILE);
    if !path.exists() {
        return Ok(None);
    }
    Ok(Some(serde_json::from_str(&output::read_text(&path)?)?))
}

/// Distances from the truth, and how many standard deviations they are.
pub fn errors(results: &Value) -> Vec<(String, Value)> {
    let of = |parameter: Parameter| {
        let name = parameter.name();
        let number = |key: &str| results[key][name].as_f64();
        let (value, truth) = (number("world")?, number("truth")?);
        let unit = parameter.unit();
        let error = (parameter.difference(value * unit, truth * unit) / unit).abs();
        let (plain, suffix) = name.strip_suffix("_deg").map_or((name, ""), |name| (name, "_deg"));
        let pull = number("sigma").map(|sigma| error / sigma);
        // An unknown error is that of the prior, which holds the truth.
        let within = |reach: f64| json!(f64::from(pull.is_none_or(|pull| pull <= reach)));
        Some([
            (format!("{plain}_error{suffix}"), json!(error)),
            (format!("{plain}_pull"), json!(pull)),
            (format!("{plain}_within_68"), within(1.0)),
            (format!("{plain}_within_95"), within(1.96)),
        ])
    };
    Parameter::ALL.into_iter().filter_map(of).flatten().collect()
}

/// A sentence for each parameter, and one for the starts.
pub fn sentences(results: &Value) -> Vec<String> {
    let of = |parameter: Parameter| {
        let name = parameter.name();
        let number = |key: &str| results[key][name].as_f64();
        let value = number("world")?;
        let (words, unit) = described(parameter);
        let truth =
            number("truth").map_or(String::new(), |truth| format!(" (truth: {truth:.3}{unit})"));
        let bounds = results["bounds"][name].as_array()?;
        let [low, high] = [0, 1].map(|k| bounds.get(k).and_then(Value::as_f64).unwrap_or(f64::NAN));
        let Some(sigma) = number("sigma") else {
            return Some(format!("The {words} is {value:.3}{unit}, with an unknown error{truth}."));
        };
        let ends = [value - 2.0 * sigma, value + 2.0 * sigma];
        if ends[0] <= low && ends[1] >= high {
            return Some(format!(
                "The {words} is not constrained: {value:.3}{unit} explains the data best{truth}."
            ));
        }
        let [from, to] = [ends[0].max(low), ends[1].min(high)];
        Some(format!("The {words} is between {from:.3}{unit} and {to:.3}{unit} at 95 %{truth}."))
    };
    let mut all: Vec<String> = Parameter::ALL.into_iter().filter_map(of).collect();
    all.extend(small_residuals(results).map(|said| format!("Note that {said}.")));
    all.push(world_scan::sentence(&results["scan"]).unwrap_or_else(|| {
        format!(
            "The world was searched for from {} places; {} of the searches ended near the best one.",
            results["starts"], results["ended_at_the_best"]
        )
    }));
    all
}

/// What a parameter is called in a sentence, and its unit.
pub fn described(parameter: Parameter) -> (&'static str, &'static str) {
    match parameter {
        Parameter::Spin => ("spin", ""),
        Parameter::Inclination => ("inclination", "°"),
        Parameter::PositionAngle => ("position angle of the spin", "°"),
        Parameter::OffsetX => ("horizontal position of the hole", " M"),
        Parameter::OffsetY => ("vertical position of the hole", " M"),
        Parameter::Mass => ("mass over the assumed one", ""),
        Parameter::Rotation => ("angular velocity over the assumed one", ""),
        Parameter::RedshiftPower => ("power of the redshift factor", ""),
        Parameter::Xi => ("angular momentum over that of circular orbits", ""),
        Parameter::BetaR => ("part of the radial velocity that is not free fall", ""),
        Parameter::BetaPhi => ("part of the angular velocity that is not free fall", ""),
    }
}

/// What errors of the world mean where residuals are much smaller than the errors of the data.
fn small_residuals(results: &Value) -> Option<String> {
    let factor = results["noise_factor"].as_f64().filter(|factor| *factor < 1.0)?;
    Some(format!(
        "residuals are much smaller than the errors of the data; the world was searched for with errors {factor:.1e} \
         times as large"
    ))
}

/// The world that a run has found.
pub fn world_of(file: &FitFile, free: &[Free], results: &Value) -> anyhow::Result<World> {
    free.iter().try_fold(setup::known_world(file), |world, Free { parameter, .. }| {
        let value = results["world"][parameter.name()].as_f64();
        let value = value.with_context(|| format!("there is no {}", parameter.name()))?;
        Ok(world.with(*parameter, value * parameter.unit()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found() -> Value {
        json!({
            "world": {"spin": 0.91, "inclination_deg": 59.0, "position_angle_deg": 179.0},
            "sigma": {"spin": 0.6, "inclination_deg": 0.5, "position_angle_deg": null},
            "truth": {"spin": 0.9, "inclination_deg": 60.0, "position_angle_deg": -179.0},
            "bounds": {
                "spin": [-0.2, 0.95], "inclination_deg": [0.0, 180.0], "position_angle_deg": [-180.0, 180.0],
            },
            "starts": 4, "ended_at_the_best": 3, "chi2_per_datum": 1.02,
        })
    }

    #[test]
    fn exact_errors_go_the_short_way_about_a_circle() {
        let errors: Map<String, Value> = errors(&found()).into_iter().collect();
        let number = |key: &str| errors[key].as_f64().unwrap();
        assert!((number("position_angle_error_deg") - 2.0).abs() < 1e-9);
        assert!((number("inclination_pull") - 2.0).abs() < 1e-9);
        assert!((number("spin_error") - 0.01).abs() < 1e-12);
        assert!(errors["position_angle_pull"].is_null());
    }

    #[test]
    fn exact_sentences_say_what_is_known() {
        let said = sentences(&found());
        assert_eq!(
            said[0],
            "The spin is not constrained: 0.910 explains the data best (truth: 0.900)."
        );
        assert_eq!(
            said[1],
            "The inclination is between 58.000° and 60.000° at 95 % (truth: 60.000°)."
        );
        assert!(said[2].contains("with an unknown error"), "{}", said[2]);
        assert!(said[3].contains("from 4 places; 3 of the searches"), "{}", said[3]);
        assert!(lines(&found())[3].contains("3 of 4 starts"));
    }
}
