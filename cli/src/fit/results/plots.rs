//! Data and model as curves.

use super::Estimate;
use crate::report::{Axis, LinePlot, Marks, Series};
use anyhow::anyhow;
use kerrlight_tomo::interferometry::operator::{Method, Operator, Pulse, Transform};
use num_complex::Complex;

impl Estimate<'_> {
    /// Total flux of the model and of the true movie.
    pub fn light_curve(&self, movie: &[f32]) -> LinePlot {
        let n = self.file.screen.pixels;
        let flux = |image: &[f32]| image.iter().map(|x| f64::from(*x)).sum::<f64>();
        let times = &self.measured.times;
        let points = |fluxes: Vec<f64>| times.iter().zip(fluxes).map(|(t, f)| [*t, f]).collect();
        let mut series = vec![Series {
            name: "recovered".to_owned(),
            points: points(movie.chunks(n * n).map(flux).collect()),
            errors: Vec::new(),
            marks: Marks::Line,
        }];
        if let Some(truth) = &self.measured.movie {
            series.push(Series {
                name: "truth".to_owned(),
                points: points(truth.chunks(n * n).map(|image| image.iter().sum()).collect()),
                errors: Vec::new(),
                marks: Marks::Points,
            });
        }
        LinePlot {
            title: "Light curve".to_owned(),
            caption: "Total flux of each frame: all light of the movie, added up. Points are the true movie, the line is the recovered one.".to_owned(),
            x: Axis { label: "time".to_owned(), unit: "GM/c³".to_owned(), log: false },
            y: Axis { label: "flux".to_owned(), unit: "Jy".to_owned(), log: false },
            series,
        }
    }

    /// Amplitudes of the data and of the model, with the data's errors.
    pub fn amplitudes(&self, movie: &[f32]) -> anyhow::Result<Option<LinePlot>> {
        let Some((observation, frames)) = &self.measured.visibilities else { return Ok(None) };
        let sky = self.measured.sky.ok_or_else(|| anyhow!("no sky"))?;
        let rows = || {
            observation.rows.iter().zip(frames).filter_map(|(row, frame)| {
                row.stokes_i(observation.basis).map(|i| (row, *frame, i))
            })
        };
        let mut uv = vec![Vec::new(); self.measured.times.len()];
        rows().for_each(|(row, frame, _)| uv[frame].push(row.uv));
        let transform = Transform::<f32>::new(sky, Pulse::Triangle, &uv, Method::Direct, 64 << 20)?;
        let mut model = vec![Complex::new(0.0, 0.0); transform.data()];
        transform.forward(movie, &mut model);
        // The model is in the order of frames.
        let mut order: Vec<_> = rows().collect();
        order.sort_by_key(|(_, frame, _)| *frame);
        let length = |uv: [f64; 2]| uv[0].hypot(uv[1]) * 1e-9;
        let data = order.iter().map(|(row, _, i)| [length(row.uv), i.visibility.norm()]);
        let fitted =
            order.iter().zip(&model).map(|((row, ..), v)| [length(row.uv), f64::from(v.norm())]);
        let series = vec![
            Series {
                name: "data".to_owned(),
                points: data.collect(),
                errors: order.iter().map(|(_, _, i)| i.noise_sigma).collect(),
                marks: Marks::Points,
            },
            Series {
                name: "recovered".to_owned(),
                points: fitted.collect(),
                errors: Vec::new(),
                marks: Marks::Points,
            },
        ];
        Ok(Some(LinePlot {
            title: "Visibilities".to_owned(),
            caption: "What the telescopes measure and what the recovered movie would give them: amplitudes of the Fourier components of all frames against the distance of two telescopes as seen from the source, in wavelengths. Long baselines see fine detail. Bars are standard deviations of the data; where they are met the model explains the data.".to_owned(),
            x: Axis { label: "baseline".to_owned(), unit: "10⁹ wavelengths".to_owned(), log: false },
            y: Axis { label: "amplitude".to_owned(), unit: "Jy".to_owned(), log: true },
            series,
        }))
    }
}
