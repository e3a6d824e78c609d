//! How the cases of a folder stand: done, running and by whom, failed, and the time left.

use super::cases::Case;
use super::runner::CASES;
use super::share::{self, FOLDER};
use crate::answer::Answer;
use crate::claims::{self, Board, Record, Watch};
use crate::interrupt::Keeper;
use crate::output;
use anyhow::{Context, anyhow};
use serde_json::{Value, json};
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

/// How often the table is shown anew on a terminal.
const EVERY: Duration = Duration::from_secs(2);
/// Failed cases that are named.
const NAMED: usize = 10;

/// Shows the table; on a terminal again and again, until all cases have ended or Ctrl-C.
pub fn show(folder: &Path, cases: &[Case]) -> anyhow::Result<Answer> {
    if !folder.join(super::plan::FILE).is_file() {
        return Err(no_comparison(folder));
    }
    let mut watch = Watch::new(&folder.join(FOLDER));
    let keeper = Keeper::brief(String::new());
    loop {
        let now = Now::of(folder, cases, &mut watch)?;
        if !std::io::stdout().is_terminal() || now.open() == 0 || keeper.stopped() {
            return Ok(now.answer());
        }
        // From the top of an empty screen.
        output::print(&format!("\x1b[2J\x1b[H{}", now.text()))?;
        std::thread::sleep(EVERY);
    }
}

/// Of a folder in which nothing was begun.
pub fn no_comparison(folder: &Path) -> anyhow::Error {
    anyhow!("{} holds no comparison: there is no {} in it", folder.display(), super::plan::FILE)
}

/// How it stands at one moment.
struct Now {
    all: usize,
    done: usize,
    /// Names and reasons.
    failed: Vec<(String, String)>,
    /// Who works, and the name of the case.
    running: Vec<(Record, String)>,
    /// Who has not left, but is dead.
    dead: Vec<String>,
}

impl Now {
    fn of(folder: &Path, cases: &[Case], watch: &mut Watch) -> anyhow::Result<Self> {
        let shared = folder.join(FOLDER);
        let board = Board::read(&shared).context("claims")?;
        let is_done = |case: &Case| {
            let run = folder.join(CASES).join(&case.slug);
            board.of(&case.slug).done || run.join("report.html").is_file()
        };
        let failures = share::failures(folder, cases);
        let failed = cases.iter().filter_map(|case| {
            let why = failures.get(&case.slug).or(case.error.as_ref())?;
            Some((case.name(), why.clone()))
        });
        let (dead, alive): (Vec<Record>, Vec<Record>) =
            claims::workers(&shared).into_iter().partition(|other| watch.is_dead(&other.worker));
        let named = |record: Record| {
            let case = cases.iter().find(|case| Some(&case.slug) == record.piece.as_ref());
            let name = case.map_or("waiting".to_owned(), Case::name);
            (record, name)
        };
        Ok(Self {
            all: cases.len(),
            done: cases.iter().filter(|case| is_done(case)).count(),
            failed: failed.collect(),
            running: alive.into_iter().map(named).collect(),
            dead: dead.into_iter().map(|record| record.worker).collect(),
        })
    }

    fn open(&self) -> usize {
        self.all.saturating_sub(self.done + self.failed.len())
    }

    /// Seconds until all cases have ended, if those to come are like those that the present workers have done.
    fn left_s(&self) -> Option<f64> {
        let (done, seconds) = self.running.iter().fold((0, 0.0), |(done, seconds), (worker, _)| {
            (done + worker.done, seconds + worker.seconds)
        });
        let rounds = self.open() as f64 / self.running.len() as f64;
        (done > 0).then(|| (rounds * seconds / done as f64).max(0.0))
    }

    fn text(&self) -> String {
        let mut text = format!(
            "{} of {} cases done, {} failed, {} open; {} at work",
            self.done,
            self.all,
            self.failed.len(),
            self.open(),
            self.running.len()
        );
        if let Some(seconds) = self.left_s() {
            let _ = write!(text, "; about {} left", duration(seconds));
        }
        text.push('\n');
        for (worker, case) in &self.running {
            let _ = writeln!(text, "  {:<32} {:>6} done  {case}", worker.worker, worker.done);
        }
        // Once all have ended it does not matter who died.
        for worker in self.dead.iter().filter(|_| self.open() > 0) {
            let _ = writeln!(text, "  {worker:<32} dead: others take up what it had");
        }
        for (name, why) in self.failed.iter().take(NAMED) {
            let _ = writeln!(text, "  failed: {name}: {why}");
        }
        if self.failed.len() > NAMED {
            let _ = writeln!(text, "  … and {} more", self.failed.len() - NAMED);
        }
        text
    }

    fn answer(&self) -> Answer {
        let worker = |(record, case): &(Record, String)| json!({"worker": record.worker, "host": record.host, "case": case, "done": record.done});
        let failed = |(name, why): &(String, String)| json!({"name": name, "error": why});
        Answer::text(self.text())
            .with("cases", self.all)
            .with("done", self.done)
            .with("open", self.open())
            .with("failed", self.failed.iter().map(failed).collect::<Vec<Value>>())
            .with("workers", self.running.iter().map(worker).collect::<Vec<Value>>())
            .with("dead", self.dead.clone())
            .with("seconds_left", self.left_s())
    }
}

/// Seconds as a person reads them.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_durations_are_read_by_people() {
        let all = [12.4, 600.0, 7200.0, 864_000.0].map(duration);
        assert_eq!(all, ["12 s", "10 min", "2.0 h", "10.0 days"]);
    }
}
