//! The linear polarisation of a static image: numbers and sentences.

use super::numbers::with_error;
use crate::fit::folder::Folder;
use crate::fit::held_out::losses;
use crate::fit::results::gains::{Gains, POLARIZED_TABLE};
use crate::fit::results::leakage::Leakage;
use crate::report::{LinePlot, Outcome};
use anyhow::Context;
use kerrlight_imaging::settings::{StaticImageFile, StaticPolarization};
use kerrlight_imaging::{LinearPolarization, PolarizedSurvey, Survey};
use kerrlight_tomo::fit::FrameTerm;
use kerrlight_tomo::fit::setup::{FitData, told_end};
use kerrlight_tomo::fit::verdict::{Errors, Statistics, Tested};
use serde::Serialize;

/// A number: its key in results.json, kind, name, unit, digits, and meaning.
struct Number {
    key: &'static str,
    of: fn(&LinearPolarization) -> f64,
    kind: Kind,
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// A part of all light, of which images have too much.
    OfLight,
    Plain,
    /// An angle with its period, degrees.
    Angle(f64),
}

/// A factor with its error.
#[derive(Clone, Copy)]
struct Factor {
    value: f64,
    error: f64,
}

const NUMBERS: [Number; 7] = [
    Number {
        key: "net_fraction",
        of: |p| p.net_fraction,
        kind: Kind::OfLight,
        name: "net polarisation",
        unit: "",
        meaning: "|ΣP|/ΣI: what an array sees that does not resolve the source",
    },
    Number {
        key: "net_evpa_deg",
        of: |p| p.net_evpa_deg,
        kind: Kind::Angle(180.0),
        name: "net position angle",
        unit: "°",
        meaning: "of the electric vector of all light together, east of north",
    },
    Number {
        key: "mean_fraction",
        of: |p| p.mean_fraction,
        kind: Kind::OfLight,
        name: "mean polarisation",
        unit: "",
        meaning: "Σ|P|/ΣI of the image as the beam sees it",
    },
    Number {
        key: "brightest_fraction",
        of: |p| p.brightest_fraction,
        kind: Kind::Plain,
        name: "polarisation where it is brightest",
        unit: "",
        meaning: "|P|/I there, as the beam sees it",
    },
    Number {
        key: "brightest_deg",
        of: |p| p.brightest_deg,
        kind: Kind::Angle(360.0),
        name: "direction of that place",
        unit: "°",
        meaning: "from the centre, east of north: −90 is west",
    },
    Number {
        key: "beta2",
        of: |p| p.beta2,
        kind: Kind::OfLight,
        name: "|β₂|",
        unit: "",
        meaning: "modulus of Σ P e^(−2iφ)/ΣI: how much electric vectors turn with the direction φ from the centre",
    },
    Number {
        key: "beta2_deg",
        of: |p| p.beta2_deg,
        kind: Kind::Angle(360.0),
        name: "arg β₂",
        unit: "°",
        meaning: "0 for radial electric vectors, 180 for tangential ones, spirals between",
    },
];

/// Polarisation that was found.
pub struct Polarized {
    /// The settings.
    pub settings: StaticPolarization,
    /// The polarisation that was found.
    pub survey: PolarizedSurvey,
    /// Leakage of the stations, where it is solved for.
    pub leakage: Option<Leakage>,
    /// True if gains were solved for.
    has_gains: bool,
    /// Flux of the image over the flux that was found, with the relative error of the latter.
    light: Factor,
    /// Data, and what is left of them.
    count: usize,
}

/// Numbers of the polarisation, for results.json.
#[derive(Serialize)]
pub struct PolarizedNumbers {
    count: usize,
    strength: f64,
    iterations: usize,
    has_converged: bool,
    draws: usize,
    other_strengths: usize,
}

impl From<&Polarized> for PolarizedNumbers {
    fn from(of: &Polarized) -> Self {
        let found = &of.survey.found;
        Self {
            count: of.count,
            strength: found.strength,
            iterations: found.iterations,
            has_converged: found.has_converged,
            draws: of.survey.draws.len(),
            other_strengths: of.survey.strengths.len(),
        }
    }
}

impl Polarized {
    /// Takes the polarisation that was found of these data, and its residuals to be judged; writes leakage and gains of stations,
    /// where they were solved for.
    pub fn new(
        file: &StaticImageFile,
        measured: &FitData,
        survey: PolarizedSurvey,
        light: &Survey,
        folder: &Folder,
    ) -> anyhow::Result<Option<(Self, (String, Tested))>> {
        let table = survey.leakage.as_ref().map(|leakage| leakage.table.clone());
        let leakage = table.map(|table| Leakage::written(table, measured, folder)).transpose()?;
        let Some(settings) = file.polarization.clone() else { return Ok(None) };
        let images = &survey.found.images;
        let image: Vec<f32> = images.iter().map(|x| *x as f32).collect();
        let gains = measured.polarized_gains(&image.repeat(measured.times.len()))?;
        let gains = gains
            .map(|table| Gains::written(POLARIZED_TABLE, table, measured, folder))
            .transpose()?;
        // I, Q and U lie one after the other.
        let terms = measured.visibility_terms::<f64>(&[settings.loss()], images.len() / 3)?;
        let term: &dyn FrameTerm<f64> = &*terms.first().context("no polarised data")?.term;
        let frames = 0..measured.times.len();
        let residuals = frames.map(|frame| term.residuals(frame, images));
        let statistics = Statistics::of(residuals, 1);
        // Variability is common to many data: χ² may lie far below 1.
        let errors =
            if measured.has_intrinsic_variability { Errors::Shared } else { Errors::Stated };
        let count = statistics.all.count();
        let tested = (settings.data.label().to_owned(), Tested::gaussian(statistics, errors));
        let has_gains = gains.is_some();
        let (flux, error) = light.flux();
        let of_image: f64 = light.found().solution.image.iter().sum();
        let light = Factor { value: of_image / flux, error: error.unwrap_or(0.0) / flux };
        Ok(Some((Self { settings, survey, leakage, has_gains, light, count }, tested)))
    }

    /// A number with its error. Light that an image has and the sky has not is not polarised: fractions of all light are too small by it.
    fn value(&self, number: &Number) -> (f64, Option<f64>) {
        let value = (number.of)(&self.survey.found.numbers);
        let period = match number.kind {
            Kind::Angle(period) => Some(period),
            _ => None,
        };
        let error = self.survey.error(number.of, period);
        if number.kind != Kind::OfLight {
            return (value, error);
        }
        let value = self.light.value * value;
        (value, error.map(|error| (self.light.value * error).hypot(self.light.error * value)))
    }

    /// Returns whether a number is measured: a direction of what may be zero is none.
    fn is_seen(&self, number: &Number) -> bool {
        let of = match number.key {
            "net_evpa_deg" => &NUMBERS[0],
            "beta2_deg" => &NUMBERS[5],
            _ => return true,
        };
        let (value, error) = self.value(of);
        error.is_none_or(|error| value >= 2.0 * error)
    }

    /// χ² over the number of its data, with their kind.
    pub fn chi2(&self) -> (&'static str, f64) {
        (self.settings.data.label(), self.survey.found.chi2)
    }

    /// Numbers of results.json, with their errors.
    pub fn numbers(&self) -> Vec<(String, Option<f64>)> {
        let one = |number: &Number| {
            let ((value, error), key) =
                (self.value(number), format!("polarization_{}", number.key));
            [(key.clone(), Some(value)), (format!("{key}_error"), error)]
        };
        NUMBERS.iter().flat_map(one).collect()
    }

    /// The page's numbers.
    pub fn outcomes(&self) -> Vec<Outcome> {
        let one = |number: &Number| {
            let (value, error) = self.value(number);
            let digits = if number.unit.is_empty() { 3 } else { 0 };
            let Number { name, unit, meaning, .. } = *number;
            let value = match self.is_seen(number) {
                true => with_error(value, error, digits),
                false => "not measured".to_owned(),
            };
            Outcome { name, value, unit, meaning }
        };
        NUMBERS.iter().map(one).collect()
    }

    /// Describes the result, in a sentence.
    pub fn sentence(&self) -> String {
        let [net, _, mean, brightest, direction, beta, angle] =
            NUMBERS.each_ref().map(|number| self.value(number));
        let per_cent = |(value, error): (f64, Option<f64>)| {
            with_error(100.0 * value, error.map(|error| 100.0 * error), 1)
        };
        let argument = match self.is_seen(&NUMBERS[6]) {
            true => format!("the argument {}°", with_error(angle.0, angle.1, 0)),
            false => "no measured argument: it is less than two errors from 0".to_owned(),
        };
        format!(
            "Seen with a beam of {} µas, {} % of the light is linearly polarised, {} % where polarised light is brightest ({}° east \
             of north of the centre), and {} % of all light together; β₂ has the modulus {} and {argument}.",
            self.settings.beam_uas,
            per_cent(mean),
            per_cent(brightest),
            with_error(direction.0, direction.1, 0),
            per_cent(net),
            with_error(beta.0, beta.1, 3)
        )
    }

    /// Describes the assumptions.
    pub fn model(&self) -> Vec<String> {
        let StaticPolarization { leakage_left, smoothness, variability, .. } = &self.settings;
        let tried = self.settings.strength.iter().flat_map(|s| s.values.iter().copied());
        let mut text = vec![format!(
            "Linear polarisation was found after total intensity, which was held: a fraction and a position angle in every pixel, \
             from {} {}. {} % of Stokes I from each station were added to errors of RL and LR for leakage. Slopes of the \
             fraction are penalised in proportion to light (weight {smoothness}, times {}{}).",
            self.count,
            self.settings.data.label(),
            100.0 * leakage_left,
            self.survey.found.strength,
            told_end(tried, self.survey.found.strength)
        )];
        if let Some(law) = variability {
            text.push(format!(
                "What polarised light varies: {} Jy/(1 + (|u|/{:e})²)^{} was added to errors of RL and LR in quadrature.",
                law.jy,
                law.uv,
                0.5 * law.power
            ));
        }
        text.extend(self.leakage.iter().flat_map(Leakage::sentences));
        if self.has_gains {
            text.push(format!(
                "Gains were solved for anew beside the polarised image: {POLARIZED_TABLE} has them, which belong to its χ² and \
                 its leakage. gains.csv has those beside total intensity."
            ));
        }
        text
    }

    /// Describes what errors are made of.
    pub fn errors(&self) -> Option<String> {
        let (draws, others) = (self.survey.draws.len(), self.survey.strengths.len());
        (draws > 1).then(|| {
            format!(
                "Errors of polarisation: {draws} images of the data with their noise once more, each beside a draw of total \
                 intensity, and {others} images with other factors on the penalty that predict held-out frames as well. \
                 Leakage, the kind of penalty and the frames' length are in no error."
            )
        })
    }

    /// Describes what the data do not tell.
    pub fn not_concluded(&self) -> Vec<String> {
        let mut text = vec![
            "Circular polarisation, and Faraday rotation: position angles are those that arrive here. Fractions are lower limits \
             where the beam mixes directions."
                .to_owned(),
        ];
        if !self.survey.found.has_converged {
            let unfinished = "The optimiser of polarisation had not come to its end after polarization.iterations.";
            text.push(unfinished.to_owned());
        }
        text
    }

    /// The loss of held-out frames against the strength.
    pub fn held_out(&self) -> Option<LinePlot> {
        let labels =
            ["Held-out frames: polarisation", "factor on the penalty", "χ² of held-out data"];
        let caption = "χ² per data point of polarised frames that were not fitted, against the factor on the penalty; bars are \
                       standard errors of the difference from the best. The least is taken.";
        losses(&self.survey.held, labels, caption)
    }
}
