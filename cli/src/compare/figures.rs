//! Pictures of an experiment.

use super::cases::Case;
use super::experiment::{Experiment, FigureAsked, FigureKind};
use super::runner::Runner;
use super::summary::{Summary, called, combinations, described, is_at, pairs, result};
use super::tables::levels;
use crate::fit;
use crate::output;
use crate::report::{Axis, Figure, LinePlot, Marks, Series, encode};
use crate::volume_files;
use anyhow::Context;
use kerrlight_tomo::volume::projection::{Surroundings, Tile, View, mosaic};
use kerrlight_tomo::volume::{Volume, VolumeFile};
use serde_json::Value;
use std::path::Path;

/// Pictures and plots.
#[derive(Default)]
pub struct Drawn {
    /// Pictures, with names of files.
    pub figures: Vec<(String, Figure)>,
    /// Plots.
    pub plots: Vec<LinePlot>,
}

/// All that figures are made of.
pub struct Figures<'a> {
    /// What is shown.
    pub experiment: &'a Experiment,
    /// What was found.
    pub summary: &'a Summary<'a>,
    /// Where the runs are.
    pub runner: &'a Runner,
}

/// Most curves of a plot.
const CURVES: usize = 6;

impl Figures<'_> {
    /// All that the experiment asks for and that there is something of.
    pub fn draw(&self) -> anyhow::Result<Drawn> {
        let mut drawn = Drawn::default();
        for (k, asked) in self.experiment.figure.iter().enumerate() {
            self.one(k, asked, &mut drawn).with_context(|| format!("figure {:?}", asked.title))?;
        }
        Ok(drawn)
    }

    fn one(&self, k: usize, asked: &FigureAsked, drawn: &mut Drawn) -> anyhow::Result<()> {
        let name = |kind: &str| format!("{}-{kind}", k + 1);
        match asked.kind {
            FigureKind::Volumes => {
                if let Some(figure) = self.volumes(asked)? {
                    drawn.figures.push((name("volumes"), figure));
                }
            }
            FigureKind::Axes => {
                for (case, _) in self.chosen(asked) {
                    let path = self.runner.run_of(case).join("axis_scan.png");
                    if path.exists() {
                        let caption =
                            format!("{}: {}. {}", asked.title, case.name(), asked.caption);
                        let alt = asked.title.clone();
                        let figure = Figure { png: output::read(&path)?, caption, alt };
                        drawn.figures.push((name(&case.slug), figure));
                    }
                }
            }
            FigureKind::Map => {
                if let Some(figure) = self.map(asked)? {
                    drawn.figures.push((name("map"), figure));
                }
            }
            FigureKind::Time => drawn.plots.extend(self.times(asked)?),
            FigureKind::Curve => drawn.plots.extend(self.curve(asked)),
            FigureKind::Coverage => drawn.plots.extend(self.coverage(asked)?),
            FigureKind::Velocities => drawn.plots.extend(self.velocities(asked)?),
        }
        Ok(())
    }

    /// Cases of a figure that have results.
    fn chosen(&self, asked: &FigureAsked) -> impl Iterator<Item = (&Case, &Value)> {
        let fixed = pairs(&asked.r#where);
        self.summary.done().filter(move |(case, _)| is_at(case, &fixed))
    }

    /// Truths in the first row, recoveries of the first seed below.
    fn volumes(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let rows = levels(self.experiment, self.summary, &asked.rows);
        let columns = levels(self.experiment, self.summary, &asked.columns);
        let (rows, columns) = (combinations(&rows), combinations(&columns));
        let mut loaded: Vec<(String, Vec<(String, Loaded)>)> =
            vec![("truth".to_owned(), Vec::new())];
        loaded.extend(rows.iter().map(|row| (called(row), Vec::new())));
        for column in &columns {
            let at = |row: &[(&str, &str)]| {
                let levels = [row, column].concat();
                self.chosen(asked).find(|(case, _)| is_at(case, &levels))
            };
            let cells: Vec<Option<(&Case, &Value)>> = rows.iter().map(|row| at(row)).collect();
            // A column with a gap would stand under the wrong truth.
            let Some(cells) = cells.into_iter().collect::<Option<Vec<_>>>() else { continue };
            let Some((first, _)) = cells.first() else { continue };
            let Some(truth) = self.load(first, "truth.npz")? else { continue };
            loaded[0].1.push((called(column), truth));
            for (line, (case, results)) in loaded[1..].iter_mut().zip(cells) {
                let Some(volume) = self.load(case, "volume.npz")? else { return Ok(None) };
                line.1.push((quality(results), volume));
            }
        }
        if loaded[0].1.is_empty() {
            return Ok(None);
        }
        let tile = |(title, loaded): &'_ (String, Loaded)| (title.clone(), loaded.around);
        let titles: Vec<Vec<(String, Surroundings)>> =
            loaded.iter().map(|(_, row)| row.iter().map(tile).collect()).collect();
        let rows: Vec<(String, Vec<Tile>)> = loaded
            .iter()
            .zip(&titles)
            .map(|((name, row), titles)| {
                let truths = loaded[0].1.iter().map(|(_, truth)| truth.around.axis);
                let tiles = row.iter().zip(titles).zip(truths).map(|((shown, title), axis)| Tile {
                    title: &title.0,
                    volume: &shown.1.volume,
                    around: title.1,
                    view: view_of(asked, axis),
                });
                (name.clone(), tiles.collect())
            })
            .collect();
        let from = match asked.view {
            Some([azimuth, elevation]) => {
                format!("from azimuth {azimuth}° and elevation {elevation}°")
            }
            None => "from above the orbits, along the true axis".to_owned(),
        };
        let caption = format!(
            "{}. {} Emission along straight parallel rays, seen {from}; the ball is the horizon, the blue line the axis \
             that was used, the circle the edge of the region in the hole's equatorial plane. Seed 1; the table of all \
             cases has the others.",
            asked.title, asked.caption
        );
        let drawn = mosaic(&rows);
        Ok(Some(Figure { png: encode(drawn)?, caption, alt: asked.title.clone() }))
    }

    fn load(&self, case: &Case, name: &str) -> anyhow::Result<Option<Loaded>> {
        let path = self.runner.run_of(case).join(name);
        if !path.exists() {
            return Ok(None);
        }
        let VolumeFile { volume, axis } = volume_files::load(&path)?;
        let (hole_radius, ring_radius) = fit::sizes(case.settings.as_deref().unwrap_or_default())?;
        let around = Surroundings {
            hole_radius,
            axis: axis.unwrap_or([0.0; 3]),
            ring_radius,
            half_width: ring_radius,
        };
        Ok(Some(Loaded { volume, around }))
    }

    /// One plot for each combination of the columns, a curve for each of the rows; every seed's points.
    fn times(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let value = asked.value.as_deref().unwrap_or("psnr_db");
        let columns = levels(self.experiment, self.summary, &asked.columns);
        let rows = levels(self.experiment, self.summary, &asked.rows);
        let mut plots = Vec::new();
        for column in combinations(&columns) {
            let mut series = Vec::new();
            for row in combinations(&rows) {
                let at = [row.as_slice(), &column].concat();
                let mut points = Vec::new();
                for (case, results) in self.chosen(asked).filter(|(case, _)| is_at(case, &at)) {
                    points.extend(self.log(case, value)?);
                    // A linear problem has its quality at its end alone.
                    let last = (result(results, "seconds"), result(results, value));
                    if let (Some(x), Some(y)) = last {
                        points.push([x, y]);
                    }
                }
                if !points.is_empty() {
                    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    series.push(Series {
                        name: called(&row),
                        points,
                        errors: Vec::new(),
                        marks: Marks::Points,
                    });
                }
            }
            let (unit, _) = described(value);
            for part in series_of(series) {
                plots.push(LinePlot {
                    title: [asked.title.clone(), called(&column)].join(": "),
                    caption: format!("{} All seeds.", asked.caption),
                    x: Axis { label: "wall time".to_owned(), unit: "s".to_owned(), log: true },
                    y: Axis { label: unit.clone(), unit: String::new(), log: false },
                    series: part,
                });
            }
        }
        Ok(plots)
    }

    /// What a run has logged of a result, against seconds.
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
    fn curve(&self, asked: &FigureAsked) -> Vec<LinePlot> {
        let (Some(value), Some(factor)) = (&asked.value, asked.columns.first()) else {
            return Vec::new();
        };
        let rows = levels(self.experiment, self.summary, &asked.rows);
        let mut series = Vec::new();
        for row in combinations(&rows) {
            let at = self.chosen(asked).filter(|(case, _)| is_at(case, &row));
            let point = |(case, results): (&Case, &Value)| {
                Some([case.number(factor)?, result(results, value)?])
            };
            let mut points: Vec<[f64; 2]> = at.filter_map(point).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            if !points.is_empty() {
                let name = if row.is_empty() { factor.clone() } else { called(&row) };
                series.push(Series { name, points, errors: Vec::new(), marks: Marks::Points });
            }
        }
        let (unit, _) = described(value);
        let plot = |series| LinePlot {
            title: asked.title.clone(),
            caption: format!("{} All seeds.", asked.caption),
            x: Axis { label: factor.clone(), unit: String::new(), log: false },
            y: Axis { label: unit.clone(), unit: String::new(), log: false },
            series,
        };
        series_of(series).into_iter().map(plot).collect()
    }

    /// Means over two factors as colours with their numbers.
    fn map(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let ([row], [column], Some(value)) =
            (asked.rows.as_slice(), asked.columns.as_slice(), &asked.value)
        else {
            return Ok(None);
        };
        let fixed = pairs(&asked.r#where);
        let names = |factor: &String| {
            levels(self.experiment, self.summary, std::slice::from_ref(factor)).remove(0).1
        };
        let (rows, columns) = (names(row), names(column));
        let cell = |r: &String, c: &String| {
            let at =
                [vec![(row.as_str(), r.as_str()), (column.as_str(), c.as_str())], fixed.clone()];
            self.summary.spread(value, &at.concat()).map(|s| s.mean)
        };
        let means: Vec<Vec<Option<f64>>> =
            rows.iter().map(|r| columns.iter().map(|c| cell(r, c)).collect()).collect();
        let (unit, digits) = described(value);
        let map = super::map::Map {
            rows: [row.clone()].into_iter().chain(rows).collect(),
            columns: [column.clone()].into_iter().chain(columns).collect(),
            means,
            digits,
        };
        let Some(picture) = map.draw() else { return Ok(None) };
        let caption = format!("{}: mean {unit}. {}", asked.title, asked.caption);
        Ok(Some(Figure { png: encode(Some(picture))?, caption, alt: asked.title.clone() }))
    }

    /// (u, v) of the first seed of each combination of rows, a plot each.
    fn coverage(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut plots = Vec::new();
        for (case, _) in self.chosen(asked).filter(|(case, _)| case.seed == 1) {
            let uv = fit::coverage(case.settings.as_deref().unwrap_or_default(), Path::new("/"))?;
            if uv.is_empty() {
                continue;
            }
            let points = uv.iter().flat_map(|[u, v]| [[*u, *v], [-*u, -*v]]);
            let series = vec![Series {
                name: format!("{} visibilities", uv.len()),
                points: points.map(|p| p.map(|x| x * 1e-9)).collect(),
                errors: Vec::new(),
                marks: Marks::Points,
            }];
            let axis = |label: &str| Axis {
                label: label.to_owned(),
                unit: "10⁹ wavelengths".to_owned(),
                log: false,
            };
            plots.push(LinePlot {
                title: format!("{}: {}", asked.title, case.name()),
                caption: format!("{} Both ends of every baseline.", asked.caption),
                x: axis("u"),
                y: axis("v"),
                series,
            });
        }
        Ok(plots)
    }

    /// Velocities that were simulated, and the one that was assumed.
    fn velocities(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let rows = levels(self.experiment, self.summary, &asked.rows);
        let mut series = Vec::new();
        for row in combinations(&rows) {
            let Some((case, _)) = self.chosen(asked).find(|(case, _)| is_at(case, &row)) else {
                continue;
            };
            let [assumed, simulated] =
                fit::velocities(case.settings.as_deref().unwrap_or_default())?;
            let curve = |name: String, points| Series {
                name,
                points,
                errors: Vec::new(),
                marks: Marks::Line,
            };
            if series.is_empty() {
                series.push(curve("assumed".to_owned(), assumed));
            }
            series.push(curve(called(&row), simulated));
        }
        let plot = |series| LinePlot {
            title: asked.title.clone(),
            caption: format!("{} Seed 1.", asked.caption),
            x: Axis { label: "radius".to_owned(), unit: "M".to_owned(), log: false },
            y: Axis {
                label: "angular velocity".to_owned(),
                unit: "rad/time unit".to_owned(),
                log: false,
            },
            series,
        };
        Ok(series_of(series).into_iter().map(plot).collect())
    }
}

struct Loaded {
    volume: Volume,
    around: Surroundings,
}

/// From where a figure shows a volume that turns about an axis.
fn view_of(asked: &FigureAsked, [x, y, z]: [f64; 3]) -> View {
    match asked.view {
        Some([azimuth, elevation]) => View { azimuth, elevation },
        None => {
            View { azimuth: y.atan2(x).to_degrees(), elevation: z.atan2(x.hypot(y)).to_degrees() }
        }
    }
}

/// What stands above a recovered volume.
fn quality(results: &Value) -> String {
    let psnr = result(results, "psnr_db").map(|x| format!("{x:.1} dB"));
    let axis = result(results, "axis_dot_truth").filter(|x| *x < 1.0 - 1e-9);
    let axis = axis.map(|x| format!("axis {x:.4}"));
    [psnr, axis].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// As many plots as are needed for so many curves.
fn series_of(series: Vec<Series>) -> Vec<Vec<Series>> {
    let mut parts = Vec::new();
    let mut rest = series.into_iter().peekable();
    while rest.peek().is_some() {
        parts.push(rest.by_ref().take(CURVES).collect());
    }
    parts
}
