//! Test of whether data of a source that varies ask for motion: a quick static image of them, before settings are
//! guessed.

use super::sources::Seen;
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_imaging::{data, survey};
use kerrlight_tomo::fit::verdict::is_chance;

/// Residuals of a static image.
pub struct QuickLook {
    /// Kinds of data with χ² per datum and how many data there are.
    kinds: Vec<(&'static str, f64, usize)>,
}

impl QuickLook {
    /// Fits a static image from all of the starts in its settings; penalties are as strong as they stand there, and
    /// nothing is drawn. None if these data have no static image.
    pub fn new(settings: &str, seen: &Seen) -> Option<Self> {
        let mut file = StaticImageFile::parse(settings).ok()?;
        (file.strength, file.ring, file.image.draws) = (None, None, None);
        let measured = data::total_intensity(&file, seen.observation.clone(), &seen.file).ok()?;
        let survey = survey(&file, &measured, &[], &|_, _| true).ok()??;
        let terms = measured.visibility_terms::<f64>(&file.loss, file.image.pixels.pow(2)).ok()?;
        let frames = 0..measured.times.len();
        let counts = terms.iter().map(|weighted| {
            frames.clone().map(|frame| weighted.term.degrees_of_freedom(frame)).sum()
        });
        let names = file.loss.iter().map(|loss| loss.data.label());
        let kinds = names.zip(&survey.found().chi2).zip(counts);
        Some(Self { kinds: kinds.map(|((name, chi2), n)| (name, *chi2, n)).collect() })
    }

    /// Returns whether χ² of each kind is what chance allows, or less.
    pub fn explains(&self) -> bool {
        self.kinds.iter().all(|(_, chi2, count)| is_chance(*chi2, *count))
    }

    /// Describes the result, in a sentence.
    pub fn sentence(&self) -> String {
        let one = |(name, chi2, _): &(&str, f64, usize)| format!("{chi2:.2} of {name}");
        let all: Vec<String> = self.kinds.iter().map(one).collect();
        let end = match self.explains() {
            true => {
                "no motion is needed, and a static image is fitted (emission that moves: --model volume)"
            }
            false => {
                "too much for an image that stands still, and a volume is fitted, in which emission moves (a static image: --model image)"
            }
        };
        format!(
            "a quick static image, with errors for what the source varies, leaves χ² per data point {}: {end}",
            all.join(", ")
        )
    }
}
