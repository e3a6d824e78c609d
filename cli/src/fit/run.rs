//! The run: steps, log, checkpoints, results.

mod record;

use super::axis_scan;
use super::band_search;
use super::closures;
use super::data;
use super::delegate;
use super::failed;
use super::folder::{self, Folder};
use super::held_out;
use super::labels;
use super::leakage;
use super::linear;
use super::results::{self, Estimate};
use super::rotation_search;
use super::world_search;
pub use super::world_search::Placed;
use crate::answer::Answer;
use crate::devices::{CheckSteps, FitDevice};
use crate::interrupt::{Interrupted, Keeper};
use crate::plain;
use crate::progress;
use anyhow::{Context, bail};
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::settings::{AxisSearch, FitFile, Kind, Start};
use kerrlight_tomo::fit::setup::{self, Given, HeldData, Instrument, Measured};
use kerrlight_tomo::fit::{Motion, Objective, Outcome, State, Trainer, checkpoint};
use kerrlight_tomo::representation::Registry;
use kerrlight_tomo::volume::Volume;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The page that shows what was found.
const REPORT: &str = "report.html";

/// A fit with its data: all that can be found wrong is, before anything is written.
pub struct Prepared<'a> {
    /// Settings.
    pub file: FitFile,
    /// Representations of others.
    pub registry: &'a Registry,
    /// Rays.
    pub instrument: Instrument,
    /// Data.
    pub measured: Measured,
    /// Motion.
    pub motion: Motion,
}

impl<'a> Prepared<'a> {
    /// Checks settings, traces rays, simulates or reads data; relative paths start from `base_dir`.
    pub fn new(file: FitFile, base_dir: &Path, registry: &'a Registry) -> anyhow::Result<Self> {
        setup::afford_all(&file, registry)?;
        setup::check(&file, registry)?;
        let instrument = Instrument::new(&file)?;
        let measured = data::measure(&file, &instrument, base_dir)?;
        if let Some(settings) = &file.band {
            setup::check_band(&file, &measured, settings)?;
        }
        let motion = setup::motion(&file, measured.times.clone())?;
        // Times at which emission may change are those of the rays.
        setup::representation(&file, registry, setup::emission_times(&instrument, &motion))?;
        if let Some(unknown) = file.unknown_world()? {
            // What contradicts it is told before anything is written.
            let world = setup::known_world(&file);
            setup::in_world(&file, &unknown, &instrument, &measured, &world, 0)?;
        }
        let prepared = Self { file, registry, instrument, measured, motion };
        let Self { instrument, motion, measured, .. } = &prepared;
        let seen = prepared.objective(instrument, motion, measured)?.observed().len();
        if let Some(held_out) = &prepared.file.held_out {
            setup::check_folds(held_out, seen, measured)?;
        }
        if matches!(prepared.file.axis, AxisSearch::Scan(_)) && seen < 2 {
            bail!(
                "axis.scan needs at least 2 frame times: a single frame does not constrain the axis"
            );
        }
        Ok(prepared)
    }

    /// The world that is not known, once it is found.
    fn placed(&self, folder: &Folder) -> anyhow::Result<Option<Placed>> {
        let Self { file, instrument, measured, .. } = self;
        match world_search::place(file, instrument, measured, folder)? {
            None => match band_search::place(file, measured, folder)? {
                None => rotation_search::place(file, (instrument, measured), folder),
                placed => Ok(placed),
            },
            placed => Ok(placed),
        }
    }

    /// Settings, rays, motion and data of the fit.
    fn world<'b>(
        &'b self,
        placed: Option<&'b Placed>,
    ) -> (&'b FitFile, &'b Instrument, &'b Motion, &'b Measured) {
        match placed {
            Some(Placed { file, instrument, motion, measured }) => {
                (file, instrument, motion, measured.as_ref().unwrap_or(&self.measured))
            }
            None => (&self.file, &self.instrument, &self.motion, &self.measured),
        }
    }

    /// Refuses a device that does not do this fit.
    pub fn check_device(&self, check: CheckSteps) -> anyhow::Result<()> {
        let Self { file, registry, instrument, measured, motion } = self;
        if file.representation.kind == Kind::LinearGrid {
            bail!("representation.kind: a linear-grid is solved on the processor");
        }
        if measured.leakage.is_some() {
            bail!("instrument.leakage: the processor solves for it between steps");
        }
        let times = setup::emission_times(instrument, motion);
        let representation = setup::representation(file, registry, times)?;
        let training = setup::training(file, setup::axis(file)?.1, times)?;
        Ok(check(&self.objective(instrument, motion, measured)?, &*representation, &training)?)
    }

    fn objective(
        &self,
        instrument: &Instrument,
        motion: &Motion,
        measured: &Measured,
    ) -> anyhow::Result<Objective<f32>> {
        let pixels = self.file.screen.pixels * self.file.screen.pixels;
        let data = measured.terms(&self.file.loss, pixels)?;
        Ok(Objective { model: setup::forward_model(instrument, motion)?, data })
    }
}

/// Runs a fit from its start or its last checkpoint to its end.
pub fn run(
    prepared: &Prepared<'_>,
    text: &str,
    (folder, resume): (&Folder, bool),
    device: Option<FitDevice>,
) -> anyhow::Result<Answer> {
    let registry = prepared.registry;
    let begun = Instant::now();
    let placed = prepared.placed(folder)?;
    let (file, instrument, motion, measured) = prepared.world(placed.as_ref());
    let mut objective = prepared.objective(instrument, motion, measured)?;
    let times = setup::emission_times(instrument, motion);
    let (axis, axis_rate) = setup::axis(file)?;
    let data = HeldData { objective: &mut objective, measured };
    let file = &held_out::before_steps(file, folder, data, (axis, times))?;
    let representation = setup::representation(file, registry, times)?;
    let training = setup::training(file, axis_rate, times)?;
    let mut state = State::new(&*representation, axis, &training);
    let mut trainer = Trainer::new(objective, &*representation, training);
    if let Some(device) = device {
        trainer.device = Some(delegate::delegate(device, file, &trainer, folder)?);
    }
    let truth = measured.truth.as_ref();
    let true_volume = truth.map(|truth| results::true_volume(file, truth)).transpose()?;
    let mut run = Run { file, text, folder, measured, true_volume, trainer, begun };
    run.tell(instrument);
    let checkpoint = if resume { folder.checkpoint()? } else { None };
    match checkpoint {
        Some(bytes) => run.resume(&mut state, &bytes)?,
        None => run.start_over(&mut state, motion, times)?,
    }
    if file.representation.kind != Kind::LinearGrid {
        run.steps(&mut state)?;
    }
    let device = run.trainer.device.take().map(|device| device.name().to_owned());
    let Run { mut trainer, true_volume, .. } = run;
    let estimate = Estimate { file, folder, instrument, motion, measured, true_volume, device };
    let results = estimate.write(&mut trainer, &state, begun)?;
    Ok(answer(folder, results))
}

/// The verdict and where to read it; the results for a script.
fn answer(folder: &Folder, (worth, results): (String, Value)) -> Answer {
    let path = folder.path();
    let files = [REPORT, "results.json", "volume.npz", "movie.npz"].map(|name| path.join(name));
    Answer::lines(&worth, &files[0].display().to_string())
        .with_all(results)
        .with("folder", path.display().to_string())
        .files(files.iter().map(PathBuf::as_path))
}

/// The state of a checkpoint of the same settings.
fn restored(bytes: &[u8], start: &State<f32>, text: &str) -> anyhow::Result<State<f32>> {
    let state = checkpoint::decode(bytes, start)?;
    if checkpoint::header(bytes)?.settings != text {
        bail!("it belongs to a run with other settings");
    }
    Ok(state)
}

/// What to do about a checkpoint that is of no use.
fn unusable(folder: &Folder) -> String {
    let path = folder.path().join(folder::CHECKPOINT);
    format!("{} (restore it, or remove it to start over)", path.display())
}

struct Run<'a> {
    file: &'a FitFile,
    text: &'a str,
    folder: &'a Folder,
    measured: &'a Measured,
    true_volume: Option<Volume>,
    trainer: Trainer<'a, f32>,
    begun: Instant,
}

impl Run<'_> {
    /// What is fitted, and what to know of it beforehand.
    fn tell(&self, instrument: &Instrument) {
        eprintln!("{}", self.describe(instrument));
        for used in closures::sentences(self.measured, &self.file.loss) {
            eprintln!("{used}");
        }
        let caution = setup::caution(self.file).map(str::to_owned);
        for note in caution.into_iter().chain(self.file.unknowns()) {
            eprintln!("note: {note}");
        }
    }

    /// Takes the state of a checkpoint and what was written beside it.
    fn resume(&self, state: &mut State<f32>, bytes: &[u8]) -> anyhow::Result<()> {
        *state = restored(bytes, state, self.text).with_context(|| unusable(self.folder))?;
        leakage::restore(self.measured, self.folder)?;
        self.folder.cut_log(state.now.step)
    }

    /// An empty log, the start that settings say, and the first checkpoint.
    fn start_over(
        &mut self,
        state: &mut State<f32>,
        motion: &Motion,
        times: [f64; 2],
    ) -> anyhow::Result<()> {
        self.folder.file(folder::LOG)?.write(b"")?;
        self.start(state, motion, times)?;
        self.folder.save(&checkpoint::encode(state, self.text)?)
    }

    fn describe(&self, instrument: &Instrument) -> String {
        let model = &self.trainer.objective.model;
        let names = self.trainer.objective.names().join(", ");
        let dark = match self.trainer.objective.observed().len() {
            seen if seen < model.frames() => format!(" ({seen} of them with data)"),
            _ => String::new(),
        };
        format!(
            "{}: {names}; {} frames{dark} of {} rays, {} nodes; {} with {} parameters",
            plain::line(&self.file.title),
            model.frames(),
            model.rays(),
            instrument.lines.points(),
            labels::representation(&self.file.representation.kind),
            self.trainer.representation.parameters(),
        )
    }

    /// The axis and the parameters that a scan and the linear problem give to begin with.
    fn start(
        &mut self,
        state: &mut State<f32>,
        motion: &Motion,
        times: [f64; 2],
    ) -> anyhow::Result<()> {
        if let AxisSearch::Scan(settings) = &self.file.axis {
            let found = axis_scan::run(self.file, self.measured, motion, settings)?;
            state.now.axis = found.axis();
            self.folder.file("axis_scan.csv")?.write(axis_scan::table(&found.scan).as_bytes())?;
            self.folder.file("axis_scan.png")?.write(&axis_scan::picture(&found.scan)?)?;
            self.folder.log(&axis_scan::line(&found))?;
        }
        let axis = state.now.axis;
        let trainer = &mut self.trainer;
        if self.file.representation.kind == Kind::LinearGrid {
            let nodes = self.file.representation.grid_nodes();
            let data = HeldData { objective: &mut trainer.objective, measured: self.measured };
            let file = held_out::place(self.file, self.folder, data, (axis, times))?;
            let change = setup::change(&file, times)?;
            let whose = (self.measured, self.folder);
            let solution =
                leakage::solve_linear(&file, whose, trainer, (axis, change), (nodes, 1))?;
            self.folder.log(&linear::solved(&solution))?;
            eprintln!("{}", linear::statement(&solution));
            state.now.parameters = solution.parameters();
        } else if let Start::Linear { nodes, stride, steps, .. } = self.file.training.start {
            let change = setup::change(self.file, times)?;
            let (whose, about) = ((self.measured, self.folder), (axis, change));
            let solution =
                leakage::solve_linear(self.file, whose, trainer, about, (nodes, stride))?;
            self.folder.log(&linear::solved(&solution))?;
            let given = Given { solution: &solution, nodes, knots: change.knots };
            let imprinted =
                setup::imprint(self.file, trainer.representation, &given, steps, state)?;
            self.folder.log(&linear::imprinted(&imprinted))?;
        }
        Ok(())
    }

    /// All steps; an error if a signal stops them, after a checkpoint.
    fn steps(&mut self, state: &mut State<f32>) -> anyhow::Result<()> {
        let steps = self.file.training.steps;
        let keeper = Keeper::saving("stopping after this step; a second signal quits at once");
        let bar = progress::steps(steps);
        bar.set_position(state.now.step);
        let mut saved = Instant::now();
        while state.now.step < steps {
            let whose = (self.measured, self.folder);
            leakage::when_due((self.file, self.text), whose, &mut self.trainer, state)?;
            let outcome = match self.trainer.step(state) {
                Ok(outcome) => outcome,
                Err(Error::Device(error)) => {
                    self.folder.save(&checkpoint::encode(state, self.text)?)?;
                    bar.abandon();
                    return Err(delegate::failed(error, state.now.step, self.folder));
                }
                Err(error) => return Err(failed::diverged(&mut self.trainer, state, &error)),
            };
            let step = state.now.step;
            bar.set_position(step);
            bar.set_message(format!("loss {:.4e}", state.now.loss));
            let converged = outcome == Outcome::Converged;
            self.record(state, outcome, &bar)?;
            let stop = keeper.stopped();
            let late = saved.elapsed().as_secs_f64() > self.file.training.checkpoint_seconds;
            if stop || late || converged || step == steps {
                self.folder.save(&checkpoint::encode(state, self.text)?)?;
                saved = Instant::now();
            }
            if stop {
                bar.abandon();
                let path = self.folder.path().display();
                let how = format!("resume with: kerrlight fit --resume {path}");
                return Err(Interrupted(format!("stopped after step {step}; {how}")).into());
            }
            if converged {
                break;
            }
        }
        bar.finish_and_clear();
        Ok(())
    }
}
