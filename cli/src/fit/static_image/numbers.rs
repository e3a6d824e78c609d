//! Numbers of a static image.

use kerrlight_imaging::{Ring, Survey};

/// A number of a ring.
pub type Number = fn(&Ring) -> f64;

/// Numbers of a ring: name, unit in the name, and value. Errors have `_error` behind the name.
pub const RING: [(&str, Number); 5] = [
    ("ring_diameter_uas", |ring| ring.diameter_uas),
    ("ring_width_uas", |ring| ring.width_uas),
    ("ring_position_angle_deg", |ring| ring.position_angle_deg),
    ("ring_asymmetry", |ring| ring.asymmetry),
    ("ring_central_brightness", |ring| ring.central_brightness),
];

/// A number of the ring with its error, calibrated but for the width, which includes what the array blurs.
pub fn of_ring(survey: &Survey, ring: &Ring, name: &str, number: Number) -> (f64, Option<f64>) {
    let calibrated = match name {
        "ring_width_uas" => None,
        "ring_diameter_uas" => survey.ring_diameter(),
        "ring_position_angle_deg" => survey.ring_direction(),
        _ => survey.ring_number(number),
    };
    calibrated.unwrap_or_else(|| (number(ring), survey.ring_error(number)))
}

/// `42.1 ± 0.8`, or the number alone where its error is not known.
pub fn with_error(value: f64, error: Option<f64>, digits: usize) -> String {
    match error {
        Some(error) => format!("{value:.digits$} ± {error:.digits$}"),
        None => format!("{value:.digits$}"),
    }
}

/// χ² per datum of fits of the image with other noise, kind by kind: mean and standard deviation; empty with less than two of
/// them.
pub fn chi2_of_draws(survey: &Survey) -> Vec<[f64; 2]> {
    let draws = survey.draws_that_count();
    let count = draws.len() as f64;
    let of = |kind: usize| {
        let mean = draws.iter().map(|draw| draw.chi2[kind]).sum::<f64>() / count;
        let square = draws.iter().map(|draw| (draw.chi2[kind] - mean).powi(2)).sum::<f64>();
        [mean, (square / (count - 1.0)).sqrt()]
    };
    let kinds = if draws.len() < 2 { 0 } else { survey.found().chi2.len() };
    (0..kinds).map(of).collect()
}
