//! Progress of a fit on the terminal, kept in its folder.

use super::folder::{self, Folder};
use crate::devices::FitDevice;
use crate::fit::journal::Journal;
use crate::fit::results::leakage;
use crate::fit::{closures, device_runner, held_out, searches};
use crate::interrupt::SignalGuard;
use crate::plain;
use crate::progress;
use crate::session;
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::{self, RaySampling};
use kerrlight_tomo::fit::{DeviceRunner, Outcome, State, Trainer, checkpoint, journal};
use kerrlight_tomo::recovery::results::{BandResults, GeometryResults, HeldOutResults};
use kerrlight_tomo::recovery::{At, Choice, Event, Fit, Found, Problem, Progress, Resumed, Stage};
use std::time::Instant;

/// A fit in its folder.
pub struct Kept<'a> {
    pub(super) problem: &'a Problem,
    pub(super) folder: &'a Folder,
    device: Option<FitDevice>,
    pub(super) begun: Instant,
    /// The work that goes on: how it is stopped, and its bar.
    work: Option<(SignalGuard, Option<(&'static str, ProgressBar)>)>,
}

/// An error of the folder, as one of the fit.
fn kept(error: anyhow::Error) -> Error {
    Error::Kept(error.into())
}

/// Says what there is more of than one.
fn asked_for(RaySampling { per_side, ring, panels, .. }: RaySampling) -> String {
    let rays = (per_side > 1).then(|| format!("{} rays per pixel", per_side * per_side));
    let ring = ring.map(|count| format!("{count} rays of pixels near the critical curve"));
    let panels = (panels > 1).then(|| format!("{panels} times the panels of region.nodes"));
    rays.into_iter().chain(ring).chain(panels).collect::<Vec<_>>().join(" and ")
}

/// Names what goes on.
fn name(at: At) -> &'static str {
    match at {
        At::Geometry { .. } => "geometry",
        At::Band(_) => "band",
        At::HeldOut(..) => "held out",
        At::Axis(..) => "axis",
        At::Linear(_) => "linear",
        _ => "steps",
    }
}

impl<'a> Kept<'a> {
    /// Takes a run in its folder.
    pub fn new(problem: &'a Problem, folder: &'a Folder, device: Option<FitDevice>) -> Self {
        Self { problem, folder, device, begun: Instant::now(), work: None }
    }

    /// Ends the work that went on.
    fn end(&mut self) {
        if let Some((_, Some((_, bar)))) = self.work.take() {
            bar.finish_and_clear();
        }
    }

    /// Returns the guard that stops work of this kind.
    fn keeper(&self, at: At) -> SignalGuard {
        match at {
            At::Step(_) => {
                SignalGuard::saving("stopping after this step; a second signal quits at once")
            }
            At::Axis(..) => {
                SignalGuard::brief("stopped while axes were being scanned: nothing is kept of that")
            }
            At::Linear(_) => SignalGuard::brief(
                "stopped while the linear grid was being solved: nothing is kept of that",
            ),
            _ => SignalGuard::brief(self.folder.stopped()),
        }
    }

    fn bar(&self, at: At) -> ProgressBar {
        let settings = &self.problem.settings;
        match at {
            At::Geometry { .. } => {
                let [searches, each, fine] = searches::planned(settings);
                progress::counting((searches * each + fine) as u64, "trial")
            }
            At::Band(_) => {
                let count = settings.band.as_ref().map_or(0, |band| {
                    band.inclinations_deg.values().len() * band.rotation_factors.len()
                });
                progress::counting(count as u64, "trial")
            }
            At::HeldOut(..) => {
                let held = settings.held_out.as_ref();
                let count = held.map_or(0, |held| held.values.len() * held.folds);
                progress::counting(count as u64, "solution")
            }
            At::Axis(_, of) => progress::counting(of as u64, "axis"),
            At::Linear(_) => progress::waiting("linear grid"),
            _ => progress::counting(settings.training.steps, "step"),
        }
    }

    fn shows(&self, at: At, bar: &ProgressBar) {
        let settings = &self.problem.settings;
        match at {
            At::Geometry { search, of, trials, least } => {
                let [_, each, _] = searches::planned(settings);
                bar.set_position((search * each + trials) as u64);
                bar.set_message(format!("search {} of {of}, least chi2/2 {least:.5e}", search + 1));
            }
            At::Band(done) => bar.set_position(done as u64),
            At::Axis(done, of) => {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
            }
            At::HeldOut(value, fold) => {
                if let Some(held) = &settings.held_out {
                    bar.set_position((fold * held.values.len() + value) as u64);
                    bar.set_message(format!("{} = {}", held.setting.name(), held.values[value]));
                }
            }
            At::Linear(now) => {
                bar.set_message(format!(
                    "round {}, {} evaluations, {} nodes, loss {:.4e}",
                    now.round, now.evaluations, now.nodes, now.value
                ));
                bar.tick();
            }
            At::Step(step) => bar.set_position(step),
            _ => {}
        }
    }

    fn describe(fit: &Fit<'_, '_>) -> String {
        let objective = &fit.trainer.objective;
        let (model, names) = (&objective.model, objective.names().join(", "));
        let dark = match objective.observed().len() {
            seen if seen < model.frames() => format!(" ({seen} of them fitted)"),
            _ => String::new(),
        };
        format!(
            "{}: {names}; {} frames{dark} of {} rays, {} nodes; {} with {} parameters",
            plain::line(&fit.file.title),
            model.frames(),
            model.rays(),
            fit.instrument.lines.points(),
            fit.file.representation.kind.label(),
            fit.trainer.representation.parameters(),
        )
    }

    /// The state of a checkpoint of the same settings, what was written beside it, and the log up to it.
    fn restored(&self, start: &State<f32>) -> anyhow::Result<Option<Resumed>> {
        let Some(bytes) = self.folder.checkpoint()? else { return Ok(None) };
        let state = self.state(&bytes, start).with_context(|| {
            let path = self.folder.path().join(folder::CHECKPOINT);
            format!("{} (restore it, or remove it to start over)", path.display())
        })?;
        let leakage = leakage::kept(&self.problem.measured, self.folder)?;
        // Later steps will be taken and logged again.
        self.folder.cut_log(state.now.step)?;
        Ok(Some((state, leakage)))
    }

    fn state(&self, bytes: &[u8], start: &State<f32>) -> anyhow::Result<State<f32>> {
        let state = checkpoint::decode(bytes, start)?;
        if checkpoint::header(bytes)?.settings != self.folder.settings {
            bail!("it belongs to a run with other settings");
        }
        Ok(state)
    }

    fn written(&self, found: &Found<'_>) -> anyhow::Result<Option<Choice>> {
        let folder = self.folder;
        let stage = match found {
            Found::Geometry(problem, unknown, found) => {
                let found = GeometryResults::new(problem, unknown, found)?;
                folder.keep(searches::GEOMETRY, &found)?;
                Stage::Geometry
            }
            Found::Band(problem, scan) => {
                folder.keep(searches::BAND, &BandResults::new(problem, scan)?)?;
                Stage::Band
            }
            Found::Weight(FitFile { held_out: Some(settings), .. }, held) => {
                folder.keep(held_out::FILE, &HeldOutResults::new(settings, held))?;
                Stage::Weight
            }
            _ => return Ok(None),
        };
        self.read(stage)
    }

    /// Reads the file of a search, which is told; none if it has not looked.
    fn read(&self, stage: Stage) -> anyhow::Result<Option<Choice>> {
        match stage {
            Stage::Geometry => searches::geometry(self.folder, &self.problem.settings),
            Stage::Band => searches::band(self.folder),
            Stage::Weight => held_out::chosen(self.folder),
            _ => Ok(None),
        }
    }
}

impl Progress for Kept<'_> {
    fn goes_on(&mut self, at: At) -> bool {
        let (keeper, bar) = match self.work.take() {
            Some((keeper, Some((kind, bar)))) if kind == name(at) => (keeper, bar),
            // Work that was announced has its guard already; its bar begins now.
            Some((keeper, None)) => (keeper, self.bar(at)),
            other => {
                // A guard that is dropped takes the present keeper with it: the old one has to go
                // before the new one comes.
                drop(other);
                (self.keeper(at), self.bar(at))
            }
        };
        self.shows(at, &bar);
        session::reached(&bar);
        let goes_on = !keeper.stopped();
        self.work = Some((keeper, Some((name(at), bar))));
        goes_on
    }

    fn journal(&mut self) -> Result<Box<dyn journal::Journal>, Error> {
        self.end();
        // A search keeps results as they come: it may be cut off at any moment.
        self.work = Some((SignalGuard::brief(self.folder.stopped()), None));
        Ok(Box::new(Journal::open(self.folder).map_err(kept)?))
    }

    fn chosen(&mut self, stage: Stage) -> Result<Option<Choice>, Error> {
        self.read(stage).map_err(kept)
    }

    fn keep(&mut self, found: &Found<'_>) -> Result<Choice, Error> {
        self.end();
        // What is read is what a resumed run will read, to the bit.
        let choice = self.written(found).map_err(kept)?;
        // Only now: until the result is in its file, the journal is all there is of the search.
        Journal::remove(self.folder);
        Ok(choice.unwrap_or_else(|| found.choice()))
    }

    fn found(&mut self, event: Event<'_>) -> Result<(), Error> {
        // Leakage between steps ends no work.
        if !matches!(event, Event::Leakage(Some(_), _)) {
            self.end();
        }
        self.record(event).map_err(kept)
    }

    fn device(
        &mut self,
        file: &FitFile,
        trainer: &Trainer<'_, f32>,
    ) -> Result<Option<DeviceRunner>, Error> {
        let device = self.device.take();
        let delegate = |device| device_runner::delegate(device, file, trainer, self.folder);
        device.map(delegate).transpose().map_err(kept)
    }

    fn begins(&mut self, fit: &Fit<'_, '_>) {
        self.end();
        eprintln!("{}", Self::describe(fit));
        for used in closures::sentences(fit.measured, &fit.file.loss) {
            eprintln!("{used}");
        }
        if let Some(rays) = self.problem.rays {
            eprintln!("note: the data ask for {}", asked_for(rays));
        }
        let caution = setup::caution(fit.file).map(str::to_owned);
        for note in caution.into_iter().chain(fit.file.unknowns()) {
            eprintln!("note: {note}");
        }
    }

    fn resumed(&mut self, start: &State<f32>) -> Result<Option<Resumed>, Error> {
        if !self.folder.is_resumed {
            return Ok(None);
        }
        let restored = self.restored(start).map_err(kept)?;
        if restored.is_some() {
            self.work = Some((self.keeper(At::Step(0)), None));
        }
        Ok(restored)
    }

    fn starts(&mut self) -> Result<(), Error> {
        // Without a checkpoint everything that was logged is done again.
        let log = self.folder.file(folder::LOG);
        log.and_then(|log| log.write(b"")).map_err(kept)
    }

    fn save(&mut self, state: &State<f32>) -> Result<(), Error> {
        let bytes = checkpoint::encode(state, &self.folder.settings)?;
        let file = self.folder.file(folder::CHECKPOINT);
        file.and_then(|file| file.write(&bytes)).map_err(kept)?;
        // From the first checkpoint on there is a state to save: a signal waits for the step.
        if state.now.step == 0 {
            self.end();
            self.work = Some((self.keeper(At::Step(0)), None));
        }
        Ok(())
    }

    fn stepped(
        &mut self,
        fit: &mut Fit<'_, '_>,
        state: &State<f32>,
        outcome: Outcome,
    ) -> Result<(), Error> {
        let Some((_, Some((_, bar)))) = &self.work else { return Ok(()) };
        let bar = bar.clone();
        bar.set_message(format!("loss {:.4e}", state.now.loss));
        self.step(fit, state, outcome, &bar).map_err(kept)
    }
}

impl Drop for Kept<'_> {
    fn drop(&mut self) {
        self.end();
    }
}
