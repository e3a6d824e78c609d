//! Curves of a run's log.

use crate::report::{Axis, LinePlot, Marks, Series};
use serde_json::Value;

fn series(lines: &[Value], name: &str, of: impl Fn(&Value) -> Option<f64>) -> Series {
    let point = |line: &Value| Some([line["step"].as_f64()?, of(line)?]);
    let points: Vec<[f64; 2]> = lines.iter().filter_map(point).collect();
    // A line through one point cannot be seen.
    let marks = if points.len() == 1 { Marks::Points } else { Marks::Line };
    Series::new(name, points, marks)
}

/// Loss and χ² of each kind of data against steps, if any were logged.
pub fn loss_plot(lines: &[Value]) -> Option<LinePlot> {
    let mut all = vec![series(lines, "loss", |line| line["loss"].as_f64())];
    if all[0].points.is_empty() {
        return None;
    }
    let names = lines.last().and_then(|line| line["chi2_per_datum"].as_object());
    for name in names.into_iter().flat_map(|names| names.keys()) {
        all.push(series(lines, name, |line| line["chi2_per_datum"][name].as_f64()));
    }
    Some(LinePlot {
        title: "Loss".to_owned(),
        caption: "χ² per data point of each kind of data and their weighted sum, the loss, against the optimiser step. Random batches make the curves noisy; a flat curve has converged.".to_owned(),
        x: Axis { label: "step".to_owned(), unit: String::new(), log: false },
        y: Axis { label: "loss".to_owned(), unit: String::new(), log: true },
        series: all,
    })
}

/// PSNR against steps, if there is a truth.
pub fn psnr_plot(lines: &[Value]) -> Option<LinePlot> {
    let psnr = series(lines, "PSNR", |line| line["psnr_db"].as_f64());
    (!psnr.points.is_empty()).then(|| LinePlot {
        title: "Quality".to_owned(),
        caption: "Peak signal-to-noise ratio of the volume against the truth, over all nodes. The fit does not use the truth.".to_owned(),
        x: Axis { label: "step".to_owned(), unit: String::new(), log: false },
        y: Axis { label: "PSNR".to_owned(), unit: "dB".to_owned(), log: false },
        series: vec![psnr],
    })
}
