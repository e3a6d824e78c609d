//! Hard rays that ranks of one job trace together: each traces the parts that it takes, and the first one adds up. Parts lie
//! in a folder beside the results until then.

use super::Accuracy;
use crate::interrupt::Keeper;
use crate::output::{self, Output};
use crate::ranks::{self, Lead, Team};
use anyhow::Context;
use kerrlight_validation::accuracy::hard::{self, BATCH, Tally};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Most parts of a run.
const MOST: u64 = 1000;

/// A part as it is kept.
#[derive(Serialize, Deserialize)]
struct Part {
    kinds: Vec<Tally>,
}

/// Parts of one run.
pub struct Together<'a> {
    arguments: &'a Accuracy,
    rays: u64,
    /// Of all runs into this folder.
    beside: PathBuf,
    /// Of this run.
    folder: PathBuf,
    ranks: (u32, u32),
    lead: Option<Lead>,
}

impl<'a> Together<'a> {
    /// Of so many rays, beside the file of their results.
    pub fn new(arguments: &'a Accuracy, rays: u64, file: &Output, ranks: (u32, u32)) -> Self {
        let beside = file.shared().unwrap_or_default();
        let Accuracy { seed, integrator, tolerance, .. } = arguments;
        let (version, name) = (env!("CARGO_PKG_VERSION"), integrator.name());
        let identity = format!("{version} {rays} {seed} {name} {tolerance:e}");
        let folder = beside.join(format!("{:08x}", crc32fast::hash(identity.as_bytes())));
        Self { arguments, rays, beside, folder, ranks, lead: None }
    }

    /// Traces what nobody else does. The first rank waits for the others and has the sum of all whole parts, the others have
    /// nothing.
    ///
    /// # Errors
    /// If a part cannot be traced, written or read.
    pub fn run(
        &mut self,
        keeper: &Keeper,
        progress: &(dyn Fn(u64) -> bool + Sync),
    ) -> anyhow::Result<Option<Vec<Tally>>> {
        let pieces = ranks::named("part", self.parts());
        let (rank, size) = self.ranks;
        if rank > 0 {
            let team = Team::join(&self.folder, pieces, rank)?;
            self.trace(&team, keeper, progress)?;
            return team.leave().map(|()| None);
        }
        let lead = Lead::start(&self.folder, pieces, size)?;
        let there = (0..self.parts()).filter(|part| self.path(*part).is_file());
        there.into_iter().try_for_each(|part| lead.team.known(part))?;
        self.trace(&lead.team, keeper, progress)?;
        while lead.team.wait(keeper)? {
            self.trace(&lead.team, keeper, progress)?;
        }
        lead.team.free()?;
        self.lead = Some(lead);
        let there = (0..self.parts()).filter(|part| self.path(*part).is_file());
        let parts = there.map(|part| self.read(part)).collect::<anyhow::Result<Vec<_>>>()?;
        Ok(Some(hard::add_up(parts)))
    }

    /// Removes the parts, once the other ranks have left.
    pub fn end(self) {
        if let Some(lead) = self.lead {
            lead.end();
        }
        // What is left behind does no harm.
        let _ = std::fs::remove_dir_all(self.beside);
    }

    /// Traces parts until none is free, one on each thread.
    fn trace(
        &self,
        team: &Team,
        keeper: &Keeper,
        progress: &(dyn Fn(u64) -> bool + Sync),
    ) -> anyhow::Result<()> {
        let one = |_| {
            while let Some(part) = (!keeper.stopped()).then(|| team.take()).flatten() {
                let kinds = self.part(part, progress)?;
                // One that a signal has cut short is done again.
                if !keeper.stopped() {
                    let text = toml::to_string(&Part { kinds })?;
                    Output::new(&self.path(part), "toml")?.write(text.as_bytes())?;
                    team.done(part)?;
                }
            }
            anyhow::Ok(())
        };
        (0..rayon::current_num_threads()).into_par_iter().try_for_each(one)?;
        team.check()
    }

    fn part(
        &self,
        part: usize,
        progress: &(dyn Fn(u64) -> bool + Sync),
    ) -> anyhow::Result<Vec<Tally>> {
        let Accuracy { integrator, tolerance, seed, .. } = *self.arguments;
        let (all, from) = (self.rays.div_ceil(BATCH), part as u64 * self.batches());
        let batches = from..(from + self.batches()).min(all);
        Ok(hard::run_part((integrator, tolerance), (self.rays, seed), batches, progress)?)
    }

    fn read(&self, part: usize) -> anyhow::Result<Vec<Tally>> {
        let path = self.path(part);
        let text = output::read_text(&path)?;
        let part: Part = toml::from_str(&text)
            .with_context(|| format!("{} is damaged: remove it", path.display()))?;
        Ok(part.kinds)
    }

    /// Batches of a part.
    fn batches(&self) -> u64 {
        self.rays.div_ceil(BATCH).div_ceil(MOST)
    }

    fn parts(&self) -> usize {
        self.rays.div_ceil(BATCH).div_ceil(self.batches()) as usize
    }

    fn path(&self, part: usize) -> PathBuf {
        self.folder.join(format!("part_{part:05}.toml"))
    }
}
