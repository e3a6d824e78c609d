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

/// Range of a result of every single case.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Cases.
    pub r#where: Levels,
    /// Name of the result.
    pub value: String,
    /// Least.
    pub at_least: Option<f64>,
    /// Most.
    pub at_most: Option<f64>,
    /// Source of the expectation.
    pub source: String,
}

/// Means over seeds that do not rise from one set of cases to the next.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
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
    /// If it is not one, or a range has no bound.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let expected: Self = toml::from_str(text)?;
        if let Some(range) =
            expected.range.iter().find(|r| r.at_least.is_none() && r.at_most.is_none())
        {
            bail!("{}: neither at_least nor at_most", named(&range.r#where));
        }
        Ok(expected)
    }

    /// Every expectation against `results.json`.
    ///
    /// # Errors
    /// If these are no results, or no case has a result that is requested.
    pub fn hold(&self, results: &Value) -> anyhow::Result<Vec<Verdict>> {
        let cases = results["cases"].as_array().context("there are no cases")?;
        let ranges = self.range.iter().map(|range| range.hold(cases));
        let verdicts: Vec<Verdict> =
            ranges.chain(self.order.iter().map(|order| order.hold(cases))).collect();
        if verdicts.iter().all(|verdict| verdict.found.is_none()) {
            bail!("no case is one that something is expected of");
        }
        Ok(verdicts)
    }
}

impl Range {
    fn hold(&self, cases: &[Value]) -> Verdict {
        let values = values(cases, &self.r#where, &self.value);
        let bounds = [
            self.at_least.map(|x| format!("at least {x}")),
            self.at_most.map(|x| format!("at most {x}")),
        ];
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
                named(&self.r#where),
                bounds.join(", "),
                self.source
            ),
            passed: found.is_none()
                || (self.at_least.is_none_or(|x| least >= x)
                    && self.at_most.is_none_or(|x| most <= x)),
            found,
        }
    }
}

impl Order {
    fn hold(&self, cases: &[Value]) -> Verdict {
        let mean = |levels: &Levels| {
            let values = values(cases, levels, &self.value);
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let means: Option<Vec<f64>> = self.falling.iter().map(mean).collect();
        let names: Vec<String> = self.falling.iter().map(named).collect();
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
        where = { scene = "1", kind = "grid" }
        value = "psnr_db"
        at_least = 50.0
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
        let unbound = EXPECTED.replace("at_least = 50.0", "");
        assert!(Expected::parse(&unbound).is_err());
        let fits = json!({"chi2_per_datum": {"image": 2.0}, "seconds": 3.0});
        assert_eq!([result(&fits, "chi2"), result(&fits, "seconds")], [Some(2.0), Some(3.0)]);
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
