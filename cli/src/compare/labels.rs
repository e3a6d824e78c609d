//! Names of results, levels and numbers, and how they are written.

use kerrlight_tomo::recovery::results::HeldOutResults;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// A number with so many digits behind the point, or in powers of ten where none of them would tell.
pub fn number(x: f64, digits: usize) -> String {
    // Below five units of the last digit, rounding would change a number by more than a tenth.
    let tells = x == 0.0 || x.abs() >= 5.0 * 10f64.powi(-(digits as i32));
    if tells { format!("{x:.digits$}") } else { format!("{x:.1e}") }
}

/// Results that are shown: their names in results.json, what they are called, their units and digits.
pub const RESULTS: [(&str, &str, &str, usize); 80] = [
    ("psnr_db", "PSNR", "dB", 2),
    ("psnr_inside_db", "PSNR inside the region", "dB", 2),
    ("psnr_over_time_db", "PSNR over time", "dB", 2),
    ("nrmse", "relative error", "", 4),
    ("nrmse_over_time", "relative error over time", "", 4),
    ("correlation", "correlation", "", 4),
    ("axis_dot_truth", "axis · true axis", "", 4),
    ("spin_error", "error of the spin", "M", 4),
    ("spin_pull", "error of the spin over its standard deviation", "", 2),
    ("inclination_error_deg", "error of the inclination", "°", 3),
    ("inclination_pull", "error of the inclination over its standard deviation", "", 2),
    ("position_angle_error_deg", "error of the position angle", "°", 3),
    ("position_angle_pull", "error of the position angle over its standard deviation", "", 2),
    ("spin_within_68", "spin within its 68 % interval", "", 2),
    ("spin_within_95", "spin within its 95 % interval", "", 2),
    ("inclination_within_68", "inclination within its 68 % interval", "", 2),
    ("inclination_within_95", "inclination within its 95 % interval", "", 2),
    ("position_angle_within_68", "position angle within its 68 % interval", "", 2),
    ("position_angle_within_95", "position angle within its 95 % interval", "", 2),
    ("xi_error", "error of ξ", "", 4),
    ("xi_pull", "error of ξ over its standard deviation", "", 2),
    ("xi_within_68", "ξ within its 68 % interval", "", 2),
    ("xi_within_95", "ξ within its 95 % interval", "", 2),
    ("inclination_drawn_within_68", "inclination within the middle 68 % of the draws", "", 2),
    ("inclination_drawn_within_95", "inclination within the middle 95 % of the draws", "", 2),
    ("position_angle_drawn_within_68", "position angle within the middle 68 % of the draws", "", 2),
    ("position_angle_drawn_within_95", "position angle within the middle 95 % of the draws", "", 2),
    ("xi_drawn_within_68", "ξ within the middle 68 % of the draws", "", 2),
    ("xi_drawn_within_95", "ξ within the middle 95 % of the draws", "", 2),
    ("beta_r_error", "error of β_r", "", 4),
    ("beta_phi_error", "error of β_φ", "", 4),
    ("flow_error", "relative error of the velocity", "", 3),
    ("random_nodes_within_68", "random nodes within the middle 68 % of the draws", "", 3),
    ("random_nodes_within_95", "random nodes within the middle 95 % of the draws", "", 3),
    ("bright_nodes_within_68", "bright nodes within the middle 68 % of the draws", "", 3),
    ("bright_nodes_within_95", "bright nodes within the middle 95 % of the draws", "", 3),
    (
        "feature_radius_within_68",
        "radius of the brightest feature within the middle 68 % of the draws",
        "",
        3,
    ),
    (
        "feature_radius_within_95",
        "radius of the brightest feature within the middle 95 % of the draws",
        "",
        3,
    ),
    ("band_inclination_deg", "median of the inclination", "°", 1),
    ("band_inclination_low_deg", "2.5 % quantile of the inclination", "°", 1),
    ("band_inclination_high_deg", "97.5 % quantile of the inclination", "°", 1),
    ("band_radius", "radius of the flare", "M", 2),
    ("band_radius_low", "2.5 % quantile of the radius", "M", 2),
    ("band_radius_high", "97.5 % quantile of the radius", "M", 2),
    ("band_azimuth_deg", "azimuth of the flare", "°", 1),
    ("band_azimuth_low_deg", "2.5 % quantile of the azimuth", "°", 1),
    ("band_azimuth_high_deg", "97.5 % quantile of the azimuth", "°", 1),
    ("band_period_min", "period of the orbit", "min", 1),
    ("band_period_low_min", "2.5 % quantile of the period", "min", 1),
    ("band_period_high_min", "97.5 % quantile of the period", "min", 1),
    ("band_ln_bayes_factor", "ln of the Bayes factor of a flare", "", 1),
    ("band_forward", "probability of the law's sense of rotation", "", 4),
    ("band_clockwise", "probability of clockwise motion on the sky", "", 4),
    ("band_validation", "χ² per data point of samples that were not fitted", "", 3),
    ("ring_diameter_uas", "diameter of the ring", "µas", 1),
    ("ring_diameter_uas_error", "error of the diameter", "µas", 1),
    ("ring_width_uas", "width of the ring", "µas", 1),
    ("ring_position_angle_deg", "brightest direction of the ring", "°", 0),
    ("ring_position_angle_deg_error", "error of the brightest direction", "°", 0),
    ("ring_asymmetry", "asymmetry of the ring", "", 3),
    ("ring_central_brightness", "brightness at the centre over that of the ring", "", 3),
    ("flux_jy", "flux", "Jy", 3),
    ("polarization_net_fraction", "net polarisation", "", 3),
    ("polarization_net_evpa_deg", "net position angle", "°", 0),
    ("polarization_mean_fraction", "mean polarisation", "", 3),
    ("polarization_mean_fraction_error", "error of the mean polarisation", "", 3),
    ("polarization_brightest_fraction", "polarisation where it is brightest", "", 3),
    ("polarization_brightest_fraction_error", "error of the polarisation there", "", 3),
    ("polarization_beta2", "modulus of β₂", "", 3),
    ("polarization_beta2_error", "error of the modulus of β₂", "", 3),
    ("polarization_beta2_deg", "argument of β₂", "°", 0),
    ("polarization_beta2_deg_error", "error of the argument of β₂", "°", 0),
    ("strength", "factor on the penalties", "", 3),
    ("chi2", "χ² per data point", "", 3),
    ("held_out_loss", "loss of held-out frames, the best setting", "", 3),
    ("loss", "loss", "", 6),
    ("seconds", "wall time", "s", 1),
    ("cpu_seconds", "CPU time", "s", 1),
    ("peak_memory_mib", "peak memory", "MiB", 0),
    ("steps", "steps", "", 0),
];

/// χ² of one kind of data among several: `chi2.closure-phases`.
pub const ONE_CHI2: &str = "chi2.";

/// Returns the name of a result with its unit, and its digits.
pub fn described(value: &str) -> (String, usize) {
    match RESULTS.iter().find(|(key, ..)| *key == value) {
        Some((_, name, "", digits)) => ((*name).to_owned(), *digits),
        Some((_, name, unit, digits)) => (format!("{name} ({unit})"), *digits),
        None => match value.strip_prefix(ONE_CHI2) {
            Some(name) => (format!("χ² per data point of {}", name.replace('-', " ")), 3),
            None => (value.to_owned(), 4),
        },
    }
}

/// The turn after which an angle is the same, degrees; none of other results.
pub fn period(value: &str) -> Option<f64> {
    match value {
        "ring_position_angle_deg"
        | "band_azimuth_deg"
        | "band_azimuth_low_deg"
        | "band_azimuth_high_deg"
        | "polarization_beta2_deg" => Some(360.0),
        // The electric vector has no head.
        "polarization_net_evpa_deg" => Some(180.0),
        _ => None,
    }
}

/// One result of a case.
pub fn result(results: &Value, value: &str) -> Option<f64> {
    if value == "chi2" {
        // With several kinds of data, a single number would be an arbitrary choice among them.
        let each = results["chi2_per_datum"].as_object()?;
        return (each.len() == 1).then(|| each.values().next()?.as_f64()).flatten();
    }
    if let Some(name) = value.strip_prefix(ONE_CHI2) {
        // results.json names kinds of data with blanks, experiments with hyphens as settings do.
        return results["chi2_per_datum"][name.replace('-', " ")]
            .as_f64()
            .filter(|x| x.is_finite());
    }
    if value == "held_out_loss" {
        return HeldOutResults::deserialize(results.get("held_out")?).ok()?.loss();
    }
    results[value].as_f64().filter(|x| x.is_finite())
}

/// Every combination of one of each, the last fastest.
pub fn product<T: Clone>(each: impl IntoIterator<Item = Vec<T>>) -> Vec<Vec<T>> {
    each.into_iter().fold(vec![Vec::new()], |all, choices| {
        let with = |before: &Vec<T>| -> Vec<Vec<T>> {
            choices
                .iter()
                .map(|one| [before.as_slice(), std::slice::from_ref(one)].concat())
                .collect()
        };
        all.iter().flat_map(with).collect()
    })
}

/// Returns the name of a combination: levels, with the factor's name before a number.
pub fn called(levels: &[(&str, &str)]) -> String {
    let one = |(factor, level): &(&str, &str)| match level.parse::<f64>() {
        Ok(_) => format!("{factor} {level}"),
        Err(_) => (*level).to_owned(),
    };
    levels.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Pairs of a map.
pub fn pairs(map: &BTreeMap<String, String>) -> Vec<(&str, &str)> {
    map.iter().map(|(factor, level)| (factor.as_str(), level.as_str())).collect()
}

/// Returns whether a case explains its data, in a word or two.
pub fn verdict_of(results: &Value) -> &'static str {
    match results["verdict"]["outcome"].as_str() {
        Some("explained") => "yes",
        Some("reproduced") => "yes, without noise",
        Some("fits-noise") => "fits noise",
        Some("unexplained") => "no",
        _ => "not judged",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn exact_numbers_have_digits_that_tell() {
        assert_eq!(
            [number(0.0004, 3), number(0.0, 3), number(-0.25, 2)],
            ["4.0e-4", "0.000", "-0.25"]
        );
    }

    #[test]
    fn exact_combinations_keep_their_order() {
        let levels = [vec![("a", "1"), ("a", "2")], vec![("b", "x"), ("b", "y")]];
        let names: Vec<String> = product(levels).iter().map(|c| called(c)).collect();
        assert_eq!(names, ["a 1, x", "a 1, y", "a 2, x", "a 2, y"]);
        assert_eq!(product::<u32>([]), [Vec::<u32>::new()]);
    }

    #[test]
    fn exact_results_are_numbers_or_nothing() {
        let results =
            json!({"psnr_db": 3.5, "nrmse": null, "chi2_per_datum": {"visibilities": 1.5}});
        assert_eq!(result(&results, "psnr_db"), Some(3.5));
        assert_eq!(result(&results, "nrmse"), None);
        assert_eq!(result(&results, "chi2"), Some(1.5));
        let two = json!({"chi2_per_datum": {"amplitudes": 1.5, "closure phases": 2.5}});
        assert_eq!(result(&two, "chi2"), None);
        assert_eq!(result(&two, "chi2.closure-phases"), Some(2.5));
        let held = json!({"held_out": {
            "setting": "linear.smoothness", "folds": 2, "chosen": 2.0, "values": [
                {"value": 1.0, "loss": 7.0, "losses": [6.0, 8.0]},
                {"value": 2.0, "loss": 5.0, "losses": [4.0, 6.0]},
            ],
        }});
        assert_eq!(result(&held, "held_out_loss"), Some(5.0));
        assert_eq!(result(&two, "held_out_loss"), None);
        assert_eq!(described("chi2.closure-phases").0, "χ² per data point of closure phases");
        assert_eq!(described("psnr_db"), ("PSNR (dB)".to_owned(), 2));
    }
}
