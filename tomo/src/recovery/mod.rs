//! A fit as a function: from settings and data to the emission, its movie and a verdict.
//!
//! [`Problem`] (settings, rays, data) → searches for what of the geometry is not known → start → steps → [`Recovery`].
//! [`Progress`] follows a fit, stops it and keeps what it finds.

mod evidence;
mod expected;
mod fields;
mod found;
mod pictured;
mod problem;
mod progress;
pub mod results;
mod search;
mod start;
mod steps;
#[cfg(test)]
mod tests;
mod words;

pub use evidence::{Compared, DataVerdict, Evidence};
pub use fields::{carried, compare, recovered, recovered_at, true_volume};
pub use found::{Choice, Found, FoundAxis, Searched, Stage};
pub use problem::Problem;
pub use progress::{At, Event, Progress, Resumed, Silent};
pub use search::{ResolvedFit, settled};
pub use words::{range_of, short};

use crate::Error;
use crate::fit::settings::{FitFile, Kind};
use crate::fit::setup::{self, FitData, Instrument};
use crate::fit::{Loss, Motion, Region, State, Trainer};
use kerrlight_common::frames::Frames;
use kerrlight_render::volume::Volume;
use kerrlight_render::volume::metrics::{self, Comparison, Mask};
use kerrlight_vlbi::polarimetry::LeakageTable;

/// Reason why a fit ended before its end: it was told to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stopped {
    /// It was in a search that goes on where it was.
    #[error("stopped")]
    Kept,
    /// It was in work of which nothing is kept.
    #[error("stopped while {0}: nothing is kept of that")]
    Lost(&'static str),
    /// It was after this step.
    #[error("stopped after step {0}")]
    After(u64),
}

/// A fit, with all that it is made of.
pub struct Fit<'a, 't> {
    /// Settings, with what was found of the geometry.
    pub file: &'a FitFile,
    /// Rays.
    pub instrument: &'a Instrument,
    /// Motion.
    pub motion: &'a Motion,
    /// Data.
    pub measured: &'a FitData,
    /// The truth at the reference time, where data are simulated.
    pub true_volume: Option<Volume>,
    /// Result of a search for the geometry in this call.
    pub searched: Option<Searched>,
    /// The fit with its memory.
    pub trainer: Trainer<'t, f32>,
}

/// Recovered emission, with its evidence.
#[derive(Debug)]
pub struct Recovery {
    /// Settings, with what was found of the geometry in place of what was assumed.
    pub settings: FitFile,
    /// Result of a search for the geometry; none if the geometry was known.
    pub searched: Option<Searched>,
    /// Emission at the reference time, dimensionless, zero outside the region of recovery.
    pub volume: Volume,
    /// Images at the times of the data, Jy/pixel, rows from the top.
    pub movie: Frames<f32>,
    /// Times of its images, M.
    pub times: Vec<f64>,
    /// The loss of all data, without penalties.
    pub loss: Loss,
    /// Residuals of each kind of data, and whether the model explains them.
    pub judged: DataVerdict,
    /// Distance of the volume from the truth inside the region, where data are simulated.
    pub closeness: Option<Comparison>,
    /// Leakage of the stations' feeds beside the movie, where it is solved for.
    pub leakage: Option<LeakageTable>,
    /// Parameters of the representation, and the axis.
    pub state: State<f32>,
}

/// Recovers the emission of a problem.
///
/// # Errors
/// If a setting is missing or out of range, a problem has no solution, the loss grows whatever the rate, or `progress`
/// stops it.
pub fn fit(problem: &Problem, progress: &mut dyn Progress) -> Result<Recovery, Error> {
    fit_with(problem, progress, |fit, state| fit.recovery(state))
}

/// The same, with all that the fit is made of in place of the recovery alone.
///
/// # Errors
/// As [`fit`], and those of `finish`.
pub fn fit_with<R, E: From<Error>>(
    problem: &Problem,
    progress: &mut dyn Progress,
    finish: impl FnOnce(&mut Fit<'_, '_>, &State<f32>) -> Result<R, E>,
) -> Result<R, E> {
    let (placed, searched) = search::placed(problem, progress)?.unzip();
    let (file, instrument, motion, measured) = match &placed {
        Some(ResolvedFit { file, instrument, motion, measured }) => {
            (file, instrument, motion, measured.as_ref().unwrap_or(&problem.measured))
        }
        None => (&problem.settings, &problem.instrument, &problem.motion, &problem.measured),
    };
    let mut objective = problem.objective(instrument, motion, measured)?;
    let times = setup::emission_times(instrument, motion);
    let (axis, axis_rate) = setup::axis(file)?;
    // What a linear grid chooses is chosen where it is solved; of others the price of change is part of every step.
    let file = &match file.representation.kind {
        Kind::LinearGrid => file.clone(),
        _ => search::weighed(file, &mut objective, axis, times, progress)?,
    };
    let representation = setup::representation(file, &problem.registry, times)?;
    let training = setup::training(file, axis_rate, times)?;
    let mut state = State::new(&*representation, axis, &training);
    let mut trainer = Trainer::new(objective, &*representation, training);
    trainer.device = progress.device(file, &trainer)?;
    let truth = measured.truth.as_ref();
    let true_volume = truth.map(|truth| true_volume(file, truth, 0.0)).transpose()?;
    let searched = searched.flatten();
    let mut fit = Fit { file, instrument, motion, measured, true_volume, searched, trainer };
    progress.begins(&fit);
    match progress.resumed(&state)? {
        Some((earlier, leakage)) => {
            state = earlier;
            leakage.iter().for_each(|table| measured.restore_leakage(table));
        }
        None => {
            progress.starts()?;
            fit.start(&mut state, motion, times, progress)?;
            // An interrupted fit need not find again what its start has found.
            progress.save(&state)?;
        }
    }
    // A linear grid is solved for at the start.
    if file.representation.kind != Kind::LinearGrid {
        fit.steps(&mut state, progress)?;
    }
    finish(&mut fit, &state)
}

impl Fit<'_, '_> {
    /// All frames as the data see them: images, images of Stokes parameters, or fluxes.
    ///
    /// # Errors
    /// If residuals are not finite, or everything is dark where dark is no result.
    pub fn seen(&mut self, state: &State<f32>) -> Result<Frames<f32>, Error> {
        let frames: Vec<usize> = (0..self.measured.times.len()).collect();
        let seen = self.trainer.images(&state.now, &frames)?;
        self.check(&frames, &seen)?;
        Ok(seen)
    }

    /// Returns the evidence by which the residuals are judged.
    pub fn evidence(&self) -> Evidence<'_> {
        let Fit { file, measured, .. } = *self;
        Evidence { file: Some(file), losses: &file.loss, seed: file.seed, measured }
    }

    /// Judges whether the model explains its data, of which it sees `seen` in `movie`.
    ///
    /// # Errors
    /// If images cannot be read.
    pub fn judged(
        &self,
        state: &State<f32>,
        seen: &Frames<f32>,
        movie: &Frames<f32>,
    ) -> Result<DataVerdict, Error> {
        let objective = &self.trainer.objective;
        let mut statistics = objective.statistics(seen)?;
        let data: usize = statistics.iter().map(|of| of.all.count()).sum();
        let taken = self.solved(&state.now.parameters) as f64 / data.max(1) as f64;
        statistics.iter_mut().for_each(|of| of.taken = taken);
        self.evidence().judged((objective.names(), statistics), movie, None)
    }

    /// Parameters of a linear grid between their bounds: as many data, at most, are used up. None of others, which are
    /// no parameters of the data but of a function.
    fn solved(&self, parameters: &[f32]) -> usize {
        match (&self.file.representation.kind, &self.file.linear) {
            (Kind::LinearGrid, Some(linear)) => {
                let is_free = |x: &&f32| **x > 0.0 && f64::from(**x) < linear.upper;
                parameters.iter().filter(is_free).count()
            }
            _ => 0,
        }
    }

    fn recovery(&mut self, state: &State<f32>) -> Result<Recovery, Error> {
        let volume = recovered(self.file, &mut self.trainer, state)?;
        let seen = self.seen(state)?;
        // Before verdict and loss, which see the leakage from here on.
        let leakage = match self.measured.leakage {
            Some(_) => self.measured.solve_leakage(&seen.to_vec()?)?,
            None => None,
        };
        let frames: Vec<usize> = (0..self.measured.times.len()).collect();
        let loss = self.trainer.objective.loss_of(&frames, &seen)?;
        let movie = self.pictured(state, &seen)?;
        let judged = self.judged(state, &seen, &movie)?;
        let closeness = self.closeness(&volume)?;
        Ok(Recovery {
            settings: self.file.clone(),
            searched: self.searched.take(),
            volume,
            movie,
            times: self.measured.times.clone(),
            loss,
            judged,
            closeness,
            leakage: leakage.map(|found| found.table),
            state: state.clone(),
        })
    }

    /// Returns the distance of a volume from the truth inside the region; none without a truth.
    fn closeness(&self, volume: &Volume) -> Result<Option<Comparison>, Error> {
        let Some(truth) = &self.true_volume else { return Ok(None) };
        let Region { r_min, r_max, z_width } = self.file.region.limits();
        let mask = Mask { r_min, r_max, z_width };
        Ok(Some(metrics::compare(volume, truth, Some(&mask))?))
    }
}
