//! Draws by the ranks of one job: each draws what it takes, and the first one adds up.

use super::{Drawing, Folder, Posterior};
use crate::answer::Answer;
use crate::claims::Watch;
use crate::interrupt::Keeper;
use crate::output;
use crate::ranks::{self, Lead, Team};
use indicatif::ProgressBar;
use kerrlight_tomo::representation::Registry;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// For so long a first rank may be gone before the others leave: one that resumes a run takes a while to begin.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often to look whether the fit is finished.
const LOOK: Duration = Duration::from_millis(200);

/// Where ranks share draws around the run in this folder.
fn shared(run: &Path) -> PathBuf {
    run.join(super::FOLDER).join("shared")
}

/// The first rank of several, from when on the others wait for its draws.
pub fn lead(folder: &Folder, samples: u32) -> anyhow::Result<Option<Lead>> {
    let Some((0, size)) = ranks::this() else { return Ok(None) };
    let pieces = ranks::named("sample", samples as usize);
    Lead::start(&shared(folder.path()), pieces, size).map(Some)
}

/// Removes what ranks have shared, once all have left.
pub fn end(lead: Option<Lead>, folder: &Folder) {
    if let Some(lead) = lead {
        lead.end();
        output::sweep(&folder.path().join(super::FOLDER), |_| true);
        // What is left behind does no harm.
        let _ = std::fs::remove_dir_all(shared(folder.path()));
    }
}

/// Draws around a run as a rank that is not the first, when that one has finished the fit.
pub fn help(run: &Path, samples: u32, rank: u32, registry: &Registry) -> anyhow::Result<Answer> {
    let pieces = ranks::named("sample", samples as usize);
    let team = Team::join(&shared(run), pieces, rank)?;
    let (mut watch, mut seen) = (Watch::new(team.folder()), Instant::now());
    while !run.join("results.json").is_file() {
        if team.is_led(&mut watch) {
            seen = Instant::now();
        } else if seen.elapsed() > PATIENCE {
            return team.leave().map(|()| Answer::default());
        }
        std::thread::sleep(LOOK);
    }
    let draws = Posterior { run: run.to_owned(), samples };
    draws.with(registry, |drawing, path| drawing.share(&team, path, samples))?;
    team.leave().map(|()| Answer::default())
}

impl Drawing<'_> {
    /// Draws what no other rank has, until nothing is left to take.
    fn share(&self, team: &Team, path: &Path, samples: u32) -> anyhow::Result<()> {
        let keeper = Keeper::brief("");
        self.take(team, path, (samples, &keeper), &ProgressBar::hidden()).map(drop)
    }

    /// The same as the first rank, which waits for the others.
    pub fn share_all(
        &self,
        team: &Team,
        path: &Path,
        (samples, keeper): (u32, &Keeper),
        bar: &ProgressBar,
    ) -> anyhow::Result<()> {
        while self.take(team, path, (samples, keeper), bar)? && team.wait(keeper)? {
            bar.set_position(u64::from(samples) - team.open() as u64);
        }
        team.free()
    }

    /// Draws until nothing is left to take; whether it was not stopped.
    fn take(
        &self,
        team: &Team,
        path: &Path,
        (samples, keeper): (u32, &Keeper),
        bar: &ProgressBar,
    ) -> anyhow::Result<bool> {
        while let Some(k) = team.take() {
            if self.kept_or_drawn(path, k as u64 + 1, keeper, bar)?.is_none() {
                return Ok(false);
            }
            team.done(k)?;
            bar.set_position(u64::from(samples) - team.open() as u64);
        }
        team.check()?;
        Ok(true)
    }
}
