//! The image, blurred and as sure as it is.

use super::Found;
use crate::report::{Figure, enlarged, images};
use kerrlight_tomo::fit::static_image::{Candidate, blurred};

/// Full width at half maximum of the beam of the published images of M87*, µas (EHT Collaboration 2019, ApJL 875, L4).
const BEAM_UAS: f64 = 20.0;

/// Pixels of a drawn image, about.
const DRAWN: usize = 320;

impl Found<'_> {
    /// The image, the same blurred, and its scatter over the draws.
    pub fn picture(&self) -> anyhow::Result<Figure> {
        let n = self.file.image.pixels;
        let pixel = self.file.image.field_uas / n as f64;
        let image = &self.survey.found().solution.image;
        let zoom = (DRAWN / n).max(1);
        let blurred = blurred(image, n, BEAM_UAS / pixel);
        let mut all = vec![("the image", image.clone()), ("blurred to 20 µas", blurred)];
        if self.survey.draws.len() > 1 {
            all.push(("standard deviation of the draws", scatter(&self.survey.draws)));
        }
        let single = |image: &[f64]| image.iter().map(|x| *x as f32).collect::<Vec<f32>>();
        let fine: Vec<(&str, Vec<f32>)> =
            all.iter().map(|(name, image)| (*name, enlarged(&single(image), n, zoom))).collect();
        let brightness = image.iter().fold(0.0f64, |most, x| most.max(*x)) / (pixel * pixel);
        let what = format!(
            "The static image, linear between the centres of its pixels as in the fit; the field is {} µas wide. The brightest \
             pixel has {:.2e} Jy/µas².",
            self.file.image.field_uas, brightness
        );
        images(&fine, n * zoom, &what)
    }
}

/// Standard deviation of each pixel.
fn scatter(draws: &[Candidate]) -> Vec<f64> {
    let count = draws.len() as f64;
    let pixels = draws.first().map_or(0, |draw| draw.solution.image.len());
    let of = |k: usize| {
        let values = || draws.iter().map(move |draw| draw.solution.image[k]);
        let mean = values().sum::<f64>() / count;
        (values().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt()
    };
    (0..pixels).map(of).collect()
}
