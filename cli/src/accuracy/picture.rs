//! Cost of one more digit, in one picture.

use anyhow::anyhow;
use kerrlight_geodesic::Integrator;
use kerrlight_validation::accuracy::rays::Class;
use kerrlight_validation::accuracy::sweep::Row;
use kuva::plot::line::LinePlot;
use kuva::plot::scatter::{MarkerShape, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

/// Samples of the rays whose time is shown.
const SAMPLES: f64 = 100.0;

/// Colours that the colour-blind tell apart (Okabe & Ito 2008).
const COLORS: [&str; 5] = ["#999999", "#E69F00", "#009E73", "#0072B2", "#D55E00"];

/// Two panels as SVG and as PNG: rays anywhere, and rays next to the critical curve.
///
/// # Errors
/// If the bitmap cannot be drawn.
pub fn figure(rows: &[Row]) -> anyhow::Result<(String, Vec<u8>)> {
    // Next to the critical curve one ray in a hundred has no digits left in any arithmetic.
    let panels = [(Class::Generic, 1, "99 % of rays"), (Class::NearCritical, 0, "the median ray")];
    let drawn = panels.map(|(class, quantile, of)| panel(rows, class, quantile, of));
    let (plots, layouts) = drawn.into_iter().unzip();
    let figure = Figure::new(1, 2)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(620.0, 480.0)
        .with_shared_legend();
    let scene = figure.render();
    let svg = kuva::backend::svg::SvgBackend::new().render_scene(&scene);
    let png = kuva::backend::png::PngBackend::new().with_scale(1.5).render_scene(&scene);
    let png = png.map_err(|error| anyhow!("cannot draw: {error}"))?;
    Ok((svg, png))
}

/// Correct digits at a quantile of one class against time, a line an integrator.
fn panel(rows: &[Row], class: Class, quantile: usize, of: &str) -> (Vec<Plot>, Layout) {
    // An error above 1 leaves no correct digit: the axis begins at 0.
    let digits = |error: f64| -error.clamp(1e-17, 1.0).log10();
    let mut plots = Vec::new();
    let mut all = Vec::new();
    for (integrator, color) in Integrator::ALL.iter().zip(COLORS) {
        let points: Vec<(f64, f64)> = rows
            .iter()
            .filter(|row| row.spin.is_none() && row.class == class)
            .filter(|row| row.integrator == *integrator)
            .map(|row| (1e-3 * (row.ns_per_ray + SAMPLES * row.ns_per_sample), row.error[quantile]))
            .filter(|(time, error)| time.is_finite() && *error > 0.0)
            .map(|(time, error)| (time, digits(error)))
            .collect();
        all.extend(points.iter().copied());
        let line = LinePlot::new().with_data(points.clone()).with_color(color);
        plots.push(Plot::from(line.with_stroke_width(1.5)));
        let marks = ScatterPlot::new().with_data(points).with_color(color).with_size(4.0);
        plots.push(Plot::from(marks.with_legend(integrator.name())));
    }
    let front = ScatterPlot::new()
        .with_data(pareto(&all))
        .with_color("#000000")
        .with_marker(MarkerShape::Circle)
        .with_marker_opacity(0.0)
        .with_marker_stroke_width(1.2)
        .with_size(8.0)
        .with_legend("nothing is faster and better");
    plots.push(Plot::from(front));
    let layout = Layout::auto_from_plots(&plots)
        .with_log_x()
        .with_y_axis_min(0.0)
        .with_y_axis_max(16.0)
        .with_ticks(8)
        .with_title(format!("{} rays", class.name()))
        .with_x_label("time of a ray with 100 samples, one core (µs)")
        .with_y_label(format!("correct digits of r, θ and φ, {of}"))
        .with_y_tick_format(TickFormat::Integer);
    (plots, layout)
}

/// The points than which no other has both less time and more digits, from left to right.
fn pareto(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut points = points.to_vec();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut most = f64::NEG_INFINITY;
    points.retain(|(_, digits)| {
        let better = *digits > most;
        most = most.max(*digits);
        better
    });
    points
}

#[cfg(test)]
mod tests {
    use super::pareto;

    #[test]
    fn exact_front_of_a_few_points() {
        let points = [(3.0, 9.0), (1.0, 5.0), (2.0, 4.0), (2.5, 8.0), (4.0, 9.0)];
        assert_eq!(pareto(&points), [(1.0, 5.0), (2.5, 8.0), (3.0, 9.0)]);
    }
}
