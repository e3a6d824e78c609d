//! Progress of a fit, and what it keeps.

use super::Fit;
use super::found::{Choice, Found, FoundAxis, Stage};
use crate::Error;
use crate::fit::journal::{Forgetful, Journal};
use crate::fit::linear::{LinearProgress, LinearSolution};
use crate::fit::settings::FitFile;
use crate::fit::setup::{SolvedLeakage, WarmStarted};
use crate::fit::{DeviceRunner, Outcome, State, Trainer};
use kerrlight_vlbi::polarimetry::LeakageTable;

/// Position of a fit in its work.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum At {
    /// The search for the geometry.
    Geometry {
        /// Number of the search, from 0.
        search: usize,
        /// Number of all searches.
        of: usize,
        /// Geometries that it has evaluated.
        trials: usize,
        /// Least χ²/2 so far.
        least: f64,
    },
    /// Geometries that were weighed by the light curve of a band.
    Band(usize),
    /// A value, and a part of the data that is held out, from 0.
    HeldOut(usize, usize),
    /// Axes that were compared, of about so many.
    Axis(usize, usize),
    /// The linear problem.
    Linear(LinearProgress),
    /// Steps that were taken.
    Step(u64),
}

/// Event of a fit on its way.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The axis, from a scan of the whole sphere.
    Axis(&'a FoundAxis),
    /// The linear problem is solved.
    Linear(&'a LinearSolution<f32>),
    /// The representation has learnt that solution.
    WarmStarted(&'a WarmStarted),
    /// Leakage, in a round of the linear problem.
    Round(usize, &'a SolvedLeakage),
    /// Leakage of the last round, or before a step.
    Leakage(Option<u64>, &'a SolvedLeakage),
    /// Steps after which the model explains the data and others would follow their noise: the last ones.
    FollowsNoise(u64),
}

/// The state of an interrupted fit, with the leakage of stations that it had found.
pub type Resumed = (State<f32>, Option<LeakageTable>);

/// Follows a fit, stops it, and keeps what it finds, so that it can go on after an interruption. Every method does
/// nothing unless it is overridden.
pub trait Progress: Send {
    /// Told how far the fit has come; `false` stops it.
    fn goes_on(&mut self, _: At) -> bool {
        true
    }

    /// The journal of the search that begins.
    ///
    /// # Errors
    /// If it cannot be opened.
    fn journal(&mut self) -> Result<Box<dyn Journal>, Error> {
        Ok(Box::new(Forgetful))
    }

    /// Returns the choice of an interrupted fit in a stage.
    ///
    /// # Errors
    /// If it cannot be read.
    fn chosen(&mut self, _: Stage) -> Result<Option<Choice>, Error> {
        Ok(None)
    }

    /// Keeps what a search has found; what it returns is what [`Progress::chosen`] will, to the bit.
    ///
    /// # Errors
    /// If it cannot be written.
    fn keep(&mut self, found: &Found<'_>) -> Result<Choice, Error> {
        Ok(found.choice())
    }

    /// Told what was found.
    ///
    /// # Errors
    /// If it cannot be written.
    fn found(&mut self, _: Event<'_>) -> Result<(), Error> {
        Ok(())
    }

    /// A device that takes the steps.
    ///
    /// # Errors
    /// If there is one, and it cannot.
    fn device(&mut self, _: &FitFile, _: &Trainer<'_, f32>) -> Result<Option<DeviceRunner>, Error> {
        Ok(None)
    }

    /// Told what is fitted, before anything is.
    fn begins(&mut self, _: &Fit<'_, '_>) {}

    /// Returns what an interrupted fit has left; `start` is the state of a new one.
    ///
    /// # Errors
    /// If it cannot be read, or is that of another fit.
    fn resumed(&mut self, _: &State<f32>) -> Result<Option<Resumed>, Error> {
        Ok(None)
    }

    /// Told before a fit starts that resumes no other.
    ///
    /// # Errors
    /// If it cannot be written.
    fn starts(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Keeps a state.
    ///
    /// # Errors
    /// If it cannot be written.
    fn save(&mut self, _: &State<f32>) -> Result<(), Error> {
        Ok(())
    }

    /// Told of a step.
    ///
    /// # Errors
    /// If it cannot be written.
    fn stepped(&mut self, _: &mut Fit<'_, '_>, _: &State<f32>, _: Outcome) -> Result<(), Error> {
        Ok(())
    }
}

/// Tells nothing and keeps nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {}
