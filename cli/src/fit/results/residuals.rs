//! Residuals on the sky and on baselines.

use super::verdict::{DataVerdict, parts};
use super::{Estimate, Found};
use crate::report::{self, Figure, LinePlot};
use kerrlight_tomo::fit::settings::LossKind;
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_tomo::fit::verdict::{Part, Tested};
use kerrlight_vlbi::dirty_image;
use num_complex::Complex;
use std::collections::HashMap;

impl Estimate<'_> {
    /// Returns the map of light in images or visibilities that the model lacks; nothing where data know no places.
    pub fn residual_map(&self, found: &Found<'_>) -> anyhow::Result<Option<Figure>> {
        let n = self.file.screen.pixels;
        let of_images = found.judged.terms.iter().map(|(_, tested)| tested);
        let of_images = of_images.filter_map(|tested| pixel_maps(tested, n * n)).next();
        if let Some([mean, chi2]) = of_images {
            return report::residuals(
                &[("the mean over all frames", &mean), ("χ² of each pixel", &chi2)],
                n,
                "Residuals of the images, model minus data, pixel by pixel: the mean over all frames in units of its \
                 error, and the excess of χ² over that of the noise in units of its scatter by chance.",
            )
            .map(Some);
        }
        let Some(map) = self.dirty_residuals(found)? else { return Ok(None) };
        report::residuals(
            &[("all frames", &map)],
            n,
            "The residuals of all visibilities, model minus data, transformed back to the sky with the weights of their \
             errors (a dirty image), in units of the noise of that image.",
        )
        .map(Some)
    }

    /// Returns the residuals where phases are fitted; nothing elsewhere, and nothing without errors.
    fn dirty_residuals(&self, found: &Found<'_>) -> anyhow::Result<Option<Vec<f32>>> {
        let has_phases = self.file.loss.iter().any(|loss| loss.data == LossKind::Visibilities);
        let (Some((observation, _)), Some(sky)) = (&self.measured.visibilities, self.measured.sky)
        else {
            return Ok(None);
        };
        let rows: Vec<_> = observation.stokes_i().collect();
        if !has_phases || rows.iter().any(|(_, i)| i.noise_sigma <= 0.0) {
            return Ok(None);
        }
        let mut model = self.evidence().model_visibilities(&found.movie)?.unwrap_or_default();
        if let Some(gains) = &found.gains {
            gains.put_on(observation, &mut model);
        }
        let uv: Vec<[f64; 2]> = rows.iter().map(|(row, _)| row.uv).collect();
        let residuals = rows.iter().zip(&model).map(|((_, i), model)| model - i.visibility);
        let residuals: Vec<Complex<f64>> = residuals.collect();
        let sigmas: Vec<f64> = rows.iter().map(|(_, i)| i.noise_sigma).collect();
        Ok(Some(dirty_image::in_sigmas(sky, uv, &residuals, &sigmas)?))
    }
}

/// Residuals over time and over baselines.
pub fn plots(judged: &DataVerdict, measured: &FitData) -> Vec<LinePlot> {
    let lengths = baselines(measured);
    let length = |[a, b]: [u16; 2]| lengths.get(&[a.min(b), a.max(b)]).copied();
    [parts::over_time(judged), parts::over_baselines(judged, length)]
        .into_iter()
        .flatten()
        .collect()
}

/// Mean lengths of baselines, 10⁹ wavelengths.
fn baselines(measured: &FitData) -> HashMap<[u16; 2], f64> {
    let mut sums: HashMap<[u16; 2], [f64; 2]> = HashMap::new();
    let rows = measured.visibilities.iter().flat_map(|(observation, _)| observation.stokes_i());
    for (row, _) in rows {
        let [a, b] = row.stations;
        let sum = sums.entry([a.min(b), a.max(b)]).or_default();
        *sum = [sum[0] + 1.0, sum[1] + row.uv[0].hypot(row.uv[1]) * 1e-9];
    }
    sums.into_iter().map(|(pair, [count, sum])| (pair, sum / count)).collect()
}

/// Mean and χ² of each pixel's residuals in units of their errors; nothing of data that are no images of so many pixels.
fn pixel_maps(tested: &Tested, pixels: usize) -> Option<[Vec<f32>; 2]> {
    let of = &tested.statistics.pixels;
    (of.len() == pixels).then(|| {
        let count = |part: &Part| part.freedom.max(1.0);
        // The mean of n residuals scatters by 1/√n, and χ²/n by √(2/n).
        let mean = of.iter().map(|sum| sum.sum / count(&sum.part).sqrt());
        let chi2 = of.iter().map(|sum| {
            let n = count(&sum.part);
            (sum.part.chi2 / n - tested.expected.chi2) / (2.0 / n).sqrt()
        });
        [mean.map(|x| x as f32).collect(), chi2.map(|x| x as f32).collect()]
    })
}
