//! What the cases of an experiment gave: all of them, and means over seeds.

use super::cases::Case;
use super::runner::Status;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Cases and how they ended.
pub struct Summary<'a> {
    /// In the order of the cases.
    pub all: Vec<(&'a Case, Status)>,
    /// How many seeds there are.
    pub seeds: u64,
}

/// The best and the worst case by one result.
#[derive(Debug, Clone, PartialEq)]
pub struct Extremes {
    /// The result's name in results.json.
    value: &'static str,
    /// The best case with its result.
    best: (String, f64),
    /// The worst case with its result.
    worst: (String, f64),
}

impl Extremes {
    /// `PSNR (dB) from 57.10 (axis scan, seed 1) to 41.20 (axis known, seed 2)`.
    fn sentence(&self) -> String {
        let (name, digits) = described(self.value);
        let one = |(case, x): &(String, f64)| format!("{} ({case})", number(*x, digits));
        if self.best == self.worst {
            return format!("{name} {}", one(&self.best));
        }
        format!("{name} from {} to {}", one(&self.best), one(&self.worst))
    }

    /// `by`, `best` and `worst` for other programs.
    pub fn json(&self) -> Value {
        let one = |(case, x): &(String, f64)| json!({"name": case, "value": x});
        json!({"by": self.value, "best": one(&self.best), "worst": one(&self.worst)})
    }
}

/// Mean and standard deviation over some cases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation of one, 0 for a single case.
    pub deviation: f64,
    /// How many.
    pub count: usize,
}

impl Spread {
    /// Of these values; nothing of none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let square: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
        let deviation = (square / (count.max(2) - 1) as f64).sqrt();
        Some(Self { mean, deviation, count })
    }

    /// `12.34 ± 0.56`.
    pub fn text(&self, digits: usize) -> String {
        if self.count < 2 {
            return number(self.mean, digits);
        }
        format!("{} ± {}", number(self.mean, digits), number(self.deviation, digits))
    }
}

/// A number with so many digits behind the point, or in powers of ten where none of them would tell.
pub fn number(x: f64, digits: usize) -> String {
    let tells = x == 0.0 || x.abs() >= 5.0 * 10f64.powi(-(digits as i32));
    if tells { format!("{x:.digits$}") } else { format!("{x:.1e}") }
}

/// Results that are shown: their names in results.json, what they are called, their units and digits.
pub const RESULTS: [(&str, &str, &str, usize); 11] = [
    ("psnr_db", "PSNR", "dB", 2),
    ("psnr_inside_db", "PSNR inside the region", "dB", 2),
    ("nrmse", "relative error", "", 4),
    ("correlation", "correlation", "", 4),
    ("axis_dot_truth", "axis · true axis", "", 4),
    ("chi2", "χ² a datum", "", 3),
    ("loss", "loss", "", 6),
    ("seconds", "wall time", "s", 1),
    ("cpu_seconds", "CPU time", "s", 1),
    ("peak_memory_mib", "peak memory", "MiB", 0),
    ("steps", "steps", "", 0),
];

/// χ² of one kind of data among several: `chi2.closure-phases`.
pub const ONE_CHI2: &str = "chi2.";

/// What a result is called with its unit, and its digits.
pub fn described(value: &str) -> (String, usize) {
    match RESULTS.iter().find(|(key, ..)| *key == value) {
        Some((_, name, "", digits)) => ((*name).to_owned(), *digits),
        Some((_, name, unit, digits)) => (format!("{name} ({unit})"), *digits),
        None => match value.strip_prefix(ONE_CHI2) {
            Some(name) => (format!("χ² a datum of {}", name.replace('-', " ")), 3),
            None => (value.to_owned(), 4),
        },
    }
}

/// One result of a case.
pub fn result(results: &Value, value: &str) -> Option<f64> {
    if value == "chi2" {
        let each = results["chi2_per_datum"].as_object()?;
        return (each.len() == 1).then(|| each.values().next()?.as_f64()).flatten();
    }
    if let Some(name) = value.strip_prefix(ONE_CHI2) {
        return results["chi2_per_datum"][name.replace('-', " ")]
            .as_f64()
            .filter(|x| x.is_finite());
    }
    results[value].as_f64().filter(|x| x.is_finite())
}

impl<'a> Summary<'a> {
    /// Of these cases.
    pub fn new(all: Vec<(&'a Case, Status)>) -> Self {
        let seeds = all.iter().map(|(case, _)| case.seed).max().unwrap_or(1);
        Summary { all, seeds }
    }

    /// Which seeds a plot shows.
    pub fn seeds_told(&self) -> String {
        if self.seeds == 1 { "One seed.".to_owned() } else { format!("All {} seeds.", self.seeds) }
    }

    /// Those that succeeded.
    pub fn done(&self) -> impl Iterator<Item = (&Case, &Value)> {
        self.all.iter().filter_map(|(case, status)| match status {
            Status::Done(results) => Some((*case, results)),
            _ => None,
        })
    }

    /// Those that failed, with the reason.
    pub fn failed(&self) -> impl Iterator<Item = (&Case, &str)> {
        self.all.iter().filter_map(|(case, status)| match status {
            Status::Failed(why) => Some((*case, why.as_str())),
            _ => None,
        })
    }

    /// How many have not been run to their end.
    pub fn open(&self) -> usize {
        self.all.iter().filter(|(_, status)| *status == Status::Open).count()
    }

    /// How many cases are done, and what the best and the worst of them have reached.
    pub fn worth(&self) -> String {
        let done = format!("{} of {} cases done", self.done().count(), self.all.len());
        self.extremes().map_or(done.clone(), |extremes| format!("{done}; {}", extremes.sentence()))
    }

    /// The best and the worst case by the first result that cases have: PSNR, χ² or loss.
    pub fn extremes(&self) -> Option<Extremes> {
        let of = |value: &'static str| {
            let all = self
                .done()
                .filter_map(|(case, results)| Some((case.name(), result(results, value)?)));
            let mut all: Vec<(String, f64)> = all.collect();
            all.sort_by(|(_, a), (_, b)| a.total_cmp(b));
            if value == "psnr_db" {
                all.reverse();
            }
            let (best, worst) = (all.first()?.clone(), all.last()?.clone());
            Some(Extremes { value, best, worst })
        };
        ["psnr_db", "chi2", "loss"].into_iter().find_map(of)
    }

    /// One result of all cases that are at these levels.
    pub fn spread(&self, value: &str, levels: &[(&str, &str)]) -> Option<Spread> {
        let chosen = self.done().filter(|(case, _)| is_at(case, levels));
        Spread::of(&chosen.filter_map(|(_, results)| result(results, value)).collect::<Vec<_>>())
    }

    /// Everything, for other programs.
    pub fn json(&self, title: &str, quick: bool) -> Value {
        let case = |(case, status): &(&Case, Status)| {
            let levels: Map<String, Value> =
                case.levels.iter().map(|(factor, level)| (factor.clone(), json!(level))).collect();
            let settings = case.settings.as_ref().ok();
            let settings = settings.and_then(|text| toml::from_str::<Value>(text).ok());
            let mut line = json!({
                "levels": levels,
                "seed": case.seed,
                "folder": format!("cases/{}", case.slug),
                "settings": settings,
            });
            match status {
                Status::Done(results) => {
                    line["status"] = json!("done");
                    line["results"] = results.clone();
                }
                Status::Failed(why) => {
                    line["status"] = json!("failed");
                    line["error"] = json!(why);
                }
                Status::Open => line["status"] = json!("open"),
            }
            line
        };
        let cases: Vec<Value> = self.all.iter().map(case).collect();
        let version = env!("CARGO_PKG_VERSION");
        json!({"title": title, "version": version, "quick": quick, "cases": cases})
    }

    /// The same as a table, a line a case.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let factors: Vec<String> = match self.all.first() {
            Some((case, _)) => case.levels.iter().map(|(factor, _)| factor.clone()).collect(),
            None => Vec::new(),
        };
        let numbers = RESULTS.iter().map(|(key, ..)| (*key).to_owned());
        let tail = ["seed", "status", "folder"].map(str::to_owned);
        writer.write_record(factors.into_iter().chain(tail).chain(numbers))?;
        for (case, status) in &self.all {
            let (word, results) = match status {
                Status::Done(results) => ("done", Some(results)),
                Status::Failed(_) => ("failed", None),
                Status::Open => ("open", None),
            };
            let levels = case.levels.iter().map(|(_, level)| level.clone());
            let tail = [case.seed.to_string(), word.to_owned(), format!("cases/{}", case.slug)];
            let number = |key: &str| {
                results.and_then(|r| result(r, key)).map(|x| x.to_string()).unwrap_or_default()
            };
            let numbers = RESULTS.iter().map(|(key, ..)| number(key));
            writer.write_record(levels.chain(tail).chain(numbers))?;
        }
        Ok(writer.into_inner()?)
    }
}

/// Whether a case is at all of these levels.
pub fn is_at(case: &Case, levels: &[(&str, &str)]) -> bool {
    levels.iter().all(|(factor, level)| case.level(factor) == Some(level))
}

/// Every combination of levels of some factors, in the order of the experiment.
pub fn combinations<'e>(levels: &'e [(String, Vec<String>)]) -> Vec<Vec<(&'e str, &'e str)>> {
    levels.iter().fold(vec![Vec::new()], |all, (factor, levels)| {
        let with = |before: &Vec<(&'e str, &'e str)>| -> Vec<Vec<(&'e str, &'e str)>> {
            let one = |level: &'e String| {
                let mut next = before.clone();
                next.push((factor.as_str(), level.as_str()));
                next
            };
            levels.iter().map(one).collect()
        };
        all.iter().flat_map(with).collect()
    })
}

/// What a combination is called: levels, with the factor's name before a number.
pub fn called(levels: &[(&str, &str)]) -> String {
    let one = |(factor, level): &(&str, &str)| match level.parse::<f64>() {
        Ok(_) => format!("{factor} {level}"),
        Err(_) => (*level).to_owned(),
    };
    levels.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Pairs of a map.
pub fn pairs(map: &BTreeMap<String, String>) -> Vec<(&str, &str)> {
    map.iter().map(|(factor, level)| (factor.as_str(), level.as_str())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_means_and_deviations() {
        assert_eq!(Spread::of(&[]), None);
        let one = Spread::of(&[3.0]).unwrap();
        assert_eq!((one.mean, one.deviation, one.text(1)), (3.0, 0.0, "3.0".to_owned()));
        let three = Spread::of(&[1.0, 2.0, 3.0]).unwrap();
        assert_eq!((three.mean, three.deviation), (2.0, 1.0));
        assert_eq!(three.text(2), "2.00 ± 1.00");
        assert_eq!(
            [number(0.0004, 3), number(0.0, 3), number(-0.25, 2)],
            ["4.0e-4", "0.000", "-0.25"]
        );
    }

    #[test]
    fn exact_combinations_keep_their_order() {
        let levels = [
            ("a".to_owned(), vec!["1".to_owned(), "2".to_owned()]),
            ("b".to_owned(), vec!["x".to_owned(), "y".to_owned()]),
        ];
        let names: Vec<String> = combinations(&levels).iter().map(|c| called(c)).collect();
        assert_eq!(names, ["a 1, x", "a 1, y", "a 2, x", "a 2, y"]);
        assert_eq!(combinations(&[]), [Vec::new()]);
    }

    #[test]
    fn exact_results_are_numbers_or_nothing() {
        let results =
            json!({"psnr_db": 3.5, "nrmse": null, "chi2_per_datum": {"visibilities": 1.5}});
        assert_eq!(result(&results, "psnr_db"), Some(3.5));
        assert_eq!(result(&results, "nrmse"), None);
        assert_eq!(result(&results, "chi2"), Some(1.5));
        let two = json!({"chi2_per_datum": {"amplitudes": 1.5, "closure phases": 2.5}});
        assert_eq!(result(&two, "chi2"), None);
        assert_eq!(result(&two, "chi2.closure-phases"), Some(2.5));
        assert_eq!(described("chi2.closure-phases").0, "χ² a datum of closure phases");
        assert_eq!(described("psnr_db"), ("PSNR (dB)".to_owned(), 2));
    }
}
