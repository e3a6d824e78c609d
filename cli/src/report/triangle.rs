//! Distributions of several numbers: one by one on the diagonal, pair by pair below it.

use kuva::backend::svg::SvgBackend;
use kuva::plot::Histogram;
use kuva::plot::line::LinePlot;
use kuva::plot::scatter::ScatterPlot;
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

/// A number with its draws.
#[derive(Debug)]
pub struct Variable {
    /// Name, with its unit.
    pub name: String,
    /// The draws, as many as of the others.
    pub values: Vec<f64>,
    /// True value.
    pub truth: Option<f64>,
}

/// Side of a panel, pixels.
const PANEL: f64 = 230.0;
const DRAWS: &str = "#0072B2";
const TRUTH: &str = "#D55E00";

/// The picture of several numbers as SVG.
pub fn triangle(variables: &[Variable]) -> String {
    let n = variables.len();
    let (mut plots, mut layouts, mut structure) = (Vec::new(), Vec::new(), Vec::new());
    for (row, y) in variables.iter().enumerate() {
        for (column, x) in variables[..=row].iter().enumerate() {
            let panel = if row == column { y.alone() } else { pair(x, y) };
            let mut layout = layout(&panel, x, (row != column).then_some(y));
            if row + 1 == n {
                layout = layout.with_x_label(x.name.clone());
            }
            if row == column {
                layout = layout.with_y_label("draws");
            } else if column == 0 {
                layout = layout.with_y_label(y.name.clone());
            }
            layouts.push(layout);
            plots.push(panel);
            structure.push(vec![row * n + column]);
        }
    }
    let figure = Figure::new(n, n).with_structure(structure).with_plots(plots);
    let figure = figure.with_layouts(layouts).with_cell_size(PANEL, PANEL).with_spacing(6.0);
    SvgBackend::new().render_scene(&figure.render())
}

impl Variable {
    fn alone(&self) -> Vec<Plot> {
        let Variable { values, truth, .. } = self;
        let [low, high] = self.range();
        let bins = (values.len() as f64).sqrt().ceil().clamp(6.0, 30.0) as usize;
        let histogram = Histogram::new()
            .with_data(values.iter().copied())
            .with_bins(bins)
            .with_range((low, high))
            .with_color(DRAWS);
        let mut all = vec![Plot::Histogram(histogram)];
        all.extend(truth.map(|truth| {
            let most = values.len() as f64 / 2.0;
            upright(truth, [0.0, most])
        }));
        all
    }

    /// Returns the range from below the least to above the largest value.
    fn range(&self) -> [f64; 2] {
        let Variable { values, truth, .. } = self;
        let all = || values.iter().copied().chain(*truth);
        let (low, high) =
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        // Draws that are all alike still need a range.
        let margin = 0.08 * (high - low).max(1e-9 * high.abs()).max(1e-12);
        [low - margin, high + margin]
    }
}

fn pair(x: &Variable, y: &Variable) -> Vec<Plot> {
    let points = x.values.iter().copied().zip(y.values.iter().copied());
    let mut all =
        vec![Plot::from(ScatterPlot::new().with_data(points).with_color(DRAWS).with_size(2.5))];
    if let (Some(a), Some(b)) = (x.truth, y.truth) {
        all.push(upright(a, y.range()));
        let [low, high] = x.range();
        all.push(Plot::from(LinePlot::new().with_data([(low, b), (high, b)]).with_color(TRUTH)));
    }
    all
}

/// Axes with the range of `x` to the right and, of a pair, that of `y` upward.
fn layout(plots: &[Plot], x: &Variable, y: Option<&Variable>) -> Layout {
    let [low, high] = x.range();
    let layout = Layout::auto_from_plots(plots)
        .with_x_axis_min(low)
        .with_x_axis_max(high)
        .with_ticks(3)
        .with_tick_size(11)
        .with_label_size(13);
    let Some([low, high]) = y.map(Variable::range) else { return layout };
    layout.with_y_axis_min(low).with_y_axis_max(high)
}

fn upright(x: f64, [low, high]: [f64; 2]) -> Plot {
    Plot::from(LinePlot::new().with_data([(x, low), (x, high)]).with_color(TRUTH))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_triangles_have_a_panel_for_each_pair() {
        let variable = |name: &str, factor: f64| Variable {
            name: name.to_owned(),
            values: (0..20).map(|k| factor * f64::from(k)).collect(),
            truth: Some(factor * 3.0),
        };
        let svg = triangle(&[variable("spin", 0.01), variable("tilt", 2.0)]);
        assert!(svg.starts_with("<svg") && svg.contains("spin") && svg.contains("tilt"));
        // Twenty draws of the one pair.
        assert!(svg.matches("<circle").count() >= 20, "{}", svg.matches("<circle").count());
    }
}
