//! Data and model as curves.

use super::Estimate;
use super::gains::Gains;
use super::verdict::Evidence;
use crate::report::{Axis, LinePlot, Marks, Series};
use kerrlight_common::frames::Frames;

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
            x: Axis { label: "time".to_owned(), unit: "GM/c³".to_owned(), log: false },
            y: Axis { label: "flux".to_owned(), unit: "Jy".to_owned(), log: false },
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
    let series = vec![
        Series {
            name: "data".to_owned(),
            points: data.collect(),
            errors: rows.iter().map(|(_, i)| i.noise_sigma).collect(),
            marks: Marks::Points,
        },
        Series::new("recovered", fitted.collect(), Marks::Points),
    ];
    Ok(Some(LinePlot {
        title: "Visibilities".to_owned(),
        caption: format!(
            "What the telescopes measure and what the recovered images would give them{with}: amplitudes of the Fourier components of all frames against the distance of two telescopes as seen from the source, in wavelengths. Long baselines see fine detail. Bars are standard deviations of the data; where they are met the model explains the data."
        ),
        x: Axis { label: "baseline".to_owned(), unit: "10⁹ wavelengths".to_owned(), log: false },
        y: Axis { label: "amplitude".to_owned(), unit: "Jy".to_owned(), log: true },
        series,
    }))
}
