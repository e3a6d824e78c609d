//! What the cases of an experiment gave: all of them, and means over seeds.

use super::cases::{Case, Status};
use super::labels::{RESULTS, described, number, result};
use serde_json::{Map, Value, json};

/// Cases and how they ended.
pub struct Summary<'a> {
    /// In the order of the cases.
    pub all: Vec<(&'a Case, Status)>,
    /// How many seeds there are.
    pub seeds: u64,
}

/// A column of the table of results.
pub enum Values {
    /// Words.
    Text(Vec<String>),
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Numbers, of which some may be missing.
    Number(Vec<Option<f64>>),
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
            let settings = case.settings().ok();
            let settings = settings.and_then(|text| toml::from_str::<Value>(&text).ok());
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
        let columns = self.columns();
        writer.write_record(columns.iter().map(|(name, _)| name))?;
        for row in 0..self.all.len() {
            writer.write_record(columns.iter().map(|(_, values)| match values {
                Values::Text(all) => all[row].clone(),
                Values::Whole(all) => all[row].to_string(),
                Values::Number(all) => all[row].map(|x| x.to_string()).unwrap_or_default(),
            }))?;
        }
        Ok(writer.into_inner()?)
    }

    /// Levels of the factors, seed, status, folder and results of all cases.
    pub fn columns(&self) -> Vec<(String, Values)> {
        let first = self.all.first().map(|(case, _)| &case.levels[..]).unwrap_or_default();
        let all = || self.all.iter();
        let level = |k: usize| {
            Values::Text(
                all()
                    .map(|(case, _)| {
                        case.levels.get(k).map_or(String::new(), |(_, level)| level.clone())
                    })
                    .collect(),
            )
        };
        let status = |(_, status): &(&Case, Status)| {
            let word = match status {
                Status::Done(_) => "done",
                Status::Failed(_) => "failed",
                Status::Open => "open",
            };
            word.to_owned()
        };
        let number = |key: &str| {
            let of = |(_, status): &(&Case, Status)| match status {
                Status::Done(results) => result(results, key),
                _ => None,
            };
            Values::Number(all().map(of).collect())
        };
        let seeds = all().map(|(case, _)| case.seed.cast_signed()).collect();
        let folders = all().map(|(case, _)| format!("cases/{}", case.slug)).collect();
        let tail = [
            ("seed".to_owned(), Values::Whole(seeds)),
            ("status".to_owned(), Values::Text(all().map(status).collect())),
            ("folder".to_owned(), Values::Text(folders)),
        ];
        let levels = first.iter().enumerate().map(|(k, (name, _))| (name.clone(), level(k)));
        let numbers = RESULTS.iter().map(|(key, ..)| ((*key).to_owned(), number(key)));
        levels.chain(tail).chain(numbers).collect()
    }
}

/// Whether a case is at all of these levels.
pub fn is_at(case: &Case, levels: &[(&str, &str)]) -> bool {
    levels.iter().all(|(factor, level)| case.level(factor) == Some(level))
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
    }
}
