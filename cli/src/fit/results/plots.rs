//! The log of a run, and data and model, as curves.

use super::Estimate;
use super::gains::Gains;
use super::verdict::Evidence;
use crate::report::{Axis, LinePlot, Marks, Series};
use kerrlight_common::frames::Frames;
use serde_json::Value;

impl Estimate<'_> {
    /// Total flux of the model and of the true movie.
    pub fn light_curve(&self, movie: &Frames<f32>) -> anyhow::Result<LinePlot> {
        let times = &self.measured.times;
        let points = |fluxes: Vec<f64>| times.iter().zip(fluxes).map(|(t, f)| [*t, f]).collect();
        let mut series = vec![Series::new("recovered", points(movie.sums()?), Marks::Line)];
        if let Some(truth) = &self.measured.movie {
            series.push(Series::new(self.known_movie(), points(truth.sums()?), Marks::Points));
        }
        let points = match (&self.measured.movie, &self.measured.truth) {
            (Some(_), Some(_)) => " Points are the true movie, the line is the recovered one.",
            (Some(_), None) => " Points are the data, the line is the recovered movie.",
            (None, _) => " The data are no images: the line is the recovered movie.",
        };
        Ok(LinePlot {
            title: "Light curve".to_owned(),
            caption: format!("Total flux of each frame: all light of the movie, added up.{points}"),
            x: Axis::new("time", "GM/c³"),
            y: Axis::new("flux", "Jy"),
            series,
        })
    }
}

/// Amplitudes of the data, with their errors, and of images of all frames with these gains.
pub fn amplitudes(
    evidence: &Evidence<'_>,
    movie: &Frames<f32>,
    gains: Option<&Gains>,
) -> anyhow::Result<Option<LinePlot>> {
    let Some((observation, _)) = &evidence.measured.visibilities else { return Ok(None) };
    let mut model = evidence.model_visibilities(movie)?.unwrap_or_default();
    let rows: Vec<_> = observation.stokes_i().collect();
    if let Some(gains) = gains {
        gains.put_on(observation, &mut model);
    }
    let with = if gains.is_some() { ", with the gains that were found" } else { "" };
    let length = |uv: [f64; 2]| uv[0].hypot(uv[1]) * 1e-9;
    let data = rows.iter().map(|(row, i)| [length(row.uv), i.visibility.norm()]);
    let fitted = rows.iter().zip(&model).map(|((row, _), v)| [length(row.uv), v.norm()]);
    let errors = rows.iter().map(|(_, i)| i.noise_sigma).collect();
    let series = vec![
        Series::new("data", data.collect(), Marks::Points).with_errors(errors),
        Series::new("recovered", fitted.collect(), Marks::Points),
    ];
    Ok(Some(LinePlot {
        title: "Visibilities".to_owned(),
        caption: format!(
            "What the telescopes measure and what the recovered images would give them{with}: amplitudes of the Fourier components of all frames against the distance of two telescopes as seen from the source, in wavelengths. Long baselines see fine detail. Bars are standard deviations of the data; where they are met the model explains the data."
        ),
        x: Axis::new("baseline", "10⁹ wavelengths"),
        y: Axis { log: true, ..Axis::new("amplitude", "Jy") },
        series,
    }))
}

fn series(lines: &[Value], name: &str, of: impl Fn(&Value) -> Option<f64>) -> Series {
    let point = |line: &Value| Some([line["step"].as_f64()?, of(line)?]);
    let points: Vec<[f64; 2]> = lines.iter().filter_map(point).collect();
    // A line through one point cannot be seen.
    let marks = if points.len() == 1 { Marks::Points } else { Marks::Line };
    Series::new(name, points, marks)
}

/// Loss and χ² of each kind of data against steps, if any were logged.
pub fn losses(lines: &[Value]) -> Option<LinePlot> {
    let mut all = vec![series(lines, "loss", |line| line["loss"].as_f64())];
    if all[0].points.is_empty() {
        return None;
    }
    let names = lines.last().and_then(|line| line["chi2_per_datum"].as_object());
    for name in names.into_iter().flat_map(|names| names.keys()) {
        all.push(series(lines, name, |line| line["chi2_per_datum"][name].as_f64()));
    }
    Some(LinePlot {
        title: "Loss".to_owned(),
        caption: "χ² per data point of each kind of data and their weighted sum, the loss, against the optimiser step. Random batches make the curves noisy; a flat curve has converged.".to_owned(),
        x: Axis::new("step", ""),
        y: Axis { log: true, ..Axis::new("loss", "") },
        series: all,
    })
}

/// PSNR against steps, if there is a truth.
pub fn quality(lines: &[Value]) -> Option<LinePlot> {
    let psnr = series(lines, "PSNR", |line| line["psnr_db"].as_f64());
    (!psnr.points.is_empty()).then(|| LinePlot {
        title: "Quality".to_owned(),
        caption: "Peak signal-to-noise ratio of the volume against the truth, over all nodes. The fit does not use the truth.".to_owned(),
        x: Axis::new("step", ""),
        y: Axis::new("PSNR", "dB"),
        series: vec![psnr],
    })
}
