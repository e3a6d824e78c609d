//! The image, blurred and as sure as it is, with axes and a beam, and as FITS.

use super::Found;
use crate::report::{Figure, SkyPanel, sky};
use kerrlight_imaging::{Candidate, blurred};
use kerrlight_vlbi::files;

/// Full width at half maximum of the beam of the published images of M87*, µas (EHT Collaboration 2019, ApJL 875, L4).
const BEAM_UAS: f64 = 20.0;

impl Found<'_> {
    /// Pixels along a side, and the width of the field in µas.
    fn size(&self) -> (usize, f64) {
        (self.file.image.pixels, self.file.image.field_uas)
    }

    /// An image as a beam of so many µas sees it.
    fn seen(&self, image: &[f64], beam_uas: f64) -> Vec<f64> {
        let (n, field) = self.size();
        blurred(image, n, beam_uas * n as f64 / field)
    }

    /// The image, the same blurred, and its scatter over the draws.
    pub fn picture(&self) -> anyhow::Result<Figure> {
        let image = &self.survey.found().solution.image;
        let panel = |name, image, beam_uas| SkyPanel { name, image, polarized: None, beam_uas };
        let mut all = vec![
            panel("the image", image.clone(), None),
            panel("blurred to 20 µas", self.seen(image, BEAM_UAS), Some(BEAM_UAS)),
        ];
        let draws = self.survey.draws_that_count();
        if draws.len() > 1 {
            let scatter = scatter(&draws);
            all.push(panel("standard deviation of the draws", scatter, None));
        }
        let what = "The static image, linear between the centres of its pixels as in the fit.";
        let (n, field_uas) = self.size();
        sky(&all, n, field_uas, what)
    }

    /// The image with ticks along its polarisation, and as the beam sees it.
    pub fn polarized_picture(&self) -> anyhow::Result<Option<Figure>> {
        let Some(polarized) = &self.polarized else { return Ok(None) };
        let beam = polarized.settings.beam_uas;
        let pixels = self.file.image.pixels.pow(2);
        let images: Vec<&[f64]> = polarized.survey.found.images.chunks_exact(pixels).collect();
        let panel = |name, of: &dyn Fn(&[f64]) -> Vec<f64>, beam_uas| SkyPanel {
            name,
            image: of(images[0]),
            polarized: Some([of(images[1]), of(images[2])]),
            beam_uas,
        };
        let name = format!("with a beam of {beam} µas");
        let all = [
            panel("the image", &<[f64]>::to_vec, None),
            panel(&name, &|image| self.seen(image, beam), Some(beam)),
        ];
        let (n, field_uas) = self.size();
        sky(&all, n, field_uas, "Total intensity with linear polarisation.").map(Some)
    }

    /// The image as FITS, with Q and U where they were found.
    pub fn fits(&self) -> anyhow::Result<Option<Vec<u8>>> {
        let Some((seen, _)) = &self.measured.visibilities else { return Ok(None) };
        let pixels = self.file.image.pixels.pow(2);
        let images: Vec<&[f64]> = match &self.polarized {
            Some(polarized) => polarized.survey.found.images.chunks_exact(pixels).collect(),
            None => vec![&self.survey.found().solution.image],
        };
        Ok(Some(files::write_fits_image(&images, self.file.image.grid()?, seen)))
    }
}

/// Standard deviation of each pixel.
fn scatter(draws: &[&Candidate]) -> Vec<f64> {
    let count = draws.len() as f64;
    let pixels = draws.first().map_or(0, |draw| draw.solution.image.len());
    let of = |k: usize| {
        let values = || draws.iter().map(move |draw| draw.solution.image[k]);
        let mean = values().sum::<f64>() / count;
        (values().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt()
    };
    (0..pixels).map(of).collect()
}
