//! The page of a static image.

use super::Found;
use super::numbers::{RING, of_ring, with_error};
use super::polarized::Polarized;
use super::results::Results;
use crate::fit::held_out::losses;
use crate::fit::results::gains::Gains;
use crate::fit::results::leakage::Leakage;
use crate::fit::results::page::{details, settings};
use crate::fit::results::verdict::{self, Evidence};
use crate::fit::results::{plots, residuals};
use crate::report::{LinePlot, Outcome, Report, Table};
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_imaging::{Candidate, ShapeFit};

/// Names of the numbers of a ring, their units and meaning.
const MEANINGS: [(&str, &str, usize, &str); 5] = [
    (
        "diameter of the ring",
        "µas",
        1,
        "twice the mean distance of the brightest point from the centre, over all directions, less what the method adds to a \
         ring that is known",
    ),
    (
        "width of the ring",
        "µas",
        1,
        "mean full width at half maximum of its profile, above the brightness at the largest radius",
    ),
    (
        "brightest direction",
        "°",
        0,
        "position angle of the first moment along the ring, east of north: 180 is south",
    ),
    (
        "asymmetry",
        "",
        3,
        "modulus of that moment over the light: 0 for an even ring, 1 for a point",
    ),
    (
        "central brightness",
        "",
        3,
        "mean brightness within 5 µas of the centre over that at the ring's radius",
    ),
];

impl Found<'_> {
    /// Draws and writes it.
    pub fn report(&self, evidence: &Evidence<'_>, results: &Results) -> anyhow::Result<()> {
        let figure = self.picture()?;
        self.folder.file("image.png")?.write(&figure.png)?;
        let polarized = self.polarized_picture()?;
        if let Some(polarized) = &polarized {
            self.folder.file("polarized.png")?.write(&polarized.png)?;
        }
        let mut all_plots: Vec<LinePlot> =
            plots::amplitudes(evidence, &self.movie, self.gains.as_ref())?.into_iter().collect();
        all_plots.extend(self.closure_phases(evidence)?);
        all_plots.extend(residuals::plots(&self.judged, self.measured));
        all_plots.extend(self.held_out());
        all_plots.extend(self.polarized.as_ref().and_then(Polarized::held_out));
        all_plots.extend(self.gains.iter().flat_map(Gains::plots));
        let leakage = self.polarized.as_ref().and_then(|polarized| polarized.leakage.as_ref());
        all_plots.extend(leakage.map(Leakage::plot));
        let mut details = details(&self.judged, self.gains.as_ref(), leakage);
        details.extend([self.shapes_table(), self.images_table()]);
        let report = Report {
            title: self.file.title.clone(),
            notice: Some(verdict::notice(&self.judged)),
            summary: (self.ring_sentence().into_iter())
                .chain(self.polarized.as_ref().map(Polarized::sentence))
                .collect(),
            parts: self.parts(),
            results: self.outcomes(results),
            figures: [figure].into_iter().chain(polarized).collect(),
            plots: all_plots,
            details,
            settings: settings(self.file, StaticImageFile::keys(), self.folder)?,
            ..Report::default()
        };
        report.write(&self.folder.file("report.html")?)
    }

    fn outcomes(&self, results: &Results) -> Vec<Outcome> {
        let numbers = RING.iter().zip(MEANINGS).filter_map(|((key, number), meaning)| {
            let (name, unit, digits, meaning) = meaning;
            let (value, error) = of_ring(&self.survey, &self.ring()?, key, *number);
            Some(Outcome { name, value: with_error(value, error, digits), unit, meaning })
        });
        let flux = Outcome {
            name: "flux",
            value: with_error(results.flux_jy, results.flux_error_jy, 3),
            unit: "Jy",
            meaning: "all light of the field; its prior has a part in it",
        };
        let seconds = Outcome {
            name: "time",
            value: format!("{:.1}", results.seconds),
            unit: "s",
            meaning: "wall time of this run",
        };
        let polarized = self.polarized.iter().flat_map(Polarized::outcomes);
        numbers.chain([flux]).chain(polarized).chain([seconds]).collect()
    }

    /// The loss of held-out frames against the strength.
    fn held_out(&self) -> Option<LinePlot> {
        let labels = ["Held-out frames", "factor on the penalties", "loss of held-out data"];
        let caption = "Weighted χ² per data point of frames that were not fitted, against the factor on all penalties; bars are \
                       standard errors of the difference from the best. Too weak penalties fit noise, too strong ones cannot \
                       fit the data. The largest within a standard error of the least is taken.";
        losses(&self.survey.held, labels, caption)
    }

    /// Simple shapes with their sizes and what they fit, beside the image.
    fn shapes_table(&self) -> Table {
        let kinds: Vec<String> =
            self.file.loss.iter().map(|loss| format!("χ² of {}", loss.data.label())).collect();
        let numbers =
            |chi2: &[f64]| chi2.iter().map(|chi2| format!("{chi2:.2}")).collect::<Vec<_>>();
        let shape = |fit: &ShapeFit| {
            let sizes =
                fit.sizes.iter().map(|(name, value, unit)| format!("{name} {value:.1} {unit}"));
            let sizes = sizes.collect::<Vec<_>>().join(", ");
            let head = [fit.shape.name().to_owned(), sizes, format!("{:.3}", fit.flux_jy)];
            [&head[..], &numbers(&fit.chi2)[..], &[format!("{:.0}", fit.criterion)]].concat()
        };
        let found = self.survey.found();
        let flux = format!("{:.3}", found.solution.image.iter().sum::<f64>());
        let head = ["the image".to_owned(), String::new(), flux];
        let image = [&head[..], &numbers(&found.chi2)[..], &["–".to_owned()]].concat();
        let first = ["shape", "sizes", "flux (Jy)"].map(str::to_owned).into_iter();
        Table::new(
            "Simple shapes",
            "Shapes that were fitted to the same data with the same gains, for a sanity check: χ² per data point, and χ² of \
             all independent data plus the number of parameters times the logarithm of that of the data. The less \
             that is, the better; 10 less is strong evidence.",
            first.chain(kinds).chain(["criterion".to_owned()]),
            self.shapes.iter().map(shape).chain([image]).collect(),
        )
    }

    /// Every image that was found, with what it fits.
    fn images_table(&self) -> Table {
        let kinds: Vec<String> =
            self.file.loss.iter().map(|loss| format!("χ² of {}", loss.data.label())).collect();
        let row = |what: &str, image: &Candidate| {
            let ring =
                image.ring.map_or("–".to_owned(), |ring| format!("{:.1}", ring.diameter_uas));
            let head = [
                what.to_owned(),
                (image.start + 1).to_string(),
                format!("{}", image.strength),
                format!("{:.5}", image.solution.loss),
            ];
            let chi2 = image.chi2.iter().map(|chi2| format!("{chi2:.3}"));
            head.into_iter().chain(chi2).chain([ring]).collect()
        };
        let rows = |what: &'static str, images: &[Candidate]| -> Vec<Vec<String>> {
            images.iter().map(|image| row(what, image)).collect()
        };
        let survey = &self.survey;
        let first = ["image", "start", "factor", "loss"].map(str::to_owned).into_iter();
        Table::new(
            "All images",
            "Images from all starts, with other factors on the penalties that predict held-out frames as well, and of \
             measurements of the best image with other noise: the loss, χ² per data point and the diameter of the ring, µas.",
            first.chain(kinds).chain(["diameter".to_owned()]),
            [
                rows("start", &survey.starts),
                rows("other factor", &survey.strengths),
                rows("draw", &survey.draws),
            ]
            .concat(),
        )
    }
}
