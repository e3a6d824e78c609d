//! Ranks of one job on the pieces of one folder: the first one makes it, waits for the others and removes it.

use crate::claims::{Claim, Queue, Watch, workers};
use crate::interrupt::Keeper;
use anyhow::{Context, bail};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Where ranks of a job say that they have come, and that they have left, in the folder: behind these words is the job,
/// since a rank may come to what an earlier one has left before the first rank does.
const HERE: &str = "here";
const LEFT: &str = "left";
/// For so long ranks wait for each other.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often to look.
const LOOK: Duration = Duration::from_millis(50);

/// A rank among those that share pieces. Threads may take some at the same time.
pub struct Team {
    folder: PathBuf,
    job: String,
    rank: u32,
    inner: Mutex<Inner>,
}

/// What the rank knows.
struct Inner {
    queue: Queue,
    /// Pieces that this rank has, by their numbers, and since when.
    taken: HashMap<usize, (Claim, Instant)>,
    failure: Option<anyhow::Error>,
}

/// What the first rank does for the others.
pub struct Lead {
    /// As one of those who work.
    pub team: Team,
    size: u32,
}

impl Lead {
    /// Makes the folder, unless an earlier job has left it, and is the first to work on `pieces`.
    pub fn start(folder: &Path, pieces: Vec<String>, size: u32) -> anyhow::Result<Self> {
        Self::of_job(folder, pieces, size, super::job())
    }

    fn of_job(folder: &Path, pieces: Vec<String>, size: u32, job: String) -> anyhow::Result<Self> {
        let own = [HERE, LEFT].map(|kind| [kind, &job].concat());
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_mark = [HERE, LEFT].iter().any(|kind| name.starts_with(kind));
            if is_mark && (job.is_empty() || !own.contains(&name)) {
                // Of an earlier job.
                let _ = std::fs::remove_dir_all(entry.path());
            }
        }
        Ok(Self { team: Team::new(folder, pieces, 0, job)?, size })
    }

    /// Waits until the others have left, and removes the folder: one that came later would begin anew.
    pub fn end(self) {
        let Team { folder, job, .. } = &self.team;
        let (mut watch, clock) = (Watch::new(folder), Instant::now());
        let is_recorded =
            |worker: &str| workers(folder).iter().any(|record| record.worker == worker);
        let is_over = |watch: &mut Watch, rank: &u32| match mark(folder, HERE, job, *rank) {
            _ if mark(folder, LEFT, job, *rank).is_some() => true,
            // One that failed has removed its record.
            Some(worker) => !is_recorded(&worker) || watch.is_dead(&worker),
            None => clock.elapsed() > PATIENCE,
        };
        let mut others: Vec<u32> = (1..self.size).collect();
        while !others.is_empty() {
            others.retain(|rank| !is_over(&mut watch, rank));
            if !others.is_empty() {
                std::thread::sleep(LOOK);
            }
        }
        let folder = folder.clone();
        drop(self);
        // What is left behind does no harm.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// Who has made a mark.
fn mark(folder: &Path, kind: &str, job: &str, rank: u32) -> Option<String> {
    std::fs::read_to_string(folder.join([kind, job].concat()).join(rank.to_string())).ok()
}

impl Team {
    /// Joins the first rank as the rank `rank`, once its folder is there.
    ///
    /// # Errors
    /// If it is not there within a minute.
    pub fn join(folder: &Path, pieces: Vec<String>, rank: u32) -> anyhow::Result<Self> {
        let clock = Instant::now();
        while !folder.is_dir() {
            if clock.elapsed() > PATIENCE {
                bail!(
                    "rank 0 has not begun {}: where each rank has a command of its own, set {}=1",
                    folder.display(),
                    super::ALONE
                );
            }
            std::thread::sleep(LOOK);
        }
        Self::new(folder, pieces, rank, super::job())
    }

    fn new(folder: &Path, pieces: Vec<String>, rank: u32, job: String) -> anyhow::Result<Self> {
        let queue = Queue::join(folder, pieces)?;
        for kind in [HERE, LEFT] {
            let path = folder.join([kind, &job].concat());
            std::fs::create_dir_all(&path)
                .with_context(|| format!("cannot make the folder {}", path.display()))?;
        }
        let inner = Inner { queue, taken: HashMap::new(), failure: None };
        let team = Self { folder: folder.to_owned(), job, rank, inner: Mutex::new(inner) };
        team.sign(HERE)?;
        Ok(team)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn sign(&self, kind: &str) -> anyhow::Result<()> {
        let name = self.inner().queue.claims.name().to_owned();
        let folder = self.folder.join([kind, &self.job].concat());
        let path = folder.join(self.rank.to_string());
        std::fs::write(&path, name).with_context(|| format!("cannot write {}", path.display()))
    }

    /// Where the pieces are shared.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Says that a piece was done before.
    pub fn known(&self, piece: usize) -> anyhow::Result<()> {
        self.inner().queue.skip(piece)
    }

    /// The number of a piece that nobody has, or of one whose owner is dead; nothing if there is none now, or claims
    /// cannot be read or written, which [`Self::check`] tells.
    pub fn take(&self) -> Option<usize> {
        let mut inner = self.inner();
        match inner.queue.next() {
            Ok(Some((piece, claim))) => {
                inner.queue.claims.works_on(Some(&claim.piece));
                inner.taken.insert(piece, (claim, Instant::now()));
                Some(piece)
            }
            Ok(None) => None,
            Err(error) => {
                inner.failure.get_or_insert(error);
                None
            }
        }
    }

    /// Says that a piece that this rank has taken is done.
    pub fn done(&self, piece: usize) -> anyhow::Result<()> {
        let mut inner = self.inner();
        let Some((claim, since)) = inner.taken.remove(&piece) else { return Ok(()) };
        inner.queue.done((piece, &claim), since.elapsed().as_secs_f64())
    }

    /// Whether whoever has a piece is dead.
    pub fn is_abandoned(&self, piece: usize) -> bool {
        self.inner().queue.is_abandoned(piece)
    }

    /// What went wrong in [`Self::take`].
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> anyhow::Result<()> {
        self.inner().failure.take().map_or(Ok(()), Err)
    }

    /// Waits a moment for the others; whether anything is left to do or to wait for. Whoever does not lead, leaves.
    pub fn wait(&self, keeper: &Keeper) -> anyhow::Result<bool> {
        self.check()?;
        if keeper.stopped() || self.rank > 0 {
            return Ok(false);
        }
        let mut inner = self.inner();
        inner.queue.look()?;
        let is_over = inner.queue.open() == 0;
        inner.queue.claims.works_on(None);
        drop(inner);
        if !is_over {
            std::thread::sleep(LOOK);
        }
        Ok(!is_over)
    }

    /// How many pieces have not ended, as far as is known.
    pub fn open(&self) -> usize {
        self.inner().queue.open()
    }

    /// Gives back what this rank has taken and not done.
    pub fn free(&self) -> anyhow::Result<()> {
        let mut inner = self.inner();
        let taken = std::mem::take(&mut inner.taken);
        taken.values().try_for_each(|(claim, _)| inner.queue.claims.free(claim))
    }

    /// Leaves.
    pub fn leave(self) -> anyhow::Result<()> {
        self.free()?;
        self.sign(LEFT)
    }

    /// Whether the first rank is at work or its end is not seen yet.
    pub fn is_led(&self, watch: &mut Watch) -> bool {
        mark(&self.folder, HERE, &self.job, 0).is_none_or(|worker| !watch.is_dead(&worker))
    }
}

/// The pieces of a folder by their numbers.
pub fn named(kind: &str, count: usize) -> Vec<String> {
    (0..count).map(|k| format!("{kind}_{k:05}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A leader waits for one that comes late, and nothing is left of the folder.
    #[test]
    fn exact_the_first_rank_waits_for_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("shared");
        let (go, ready) = std::sync::mpsc::channel();
        let late = {
            let at = at.clone();
            std::thread::spawn(move || {
                let team = Team::join(&at, named("piece", 9), 1).unwrap();
                ready.recv().unwrap();
                std::thread::sleep(Duration::from_millis(300));
                let done = std::iter::from_fn(|| team.take()).inspect(|k| team.done(*k).unwrap());
                let count = done.count();
                team.leave().unwrap();
                count
            })
        };
        let lead = Lead::start(&at, named("piece", 9), 2).unwrap();
        lead.team.known(4).unwrap();
        let mine: Vec<usize> = std::iter::from_fn(|| lead.team.take()).take(3).collect();
        assert_eq!(mine, [0, 1, 2]);
        mine.iter().for_each(|k| lead.team.done(*k).unwrap());
        go.send(()).unwrap();
        let keeper = Keeper::brief("");
        while lead.team.wait(&keeper).unwrap() {}
        lead.end();
        assert_eq!(late.join().unwrap(), 5);
        assert!(!at.exists());
    }

    /// A rank that is faster than the first one, in what a killed job has left, is not taken for one of that job.
    #[test]
    fn exact_a_rank_that_comes_before_the_first_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("shared");
        let of_job = |job: &str| Lead::of_job(&at, named("piece", 2), 2, job.to_owned()).unwrap();
        drop(of_job("_killed"));
        let early = Team::new(&at, named("piece", 2), 1, "_new".to_owned()).unwrap();
        let done = std::iter::from_fn(|| early.take()).inspect(|k| early.done(*k).unwrap());
        assert_eq!(done.count(), 2);
        early.leave().unwrap();
        let (lead, clock) = (of_job("_new"), Instant::now());
        assert!(!at.join("here_killed").exists());
        assert!(lead.team.take().is_none());
        lead.end();
        assert!(clock.elapsed() < Duration::from_secs(10) && !at.exists());
    }

    /// What a stopped rank had is free, and a rank that died keeps nobody waiting.
    #[test]
    fn exact_what_is_given_back_is_taken_by_others() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("shared");
        let lead = Lead::start(&at, named("piece", 2), 2).unwrap();
        let other = Team::join(&at, named("piece", 2), 1).unwrap();
        assert_eq!((other.take(), lead.team.take()), (Some(0), Some(1)));
        assert!(lead.team.take().is_none() && !lead.team.is_abandoned(0));
        other.leave().unwrap();
        assert_eq!(lead.team.take(), Some(0));
        assert!(at.join("claims/piece_00000.1").exists());
        lead.end();
        assert!(!at.exists());
    }
}
