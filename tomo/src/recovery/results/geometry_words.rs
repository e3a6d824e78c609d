//! Words on a geometry that was found: lines, sentences, and distances from a known one.

use super::geometry::{ALIKE, GeometryResults, PerParameter, TrialResults};
use crate::fit::geometry::Parameter;
use crate::fit::verdict::EXCESS;
use std::collections::BTreeMap;

/// χ²/N with digits that tell.
fn reduced(chi2: f64) -> String {
    if chi2 < 5e-3 { format!("{chi2:.1e}") } else { format!("{chi2:.3}") }
}

impl GeometryResults {
    /// Tells each parameter in a line, and the starts in one.
    pub fn lines(&self) -> Vec<String> {
        let mut parameters: Vec<(&Parameter, &f64)> = self.geometry.iter().collect();
        parameters.sort_by_key(|(parameter, _)| parameter.name());
        let of = |(parameter, value): (&Parameter, &f64)| {
            let name = parameter.name();
            let sure = match self.sigma_of(*parameter) {
                Some(sigma) if !self.is_open(*parameter) => format!("{value:.4} ± {sigma:.4}"),
                _ => format!("{value:.4}, not constrained: the data leave it open"),
            };
            match self.true_value(*parameter) {
                Some(truth) => format!("{name} = {sure} (truth {truth:.4})"),
                None => format!("{name} = {sure}"),
            }
        };
        let mut lines: Vec<String> = parameters.into_iter().map(of).collect();
        lines.extend(self.own().into_iter().map(|said| format!("error: {said}")));
        lines.extend(self.notes().map(|said| format!("note: {said}")));
        lines.push(format!(
            "search: {} of {} starts ended at the best one; χ²/N = {}",
            self.ended_at_the_best,
            self.starts,
            reduced(self.chi2_per_datum)
        ));
        lines
    }

    /// Compares with the truth, by keys of results: distances, over standard deviations, and whether intervals hold it (0 or
    /// 1).
    pub fn errors(&self) -> BTreeMap<String, Option<f64>> {
        let of = |(parameter, value): (&Parameter, &f64)| {
            let (name, truth, unit) =
                (parameter.name(), self.true_value(*parameter)?, parameter.unit());
            let error = (parameter.difference(value * unit, truth * unit) / unit).abs();
            let (plain, suffix) =
                name.strip_suffix("_deg").map_or((name, ""), |name| (name, "_deg"));
            let pull = self.sigma_of(*parameter).map(|sigma| error / sigma);
            let within = |intervals: &PerParameter<[f64; 2]>| {
                let [low, high] = *intervals.get(parameter)?;
                let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
                let away = parameter.difference(truth * unit, middle * unit) / unit;
                Some(f64::from(away.abs() <= half))
            };
            Some([
                (format!("{plain}_error{suffix}"), Some(error)),
                (format!("{plain}_pull"), pull),
                (format!("{plain}_within_68"), within(&self.interval_68)),
                (format!("{plain}_within_95"), within(&self.interval_95)),
            ])
        };
        let flow = self.flow_error.map(|error| ("flow_error".to_owned(), Some(error)));
        self.geometry.iter().filter_map(of).flatten().chain(flow).collect()
    }

    fn true_value(&self, parameter: Parameter) -> Option<f64> {
        self.truth.as_ref()?.get(&parameter).copied()
    }

    fn sigma_of(&self, parameter: Parameter) -> Option<f64> {
        self.sigma.get(&parameter).copied().flatten()
    }

    fn is_open(&self, parameter: Parameter) -> bool {
        self.open.get(&parameter).copied().unwrap_or(true)
    }

    /// Tells each parameter in a sentence, and the starts in one.
    pub fn sentences(&self) -> Vec<String> {
        let is_if = self.unexplained().is_some() && !self.has_own();
        let of = |(parameter, value): (&Parameter, &f64)| {
            let (words, unit) = parameter.label();
            let truth = self.true_value(*parameter);
            let truth = truth.map_or(String::new(), |truth| format!(" (truth: {truth:.3}{unit})"));
            let [from, to] = self.interval_95.get(parameter)?;
            if self.is_open(*parameter) {
                return Some(format!(
                    "The {words} is not constrained: {value:.3}{unit} explains the data best, and the prior alone says \
                     {from:.3}{unit} to {to:.3}{unit} at 95 %{truth}."
                ));
            }
            let interval = format!("between {from:.3}{unit} and {to:.3}{unit} at 95 %{truth}");
            Some(match is_if {
                false => format!("The {words} is {interval}."),
                true => format!("If the model were right, the {words} would be {interval}."),
            })
        };
        let mut all: Vec<String> = self.geometry.iter().filter_map(of).collect();
        let own = self.own();
        if !own.is_empty() {
            all.push(format!("Errors: {}.", own.join("; ")));
        }
        all.extend(self.notes().map(|said| format!("Note that {said}.")));
        all.push(format!(
            "The geometry was searched for from {} places; {} of the searches ended near the best one.",
            self.starts, self.ended_at_the_best
        ));
        all
    }

    /// Names what keeps a geometry from being as sure as its intervals say.
    fn notes(&self) -> impl Iterator<Item = String> {
        let before = [self.small_residuals(), self.rival(), self.unfinished()];
        before.into_iter().flatten().chain(self.edges()).chain(self.unexplained())
    }

    /// Describes the model's own part of the error of each parameter, and what errors leave out; nothing where data are
    /// simulated.
    fn own(&self) -> Vec<String> {
        let left_out = self.model_error_left_out.as_ref().map(|data| {
            format!("errors leave out those of voxels, pixels and sums along rays, which are not known for {data}")
        });
        let parts = self.model_error.iter().filter(|parts| !parts.is_empty());
        left_out.into_iter().chain(parts.flat_map(|parts| self.each_own(parts))).collect()
    }

    fn each_own(&self, parts: &BTreeMap<String, PerParameter<Option<f64>>>) -> Vec<String> {
        let of = |(parameter, sigma): (&Parameter, &Option<f64>)| {
            let ((words, unit), sigma) = (parameter.label(), (*sigma)?);
            let moved = |(source, moved): (_, &PerParameter<Option<f64>>)| {
                Some((source, (*moved.get(parameter)?)?))
            };
            let mut each: Vec<(&String, f64)> = parts.iter().filter_map(moved).collect();
            each.sort_by(|a, b| b.1.total_cmp(&a.1));
            let whole = each.iter().map(|(_, moved)| moved * moved).sum::<f64>().sqrt();
            let each = each.iter().map(|(source, moved)| format!("{source} {moved:.4}{unit}"));
            let each = each.collect::<Vec<_>>().join(", ");
            if self.is_open(*parameter) {
                // It may be the data that do, unless the model has more than half of the variance.
                let is_most = whole > sigma * core::f64::consts::FRAC_1_SQRT_2;
                return is_most.then(|| format!("the model leaves the {words} open ({each})"));
            }
            let whole = whole.min(sigma);
            Some(format!(
                "of ± {sigma:.4}{unit} in {words}, {whole:.4}{unit} is the model's own ({each})"
            ))
        };
        self.sigma.iter().filter_map(of).collect()
    }

    /// A geometry far from the best one that explains the data about as well: one of two mirror images, say.
    fn rival(&self) -> Option<String> {
        let elsewhere = self.trials.iter().filter(|trial| !trial.same);
        let nearest = elsewhere.min_by(|a, b| a.above_best.total_cmp(&b.above_best))?;
        if nearest.above_best.is_nan() || nearest.above_best >= ALIKE {
            return None;
        }
        let value = |(parameter, value): (&Parameter, &f64)| {
            let (words, unit) = parameter.label();
            format!("{words} {value:.3}{unit}")
        };
        let values: Vec<String> = nearest.end.iter().map(value).collect();
        Some(format!(
            "another geometry explains the data about as well (χ²/2 larger by {:.1}), and the intervals \
             leave it out: {}",
            nearest.above_best,
            values.join(", ")
        ))
    }

    /// Describes how many searches have ended before they had converged, most at the limit on their geometries. Those that ended
    /// where the best one and others did are confirmed.
    fn unfinished(&self) -> Option<String> {
        let is_confirmed = self.trials.iter().filter(|trial| trial.same).count() > 1;
        let is_open = |trial: &&TrialResults| !(trial.converged || is_confirmed && trial.same);
        let open = self.trials.iter().filter(is_open).count();
        (open > 0).then(|| {
            format!(
                "{open} of {} searches ended before they had converged: with a larger search.coarse.trials more of them may \
                 end at the same geometry, or at a better one",
                self.trials.len()
            )
        })
    }

    /// Parameters at an edge of their priors, where the prior and not the model ends.
    fn edges(&self) -> Vec<String> {
        let of = |(parameter, value): (&Parameter, &f64)| {
            let ((words, degrees), unit) = (parameter.label(), parameter.unit());
            let [low, high] = *self.bounds.get(parameter)?;
            let range = parameter.range().map(|end| end / unit);
            let is_circle = parameter.difference(low * unit, high * unit).abs() < 1e-6;
            // A full circle has no edge, and where the model itself ends data can ask for no more.
            let is_at = |end: f64, of_model: f64| {
                (value - end).abs() < EDGE * (high - low)
                    && (end - of_model).abs() > 1e-6
                    && !is_circle
            };
            let end =
                [(low, range[0]), (high, range[1])].into_iter().find(|(end, of)| is_at(*end, *of));
            end.filter(|_| !self.is_open(*parameter)).map(|(end, _)| {
                format!(
                    "the {words} lies at the edge of its prior, {end}{degrees}: the data may ask for more than that allows"
                )
            })
        };
        self.geometry.iter().filter_map(of).collect()
    }

    /// Returns whether the errors have grown by what the model may be wrong by.
    fn has_own(&self) -> bool {
        self.model_error.as_ref().is_some_and(|parts| !parts.is_empty())
    }

    /// Explains what it means for a geometry that its volume leaves data unexplained.
    fn unexplained(&self) -> Option<String> {
        let chi2 = Some(self.chi2_per_datum).filter(|chi2| *chi2 > ROUGH)?;
        let means = match self.has_own() {
            true => "and errors have grown by what that can move the geometry by",
            false => "which pulls at the geometry more than its errors say",
        };
        Some(format!(
            "the volume of the best geometry leaves χ²/N = {chi2:.2}, {means}: matter may move by another law than \
             motion.velocity, or emission lie outside of the region; else more search.fine.nodes may help, and \
             pulse = \"delta\" where data are of finer pixels"
        ))
    }

    /// Explains what errors of the geometry mean where residuals are much smaller than the errors of the data.
    fn small_residuals(&self) -> Option<String> {
        let factor = Some(self.noise_factor).filter(|factor| *factor < 1.0)?;
        Some(format!(
            "residuals are much smaller than the errors of the data; the geometry was searched for with errors {factor:.1e} \
             times as large"
        ))
    }
}

/// Part of a prior's range within which a value lies at its edge.
const EDGE: f64 = 0.02;

/// χ²/N of the best geometry above which its errors do not hold: where the verdict of a fit begins to say so.
const ROUGH: f64 = 1.0 + EXCESS;

#[cfg(test)]
mod tests {
    use super::*;

    use crate::recovery::results::{ResolutionResults, TrialResults};

    /// Something of spin, inclination and position angle.
    fn of<T>(each: [T; 3]) -> PerParameter<T> {
        [Parameter::Spin, Parameter::Inclination, Parameter::PositionAngle]
            .into_iter()
            .zip(each)
            .collect()
    }

    fn found() -> GeometryResults {
        GeometryResults {
            geometry: of([0.91, 59.0, 179.0]),
            flow_error: None,
            sigma: of([0.34, 0.5, 1.5].map(Some)),
            open: of([true, false, false]),
            interval_68: of([[-0.02, 0.77], [58.5, 59.5], [177.5, 180.5]]),
            interval_95: of([[-0.17, 0.92], [58.02, 59.98], [176.06, 181.94]]),
            model_error: None,
            model_error_left_out: None,
            correlation: None,
            ripple: None,
            bounds: of([[-0.2, 0.95], [0.0, 180.0], [-180.0, 180.0]]),
            truth: Some(of([0.9, 60.0, -179.0])),
            chi2_per_datum: 1.02,
            noise_factor: 1.0,
            resolution: ResolutionResults {
                nodes: 16,
                pixels: 20,
                rays_per_pixel: 4,
                ring_rays: None,
                panels: 1,
            },
            starts: 4,
            ended_at_the_best: 3,
            trials: Vec::new(),
        }
    }

    fn trial(end: [f64; 2], above_best: f64, [same, converged]: [bool; 2]) -> TrialResults {
        let end: PerParameter<f64> =
            [Parameter::Spin, Parameter::Inclination].into_iter().zip(end).collect();
        TrialResults { start: end.clone(), end, above_best, trials: 9, converged, same }
    }

    #[test]
    fn exact_errors_go_the_short_way_about_a_circle() {
        let errors = found().errors();
        let number = |key: &str| errors[key].unwrap();
        assert!((number("position_angle_error_deg") - 2.0).abs() < 1e-9);
        assert!((number("inclination_pull") - 2.0).abs() < 1e-9);
        assert!((number("spin_error") - 0.01).abs() < 1e-12);
        assert_eq!(number("position_angle_within_68"), 0.0);
        assert_eq!(number("position_angle_within_95"), 1.0);
        assert_eq!(number("inclination_within_95"), 0.0);
        assert_eq!((number("spin_within_68"), number("spin_within_95")), (0.0, 1.0));
    }

    #[test]
    fn exact_sentences_say_what_is_known() {
        let said = found().sentences();
        assert_eq!(
            said[0],
            "The spin is not constrained: 0.910 explains the data best, and the prior alone says -0.170 to 0.920 at \
             95 % (truth: 0.900)."
        );
        assert_eq!(
            said[1],
            "The inclination is between 58.020° and 59.980° at 95 % (truth: 60.000°)."
        );
        assert!(said[2].contains("between 176.060° and 181.940°"), "{}", said[2]);
        assert!(said[3].contains("from 4 places; 3 of the searches"), "{}", said[3]);
        assert!(found().lines()[3].contains("3 of 4 starts"));
    }

    #[test]
    fn exact_errors_that_do_not_hold_are_told() {
        let mut results = found();
        let says = |results: &GeometryResults| {
            let all = [results.lines(), results.sentences()];
            all.map(|said| said.iter().any(|line| line.contains("more than its errors say")))
        };
        results.chi2_per_datum = 1.1;
        assert_eq!(says(&results), [false; 2]);
        assert!(results.sentences()[1].starts_with("The inclination is between"));
        results.chi2_per_datum = 3.3;
        assert_eq!(says(&results), [true; 2]);
        let said = &results.sentences()[1];
        assert!(
            said.starts_with("If the model were right, the inclination would be between"),
            "{said}"
        );
    }

    #[test]
    fn exact_errors_of_the_model_are_told() {
        let mut results = found();
        results.chi2_per_datum = 3.3;
        let parts = [("voxels", [0.3, 0.3, 0.0]), ("pixels", [0.1, 0.4, 1.2])];
        let part = |(source, moved): (&str, [f64; 3])| (source.to_owned(), of(moved.map(Some)));
        results.model_error = Some(parts.map(part).into());
        let said = results.own().join("; ");
        assert!(
            said.starts_with("the model leaves the spin open (voxels 0.3000, pixels 0.1000); "),
            "{said}"
        );
        let inclination = "of ± 0.5000° in inclination, 0.5000° is the model's own (pixels 0.4000°, voxels 0.3000°)";
        assert!(said.contains(inclination), "{said}");
        assert!(
            said.contains("of ± 1.5000° in position angle of the spin, 1.2000° is the model's own"),
            "{said}"
        );
        // They are part of the interval, which then needs no model that is right.
        assert!(results.sentences()[1].starts_with("The inclination is between"));
        assert!(results.lines().iter().any(|line| line.contains("errors have grown by")));
        results.model_error = Some(BTreeMap::new());
        results.model_error_left_out = Some("amplitudes and closure quantities".to_owned());
        let said = "which are not known for amplitudes and closure quantities";
        assert!(results.lines().iter().any(|line| line.contains(said)));
    }

    #[test]
    fn exact_what_stopped_and_what_lies_at_an_edge_is_told() {
        let mut results = found();
        let note = |results: &GeometryResults, part: &str| {
            [results.lines(), results.sentences()].map(|all| all.iter().any(|s| s.contains(part)))
        };
        results.trials = vec![trial([0.91, 59.0], 0.0, [true, false])];
        assert_eq!(note(&results, "1 of 1 searches ended before"), [true; 2]);
        // Two that end at the same place confirm each other; one elsewhere is open.
        results.trials.push(trial([0.91, 59.0], 0.0, [true, false]));
        assert_eq!(note(&results, "ended before"), [false; 2]);
        results.trials.push(trial([0.2, 30.0], 900.0, [false; 2]));
        assert_eq!(note(&results, "1 of 3 searches ended before"), [true; 2]);
        results.trials.pop();
        assert_eq!(note(&results, "edge of its prior"), [false; 2]);
        results.open.insert(Parameter::Spin, false);
        results.geometry.insert(Parameter::Spin, 0.94);
        assert_eq!(note(&results, "the spin lies at the edge of its prior, 0.95:"), [true; 2]);
        // Where the model itself ends there is no more.
        results.geometry.insert(Parameter::Inclination, 0.1);
        assert_eq!(note(&results, "the inclination lies at the edge"), [false; 2]);
    }

    #[test]
    fn exact_a_mirror_image_of_the_best_geometry_is_told() {
        let mut results = found();
        results.trials = vec![
            trial([0.91, 59.0], 0.0, [true; 2]),
            trial([0.9, 59.1], 0.1, [true; 2]),
            trial([-0.88, 121.0], 1.23, [false, true]),
            trial([0.1, 80.0], 40.0, [false, true]),
        ];
        let said = results.sentences().join(" ");
        let rival = "larger by 1.2), and the intervals leave it out: spin -0.880, inclination \
                     121.000°.";
        assert!(said.contains(rival), "{said}");
        results.trials[2].above_best = 12.0;
        assert!(!results.sentences().join(" ").contains("another geometry"));
    }
}
