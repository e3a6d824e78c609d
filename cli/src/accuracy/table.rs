//! The sweep as tables.

use kerrlight_validation::accuracy::rays::Class;
use kerrlight_validation::accuracy::sweep::{Row, Sweep};
use serde::Serialize;
use std::fmt::Write;

/// A row as it is written.
#[derive(Serialize)]
struct Line {
    integrator: &'static str,
    tolerance: f64,
    spin: String,
    class: &'static str,
    rays: usize,
    wrong_fates: usize,
    position_error_median: f64,
    position_error_99: f64,
    position_error_max: f64,
    delay_error_median: f64,
    delay_error_99: f64,
    delay_error_max: f64,
    estimate_bounds: f64,
    estimate_over_error: f64,
    ns_per_ray: f64,
    ns_per_sample: f64,
}

impl From<&Row> for Line {
    fn from(row: &Row) -> Self {
        let ([e50, e99, e100], [d50, d99, d100]) = (row.error, row.delay_error);
        Line {
            integrator: row.integrator.name(),
            tolerance: row.tolerance,
            spin: row.spin.map_or("all".to_owned(), |spin| spin.to_string()),
            class: row.class.name(),
            rays: row.rays,
            wrong_fates: row.wrong_fates,
            position_error_median: e50,
            position_error_99: e99,
            position_error_max: e100,
            delay_error_median: d50,
            delay_error_99: d99,
            delay_error_max: d100,
            estimate_bounds: row.bounded,
            estimate_over_error: row.overestimate,
            ns_per_ray: row.ns_per_ray,
            ns_per_sample: row.ns_per_sample,
        }
    }
}

/// The whole sweep as it is written.
#[derive(Serialize)]
pub struct Document {
    version: &'static str,
    seed: u64,
    rows: Vec<Line>,
}

/// One line a row.
pub fn csv(rows: &[Row]) -> anyhow::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(Line::from(row))?;
    }
    Ok(writer.into_inner()?)
}

/// The same with what decided it.
pub fn json(rows: &[Row], sweep: &Sweep) -> Document {
    let rows = rows.iter().map(Line::from).collect();
    Document { version: env!("CARGO_PKG_VERSION"), seed: sweep.seed, rows }
}

/// Summary of all spins together, which a reader wants first.
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::new();
    for class in Class::ALL {
        let _ = writeln!(
            text,
            "\n{}: error of r (relative), theta, phi | time of a ray and of a sample, one core | estimates: share that bounds the error, median over error\n{:<12} {:>9} {:>8} {:>8} {:>8}  {:>10} {:>8}  {:>7} {:>7}",
            class.name(),
            "integrator",
            "tolerance",
            "median",
            "99 %",
            "max",
            "us a ray",
            "ns",
            "bounds",
            "over",
        );
        for row in rows.iter().filter(|row| row.spin.is_none() && row.class == class) {
            let [median, most, max] = row.error;
            let _ = writeln!(
                text,
                "{:<12} {:>9.0e} {median:>8.1e} {most:>8.1e} {max:>8.1e}  {:>10.2} {:>8.0}  {:>5.1} % {:>7.1}{}",
                row.integrator.name(),
                row.tolerance,
                row.ns_per_ray / 1e3,
                row.ns_per_sample,
                100.0 * row.bounded,
                row.overestimate,
                if row.wrong_fates > 0 {
                    format!("  {} of {} rays with a wrong fate", row.wrong_fates, row.rays)
                } else {
                    String::new()
                },
            );
        }
    }
    text
}
