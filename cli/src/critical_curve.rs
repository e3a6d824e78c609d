//! `kerrlight critical-curve`: the edge of the shadow, as a table.

use crate::answer::Answer;
use crate::columns::{self, Column};
use crate::output::Output;
use anyhow::Context;
use clap::Args;
use kerrlight_geodesic::analytic::{CriticalCurve, CriticalPoint};
use kerrlight_geodesic::{Inclination, Kerr};
use std::path::PathBuf;

/// Arguments of `kerrlight critical-curve`.
#[derive(Debug, Args)]
pub struct CriticalCurveTable {
    /// Spin of the hole, in [-1, 1]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    spin: f64,
    /// Angle between the spin axis and the line of sight, in [0, 180] degrees
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    inclination: f64,
    /// Number of points, at equal steps of the angle around the screen's origin, the first on the
    /// right (beta = 0), counterclockwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    points: u32,
    /// Output table; `-` is standard output [default: -]
    #[arg(short, long, value_name = "FILE.csv")]
    pub output: Option<PathBuf>,
}

impl CriticalCurveTable {
    /// Computes and writes the curve.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let hole = Kerr::new(self.spin).context("--spin")?;
        let inclination = Inclination::from_degrees(self.inclination).context("--inclination")?;
        let output =
            self.output.as_deref().map(|path| Output::or_pipe(path, &["csv"])).transpose()?;
        let curve = CriticalCurve::new(&hole, inclination);
        let points: Vec<_> = curve.points(self.points).map(|point| point.numbers()).collect();
        let endless = points.iter().filter(|point| !point.iter().all(|x| x.is_finite())).count();
        if endless > 0 {
            eprintln!(
                "note: {endless} of {} points are orbits on the horizon of a hole with |a| = M, where delta and tau are inf",
                points.len()
            );
        }
        let column = |k: usize| points.iter().map(|point| point[k]).collect();
        let table: Vec<_> = CriticalPoint::NAMES
            .iter()
            .enumerate()
            .map(|(k, name)| Column::Numbers((*name).to_owned(), column(k)))
            .collect();
        let Some(output) = output else {
            return Ok(Answer::table("points", vec![table], points.len()));
        };
        output.write(&columns::csv(&[table], points.len())?)?;
        Ok(Answer::default().with("count", points.len()).outputs([&output]))
    }
}
