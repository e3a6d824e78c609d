//! What a run records: lines of its log, files beside it, and messages.

use super::kept::Kept;
use crate::fit::linear;
use crate::fit::results::{last_step, leakage};
use crate::{progress, report};
use indicatif::ProgressBar;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_tomo::fit::scan::{AxisLoss, AxisScan};
use kerrlight_tomo::fit::settings::{AxisSearch, Kind};
use kerrlight_tomo::fit::{Loss, Outcome, State};
use kerrlight_tomo::recovery::{Event, Fit, FoundAxis, compare};
use serde_json::{Value, json};
use std::collections::BTreeMap;

impl Kept<'_> {
    /// Keeps what was found on the way, and tells of it.
    pub(super) fn record(&self, event: Event<'_>) -> anyhow::Result<()> {
        let folder = self.folder;
        match event {
            Event::Axis(found) => {
                folder.file("axis_scan.csv")?.write(map(&found.scan).as_bytes())?;
                let picture = found.scan.picture(720, Colormap::Viridis)?;
                folder.file("axis_scan.png")?.write(&report::encode(Some(picture))?)?;
                folder.log(&scanned(found))
            }
            Event::Linear(solution) => {
                folder.log(&linear::solved(solution))?;
                if self.problem.settings.representation.kind == Kind::LinearGrid {
                    eprintln!("{}", linear::statement(solution));
                }
                Ok(())
            }
            Event::WarmStarted(found) => folder.log(&linear::imprinted(found)),
            Event::Round(round, found) => {
                let moved = found.moved;
                eprintln!("leakage, round {round}: the largest change is {moved:.2e}");
                Ok(())
            }
            Event::Leakage(step, found) => leakage::keep(folder, step, found),
            Event::FollowsNoise(step) => {
                let of = self.problem.settings.training.steps;
                eprintln!("{}", last_step(step, of));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Logs what a step has done, and tells of what is unusual.
    pub(super) fn step(
        &self,
        fit: &mut Fit<'_, '_>,
        state: &State<f32>,
        outcome: Outcome,
        bar: &ProgressBar,
    ) -> anyhow::Result<()> {
        let (step, training) = (state.now.step, &fit.file.training);
        let line = match outcome {
            Outcome::Done(loss)
                if step.is_multiple_of(training.log_every) || step == training.steps =>
            {
                self.line(fit, state, &loss)
            }
            Outcome::Done(_) => return Ok(()),
            Outcome::SteppedBack { loss, to, caution } => {
                let back = format!("back to step {to}, learning rates scaled by {caution}");
                progress::line(bar, &format!("the loss rose to {loss:e}: {back}"));
                json!({"step": step, "diverged_loss": loss.to_string(), "caution": caution})
            }
        };
        self.folder.log(&line)
    }

    fn line(&self, fit: &mut Fit<'_, '_>, state: &State<f32>, loss: &Loss) -> Value {
        let chi2 = fit.trainer.objective.names().into_iter().zip(&loss.terms);
        let chi2: BTreeMap<&str, &f64> = chi2.collect();
        let now = &state.now;
        let mut line = json!({
            "step": now.step,
            "seconds": self.begun.elapsed().as_secs_f64(),
            "loss": now.loss,
            "chi2_per_datum": chi2,
            "evaluations": loss.points,
        });
        if let Some(change) = loss.change {
            line["penalties"] = json!({"change": change});
        }
        if !matches!(fit.file.axis, AxisSearch::Known {}) {
            line["axis"] = json!(now.axis.vector());
        }
        if let Some(mask) = &now.occupancy {
            line["occupied"] = json!(mask.fraction());
        }
        if let Some(truth) = &fit.measured.truth {
            line["axis_dot_truth"] = json!(now.axis.dot(truth.axis()));
        }
        if let Some(truth) = &fit.true_volume
            && let Some(found) = compare(fit.file, &mut fit.trainer, state, truth)
        {
            line["psnr_db"] = json!(found.psnr_db);
            line["nrmse"] = json!(found.nrmse);
            line["correlation"] = json!(found.correlation);
        }
        line
    }
}

/// The losses of a scan of axes as a table.
fn map(scan: &AxisScan) -> String {
    let line = |at: &AxisLoss| {
        let [x, y, z] = at.axis.vector();
        format!("{x},{y},{z},{}\n", at.loss)
    };
    let rows: String = scan.map.iter().map(line).collect();
    format!("x,y,z,loss\n{rows}")
}

/// A line of the log on the same.
fn scanned(found: &FoundAxis) -> Value {
    let FoundAxis { scan, refined } = found;
    let refined = refined.map(|at| json!({"best": at.axis.vector(), "loss": at.loss}));
    json!({
        "step": 0,
        "axis_scan": {
            "best": scan.best.axis.vector(), "loss": scan.best.loss,
            "runner_up": scan.runner_up.axis.vector(), "runner_up_loss": scan.runner_up.loss,
            "refined": refined,
        },
    })
}
