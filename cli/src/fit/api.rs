//! Interface of fits to comparisons: settings as text in, checks and what follows from them without a run out.

use super::data;
use super::parse;
use super::work::Work;
use crate::changed::Changed;
use anyhow::Context;
use kerrlight_render::scene::apply_override;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::{self, FitData, Instrument};
use kerrlight_tomo::representation::Registry;
use std::path::Path;

/// Settings with one `key=value` changed; `representation=grid` is short for representation.kind=grid.
pub fn assigned(text: &str, assignment: &str) -> anyhow::Result<String> {
    let long = match assignment.split_once('=') {
        Some(("representation", kind)) if !kind.trim_start().starts_with('{') => {
            format!("representation.kind={kind}")
        }
        _ => assignment.to_owned(),
    };
    apply_override(text, &long).with_context(|| format!("--set {assignment}"))
}

/// Checks that settings make sense, as far as can be told without tracing rays.
pub fn check(changed: &Changed<'_>, registry: &Registry) -> anyhow::Result<()> {
    match Work::read_changed(changed)? {
        Work::Emission(file) => Ok(setup::check(&file, registry)?),
        Work::Image(_) => Ok(()),
    }
}

/// Radius of the horizon, and of the region of recovery, M.
pub fn sizes(text: &str) -> anyhow::Result<(f64, f64)> {
    let file = parse(text)?;
    Ok((kerrlight_geodesic::Kerr::new(file.hole.spin.value())?.horizon(), file.region.r_max))
}

/// Angle (radians) by which matter at a radius (M) has turned since the reference time when the part `later` of the
/// movie has passed: as a fit assumes it, and as its data were simulated.
pub fn turned(text: &str, later: f64) -> anyhow::Result<[impl Fn(f64) -> f64; 2]> {
    let file = parse(text)?;
    let angle = |of: &FitFile| -> anyhow::Result<_> {
        let [from, to] = of.span_of_images().context("data are no movie")?;
        let motion = setup::motion(of, Vec::new())?;
        let time = from + later * (to - from) - motion.reference;
        Ok(move |r| motion.velocity.rate(r) * time)
    };
    Ok([angle(&file)?, angle(&file.simulated()?)?])
}

/// (u, v) of the data, wavelengths; none without visibilities.
pub fn coverage(text: &str, base_dir: &Path) -> anyhow::Result<Vec<[f64; 2]>> {
    let FitData { visibilities, .. } = match Work::read(text)? {
        Work::Emission(file) => data::measure(&file, &Instrument::new(&file)?, base_dir)?,
        Work::Image(file) => data::of_static(&file, base_dir)?.0,
    };
    let rows = visibilities.into_iter().flat_map(|(observation, _)| observation.rows);
    Ok(rows.map(|row| row.uv).collect())
}

/// (r, angular velocity) that a fit assumes, and that its data were simulated with.
pub fn velocities(text: &str) -> anyhow::Result<[Vec<[f64; 2]>; 2]> {
    let file = parse(text)?;
    let curve = |of: &FitFile| -> anyhow::Result<Vec<[f64; 2]>> {
        let velocity = setup::motion(of, Vec::new())?.velocity;
        let (low, high) = (file.region.r_min, file.region.r_max);
        // A region may reach the centre, where r^(−3/2) has no value.
        let radius = |k: usize| (low + (high - low) * k as f64 / 99.0).max(1e-3);
        Ok((0..100).map(|k| [radius(k), velocity.rate(radius(k))]).collect())
    };
    Ok([curve(&file)?, curve(&file.simulated()?)?])
}
