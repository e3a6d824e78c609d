//! Several processes, on one machine or many, run the cases of one folder: each case is done once.

use super::cases::{Case, Status};
use super::runner::{Runner, said};
use crate::claims::{Board, Claim, Queue, Watch};
use crate::interrupt::Keeper;
use crate::lock::Lock;
use crate::progress;
use crate::ranks;
use anyhow::{Context, bail};
use clap::ValueEnum;
use indicatif::ProgressBar;
use std::collections::HashMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What the processes tell each other, in the folder of the results.
pub const FOLDER: &str = "shared";
/// Runs that are not finished, there.
const WORK: &str = "work";

/// What a process does when all cases are done or taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Share {
    /// Wait until all have ended, take over those of dead processes, and write the report
    Wait,
    /// Leave
    Leave,
}

/// For how long a fit that was orphaned may take to notice.
const ORPHAN: Duration = Duration::from_secs(20);
/// How often to look whether others have ended.
const LOOK: Duration = Duration::from_millis(500);
/// A case whose workers have died so often is not tried again: it may be what kills them.
const DEATHS: u32 = 200;

/// This process among those that run the cases of a folder.
pub struct Sharing<'a> {
    runner: &'a Runner<'a>,
    /// All that can be run, in the order of the queue.
    cases: Vec<&'a Case>,
    queue: Queue,
    folder: PathBuf,
    costs: Costs<'a>,
}

/// What cases took this process, by their levels, seconds.
struct Costs<'a> {
    seconds: HashMap<&'a [u32], f64>,
    /// When the queue was ordered by them, and how long that took.
    ordered: Instant,
    ordering: Duration,
}

impl<'a> Sharing<'a> {
    /// Joins.
    pub fn join(folder: &Path, runner: &'a Runner<'a>, cases: &'a [Case]) -> anyhow::Result<Self> {
        let folder = folder.join(FOLDER);
        let work = folder.join(WORK);
        fs::create_dir_all(&work).with_context(|| format!("cannot make {}", work.display()))?;
        let cases: Vec<&Case> = cases.iter().filter(|case| case.error.is_none()).collect();
        let queue = Queue::join(&folder, cases.iter().map(|case| case.slug.clone()).collect())?;
        let (seconds, ordered, ordering) = (HashMap::new(), Instant::now(), Duration::ZERO);
        Ok(Self { runner, cases, queue, folder, costs: Costs { seconds, ordered, ordering } })
    }

    /// Takes the longest cases first, so that none is begun when all others end; before them those of unknown length, seed by
    /// seed.
    fn learn(&mut self, case: &'a Case, seconds: f64) {
        let Costs { seconds: known, ordered, ordering } = &mut self.costs;
        known.insert(case.combination(), seconds);
        if ordered.elapsed() < 20 * *ordering {
            return;
        }
        let clock = Instant::now();
        let cost = |case: &&Case| known.get(case.combination()).copied().unwrap_or(f64::INFINITY);
        let costs: Vec<f64> = self.cases.iter().map(cost).collect();
        self.queue.prefer(|at| costs[at]);
        (*ordered, *ordering) = (Instant::now(), clock.elapsed());
    }

    /// Runs cases until none is left to take; how many are open then, and how many this process has run.
    pub fn run(&mut self, share: Share, keeper: &Keeper) -> anyhow::Result<(usize, usize)> {
        let (open, name) = (self.queue.open(), self.queue.claims.name().to_owned());
        if !ranks::is_silent() {
            eprintln!("{} cases, {open} of them open; this is {name}", self.cases.len());
        }
        let bar = progress::cases(open as u64);
        let mut run = 0;
        while !keeper.stopped() && self.queue.open() > 0 {
            if let Some((at, claim)) = self.queue.next()? {
                run += usize::from(self.one(at, &claim, keeper, &bar)?);
            } else if share == Share::Leave {
                break;
            } else {
                self.queue.claims.works_on(None);
                bar.set_message("waiting for the others");
                std::thread::sleep(LOOK.max(20 * self.queue.look()?));
            }
            bar.set_position((open - self.queue.open()) as u64);
        }
        bar.finish_and_clear();
        Ok((self.queue.open(), run))
    }

    /// Runs a case; whether it has ended here.
    fn one(
        &mut self,
        at: usize,
        claim: &Claim,
        keeper: &Keeper,
        bar: &ProgressBar,
    ) -> anyhow::Result<bool> {
        let case = self.cases[at];
        self.queue.claims.works_on(Some(&claim.piece));
        bar.set_message(case.name());
        bar.tick();
        let clock = Instant::now();
        match self.status(case, claim, keeper)? {
            Status::Done(_) => {
                let seconds = clock.elapsed().as_secs_f64();
                self.queue.done((at, claim), seconds)?;
                self.learn(case, seconds);
            }
            Status::Failed(why) if self.queue.claims.holds(claim) => {
                bar.suspend(|| eprintln!("failed: {}: {why}", case.name()));
                self.queue.failed((at, claim), &why)?;
            }
            // Somebody has taken it over, and it failed for that.
            Status::Failed(_) => return Ok(false),
            Status::Open => {
                self.queue.claims.free(claim)?;
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// What comes of a case that this process has taken; open if it was stopped, or cannot be run now.
    fn status(&self, case: &Case, claim: &Claim, keeper: &Keeper) -> anyhow::Result<Status> {
        let known = self.runner.known(case);
        if known != Status::Open {
            return Ok(known);
        }
        if claim.turn > DEATHS {
            return Ok(Status::Failed(format!("{} processes have died with it", claim.turn)));
        }
        let work = self.work(&claim.piece, claim.turn);
        if !self.bring(case, claim, &work)? {
            return Ok(Status::Open);
        }
        match self.runner.run_in(case, &work, keeper) {
            // What kills a fit may be about to kill this process as well: then nothing has failed.
            Status::Failed(why) if why.starts_with("killed") => {
                std::thread::sleep(Duration::from_secs(1));
                Ok(Status::Failed(why))
            }
            // Nothing more can be written by anybody: the case is not at fault.
            Status::Failed(why) if is_full(&why) => bail!("{}: {why}", case.name()),
            Status::Done(results) => Ok(match publish(&work, &self.runner.run_of(case))? {
                true => Status::Done(results),
                // Another process has taken the run over, or published its own.
                false => self.runner.known(case),
            }),
            other => Ok(other),
        }
    }

    fn work(&self, slug: &str, turn: u32) -> PathBuf {
        self.folder.join(WORK).join(format!("{slug}.{turn}"))
    }

    /// Moves what there is of a run to where this process works on it, so that whoever had it writes to it no more;
    /// false if somebody still does.
    fn bring(&self, case: &Case, claim: &Claim, work: &Path) -> anyhow::Result<bool> {
        let earlier = (0..claim.turn).rev().map(|turn| self.work(&claim.piece, turn));
        for from in earlier.chain([self.runner.run_of(case)]) {
            // A fit whose worker was killed saves its state first.
            if from.is_dir() && Lock::take(&from, "fits in", ORPHAN).is_err() {
                return Ok(false);
            }
            match fs::rename(&from, work) {
                Ok(()) => return Ok(true),
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => {
                    return Err(error).with_context(|| format!("cannot move {}", from.display()));
                }
            }
        }
        Ok(true)
    }
}

/// Codes of the system for a disk or a quota that is full, as messages have them.
const FULL: [&str; 2] = ["(os error 28)", "(os error 122)"];

/// Whether a case has failed for lack of room on the disk.
fn is_full(why: &str) -> bool {
    FULL.iter().any(|code| why.contains(code))
}

/// Moves a finished run to its place, which only one process can do; false if it is there, or not here.
fn publish(work: &Path, place: &Path) -> anyhow::Result<bool> {
    match fs::rename(work, place) {
        Ok(()) => {
            // Its messages come along, if they can.
            let _ = fs::rename(said(work), said(place));
            Ok(true)
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(_) if place.join("results.json").exists() => {
            fs::remove_dir_all(work).with_context(|| format!("cannot clear {}", work.display()))?;
            Ok(false)
        }
        Err(error) => Err(error).with_context(|| format!("cannot move {}", work.display())),
    }
}

/// Cases that have failed in a shared folder, with the reasons.
pub fn failures(folder: &Path, cases: &[Case]) -> HashMap<String, String> {
    let folder = folder.join(FOLDER);
    let board = Board::read(&folder).unwrap_or_default();
    let failed = cases.iter().filter(|case| board.of(&case.slug).failed);
    failed.map(|case| (case.slug.clone(), crate::claims::reason(&folder, &case.slug))).collect()
}

/// Ends sharing, so that one process may work on the folder alone: runs that are not finished go back to their places.
///
/// # Errors
/// If others still work on it, or something cannot be moved.
pub fn end(folder: &Path, cases: &Path) -> anyhow::Result<()> {
    let shared = folder.join(FOLDER);
    if !shared.exists() {
        return Ok(());
    }
    alone(folder, &shared)?;
    for entry in fs::read_dir(shared.join(WORK)).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if let Some((slug, turn)) = name.rsplit_once('.')
            && turn.parse::<u32>().is_ok()
            && !cases.join(slug).exists()
        {
            fs::rename(entry.path(), cases.join(slug))
                .with_context(|| format!("cannot move {}", entry.path().display()))?;
        }
    }
    fs::remove_dir_all(&shared).with_context(|| format!("cannot clear {}", shared.display()))
}

/// Waits until all who have not left are known to be dead.
fn alone(folder: &Path, shared: &Path) -> anyhow::Result<()> {
    let mut watch = Watch::new(shared);
    let others = crate::claims::workers(shared);
    let longest = others.iter().map(|other| other.every_s).fold(0.0, f64::max);
    let (clock, mut told) = (Instant::now(), false);
    for other in others {
        while !watch.is_dead(&other.worker) {
            // One that is seen to live is not waited for.
            let lives = other.process.has_ended() == Some(false);
            if !lives && !told {
                eprintln!("waiting to see whether {} still works here", other.worker);
                told = true;
            }
            if lives || clock.elapsed().as_secs_f64() > 10.0 * longest {
                anyhow::bail!(
                    "{} is in use: {} works on it; join it with --share",
                    folder.display(),
                    other.worker
                );
            }
            std::thread::sleep(LOOK);
        }
    }
    Ok(())
}
