//! A geometry that is not known: it is found before the emission is fitted in it.

use super::folder::Folder;
use super::geometry_results;
use crate::checksum::sealed;
use anyhow::{Context, bail};
use kerrlight_tomo::fit::geometry::{
    Free, Geometry, ModelError, ModelErrors, Parameter, Span, Spread,
};
use kerrlight_tomo::fit::settings::{FitFile, Region, UnknownGeometry};
use kerrlight_tomo::fit::setup::{self, FitData, FoundGeometry, Resolution, Trial};
use kerrlight_tomo::recovery::{Choice, Problem, settled};
use serde_json::{Map, Value, json};

/// What was found, in the folder of the run.
pub const FILE: &str = "geometry.json";

/// Keeps what a search has found.
pub fn write(
    folder: &Folder,
    problem: &Problem,
    unknown: &UnknownGeometry,
    found: &FoundGeometry,
) -> anyhow::Result<()> {
    let Problem { settings, measured, .. } = problem;
    let results = results(settings, measured, unknown, found)?;
    folder.file(FILE)?.write(sealed(results).as_bytes())
}

/// The geometry that a run has found, which is told; none if it has not looked.
pub fn chosen(folder: &Folder, file: &FitFile) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found(FILE)? else { return Ok(None) };
    let Some(unknown) = file.unknown_geometry()? else { return Ok(None) };
    geometry_results::lines(&results).iter().for_each(|line| eprintln!("{line}"));
    let geometry =
        geometry_of(file, &unknown.free, &results).with_context(|| folder.damaged(FILE))?;
    Ok(Some(Choice::Geometry { geometry, rays: rays_of(&results) }))
}

/// Geometries of one of the coarse searches at most.
pub fn each(file: &FitFile) -> anyhow::Result<usize> {
    Ok(searches(file)?[1])
}

/// Geometries of all searches at most.
pub fn planned(file: &FitFile) -> anyhow::Result<u64> {
    let [searches, each, fine] = searches(file)?;
    Ok((searches * each + fine) as u64)
}

/// Coarse searches, geometries of each, and geometries of the fine one.
fn searches(file: &FitFile) -> anyhow::Result<[usize; 3]> {
    let Some(unknown) = file.unknown_geometry()? else { return Ok([0; 3]) };
    let search = &unknown.search;
    Ok([search.starts, search.coarse.trials, search.fine.trials])
}

/// Names and values of the free parameters of a geometry, in their units.
pub fn values_of(free: &[Free], geometry: &Geometry) -> Value {
    Value::Object(values(free, |_, parameter| Some(geometry.get(parameter))))
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
    geometry: &Geometry,
    sigma: &dyn Fn(usize) -> Option<f64>,
    span: Span,
) -> Map<String, Value> {
    let one = |(k, free): (usize, &Free)| {
        let ends = free.interval(geometry.get(free.parameter), sigma(k), span);
        (free.parameter.name().to_owned(), json!(ends.map(|end| end / free.parameter.unit())))
    };
    free.iter().enumerate().map(one).collect()
}

fn results(
    file: &FitFile,
    measured: &FitData,
    unknown: &UnknownGeometry,
    found: &FoundGeometry,
) -> anyhow::Result<Value> {
    let free = &unknown.free;
    let geometry = |geometry: &Geometry| values(free, |_, parameter| Some(geometry.get(parameter)));
    let spread = found.spread.as_ref();
    let sigma = |k: usize| spread.map(|spread| spread.sigma[k]);
    let open = |k: usize| spread.is_none_or(|spread| spread.open[k]);
    let truth = true_geometry(file, measured)?.map(|truth| geometry(&truth));
    let least = found.trials.iter().map(|trial| trial.value).fold(f64::INFINITY, f64::min);
    let trial = |trial: &Trial| {
        json!({
            "start": geometry(&trial.start), "end": geometry(&trial.end), "above_best": trial.value - least,
            "trials": trial.trials, "converged": has_converged(free, trial, &sigma),
            "same": is_same(free, trial, (&found.trials, &sigma)),
        })
    };
    let trials: Vec<Value> = found.trials.iter().map(trial).collect();
    let same = trials.iter().filter(|trial| trial["same"] == true).count();
    let priors = free.iter().map(|free| {
        (free.parameter.name().to_owned(), json!(free.bounds().map(|x| x / free.parameter.unit())))
    });
    let flow = match true_geometry(file, measured)? {
        Some(truth) => flow_error(file, [&found.geometry, &truth])?,
        None => None,
    };
    Ok(json!({
        "geometry": geometry(&found.geometry),
        "flow_error": flow,
        "sigma": values(free, |k, _| sigma(k)),
        "open": free.iter().enumerate().map(|(k, f)| (f.parameter.name().to_owned(), json!(open(k))))
            .collect::<Map<String, Value>>(),
        "interval_68": intervals(free, &found.geometry, &sigma, Span::ONE_SIGMA),
        "interval_95": intervals(free, &found.geometry, &sigma, Span::NEARLY_ALL),
        "model_error": spread.map(|spread| own(free, spread)),
        "model_error_left_out": spread.and_then(|spread| spread.own.left_out),
        "correlation": spread.map(|spread| spread.correlation.clone()),
        "ripple": spread.map(|spread| spread.ripple),
        "bounds": priors.collect::<Map<String, Value>>(),
        "truth": truth,
        "chi2_per_datum": found.reduced_chi2,
        "noise_factor": found.noise_factor,
        "resolution": resolution(found.resolution),
        "starts": trials.len(),
        "ended_at_the_best": same,
        "trials": trials,
    }))
}

/// What the best geometry was looked at through.
fn resolution(Resolution { nodes, pixels, rays, panels }: Resolution) -> Value {
    json!({"nodes": nodes, "pixels": pixels, "rays_per_pixel": rays * rays, "panels": panels})
}

/// Rays along each side of a pixel that the best geometry was looked at through.
pub fn rays_of(results: &Value) -> usize {
    results["resolution"]["rays_per_pixel"].as_u64().map_or(1, |rays| rays.isqrt() as usize)
}

/// Radii at which velocities are compared.
const RADII: usize = 64;

/// How far a flow is from the true one: the root mean square difference of (dr/dt, r dφ/dt) over the radii of the region,
/// over the root mean square of the true velocity.
fn flow_error(file: &FitFile, trials: [&Geometry; 2]) -> anyhow::Result<Option<f64>> {
    let laws = trials.map(|geometry| setup::motion(&settled(file, geometry), Vec::new()));
    let [found, truth] = laws;
    let (found, truth) = (found?.velocity, truth?.velocity);
    let Region { r_min, r_max, .. } = file.region;
    let (mut away, mut all) = (0.0, 0.0);
    for k in 0..RADII {
        let r = r_min + (r_max - r_min) * (k as f64 + 0.5) / RADII as f64;
        let [found, truth] = [&found, &truth].map(|law| [law.fall(r), r * law.rate(r)]);
        away += (found[0] - truth[0]).powi(2) + (found[1] - truth[1]).powi(2);
        all += truth[0].powi(2) + truth[1].powi(2);
    }
    let error = (away / all).sqrt();
    Ok(error.is_finite().then_some(error))
}

/// The geometry of a simulation.
fn true_geometry(file: &FitFile, measured: &FitData) -> anyhow::Result<Option<Geometry>> {
    Ok(measured.truth.as_ref().map(|_| setup::true_geometry(file)).transpose()?)
}

/// By what the model itself may have moved each free parameter, part by part, in its unit.
fn own(free: &[Free], spread: &Spread) -> Map<String, Value> {
    let part = |error: &ModelError| {
        let variance = |k: usize| error.covariance.get(k * (free.len() + 1));
        let moved = values(free, |k, _| variance(k).map(|variance| variance.sqrt()));
        (error.source.to_owned(), Value::Object(moved))
    };
    spread.own.known.iter().map(part).collect()
}

/// Whether what a search expects farther on is no farther away than a standard deviation of every parameter.
fn has_converged(free: &[Free], trial: &Trial, sigma: &dyn Fn(usize) -> Option<f64>) -> bool {
    trial.further.is_some_and(|further| {
        free.iter().enumerate().all(|(k, Free { parameter, .. })| {
            let apart = parameter.difference(further.get(*parameter), trial.end.get(*parameter));
            sigma(k).is_some_and(|sigma| apart.abs() <= sigma)
        })
    })
}

/// Whether a search ended where the best one did: within the 95 % interval about it, or at a geometry that is as probable and
/// nearer than 1.5 of each parameter's scale, the width of a first population.
fn is_same(
    free: &[Free],
    trial: &Trial,
    (trials, sigma): (&[Trial], &dyn Fn(usize) -> Option<f64>),
) -> bool {
    let best = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
    best.is_some_and(|best| {
        // What chance makes of χ²/2 of as many data.
        let chance = (best.value / best.reduced_chi2).sqrt().max(geometry_results::ALIKE);
        let above = trial.value - best.value;
        let is_near = |(k, Free { parameter, .. }): (usize, &Free)| {
            let apart = parameter.difference(trial.end.get(*parameter), best.end.get(*parameter));
            let interval = sigma(k).map_or(0.0, |sigma| Span::NEARLY_ALL.deviations * sigma);
            let is_as_probable = above < geometry_results::ALIKE;
            let far = if is_as_probable { 1.5 * parameter.scale() } else { 0.0 };
            apart.abs() <= interval.max(far)
        };
        above <= chance && free.iter().enumerate().all(is_near)
    })
}

/// How sure a run is of the geometry that it has found.
pub fn spread_of(free: &[Free], geometry: Geometry, results: &Value) -> anyhow::Result<Spread> {
    let number = |value: &Value, name: &str| {
        value.as_f64().with_context(|| format!("the search for the geometry has no {name}"))
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
        bail!("the search for the geometry has no correlations");
    }
    Ok(Spread {
        geometry,
        sigma,
        open,
        correlation,
        ripple: 0.0,
        trials: 0,
        own: ModelErrors::default(),
    })
}

/// The geometry that a run has found.
pub fn geometry_of(file: &FitFile, free: &[Free], results: &Value) -> anyhow::Result<Geometry> {
    free.iter().try_fold(setup::known_geometry(file), |geometry, Free { parameter, .. }| {
        let value = results["geometry"][parameter.name()].as_f64();
        let value = value.with_context(|| format!("there is no {}", parameter.name()))?;
        Ok(geometry.with(*parameter, value * parameter.unit()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::fit::geometry::Prior;

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
            let same = is_same(&free, &trials[1], (&trials, &|_| Some(0.01)));
            assert_eq!(same, expected, "{spin} {above}");
            assert!(is_same(&free, &trials[0], (&trials, &|_| None)));
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
