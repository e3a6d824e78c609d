//! Volumes in rows and columns.

use super::Figures;
use crate::compare::cases::Case;
use crate::compare::experiment::FigureAsked;
use crate::compare::labels::called;
use crate::compare::results::Results;
use crate::fit;
use crate::report::{Figure, encode};
use crate::volume_files;
use anyhow::Context;
use kerrlight_render::dynamics::Axis;
use kerrlight_render::volume::metrics;
use kerrlight_render::volume::projection::{Surroundings, Tile, View, mosaic};
use kerrlight_render::volume::{Volume, VolumeFile};

impl Figures<'_> {
    /// Truths in the first row, recoveries of the first seed, or of every one, below.
    pub(super) fn volumes(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let lines = match self.lines(asked)? {
            Some(lines) if !lines[0].cells.is_empty() => lines,
            _ => return Ok(None),
        };
        let truths = lines[0].cells.iter().map(|(_, truth)| truth.around.axis);
        let views: Vec<View> = truths.map(|axis| view_of(asked, axis)).collect();
        let rows: Vec<(String, Vec<Tile>)> = lines
            .iter()
            .map(|line| {
                let tiles = line.cells.iter().zip(&views).map(|(cell, view)| tile(cell, *view));
                (line.name.clone(), tiles.collect())
            })
            .collect();
        let (caption, alt) = (self.caption(asked), asked.title.clone());
        Ok(Some(Figure { png: encode(mosaic(&rows))?, caption, alt }))
    }

    /// The volumes of all rows, the truths first; `None` where a recovery is missing.
    fn lines(&self, asked: &FigureAsked) -> anyhow::Result<Option<Vec<Line>>> {
        let kinds = self.summary.combinations(&asked.rows);
        let rows = self.rows(asked, &kinds);
        let mut lines = vec![Line { name: "truth".to_owned(), cells: Vec::new() }];
        lines.extend(rows.iter().map(|row| Line { name: row.name(asked), cells: Vec::new() }));
        for column in self.summary.combinations(&asked.columns) {
            let at = |row: &Row| {
                let levels = [row.levels, &column].concat();
                self.chosen_at(asked, &levels).into_iter().find(|(case, _)| case.seed == row.seed)
            };
            // A column with a gap would stand under the wrong truth.
            let cells: Option<Vec<(&Case, &Results)>> = rows.iter().map(at).collect();
            let Some(cells) = cells else { continue };
            let Some((first, _)) = cells.first() else { continue };
            let Some(truth) = self.load(first, TRUTH, asked.later)? else { continue };
            for (line, (case, results)) in lines[1..].iter_mut().zip(cells) {
                let Some(volume) = self.load(case, FOUND, asked.later)? else { return Ok(None) };
                // results.json has the PSNR of the reference time alone.
                let psnr = match asked.later {
                    Some(_) => metrics::compare(&volume.volume, &truth.volume, None)?.psnr_db,
                    None => results.get("psnr_db"),
                };
                line.cells.push((quality(psnr, results), volume));
            }
            lines[0].cells.push((called(&column), truth));
        }
        Ok(Some(lines))
    }

    /// Rows of recoveries, without methods that do not have the settings of this figure.
    fn rows<'r>(&self, asked: &FigureAsked, kinds: &'r [Vec<Level<'r>>]) -> Vec<Row<'r>> {
        let seeds = 1..=if asked.every_seed { self.summary.seeds } else { 1 };
        let rows = kinds.iter().flat_map(|levels| {
            seeds.clone().map(move |seed| Row { levels: levels.as_slice(), seed })
        });
        let is_there = |row: &Row| {
            self.chosen_at(asked, row.levels).into_iter().any(|(case, _)| case.seed == row.seed)
        };
        rows.filter(is_there).collect()
    }

    /// Returns the caption of a figure.
    fn caption(&self, asked: &FigureAsked) -> String {
        let from = match asked.view {
            Some([azimuth, elevation]) => {
                format!("from azimuth {azimuth}° and elevation {elevation}°")
            }
            None => "from above the orbits, along the true axis".to_owned(),
        };
        let when = match asked.later {
            Some(_) => {
                " The truth has been carried along by the true motion since the reference time, recovered volumes by the assumed \
                 motion about the axis that was found; PSNR is that of this time."
            }
            None => "",
        };
        format!(
            "{}. {}{when} Emission along straight parallel rays, seen {from}. The ball is the horizon, the blue line the axis \
             that was used (a point where it is seen end on), the closed curve the edge of the region in the hole's \
             equatorial plane. The colours of a column end at its truth's brightest place: what is brighter is shown like \
             that. {}",
            asked.title,
            asked.caption,
            if asked.every_seed || self.summary.seeds == 1 {
                self.summary.seeds_told()
            } else {
                "Seed 1; the table of all cases has the others.".to_owned()
            }
        )
    }

    /// A volume of a case: at its reference time, or carried along by its own motion.
    fn load(
        &self,
        case: &Case,
        (name, motion): (&str, usize),
        later: Option<f64>,
    ) -> anyhow::Result<Option<Loaded>> {
        let path = self.runner.run_of(case).join(name);
        if !path.exists() {
            return Ok(None);
        }
        let VolumeFile { mut volume, axis } = volume_files::load(&path)?;
        let settings = &case.settings().unwrap_or_default();
        if let Some(later) = later {
            let axis = axis.with_context(|| format!("{}: no axis", path.display()))?;
            let turned = &fit::turned(settings, later).context("later")?[motion];
            volume = volume.carried(Axis::new(axis)?, turned);
        }
        let (hole_radius, ring_radius) = fit::sizes(settings)?;
        let around = Surroundings {
            hole_radius,
            axis: axis.unwrap_or([0.0; 3]),
            ring_radius,
            half_width: ring_radius,
        };
        Ok(Some(Loaded { volume, around }))
    }
}

/// Files of a run, and whose motion carries them: the one that is assumed, or the true one.
const FOUND: (&str, usize) = ("volume.npz", 0);
const TRUTH: (&str, usize) = ("truth.npz", 1);

/// A factor and its level.
type Level<'l> = (&'l str, &'l str);

/// A row of recoveries: cases at these levels with this seed.
struct Row<'l> {
    levels: &'l [Level<'l>],
    seed: u64,
}

impl Row<'_> {
    fn name(&self, asked: &FigureAsked) -> String {
        let seed = asked.every_seed.then(|| format!("seed {}", self.seed));
        let row = Some(called(self.levels)).filter(|name| !name.is_empty());
        row.into_iter().chain(seed).collect::<Vec<_>>().join(", ")
    }
}

/// A row of a figure: volumes with what stands above each.
struct Line {
    name: String,
    cells: Vec<(String, Loaded)>,
}

struct Loaded {
    volume: Volume,
    around: Surroundings,
}

/// A volume as it is drawn.
fn tile((title, loaded): &(String, Loaded), view: View) -> Tile<'_> {
    Tile { title, volume: &loaded.volume, around: loaded.around, view }
}

/// Returns the direction from which a figure shows a volume that turns about an axis.
fn view_of(asked: &FigureAsked, [x, y, z]: [f64; 3]) -> View {
    match asked.view {
        Some([azimuth, elevation]) => View { azimuth, elevation },
        None => {
            View { azimuth: y.atan2(x).to_degrees(), elevation: z.atan2(x.hypot(y)).to_degrees() }
        }
    }
}

/// Returns the title of a recovered volume.
fn quality(psnr: Option<f64>, results: &Results) -> String {
    let psnr = psnr.map(|x| format!("{x:.1} dB"));
    // A known axis equals the true one up to rounding and needs no mention.
    let axis = results.get("axis_dot_truth").filter(|x| *x < 1.0 - 1e-9);
    let axis = axis.map(|x| format!("axis {x:.4}"));
    [psnr, axis].into_iter().flatten().collect::<Vec<_>>().join(", ")
}
