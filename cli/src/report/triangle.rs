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

/// The triangle.
#[derive(Debug)]
pub struct Triangle {
    /// Its numbers.
    pub variables: Vec<Variable>,
}

/// Side of a panel, pixels.
const PANEL: f64 = 230.0;
const DRAWS: &str = "#0072B2";
const TRUTH: &str = "#D55E00";

impl Triangle {
    /// The picture as text.
    pub fn svg(&self) -> String {
        let n = self.variables.len();
        let (mut plots, mut layouts, mut structure) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..n {
            for column in 0..=row {
                let panel = if row == column { self.alone(row) } else { self.pair(row, column) };
                layouts.push(self.layout(&panel, row, column));
                plots.push(panel);
                structure.push(vec![row * n + column]);
            }
        }
        let figure = Figure::new(n, n).with_structure(structure).with_plots(plots);
        let figure = figure.with_layouts(layouts).with_cell_size(PANEL, PANEL).with_spacing(6.0);
        SvgBackend::new().render_scene(&figure.render())
    }

    fn alone(&self, k: usize) -> Vec<Plot> {
        let Variable { values, truth, .. } = &self.variables[k];
        let [low, high] = self.range(k);
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

    fn pair(&self, row: usize, column: usize) -> Vec<Plot> {
        let (x, y) = (&self.variables[column], &self.variables[row]);
        let points = x.values.iter().copied().zip(y.values.iter().copied());
        let mut all =
            vec![Plot::from(ScatterPlot::new().with_data(points).with_color(DRAWS).with_size(2.5))];
        if let (Some(a), Some(b)) = (x.truth, y.truth) {
            all.push(upright(a, self.range(row)));
            let [low, high] = self.range(column);
            all.push(Plot::from(
                LinePlot::new().with_data([(low, b), (high, b)]).with_color(TRUTH),
            ));
        }
        all
    }

    /// Returns the range from below the least to above the largest value.
    fn range(&self, k: usize) -> [f64; 2] {
        let Variable { values, truth, .. } = &self.variables[k];
        let all = || values.iter().copied().chain(*truth);
        let (low, high) =
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        // Draws that are all alike still need a range.
        let margin = 0.08 * (high - low).max(1e-9 * high.abs()).max(1e-12);
        [low - margin, high + margin]
    }

    fn layout(&self, plots: &[Plot], row: usize, column: usize) -> Layout {
        let (n, [low, high]) = (self.variables.len(), self.range(column));
        let mut layout = Layout::auto_from_plots(plots)
            .with_x_axis_min(low)
            .with_x_axis_max(high)
            .with_ticks(3)
            .with_tick_size(11)
            .with_label_size(13);
        if row + 1 == n {
            layout = layout.with_x_label(self.variables[column].name.clone());
        }
        if row == column {
            return layout.with_y_label("draws");
        }
        let [low, high] = self.range(row);
        layout = layout.with_y_axis_min(low).with_y_axis_max(high);
        if column == 0 { layout.with_y_label(self.variables[row].name.clone()) } else { layout }
    }
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
        let triangle = Triangle { variables: vec![variable("spin", 0.01), variable("tilt", 2.0)] };
        let svg = triangle.svg();
        assert!(svg.starts_with("<svg") && svg.contains("spin") && svg.contains("tilt"));
        // Twenty draws of the one pair.
        assert!(svg.matches("<circle").count() >= 20, "{}", svg.matches("<circle").count());
    }
}
