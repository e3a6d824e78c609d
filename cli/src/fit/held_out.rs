//! A weight of the linear problem that is chosen by frames that are held out.

use super::folder::Folder;
use crate::report::{Axis, LinePlot, Marks, Series};
use anyhow::Context;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::{Held, best_held};
use kerrlight_tomo::recovery::Choice;
use kerrlight_tomo::recovery::results::HeldOutResults;

/// Name of the results in the folder of the run.
pub const FILE: &str = "held_out.json";

/// The weight that a run has chosen, which is told; none if it has not.
pub fn chosen(folder: &Folder) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found::<HeldOutResults>(FILE)? else { return Ok(None) };
    results.sentence().iter().for_each(|line| eprintln!("{line}"));
    Ok(Some(Choice::Weight(weight(&results, folder)?)))
}

fn weight(results: &HeldOutResults, folder: &Folder) -> anyhow::Result<f64> {
    results.chosen.with_context(|| folder.damaged(FILE))
}

/// The settings with the weight that a run has chosen.
pub fn settled(file: &FitFile, folder: &Folder) -> anyhow::Result<FitFile> {
    let results = folder.found::<HeldOutResults>(FILE)?;
    let (Some(settings), Some(results)) = (&file.held_out, results) else {
        return Ok(file.clone());
    };
    Ok(settings.setting.put(file.clone(), weight(&results, folder)?))
}

/// The loss of held-out frames against the weight.
pub fn plot(results: &HeldOutResults) -> LinePlot {
    let caption = format!(
        "χ² per data point of frames that were not fitted, against the weight: each of {} parts of the frames was \
         held out once. Too small a weight fits noise, too large a one cannot fit the data; both predict frames badly \
         that they have not seen. Bars are standard errors of the difference from the best weight.",
        results.folds
    );
    let points = results.values.iter().map(|of| [of.value, of.loss]).collect();
    let errors = results.values.iter().filter_map(|of| of.error).collect();
    let labels = ["Held-out frames", results.setting.name(), "χ² of held-out data"];
    line_plot(labels, &caption, points, errors)
}

/// The loss of held-out frames against a factor on penalties; labels are the title and those of both axes.
pub fn losses(held: &[Held], labels: [&str; 3], caption: &str) -> Option<LinePlot> {
    let best = best_held(held)?;
    let points = held.iter().map(|held| [held.value, held.mean()]).collect();
    let errors = held.iter().map(|held| held.error_beside(best)).collect();
    Some(line_plot(labels, caption, points, errors))
}

fn line_plot(
    [title, x, y]: [&str; 3],
    caption: &str,
    points: Vec<[f64; 2]>,
    errors: Vec<f64>,
) -> LinePlot {
    // A weight of 0 is allowed and has no place on a logarithmic axis.
    let log = points.iter().all(|[x, _]| *x > 0.0);
    LinePlot {
        title: title.to_owned(),
        caption: caption.to_owned(),
        x: Axis { log, ..Axis::new(x, "") },
        y: Axis::new(y, ""),
        series: vec![Series::new("held out", points, Marks::Joined).with_errors(errors)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::fit::settings::{HeldOutSettings, Weight};

    #[test]
    fn exact_every_value_has_its_bar() {
        let values = vec![0.1, 1.0, 10.0];
        let held = |value: &f64| Held { value: *value, losses: vec![1.0, 1.0 + value] };
        let held: Vec<Held> = values.iter().map(held).collect();
        let settings = HeldOutSettings { setting: Weight::Smoothness, values, folds: 2 };
        let plot = plot(&HeldOutResults::new(&settings, &held));
        assert_eq!(plot.series[0].errors.len(), 3);
        assert!(plot.x.log);
    }
}
