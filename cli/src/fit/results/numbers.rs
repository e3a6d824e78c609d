//! What was found, in numbers.

use super::{Estimate, Found, bounds, quadrature, verdict};
use crate::fit::{band_search, closures, geometry_results, geometry_search, held_out, linear};
use crate::report;
use crate::session;
use crate::usage::usage;
use kerrlight_common::frames::Frames;
use kerrlight_render::volume::metrics::{self, Mask};
use kerrlight_tomo::fit::{State, Trainer};
use serde_json::{Value, json};

/// What is said of a truth without emission.
pub const DARK: &str =
    "the truth is dark on all nodes: PSNR, relative error and correlation are not defined";

/// Σ |masked − unmasked|/Σ |unmasked| over a few frames.
pub fn mask_error(
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
    masked: &Frames<f32>,
) -> anyhow::Result<Option<f64>> {
    if state.now.occupancy.is_none() {
        return Ok(None);
    }
    let model = &trainer.objective.model;
    let (all, pixels) = (model.frames(), model.pixels());
    let frames: Vec<usize> = [1, 3].map(|k| k * all / 4).to_vec();
    let whole = trainer.movie(&state.now, &frames, false);
    let mut sums = [0.0; 2];
    for (frame, image) in frames.iter().zip(whole.chunks_exact(pixels)) {
        for (pixel, masked) in image.iter().zip(&*masked.image(*frame)?) {
            sums[0] += f64::from((pixel - masked).abs());
            sums[1] += f64::from(pixel.abs());
        }
    }
    Ok((sums[1] > 0.0).then(|| sums[0] / sums[1]))
}

impl Estimate<'_> {
    /// All of them, as they are written.
    pub fn results(&self, trainer: &Trainer<'_, f32>, found: &Found<'_>) -> anyhow::Result<Value> {
        let names = trainer.objective.names();
        let chi2: serde_json::Map<String, Value> = names
            .iter()
            .zip(&found.loss.terms)
            .map(|(name, value)| ((*name).to_owned(), json!(value)))
            .collect();
        let now = &found.state.now;
        let mut results = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "steps": now.step,
            "seconds": found.begun.elapsed().as_secs_f64(),
            "cpu_seconds": usage().map(|usage| usage.cpu_seconds - session::cpu_seconds_before()),
            "peak_memory_mib": usage().map(|usage| usage.peak_mib),
            "loss": found.loss.total,
            "chi2_per_datum": chi2,
            "axis": now.axis.vector(),
            "inputs": self.folder.inputs().files,
            "verdict": verdict::json(&found.judged),
        });
        if let Some(device) = &self.device {
            results["device"] = json!(device);
        }
        if let Some(validation) = self.validation(&found.seen)? {
            results["validation_chi2_per_datum"] = json!(validation);
        }
        if let Some(gains) = &found.gains {
            results["gains"] = gains.json();
        }
        if let Some(leakage) = &found.leakage {
            results["leakage"] = leakage.json();
        }
        if let Some(quiescent) = &found.quiescent {
            results["quiescent"] = quiescent.json();
        }
        if let Some(mask) = found.mask {
            results["mask_error"] = json!(mask);
        }
        if let Some(off) = found.quadrature {
            results["quadrature_error"] = json!(off);
        }
        if let Some(linear) = linear::outcome(self.file, &self.folder.lines()?) {
            results["linear"] = linear;
        }
        if let Some(held_out) = self.folder.found(held_out::FILE)? {
            results["held_out"] = held_out;
        }
        if let Some(closures) = closures::json(self.measured, &self.file.loss) {
            results["closures"] = closures;
        }
        self.add_geometries(&mut results)?;
        let unknown = self.file.unknowns();
        if !unknown.is_empty() {
            results["unknown"] = json!(unknown);
        }
        self.add_closeness(&mut results, found)?;
        Ok(results)
    }
}

impl Estimate<'_> {
    /// How close the volume is to the truth, where there is one.
    fn add_closeness(&self, results: &mut Value, found: &Found<'_>) -> anyhow::Result<()> {
        let (Some(truth), Some(volume)) = (&self.measured.truth, &self.true_volume) else {
            return Ok(());
        };
        let region = &self.file.region;
        let z_width = region.z_width.unwrap_or(f64::INFINITY);
        let mask = Mask::new(region.r_min, region.r_max, z_width)?;
        let all = metrics::compare(&found.volume, volume, None)?;
        let inside = metrics::compare(&found.volume, volume, Some(&mask))?;
        results["axis_dot_truth"] = json!(found.state.now.axis.dot(truth.axis()));
        if all.psnr_db.is_none() {
            results["note"] = json!(DARK);
        }
        results["psnr_db"] = json!(all.psnr_db);
        results["psnr_inside_db"] = json!(inside.psnr_db);
        results["nrmse"] = json!(all.nrmse);
        results["correlation"] = json!(all.correlation);
        if let Some(changes) = &found.changes {
            results["psnr_over_time_db"] = json!(changes.closeness.psnr_db());
            results["nrmse_over_time"] = json!(changes.closeness.nrmse());
        }
        Ok(())
    }

    /// The geometries that were found, where they were not known.
    fn add_geometries(&self, results: &mut Value) -> anyhow::Result<()> {
        if let Some(geometry) = self.folder.found(geometry_search::FILE)? {
            geometry_results::errors(&geometry)
                .into_iter()
                .for_each(|(key, value)| results[key] = value);
            results["geometry"] = geometry;
        }
        if let Some(band) = self.folder.found(band_search::FILE)? {
            band_search::numbers(&band).into_iter().for_each(|(key, value)| results[key] = value);
            // Samples that were not fitted have one χ²: with the errors that a flare's past leaves of them.
            if band["validation_chi2_per_datum"].is_number()
                && let Some(results) = results.as_object_mut()
            {
                results.remove("validation_chi2_per_datum");
            }
            results["band"] = band;
        }
        Ok(())
    }
}

/// The verdict, what is wrong with sums along rays, bounds that were reached and, beside a truth, PSNR with that of an empty volume.
pub fn last_line(headline: &str, results: &Value) -> String {
    let said = quadrature::sentence(results).into_iter().chain(bounds::sentences(results));
    let headline = std::iter::once(headline.to_owned()).chain(said).collect::<Vec<_>>().join(" ");
    match (results["psnr_db"].as_f64(), results["nrmse"].as_f64()) {
        (Some(psnr), Some(nrmse)) => {
            let empty = psnr + 20.0 * nrmse.log10();
            format!(
                "{headline} PSNR beside the truth: {psnr:.2} dB (an empty volume: {empty:.2} dB)."
            )
        }
        _ => headline,
    }
}

/// A line of the table of results.
struct Meaning {
    key: &'static str,
    name: &'static str,
    digits: usize,
    unit: &'static str,
    text: &'static str,
}

const fn meaning(
    key: &'static str,
    name: &'static str,
    digits: usize,
    unit: &'static str,
    text: &'static str,
) -> Meaning {
    Meaning { key, name, digits, unit, text }
}

const MEANINGS: [Meaning; 15] = [
    meaning("loss", "loss", 6, "", "what was minimised, of all data, without penalties"),
    meaning(
        "validation_chi2_per_datum",
        "validation",
        4,
        "",
        "χ² per data point of the samples that were not fitted",
    ),
    meaning(
        "psnr_db",
        "PSNR",
        2,
        "dB",
        "peak signal-to-noise ratio of the volume: 10 log10(largest true value² / mean square error); 10 dB more is an \
         error about a third as large. An empty volume has tens of dB already, as most of space is dark",
    ),
    meaning(
        "psnr_inside_db",
        "PSNR inside",
        2,
        "dB",
        "the same, of the nodes inside the region of recovery alone",
    ),
    meaning(
        "psnr_over_time_db",
        "PSNR over time",
        2,
        "dB",
        "the same of the volumes at the times of all frames together, for emission that changes",
    ),
    meaning(
        "nrmse_over_time",
        "relative error over time",
        4,
        "",
        "root mean square error of the volumes at the times of all frames over that of the truth",
    ),
    meaning(
        "nrmse",
        "relative error",
        4,
        "",
        "root mean square error over that of the truth: 0 is perfect, 1 an empty volume",
    ),
    meaning(
        "correlation",
        "correlation",
        5,
        "",
        "normalised cross-correlation with the truth: 1 is perfect, whatever the scale",
    ),
    meaning(
        "axis_dot_truth",
        "axis",
        6,
        "",
        "cosine of the angle between the recovered axis and the true one: 1 is perfect",
    ),
    meaning(
        "mask_error",
        "masked light",
        6,
        "",
        "light in places that were taken for empty and left out, as a part of all, in two frames",
    ),
    meaning(
        "quadrature_error",
        "sums along rays",
        3,
        "of the errors",
        "root mean square difference of the model from the same with twice the nodes on rays, over the errors of the data",
    ),
    meaning("steps", "steps", 0, "", "steps of the optimiser"),
    meaning("seconds", "time", 1, "s", "wall time of this run, from its start to these results"),
    meaning("cpu_seconds", "processor time", 1, "s", "the same, of all threads together"),
    meaning("peak_memory_mib", "memory", 0, "MiB", "most memory that the process held"),
];

/// The same as lines of a table; what is not defined is left out.
pub fn outcomes(results: &Value) -> Vec<report::Outcome> {
    let one = |meaning: &Meaning| {
        Some(report::Outcome {
            name: meaning.name.to_owned(),
            value: format!("{:.*}", meaning.digits, results[meaning.key].as_f64()?),
            unit: meaning.unit.to_owned(),
            meaning: meaning.text.to_owned(),
        })
    };
    MEANINGS.iter().filter_map(one).collect()
}
