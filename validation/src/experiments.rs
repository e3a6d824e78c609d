//! Results of `kerrlight compare` held against what was published and what has been measured.

use anyhow::{Context, bail};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Expected result of an experiment.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// Means of single results.
    #[serde(default)]
    pub range: Vec<Range>,
    /// Results that are to come out in some order.
    #[serde(default)]
    pub order: Vec<Order>,
}

/// Factors and their levels; those that are not named may be any.
pub type Levels = BTreeMap<String, String>;

/// Factors with several levels: something is expected of each combination of them.
pub type Each = BTreeMap<String, Vec<String>>;

/// Range of a result of every single case.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Cases, one combination after the other.
    #[serde(default)]
    pub each: Each,
    /// What all of them have in common.
    #[serde(default)]
    pub r#where: Levels,
    /// Name of the result.
    pub value: String,
    /// Least, of the combinations in turn.
    #[serde(default)]
    pub at_least: Vec<f64>,
    /// Most, likewise.
    #[serde(default)]
    pub at_most: Vec<f64>,
    /// Source of the expectation.
    pub source: String,
}

/// Means over seeds that do not rise from one set of cases to the next.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// Levels of all cases of an order, unless `falling` has others; one combination after the other.
    #[serde(default)]
    pub each: Each,
    /// The best first.
    pub falling: Vec<Levels>,
    /// Name of the result.
    pub value: String,
    /// Excess of one over the one before it that is allowed.
    #[serde(default)]
    pub slack: f64,
    /// Source of the expectation.
    pub source: String,
}

/// Outcome of one expectation.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Quantity, case and source of the expectation.
    pub what: String,
    /// Measured value; nothing if no case of it has results.
    pub found: Option<String>,
    /// True if it is as expected.
    pub passed: bool,
}

impl Expected {
    /// Reads the file of an experiment.
    ///
    /// # Errors
    /// If it is not one, or a range has no bound, or not as many as take turns.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let expected: Self = toml::from_str(text)?;
        for Range { each, r#where, at_least, at_most, .. } in &expected.range {
            if at_least.is_empty() && at_most.is_empty() {
                bail!("{}: neither at_least nor at_most", named(r#where));
            }
            let count = combinations(each).len();
            let take_turns = |all: &[f64]| count.is_multiple_of(all.len().max(1));
            if !(take_turns(at_least) && take_turns(at_most)) {
                bail!("{}: bounds of {count} combinations do not take turns", named(r#where));
            }
        }
        Ok(expected)
    }

    /// Every expectation against `results.json`.
    ///
    /// # Errors
    /// If these are no results, or no case has a result that is requested.
    pub fn hold(&self, results: &Value) -> anyhow::Result<Vec<Verdict>> {
        let cases = results["cases"].as_array().context("there are no cases")?;
        let ranges = self.range.iter().flat_map(|range| {
            let each = combinations(&range.each).into_iter().enumerate();
            each.map(move |(k, each)| range.hold(cases, &each, k))
        });
        let orders = self.order.iter().flat_map(|order| {
            combinations(&order.each).into_iter().map(move |each| order.hold(cases, &each))
        });
        let verdicts: Vec<Verdict> = ranges.chain(orders).collect();
        if verdicts.iter().all(|verdict| verdict.found.is_none()) {
            bail!("no case is one that something is expected of");
        }
        Ok(verdicts)
    }
}

/// All combinations of levels; that of none where there are no factors.
fn combinations(each: &Each) -> Vec<Levels> {
    each.iter().fold(vec![Levels::new()], |all, (factor, levels)| {
        let with = |of: &Levels, level: &String| {
            overlaid(of, &Levels::from([(factor.clone(), level.clone())]))
        };
        all.iter().flat_map(|of| levels.iter().map(move |level| with(of, level))).collect()
    })
}

/// Levels with others in their place.
fn overlaid(levels: &Levels, others: &Levels) -> Levels {
    levels.iter().chain(others).map(|(factor, level)| (factor.clone(), level.clone())).collect()
}

impl Range {
    /// Holds the combination with this number.
    fn hold(&self, cases: &[Value], each: &Levels, number: usize) -> Verdict {
        let levels = overlaid(each, &self.r#where);
        let values = values(cases, &levels, &self.value);
        let in_turn = |all: &[f64]| all.iter().copied().cycle().nth(number);
        let (at_least, at_most) = (in_turn(&self.at_least), in_turn(&self.at_most));
        let bounds =
            [at_least.map(|x| format!("at least {x}")), at_most.map(|x| format!("at most {x}"))];
        let bounds: Vec<String> = bounds.into_iter().flatten().collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let found = (!values.is_empty()).then(|| match values.len() {
            1 => format!("{least:.4}"),
            count => format!("{least:.4} to {most:.4} in {count} runs"),
        });
        Verdict {
            what: format!(
                "{} of {}: {} ({})",
                self.value,
                named(&levels),
                bounds.join(", "),
                self.source
            ),
            passed: found.is_none()
                || (at_least.is_none_or(|x| least >= x) && at_most.is_none_or(|x| most <= x)),
            found,
        }
    }
}

impl Order {
    fn hold(&self, cases: &[Value], each: &Levels) -> Verdict {
        let falling: Vec<Levels> =
            self.falling.iter().map(|levels| overlaid(each, levels)).collect();
        let mean = |levels: &Levels| {
            let values = values(cases, levels, &self.value);
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let means: Option<Vec<f64>> = falling.iter().map(mean).collect();
        let names: Vec<String> = falling.iter().map(named).collect();
        Verdict {
            what: format!("{}: {} ({})", self.value, names.join(" ≥ "), self.source),
            passed: means.as_ref().is_none_or(|m| m.windows(2).all(|w| w[1] <= w[0] + self.slack)),
            found: means
                .map(|m| m.iter().map(|x| format!("{x:.2}")).collect::<Vec<_>>().join(", ")),
        }
    }
}

/// A result of all cases at some levels that have it.
fn values(cases: &[Value], levels: &Levels, value: &str) -> Vec<f64> {
    let is_at = |case: &&Value| {
        levels.iter().all(|(factor, level)| case["levels"][factor] == level.as_str())
    };
    cases.iter().filter(is_at).filter_map(|case| result(&case["results"], value)).collect()
}

/// A result; `chi2` of a case with one kind of data is that of a datum.
fn result(results: &Value, value: &str) -> Option<f64> {
    match (value, results["chi2_per_datum"].as_object()) {
        ("chi2", Some(each)) if each.len() == 1 => each.values().next()?.as_f64(),
        _ => results[value].as_f64(),
    }
}

fn named(levels: &Levels) -> String {
    let one = |(factor, level): (&String, &String)| format!("{factor} {level}");
    levels.iter().map(one).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const EXPECTED: &str = r#"
        [[range]]
        each = { kind = ["grid"] }
        where = { scene = "1" }
        value = "psnr_db"
        at_least = [50.0]
        source = "someone"
        [[order]]
        falling = [{ kind = "grid" }, { kind = "network" }]
        value = "psnr_db"
        source = "someone"
    "#;

    fn case(kind: &str, psnr: f64) -> Value {
        json!({"levels": {"scene": "1", "kind": kind}, "results": {"psnr_db": psnr}})
    }

    #[test]
    fn exact_every_run_and_every_mean_count() {
        let expected = Expected::parse(EXPECTED).unwrap();
        let passed = |cases: Vec<Value>| -> Vec<bool> {
            let verdicts = expected.hold(&json!({ "cases": cases })).unwrap();
            verdicts.iter().map(|verdict| verdict.passed).collect()
        };
        assert_eq!(passed(vec![case("grid", 51.0), case("network", 40.0)]), [true, true]);
        assert_eq!(passed(vec![case("grid", 51.0), case("grid", 49.0)]), [false, true]);
        assert_eq!(passed(vec![case("grid", 51.0), case("network", 51.5)]), [true, false]);
        assert!(expected.hold(&json!({"cases": [case("other", 1.0)]})).is_err());
        assert!(expected.hold(&json!({})).is_err());
        for wrong in ["", "at_least = [50.0, 40.0]"] {
            assert!(Expected::parse(&EXPECTED.replace("at_least = [50.0]", wrong)).is_err());
        }
        let fits = json!({"chi2_per_datum": {"image": 2.0}, "seconds": 3.0});
        assert_eq!([result(&fits, "chi2"), result(&fits, "seconds")], [Some(2.0), Some(3.0)]);
    }

    /// Each combination has a verdict of its own; bounds take turns, and levels of an order count before those of all.
    #[test]
    fn exact_combinations_are_held_one_by_one() {
        let both = EXPECTED
            .replace("[\"grid\"]", "[\"grid\", \"network\"]")
            .replace("[50.0]", "[50.0, 45.0]")
            .replace(
                "falling",
                "each = { kind = [\"grid\", \"other\"], scene = [\"1\"] }\n falling",
            )
            .replace("{ kind = \"network\" }", "{}");
        let results = json!({ "cases": [case("grid", 49.0), case("network", 46.0)] });
        let verdicts = Expected::parse(&both).unwrap().hold(&results).unwrap();
        let passed: Vec<bool> = verdicts.iter().map(|verdict| verdict.passed).collect();
        assert_eq!(passed, [false, true, true, true]);
        assert!(verdicts[1].what.starts_with("psnr_db of kind network, scene 1: at least 45 ("));
        assert!(
            verdicts[3].what.starts_with("psnr_db: kind grid, scene 1 ≥ kind other, scene 1 (")
        );
    }

    /// The files that the program reads.
    #[test]
    fn exact_all_files_are_whole() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
        let mut count = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let expected = Expected::parse(&std::fs::read_to_string(&path).unwrap());
            assert!(expected.is_ok(), "{}: {expected:?}", path.display());
            count += 1;
        }
        assert!(count >= 4, "{count}");
    }
}
