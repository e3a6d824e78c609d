//! Summary of the cases of an experiment: all of them, and means over seeds.

use super::cases::{Case, Status};
use super::experiment::Experiment;
use super::labels::{RESULTS, described, number, period, product};
use super::results::Results;
use super::runner::TOGETHER;
use crate::checksum;
use crate::output::Output;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

/// Cases and how they ended.
pub struct Summary<'a> {
    /// Experiment as it is shown.
    pub experiment: &'a Experiment,
    /// Cases in their order.
    pub all: Vec<(&'a Case, Status<Results>)>,
    /// Number of seeds.
    pub seeds: u64,
    /// Groups of cases, by the factors, by number, that they are grouped by.
    groups: Mutex<BTreeMap<Vec<usize>, Arc<Groups>>>,
}

/// Cases at the same levels of some factors, by those levels.
type Groups = HashMap<Vec<u32>, Vec<usize>>;

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
    /// Number of values.
    pub count: usize,
}

impl Spread {
    /// Summarises these values; nothing of none.
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
    /// Takes these cases.
    pub fn new(experiment: &'a Experiment, all: Vec<(&'a Case, Status<Results>)>) -> Self {
        let seeds = all.iter().map(|(case, _)| case.seed).max().unwrap_or(1);
        Summary { experiment, all, seeds, groups: Mutex::default() }
    }

    /// Takes these cases, whose settings and results are written for other programs as they are
    /// read.
    pub fn written(
        experiment: &'a Experiment,
        cases: &'a [Case],
        status: impl Fn(&Case) -> Status + Sync,
        quick: bool,
        output: &Output,
    ) -> anyhow::Result<Self> {
        let read = |case: &Case| {
            let status = status(case);
            let entry = checksum::listed(&entry(case, &status));
            let status = match status {
                Status::Done(results) => Status::Done(Results::of(&results)),
                Status::Failed(why) => Status::Failed(why),
                Status::Open => Status::Open,
            };
            (status, entry)
        };
        let mut all = Vec::with_capacity(cases.len());
        // Whole results are in memory for one stretch at a time; of the others only numbers stay.
        let entries = cases.chunks(TOGETHER).flat_map(|some| {
            let read: Vec<_> = some.par_iter().map(read).collect();
            let (states, entries): (Vec<_>, Vec<String>) = read.into_iter().unzip();
            all.extend(some.iter().zip(states));
            entries
        });
        let version = env!("CARGO_PKG_VERSION");
        let object = json!({"title": experiment.title, "version": version, "quick": quick});
        output.write_with(|file| Ok(checksum::seal_list(file, object, "cases", entries)?))?;
        Ok(Self::new(experiment, all))
    }

    /// Names the seeds that a plot shows.
    pub fn seeds_told(&self) -> String {
        if self.seeds == 1 { "One seed.".to_owned() } else { format!("All {} seeds.", self.seeds) }
    }

    /// Those that succeeded.
    pub fn done(&self) -> impl Iterator<Item = (&Case, &Results)> {
        self.all.iter().filter_map(done)
    }

    /// Those of them that are at all of these levels.
    pub fn at(&self, levels: &[(&str, &str)]) -> Vec<(&Case, &Results)> {
        let group = self.group(levels).unwrap_or_default();
        group.into_iter().filter_map(|k| done(&self.all[k])).collect()
    }

    /// Every combination of levels of some factors, without levels that no case, done or not, is at.
    pub fn combinations(&self, factors: &[String]) -> Vec<Vec<(&'a str, &'a str)>> {
        let mut all = self.experiment.levels_of(factors);
        for levels in &mut all {
            levels.retain(|level| self.group(&[*level]).is_some());
        }
        product(all)
    }

    /// Cases that are at all of these levels, by number.
    fn group(&self, levels: &[(&str, &str)]) -> Option<Vec<usize>> {
        let (first, _) = self.all.first()?;
        let places = levels.iter().map(|(factor, level)| first.place(factor, level));
        let mut places = places.collect::<Option<Vec<(usize, u32)>>>()?;
        // One key for the same levels, in whatever order they are named.
        places.sort_unstable();
        places.dedup();
        let (factors, levels): (Vec<usize>, Vec<u32>) = places.into_iter().unzip();
        self.groups_of(factors).get(&levels).cloned()
    }

    /// All cases by their levels of some factors.
    fn groups_of(&self, factors: Vec<usize>) -> Arc<Groups> {
        let mut known = self.groups.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(groups) = known.get(&factors) {
            return Arc::clone(groups);
        }
        let mut groups = Groups::new();
        for (k, (case, _)) in self.all.iter().enumerate() {
            let chosen = case.chosen();
            let levels = factors.iter().map(|factor| chosen[*factor]).collect();
            groups.entry(levels).or_default().push(k);
        }
        let groups = Arc::new(groups);
        known.insert(factors, Arc::clone(&groups));
        groups
    }

    /// Those that failed, with the reason.
    pub fn failed(&self) -> impl Iterator<Item = (&Case, &str)> {
        self.all.iter().filter_map(|(case, status)| match status {
            Status::Failed(why) => Some((*case, why.as_str())),
            _ => None,
        })
    }

    /// Returns the number of cases that have not been run to their end.
    pub fn open(&self) -> usize {
        self.all.iter().filter(|(_, status)| *status == Status::Open).count()
    }

    /// Describes how many cases are done, and the best and the worst of their results.
    pub fn worth(&self) -> String {
        let done = format!("{} of {} cases done", self.done().count(), self.all.len());
        self.extremes().map_or(done.clone(), |extremes| format!("{done}; {}", extremes.sentence()))
    }

    /// The best and the worst case by the first result that cases have: PSNR, χ² or loss.
    pub fn extremes(&self) -> Option<Extremes> {
        let of = |value: &'static str| {
            let all = self.done().filter_map(|(case, results)| Some((case, results.get(value)?)));
            let mut all: Vec<(&Case, f64)> = all.collect();
            all.sort_by(|(_, a), (_, b)| a.total_cmp(b));
            if value == "psnr_db" {
                all.reverse();
            }
            let named = |(case, x): &(&Case, f64)| (case.name(), *x);
            Some(Extremes { value, best: named(all.first()?), worst: named(all.last()?) })
        };
        ["psnr_db", "chi2", "loss"].into_iter().find_map(of)
    }

    /// One result of all cases that are at these levels.
    pub fn spread(&self, value: &str, levels: &[(&str, &str)]) -> Option<Spread> {
        let values = self.at(levels).into_iter().filter_map(|(_, results)| results.get(value));
        Spread::of(&unwrapped(values.collect(), period(value)))
    }

    /// The same as a table, a line a case.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let first = self.all.first().map(|(case, _)| case.levels());
        let factors = first.into_iter().flatten().map(|(factor, _)| factor);
        let columns = factors.chain(["seed", "status", "folder"]);
        writer.write_record(columns.chain(RESULTS.iter().map(|(key, ..)| *key)))?;
        for line @ (case, status) in &self.all {
            let levels = case.levels().map(|(_, level)| level.to_owned());
            let of_case = [case.seed.to_string(), word(status).to_owned(), folder(case)];
            let results = done(line).map(|(_, results)| results);
            let number = |k: usize| results.and_then(|of| of.number(k)).map(|x| x.to_string());
            let numbers = (0..RESULTS.len()).map(|k| number(k).unwrap_or_default());
            writer.write_record(levels.chain(of_case).chain(numbers))?;
        }
        Ok(writer.into_inner()?)
    }
}

fn done<'s>((case, status): &'s (&Case, Status<Results>)) -> Option<(&'s Case, &'s Results)> {
    match status {
        Status::Done(results) => Some((case, results)),
        _ => None,
    }
}

/// Names the status of a case, in a word.
fn word<R>(status: &Status<R>) -> &'static str {
    match status {
        Status::Done(_) => "done",
        Status::Failed(_) => "failed",
        Status::Open => "open",
    }
}

/// The folder of a case in that of the results.
fn folder(case: &Case) -> String {
    format!("cases/{}", case.slug())
}

/// All of a case, for other programs.
fn entry(case: &Case, status: &Status) -> Value {
    let levels: Map<String, Value> =
        case.levels().map(|(factor, level)| (factor.to_owned(), json!(level))).collect();
    // Settings of what is done are right.
    let is_right = matches!(status, Status::Done(_)) || case.early_error().is_none();
    let settings = is_right.then(|| case.table()).flatten();
    let mut entry = json!({
        "levels": levels,
        "seed": case.seed,
        "folder": folder(case),
        "settings": settings,
        "status": word(status),
    });
    match status {
        Status::Done(results) => entry["results"] = results.clone(),
        Status::Failed(why) => entry["error"] = json!(why),
        Status::Open => {}
    }
    entry
}

/// Returns whether a case is at all of these levels.
pub fn is_at(case: &Case, levels: &[(&str, &str)]) -> bool {
    levels.iter().all(|(factor, level)| case.level(factor) == Some(level))
}

/// Angles as the first of them has them, the short way round: 359 and 1 degrees are neighbours.
fn unwrapped(mut values: Vec<f64>, period: Option<f64>) -> Vec<f64> {
    if let (Some(period), Some(first)) = (period, values.first().copied()) {
        let near = |x: f64| first + (x - first + 0.5 * period).rem_euclid(period) - 0.5 * period;
        values.iter_mut().for_each(|x| *x = near(*x));
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_means_and_deviations() {
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(unwrapped(vec![359.0, 1.0, 358.0], Some(360.0)), [359.0, 361.0, 358.0]);
        assert_eq!(unwrapped(vec![-89.0, 89.0], Some(180.0)), [-89.0, -91.0]);
        assert_eq!(unwrapped(vec![359.0, 1.0], None), [359.0, 1.0]);
        let one = Spread::of(&[3.0]).unwrap();
        assert_eq!((one.mean, one.deviation, one.text(1)), (3.0, 0.0, "3.0".to_owned()));
        let three = Spread::of(&[1.0, 2.0, 3.0]).unwrap();
        assert_eq!((three.mean, three.deviation), (2.0, 1.0));
        assert_eq!(three.text(2), "2.00 ± 1.00");
    }
}
