//! Geometries that are weighed by the light curve of a flare in an orbital band, before the emission is fitted.

use super::folder::Folder;
use crate::checksum::sealed;
use anyhow::Context;
use kerrlight_tomo::fit::band::Interval;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::{BandGeometry, BandScan};
use kerrlight_tomo::recovery::{Choice, Problem};
use serde_json::{Value, json};

/// What was found, in the folder of the run.
pub const FILE: &str = "band.json";

/// Bins of periods.
const BINS: usize = 24;

/// Keeps the geometries that were weighed.
pub fn write(folder: &Folder, problem: &Problem, scan: &BandScan) -> anyhow::Result<()> {
    folder.file(FILE)?.write(sealed(results(scan, &problem.settings)?).as_bytes())
}

/// The geometry that a run has found, which is told; none if it has not looked.
pub fn chosen(folder: &Folder) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found(FILE)? else { return Ok(None) };
    let damaged = || folder.damaged(FILE);
    sentences(&results).iter().for_each(|line| eprintln!("{line}"));
    let best = |key: &str| results[key]["best"].as_f64().with_context(damaged);
    let background = match &results["background_jy"] {
        Value::Null => None,
        values => Some(serde_json::from_value(values.clone()).with_context(damaged)?),
    };
    Ok(Some(Choice::Band {
        inclination_deg: best("inclination_deg")?,
        position_angle_deg: best("position_angle_deg")?,
        rotation_factor: best("rotation_factor")?,
        background,
    }))
}

/// Shares of the probability of values, in their order.
fn shares(geometries: &[BandGeometry], of: fn(&BandGeometry) -> f64) -> Vec<[f64; 2]> {
    let most =
        geometries.iter().map(|geometry| geometry.ln_posterior).fold(f64::NEG_INFINITY, f64::max);
    let mut all: Vec<[f64; 2]> = Vec::new();
    for geometry in geometries {
        let share = (geometry.ln_posterior - most).exp();
        match all.iter_mut().find(|[value, _]| *value == of(geometry)) {
            Some([_, sum]) => *sum += share,
            None => all.push([of(geometry), share]),
        }
    }
    normalised(all)
}

fn normalised(mut all: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let sum: f64 = all.iter().map(|[_, share]| share).sum();
    all.iter_mut().for_each(|[_, share]| *share /= sum);
    all
}

/// How probable each radius is in each geometry, up to a factor.
fn orbits(scan: &BandScan) -> Vec<Vec<f64>> {
    let all = scan.geometries.iter().flat_map(|geometry| geometry.by_radius.iter().copied());
    let most = all.fold(f64::NEG_INFINITY, f64::max);
    let of = |geometry: &BandGeometry| {
        let prior = geometry.inclination_deg.to_radians().sin().max(1e-6);
        geometry.by_radius.iter().map(|ln| (ln - most).exp() * prior).collect()
    };
    scan.geometries.iter().map(of).collect()
}

/// Shares of the radii of all geometries.
fn radii(scan: &BandScan) -> Vec<[f64; 2]> {
    let orbits = orbits(scan);
    let share = |k: usize| orbits.iter().map(|of_geometry| of_geometry[k]).sum::<f64>();
    normalised(scan.radii.iter().enumerate().map(|(k, radius)| [*radius, share(k)]).collect())
}

/// Shares of the periods of the orbits of all geometries, minutes; where matter stands still there is none.
fn periods(scan: &BandScan) -> Vec<[f64; 2]> {
    let shares = orbits(scan).into_iter().flatten();
    let all = scan.periods_min.iter().flatten().copied().zip(shares);
    let moving = all.filter(|(period, _)| period.is_finite());
    normalised(moving.map(|(period, share)| [period, share]).collect())
}

/// Shares in so many bins of the same width, each at its middle.
fn binned(shares: &[[f64; 2]], bins: usize) -> Vec<[f64; 2]> {
    let (Some([low, _]), Some([high, _])) = (shares.first(), shares.last()) else {
        return Vec::new();
    };
    let width = (high - low).max(1e-9 * high.abs()) / bins as f64;
    let mut all: Vec<[f64; 2]> = (0..bins).map(|k| [low + (k as f64 + 0.5) * width, 0.0]).collect();
    for [value, share] in shares {
        all[(((value - low) / width) as usize).min(bins - 1)][1] += share;
    }
    all
}

/// The probability that matter turns clockwise on the sky: the axis is that of the hole, right-handed about
/// `motion.axis`.
fn clockwise(scan: &BandScan, axis_z: f64) -> f64 {
    let towards = |geometry: &BandGeometry| {
        geometry.rotation_factor * geometry.inclination_deg.to_radians().cos()
    };
    // Seen edge-on there is no sense; standing matter has none.
    let share = |towards: f64| match towards * axis_z {
        x if x.abs() < 1e-9 => 0.5,
        x => f64::from(u8::from(x < 0.0)),
    };
    shares(&scan.geometries, towards).iter().map(|[of, probability]| share(*of) * probability).sum()
}

/// The value below which a part of the probability lies, each share spread evenly half way to its neighbours.
fn quantile(shares: &[[f64; 2]], part: f64) -> f64 {
    let edge = |k: usize| match (k.checked_sub(1).map(|k| shares[k][0]), shares.get(k)) {
        (Some(before), Some([after, _])) => 0.5 * (before + after),
        (None, Some([first, _])) => *first,
        (before, None) => before.unwrap_or(f64::NAN),
    };
    let mut below = 0.0;
    for (k, [_, share]) in shares.iter().enumerate() {
        if below + share >= part && *share > 0.0 {
            return edge(k) + (edge(k + 1) - edge(k)) * ((part - below) / share).clamp(0.0, 1.0);
        }
        below += share;
    }
    edge(shares.len())
}

/// Median and 95 % interval.
fn interval(shares: &[[f64; 2]], best: Option<f64>) -> Value {
    let [low, median, high] = [0.025, 0.5, 0.975].map(|part| quantile(shares, part));
    json!({"best": best, "median": median, "low": low, "high": high})
}

/// An interval of azimuths in degrees, its median in [0°, 360°).
fn azimuth(Interval { median, low, high }: Interval) -> Value {
    let [median, low, high] = [median, low, high].map(f64::to_degrees);
    let turns = median.rem_euclid(360.0) - median;
    json!({"median": median + turns, "low": low + turns, "high": high + turns})
}

fn results(scan: &BandScan, file: &FitFile) -> anyhow::Result<Value> {
    let best = &scan.geometries[scan.best];
    let inclinations = shares(&scan.geometries, |geometry| geometry.inclination_deg);
    let probabilities = |of: fn(&BandGeometry) -> f64, best: f64| json!({"best": best, "probabilities": shares(&scan.geometries, of)});
    let row = |geometry: &BandGeometry| {
        let BandGeometry { inclination_deg, rotation_factor, position_angle_deg, .. } = geometry;
        let ln = geometry.ln_posterior - best.ln_posterior;
        json!([inclination_deg, rotation_factor, position_angle_deg, ln])
    };
    let truth = match file.simulation {
        Some(_) => Some(file.simulated()?.observer.inclination_deg.value()),
        None => None,
    };
    let band = best.band;
    Ok(json!({
        "inclination_deg": interval(&inclinations, Some(best.inclination_deg)),
        "inclinations": inclinations,
        "rotation_factor": probabilities(|geometry| geometry.rotation_factor, best.rotation_factor),
        "position_angle_deg": probabilities(|geometry| geometry.position_angle_deg, best.position_angle_deg),
        "clockwise": clockwise(scan, file.motion.axis.map_or(1.0, |axis| axis[2])),
        "radius": interval(&radii(scan), Some(band.radius)),
        "radii": radii(scan),
        "band": {
            "radius": band.radius, "width": band.width, "height": band.height, "length": band.length,
            "power": band.power, "mean": band.mean,
        },
        "emission_radius": {
            "median": scan.radius.median, "low": scan.radius.low, "high": scan.radius.high,
        },
        "azimuth_deg": azimuth(scan.azimuth),
        "period_min": interval(&periods(scan), None),
        "periods": binned(&periods(scan), BINS),
        "ln_bayes_factor": scan.ln_bayes_factor,
        "background": scan.background.is_some().then(|| json!({
            "constant_jy": band.background.constant,
            "variation_jy": band.background.variation,
            "correlation_min": band.background.minutes,
            "matern": band.background.roughness,
        })),
        "background_jy": scan.background,
        "validation_chi2_per_datum": scan.validation,
        "truth": {"inclination_deg": truth},
        "geometries": scan.geometries.iter().map(row).collect::<Vec<_>>(),
    }))
}

/// Numbers for tables: of the 95 % interval, of the band, and the probability that matter turns as the law says.
pub fn numbers(results: &Value) -> Vec<(&'static str, Value)> {
    let forward = forward(results);
    let inclination = &results["inclination_deg"];
    vec![
        ("band_inclination_deg", inclination["median"].clone()),
        ("band_inclination_low_deg", inclination["low"].clone()),
        ("band_inclination_high_deg", inclination["high"].clone()),
        ("band_radius", results["emission_radius"]["median"].clone()),
        ("band_radius_low", results["emission_radius"]["low"].clone()),
        ("band_radius_high", results["emission_radius"]["high"].clone()),
        ("band_azimuth_deg", results["azimuth_deg"]["median"].clone()),
        ("band_azimuth_low_deg", results["azimuth_deg"]["low"].clone()),
        ("band_azimuth_high_deg", results["azimuth_deg"]["high"].clone()),
        ("band_period_min", results["period_min"]["median"].clone()),
        ("band_period_low_min", results["period_min"]["low"].clone()),
        ("band_period_high_min", results["period_min"]["high"].clone()),
        ("band_ln_bayes_factor", results["ln_bayes_factor"].clone()),
        ("band_forward", json!(forward)),
        ("band_clockwise", results["clockwise"].clone()),
        ("band_validation", results["validation_chi2_per_datum"].clone()),
    ]
}

/// The probability that matter turns as the law says.
fn forward(results: &Value) -> Option<f64> {
    let share = |pair: &Value| match pair[0].as_f64() {
        Some(factor) if factor > 0.0 => pair[1].as_f64().unwrap_or(0.0),
        _ => 0.0,
    };
    let all = results["rotation_factor"]["probabilities"].as_array()?;
    Some(all.iter().map(share).sum())
}

/// Whether a flare is seen before a background.
fn flare(ln: f64) -> String {
    let factor = match ln.abs() {
        size if size < 5.0 => format!("{:.2}", ln.exp()),
        size if size < 30.0 => format!("{:.1e}", ln.exp()),
        _ => format!("e^{ln:.0}"),
    };
    let what = match ln {
        ln if ln > SEEN => "The data ask for a flare that orbits",
        ln if ln < -SEEN => "The data speak against a flare that orbits",
        _ => "The data do not tell whether a flare orbits",
    };
    let then = if ln > SEEN { "" } else { " What follows holds if there is one." };
    format!(
        "{what}: with one, they are {factor} times as probable as with the background alone.{then}"
    )
}

/// Whether data ask for a flare beside a background; none where there is no background, and nothing to ask.
pub fn is_seen(results: &Value) -> Option<bool> {
    let ln = results["ln_bayes_factor"].as_f64().filter(|_| results["background"].is_object())?;
    Some(ln > SEEN)
}

/// ln of 20, above which a Bayes factor is called strong (Kass & Raftery 1995).
const SEEN: f64 = 3.0;

/// From this width on an interval of azimuths is the whole circle, degrees: 95 % of it.
const ROUND: f64 = 0.95 * 360.0 - 5.0;

/// Where the middle of a flare is, from median and interval of its azimuth in degrees.
fn place_of([median, low, high]: [f64; 3]) -> String {
    if high - low > ROUND {
        return "its middle may be at any azimuth".to_owned();
    }
    format!(
        "its middle is at an azimuth of {median:.0}° (−{:.0}°, +{:.0}°)",
        median - low,
        high - median
    )
}

/// Radii that were asked for, M.
fn radii_of(results: &Value) -> Vec<f64> {
    let all = results["radii"].as_array().into_iter().flatten();
    all.filter_map(|pair| pair[0].as_f64()).collect()
}

/// Part of the radii that were asked for: a 95 % interval that is wider says no more than the prior.
const OPEN: f64 = 0.75;

/// Radius (M) and period (minutes) of an orbit, each as median and interval; a radius that may be almost any of those that were asked for
/// is not constrained, nor is the period.
fn orbit(
    [radius, inner, outer]: [f64; 3],
    [period, short, long]: [f64; 3],
    asked: &[f64],
) -> String {
    let inner = inner.max(0.0);
    let (Some(first), Some(last)) = (asked.first(), asked.last()) else { return String::new() };
    if outer - inner > OPEN * (last - first) && asked.len() > 1 {
        return format!(
            "Radius and period of the orbit are not constrained: {inner:.1} to {outer:.1} M and {short:.0} to {long:.0} minutes at 95 %."
        );
    }
    format!(
        "The flare orbits at {radius:.1} M ({inner:.1} to {outer:.1} at 95 %), with a period of {period:.0} minutes ({short:.0} to {long:.0})."
    )
}

/// What was found, in sentences.
pub fn sentences(results: &Value) -> Vec<String> {
    let number = |of: &Value| of.as_f64().unwrap_or(f64::NAN);
    let of = |key: &str, part: &str| number(&results[key][part]);
    let truth = results["truth"]["inclination_deg"].as_f64();
    let truth = truth.map_or(String::new(), |truth| format!(" (truth: {truth:.1}°)"));
    let mut all = Vec::new();
    if let (Some(ln), true) =
        (results["ln_bayes_factor"].as_f64(), results["background"].is_object())
    {
        all.push(flare(ln));
    }
    all.extend([
        format!(
            "The inclination is between {:.1}° and {:.1}° at 95 %, with a median of {:.1}°{truth}.",
            of("inclination_deg", "low"),
            of("inclination_deg", "high"),
            of("inclination_deg", "median")
        ),
        orbit(
            ["median", "low", "high"].map(|part| of("emission_radius", part)),
            ["median", "low", "high"].map(|part| of("period_min", part)),
            &radii_of(results),
        ),
        format!(
            "At the reference time {}.",
            place_of(["median", "low", "high"].map(|part| of("azimuth_deg", part)))
        ),
    ]);
    let turns = results["rotation_factor"]["probabilities"].as_array();
    if turns.is_some_and(|turns| turns.len() > 1) {
        let best = of("rotation_factor", "best");
        let forward = forward(results).unwrap_or(f64::NAN);
        all.push(format!(
            "Most probably it turns {best:.2} times as fast as the law of motion says, in the law's sense with a probability of {forward:.3}."
        ));
        if let Some(clockwise) = results["clockwise"].as_f64() {
            all.push(format!(
                "On the sky it turns clockwise with a probability of {clockwise:.3}, anticlockwise with {:.3}.",
                1.0 - clockwise
            ));
        }
    }
    if let Some(validation) = results["validation_chi2_per_datum"].as_f64() {
        all.push(format!(
            "Samples that were not fitted have a χ² of {validation:.2} per datum with the errors that are expected of them."
        ));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_azimuths_go_round() {
        assert_eq!(place_of([273.0, 93.0, 453.0]), "its middle may be at any azimuth");
        let near = place_of([350.0, 330.0, 375.0]);
        assert_eq!(near, "its middle is at an azimuth of 350° (−20°, +25°)");
    }

    #[test]
    fn exact_a_radius_as_wide_as_its_prior_is_not_constrained() {
        let asked: Vec<f64> = (0..=20).map(|k| 4.0 + f64::from(k)).collect();
        let open = orbit([11.0, 0.0, 22.0], [60.0, 20.0, 150.0], &asked);
        assert!(open.contains("not constrained: 0.0 to 22.0 M and 20 to 150 minutes"), "{open}");
        let known = orbit([11.0, 9.0, 13.0], [60.0, 50.0, 70.0], &asked);
        assert!(known.starts_with("The flare orbits at 11.0 M (9.0 to 13.0 at 95 %), with"));
        let of = |ln: f64| json!({"ln_bayes_factor": ln, "background": {}});
        assert_eq!([0.5f64.ln(), 4.0].map(|ln| is_seen(&of(ln))), [Some(false), Some(true)]);
        assert_eq!(is_seen(&Value::Null), None);
    }

    #[test]
    fn exact_bins_hold_all_shares() {
        let bins = binned(&[[1.0, 0.2], [1.5, 0.3], [3.0, 0.5]], 2);
        assert_eq!(bins, [[1.5, 0.5], [2.5, 0.5]]);
        assert_eq!(binned(&[[2.0, 1.0]], 3)[0][1], 1.0);
        assert!(binned(&[], 3).is_empty());
    }

    /// Quantiles of equal shares are those of a straight line.
    #[test]
    fn exact_quantiles_of_shares() {
        let shares: Vec<[f64; 2]> = (0..11).map(|k| [f64::from(k), 1.0]).collect();
        let shares = normalised(shares);
        assert!((quantile(&shares, 0.5) - 5.0).abs() < 1e-12);
        assert!(
            (quantile(&shares, 0.0)).abs() < 1e-12 && (quantile(&shares, 1.0) - 10.0).abs() < 1e-9
        );
        let one = normalised(vec![[3.0, 0.0], [4.0, 1.0], [5.0, 0.0]]);
        assert!(
            (quantile(&one, 0.5) - 4.0).abs() < 1e-12 && (quantile(&one, 0.1) - 3.6).abs() < 1e-12
        );
    }
}
