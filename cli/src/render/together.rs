//! A picture that ranks of one job render together: each renders the bands that it takes, and the first one writes the
//! file. Bands lie in a folder beside the file until then, each a journal of its own.

use crate::interrupt::Keeper;
use crate::output::Output;
use crate::progress;
use crate::ranks::{self, Lead, Team};
use anyhow::Context;
use kerrlight_render::Error;
use kerrlight_render::picture::{Journal, Raster, RenderError};
use std::io;
use std::path::{Path, PathBuf};

/// Bands that lie beside a file.
pub struct Together<'a> {
    raster: &'a Raster,
    /// All that decides the picture.
    identity: &'a str,
    /// Of all pictures of this name.
    beside: PathBuf,
    /// Of this picture.
    folder: PathBuf,
    lead: Option<Lead>,
}

impl<'a> Together<'a> {
    /// Of the file; nothing for standard output, beside which there is no place.
    pub fn new(raster: &'a Raster, exr: &Output, identity: &'a str) -> Option<Self> {
        let beside = exr.shared()?;
        let folder = beside.join(format!("{:08x}", crc32fast::hash(identity.as_bytes())));
        Some(Self { raster, identity, beside, folder, lead: None })
    }

    /// Renders bands as one of the ranks that do not write the file.
    pub fn help(&self, rank: u32) -> anyhow::Result<()> {
        let team = Team::join(&self.folder, self.bands(), rank)?;
        let keeper = Keeper::brief("");
        match self.render(&team, &keeper, &|| {}) {
            Err(Error::Render(RenderError::Stopped)) | Ok(()) => {}
            Err(error) => return Err(error.into()),
        }
        team.check()?;
        team.leave()
    }

    /// Fills the journal with what an earlier job has left and, if this is the first of several ranks, with what all of
    /// them render. What is missing after that has been damaged.
    pub fn fill(
        &mut self,
        journal: &mut Journal<std::fs::File>,
        stopped: &str,
    ) -> anyhow::Result<()> {
        self.take_in(journal)?;
        let Some((_, size)) = ranks::this() else { return Ok(()) };
        let lead = Lead::start(&self.folder, self.bands(), size)?;
        let missing = journal.missing();
        let all = self.raster.bands();
        (0..all).filter(|k| !missing.contains(k)).try_for_each(|k| lead.team.known(k))?;
        let (keeper, bar) = (Keeper::brief(stopped), progress::bar(all as u64));
        loop {
            let show = || bar.set_position((all - lead.team.open()) as u64);
            self.render(&lead.team, &keeper, &show)?;
            self.take_in(journal)?;
            if !lead.team.wait(&keeper)? {
                break;
            }
        }
        bar.finish_and_clear();
        if keeper.stopped() {
            lead.team.free()?;
            return Err(Error::from(RenderError::Stopped).into());
        }
        self.take_in(journal)?;
        self.lead = Some(lead);
        Ok(())
    }

    /// Removes what lies beside the file, which is whole, once the others have left.
    pub fn end(self) {
        if let Some(lead) = self.lead {
            lead.end();
        }
        // What is left behind does no harm.
        let _ = std::fs::remove_dir_all(self.beside);
    }

    fn bands(&self) -> Vec<String> {
        ranks::named("band", self.raster.bands())
    }

    fn path(&self, band: usize) -> PathBuf {
        self.folder.join(format!("band_{band:05}.partial"))
    }

    /// Renders bands until none is free.
    fn render(&self, team: &Team, keeper: &Keeper, show: &(dyn Fn() + Sync)) -> Result<(), Error> {
        let keep = |band: usize, bytes: Vec<u8>| {
            let kept = write(&self.path(band), &bytes).and_then(|()| team.done(band));
            show();
            kept.map_err(|error| io::Error::other(format!("{error:#}")))
        };
        let mut todo = std::iter::from_fn(|| team.take());
        self.raster.fill_apart(self.identity, &mut todo, &keep, &|_| !keeper.stopped())
    }

    fn take_in(&self, journal: &mut Journal<std::fs::File>) -> anyhow::Result<()> {
        for band in journal.missing() {
            if let Ok(bytes) = std::fs::read(self.path(band)) {
                journal.absorb(self.identity, bytes).context("cannot write finished bands")?;
            }
        }
        Ok(())
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    Output::new(path, "")?.write(bytes)
}
