//! Pictures of an experiment.

mod plots;
mod volumes;

use super::cases::Case;
use super::experiment::{FigureAsked, FigureKind};
use super::labels::{described, pairs};
use super::results::Results;
use super::runner::Runner;
use super::summary::Summary;
use crate::fit;
use crate::interferometry::movie_files;
use crate::output;
use crate::report::{self, Figure, LinePlot};
use anyhow::Context;
use kerrlight_tomo::recovery::results::BandResults;
use std::path::PathBuf;

/// Levels of some factors.
type Levels<'l> = Vec<(&'l str, &'l str)>;

/// Pictures and plots.
#[derive(Default)]
pub struct Drawn {
    /// Pictures, with names of files.
    pub figures: Vec<(String, Figure)>,
    /// Plots.
    pub plots: Vec<LinePlot>,
    /// Figures that could not be drawn, in sentences.
    pub missing: Vec<String>,
}

/// Most pictures or plots of a figure: a page of thousands of cases should stay small.
const MOST: usize = 12;

/// Least width of a drawn image, pixels.
const DRAWN: usize = 160;

/// All that figures are made of.
pub struct Figures<'a> {
    /// Summary of the results.
    pub summary: &'a Summary<'a>,
    /// Folders of the runs.
    pub runner: &'a Runner<'a>,
}

impl Figures<'_> {
    /// All that the experiment asks for and that there is something of.
    pub fn draw(&self) -> anyhow::Result<Drawn> {
        let mut drawn = Drawn::default();
        for (k, asked) in self.summary.experiment.figure.iter().enumerate() {
            let (figures, plots) = (drawn.figures.len(), drawn.plots.len());
            self.one(k, asked, &mut drawn).with_context(|| format!("figure {:?}", asked.title))?;
            let count = drawn.figures.len() + drawn.plots.len() - figures - plots;
            let title = &asked.title;
            if count == 0 {
                drawn.missing.push(format!(
                    "Figure {title:?}: no case that was run to its end has what it shows."
                ));
            } else if count > MOST {
                drawn.figures.truncate(figures + MOST);
                drawn.plots.truncate(plots + MOST);
                let told =
                    format!("Figure {title:?}: the first {MOST} of {count} pictures are shown.");
                drawn.missing.push(told);
            }
        }
        Ok(drawn)
    }

    fn one(&self, k: usize, asked: &FigureAsked, drawn: &mut Drawn) -> anyhow::Result<()> {
        let name = |kind: &str| format!("{}-{kind}", k + 1);
        let named = |kind: &str, figure: Option<Figure>| figure.map(|figure| (name(kind), figure));
        match asked.kind {
            FigureKind::Volumes => drawn.figures.extend(named("volumes", self.volumes(asked)?)),
            FigureKind::Axes => {
                // One more says that there are more.
                for (case, path) in self.files(asked, "axis_scan.png", MOST + 1) {
                    let caption = format!(
                        "{}: {}. {} The folders of the other seeds have their own maps (axis_scan.png).",
                        asked.title,
                        case.name(),
                        asked.caption
                    );
                    let alt = asked.title.clone();
                    let figure = Figure { png: output::read(&path)?, caption, alt };
                    drawn.figures.push((name(&case.slug()), figure));
                }
            }
            FigureKind::Map => drawn.figures.extend(named("map", self.map(asked)?)),
            FigureKind::Images => drawn.figures.extend(named("images", self.images(asked)?)),
            FigureKind::Time => drawn.plots.extend(self.times(asked)?),
            FigureKind::Curve => drawn.plots.extend(self.curve(asked)),
            FigureKind::Coverage => drawn.plots.extend(self.coverage(asked)?),
            FigureKind::Velocities => drawn.plots.extend(self.velocities(asked)?),
            FigureKind::Geometries => drawn.plots.extend(self.geometries(asked)?),
            FigureKind::Loops => drawn.plots.extend(self.loops(asked)?),
        }
        Ok(())
    }

    /// Cases of a figure that have results.
    fn chosen(&self, asked: &FigureAsked) -> impl Iterator<Item = (&Case, &Results)> {
        self.chosen_at(asked, &[]).into_iter()
    }

    /// Those of them at these levels.
    fn chosen_at(&self, asked: &FigureAsked, levels: &[(&str, &str)]) -> Vec<(&Case, &Results)> {
        self.summary.at(&[levels, &pairs(&asked.r#where)].concat())
    }

    /// Files of this name in the runs of the first seed, of so many cases at most.
    fn files(&self, asked: &FigureAsked, name: &str, most: usize) -> Vec<(&Case, PathBuf)> {
        let cases = self.chosen(asked).filter(|(case, _)| case.seed == 1).take(most);
        let files = cases.map(|(case, _)| (case, self.runner.run_of(case).join(name)));
        files.filter(|(_, path)| path.exists()).collect()
    }

    /// Means over two factors as colours with their numbers.
    fn map(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let ([row], [column], Some(value)) =
            (asked.rows.as_slice(), asked.columns.as_slice(), &asked.value)
        else {
            return Ok(None);
        };
        let fixed = pairs(&asked.r#where);
        let [rows, columns] = [&asked.rows, &asked.columns].map(|of| self.summary.combinations(of));
        let cell = |r: &Levels<'_>, c: &Levels<'_>| {
            let at = [r.as_slice(), c, &fixed].concat();
            self.summary.spread(value, &at).map(|s| s.mean)
        };
        let means = rows.iter().map(|r| columns.iter().map(|c| cell(r, c)).collect()).collect();
        let names = |factor: &String, of: &[Levels<'_>]| {
            let levels = of.iter().flatten().map(|(_, level)| (*level).to_owned());
            std::iter::once(factor.clone()).chain(levels).collect()
        };
        let (unit, digits) = described(value);
        let (rows, columns) = (names(row, &rows), names(column, &columns));
        let map = super::map::Map { rows, columns, means, digits };
        let Some(picture) = map.draw() else { return Ok(None) };
        let caption = format!("{}: mean {unit}. {}", asked.title, asked.caption);
        Ok(Some(Figure { png: report::encode(Some(picture))?, caption, alt: asked.title.clone() }))
    }

    /// The images of the first seed of all cases that have one, on one scale.
    fn images(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let mut images: Vec<(String, Vec<f32>)> = Vec::new();
        let mut side = 0;
        for (case, path) in self.files(asked, "image.npz", usize::MAX) {
            let (movie, _) = movie_files::read(&[path], None)?;
            let n = movie.i.grid.width;
            if side != 0 && n != side {
                anyhow::bail!("images have {side} and {n} pixels a side: `where` can choose some");
            }
            side = n;
            images.push((case.name(), movie.i.pixels.iter().map(|x| *x as f32).collect()));
        }
        if images.is_empty() {
            return Ok(None);
        }
        let zoom = DRAWN.div_ceil(side);
        let drawn: Vec<(&str, Vec<f32>)> = images
            .iter()
            .map(|(name, image)| (name.as_str(), report::enlarged(image, side, zoom)))
            .collect();
        let what = format!("{}. {}", asked.title, asked.caption);
        report::images(&drawn, side * zoom, &what).map(Some)
    }

    /// The probability of each unknown, a curve for each case of the first seed.
    fn geometries(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut runs: Vec<(String, BandResults)> = Vec::new();
        for (case, path) in self.files(asked, fit::BAND, usize::MAX) {
            let text = output::read_text(&path)?;
            let results =
                serde_json::from_str(&text).with_context(|| path.display().to_string())?;
            runs.push((case.name(), results));
        }
        Ok(fit::plots_of_bands(&runs, &asked.caption))
    }

    /// Loops in Q and U, a plot for each case of the first seed.
    fn loops(&self, asked: &FigureAsked) -> anyhow::Result<Vec<LinePlot>> {
        let mut plots = Vec::new();
        for (case, path) in self.files(asked, fit::LIGHT_CURVE, MOST + 1) {
            let table = output::read_text(&path)?;
            plots.extend(fit::loop_plot(&table, &format!(": {}", case.name())));
        }
        Ok(plots)
    }
}
