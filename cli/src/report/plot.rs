//! Curves and points as inline SVG.

use anyhow::bail;
use kuva::plot::LegendPosition;
use kuva::plot::line::LinePlot as Line;
use kuva::plot::scatter::ScatterPlot;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

/// An axis and what it measures.
#[derive(Debug)]
pub struct Axis {
    /// The quantity.
    pub label: String,
    /// Its unit; empty for a number without one.
    pub unit: String,
    /// True if equal ratios are equally far apart.
    pub log: bool,
}

/// Marks of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marks {
    /// A line from point to point.
    Line,
    /// Points on their own.
    Points,
    /// Points, and a line through the means of those at one x.
    Joined,
}

/// One curve.
#[derive(Debug)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// (x, y).
    pub points: Vec<[f64; 2]>,
    /// Standard deviations of y, one for each point, or none at all.
    pub errors: Vec<f64>,
    /// Marks.
    pub marks: Marks,
}

/// A plot.
#[derive(Debug)]
pub struct LinePlot {
    /// Its title.
    pub title: String,
    /// Caption.
    pub caption: String,
    /// The axis to the right.
    pub x: Axis,
    /// The axis upward.
    pub y: Axis,
    /// Its curves, at most six.
    pub series: Vec<Series>,
}

/// Colours that the colour-blind tell apart (Okabe & Ito 2008).
const COLORS: [&str; 6] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];

/// A series of more points is thinned out: a page should stay small.
const MOST_POINTS: usize = 3000;

impl Axis {
    /// A linear one.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Axis { label: label.into(), unit: unit.into(), log: false }
    }

    fn title(&self) -> String {
        if self.unit.is_empty() {
            self.label.clone()
        } else {
            format!("{} ({})", self.label, self.unit)
        }
    }

    fn shows(&self, value: f64) -> bool {
        value.is_finite() && (!self.log || value > 0.0)
    }
}

impl Series {
    /// One without errors.
    pub fn new(name: impl Into<String>, points: Vec<[f64; 2]>, marks: Marks) -> Self {
        Series { name: name.into(), points, errors: Vec::new(), marks }
    }

    /// The same with standard deviations of y.
    pub fn with_errors(self, errors: Vec<f64>) -> Self {
        Series { errors, ..self }
    }
}

/// A point and the error of its y.
type Point = ([f64; 2], f64);

impl LinePlot {
    /// The picture, and its caption with what had to be left out. `prefix` is for names in the picture,
    /// another one for each on a page.
    pub fn draw(&self, prefix: &str) -> anyhow::Result<(String, String)> {
        let (mut plots, mut caption, mut hidden) = (Vec::new(), self.caption.clone(), 0);
        if self.series.len() > COLORS.len() {
            bail!("plot {:?}: {} series are not allowed: 1 to 6", self.title, self.series.len());
        }
        for (series, color) in self.series.iter().zip(COLORS) {
            let shown = self.shown(series)?;
            hidden += series.points.len() - shown.len();
            let every = shown.len().div_ceil(MOST_POINTS).max(1);
            if every > 1 {
                caption += &format!(" Of {} one point in {every} is drawn.", series.name);
            }
            let shown: Vec<Point> = shown.into_iter().step_by(every).collect();
            if !shown.is_empty() {
                plots.extend(self.curve(series, &shown, color));
            }
        }
        if plots.is_empty() {
            return Ok((String::new(), format!("{caption} There is no point to show.")));
        }
        if hidden > 0 {
            caption +=
                &format!(" {hidden} points that are not finite or not above 0 are not shown.");
        }
        let layout = self.layout(&plots);
        Ok((inline(&kuva::render_to_svg(plots, layout), prefix), caption))
    }

    /// Points that the axes can show.
    fn shown(&self, series: &Series) -> anyhow::Result<Vec<Point>> {
        let (points, errors) = (series.points.len(), series.errors.len());
        if errors != 0 && errors != points {
            bail!("series {:?}: {errors} errors are not allowed: none or {points}", series.name);
        }
        let error = |k: usize| series.errors.get(k).copied().unwrap_or(0.0);
        let all = series.points.iter().enumerate().map(|(k, point)| (*point, error(k)));
        let visible = |(point, error): &Point| {
            self.x.shows(point[0]) && self.y.shows(point[1]) && error.is_finite()
        };
        Ok(all.filter(visible).collect())
    }

    /// Returns the layers of a series, one over another.
    fn curve(&self, series: &Series, shown: &[Point], color: &str) -> Vec<Plot> {
        let points = shown.iter().map(|([x, y], _)| (*x, *y));
        let line = |width| Line::new().with_color(color).with_stroke_width(width);
        match series.marks {
            Marks::Line => vec![line(1.6).with_data(points).with_legend(&*series.name).into()],
            Marks::Points => vec![self.marks(series, shown, color)],
            Marks::Joined => {
                let through = line(1.0).with_data(means(shown));
                vec![through.into(), self.marks(series, shown, color)]
            }
        }
    }

    fn marks(&self, series: &Series, shown: &[Point], color: &str) -> Plot {
        let points = shown.iter().map(|([x, y], _)| (*x, *y));
        let marks = ScatterPlot::new().with_data(points).with_color(color).with_size(2.5);
        let marks = marks.with_legend(&*series.name);
        if series.errors.is_empty() {
            return Plot::from(marks);
        }
        // On a logarithmic axis an error bar ends above 0.
        let below = |([_, y], e): &Point| if self.y.log { e.min(0.999 * y) } else { *e };
        Plot::from(marks.with_y_err_asymmetric(shown.iter().map(|p| (below(p), p.1))))
    }

    fn layout(&self, plots: &[Plot]) -> Layout {
        let layout = Layout::auto_from_plots(plots)
            .with_title(&*self.title)
            .with_x_label(self.x.title())
            .with_y_label(self.y.title())
            .with_tick_size(13)
            .with_label_size(15)
            .with_legend_position(LegendPosition::OutsideBottomColumns)
            .with_legend_box(false)
            .with_x_label_offset(0.0, -4.0)
            .with_width(540.0)
            .with_height(400.0);
        let layout = if self.x.log { layout.with_log_x() } else { layout };
        if !self.y.log {
            return layout;
        }
        // Error bars that reach to 0 do not decide how far down the axis goes.
        let values = self.series.iter().flat_map(|s| &s.points).map(|[_, y]| *y);
        let least = values.filter(|y| self.y.shows(*y)).fold(f64::INFINITY, f64::min);
        layout.with_log_y().with_y_axis_min(0.5 * least)
    }
}

/// Means of y over points of one x, in their order.
fn means(points: &[Point]) -> Vec<(f64, f64)> {
    let of_one = points.chunk_by(|a, b| a.0[0] == b.0[0]);
    let mean = |group: &[Point]| {
        (group[0].0[0], group.iter().map(|(point, _)| point[1]).sum::<f64>() / group.len() as f64)
    };
    of_one.map(mean).collect()
}

/// The same drawing as wide as its place: the size in pixels becomes a view box. Names in it get a
/// prefix, because all drawings share those of the page.
pub fn inline(svg: &str, prefix: &str) -> String {
    let parts = svg.split_once("width=\"").and_then(|(head, rest)| {
        let (width, rest) = rest.split_once("\" height=\"")?;
        let (height, rest) = rest.split_once('"')?;
        Some(format!("{head}viewBox=\"0 0 {width} {height}\"{rest}"))
    });
    let svg = parts.unwrap_or_else(|| svg.to_owned());
    svg.replace(" id=\"", &format!(" id=\"{prefix}"))
        .replace("\"url(#", &format!("\"url(#{prefix}"))
}
