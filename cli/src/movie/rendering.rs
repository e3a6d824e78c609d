//! The frames that are missing, batch by batch: all of them, or with other ranks of one job those that this one takes.

use super::frames::Sequence;
use crate::interrupt::{Interrupted, Keeper};
use crate::progress;
use crate::ranks::{self, Lead, Team};
use crate::render::exr_options::ExrOptions;
use indicatif::ProgressBar;
use kerrlight_geodesic::RayDevice;
use kerrlight_tomo::Error;
use kerrlight_tomo::render::{Film, Frame, RenderError};
use std::path::Path;
use std::time::{Duration, Instant};

/// So many pieces a rank has at least, if there are as many frames: the last ones end at about the same time.
const PIECES: usize = 4;
/// How often to look whether the first frame is there.
const LOOK: Duration = Duration::from_millis(50);

/// A film under way.
pub struct Rendering<'a> {
    film: &'a mut Film,
    sequence: &'a mut Sequence,
    folder: &'a Path,
    /// How files are written, and frames a second.
    style: (&'a ExrOptions, u16),
    bar: ProgressBar,
}

impl<'a> Rendering<'a> {
    /// Of the frames in `folder`, written in some style, so many a second.
    pub fn new(
        film: &'a mut Film,
        sequence: &'a mut Sequence,
        folder: &'a Path,
        style: (&'a ExrOptions, u16),
    ) -> Self {
        let batches = sequence.missing().len().div_ceil(film.batch());
        let bar = progress::bar((batches * sequence.height()) as u64);
        Self { film, sequence, folder, style, bar }
    }

    /// Renders what is missing and counts it; a rank that is not the first counts nothing.
    pub fn run(mut self) -> anyhow::Result<usize> {
        let (missing, start) = (self.sequence.missing(), Instant::now());
        match ranks::this() {
            None => self.rest()?,
            Some((0, size)) => self.lead(size)?,
            Some((rank, size)) => return self.help(rank, size).map(|()| 0),
        }
        self.bar.finish_and_clear();
        let (count, seconds) = (missing.len(), start.elapsed().as_secs_f64());
        let there = self.sequence.len() - count;
        eprintln!("{count} frames rendered in {seconds:.2} s, {there} were there");
        let unresolved = self.sequence.unresolved(&missing);
        if unresolved > 0 {
            eprintln!("warning: {unresolved} rays unresolved, shown as dark");
        }
        Ok(count)
    }

    /// All that is missing.
    fn rest(&mut self) -> anyhow::Result<()> {
        let missing = self.sequence.missing();
        let most = self.film.batch();
        missing.chunks(most).try_for_each(|batch| self.batch(batch, None))
    }

    /// With others, for whom this rank waits.
    fn lead(&mut self, size: u32) -> anyhow::Result<()> {
        let pieces = self.pieces(size);
        let at = self.folder.join("shared");
        let lead = Lead::start(&at.join(self.key(size)), names(&pieces), size)?;
        for (k, piece) in pieces.iter().enumerate() {
            if self.open(piece).is_empty() {
                lead.team.known(k)?;
            }
        }
        let keeper = Keeper::brief(self.there());
        loop {
            self.share(&lead.team, &pieces)?;
            if !lead.team.wait(&keeper)? {
                break;
            }
        }
        if keeper.stopped() {
            return Err(Interrupted(self.there()).into());
        }
        drop(keeper);
        self.sequence.find()?;
        // Frames that somebody has removed since.
        self.rest()?;
        lead.end();
        // What is left behind does no harm.
        let _ = std::fs::remove_dir_all(at);
        Ok(())
    }

    fn help(&mut self, rank: u32, size: u32) -> anyhow::Result<()> {
        let pieces = self.pieces(size);
        let folder = self.folder.join("shared").join(self.key(size));
        let team = Team::join(&folder, names(&pieces), rank)?;
        self.share(&team, &pieces)?;
        team.leave()
    }

    /// Renders pieces until none is free.
    fn share(&mut self, team: &Team, pieces: &[Vec<usize>]) -> anyhow::Result<()> {
        while let Some(k) = team.take() {
            let batch = self.open(&pieces[k]);
            self.batch(&batch, Some(team))?;
            team.done(k)?;
        }
        team.check()
    }

    /// Frames that are rendered by one rank, the same for all ranks.
    fn pieces(&self, size: u32) -> Vec<Vec<usize>> {
        let all: Vec<usize> = (0..self.sequence.len()).collect();
        let even = all.len().div_ceil(PIECES * size as usize).max(1);
        all.chunks(self.film.batch().min(even)).map(<[usize]>::to_vec).collect()
    }

    /// What tells the pieces of this film from others.
    fn key(&self, size: u32) -> String {
        let decides = format!("{size} {}", self.sequence.identity());
        format!("{:08x}", crc32fast::hash(decides.as_bytes()))
    }

    /// Those of some frames that are not there.
    fn open(&self, piece: &[usize]) -> Vec<usize> {
        let is_there = |k: &usize| self.sequence.path(*k, "exr").exists();
        piece.iter().copied().filter(|k| !is_there(k)).collect()
    }

    fn batch(&mut self, batch: &[usize], team: Option<&Team>) -> anyhow::Result<()> {
        if batch.is_empty() {
            return Ok(());
        }
        let keeper = Keeper::brief(self.there());
        let times: Vec<f64> = batch.iter().map(|k| self.sequence.time(*k)).collect();
        let frames = self.frames(&times, &keeper)?;
        if let Some(team) = team.filter(|_| batch[0] != 0) {
            self.await_scale(team, &keeper)?;
        }
        self.sequence.write(self.film, self.style, batch, frames)
    }

    fn frames(&mut self, times: &[f64], keeper: &Keeper) -> anyhow::Result<Vec<Frame>> {
        let bar = &self.bar;
        let frames = self.film.frames(times, &|rows| {
            bar.inc(rows as u64);
            !keeper.stopped()
        });
        match frames {
            Err(Error::Render(RenderError::Stopped)) => {
                self.bar.finish_and_clear();
                Err(Interrupted(self.there()).into())
            }
            Err(error) => {
                let failure = self.film.device().and_then(RayDevice::failure);
                let told = failure.map(|failure| {
                    format!("{failure}; {}, or with --device cpu into another folder", self.there())
                });
                Err(told.map_or(error.into(), anyhow::Error::msg))
            }
            Ok(frames) => Ok(frames),
        }
    }

    /// Waits for the frame whose scale all others share, where there is one; it is rendered once more if whoever had it
    /// is dead.
    fn await_scale(&mut self, team: &Team, keeper: &Keeper) -> anyhow::Result<()> {
        while self.sequence.lacks_scale()? {
            if keeper.stopped() {
                return Err(Interrupted(self.there()).into());
            }
            if team.is_abandoned(0) {
                let first = self.frames(&[self.sequence.time(0)], keeper)?;
                return self.sequence.scale_like(self.film, &first[0]);
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// How far it is, and how to resume.
    fn there(&self) -> String {
        let (done, all) =
            (self.sequence.len() - self.sequence.missing().len(), self.sequence.len());
        let folder = self.folder.display();
        format!(
            "stopped: {done} of {all} frames are in {folder}; run the same command again to resume"
        )
    }
}

fn names(pieces: &[Vec<usize>]) -> Vec<String> {
    pieces.iter().map(|piece| format!("frame_{:04}", piece[0])).collect()
}
