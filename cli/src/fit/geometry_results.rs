//! What is said of a geometry that was found: lines, sentences, and distances from a known one.

use kerrlight_tomo::fit::geometry::Parameter;
use kerrlight_tomo::fit::verdict::EXCESS;
use serde_json::{Map, Value, json};

/// χ²/2 above the best below which a search is taken to have ended at the same geometry, however few the data are.
pub const ALIKE: f64 = 3.0;

/// χ²/N with digits that tell.
fn reduced(chi2: f64) -> String {
    if chi2 < 5e-3 { format!("{chi2:.1e}") } else { format!("{chi2:.3}") }
}

/// A line for each parameter, and one for the starts.
pub fn lines(results: &Value) -> Vec<String> {
    let Some(geometry) = results["geometry"].as_object() else { return Vec::new() };
    let mut lines: Vec<String> = geometry
        .iter()
        .map(|(name, value)| {
            let value = value.as_f64().unwrap_or(f64::NAN);
            let sure = match results["sigma"][name].as_f64() {
                Some(sigma) if results["open"][name] != true => format!("{value:.4} ± {sigma:.4}"),
                _ => format!("{value:.4}, not constrained: the data leave it open"),
            };
            match results["truth"][name].as_f64() {
                Some(truth) => format!("{name} = {sure} (truth {truth:.4})"),
                None => format!("{name} = {sure}"),
            }
        })
        .collect();
    lines.extend(own(results).into_iter().map(|said| format!("error: {said}")));
    lines.extend(notes(results).map(|said| format!("note: {said}")));
    let chi2 = reduced(results["chi2_per_datum"].as_f64().unwrap_or(f64::NAN));
    lines.push(format!(
        "search: {} of {} starts ended at the best one; χ²/N = {chi2}",
        results["ended_at_the_best"], results["starts"],
    ));
    lines
}

/// Distances from the truth, and how many standard deviations they are.
pub fn errors(results: &Value) -> Vec<(String, Value)> {
    let of = |parameter: Parameter| {
        let name = parameter.name();
        let number = |key: &str| results[key][name].as_f64();
        let (value, truth) = (number("geometry")?, number("truth")?);
        let unit = parameter.unit();
        let error = (parameter.difference(value * unit, truth * unit) / unit).abs();
        let (plain, suffix) = name.strip_suffix("_deg").map_or((name, ""), |name| (name, "_deg"));
        let pull = number("sigma").map(|sigma| error / sigma);
        let within = |interval: &str| {
            let [low, high] = ends(results, interval, name)?;
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            let away = parameter.difference(truth * unit, middle * unit) / unit;
            Some(f64::from(away.abs() <= half))
        };
        Some([
            (format!("{plain}_error{suffix}"), json!(error)),
            (format!("{plain}_pull"), json!(pull)),
            (format!("{plain}_within_68"), json!(within("interval_68"))),
            (format!("{plain}_within_95"), json!(within("interval_95"))),
        ])
    };
    let flow = results["flow_error"].as_f64().map(|error| ("flow_error".to_owned(), json!(error)));
    Parameter::ALL.into_iter().filter_map(of).flatten().chain(flow).collect()
}

/// The ends of a parameter's interval.
fn ends(results: &Value, interval: &str, name: &str) -> Option<[f64; 2]> {
    let ends = &results[interval][name];
    Some([ends[0].as_f64()?, ends[1].as_f64()?])
}

/// A sentence for each parameter, and one for the starts.
pub fn sentences(results: &Value) -> Vec<String> {
    let of = |parameter: Parameter| {
        let name = parameter.name();
        let number = |key: &str| results[key][name].as_f64();
        let value = number("geometry")?;
        let (words, unit) = parameter.label();
        let truth =
            number("truth").map_or(String::new(), |truth| format!(" (truth: {truth:.3}{unit})"));
        let [from, to] = ends(results, "interval_95", name)?;
        if results["open"][name] == true {
            return Some(format!(
                "The {words} is not constrained: {value:.3}{unit} explains the data best, and the prior alone says \
                 {from:.3}{unit} to {to:.3}{unit} at 95 %{truth}."
            ));
        }
        let interval = format!("between {from:.3}{unit} and {to:.3}{unit} at 95 %{truth}");
        Some(match unexplained(results).filter(|_| !has_own(results)) {
            None => format!("The {words} is {interval}."),
            Some(_) => format!("If the model were right, the {words} would be {interval}."),
        })
    };
    let mut all: Vec<String> = Parameter::ALL.into_iter().filter_map(of).collect();
    let own = own(results);
    if !own.is_empty() {
        all.push(format!("Errors: {}.", own.join("; ")));
    }
    all.extend(notes(results).map(|said| format!("Note that {said}.")));
    all.push(format!(
        "The geometry was searched for from {} places; {} of the searches ended near the best one.",
        results["starts"], results["ended_at_the_best"]
    ));
    all
}

/// What keeps a geometry from being as sure as its intervals say.
fn notes(results: &Value) -> impl Iterator<Item = String> {
    let before = [small_residuals(results), rival(results), unfinished(results)];
    before.into_iter().flatten().chain(edges(results)).chain(unexplained(results))
}

/// How much of the error of each parameter the model makes itself, and what errors leave out; nothing where data are
/// simulated.
fn own(results: &Value) -> Vec<String> {
    let left_out = results["model_error_left_out"].as_str().map(|data| {
        format!("errors leave out those of voxels, pixels and sums along rays, which are not known for {data}")
    });
    let parts = results["model_error"].as_object().filter(|parts| !parts.is_empty());
    let parts = parts.map_or_else(Vec::new, |parts| each_own(results, parts));
    left_out.into_iter().chain(parts).collect()
}

fn each_own(results: &Value, parts: &Map<String, Value>) -> Vec<String> {
    let of = |parameter: Parameter| {
        let (words, unit) = parameter.label();
        let name = parameter.name();
        let sigma = results["sigma"][name].as_f64()?;
        let mut each: Vec<(&str, f64)> = parts
            .iter()
            .filter_map(|(source, moved)| Some((source.as_str(), moved[name].as_f64()?)))
            .collect();
        each.sort_by(|a, b| b.1.total_cmp(&a.1));
        let whole = each.iter().map(|(_, moved)| moved * moved).sum::<f64>().sqrt();
        let each = each.iter().map(|(source, moved)| format!("{source} {moved:.4}{unit}"));
        let each = each.collect::<Vec<_>>().join(", ");
        if results["open"][name] == true {
            // It may be the data that do.
            let is_most = whole > sigma * core::f64::consts::FRAC_1_SQRT_2;
            return is_most.then(|| format!("the model leaves the {words} open ({each})"));
        }
        let whole = whole.min(sigma);
        Some(format!(
            "of ± {sigma:.4}{unit} in {words}, {whole:.4}{unit} is the model's own ({each})"
        ))
    };
    Parameter::ALL.into_iter().filter_map(of).collect()
}

/// A geometry far from the best one that explains the data about as well: one of two mirror images, say.
fn rival(results: &Value) -> Option<String> {
    let above = |trial: &&Value| trial["above_best"].as_f64().unwrap_or(f64::INFINITY);
    let elsewhere = results["trials"].as_array()?.iter().filter(|trial| trial["same"] == false);
    let nearest = elsewhere.min_by(|a, b| above(a).total_cmp(&above(b)))?;
    if above(&nearest) >= ALIKE {
        return None;
    }
    let value = |parameter: Parameter| {
        let value = nearest["end"][parameter.name()].as_f64()?;
        let (words, unit) = parameter.label();
        Some(format!("{words} {value:.3}{unit}"))
    };
    let values: Vec<String> = Parameter::ALL.into_iter().filter_map(value).collect();
    Some(format!(
        "another geometry explains the data about as well (χ²/2 larger by {:.1} in the coarse search), and the intervals \
         leave it out: {}",
        above(&nearest),
        values.join(", ")
    ))
}

/// How many searches have ended before they had converged, most at the limit on their geometries.
fn unfinished(results: &Value) -> Option<String> {
    let trials = results["trials"].as_array()?;
    let open = trials.iter().filter(|trial| trial["converged"] == false).count();
    (open > 0).then(|| {
        format!(
            "{open} of {} searches ended before they had converged: with a larger search.coarse.trials more of them may \
             end at the same geometry, or at a better one",
            trials.len()
        )
    })
}

/// Part of a prior's range within which a value lies at its edge.
const EDGE: f64 = 0.02;

/// Parameters at an edge of their priors, where the prior and not the model ends.
fn edges(results: &Value) -> Vec<String> {
    let of = |parameter: Parameter| {
        let (name, unit) = (parameter.name(), parameter.unit());
        let (words, degrees) = parameter.label();
        let value = results["geometry"][name].as_f64()?;
        let [low, high] = ends(results, "bounds", name)?;
        let range = parameter.range().map(|end| end / unit);
        let is_circle = parameter.difference(low * unit, high * unit).abs() < 1e-6;
        let is_at = |end: f64, of_model: f64| {
            (value - end).abs() < EDGE * (high - low) && (end - of_model).abs() > 1e-6 && !is_circle
        };
        let end =
            [(low, range[0]), (high, range[1])].into_iter().find(|(end, of)| is_at(*end, *of));
        end.filter(|_| results["open"][name] != true).map(|(end, _)| {
            format!(
                "the {words} lies at the edge of its prior, {end}{degrees}: the data may ask for more than that allows"
            )
        })
    };
    Parameter::ALL.into_iter().filter_map(of).collect()
}

/// χ²/N of the best geometry above which its errors do not hold: where the verdict of a fit begins to say so.
const ROUGH: f64 = 1.0 + EXCESS;

/// Whether the errors have grown by what the model may be wrong by.
fn has_own(results: &Value) -> bool {
    results["model_error"].as_object().is_some_and(|parts| !parts.is_empty())
}

/// What it means for a geometry that its volume leaves data unexplained.
fn unexplained(results: &Value) -> Option<String> {
    let chi2 = results["chi2_per_datum"].as_f64().filter(|chi2| *chi2 > ROUGH)?;
    let means = match has_own(results) {
        true => "and errors have grown by what that can move the geometry by",
        false => "which pulls at the geometry more than its errors say",
    };
    Some(format!(
        "the volume of the best geometry leaves χ²/N = {chi2:.2}, {means}: matter may move by another law than \
         motion.velocity, or emission lie outside of the region; else linear.degree = \"quadratic\" may help, and \
         pulse = \"delta\" where data are of finer pixels"
    ))
}

/// What errors of the geometry mean where residuals are much smaller than the errors of the data.
fn small_residuals(results: &Value) -> Option<String> {
    let factor = results["noise_factor"].as_f64().filter(|factor| *factor < 1.0)?;
    Some(format!(
        "residuals are much smaller than the errors of the data; the geometry was searched for with errors {factor:.1e} \
         times as large"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found() -> Value {
        json!({
            "geometry": {"spin": 0.91, "inclination_deg": 59.0, "position_angle_deg": 179.0},
            "sigma": {"spin": 0.34, "inclination_deg": 0.5, "position_angle_deg": 1.5},
            "open": {"spin": true, "inclination_deg": false, "position_angle_deg": false},
            "interval_68": {
                "spin": [-0.02, 0.77], "inclination_deg": [58.5, 59.5], "position_angle_deg": [177.5, 180.5],
            },
            "interval_95": {
                "spin": [-0.17, 0.92], "inclination_deg": [58.02, 59.98], "position_angle_deg": [176.06, 181.94],
            },
            "truth": {"spin": 0.9, "inclination_deg": 60.0, "position_angle_deg": -179.0},
            "bounds": {
                "spin": [-0.2, 0.95], "inclination_deg": [0.0, 180.0], "position_angle_deg": [-180.0, 180.0],
            },
            "starts": 4, "ended_at_the_best": 3, "chi2_per_datum": 1.02,
        })
    }

    #[test]
    fn exact_errors_go_the_short_way_about_a_circle() {
        let errors: Map<String, Value> = errors(&found()).into_iter().collect();
        let number = |key: &str| errors[key].as_f64().unwrap();
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
        let said = sentences(&found());
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
        assert!(lines(&found())[3].contains("3 of 4 starts"));
    }

    #[test]
    fn exact_errors_that_do_not_hold_are_told() {
        let mut results = found();
        let says = |results: &Value| {
            let all = [lines(results), sentences(results)];
            all.map(|said| said.iter().any(|line| line.contains("more than its errors say")))
        };
        results["chi2_per_datum"] = json!(1.1);
        assert_eq!(says(&results), [false; 2]);
        assert!(sentences(&results)[1].starts_with("The inclination is between"));
        results["chi2_per_datum"] = json!(3.3);
        assert_eq!(says(&results), [true; 2]);
        let said = &sentences(&results)[1];
        assert!(
            said.starts_with("If the model were right, the inclination would be between"),
            "{said}"
        );
    }

    #[test]
    fn exact_errors_of_the_model_are_told() {
        let mut results = found();
        results["chi2_per_datum"] = json!(3.3);
        results["sigma"]["inclination_deg"] = json!(0.5);
        results["model_error"] = json!({
            "voxels": {"spin": 0.3, "inclination_deg": 0.3, "position_angle_deg": 0.0},
            "pixels": {"spin": 0.1, "inclination_deg": 0.4, "position_angle_deg": 1.2},
        });
        let said = own(&results).join("; ");
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
        assert!(sentences(&results)[1].starts_with("The inclination is between"));
        assert!(lines(&results).iter().any(|line| line.contains("errors have grown by")));
        results["model_error"] = json!({});
        results["model_error_left_out"] = json!("amplitudes and closure quantities");
        let said = "which are not known for amplitudes and closure quantities";
        assert!(lines(&results).iter().any(|line| line.contains(said)));
    }

    #[test]
    fn exact_what_stopped_and_what_lies_at_an_edge_is_told() {
        let mut results = found();
        let note = |results: &Value, part: &str| {
            [lines(results), sentences(results)].map(|all| all.iter().any(|s| s.contains(part)))
        };
        results["trials"] = json!([{"converged": false}, {"converged": true}]);
        assert_eq!(note(&results, "1 of 2 searches ended before"), [true; 2]);
        results["trials"][0]["converged"] = json!(true);
        assert_eq!(note(&results, "ended before"), [false; 2]);
        assert_eq!(note(&results, "edge of its prior"), [false; 2]);
        results["open"]["spin"] = json!(false);
        results["geometry"]["spin"] = json!(0.94);
        assert_eq!(note(&results, "the spin lies at the edge of its prior, 0.95:"), [true; 2]);
        // Where the model itself ends there is no more.
        results["geometry"]["inclination_deg"] = json!(0.1);
        assert_eq!(note(&results, "the inclination lies at the edge"), [false; 2]);
    }

    #[test]
    fn exact_a_mirror_image_of_the_best_geometry_is_told() {
        let end =
            |spin: f64, inclination: f64| json!({"spin": spin, "inclination_deg": inclination});
        let mut results = found();
        results["trials"] = json!([
            {"end": end(0.91, 59.0), "above_best": 0.0, "same": true},
            {"end": end(0.9, 59.1), "above_best": 0.1, "same": true},
            {"end": end(-0.88, 121.0), "above_best": 1.23, "same": false},
            {"end": end(0.1, 80.0), "above_best": 40.0, "same": false},
        ]);
        let said = sentences(&results).join(" ");
        let rival = "larger by 1.2 in the coarse search), and the intervals leave it out: spin -0.880, inclination \
                     121.000°.";
        assert!(said.contains(rival), "{said}");
        results["trials"][2]["above_best"] = json!(12.0);
        assert!(!sentences(&results).join(" ").contains("another geometry"));
    }
}
