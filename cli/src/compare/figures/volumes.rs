//! Volumes in rows and columns.

use super::Figures;
use crate::compare::cases::Case;
use crate::compare::experiment::FigureAsked;
use crate::compare::labels::{called, combinations, result};
use crate::compare::summary::is_at;
use crate::compare::tables::levels;
use crate::fit;
use crate::report::{Figure, encode};
use crate::volume_files;
use anyhow::Context;
use kerrlight_tomo::dynamics::Axis;
use kerrlight_tomo::volume::metrics;
use kerrlight_tomo::volume::projection::{Surroundings, Tile, View, mosaic};
use kerrlight_tomo::volume::{Volume, VolumeFile};
use serde_json::Value;

impl Figures<'_> {
    /// Truths in the first row, recoveries of the first seed, or of every one, below.
    pub(super) fn volumes(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let rows = levels(self.experiment, self.summary, &asked.rows);
        let columns = levels(self.experiment, self.summary, &asked.columns);
        let (rows, columns) = (combinations(&rows), combinations(&columns));
        let seeds = 1..=if asked.every_seed { self.summary.seeds } else { 1 };
        let rows = rows.iter().flat_map(|row| seeds.clone().map(move |seed| (row, seed)));
        let is_of = |case: &Case, levels: &[(&str, &str)], seed: u64| {
            is_at(case, levels) && case.seed == seed
        };
        // What was never asked for here, as a method that has no such settings.
        let is_there = |row: &[_], seed| self.chosen(asked).any(|(case, _)| is_of(case, row, seed));
        let rows: Vec<_> = rows.filter(|(row, seed)| is_there(row, *seed)).collect();
        let name = |(row, seed): &(&Vec<(&str, &str)>, u64)| {
            let seed = asked.every_seed.then(|| format!("seed {seed}"));
            let row = Some(called(row)).filter(|name| !name.is_empty());
            row.into_iter().chain(seed).collect::<Vec<_>>().join(", ")
        };
        let mut loaded: Vec<(String, Vec<(String, Loaded)>)> =
            vec![("truth".to_owned(), Vec::new())];
        loaded.extend(rows.iter().map(|row| (name(row), Vec::new())));
        for column in &columns {
            let at = |(row, seed): &(&Vec<(&str, &str)>, u64)| {
                let levels = [row.as_slice(), column].concat();
                self.chosen(asked).find(|(case, _)| is_of(case, &levels, *seed))
            };
            let cells: Vec<Option<(&Case, &Value)>> = rows.iter().map(at).collect();
            // A column with a gap would stand under the wrong truth.
            let Some(cells) = cells.into_iter().collect::<Option<Vec<_>>>() else { continue };
            let Some((first, _)) = cells.first() else { continue };
            let Some(truth) = self.load(first, TRUTH, asked.later)? else { continue };
            for (line, (case, results)) in loaded[1..].iter_mut().zip(cells) {
                let Some(volume) = self.load(case, FOUND, asked.later)? else { return Ok(None) };
                let psnr = match asked.later {
                    Some(_) => metrics::compare(&volume.volume, &truth.volume, None)?.psnr_db,
                    None => result(results, "psnr_db"),
                };
                line.1.push((quality(psnr, results), volume));
            }
            loaded[0].1.push((called(column), truth));
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
        let when = match asked.later {
            Some(_) => {
                " The truth has been carried along by the true motion since the reference time, recovered volumes by the assumed \
                 motion about the axis that was found; PSNR is that of this time."
            }
            None => "",
        };
        let caption = format!(
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
        );
        let drawn = mosaic(&rows);
        Ok(Some(Figure { png: encode(drawn)?, caption, alt: asked.title.clone() }))
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
        let settings = case.settings.as_deref().unwrap_or_default();
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
fn quality(psnr: Option<f64>, results: &Value) -> String {
    let psnr = psnr.map(|x| format!("{x:.1} dB"));
    let axis = result(results, "axis_dot_truth").filter(|x| *x < 1.0 - 1e-9);
    let axis = axis.map(|x| format!("axis {x:.4}"));
    [psnr, axis].into_iter().flatten().collect::<Vec<_>>().join(", ")
}
