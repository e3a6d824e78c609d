//! results.json of a static image.

use super::Found;
use crate::fit::closures;
use crate::fit::results::verdict;
use crate::session;
use crate::usage::usage;
use kerrlight_imaging::{Candidate, Ring, ShapeFit, Survey};
use serde_json::{Map, Value, json};

/// A number of a ring.
type Number = fn(&Ring) -> f64;

/// Numbers of a ring: name, unit in the name, and value. Errors have `_error` behind the name.
pub const RING: [(&str, Number); 5] = [
    ("ring_diameter_uas", |ring| ring.diameter_uas),
    ("ring_width_uas", |ring| ring.width_uas),
    ("ring_position_angle_deg", |ring| ring.position_angle_deg),
    ("ring_asymmetry", |ring| ring.asymmetry),
    ("ring_central_brightness", |ring| ring.central_brightness),
];

/// A number of the ring with its error. Angles are compared the short way round; the diameter is calibrated.
pub fn of_ring(survey: &Survey, ring: &Ring, name: &str, number: Number) -> (f64, Option<f64>) {
    let value = number(ring);
    let error = match name {
        "ring_diameter_uas" => return survey.ring_diameter().unwrap_or((value, None)),
        "ring_position_angle_deg" => survey.ring_error(|ring| {
            value + (ring.position_angle_deg - value + 540.0).rem_euclid(360.0) - 180.0
        }),
        _ => survey.ring_error(number),
    };
    (value, error)
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
    let draws = &survey.draws;
    let count = draws.len() as f64;
    let of = |kind: usize| {
        let mean = draws.iter().map(|draw| draw.chi2[kind]).sum::<f64>() / count;
        let square = draws.iter().map(|draw| (draw.chi2[kind] - mean).powi(2)).sum::<f64>();
        [mean, (square / (count - 1.0)).sqrt()]
    };
    let kinds = if draws.len() < 2 { 0 } else { survey.found().chi2.len() };
    (0..kinds).map(of).collect()
}

fn candidate(image: &Candidate) -> Value {
    json!({
        "start": image.start + 1,
        "strength": image.strength,
        "loss": image.solution.loss,
        "flux_jy": image.solution.image.iter().sum::<f64>(),
        "iterations": image.solution.iterations,
        "has_converged": image.solution.has_converged,
        "chi2_per_datum": image.chi2,
        "ring_diameter_uas": image.ring.map(|ring| ring.diameter_uas),
    })
}

/// A shape as it is listed.
fn shape(fit: &ShapeFit) -> Value {
    let sizes: Map<String, Value> =
        fit.sizes.iter().map(|(name, value, _)| ((*name).to_owned(), json!(value))).collect();
    json!({
        "shape": fit.shape.name(),
        "sizes": sizes,
        "flux_jy": fit.flux_jy,
        "chi2_per_datum": fit.chi2,
        "criterion": fit.criterion,
    })
}

impl Found<'_> {
    /// All numbers.
    pub fn results(&self) -> Value {
        let found = self.survey.found();
        let kinds = self.file.loss.iter().map(|loss| super::name(loss.data));
        let chi2: Map<String, Value> =
            kinds.zip(&found.chi2).map(|(name, chi2)| (name.to_owned(), json!(chi2))).collect();
        let drawn = |[mean, deviation]: [f64; 2]| json!({"mean": mean, "deviation": deviation});
        let of_draws: Map<String, Value> = (self.file.loss.iter())
            .zip(chi2_of_draws(&self.survey))
            .map(|(loss, chi2)| (super::name(loss.data).to_owned(), drawn(chi2)))
            .collect();
        let beside: Map<String, Value> =
            self.beside.iter().map(|(name, chi2)| ((*name).to_owned(), json!(chi2))).collect();
        let all = |images: &[Candidate]| images.iter().map(candidate).collect::<Vec<_>>();
        let mut results = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "kind": "static image",
            "steps": found.solution.iterations,
            "seconds": self.begun.elapsed().as_secs_f64(),
            "cpu_seconds": usage().map(|usage| usage.cpu_seconds - session::cpu_seconds_before()),
            "peak_memory_mib": usage().map(|usage| usage.peak_mib),
            "loss": found.solution.loss,
            "chi2_per_datum": chi2,
            "chi2_not_fitted": beside,
            "chi2_of_draws": of_draws,
            "inputs": self.folder.inputs().files,
            "verdict": verdict::json(&self.judged),
            "flux_jy": found.solution.image.iter().sum::<f64>(),
            "flux_error_jy": self.survey.flux_error(),
            "strength": self.survey.strength,
            "envelope_fwhm_uas": self.survey.envelope_uas,
            "starts": all(&self.survey.starts),
            "strengths": all(&self.survey.strengths),
            "draws": all(&self.survey.draws),
            "has_converged": found.solution.has_converged,
        });
        if let Some(closures) = closures::json(self.measured, &self.file.loss) {
            results["closures"] = closures;
        }
        if !self.survey.held.is_empty() {
            let held = self.survey.held.iter();
            let one = |held: &kerrlight_tomo::fit::setup::Held| json!({"value": held.value, "loss": held.mean(), "losses": held.losses});
            results["held_out"] = json!(held.map(one).collect::<Vec<_>>());
        }
        if let Some(gains) = &self.gains {
            results["gains"] = gains.json();
        }
        if let Some(polarized) = &self.polarized {
            polarized.add_to(&mut results);
        }
        results["shapes"] = self.shapes.iter().map(shape).collect();
        let [with, all] = self.survey.with_ring();
        results["images_with_ring"] = json!({"count": with, "of": all});
        self.add_ring(&mut results);
        results
    }

    fn add_ring(&self, results: &mut Value) {
        let Some(ring) = &self.ring() else { return };
        for (name, number) in RING {
            let (value, error) = of_ring(&self.survey, ring, name, number);
            results[name] = json!(value);
            results[format!("{name}_error")] = json!(error);
        }
        results["ring_diameter_of_image_uas"] = json!(ring.diameter_uas);
        results["ring"] = json!({
            "centre_east_uas": ring.centre_uas[0],
            "centre_north_uas": ring.centre_uas[1],
            "diameter_scatter_uas": ring.diameter_scatter_uas,
        });
    }
}
