//! Results in numbers.

use super::bounds::Reached;
use super::gains::{GainResults, Gains};
use super::leakage::{Leakage, LeakageResults};
use super::quiescent::{Quiescent, QuiescentResults};
use super::verdict::VerdictResults;
use super::{Estimate, Found};
use crate::checksum::Sealed;
use crate::fit::closures::{self, ClosureResults};
use crate::fit::inputs::InputFile;
use crate::fit::{held_out, linear, searches};
use crate::report;
use crate::session;
use crate::usage::usage;
use kerrlight_common::frames::Frames;
use kerrlight_render::volume::metrics::{self, Mask};
use kerrlight_tomo::fit::settings::AxisSearch;
use kerrlight_tomo::fit::{Region, State, Trainer};
use kerrlight_tomo::recovery::results::{BandResults, GeometryResults, HeldOutResults};
use serde::Serialize;
use std::collections::BTreeMap;

/// Error over the truth above which a truth that changes is dark at the reference time.
const NEARLY_DARK: f64 = 1e3;

/// Words on a truth that changes, at a time at which it is dark.
const DARK_NOW: &str = "the truth is dark, or nearly so, at the reference time: PSNR, relative error and correlation there are not defined";

/// Words on a truth without emission.
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

/// All numbers of a fit, as results.json has them; what is not known is left out.
#[derive(Serialize)]
pub struct Results {
    version: &'static str,
    pub steps: u64,
    seconds: f64,
    cpu_seconds: Option<f64>,
    peak_memory_mib: Option<f64>,
    loss: f64,
    /// χ² per datum of each kind of data.
    pub chi2_per_datum: BTreeMap<String, f64>,
    axis: [f64; 3],
    inputs: Vec<InputFile>,
    verdict: VerdictResults,
    #[serde(skip_serializing_if = "Option::is_none")]
    device: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    validation_chi2_per_datum: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gains: Option<GainResults>,
    #[serde(skip_serializing_if = "Option::is_none")]
    leakage: Option<LeakageResults>,
    #[serde(skip_serializing_if = "Option::is_none")]
    quiescent: Option<QuiescentResults>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mask_error: Option<f64>,
    rays_per_pixel: usize,
    /// Settings to raise, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub advice: Vec<String>,
    /// Error of sums along rays, over the errors of the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quadrature_error: Option<f64>,
    /// Quality of the solution of a linear grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<linear::Solved>,
    /// The weight that was chosen by held-out data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<Sealed<HeldOutResults>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    closures: Vec<ClosureResults>,
    /// The geometry, where it was not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometry: Option<Sealed<GeometryResults>>,
    /// The same by the light curve of a flare.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band: Option<Sealed<BandResults>>,
    /// Numbers of the two in tables.
    #[serde(flatten)]
    of_searches: BTreeMap<String, Option<f64>>,
    /// Quantities that the data cannot tell.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unknown: Vec<String>,
    /// Distance of the volume from the truth, where there is one.
    #[serde(flatten)]
    pub closeness: Option<Closeness>,
    /// Bounds that were reached.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bounds: Vec<Reached>,
}

/// Distance of a volume from the truth.
#[derive(Serialize)]
pub struct Closeness {
    /// Cosine of the angle between the axes.
    pub axis_dot_truth: f64,
    /// True if the axis was given.
    #[serde(skip)]
    is_axis_known: bool,
    /// Note on a truth of which nothing is defined.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<&'static str>,
    /// PSNR of all nodes.
    pub psnr_db: Option<f64>,
    psnr_inside_db: Option<f64>,
    /// Relative error.
    pub nrmse: Option<f64>,
    correlation: Option<f64>,
    #[serde(flatten)]
    over_time: Option<OverTime>,
}

impl Closeness {
    /// Tells it, the axis where that was looked for.
    pub fn sentences(&self) -> Vec<String> {
        let mut all = Vec::new();
        if let (Some(psnr), Some(nrmse)) = (self.psnr_db, self.nrmse) {
            all.push(format!(
                "Compared with the truth, the volume has a peak signal-to-noise ratio of {psnr:.2} dB and a relative error of {nrmse:.3} (1 for an empty volume)."
            ));
        }
        all.extend(self.note.map(|note| format!("Note that {note}.")));
        if !self.is_axis_known {
            let dot = self.axis_dot_truth;
            let angle = dot.clamp(-1.0, 1.0).acos().to_degrees();
            all.push(format!(
                "The fitted rotation axis is {angle:.2}° from the true one (cosine {dot:.5})."
            ));
        }
        all
    }
}

/// The same of the volumes at the times of all frames.
#[derive(Serialize)]
struct OverTime {
    psnr_over_time_db: Option<f64>,
    nrmse_over_time: Option<f64>,
}

impl Estimate<'_> {
    /// All of them.
    pub fn results(
        &self,
        trainer: &Trainer<'_, f32>,
        found: &Found<'_>,
    ) -> anyhow::Result<Results> {
        let names = trainer.objective.names().into_iter().map(str::to_owned);
        let now = &found.state.now;
        let geometry = self.folder.found::<GeometryResults>(searches::GEOMETRY)?;
        let band = self.folder.found::<BandResults>(searches::BAND)?;
        let log = self.folder.lines()?;
        // Samples that were not fitted have one χ²: with the errors that a flare's past leaves of them.
        let is_told = band.as_ref().is_some_and(|of| of.validation_chi2_per_datum.is_some());
        let validation = if is_told { None } else { self.validation(&found.seen)? };
        let errors = geometry.as_ref().map(|of| of.errors()).into_iter().flatten();
        let numbers = band.as_ref().map(|of| of.numbers()).into_iter().flatten();
        let numbers = numbers.map(|(key, number)| (key.to_owned(), number));
        Ok(Results {
            version: env!("CARGO_PKG_VERSION"),
            steps: now.step,
            seconds: found.begun.elapsed().as_secs_f64(),
            cpu_seconds: usage().map(|usage| usage.cpu_seconds - session::cpu_seconds_before()),
            peak_memory_mib: usage().map(|usage| usage.peak_mib),
            loss: found.loss.total,
            chi2_per_datum: names.zip(found.loss.terms.iter().copied()).collect(),
            axis: now.axis.vector(),
            inputs: self.folder.inputs.files.clone(),
            verdict: VerdictResults::from(&found.judged),
            device: self.device.clone(),
            validation_chi2_per_datum: validation,
            gains: found.gains.as_ref().map(Gains::results),
            leakage: found.leakage.as_ref().map(Leakage::results),
            quiescent: found.quiescent.as_ref().map(Quiescent::results),
            mask_error: found.mask,
            rays_per_pixel: self.file.screen.samples_per_pixel.unwrap_or(1),
            quadrature_error: found.quadrature,
            advice: self.advice(found, &log),
            linear: linear::outcome(self.file, &log),
            held_out: self.folder.found(held_out::FILE)?,
            closures: closures::results(self.measured, &self.file.loss),
            of_searches: errors.chain(numbers).collect(),
            geometry,
            band,
            unknown: self.file.unknowns(),
            closeness: self.closeness(found)?,
            bounds: self.bounds(&found.volume, &now.parameters, found.quiescent.as_ref()),
        })
    }

    /// Returns the distance of the volume from the truth, where there is one.
    fn closeness(&self, found: &Found<'_>) -> anyhow::Result<Option<Closeness>> {
        let (Some(truth), Some(volume)) = (&self.measured.truth, &self.true_volume) else {
            return Ok(None);
        };
        let Region { r_min, r_max, z_width } = self.file.region.limits();
        let mask = Mask { r_min, r_max, z_width };
        let all = metrics::compare(&found.volume, volume, None)?;
        let inside = metrics::compare(&found.volume, volume, Some(&mask))?;
        // Emission that fades is never quite dark: what is found then is compared with next to nothing.
        let is_lit = found.changes.is_none() || all.nrmse.is_none_or(|of| of < NEARLY_DARK);
        let lit = |number: Option<f64>| number.filter(|_| is_lit);
        Ok(Some(Closeness {
            axis_dot_truth: found.state.now.axis.dot(truth.axis()),
            is_axis_known: matches!(self.file.axis, AxisSearch::Known {}),
            note: match (all.psnr_db, is_lit) {
                (None, _) => Some(DARK),
                (_, false) => Some(DARK_NOW),
                _ => None,
            },
            psnr_db: lit(all.psnr_db),
            psnr_inside_db: lit(inside.psnr_db),
            nrmse: lit(all.nrmse),
            correlation: lit(all.correlation),
            over_time: found.changes.as_ref().map(|changes| OverTime {
                psnr_over_time_db: changes.closeness.psnr_db(),
                nrmse_over_time: changes.closeness.nrmse(),
            }),
        }))
    }
}

/// The verdict, settings to raise, bounds that were reached and, beside a truth, PSNR with that of an empty volume.
pub fn last_line(headline: &str, results: &Results) -> String {
    let said = results.advice.iter().cloned().chain(results.bounds.iter().map(Reached::sentence));
    let headline = std::iter::once(headline.to_owned()).chain(said).collect::<Vec<_>>().join(" ");
    let told = results.closeness.as_ref().and_then(|of| match &of.over_time {
        Some(over) => Some((" over all frames", over.psnr_over_time_db?, over.nrmse_over_time?)),
        None => Some(("", of.psnr_db?, of.nrmse?)),
    });
    match told {
        Some((when, psnr, nrmse)) => {
            // The error of an empty volume is the truth itself, a relative error of 1.
            let empty = psnr + 20.0 * nrmse.log10();
            format!(
                "{headline} PSNR with respect to the truth{when}: {psnr:.2} dB (an empty volume: {empty:.2} dB)."
            )
        }
        None => headline,
    }
}

/// Why steps have ended early.
pub fn last_step(step: u64, of: u64) -> String {
    format!("Step {step} of {of} is the last: more would follow the noise of the data.")
}

/// A number of results; none where it is not defined.
type Number = fn(&Results) -> Option<f64>;

/// A line of the table of results: a number with its name, digits, unit and meaning.
type Line = (Number, &'static str, usize, &'static str, &'static str);

/// All of them.
const MEANINGS: [Line; 15] = [
    (|of| Some(of.loss), "loss", 6, "", "what was minimised, of all data, without penalties"),
    (
        |of| of.validation_chi2_per_datum,
        "validation",
        4,
        "",
        "χ² per data point of the samples that were not fitted",
    ),
    (
        |of| of.closeness.as_ref()?.psnr_db,
        "PSNR",
        2,
        "dB",
        "peak signal-to-noise ratio of the volume: 10 log10(largest true value² / mean square error); 10 dB more is an \
         error about a third as large. An empty volume has tens of dB already, as most of space is dark",
    ),
    (
        |of| of.closeness.as_ref()?.psnr_inside_db,
        "PSNR inside",
        2,
        "dB",
        "the same, of the nodes inside the region of recovery alone",
    ),
    (
        |of| of.closeness.as_ref()?.over_time.as_ref()?.psnr_over_time_db,
        "PSNR over time",
        2,
        "dB",
        "the same of the volumes at the times of all frames together, for emission that changes",
    ),
    (
        |of| of.closeness.as_ref()?.over_time.as_ref()?.nrmse_over_time,
        "relative error over time",
        4,
        "",
        "root mean square error of the volumes at the times of all frames over that of the truth",
    ),
    (
        |of| of.closeness.as_ref()?.nrmse,
        "relative error",
        4,
        "",
        "root mean square error over that of the truth: 0 is perfect, 1 an empty volume",
    ),
    (
        |of| of.closeness.as_ref()?.correlation,
        "correlation",
        5,
        "",
        "normalised cross-correlation with the truth: 1 is perfect, whatever the scale",
    ),
    (
        |of| {
            let closeness = of.closeness.as_ref().filter(|closeness| !closeness.is_axis_known);
            Some(closeness?.axis_dot_truth)
        },
        "axis",
        6,
        "",
        "cosine of the angle between the recovered axis and the true one: 1 is perfect",
    ),
    (
        |of| of.mask_error,
        "masked light",
        6,
        "",
        "light in places that were taken for empty and left out, as a part of all, in two frames",
    ),
    (
        |of| of.quadrature_error,
        "sums along rays",
        3,
        "of the errors",
        "root mean square difference of the model from the same with twice the nodes on rays, over the errors of the data",
    ),
    (|of| Some(of.steps as f64), "steps", 0, "", "steps of the optimiser"),
    (
        |of| Some(of.seconds),
        "time",
        1,
        "s",
        "wall time of this run, from its start to these results",
    ),
    (|of| of.cpu_seconds, "processor time", 1, "s", "the same, of all threads together"),
    (|of| of.peak_memory_mib, "memory", 0, "MiB", "most memory that the process held"),
];

/// The same as lines of a table; what is not defined is left out.
pub fn outcomes(results: &Results) -> Vec<report::Outcome> {
    let one = |(of, name, digits, unit, meaning): Line| {
        let value = of(results).filter(|x| x.is_finite())?;
        Some(report::Outcome { name, value: format!("{value:.digits$}"), unit, meaning })
    };
    MEANINGS.into_iter().filter_map(one).collect()
}
