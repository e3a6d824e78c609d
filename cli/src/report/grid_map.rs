//! A function on a grid of a few numbers: its profile along each on the diagonal, over each pair below it.

use super::panels;
use kuva::plot::line::LinePlot;
use kuva::plot::scatter::ScatterPlot;
use kuva::plot::{ColorMap, Heatmap};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

/// One of the numbers.
#[derive(Debug)]
pub struct GridAxis {
    /// What it is called, with its unit.
    pub name: String,
    /// Its values on the grid, growing, at equal distances.
    pub values: Vec<f64>,
    /// Where the function is least.
    pub best: f64,
    /// What it is in truth.
    pub truth: Option<f64>,
}

/// The map.
#[derive(Debug)]
pub struct GridMap {
    /// The numbers.
    pub axes: Vec<GridAxis>,
    /// What the function is called.
    pub name: String,
    /// Least values at each value of one number, for all numbers.
    pub alone: Vec<Vec<f64>>,
    /// Least values over the pair (column, row), rows one after the other, for all column < row, row by row.
    pub pairs: Vec<Vec<f64>>,
}

/// Side of a panel, pixels.
const PANEL: f64 = 260.0;
const CURVE: &str = "#0072B2";
const TRUTH: &str = "#D55E00";
const BEST: &str = "#FFFFFF";

impl GridAxis {
    /// From half a cell before the first value to half a cell behind the last.
    fn range(&self) -> [f64; 2] {
        let [first, last] = [self.values[0], self.values[self.values.len() - 1]];
        let half = 0.5 * (last - first) / (self.values.len() - 1) as f64;
        [first - half, last + half]
    }
}

impl GridMap {
    /// The picture as text.
    pub fn svg(&self) -> String {
        panels::triangle(self.axes.len(), PANEL, |row, column| {
            let panel = if row == column { self.curve(row) } else { self.pair(column, row) };
            let layout = self.layout(&panel, row, column);
            (panel, layout)
        })
    }

    fn curve(&self, k: usize) -> Vec<Plot> {
        let points = self.axes[k].values.iter().copied().zip(self.alone[k].iter().copied());
        let points: Vec<(f64, f64)> = points.collect();
        let top = self.alone[k].iter().copied().fold(0.0, f64::max);
        let mut all = vec![Plot::from(LinePlot::new().with_data(points).with_color(CURVE))];
        all.extend(self.axes[k].truth.map(|truth| {
            Plot::from(LinePlot::new().with_data([(truth, 0.0), (truth, top)]).with_color(TRUTH))
        }));
        all
    }

    fn pair(&self, column: usize, row: usize) -> Vec<Plot> {
        let (x, y) = (&self.axes[column], &self.axes[row]);
        let values = &self.pairs[row * (row - 1) / 2 + column];
        let rows: Vec<Vec<f64>> =
            values.chunks_exact(x.values.len()).map(<[f64]>::to_vec).collect();
        let ([left, right], [low, high]) = (x.range(), y.range());
        let heat = Heatmap::new()
            // With a range of y the first row is drawn at the bottom.
            .with_data(rows)
            .with_color_map(ColorMap::Viridis)
            .with_x_range(left, right)
            .with_y_range(low, high)
            .with_cell_size(1.0);
        let mark = |x: f64, y: f64, color: &str| {
            Plot::from(ScatterPlot::new().with_data([(x, y)]).with_color(color).with_size(5.0))
        };
        let mut all = vec![Plot::Heatmap(heat), mark(x.best, y.best, BEST)];
        if let (Some(a), Some(b)) = (x.truth, y.truth) {
            all.push(mark(a, b, TRUTH));
        }
        all
    }

    fn layout(&self, plots: &[Plot], row: usize, column: usize) -> Layout {
        let (n, [low, high]) = (self.axes.len(), self.axes[column].range());
        let mut layout = Layout::auto_from_plots(plots)
            .with_x_axis_min(low)
            .with_x_axis_max(high)
            .with_ticks(4)
            .with_tick_size(11)
            .with_label_size(13);
        if row + 1 == n {
            layout = layout.with_x_label(self.axes[column].name.clone());
        }
        if row == column {
            return layout.with_y_label(self.name.clone());
        }
        let [low, high] = self.axes[row].range();
        layout = layout.with_y_axis_min(low).with_y_axis_max(high);
        if column == 0 { layout.with_y_label(self.axes[row].name.clone()) } else { layout }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_maps_have_a_cell_for_each_pair_of_values() {
        let axis = |name: &str, count: u32| GridAxis {
            name: name.to_owned(),
            values: (0..count).map(f64::from).collect(),
            best: 1.0,
            truth: Some(2.0),
        };
        let map = GridMap {
            axes: vec![axis("spin", 5), axis("tilt", 4)],
            name: "distance".to_owned(),
            alone: vec![vec![3.0, 0.0, 1.0, 2.0, 4.0], vec![1.0, 0.0, 1.0, 2.0]],
            pairs: vec![(0..20).map(f64::from).collect()],
        };
        let svg = map.svg();
        assert!(svg.starts_with("<svg") && svg.contains("spin") && svg.contains("tilt"));
        assert!(svg.matches("<rect").count() >= 20, "{}", svg.matches("<rect").count());
    }
}
