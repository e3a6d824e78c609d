//! The run: steps, log, checkpoints, results.

use super::config::{AxisSearch, FitFile, LossKind};
use super::data::{self, Measured};
use super::folder::Folder;
use super::results::{self, Estimate};
use super::setup::{self, Instrument};
use crate::{interrupt, output, progress};
use anyhow::{Context, bail};
use kerrlight_tomo::fit::{Objective, Outcome, State, Trainer, checkpoint};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// What can be seen to be wrong before any work is done.
pub fn check(file: &FitFile) -> anyhow::Result<()> {
    let (_, axis_rate) = setup::axis(file)?;
    setup::representation(file)?;
    let training = setup::training(file, axis_rate)?;
    let images_only = file.loss.iter().all(|loss| loss.data == LossKind::Image);
    if matches!(training.batch, kerrlight_tomo::fit::BatchSize::Pixels(_)) && !images_only {
        bail!("training.batch: pixels are for images alone; take frames = N");
    }
    if !(2..=512).contains(&file.output.nodes) {
        bail!("output.nodes = {} is not allowed: 2 to 512", file.output.nodes);
    }
    Ok(())
}

/// Runs a fit from its start or its last checkpoint to its end.
pub fn run(
    file: &FitFile,
    text: &str,
    folder: &Folder,
    near: &Path,
    resume: bool,
) -> anyhow::Result<()> {
    check(file)?;
    let begun = Instant::now();
    let instrument = Instrument::new(file)?;
    let measured = data::measure(file, &instrument, near)?;
    let motion = setup::motion(file, measured.times.clone())?;
    let pixels = file.screen.pixels * file.screen.pixels;
    let data = measured.terms(&file.loss, pixels)?;
    let objective = Objective { chain: data::chain(&instrument, &motion)?, data };
    let representation = setup::representation(file)?;
    let (axis, axis_rate) = setup::axis(file)?;
    let training = setup::training(file, axis_rate)?;
    let mut state = State::new(&*representation, axis, &training);
    if resume && let Some(bytes) = folder.checkpoint()? {
        let name = || format!("{}: checkpoint", folder.path().display());
        state = checkpoint::decode(&bytes, &state).with_context(name)?;
        folder.cut_log(state.now.step)?;
    } else {
        folder.cut_log(0)?;
    }
    let trainer = Trainer::new(objective, &*representation, training);
    let mut run = Run { file, text, folder, measured: &measured, trainer, begun };
    eprintln!("{}", run.describe(&instrument));
    if run.steps(&mut state)? {
        return Ok(());
    }
    let estimate =
        Estimate { file, folder, instrument: &instrument, motion: &motion, measured: &measured };
    estimate.write(&mut run.trainer, &state, begun)?;
    output::print(&format!("{}\n", folder.path().join("report.html").display()))
}

struct Run<'a> {
    file: &'a FitFile,
    text: &'a str,
    folder: &'a Folder,
    measured: &'a Measured,
    trainer: Trainer<'a, f32>,
    begun: Instant,
}

impl Run<'_> {
    fn describe(&self, instrument: &Instrument) -> String {
        let chain = &self.trainer.objective.chain;
        let names = self.trainer.objective.names().join(", ");
        format!(
            "{}: {names}; {} frames of {} rays, {} nodes; {:?} with {} parameters",
            self.file.title,
            chain.frames(),
            chain.rays(),
            instrument.lines.points(),
            self.file.representation.kind,
            self.trainer.representation.parameters(),
        )
    }

    /// Whether it was interrupted.
    fn steps(&mut self, state: &mut State<f32>) -> anyhow::Result<bool> {
        let steps = self.file.training.steps;
        let (flag, bar) = (interrupt::flag(), progress::steps(steps));
        bar.set_position(state.now.step);
        let mut saved = Instant::now();
        while state.now.step < steps {
            let outcome = self.trainer.step(state)?;
            let step = state.now.step;
            bar.set_position(step);
            bar.set_message(format!("loss {:.4e}", state.now.loss));
            match outcome {
                Outcome::Done(loss)
                    if step.is_multiple_of(self.file.training.log_every) || step == steps =>
                {
                    let line = self.line(state, &loss.terms, loss.points);
                    self.folder.log(&line)?;
                }
                Outcome::Done(_) => {}
                Outcome::SteppedBack { loss, to, caution } => {
                    bar.println(format!(
                        "the loss became {loss:e}: back to step {to}, rates times {caution}"
                    ));
                    let line = json!({"step": step, "diverged_loss": loss.to_string(), "caution": caution});
                    self.folder.log(&line)?;
                }
            }
            let stop = flag.load(Ordering::Relaxed);
            let late = saved.elapsed().as_secs_f64() > self.file.training.checkpoint_seconds;
            if stop || late || step == steps {
                self.folder.save(&checkpoint::encode(state, self.text)?)?;
                saved = Instant::now();
            }
            if stop && step < steps {
                bar.abandon();
                let path = self.folder.path().display();
                eprintln!("stopped after step {step}; go on with: kerrlight fit --resume {path}");
                return Ok(true);
            }
        }
        bar.finish_and_clear();
        Ok(false)
    }

    fn line(&mut self, state: &State<f32>, terms: &[f64], points: usize) -> Value {
        let names = self.trainer.objective.names().into_iter().map(str::to_owned);
        let chi2: serde_json::Map<String, Value> =
            names.zip(terms).map(|(name, value)| (name, json!(value))).collect();
        let now = &state.now;
        let mut line = json!({
            "step": now.step,
            "seconds": self.begun.elapsed().as_secs_f64(),
            "loss": now.loss,
            "chi2_per_datum": chi2,
            "evaluations": points,
        });
        if !matches!(self.file.axis, AxisSearch::Known {}) {
            line["axis"] = json!(now.axis.vector());
        }
        if let Some(mask) = &now.occupancy {
            line["occupied"] = json!(mask.fraction());
        }
        if let Some(truth) = &self.measured.truth {
            line["axis_dot_truth"] = json!(now.axis.dot(truth.axis()));
            if let Some(found) = results::compare(self.file, &mut self.trainer, state, truth) {
                line["psnr_db"] = json!(found.psnr_db);
                line["nrmse"] = json!(found.nrmse);
                line["correlation"] = json!(found.correlation);
            }
        }
        line
    }
}
