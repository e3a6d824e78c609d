//! Messages of a run on its steps.

use super::kept::Kept;
use crate::progress;
use indicatif::ProgressBar;
use kerrlight_tomo::fit::settings::AxisSearch;
use kerrlight_tomo::fit::{Loss, Outcome, State};
use kerrlight_tomo::recovery::{Fit, compare};
use serde_json::{Value, json};
use std::collections::BTreeMap;

impl Kept<'_> {
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
