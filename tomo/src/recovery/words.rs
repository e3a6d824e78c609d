//! The verdict in sentences.

use super::evidence::DataVerdict;
use crate::fit::verdict::{Errors, Expected, Fault, Outcome, Reason, Tested};

impl DataVerdict {
    /// The verdict with χ² of all data that have errors, whatever the verdict rests on.
    pub fn worth(&self) -> String {
        let (headline, chi2) = (self.headline(), self.chi2());
        if chi2.is_empty() || headline.contains(&chi2) {
            return headline;
        }
        format!("{headline} In all, {chi2}.")
    }

    /// χ² of the data that have errors, with what is expected of it.
    fn chi2(&self) -> String {
        let noisy = self.terms.iter().filter(|(_, tested)| tested.errors != Errors::Weight);
        noisy.map(|(name, tested)| chi2_of(name, tested)).collect::<Vec<_>>().join("; ")
    }

    /// One sentence.
    pub fn headline(&self) -> String {
        match self.verdict.outcome {
            Outcome::Explained => format!("The model explains its data: {}.", self.chi2()),
            Outcome::Reproduced => format!(
                "The model reproduces its noise-free data{}: σ is only a weight, so χ² tests nothing.",
                self.left_over()
            ),
            Outcome::FitsNoise => format!(
                "The model fits noise, or the errors are overestimated: {}.",
                self.reasons().join("; ")
            ),
            Outcome::Unexplained => {
                format!("The model does not explain its data: {}.", self.reasons().join("; "))
            }
        }
    }

    /// ` to 1.3 %`.
    fn left_over(&self) -> String {
        let parts = self.terms.iter().filter_map(|(_, tested)| tested.statistics.misfit());
        parts.reduce(f64::max).map_or(String::new(), |part| format!(" to {}", percent(part)))
    }

    /// All that is wrong.
    pub fn reasons(&self) -> Vec<String> {
        self.verdict.reasons.iter().map(|reason| self.reason(reason)).collect()
    }

    fn reason(&self, Reason { term, fault }: &Reason) -> String {
        let of = term.and_then(|term| self.terms.get(term));
        let name = of.map_or("", |(name, _)| name.as_str());
        match fault {
            Fault::NotFinite => format!("χ² of {name} is not a number"),
            Fault::Large => of.map_or(String::new(), |(name, tested)| {
                let part = tested.statistics.misfit().map(percent);
                let part = part
                    .map_or(String::new(), |part| format!("; residuals are {part} of the data"));
                format!("{}{part}", chi2_of(name, tested))
            }),
            Fault::Small => of.map_or(String::new(), |(n, tested)| chi2_of(n, tested)),
            Fault::Misfit(part) => {
                format!("residuals of the noise-free {name} are {} of the data", percent(*part))
            }
            Fault::Mean(mean) => format!("residuals of {name} have a mean of {mean:.2} σ"),
            Fault::InTime(r) => {
                format!("residuals of {name} are correlated from frame to frame ({r:.2})")
            }
            Fault::InSpace(r) => {
                format!("residuals of {name} are correlated from pixel to pixel ({r:.2})")
            }
            Fault::Group(stations, chi2) => {
                format!(
                    "{name} of {} alone have χ² {} per data point",
                    self.names(stations),
                    short(*chi2)
                )
            }
            Fault::Frame(frame, chi2) => {
                format!(
                    "{name} of frame {} alone have χ² {} per data point",
                    frame + 1,
                    short(*chi2)
                )
            }
            Fault::Flux => self.flux.map_or(String::new(), |flux| {
                format!(
                    "short baselines measure {:.3} Jy, the model has {:.3} Jy",
                    flux.measured_jy, flux.model_jy
                )
            }),
        }
    }

    /// Names of stations, joined: `AA–LM`.
    pub fn names(&self, stations: &[u16]) -> String {
        let name = |k: &u16| self.stations.get(usize::from(*k)).map_or("?", String::as_str);
        stations.iter().map(name).collect::<Vec<_>>().join("–")
    }
}

/// The expected χ² per datum: `1.00 ± 0.02`, or `0.74 to 1.00 ± 0.02` where parameters may have used up a quarter of the data.
pub fn range_of(Expected { chi2, spread, taken, .. }: &Expected) -> String {
    // Less does not show in two digits.
    let least =
        if *taken >= 5e-3 { format!("{:.2} to ", chi2 * (1.0 - taken)) } else { String::new() };
    format!("{least}{chi2:.2} ± {spread:.2}")
}

/// `χ² 1.68 per data point of visibilities (1.00 ± 0.02 expected)`.
fn chi2_of(name: &str, tested: &Tested) -> String {
    let (mean, range) = (tested.expected.chi2, range_of(&tested.expected));
    let chi2 = tested.statistics.chi2().map_or("–".to_owned(), short);
    let expected = match tested.errors {
        Errors::Assumed => format!("{range} expected with the assumed σ"),
        Errors::Shared => format!("{mean:.2} at most expected, σ includes the assumed variability"),
        _ => format!("{range} expected"),
    };
    format!("χ² {chi2} per data point of {name} ({expected})")
}

/// A number with three digits.
pub fn short(x: f64) -> String {
    match x.abs() {
        size if !(1e-3..1e5).contains(&size) => format!("{x:.2e}"),
        size if size >= 100.0 => format!("{x:.0}"),
        size if size >= 10.0 => format!("{x:.1}"),
        _ => format!("{x:.2}"),
    }
}

/// Two digits.
fn percent(part: f64) -> String {
    match 100.0 * part {
        percent if percent >= 10.0 => format!("{percent:.0} %"),
        percent if percent >= 0.1 => format!("{percent:.1} %"),
        percent => format!("{percent:.1e} %"),
    }
}
