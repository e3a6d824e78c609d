//! The scan of the whole sphere of axes with coarse linear grids, through few pixels.

use super::failed;
use super::linear::terms;
use crate::interrupt::{Interrupted, Keeper};
use crate::progress;
use anyhow::Context;
use kerrlight_tomo::Error;
use kerrlight_tomo::dynamics::Axis;
use kerrlight_tomo::fit::scan::{
    AxisLoss, AxisProblem, AxisScan, AxisSettings, Effort, refine_axis, scan_axis,
};
use kerrlight_tomo::fit::settings::{
    AxisScan as AxisScanSettings, FitFile, LossKind, Region, Screen, WidthOf,
};
use kerrlight_tomo::fit::setup::{self, Instrument, Measured};
use kerrlight_tomo::fit::{Motion, Objective, Sampling};
use kerrlight_tomo::image::colormap::Colormap;
use serde_json::{Value, json};
use std::io::Cursor;

/// What a fit is seen through by a scan.
struct View {
    file: FitFile,
    instrument: Instrument,
    measured: Measured,
}

impl View {
    /// The same view with fewer pixels, and as many fewer nodes on rays. Images are known at every n-th
    /// pixel; visibilities are explained by pixels n times as wide. A loss that has both is seen through
    /// all pixels, as is one of few.
    fn new(file: &FitFile, measured: &Measured, pixels: usize) -> anyhow::Result<Self> {
        let images = file.loss.iter().filter(|loss| loss.data == LossKind::Image).count();
        let screen = &file.screen;
        let every = screen.pixels / pixels.max(2);
        if every < 2 || (images > 0 && images < file.loss.len()) {
            let instrument = Instrument::new(file)?;
            return Ok(Self { file: file.clone(), instrument, measured: measured.without_truth() });
        }
        if images > 0 {
            Self::thinned(file, measured, every)
        } else {
            Self::wide(file, measured, pixels)
        }
    }

    /// Every n-th row and column of images.
    fn thinned(file: &FitFile, measured: &Measured, every: usize) -> anyhow::Result<Self> {
        let n = file.screen.pixels;
        let places: Vec<usize> = (every / 2..n).step_by(every).collect();
        let kept: Vec<usize> = places
            .iter()
            .flat_map(|row| places.iter().map(move |column| row * n + column))
            .collect();
        let region = fewer_nodes(file, every);
        let file = FitFile { region, ..file.clone() };
        let instrument = Instrument::of(&file, &kept)?;
        let thin = |movie: &Vec<f64>| -> Vec<f64> {
            movie.chunks(n * n).flat_map(|frame| kept.iter().map(|k| frame[*k])).collect()
        };
        let measured =
            Measured { movie: measured.movie.as_ref().map(thin), ..measured.without_truth() };
        let screen = Screen { pixels: places.len(), ..file.screen.clone() };
        Ok(Self { file: FitFile { screen, ..file }, instrument, measured })
    }

    /// Wider pixels over the same field.
    fn wide(file: &FitFile, measured: &Measured, pixels: usize) -> anyhow::Result<Self> {
        let n = file.screen.pixels as f64;
        let screen = Screen {
            pixels,
            width: setup::spacing(&file.screen)? * n,
            width_of: WidthOf::Edges,
            jy_per_pixel: file.screen.jy_per_pixel * (n / pixels as f64).powi(2),
            ..file.screen.clone()
        };
        let region = fewer_nodes(file, file.screen.pixels / pixels);
        let file = FitFile { screen, region, ..file.clone() };
        let instrument = Instrument::new(&file)?;
        let measured = Measured { sky: setup::sky(&file).ok(), ..measured.without_truth() };
        Ok(Self { file, instrument, measured })
    }
}

/// The fewest equidistant nodes that a ray is thinned to: a node for each of the grid's voxels that it crosses.
const FEWEST: usize = 32;

/// The region with every n-th node, or panels of half as many.
fn fewer_nodes(file: &FitFile, every: usize) -> Region {
    let nodes = match file.region.nodes {
        Sampling::Gauss { order, split } => Sampling::Gauss { order: order.div_ceil(2), split },
        Sampling::EqualMinoTime { per_ray } => {
            Sampling::EqualMinoTime { per_ray: per_ray.min(FEWEST.max(per_ray / every)) }
        }
    };
    Region { nodes, ..file.region.clone() }
}

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
    let view = View::new(file, measured, pixels)?;
    let settings = AxisSettings { directions, ..AxisSettings::default() };
    let (keeper, bar) = (Keeper::brief(STOPPED), progress::axes(directions as u64));
    let watch = |solved: usize, expected: usize| {
        bar.set_length(expected as u64);
        bar.set_position(solved as u64);
        !keeper.stopped()
    };
    let whole = |problem: &AxisProblem<'_, f32>| scan_axis(problem, &settings, &watch);
    let scan = with_problem(&view, motion, frames, whole)?.ok_or_else(stopped)?;
    let refined = refine.map(|nodes| -> anyhow::Result<AxisLoss> {
        let view = View::new(file, measured, file.screen.pixels)?;
        let effort = (fine(nodes), HALVINGS);
        let near = |problem: &AxisProblem<'_, f32>| {
            refine_axis(problem, scan.best.axis, STEP, effort, &watch)
        };
        with_problem(&view, motion, frames, near)?.ok_or_else(stopped)
    });
    bar.finish_and_clear();
    Ok(Found { refined: refined.transpose()?, scan })
}

const STOPPED: &str = "stopped while axes were being scanned: nothing is kept of that";

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

/// Hands the linear problem of all axes, seen through a view, to a search.
fn with_problem<R>(
    view: &View,
    motion: &Motion,
    frames: usize,
    search: impl FnOnce(&AxisProblem<'_, f32>) -> Result<R, Error>,
) -> anyhow::Result<R> {
    let file = &view.file;
    let linear = setup::linear(file)?;
    let model = setup::forward_model(&view.instrument, motion)?;
    let count = file.screen.pixels * file.screen.pixels;
    let objective = Objective { model, data: view.measured.terms(&file.loss, count)? };
    let all = objective.observed();
    let chosen: Vec<usize> = all.iter().copied().step_by((all.len() / frames).max(1)).collect();
    let (terms, priors) = (terms(&objective.data), setup::priors(linear));
    let problem = AxisProblem {
        model: &objective.model,
        frames: &chosen,
        terms: &terms,
        half_width: file.region.r_max,
        upper: linear.upper,
        flux: linear.flux_jy,
        priors: &priors,
    };
    search(&problem).map_err(failed::linear).context("axis.scan")
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
