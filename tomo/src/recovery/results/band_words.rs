//! Words on a flare in an orbital band.

use super::band::BandResults;
use crate::fit::band::Interval;

impl BandResults {
    /// Says whether data ask for a flare beside a background; none where there is no background, and nothing to ask.
    pub fn is_seen(&self) -> Option<bool> {
        self.ln_against_background().map(|ln| ln > SEEN)
    }

    pub(super) fn ln_against_background(&self) -> Option<f64> {
        self.ln_bayes_factor.filter(|_| self.background.is_some())
    }

    /// Tells what was found.
    pub fn sentences(&self) -> Vec<String> {
        let truth = self.truth.inclination_deg;
        let truth = truth.map_or(String::new(), |truth| format!(" (truth: {truth:.1}°)"));
        let inclination = self.inclination_deg.interval;
        let mut all: Vec<String> = self.ln_against_background().map(flare).into_iter().collect();
        if self.is_seen() == Some(true) && !self.background_ends.is_empty() {
            all.push(format!(
                "The most probable background is at an end of {}: a background that is faster or stronger looks like a flare. \
                 Lengthen the list before you trust the flare.",
                self.background_ends.join(" and of ")
            ));
        }
        all.extend([
            format!(
                "The inclination is between {:.1}° and {:.1}° at 95 %, with a median of {:.1}°{truth}.",
                inclination.low, inclination.high, inclination.median
            ),
            orbit([self.emission_radius, self.radius.interval, self.period_min.interval], &self.radii),
            format!("At the reference time {}.", place_of(self.azimuth_deg)),
        ]);
        let factors = &self.rotation_factor.probabilities;
        // Of all geometries together: that of the best one alone may be improbable.
        let likeliest = factors.iter().max_by(|a, b| a[1].total_cmp(&b[1]));
        if let Some([factor, probability]) = likeliest.filter(|_| factors.len() > 1) {
            let sense = self.forward();
            all.push(match (*probability < TOLD, sense.max(1.0 - sense) < TOLD) {
                (true, true) => format!(
                    "The data do not tell how it turns: in the law's sense with a probability of {sense:.3}."
                ),
                (true, false) => format!(
                    "It turns in the law's sense with a probability of {sense:.3}; how fast, the data do not tell."
                ),
                (false, _) => format!(
                    "Most probably it turns {factor:.2} times as fast as the law of motion says, in the law's sense with a probability of {sense:.3}."
                ),
            });
            all.extend(self.clockwise.map(|clockwise| {
                format!(
                    "On the sky it turns clockwise with a probability of {clockwise:.3}, anticlockwise with {:.3}.",
                    1.0 - clockwise
                )
            }));
        }
        all.extend(self.validation_chi2_per_datum.map(|validation| {
            format!(
                "Samples that were not fitted have a χ² of {validation:.2} per datum with the errors that are expected of them."
            )
        }));
        all
    }
}

/// Describes whether a flare is seen before a background.
fn flare(ln: f64) -> String {
    let factor = match ln.abs() {
        size if size < 5.0 => format!("{:.2}", ln.exp()),
        size if size < 30.0 => format!("{:.1e}", ln.exp()),
        _ => format!("e^{ln:.0}"),
    };
    let what = match ln {
        ln if ln > SEEN => "The data ask for a flare that orbits",
        ln if ln < -SEEN => "The data speak against a flare that orbits",
        _ => "The data do not tell whether a flare orbits",
    };
    let then = if ln > SEEN { "" } else { " What follows holds if there is one." };
    format!(
        "{what}: with one, they are {factor} times as probable as with the background alone.{then}"
    )
}

/// ln of 20, above which a Bayes factor is called strong (Kass & Raftery 1995).
const SEEN: f64 = 3.0;

/// Probability from which on one of several is called the most probable.
const TOLD: f64 = 0.6;

/// Width from which on an interval of azimuths is the whole circle, degrees: 95 % of it.
const ROUND: f64 = 0.95 * 360.0 - 5.0;

/// Describes the middle of a flare, from median and interval of its azimuth in degrees.
fn place_of(Interval { median, low, high }: Interval) -> String {
    if high - low > ROUND {
        return "its middle may be at any azimuth".to_owned();
    }
    format!(
        "its middle is at an azimuth of {median:.0}° (−{:.0}°, +{:.0}°)",
        median - low,
        high - median
    )
}

/// Part of the radii that were asked for: a 95 % interval that is wider says no more than the prior.
const OPEN: f64 = 0.75;

/// Distance of the light from the axis (M), radius (M) and period (minutes) of the band that it is part of, each as median and
/// interval; a radius that may be almost any of those that were asked for is not constrained, nor is the period.
fn orbit([light, band, period]: [Interval; 3], asked: &[[f64; 2]]) -> String {
    let (Some([first, _]), Some([last, _])) = (asked.first(), asked.last()) else {
        return String::new();
    };
    let of_band = format!(
        "{:.1} to {:.1} M and {:.0} to {:.0} minutes at 95 %",
        band.low, band.high, period.low, period.high
    );
    if band.high - band.low > OPEN * (last - first) && asked.len() > 1 {
        return format!("Radius and period of the orbit are not constrained: {of_band}.");
    }
    format!(
        "The flare orbits at {:.1} M ({:.1} to {:.1} at 95 %), in a band with a radius of {:.1} M and a period of {:.0} minutes ({of_band}).",
        light.median,
        light.low.max(0.0),
        light.high,
        band.median,
        period.median
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::band::Background;

    fn interval([median, low, high]: [f64; 3]) -> Interval {
        Interval { median, low, high }
    }

    #[test]
    fn exact_azimuths_go_round() {
        assert_eq!(place_of(interval([273.0, 93.0, 453.0])), "its middle may be at any azimuth");
        let near = place_of(interval([350.0, 330.0, 375.0]));
        assert_eq!(near, "its middle is at an azimuth of 350° (−20°, +25°)");
    }

    #[test]
    fn exact_a_radius_as_wide_as_its_prior_is_not_constrained() {
        let asked: Vec<[f64; 2]> = (0..=20).map(|k| [4.0 + f64::from(k), 0.0]).collect();
        let all = |low: f64, high: f64| {
            [[11.0, low - 1.0, high + 2.0], [11.0, low, high], [60.0, 20.0, 150.0]].map(interval)
        };
        let open = orbit(all(4.0, 22.0), &asked);
        assert!(open.contains("not constrained: 4.0 to 22.0 M and 20 to 150 minutes"), "{open}");
        let known = orbit(all(9.0, 13.0), &asked);
        assert!(known.starts_with("The flare orbits at 11.0 M (8.0 to 15.0 at 95 %), in a band"));
        assert!(known.contains("60 minutes (9.0 to 13.0 M and 20 to 150 minutes"), "{known}");
    }

    #[test]
    fn exact_flares_are_seen_before_a_background() {
        let curve = "probabilities = [[1.0, 1.0]]";
        let known = "median = 1.0\nlow = 1.0\nhigh = 1.0";
        let text = format!(
            "background_ends = []\ninclinations = []\nradii = []\nperiods = []\ngeometries = [[20.0, 1.0, 0.0, 0.0]]
             [inclination_deg]\n{known}\n[radius]\n{known}\n[period_min]\n{known}
             [emission_radius]\n{known}\n[azimuth_deg]\n{known}\n[truth]
             [rotation_factor]\nbest = 1.0\n{curve}\n[position_angle_deg]\nbest = 0.0\n{curve}
             [band]\nradius = 8.0\nwidth = 2.0\nheight = 1.0\nlength = 4.0\npower = 1.0\nmean = 1.0"
        );
        let alone: BandResults = toml::from_str(&text).unwrap();
        let with = |ln: f64, background: Option<Background>| {
            BandResults { ln_bayes_factor: Some(ln), background, ..alone.clone() }.is_seen()
        };
        let seen = [0.5f64.ln(), 4.0].map(|ln| with(ln, Some(Background::NONE)));
        assert_eq!(seen, [Some(false), Some(true)]);
        assert_eq!((with(4.0, None), alone.is_seen()), (None, None));
    }
}
