//! The usual pictures of an observation, as PNG or SVG.

use crate::output::Output;
use crate::paths;
use anyhow::{anyhow, bail};
use kerrlight_render::image::colormap::Colormap;
use kerrlight_vlbi::observation::Observation;
use kuva::plot::scatter::ScatterPlot;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use std::path::Path;

/// Intervals of time that have a colour of their own.
const INTERVALS: usize = 8;

/// A picture to be written, PNG or SVG by the ending of its name.
pub struct PlotFile {
    pub output: Output,
    is_svg: bool,
}

impl PlotFile {
    /// Checks the place before any work is done.
    pub fn new(path: &Path) -> anyhow::Result<Self> {
        let is_svg = match paths::ending(path).as_str() {
            "svg" => true,
            "png" => false,
            _ => bail!("plot {} must end in .png or .svg", path.display()),
        };
        Ok(PlotFile { output: Output::new(path, "")?, is_svg })
    }

    /// Draws and writes.
    pub fn write(&self, (plots, layout): (Vec<Plot>, Layout)) -> anyhow::Result<()> {
        let bytes = if self.is_svg {
            kuva::render_to_svg(plots, layout).into_bytes()
        } else {
            kuva::render_to_png(plots, layout, 1.5).map_err(|e| anyhow!("cannot draw: {e}"))?
        };
        self.output.write(&bytes)
    }
}

/// (u, v) of all baselines in both senses, coloured by time.
pub fn coverage(observation: &Observation, title: &str) -> (Vec<Plot>, Layout) {
    let points = observation.rows.iter().flat_map(|row| {
        let [u, v] = row.uv.map(|x| x / 1e9);
        [(row.time_h, (u, v)), (row.time_h, (-u, -v))]
    });
    let plots = by_time(points.collect());
    let reach = observation
        .rows
        .iter()
        .fold(0.0, |most: f64, row| most.max(row.uv[0].abs()).max(row.uv[1].abs()))
        .max(1.0);
    let half = 1.05 * reach / 1e9;
    let layout = Layout::auto_from_plots(&plots)
        .with_title(title)
        .with_x_label("u (Gλ)")
        .with_y_label("v (Gλ)")
        .with_x_axis_min(-half)
        .with_x_axis_max(half)
        .with_y_axis_min(-half)
        .with_y_axis_max(half)
        .with_width(640.0)
        .with_height(560.0);
    (plots, layout)
}

/// |V| of Stokes I against the length of the baseline, coloured by time.
pub fn amplitudes(observation: &Observation, title: &str) -> (Vec<Plot>, Layout) {
    let points = observation
        .stokes_i()
        // The axis of amplitudes is logarithmic.
        .filter(|(_, i)| i.visibility.norm() > 0.0)
        .map(|(row, i)| (row.time_h, (row.uv[0].hypot(row.uv[1]) / 1e9, i.visibility.norm())));
    let plots = by_time(points.collect());
    let layout = Layout::auto_from_plots(&plots)
        .with_title(title)
        .with_x_label("baseline (Gλ)")
        .with_y_label("|V| (Jy)")
        .with_x_axis_min(0.0)
        .with_log_y()
        .with_width(800.0)
        .with_height(500.0);
    (plots, layout)
}

/// Points by the interval of time that they are in.
fn by_time(points: Vec<(f64, (f64, f64))>) -> Vec<Plot> {
    let times = || points.iter().map(|(time, _)| *time);
    let first = times().fold(f64::INFINITY, f64::min);
    let last = times().fold(f64::NEG_INFINITY, f64::max);
    let width = (last - first) / INTERVALS as f64;
    let interval = |time: f64| {
        if width > 0.0 { (((time - first) / width) as usize).min(INTERVALS - 1) } else { 0 }
    };
    let colors = Colormap::Viridis.table();
    let mut plots = Vec::new();
    for k in 0..INTERVALS {
        let inside = points.iter().filter(|(time, _)| interval(*time) == k);
        let inside: Vec<(f64, f64)> = inside.map(|(_, point)| *point).collect();
        if inside.is_empty() {
            continue;
        }
        // The brightest yellow is hard to see on white.
        let [r, g, b] = colors[k * 900 / (INTERVALS - 1)];
        let from = first + k as f64 * width;
        let marks = ScatterPlot::new()
            .with_data(inside)
            .with_size(2.0)
            .with_color(format!("#{r:02x}{g:02x}{b:02x}"))
            .with_legend(format!("{from:.1}–{:.1} h", from + width));
        plots.push(marks.into());
    }
    plots
}
