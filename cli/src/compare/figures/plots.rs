//! Curves and points.

use super::Figures;
use crate::compare::cases::Case;
use crate::compare::experiment::FigureAsked;
use crate::compare::labels::{called, described, result};
use crate::compare::results::Results;
use crate::fit;
use crate::output;
use crate::report::{Axis, LinePlot, Marks, Series};
use serde_json::Value;
use std::path::Path;

/// Most curves of a plot.
const CURVES: usize = 6;

impl Figures<'_> {
    /// One plot for each combination of the columns, a curve for each of the rows; every seed's points.
    pub(super) fn times(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let value = asked.value.as_deref().unwrap_or("psnr_db");
        let rows = self.summary.combinations(&asked.rows);
        // Steps of several seeds have no order among each other.
        let marks = if self.summary.seeds == 1 { Marks::Joined } else { Marks::Points };
        let mut plots = Vec::new();
        for column in self.summary.combinations(&asked.columns) {
            let mut series = Vec::new();
            for row in &rows {
                let at = [row.as_slice(), &column].concat();
                let mut points = Vec::new();
                for (case, results) in self.chosen_at(asked, &at) {
                    points.extend(self.log(case, value)?);
                    // A linear problem has its quality at its end alone.
                    let last = (results.get("seconds"), results.get(value));
                    if let (Some(x), Some(y)) = last {
                        points.push([x, y]);
                    }
                }
                points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                // One without points keeps the colours of the others as they are in other plots.
                series.push(Series::new(called(row), points, marks));
            }
            let (unit, _) = described(value);
            let seeds = self.summary.seeds_told();
            for part in series_of(series) {
                plots.push(LinePlot {
                    title: [asked.title.clone(), called(&column)].join(": "),
                    caption: format!(
                        "{} {seeds} The last point of each is the end of the whole process, with the simulation of the \
                         data and the pictures; those before it count the fit alone.",
                        asked.caption
                    ),
                    x: Axis { log: true, ..Axis::new("wall time", "s") },
                    y: Axis::new(&unit, ""),
                    series: part,
                });
            }
        }
        Ok(plots)
    }

    /// Returns the log of a result, against seconds.
    fn log(&self, case: &Case, value: &str) -> anyhow::Result<Vec<[f64; 2]>> {
        let path = self.runner.run_of(case).join("log.jsonl");
        let text = output::read_text(&path)?;
        let line = |line: &str| {
            let line: Value = serde_json::from_str(line).ok()?;
            Some([line["seconds"].as_f64()?, result(&line, value)?])
        };
        Ok(text.lines().filter_map(line).collect())
    }

    /// A result against the numbers of the first column, a curve for each combination of rows.
    pub(super) fn curve(&self, asked: &FigureAsked) -> Vec<LinePlot> {
        let (Some(value), Some(factor)) = (&asked.value, asked.columns.first()) else {
            return Vec::new();
        };
        let mut series = Vec::new();
        for row in self.summary.combinations(&asked.rows) {
            let point = |(case, results): (&Case, &Results)| {
                Some([case.number(factor)?, results.get(value)?])
            };
            let mut points: Vec<[f64; 2]> =
                self.chosen_at(asked, &row).into_iter().filter_map(point).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            if !points.is_empty() {
                let name = if row.is_empty() { factor.clone() } else { called(&row) };
                series.push(binned(name, points));
            }
        }
        let (unit, _) = described(value);
        let numbers = || series.iter().flat_map(|series| &series.points).map(|point| point[0]);
        let (least, most) = (numbers().fold(f64::MAX, f64::min), numbers().fold(0.0, f64::max));
        // Factors of a few levels look best as they are, rates and steps over decades do not.
        let log = least > 0.0 && most >= 30.0 * least;
        let plot = |series| LinePlot {
            title: asked.title.clone(),
            caption: format!("{} {}", asked.caption, self.summary.seeds_told()),
            x: Axis { log, ..Axis::new(factor, "") },
            y: Axis::new(&unit, ""),
            series,
        };
        series_of(series).into_iter().map(plot).collect()
    }

    /// (u, v) of the first seed of each combination of rows, a plot each.
    pub(super) fn coverage(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut plots = Vec::new();
        let cases = self.chosen(asked).filter(|(case, _)| case.seed == 1);
        for (case, _) in cases.take(super::MOST + 1) {
            // Paths in the settings of cases start from the root.
            let uv = fit::coverage(&case.settings().unwrap_or_default(), Path::new("/"))?;
            if uv.is_empty() {
                continue;
            }
            // The sky is real: V(−u, −v) is the conjugate of V(u, v), and both are measured.
            let points = uv.iter().flat_map(|[u, v]| [[*u, *v], [-*u, -*v]]);
            let points = points.map(|p| p.map(|x| x * 1e-9)).collect();
            let name = format!("{} visibilities", uv.len());
            plots.push(LinePlot {
                title: format!("{}: {}", asked.title, case.name()),
                caption: format!("{} Both ends of every baseline.", asked.caption),
                x: Axis::new("u", "10⁹ wavelengths"),
                y: Axis::new("v", "10⁹ wavelengths"),
                series: vec![Series::new(name, points, Marks::Points)],
            });
        }
        Ok(plots)
    }

    /// Velocities that were simulated, and the one that was assumed.
    pub(super) fn velocities(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut series = Vec::new();
        for row in self.summary.combinations(&asked.rows) {
            let Some((case, _)) = self.chosen_at(asked, &row).into_iter().next() else {
                continue;
            };
            let [assumed, simulated] = fit::velocities(&case.settings().unwrap_or_default())?;
            if series.is_empty() {
                series.push(Series::new("assumed", assumed, Marks::Line));
            }
            series.push(Series::new(called(&row), simulated, Marks::Line));
        }
        let plot = |series| LinePlot {
            title: asked.title.clone(),
            caption: format!("{} Seed 1.", asked.caption),
            x: Axis::new("radius", "M"),
            y: Axis::new("angular velocity", "rad/time unit"),
            series,
        };
        Ok(series_of(series).into_iter().map(plot).collect())
    }
}

/// Points of a curve; of more, means and standard deviations of equally many that lie next to each other.
const POINTS: usize = 600;
/// Largest number of groups.
const BINS: usize = 100;

/// A curve of points in order: as they are, or of too many their means in groups.
fn binned(name: String, points: Vec<[f64; 2]>) -> Series {
    if points.len() <= POINTS {
        return Series::new(name, points, Marks::Joined);
    }
    let group = |part: &[[f64; 2]]| {
        let mean = |k: usize| part.iter().map(|point| point[k]).sum::<f64>() / part.len() as f64;
        let (x, y) = (mean(0), mean(1));
        let square: f64 = part.iter().map(|point| (point[1] - y).powi(2)).sum();
        ([x, y], (square / (part.len().max(2) - 1) as f64).sqrt())
    };
    let name = format!("{name}: means and standard deviations of {} cases", points.len());
    let each = points.len().div_ceil(BINS);
    let (points, errors) = points.chunks(each).map(group).unzip();
    Series::new(name, points, Marks::Joined).with_errors(errors)
}

/// Splits curves into as many plots as are needed.
fn series_of(series: Vec<Series>) -> Vec<Vec<Series>> {
    let mut parts = Vec::new();
    let mut rest = series.into_iter().peekable();
    while rest.peek().is_some() {
        parts.push(rest.by_ref().take(CURVES).collect::<Vec<Series>>());
    }
    // A plot without any point would be an error of the page.
    parts.retain(|part| part.iter().any(|series| !series.points.is_empty()));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_many_points_are_means_of_neighbours() {
        let points = |count: u32| (0..count).map(f64::from).map(|k| [k, k % 2.0]).collect();
        let few = binned("a".to_owned(), points(600));
        assert_eq!((few.points.len(), few.errors.len(), few.name.as_str()), (600, 0, "a"));
        let many = binned("a".to_owned(), points(10_000));
        assert_eq!((many.points.len(), many.errors.len()), (100, 100));
        assert_eq!(many.points[1], [149.5, 0.5]);
        // Of 50 zeros and 50 ones.
        assert!((many.errors[1] - (25.0f64 / 99.0).sqrt()).abs() < 1e-15);
        assert!(many.name.contains("10000 cases"), "{}", many.name);
    }
}
