//! Panels of several numbers: each alone on the diagonal, each pair below it.

use kuva::backend::svg::SvgBackend;
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

/// The picture of n numbers as text; `panel` draws that of a row and a column, `side` pixels wide.
pub fn triangle(
    n: usize,
    side: f64,
    panel: impl Fn(usize, usize) -> (Vec<Plot>, Layout),
) -> String {
    let (mut plots, mut layouts, mut structure) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..n {
        for column in 0..=row {
            let (plot, layout) = panel(row, column);
            layouts.push(layout);
            plots.push(plot);
            structure.push(vec![row * n + column]);
        }
    }
    let figure = Figure::new(n, n).with_structure(structure).with_plots(plots);
    let figure = figure.with_layouts(layouts).with_cell_size(side, side).with_spacing(6.0);
    SvgBackend::new().render_scene(&figure.render())
}
