//! `kerrlight accuracy`: what a digit costs, and whether hard rays come out right.

mod hard;
mod picture;
mod table;

use crate::answer::Answer;
use crate::output::Output;
use crate::progress;
use anyhow::Context;
use clap::Args;
use kerrlight_validation::accuracy::sweep::{self, Sweep};
use std::path::PathBuf;

/// Arguments of `kerrlight accuracy`.
#[derive(Debug, Args)]
pub struct Accuracy {
    /// Folder for the results, made if it does not exist
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Rays of every class and spin in the sweep
    #[arg(long, default_value_t = 128, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=100_000))]
    rays: u32,
    /// Seed of the random rays
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    seed: u64,
    /// Stress-test this many random rays instead of the sweep, compared with 28-digit references:
    /// special spins and inclinations and their neighbours, impact parameters from 1e-12 to 1e6 M,
    /// rays up to 1e-14 beside the critical curve
    #[arg(long, num_args = 0..=1, default_missing_value = "10000000", value_name = "RAYS", value_parser = clap::value_parser!(u64).range(1..=10_000_000_000))]
    hard: Option<u64>,
    /// Integrator of the hard rays
    #[arg(long, default_value = "taylor-mino", requires = "hard", value_parser = crate::trace::integrators())]
    integrator: kerrlight_geodesic::Integrator,
    /// Tolerance of the hard rays
    #[arg(long, default_value_t = 1e-12, requires = "hard")]
    tolerance: f64,
}

impl Accuracy {
    /// Runs the sweep, or the hard rays.
    pub fn run(&self) -> anyhow::Result<Answer> {
        // Before the folder is made: a wrong tolerance leaves nothing behind.
        if self.hard.is_some() {
            kerrlight_geodesic::Tracer::new(self.tolerance).context("--tolerance")?;
        }
        std::fs::create_dir_all(&self.output)
            .with_context(|| format!("cannot make {}", self.output.display()))?;
        match self.hard {
            Some(rays) => hard::run(self, rays),
            None => self.sweep(),
        }
    }

    fn sweep(&self) -> anyhow::Result<Answer> {
        let files =
            ["csv", "json", "svg", "png"].map(|kind| self.place(&format!("accuracy.{kind}"), kind));
        let [csv, json, svg, png] = files;
        let (csv, json, svg, png) = (csv?, json?, svg?, png?);
        let sweep = Sweep::full(self.rays as usize, self.seed);
        let bar = progress::bar(1);
        let rows = sweep::run(&sweep, |done, of| {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
            true
        })?;
        bar.finish_and_clear();
        let (drawing, bitmap) = picture::figure(&rows)?;
        csv.write(&table::csv(&rows)?)?;
        let document = table::json(&rows, &sweep);
        json.write(&serde_json::to_vec_pretty(&document)?)?;
        svg.write(drawing.as_bytes())?;
        png.write(&bitmap)?;
        let answer = Answer::text(table::summary(&rows)).outputs([&csv, &json, &svg, &png]);
        Ok(answer.with_all(serde_json::to_value(&document)?))
    }

    /// A file in the folder of the results.
    fn place(&self, name: &str, extension: &str) -> anyhow::Result<Output> {
        Output::new(&self.output.join(name), extension)
    }
}
