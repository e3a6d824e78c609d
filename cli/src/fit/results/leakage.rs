//! Leakage between the feeds of stations that a fit has solved for: a table, a picture and numbers.

use super::Estimate;
use super::gains::write_by_file;
use crate::fit::folder::Folder;
use crate::output;
use crate::report::{Axis, LinePlot, Marks, Series, Table};
use anyhow::Context;
use kerrlight_common::frames::Frames;
use kerrlight_tomo::fit::setup::{FitData, SolvedLeakage};
use kerrlight_vlbi::files;
use kerrlight_vlbi::polarimetry::{LeakageDistance, LeakageTable, StationLeakage};
use serde::Serialize;
use serde_json::json;

/// The table of what was found last.
const TABLE: &str = "leakage.csv";

/// Keeps what was found before a step, or beside the linear problem.
pub fn keep(folder: &Folder, step: Option<u64>, found: &SolvedLeakage) -> anyhow::Result<()> {
    folder.file(TABLE)?.write(files::leakage_to_csv(&found.table).as_bytes())?;
    let Some(step) = step else { return Ok(()) };
    folder.log(&json!({ "step": step, "leakage": { "largest_change": found.moved } }))
}

/// Returns the leakage that a run has found last, if it has solved for it.
pub fn kept(measured: &FitData, folder: &Folder) -> anyhow::Result<Option<LeakageTable>> {
    let path = folder.path().join(TABLE);
    if measured.leakage.is_none() || !path.exists() {
        return Ok(None);
    }
    let table = files::parse_leakage(&output::read_text(&path)?);
    table.with_context(|| path.display().to_string()).map(Some)
}

/// Leakage that was found.
pub struct Leakage {
    table: LeakageTable,
    truth: Option<LeakageTable>,
}

/// The leakage, as results.json has it.
#[derive(Serialize)]
pub struct LeakageResults {
    file: &'static str,
    stations: Vec<StationTerms>,
    #[serde(skip_serializing_if = "Option::is_none")]
    beside_the_truth: Option<LeakageDistance>,
}

/// Real and imaginary parts of the terms of a station, with the standard deviation of each part.
#[derive(Serialize)]
struct StationTerms {
    station: String,
    d_r: [f64; 2],
    d_r_error: f64,
    d_l: [f64; 2],
    d_l_error: f64,
}

impl Estimate<'_> {
    /// The leakage of all stations beside images of I, Q and U of all frames, where it is solved for; writes its table. The
    /// loss sees it from now on.
    pub fn leakage(&self, seen: &Frames<f32>) -> anyhow::Result<Option<Leakage>> {
        if self.measured.leakage.is_none() {
            return Ok(None);
        }
        let Some(found) = self.measured.solve_leakage(&seen.to_vec()?)? else { return Ok(None) };
        Leakage::written(found.table, self.measured, self.folder).map(Some)
    }
}

impl Leakage {
    /// Writes its table.
    pub fn written(
        table: LeakageTable,
        measured: &FitData,
        folder: &Folder,
    ) -> anyhow::Result<Self> {
        write_by_file(TABLE, measured, folder, |own_name| {
            let stations = table.stations.iter().filter_map(|leakage| {
                Some(StationLeakage { station: own_name(&leakage.station)?, ..leakage.clone() })
            });
            files::leakage_to_csv(&LeakageTable { stations: stations.collect() })
        })?;
        Ok(Leakage { table, truth: measured.true_leakage.clone() })
    }

    fn distance(&self) -> Option<LeakageDistance> {
        self.table.distance(self.truth.as_ref()?)
    }

    /// Returns the leakage for results.json.
    pub fn results(&self) -> LeakageResults {
        let station = |s: &StationLeakage| {
            let [d_r, d_l] = s.terms.map(|term| [term.re, term.im]);
            let [d_r_error, d_l_error] = s.errors;
            StationTerms { station: s.station.clone(), d_r, d_r_error, d_l, d_l_error }
        };
        let stations = self.table.stations.iter().map(station).collect();
        LeakageResults { file: TABLE, stations, beside_the_truth: self.distance() }
    }

    /// Sentences for the report.
    pub fn sentences(&self) -> Vec<String> {
        let mut all = vec![format!(
            "The leakage of {} stations was solved for in turn with the emission; {TABLE} has it.",
            self.table.stations.len()
        )];
        if let Some(LeakageDistance { rms, largest, size, .. }) = self.distance() {
            all.push(format!(
                "Beside the true leakage, {:.2} % (root mean square of |d|), the recovered one is off by {:.2} % (root mean square; at most {:.2} %).",
                100.0 * size,
                100.0 * rms,
                100.0 * largest
            ));
        }
        all
    }

    /// A line for every station, in per cent.
    pub fn details(&self) -> Table {
        let row = |s: &StationLeakage| {
            let number = |x: f64| format!("{:.2}", 100.0 * x);
            let of = |k: usize| [s.terms[k].re, s.terms[k].im, s.errors[k]].map(number);
            [vec![s.station.clone()], of(0).to_vec(), of(1).to_vec()].concat()
        };
        let head = ["station", "Re d_R", "Im d_R", "σ of d_R", "Re d_L", "Im d_L", "σ of d_L"];
        Table::new(
            "Leakage",
            "Leakage of the other hand into each feed, in per cent, with the standard deviation of each part that data and prior leave open, the model taken for granted.",
            head,
            self.table.stations.iter().map(row).collect(),
        )
    }

    /// All terms in the complex plane, beside the true ones where these are known.
    pub fn plot(&self) -> LinePlot {
        let points = |table: &LeakageTable, hand: usize| {
            let of = |s: &StationLeakage| [100.0 * s.terms[hand].re, 100.0 * s.terms[hand].im];
            table.stations.iter().map(of).collect::<Vec<[f64; 2]>>()
        };
        let mut series = Vec::new();
        for (hand, name) in ["d_R", "d_L"].into_iter().enumerate() {
            let errors = self.table.stations.iter().map(|s| 100.0 * s.errors[hand]);
            let found = Series::new(name, points(&self.table, hand), Marks::Points);
            series.push(found.with_errors(errors.collect()));
            series.extend(self.truth.as_ref().map(|truth| {
                Series::new(format!("{name}, truth"), points(truth, hand), Marks::Points)
            }));
        }
        LinePlot {
            title: "Leakage of stations".to_owned(),
            caption: "Leakage d_R and d_L of every station in the complex plane; 0 is a feed that is pure.".to_owned(),
            x: Axis::new("real part", "%"),
            y: Axis::new("imaginary part", "%"),
            series,
        }
    }
}
