//! The scan of the whole sphere of axes with coarse linear grids, through few pixels.

use super::failed;
use crate::interrupt::{Interrupted, Keeper};
use crate::progress;
use kerrlight_render::dynamics::Axis;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::Motion;
use kerrlight_tomo::fit::scan::{
    AxisLoss, AxisProblem, AxisScan, AxisSettings, Effort, refine_axis, scan_axis,
};
use kerrlight_tomo::fit::settings::{AxisScan as AxisScanSettings, FitFile};
use kerrlight_tomo::fit::setup::{CoarseView, Measured};
use serde_json::{Value, json};
use std::io::Cursor;

/// What was found.
pub struct Found {
    /// On the whole sphere.
    pub scan: AxisScan,
    /// Near the best one, with a finer grid.
    pub refined: Option<AxisLoss>,
}

impl Found {
    /// The best axis.
    pub fn axis(&self) -> Axis {
        self.refined.unwrap_or(self.scan.best).axis
    }
}

/// The loss over the whole sphere of axes, and the best one.
pub fn run(
    file: &FitFile,
    measured: &Measured,
    motion: &Motion,
    settings: &AxisScanSettings,
) -> anyhow::Result<Found> {
    let AxisScanSettings { directions, frames, pixels, refine, .. } = *settings;
    let view = CoarseView::new(file, measured, pixels)?;
    let settings = AxisSettings { directions, ..AxisSettings::default() };
    let (keeper, bar) = (Keeper::brief(STOPPED), progress::axes(directions as u64));
    let watch = |solved: usize, expected: usize| {
        bar.set_length(expected as u64);
        bar.set_position(solved as u64);
        !keeper.stopped()
    };
    let whole = |problem: &AxisProblem<'_, f32>| scan_axis(problem, &settings, &watch);
    let scan = view.search(motion, frames, whole).map_err(scan_failed)?.ok_or_else(stopped)?;
    let refined = refine.map(|nodes| -> anyhow::Result<AxisLoss> {
        let view = CoarseView::new(file, measured, file.screen.pixels)?;
        let effort = (fine(nodes), HALVINGS);
        let near = |problem: &AxisProblem<'_, f32>| {
            refine_axis(problem, scan.best.axis, STEP, effort, &watch)
        };
        view.search(motion, frames, near).map_err(scan_failed)?.ok_or_else(stopped)
    });
    bar.finish_and_clear();
    Ok(Found { refined: refined.transpose()?, scan })
}

const STOPPED: &str = "stopped while axes were being scanned: nothing is kept of that";

fn scan_failed(error: Error) -> anyhow::Error {
    failed::linear(error).context("axis.scan")
}

fn stopped() -> anyhow::Error {
    Interrupted(STOPPED.to_owned()).into()
}

/// First step of the refinement: half of what lattice points of 200 are apart by, and its halvings.
const STEP: f64 = 0.06;
const HALVINGS: usize = 3;

/// Iterations of the refinement's grids: with few, a wrong axis is as good as the right one.
fn fine(nodes: usize) -> Effort {
    Effort { nodes, iterations: 40 }
}

/// The map of losses as a table.
pub fn table(scan: &AxisScan) -> String {
    let line = |at: &AxisLoss| {
        let [x, y, z] = at.axis.vector();
        format!("{x},{y},{z},{}\n", at.loss)
    };
    let rows: String = scan.map.iter().map(line).collect();
    format!("x,y,z,loss\n{rows}")
}

/// The map as a PNG.
pub fn picture(scan: &AxisScan) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    scan.picture(720, Colormap::Viridis)?.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// A line of the log.
pub fn line(found: &Found) -> Value {
    let Found { scan, refined } = found;
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
