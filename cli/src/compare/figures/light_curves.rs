//! Results of fits to light curves.

use super::{Figures, MOST};
use crate::compare::experiment::FigureAsked;
use crate::fit;
use crate::output;
use crate::report::LinePlot;
use anyhow::Context;
use kerrlight_tomo::recovery::results::BandResults;

impl Figures<'_> {
    /// The probability of each unknown, a curve for each case of the first seed.
    pub(super) fn geometries(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut runs: Vec<(String, BandResults)> = Vec::new();
        for (case, _) in self.chosen(asked).filter(|(case, _)| case.seed == 1) {
            let path = self.runner.run_of(case).join(fit::BAND);
            if path.exists() {
                let text = output::read_text(&path)?;
                let results =
                    serde_json::from_str(&text).with_context(|| path.display().to_string())?;
                runs.push((case.name(), results));
            }
        }
        Ok(fit::plots_of_bands(&runs, &asked.caption))
    }

    /// Loops in Q and U, a plot for each case of the first seed.
    pub(super) fn loops(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut plots = Vec::new();
        for (case, _) in self.chosen(asked).filter(|(case, _)| case.seed == 1).take(MOST + 1) {
            let path = self.runner.run_of(case).join(fit::LIGHT_CURVE);
            if path.exists() {
                let table = output::read_text(&path)?;
                plots.extend(fit::loop_plot(&table, &format!(": {}", case.name())));
            }
        }
        Ok(plots)
    }
}
