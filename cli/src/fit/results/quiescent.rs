//! Emission that does not move, recovered beside the moving one: files, a picture and numbers.

use super::Estimate;
use crate::report::{self, Figure, enlarged};
use kerrlight_render::image::{Channel, Picture, exr};
use kerrlight_render::polarization::StokesParameter;
use kerrlight_tomo::fit::setup::Truth;
use kerrlight_tomo::fit::{State, Trainer};
use kerrlight_vlbi::files::images;
use serde::Serialize;
use std::collections::BTreeMap;

/// The images as arrays, as channels, and as a picture.
const ARRAYS: &str = "quiescent.npz";
const CHANNELS: &str = "quiescent.exr";
const PICTURE: &str = "quiescent.png";

/// Pixels of a drawn image, about.
const DRAWN: usize = 320;

/// Images of the parameters that data see, or their fluxes.
pub struct Quiescent {
    is_flux: bool,
    /// Jy in a pixel, or Jy.
    images: Vec<(StokesParameter, Vec<f32>)>,
    /// The true ones, in the same order.
    truth: Option<Vec<Vec<f32>>>,
}

/// What does not move, as results.json has it.
#[derive(Serialize)]
pub struct QuiescentResults {
    #[serde(flatten)]
    images: BTreeMap<&'static str, ImageResults>,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<&'static str>,
}

/// Light of one parameter.
#[derive(Serialize)]
struct ImageResults {
    flux_jy: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    beside_the_truth: Option<Closeness>,
}

/// Distance of an image from the truth; nothing but the true flux of what is no image.
#[derive(Serialize)]
struct Closeness {
    #[serde(skip_serializing_if = "Option::is_none")]
    correlation: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    relative_error: Option<f64>,
    flux_jy: f64,
}

impl Quiescent {
    /// All pixels, Jy, and whether they are fluxes.
    pub fn values(&self) -> (Vec<f32>, bool) {
        (self.images.iter().flat_map(|(_, image)| image.iter().copied()).collect(), self.is_flux)
    }
}

impl Estimate<'_> {
    /// Returns the emission that does not move, where it was recovered; writes its files.
    pub fn quiescent(
        &self,
        trainer: &Trainer<'_, f32>,
        state: &State<f32>,
    ) -> anyhow::Result<Option<Quiescent>> {
        let Some(image) = trainer.objective.model.quiescent() else { return Ok(None) };
        let all = image.images(&state.now.parameters);
        let planes = all.chunks_exact(image.pixels).map(<[f32]>::to_vec);
        let parameters = self.instrument.seen.parameters();
        let images: Vec<_> = parameters.iter().copied().zip(planes).collect();
        let is_flux = self.instrument.seen.is_flux();
        let of = |truth: &Truth| -> Option<Vec<Vec<f32>>> {
            let one = |parameter: &StokesParameter| truth.quiescent(*parameter);
            let all = parameters.iter().map(one).collect::<Option<Vec<_>>>()?;
            // The truth is an image also where data see its flux alone.
            let single = |image: &[f64]| match is_flux {
                true => vec![image.iter().sum::<f64>() as f32],
                false => image.iter().map(|x| *x as f32).collect(),
            };
            Some(all.into_iter().map(single).collect())
        };
        let truth = self.measured.truth.as_ref().and_then(of);
        let found = Quiescent { is_flux, images, truth };
        if !is_flux {
            self.quiescent_files(&found)?;
        }
        Ok(Some(found))
    }

    fn quiescent_files(&self, found: &Quiescent) -> anyhow::Result<()> {
        let n = self.file.screen.pixels;
        let flat = |images: Vec<&Vec<f32>>| images.into_iter().flatten().copied().collect();
        let recovered: Vec<f32> = flat(found.images.iter().map(|(_, image)| image).collect());
        let mut all = vec![("recovered", recovered)];
        if let Some(truth) = &found.truth {
            all.push(("truth", flat(truth.iter().collect())));
        }
        let shape = [found.images.len(), n, n];
        let lists: Vec<_> = self.field().into_iter().collect();
        let bytes = images::movie_archive(shape, &all, &lists);
        self.folder.file(ARRAYS)?.write(&bytes)?;
        let channel = |(parameter, image): &(StokesParameter, Vec<f32>)| Channel {
            name: match parameter {
                StokesParameter::I => "intensity".to_owned(),
                other => other.name().to_owned(),
            },
            values: image.clone(),
        };
        let channels = found.images.iter().map(channel).collect();
        let picture = Picture { width: n, height: n, channels };
        let unit = ("unit".to_owned(), "Jy/pixel".to_owned());
        let bytes = exr::encode(&picture, &exr::Attributes::from([unit]), exr::Style::default())?;
        self.folder.file(CHANNELS)?.write(&bytes)
    }

    /// The picture of its I, and of the true one.
    pub fn quiescent_figure(&self, found: &Quiescent) -> anyhow::Result<Option<Figure>> {
        let first = found.images.first().filter(|(of, _)| *of == StokesParameter::I);
        let Some((_, image)) = first.filter(|_| !found.is_flux) else { return Ok(None) };
        let n = self.file.screen.pixels;
        let zoom = (DRAWN / n).max(1);
        let mut shown = vec![("recovered", enlarged(image, n, zoom))];
        if let Some(truth) = &found.truth {
            shown.push(("truth", enlarged(&truth[0], n, zoom)));
        }
        let most = image.iter().fold(0.0f32, |most, x| most.max(*x));
        let what = format!(
            "What does not move: the image that was recovered beside the emission and is added to every frame. Its brightest \
             pixel has {most:.2e} Jy."
        );
        let figure = report::images(&shown, n * zoom, &what)?;
        self.folder.file(PICTURE)?.write(&figure.png)?;
        Ok(Some(figure))
    }
}

impl Quiescent {
    fn closeness(&self, k: usize) -> Option<Closeness> {
        let (found, truth) = (&self.images[k].1, self.truth.as_ref()?.get(k)?);
        let double = |x: &[f32]| x.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
        let (found, truth) = (double(found), double(truth));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let apart: Vec<f64> = found.iter().zip(&truth).map(|(a, b)| a - b).collect();
        let correlation = dot(&found, &truth) / (dot(&found, &found) * dot(&truth, &truth)).sqrt();
        let relative_error = (dot(&apart, &apart) / dot(&truth, &truth)).sqrt();
        Some(Closeness {
            correlation: (!self.is_flux).then_some(correlation),
            relative_error: (!self.is_flux).then_some(relative_error),
            flux_jy: truth.iter().sum(),
        })
    }

    fn flux(&self, k: usize) -> f64 {
        self.images[k].1.iter().map(|x| f64::from(*x)).sum()
    }

    /// Returns its numbers for results.json.
    pub fn results(&self) -> QuiescentResults {
        let one = |k: usize| {
            let beside_the_truth = self.closeness(k);
            let image = ImageResults { flux_jy: self.flux(k), beside_the_truth };
            (self.images[k].0.name(), image)
        };
        let images = (0..self.images.len()).map(one).collect();
        QuiescentResults { images, file: (!self.is_flux).then_some(ARRAYS) }
    }

    /// Sentences for the report.
    pub fn sentences(&self) -> Vec<String> {
        let flux = |k: usize| format!("{} = {:.4} Jy", self.images[k].0.name(), self.flux(k));
        let fluxes: Vec<String> = (0..self.images.len()).map(flux).collect();
        let what =
            if self.is_flux { "Fluxes that do not change" } else { "An image that does not move" };
        let mut all = vec![format!("{what} recovered beside the emission: {}.", fluxes.join(", "))];
        if let Some(Closeness {
            correlation: Some(correlation),
            relative_error: Some(error),
            flux_jy,
        }) = self.closeness(0)
        {
            all.push(format!(
                "Its correlation with the true one, which has {flux_jy:.4} Jy, is {correlation:.4}; the relative error is {error:.3}."
            ));
        }
        all
    }
}
