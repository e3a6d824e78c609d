//! Leakage between the feeds of stations, solved for in turn with the emission.

use super::folder::Folder;
use super::linear;
use crate::output;
use anyhow::Context;
use kerrlight_render::dynamics::Axis;
use kerrlight_tomo::fit::linear::{Change, LinearSolution, Voxels};
use kerrlight_tomo::fit::settings::{FitFile, Kind};
use kerrlight_tomo::fit::setup::{self, Measured, SolvedLeakage};
use kerrlight_tomo::fit::{Batch, Beside, Field, State, Trainer, checkpoint};
use kerrlight_tomo::representation::{Representation, Workspace};
use kerrlight_vlbi::files;
use serde_json::json;

/// The table of what was found last.
pub const TABLE: &str = "leakage.csv";

/// The linear grid; where leakage is solved for, both in turn.
pub fn solve_linear(
    file: &FitFile,
    (measured, folder): (&Measured, &Folder),
    trainer: &mut Trainer<'_, f32>,
    about: (Axis, Change),
    nodes: (usize, usize),
) -> anyhow::Result<LinearSolution<f32>> {
    let voxels = Voxels::cube(nodes.0, file.region.r_max, setup::linear(file)?.degree).field()?;
    let voxels: Box<dyn Representation<f32>> = match trainer.objective.model.quiescent() {
        Some(image) => Box::new(Beside::new(Box::new(voxels), image)),
        None => Box::new(voxels),
    };
    let grid = match file.representation.kind {
        Kind::LinearGrid => trainer.representation,
        _ => &*voxels,
    };
    let objective = &mut trainer.objective;
    let mut solution = None;
    let images = || -> anyhow::Result<Vec<f32>> {
        let found = linear::solve(file, objective, about, nodes)?;
        let parameters = &found.parameters();
        let field = Field { representation: grid, parameters, axis: about.0, occupancy: None };
        let frames: Vec<usize> = match measured.leakage {
            Some(_) => (0..measured.times.len()).collect(),
            None => Vec::new(),
        };
        let mut movie = vec![0.0; frames.len() * objective.model.pixels()];
        let (batch, workspace) = (&mut Batch::default(), &mut Workspace::new());
        objective.model.movie(field, &frames, batch, workspace, &mut movie);
        solution = Some(found);
        Ok(movie)
    };
    let told = |round: usize, found: &SolvedLeakage| {
        eprintln!("leakage, round {round}: the largest change is {:.2e}", found.moved);
    };
    if let Some(found) = measured.in_turn(images, told)? {
        save(folder, &found)?;
    }
    solution.context("no round of emission and leakage")
}

/// Solves for the leakage beside the present emission before steps at equal intervals, as often as settings say.
pub fn when_due(
    (file, text): (&FitFile, &str),
    (measured, folder): (&Measured, &Folder),
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
) -> anyhow::Result<()> {
    let step = state.now.step;
    if !interval(file).is_some_and(|interval| step > 0 && step.is_multiple_of(interval)) {
        return Ok(());
    }
    // What comes before cannot be resumed with the leakage that is found now.
    folder.save(&checkpoint::encode(state, text)?)?;
    let frames: Vec<usize> = (0..measured.times.len()).collect();
    let movie = trainer.movie(&state.now, &frames, true);
    let Some(found) = measured.solve_leakage(&movie)? else { return Ok(()) };
    save(folder, &found)?;
    folder.log(&json!({ "step": step, "leakage": { "largest_change": found.moved } }))
}

fn save(folder: &Folder, found: &SolvedLeakage) -> anyhow::Result<()> {
    folder.file(TABLE)?.write(files::leakage_to_csv(&found.table).as_bytes())
}

/// Takes up what a run has found last, if it has solved for leakage.
pub fn restore(measured: &Measured, folder: &Folder) -> anyhow::Result<()> {
    let path = folder.path().join(TABLE);
    if measured.leakage.is_some() && path.exists() {
        let table = files::parse_leakage(&output::read_text(&path)?);
        measured.restore_leakage(&table.with_context(|| path.display().to_string())?);
    }
    Ok(())
}

/// Steps of training from one solution for the leakage to the next; none where it is not solved for.
fn interval(file: &FitFile) -> Option<u64> {
    let settings = file.instrument.as_ref()?.leakage?;
    Some(file.training.steps.div_ceil(settings.rounds as u64 + 1).max(1))
}
