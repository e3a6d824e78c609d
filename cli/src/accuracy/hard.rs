//! Stress test: millions of random rays.

use super::Accuracy;
use crate::answer::Answer;
use crate::interrupt::{Interrupted, SignalGuard};
use crate::progress;
use anyhow::anyhow;
use kerrlight_validation::accuracy::hard::{self, Tally};
use kerrlight_validation::accuracy::rays::{Angle, Draw};
use serde::Serialize;
use std::fmt::Write;

/// A tally as it is written.
#[derive(Serialize)]
struct Line {
    kind: &'static str,
    rays: u64,
    captured: u64,
    escaped: u64,
    photon_orbit: u64,
    step_limit: u64,
    wrong_fates: u64,
    wrong_crossings: u64,
    not_finite: u64,
    within_estimate: u64,
    worst_error_over_estimate: f64,
    worst_ray: String,
    example_of_wrong: String,
}

impl From<&Tally> for Line {
    fn from(tally: &Tally) -> Self {
        Line {
            kind: tally.kind.name(),
            rays: tally.rays,
            captured: tally.fates[0],
            escaped: tally.fates[1],
            photon_orbit: tally.unresolved[0],
            step_limit: tally.unresolved[1],
            wrong_fates: tally.wrong_fates,
            wrong_crossings: tally.wrong_crossings,
            not_finite: tally.not_finite,
            within_estimate: tally.bounded,
            worst_error_over_estimate: tally.worst.map_or(0.0, |(ratio, _)| ratio),
            worst_ray: tally.worst.map_or(String::new(), |(_, ray)| describe(&ray)),
            example_of_wrong: tally.example.map_or(String::new(), |ray| describe(&ray)),
        }
    }
}

#[derive(Serialize)]
struct Document {
    version: &'static str,
    integrator: &'static str,
    tolerance: f64,
    seed: u64,
    rays: u64,
    kinds: Vec<Line>,
}

/// A ray in full, so that anyone can trace it again.
fn describe(ray: &Draw) -> String {
    let angle = match ray.inclination {
        Angle::Radians(angle) => format!("{angle:e} rad"),
        Angle::Degrees(angle) => format!("{angle} deg"),
    };
    let Draw { spin, radius, alpha, beta, .. } = ray;
    format!("spin {spin:e}, inclination {angle}, observer {radius}, alpha {alpha:e}, beta {beta:e}")
}

/// Traces them, writes hard.json and hard.csv, and fails if a ray went wrong.
pub fn run(arguments: &Accuracy, rays: u64) -> anyhow::Result<Answer> {
    // Places are checked now, not after hours of tracing.
    let csv = arguments.place("hard.csv", "csv")?;
    let json = arguments.place("hard.json", "json")?;
    let (integrator, tolerance) = (arguments.integrator, arguments.tolerance);
    let (bar, keeper) = (progress::bar(rays), SignalGuard::saving("stopping"));
    let tallies = hard::run(integrator, tolerance, rays, arguments.seed, |done| {
        bar.inc(done);
        !keeper.stopped()
    })?;
    bar.finish_and_clear();
    let done = tallies.iter().map(|tally| tally.rays).sum();
    let document = Document {
        version: env!("CARGO_PKG_VERSION"),
        integrator: integrator.name(),
        tolerance,
        seed: arguments.seed,
        rays: done,
        kinds: tallies.iter().map(Line::from).collect(),
    };
    json.write(&serde_json::to_vec_pretty(&document)?)?;
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in &document.kinds {
        writer.serialize(line)?;
    }
    csv.write(&writer.into_inner()?)?;
    let answer = Answer::text(table(&document)).outputs([&csv, &json]);
    let answer = answer.with_all(serde_json::to_value(&document)?);
    if done < rays {
        let said = format!("interrupted after {done} of {rays} rays; what they gave is written");
        return Ok(answer.failing(Interrupted(said)));
    }
    Ok(match tallies.iter().all(Tally::passes) {
        true => answer,
        false => answer.failing(anyhow!("some rays went wrong: see {}", json.shown().display())),
    })
}

fn table(document: &Document) -> String {
    let mut text = format!(
        "{} rays by {} at tolerance {:e}, seed {}\n{:<18} {:>9} {:>9} {:>9} {:>12} {:>10} {:>11} {:>15} {:>10} {:>9} {:>9}\n",
        document.rays,
        document.integrator,
        document.tolerance,
        document.seed,
        "kind",
        "rays",
        "captured",
        "escaped",
        "photon orbit",
        "step limit",
        "wrong fate",
        "wrong crossings",
        "not finite",
        "bounded",
        "worst"
    );
    for line in &document.kinds {
        let _ = writeln!(
            text,
            "{:<18} {:>9} {:>9} {:>9} {:>12} {:>10} {:>11} {:>15} {:>10} {:>7.3} % {:>9.2}",
            line.kind,
            line.rays,
            line.captured,
            line.escaped,
            line.photon_orbit,
            line.step_limit,
            line.wrong_fates,
            line.wrong_crossings,
            line.not_finite,
            100.0 * line.within_estimate as f64 / line.rays.max(1) as f64,
            line.worst_error_over_estimate,
        );
    }
    text
}
