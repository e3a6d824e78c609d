//! `kerrlight uv`: which Fourier components an array measures.

use crate::answer::Answer;
use crate::columns::{self, Column};
use crate::interferometry::arguments::{self, Observing};
use crate::interferometry::plots::{self, PlotFile};
use crate::output::Output;
use clap::Args;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::schedule;
use std::path::PathBuf;

/// Arguments of `kerrlight uv`.
#[derive(Debug, Args)]
pub struct Uv {
    /// EHT2017, ngEHT, or a file in eht-imaging's format
    array: String,
    #[command(flatten)]
    observing: Observing,
    /// Output table; `-` is standard output [default, without --plot: -]
    #[arg(short, long, value_name = "FILE.csv")]
    pub output: Option<PathBuf>,
    /// Output picture, coloured by time
    #[arg(long, value_name = "FILE.png|.svg")]
    plot: Option<PathBuf>,
}

impl Uv {
    /// Computes and writes the coverage.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let output =
            self.output.as_deref().map(|path| Output::or_pipe(path, &["csv"])).transpose()?;
        let plot = self.plot.as_deref().map(PlotFile::new).transpose()?;
        let array = arguments::array_of(&self.array)?;
        let (schedule, setup) = (self.observing.schedule()?, self.observing.setup()?);
        let source = &self.observing.source;
        let observation = schedule::observe_affordable(&array, source.position, &schedule, &setup)?;
        let (table, count) = (vec![table(&observation)], observation.rows.len());
        if let Some(output) = &output {
            output.write(&columns::csv(&table, count)?)?;
        }
        if let Some(plot) = &plot {
            let title = format!("{} and {}, MJD {}", self.array, source.name, self.observing.mjd);
            plot.write(plots::coverage(&observation, &title))?;
        }
        eprintln!("{count} points; {}", self.observing.history(&self.array).join("; "));
        let outputs = output.iter().chain(plot.as_ref().map(|plot| &plot.output));
        let answer = match (&output, &plot) {
            (None, None) => Answer::table("points", table, count).outputs(outputs),
            _ => Answer::written(outputs),
        };
        Ok(answer.with("count", count))
    }
}

fn table(observation: &Observation) -> Vec<Column> {
    let rows = &observation.rows;
    let numbers = |name: &str, value: fn(&kerrlight_vlbi::observation::Row) -> f64| {
        Column::Numbers(name.to_owned(), rows.iter().map(value).collect())
    };
    let station = |name: &str, k: usize| {
        let names = rows.iter().map(|row| observation.names(row)[k].to_owned());
        Column::Words(name.to_owned(), names.collect())
    };
    vec![
        numbers("time_utc_h", |row| row.time_h),
        station("t1", 0),
        station("t2", 1),
        numbers("u", |row| row.uv[0]),
        numbers("v", |row| row.uv[1]),
    ]
}
