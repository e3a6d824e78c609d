//! Words on a static image: data, model, priors, and what may be concluded.

use super::Found;
use super::numbers::{RING, of_ring, with_error};
use super::polarized::Polarized;
use crate::fit::closures;
use crate::fit::results::medium;
use crate::report::Part;
use kerrlight_imaging::settings::{RingSettings, StartImage, StrengthSettings};
use kerrlight_imaging::{
    Calibration, Candidate, Envelope, MOST_CENTRAL, Profile, ShapeFit, Survey, best_shape,
};
use kerrlight_tomo::fit::settings::LossKind;
use kerrlight_tomo::fit::setup::told_end;

impl Found<'_> {
    /// The ring in a sentence, where one is looked for.
    pub fn ring_sentence(&self) -> Option<String> {
        self.file.ring.map(|between| ring(&self.survey, &self.shapes, &between))
    }
}

/// The numbers of a ring where one is claimed, and why none is where the image or a simple shape has one.
fn ring(survey: &Survey, shapes: &[ShapeFit], between: &RingSettings) -> String {
    let Some(ring) = survey.found().ring else { return no_ring(survey, shapes, between) };
    if let Some(doubt) = doubt(survey, shapes) {
        return format!("The image looks like a ring, but {doubt}: no ring is claimed.");
    }
    let [diameter, width, angle, asymmetry, _] =
        RING.map(|(name, number)| of_ring(survey, &ring, name, number));
    let is_even = asymmetry.1.is_none_or(|error| asymmetry.0 < 2.0 * error);
    let bright = match angle.1 {
        Some(error) if error > EVEN_DEG && is_even => {
            "as bright on all sides within the errors".to_owned()
        }
        Some(error) if error > EVEN_DEG => {
            "brighter on one side, whose direction is not known".to_owned()
        }
        Some(error) => {
            format!("brightest at {}° east of north", with_error(angle.0, Some(error), 0))
        }
        None => format!("brightest at {:.0}° east of north, without an error", angle.0),
    };
    let [with, all] = survey.with_ring();
    let others = match with == all {
        true => String::new(),
        false => format!(" {with} of {all} images that the data allow have one of this size."),
    };
    format!(
        "The image has a ring of {} µas, {} µas wide, {bright}.{others}",
        with_error(diameter.0, diameter.1, 1),
        with_error(width.0, width.1, 1),
    )
}

/// States that the image has no ring, and whether a simple shape with one fits the data better than those without.
fn no_ring(survey: &Survey, shapes: &[ShapeFit], between: &RingSettings) -> String {
    let [with, all] = survey.with_ring();
    let none = format!(
        "The image has no ring between the radii of [ring], nor have {} of {all} images that the data allow",
        all - with
    );
    let Some(best) = best_shape(shapes.iter()).filter(|best| best.shape.is_ring()) else {
        return format!("{none}.");
    };
    let sizes = best.sizes.iter().map(|(name, value, unit)| format!("{name} {value:.0} {unit}"));
    let radius = best.sizes.iter().find(|(name, ..)| *name == "diameter").map(|size| 0.5 * size.1);
    let range = between.least_radius_uas..=between.most_radius_uas;
    let means = match radius.is_none_or(|radius| range.contains(&radius)) {
        false => "change ring.least_radius_uas and ring.most_radius_uas to look for it",
        true if !survey.found().solution.has_converged => "the image did not come to a minimum",
        true => "the data allow a ring and do not require it",
    };
    format!(
        "{none}, but of the simple shapes a {} fits best ({}): {means}.",
        best.shape.name(),
        sizes.collect::<Vec<_>>().join(", ")
    )
}

/// Explains why the ring of an image is not claimed: other images that the data allow have none, or a shape without a hole
/// fits better than a ring and a crescent.
pub fn doubt(survey: &Survey, shapes: &[ShapeFit]) -> Option<String> {
    let [with, all] = survey.with_ring();
    if (with as f64) < LEAST_AGREEMENT * all as f64 {
        return Some(format!("{with} of {all} images that the data allow have one of this size"));
    }
    let ring = survey.found().ring?;
    let (diameter, error) = survey.ring_diameter().unwrap_or((ring.diameter_uas, None));
    if let Some(error) = error.filter(|error| diameter < LEAST_CERTAINTY * error) {
        return Some(format!("its diameter, {diameter:.0} ± {error:.0} µas, is not measured"));
    }
    let central = survey.ring_number(|ring| ring.central_brightness);
    let (central, error) = central.unwrap_or((ring.central_brightness, None));
    if let Some(error) = error.filter(|error| central + error > MOST_CENTRAL) {
        return Some(format!(
            "its middle may be filled: {central:.2} ± {error:.2} as bright as it"
        ));
    }
    let least =
        |is_ring: bool| best_shape(shapes.iter().filter(|fit| fit.shape.is_ring() == is_ring));
    // Without shapes of both kinds nothing speaks against the ring.
    let (ring, other) = (least(true)?, least(false)?);
    (other.criterion < ring.criterion).then(|| {
        format!(
            "a {} fits the data better than a {} (χ² with a penalty on parameters {:.0} and {:.0}){}",
            other.shape.name(),
            ring.shape.name(),
            other.criterion,
            ring.criterion,
            if other.explains { "" } else { ", though neither explains them" }
        )
    })
}

/// Error of the direction in which a ring is brightest from which on it has none: directions of an even ring scatter by 104°.
const EVEN_DEG: f64 = 45.0;

/// Part of the images that the data allow which have to have a ring.
const LEAST_AGREEMENT: f64 = 0.8;

/// Errors that the diameter of a ring has to be from 0.
const LEAST_CERTAINTY: f64 = 3.0;

impl Found<'_> {
    /// Paragraphs under headings.
    pub fn parts(&self) -> Vec<Part> {
        vec![
            Part { heading: "Data", text: self.data() },
            Part { heading: "Model and priors", text: self.model() },
            Part { heading: "How sure it is", text: self.errors() },
            Part { heading: "What is concluded", text: self.concluded() },
            Part { heading: "What is not concluded", text: self.not_concluded() },
        ]
    }

    fn data(&self) -> Vec<String> {
        let data = &self.file.data.visibilities;
        let rows = self.measured.visibilities.iter().flat_map(|(seen, _)| seen.stokes_i()).count();
        let kinds: Vec<&str> = self.file.loss.iter().map(|loss| loss.data.label()).collect();
        let mut text = vec![format!(
            "{}: {rows} visibilities of Stokes I in {} frames of {} s; {} are fitted. {} % of each amplitude was added to its \
             error in quadrature.",
            data.path.names(),
            self.measured.times.len(),
            data.average_s,
            kinds.join(", "),
            100.0 * data.systematic
        )];
        if data.path.all().len() > 1 {
            text.push(
                "The files share the image alone: each has gains of its own, and nothing closes across them. From the second \
                 on (2), (3) … stand behind the names of stations."
                    .to_owned(),
            );
        }
        if let Some(least) = data.uv_min {
            text.push(format!("Baselines below {least:e} wavelengths are left out."));
        }
        text.extend(self.file.loss.iter().map(|loss| formula(loss.data, self.gains.is_some())));
        let closures = closures::sentences(self.measured, &self.file.loss);
        text.extend(closures.into_iter().map(|sentence| sentence + "."));
        text.extend(medium::sentences(data.scattering, data.variability));
        text
    }

    fn model(&self) -> Vec<String> {
        let image = &self.file.image;
        let starts: Vec<String> = image.starts.iter().copied().map(start).collect();
        let penalties: Vec<String> = self
            .file
            .regulariser
            .iter()
            .map(|penalty| format!("{:?} (weight {})", penalty.kind, penalty.weight))
            .collect();
        let (flux, error) = self.survey.flux();
        let mut text = vec![
            format!(
                "One image of {} × {} positive pixels in a field of {} µas for all frames: nothing moves. No hole, no gas and no \
                 ring is assumed. Its flux has a Gaussian prior, {} ± {} Jy, and came out as {} Jy ({:.3} Jy in the image).",
                image.pixels,
                image.pixels,
                image.field_uas,
                image.flux_jy,
                image.flux_sigma_jy,
                with_error(flux, error, 3),
                self.survey.found().solution.image.iter().sum::<f64>()
            ),
            format!("Starts: {}; then the simple shapes that fit the data.", starts.join("; ")),
        ];
        let envelope = self.file.envelope.zip(self.survey.envelope);
        let envelope = envelope.map(|(settings, Envelope { profile, fwhm_uas })| {
            let of_shape = match settings.fwhm_uas {
                Some(_) => "",
                None => " with the second moment of the best simple shape",
            };
            let what = match profile {
                Profile::Gaussian => "a Gaussian of",
                Profile::Flat => "a flat disc with soft edges, as wide as a Gaussian of",
            };
            let weight = settings.weight;
            format!("entropy relative to {what} {fwhm_uas:.1} µas{of_shape} (weight {weight})")
        });
        let penalties: Vec<String> = envelope.into_iter().chain(penalties).collect();
        if !penalties.is_empty() {
            text.push(format!(
                "Penalties: {}, all times {}.",
                penalties.join(", "),
                self.survey.strength
            ));
        }
        text.extend(self.factor());
        match &self.gains {
            Some(gains) => text.extend(gains.sentences()),
            None => text.push("No gains are solved for.".to_owned()),
        }
        text.extend(self.polarized.iter().flat_map(Polarized::model));
        text
    }

    /// Describes how the factor on the penalties was chosen, where there is a list.
    fn factor(&self) -> Option<String> {
        let StrengthSettings { values, folds } = self.file.strength.as_ref()?;
        if self.survey.held.is_empty() {
            return Some(format!(
                "Frames that were not fitted choose no factor: too few fits of {} came to a minimum, and the middle factor is taken.",
                values.len() * folds
            ));
        }
        let tried = values.iter().copied();
        Some(format!(
            "The factor is the largest of {} that predicts frames which were not fitted as well as the best, within a standard error{}.",
            self.survey.held.len(),
            told_end(tried, self.survey.strength)
        ))
    }

    fn errors(&self) -> Vec<String> {
        let (draws, others) = (self.survey.draws.len(), self.survey.alternatives().count());
        if draws < 2 {
            return vec!["No draws were asked for: numbers have no errors.".to_owned()];
        }
        let known_sky = self.survey.known_sky.as_ref();
        let flux = match self.survey.calibration().is_some_and(|known| known.explains) {
            true => "",
            false => "a flux drawn from its prior, ",
        };
        let mut text = vec![format!(
            "Errors add in quadrature how far {draws} images of measurements of this image with other noise, {flux}an envelope 10 % \
             wider or narrower (one standard deviation), and starts and factors that are as good, are from it (root mean \
             square, what the method distorts included), and how far {others} images are that the data do not tell from the \
             best: of other starts with a loss within 1 %, and of other factors that predict held-out frames as well. The kind \
             of penalty, the field and the size of pixels stay what they are: what they decide is in no error."
        )];
        text.extend(known_sky.map(calibrated));
        text.extend(self.polarized.as_ref().and_then(Polarized::errors));
        text
    }

    fn concluded(&self) -> Vec<String> {
        let mut text = vec![self.judged.headline()];
        text.extend(self.unfinished());
        for (name, chi2) in &self.beside {
            text.push(format!("χ² {chi2:.2} per data point of {name}, which were not fitted."));
        }
        text.extend(self.ring_sentence());
        text.push(shapes_beside(&self.shapes));
        text.extend(self.polarized.as_ref().map(Polarized::sentence));
        text
    }

    /// Says so where the optimiser has come to no minimum.
    pub fn unfinished(&self) -> Option<String> {
        let stopped = |image: &&Candidate| !image.solution.has_converged;
        let (draws, of) = (&self.survey.draws, self.file.image.iterations);
        let count = draws.iter().filter(stopped).count();
        if !self.survey.found().solution.has_converged {
            return Some(format!(
                "The optimiser did not come to a minimum in image.iterations = {of}: the image, its numbers and their errors \
                 are unfinished."
            ));
        }
        let effect = match 2 * count > draws.len() {
            true => "errors are too small",
            false => "errors are those of the others",
        };
        (count > 0).then(|| {
            format!(
                "{count} of {} draws did not come to a minimum in image.iterations = {of}: {effect}.",
                draws.len()
            )
        })
    }

    fn not_concluded(&self) -> Vec<String> {
        let mut text = vec![
            "The position on the sky: neither closure phases nor amplitudes know it. Detail finer than the longest baselines \
             resolve is that of the penalties, and brightness that is spread wider than the shortest baselines see is that of \
             the prior of the flux and of the field."
                .to_owned(),
            "Mass, spin and inclination: the image knows of no hole. The width of the ring includes what the array and the \
             penalties blur."
                .to_owned(),
        ];
        if self.file.data.visibilities.variability.is_some() {
            text.push(
                "That the source stands still: errors stand for what it varies, whatever way it moves. `kerrlight fit --data \
                 FILE --model volume` fits emission that moves."
                    .to_owned(),
            );
        }
        text.extend(self.polarized.iter().flat_map(Polarized::not_concluded));
        text
    }
}

/// What images of a known sky have changed.
fn calibrated(known: &Calibration) -> String {
    let rest = match known.explains {
        true => {
            "explains the data, so that what it adds to flux, gains and ring (to the brightest direction where these images agree on one) is taken off, and the scatter of the draws about their mean counts in place of their distance"
        }
        false => {
            "does not explain the data, so that what it adds to flux, gains and ring is part of their errors"
        }
    };
    format!(
        "{} images of measurements of the best simple shape tell what the method makes of a known sky. The shape {rest}. Where an \
         image did not come to a minimum, nothing is taken off.",
        known.images.len()
    )
}

/// χ² of a kind of data, as it is computed.
fn formula(kind: LossKind, has_gains: bool) -> String {
    let name = kind.label();
    let least = |of: &str, plain: &str| match has_gains {
        true => format!("the least {of} + Σ (ln|g|/s)² over gains g with the priors s"),
        false => plain.to_owned(),
    };
    let what = match kind {
        LossKind::Amplitudes => {
            least("Σ (|g₁ g₂ V| − A)²/σ²", "Σ (|V| − A)²/σ²") + ", with A² = |V_data|² − σ²"
        }
        LossKind::ClosurePhases | LossKind::LogClosureAmplitudes => {
            "Σ rᵀ C⁻¹ r over frames, with r the differences of an independent set from the image and C = Σ ± (σ/|V|)² over \
             the baselines that two of them share"
                .to_owned()
        }
        _ => least("Σ |g₁ ḡ₂ V − V_data|²/σ²", "Σ |V − V_data|²/σ²"),
    };
    format!("χ² of {name} is {what}.")
}

/// Simple shapes in a sentence, the one that fits best first.
fn shapes_beside(shapes: &[ShapeFit]) -> String {
    let mut all: Vec<&ShapeFit> = shapes.iter().collect();
    all.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let one = |fit: &&ShapeFit| format!("{} {:.0}", fit.shape.name(), fit.criterion);
    let all: Vec<String> = all.iter().map(one).collect();
    format!(
        "Simple shapes with the same gains, by χ² with a penalty on their parameters, the least first: {}.",
        all.join(", ")
    )
}

fn start(start: StartImage) -> String {
    match start {
        StartImage::Ring { diameter_uas, width_uas } => {
            format!("a ring of {diameter_uas} µas, {width_uas} µas wide")
        }
        StartImage::Gaussian { fwhm_uas } => format!("a Gaussian of {fwhm_uas} µas"),
    }
}
