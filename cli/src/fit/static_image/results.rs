//! results.json of a static image.

use super::Found;
use super::numbers::{Number, RING, chi2_of_draws, of_ring};
use super::polarized::{Polarized, PolarizedNumbers};
use crate::fit::closures::{self, ClosureResults};
use crate::fit::inputs::InputFile;
use crate::fit::results::gains::{GainResults, Gains};
use crate::fit::results::leakage::{Leakage, LeakageResults};
use crate::fit::results::verdict::VerdictResults;
use crate::session;
use crate::usage::usage;
use kerrlight_imaging::{Candidate, ShapeFit};
use kerrlight_tomo::fit::setup::Held;
use serde::Serialize;
use std::collections::BTreeMap;

/// All numbers of a static image, as results.json has them; what was not asked for is left out.
#[derive(Serialize)]
pub struct Results {
    version: &'static str,
    kind: &'static str,
    steps: usize,
    /// Wall time, s.
    pub seconds: f64,
    cpu_seconds: Option<f64>,
    peak_memory_mib: Option<f64>,
    loss: f64,
    chi2_per_datum: BTreeMap<&'static str, f64>,
    chi2_not_fitted: BTreeMap<&'static str, f64>,
    chi2_of_draws: BTreeMap<&'static str, OfDraws>,
    inputs: Vec<InputFile>,
    verdict: VerdictResults,
    /// All light of the field less what the method adds, Jy.
    pub flux_jy: f64,
    /// Its standard deviation.
    pub flux_error_jy: Option<f64>,
    flux_of_image_jy: f64,
    strength: f64,
    envelope_fwhm_uas: Option<f64>,
    starts: Vec<ImageNumbers>,
    strengths: Vec<ImageNumbers>,
    draws: Vec<ImageNumbers>,
    #[serde(skip_serializing_if = "Option::is_none")]
    known_sky: Option<KnownSky>,
    has_converged: bool,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    closures: Vec<ClosureResults>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    held_out: Vec<HeldLoss>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gains: Option<GainResults>,
    #[serde(skip_serializing_if = "Option::is_none")]
    polarization: Option<PolarizedNumbers>,
    #[serde(skip_serializing_if = "Option::is_none")]
    leakage: Option<LeakageResults>,
    shapes: Vec<ShapeNumbers>,
    images_with_ring: WithRing,
    #[serde(skip_serializing_if = "Option::is_none")]
    ring: Option<RingPlace>,
    ring_sentence: Option<String>,
    /// Numbers of the ring and of polarisation, with their errors.
    #[serde(flatten)]
    numbers: BTreeMap<String, Option<f64>>,
}

/// Mean and standard deviation over draws.
#[derive(Serialize)]
struct OfDraws {
    mean: f64,
    deviation: f64,
}

/// Losses of a strength.
#[derive(Serialize)]
struct HeldLoss {
    value: f64,
    loss: f64,
    losses: Vec<f64>,
}

/// Number of images with a ring.
#[derive(Serialize)]
struct WithRing {
    count: usize,
    of: usize,
}

/// Place of the ring, and its scatter.
#[derive(Serialize)]
struct RingPlace {
    centre_east_uas: f64,
    centre_north_uas: f64,
    diameter_scatter_uas: f64,
}

/// An image as it is listed.
#[derive(Serialize)]
struct ImageNumbers {
    start: usize,
    strength: f64,
    loss: f64,
    flux_jy: f64,
    iterations: usize,
    has_converged: bool,
    chi2_per_datum: Vec<f64>,
    ring_diameter_uas: Option<f64>,
    ring_position_angle_deg: Option<f64>,
    ring_asymmetry: Option<f64>,
}

/// A simple shape, and images of its simulated data.
#[derive(Serialize)]
struct KnownSky {
    flux_jy: f64,
    ring_diameter_uas: Option<f64>,
    ring_position_angle_deg: Option<f64>,
    ring_asymmetry: Option<f64>,
    images: Vec<ImageNumbers>,
}

impl From<&Candidate> for ImageNumbers {
    fn from(image: &Candidate) -> Self {
        Self {
            start: image.start + 1,
            strength: image.strength,
            loss: image.solution.loss,
            flux_jy: image.solution.image.iter().sum(),
            iterations: image.solution.iterations,
            has_converged: image.solution.has_converged,
            chi2_per_datum: image.chi2.clone(),
            ring_diameter_uas: image.ring.map(|ring| ring.diameter_uas),
            ring_position_angle_deg: image.ring.map(|ring| ring.position_angle_deg),
            ring_asymmetry: image.ring.map(|ring| ring.asymmetry),
        }
    }
}

/// A shape as it is listed.
#[derive(Serialize)]
struct ShapeNumbers {
    shape: &'static str,
    sizes: BTreeMap<&'static str, f64>,
    flux_jy: f64,
    chi2_per_datum: Vec<f64>,
    criterion: f64,
}

impl From<&ShapeFit> for ShapeNumbers {
    fn from(fit: &ShapeFit) -> Self {
        Self {
            shape: fit.shape.name(),
            sizes: fit.sizes.iter().map(|(name, value, _)| (*name, *value)).collect(),
            flux_jy: fit.flux_jy,
            chi2_per_datum: fit.chi2.clone(),
            criterion: fit.criterion,
        }
    }
}

impl Found<'_> {
    /// All numbers.
    pub fn results(&self) -> Results {
        let found = self.survey.found();
        let kinds = || self.file.loss.iter().map(|loss| loss.data.label());
        let polarized = self.polarized.as_ref();
        let all = |images: &[Candidate]| images.iter().map(ImageNumbers::from).collect();
        let held = |held: &Held| HeldLoss {
            value: held.value,
            loss: held.mean(),
            losses: held.losses.clone(),
        };
        let drawn = |[mean, deviation]: [f64; 2]| OfDraws { mean, deviation };
        let [with, of] = self.survey.with_ring();
        let of_polarized = polarized.map(Polarized::numbers).into_iter().flatten();
        let (flux_jy, flux_error_jy) = self.survey.flux();
        let chi2 = kinds().zip(found.chi2.iter().copied());
        Results {
            version: env!("CARGO_PKG_VERSION"),
            kind: "static image",
            steps: found.solution.iterations,
            seconds: self.begun.elapsed().as_secs_f64(),
            cpu_seconds: usage().map(|usage| usage.cpu_seconds - session::cpu_seconds_before()),
            peak_memory_mib: usage().map(|usage| usage.peak_mib),
            loss: found.solution.loss,
            chi2_per_datum: chi2.chain(polarized.map(Polarized::chi2)).collect(),
            chi2_not_fitted: self.beside.iter().map(|(name, chi2)| (*name, *chi2)).collect(),
            chi2_of_draws: kinds()
                .zip(chi2_of_draws(&self.survey).into_iter().map(drawn))
                .collect(),
            inputs: self.folder.inputs.files.clone(),
            verdict: VerdictResults::from(&self.judged),
            flux_jy,
            flux_error_jy,
            flux_of_image_jy: found.solution.image.iter().sum(),
            strength: self.survey.strength,
            envelope_fwhm_uas: self.survey.envelope.map(|envelope| envelope.fwhm_uas),
            starts: all(&self.survey.starts),
            strengths: all(&self.survey.strengths),
            draws: all(&self.survey.draws),
            known_sky: self.survey.known_sky.as_ref().map(|known| KnownSky {
                flux_jy: known.shape.iter().sum(),
                ring_diameter_uas: known.ring.map(|ring| ring.diameter_uas),
                ring_position_angle_deg: known.ring.map(|ring| ring.position_angle_deg),
                ring_asymmetry: known.ring.map(|ring| ring.asymmetry),
                images: all(&known.images),
            }),
            has_converged: found.solution.has_converged,
            closures: closures::results(self.measured, &self.file.loss),
            held_out: self.survey.held.iter().map(held).collect(),
            gains: self.gains.as_ref().map(Gains::results),
            polarization: polarized.map(PolarizedNumbers::from),
            leakage: polarized.and_then(|of| of.leakage.as_ref()).map(Leakage::results),
            shapes: self.shapes.iter().map(ShapeNumbers::from).collect(),
            images_with_ring: WithRing { count: with, of },
            ring: self.ring().map(|ring| RingPlace {
                centre_east_uas: ring.centre_uas[0],
                centre_north_uas: ring.centre_uas[1],
                diameter_scatter_uas: ring.diameter_scatter_uas,
            }),
            ring_sentence: self.ring_sentence(),
            numbers: self.ring_numbers().into_iter().chain(of_polarized).collect(),
        }
    }

    /// Numbers of the ring, with their errors; none without one.
    fn ring_numbers(&self) -> Vec<(String, Option<f64>)> {
        let Some(ring) = self.ring() else { return Vec::new() };
        let one = |(name, number): (&str, Number)| {
            let (value, error) = of_ring(&self.survey, &ring, name, number);
            [(name.to_owned(), Some(value)), (format!("{name}_error"), error)]
        };
        let of_image = [
            ("ring_diameter_of_image_uas".to_owned(), Some(ring.diameter_uas)),
            ("ring_position_angle_of_image_deg".to_owned(), Some(ring.position_angle_deg)),
        ];
        RING.into_iter().flat_map(one).chain(of_image).collect()
    }
}
