//! Start of a fit: an axis, the solution of a linear problem, leakage.

use super::found::FoundAxis;
use super::progress::{At, Event, Progress};
use super::search::weighed;
use super::{Fit, Stopped};
use crate::Error;
use crate::fit::linear::{Ending, LinearProblem, LinearProgress, LinearSolution};
use crate::fit::scan::{AxisLoss, AxisSettings, refine_axis, scan_axis};
use crate::fit::settings::{AxisScan as AxisScanSettings, AxisSearch, FitFile, Kind, Start};
use crate::fit::setup::{self, CoarseView, FitData, SolvedLeakage};
use crate::fit::{Field, ForwardModel, Motion, State, Trainer};
use crate::representation::Registry;
use core::ops::ControlFlow;
use kerrlight_render::dynamics::Axis;
use std::sync::{Mutex, PoisonError};

/// The loss over the whole sphere of axes, and the best one.
fn scan(
    file: &FitFile,
    settings: &AxisScanSettings,
    measured: &FitData,
    motion: &Motion,
    progress: &mut dyn Progress,
) -> Result<FoundAxis, Error> {
    let AxisScanSettings { directions, frames, pixels, refine, .. } = *settings;
    let stopped = || Error::from(Stopped::Lost("axes were being scanned"));
    let view = CoarseView::new(file, measured, pixels)?;
    let settings = AxisSettings { directions, ..AxisSettings::default() };
    // Axes are compared by several threads, each of which tells.
    let told = Mutex::new(progress);
    let watch = |solved: usize, expected: usize| {
        let mut progress = told.lock().unwrap_or_else(PoisonError::into_inner);
        progress.goes_on(At::Axis(solved, expected))
    };
    let whole = |problem: &LinearProblem<'_, f32>| scan_axis(problem, &settings, &watch);
    let scan = view.search(motion, frames, whole)?.ok_or_else(stopped)?;
    let refined = refine.map(|nodes| -> Result<AxisLoss, Error> {
        let view = CoarseView::new(file, measured, file.screen.pixels)?;
        let near =
            |problem: &LinearProblem<'_, f32>| refine_axis(problem, scan.best.axis, nodes, &watch);
        view.search(motion, frames, near)?.ok_or_else(stopped)
    });
    Ok(FoundAxis { refined: refined.transpose()?, scan })
}

impl Fit<'_, '_> {
    /// The axis and the parameters that a scan and the linear problem give to begin with.
    pub(super) fn start(
        &mut self,
        state: &mut State<f32>,
        motion: &Motion,
        times: [f64; 2],
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        let file = self.file;
        if let AxisSearch::Scan(settings) = &file.axis {
            let found = scan(file, settings, self.measured, motion, progress)
                .map_err(|error| error.while_in("axis.scan"))?;
            state.now.axis = found.axis();
            progress.found(Event::Axis(&found))?;
        }
        let axis = state.now.axis;
        let measured = self.measured;
        let trainer = &mut self.trainer;
        if file.representation.kind == Kind::LinearGrid {
            let file = weighed(file, &mut trainer.objective, axis, times, progress)?;
            let solution = solve_linear(&file, measured, axis, times, trainer, progress)?;
            state.now.parameters = solution.parameters();
        } else if let Start::Linear { .. } = file.training.start {
            let solution = solve_linear(file, measured, axis, times, trainer, progress)?;
            let representation = trainer.representation;
            let imprinted = setup::warm_start(file, representation, &solution, times, state)?;
            progress.found(Event::WarmStarted(&imprinted))?;
        }
        Ok(())
    }
}

/// The grid that fits every so many frames best; where leakage is solved for, both in turn.
fn solve_linear(
    file: &FitFile,
    measured: &FitData,
    axis: Axis,
    times: [f64; 2],
    trainer: &mut Trainer<'_, f32>,
    progress: &mut dyn Progress,
) -> Result<LinearSolution<f32>, Error> {
    let objective = &mut trainer.objective;
    let mut solution = None;
    // Two closures tell, and `progress` can be borrowed by one: the lock lends it to either.
    let told = Mutex::new(&mut *progress);
    let tell = |event: Event<'_>| told.lock().unwrap_or_else(PoisonError::into_inner).found(event);
    let images = || -> Result<Vec<f32>, Error> {
        let mut watch = |now: &LinearProgress| {
            let mut progress = told.lock().unwrap_or_else(PoisonError::into_inner);
            match progress.goes_on(At::Linear(*now)) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        };
        let found = setup::solve_linear(file, objective, axis, times, None, &mut watch)
            .map_err(|error| error.while_in("linear"))?;
        if found.ending == Ending::Cancelled {
            return Err(Stopped::Lost("the linear grid was being solved").into());
        }
        // The images are for the leakage: without it none are computed.
        let images = match measured.leakage {
            Some(_) => images_of(&found, file, axis, times, &objective.model)?,
            None => Vec::new(),
        };
        solution = Some(found);
        Ok(images)
    };
    // `rounds` returns nothing: its error waits until the rounds are over.
    let mut refused = Ok(());
    let rounds = |round: usize, found: &SolvedLeakage| {
        refused = tell(Event::Round(round, found));
    };
    let leakage = measured.in_turn(images, rounds)?;
    refused?;
    if let Some(found) = &leakage {
        progress.found(Event::Leakage(None, found))?;
    }
    let solution = solution.ok_or(Stopped::Lost("the linear grid was being solved"))?;
    progress.found(Event::Linear(&solution))?;
    Ok(solution)
}

/// The images of all frames that a solution of the linear problem has.
fn images_of(
    solution: &LinearSolution<f32>,
    file: &FitFile,
    axis: Axis,
    times: [f64; 2],
    model: &ForwardModel<f32>,
) -> Result<Vec<f32>, Error> {
    let (mut file, nodes) = (file.clone(), file.voxel_nodes());
    (file.representation.kind, file.representation.linear_grid.nodes) = (Kind::LinearGrid, nodes);
    let representation = &*setup::representation(&file, &Registry::default(), times)?;
    let parameters = &solution.parameters();
    let field = Field { representation, parameters, axis, occupancy: None };
    let frames: Vec<usize> = (0..model.frames()).collect();
    Ok(model.images(field, &frames))
}
