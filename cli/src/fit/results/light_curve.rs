//! Light curves of unresolved sources: the model beside the data; images where data see something else.

use super::Estimate;
use crate::fit::band_plots;
use crate::report::{Axis, LinePlot, Marks, Series};
use kerrlight_common::frames::Frames;
use kerrlight_tomo::fit::FrameTerm;
use std::fmt::Write;

/// The table of data and model.
pub const TABLE: &str = "light_curve.csv";

impl Estimate<'_> {
    /// χ² per datum of the samples that were not fitted, if there are any.
    pub fn validation(&self, seen: &Frames<f32>) -> anyhow::Result<Option<f64>> {
        let Some(curve) = &self.measured.curve else { return Ok(None) };
        let Some(term) = curve.validation()? else { return Ok(None) };
        let term: &dyn FrameTerm<f32> = &term;
        let (mut chi2, mut count) = (0.0, 0);
        for (frame, image) in seen.images().enumerate() {
            count += term.degrees_of_freedom(frame);
            chi2 += term.residuals(frame, &image?).iter().map(|r| r.value * r.value).sum::<f64>();
        }
        Ok((count > 0).then(|| chi2 / count as f64))
    }

    /// The table of data and model, if the data are a light curve.
    pub fn curve_table(&self, seen: &Frames<f32>) -> anyhow::Result<Option<String>> {
        let Some(curve) = &self.measured.curve else { return Ok(None) };
        let seen = seen.to_vec()?;
        let mut text = "time_utc_h,time_m,fitted".to_owned();
        for parameter in &curve.parameters {
            write!(text, ",{0},sigma_{0},model_{0}", parameter.name())?;
            if curve.background.is_some() {
                write!(text, ",background_{0},sigma_background_{0}", parameter.name())?;
            }
        }
        let count = curve.parameters.len();
        for (frame, hour) in curve.hours.iter().enumerate() {
            let (time, fitted) = (self.measured.times[frame], u8::from(curve.fitted[frame]));
            write!(text, "\n{hour},{time},{fitted}")?;
            let range = frame * count..(frame + 1) * count;
            for k in range {
                let [flux, sigma] = curve.data[k].unwrap_or([f64::NAN; 2]);
                match &curve.background {
                    None => write!(text, ",{flux},{sigma},{}", seen[k])?,
                    Some(background) => {
                        let [value, deviation, _] = background[k];
                        let model = f64::from(seen[k]) + value;
                        write!(text, ",{flux},{sigma},{model},{value},{deviation}")?;
                    }
                }
            }
        }
        text.push('\n');
        Ok(Some(text))
    }

    /// Data and model of each Stokes parameter over time, and the loop in Q and U.
    pub fn light_curves(&self, frames: &Frames<f32>) -> anyhow::Result<Vec<LinePlot>> {
        let Some(curve) = &self.measured.curve else { return Ok(Vec::new()) };
        let seen = frames.to_vec()?;
        let count = curve.parameters.len();
        let mut series = Vec::new();
        for (plane, parameter) in curve.parameters.iter().enumerate() {
            let line = |what: &str, of: &dyn Fn(usize) -> f64| {
                let hours = curve.hours.iter().enumerate();
                let points = hours.map(|(k, hour)| [*hour, of(k * count + plane)]).collect();
                Series::new(format!("{} of the {what}", parameter.name()), points, Marks::Line)
            };
            series.push(line("model", &|k| f64::from(seen[k]) + curve.background_at(k)[0]));
            if curve.background.is_some() {
                series.push(line("background", &|k| curve.background_at(k)[0]));
            }
            // Data go sample by sample, the Stokes parameters of each one after the other.
            let data = curve.hours.iter().zip(curve.data[plane..].iter().step_by(count));
            let measured: Vec<[f64; 3]> =
                data.filter_map(|(h, datum)| datum.map(|[jy, sigma]| [*h, jy, sigma])).collect();
            let points = measured.iter().map(|[h, jy, _]| [*h, *jy]).collect();
            let errors = measured.iter().map(|[.., sigma]| *sigma).collect();
            let data = Series::new(parameter.name(), points, Marks::Points);
            series.push(data.with_errors(errors));
        }
        let held = match curve.fitted.iter().position(|fitted| !fitted) {
            Some(first) => format!(
                " Samples from {:.3} h on were not fitted: they judge the fit.",
                curve.hours[first]
            ),
            None => String::new(),
        };
        let background = match curve.background {
            Some(_) => {
                " with the background that is expected beside it, and that background alone,"
            }
            None => "",
        };
        let text = self.curve_table(frames)?.unwrap_or_default();
        let mut plots = vec![LinePlot {
            title: "Stokes light curves".to_owned(),
            caption: format!(
                "Fluxes of the unresolved source, data as points with their standard deviations, the recovered emission{background} as lines.{held}"
            ),
            x: Axis::new("time", "h UTC"),
            y: Axis::new("flux density", "Jy"),
            series,
        }];
        plots.extend(band_plots::loop_plot(&text, ""));
        Ok(plots)
    }
}
