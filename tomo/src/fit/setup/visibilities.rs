//! Measured visibilities, as a fit takes them.

use super::Result;
use crate::fit::settings::refuse;
use kerrlight_vlbi::observation::{Flags, Observation, Row};

/// What a fit does with the rows of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisibilitySettings {
    /// Rows of an interval of this many seconds are averaged; 0 keeps all.
    pub average_s: f64,
    /// Baselines shorter than this many wavelengths are left out.
    pub uv_min: Option<f64>,
}

/// Stokes I of an observation, averaged, in order of time.
///
/// # Errors
/// If a visibility has no error, or none is left.
pub fn prepared(observation: Observation, settings: &VisibilitySettings) -> Result<Observation> {
    let mut observation = averaged(observation, settings)?.total_intensity();
    observation.sort();
    Ok(observation)
}

/// The same with all products, those of rows without parallel hands too.
///
/// # Errors
/// As [`prepared`].
pub(super) fn all_products(
    observation: Observation,
    settings: &VisibilitySettings,
) -> Result<Observation> {
    let mut observation = averaged(observation, settings)?;
    observation.sort();
    Ok(observation)
}

fn averaged(observation: Observation, settings: &VisibilitySettings) -> Result<Observation> {
    check_errors(&observation)?;
    let observation = long_enough(observation, settings.uv_min)?;
    Ok(match settings.average_s > 0.0 {
        true => observation.averaged_in_scans(settings.average_s),
        false => observation,
    })
}

fn long_enough(observation: Observation, uv_min: Option<f64>) -> Result<Observation> {
    let flags = Flags { shorter_than: uv_min, ..Flags::default() };
    let kept = flags.apply(&observation).observation;
    let has_any = |data: &Observation| data.stokes_i().next().is_some();
    match uv_min {
        _ if has_any(&kept) => Ok(kept),
        Some(least) if has_any(&observation) => {
            refuse!("data.visibilities.uv_min = {least} leaves no visibilities")
        }
        _ => refuse!("there are no visibilities of Stokes I"),
    }
}

/// A visibility without an error would count for more than all others together. Products that do not
/// enter Stokes I may have any.
fn check_errors(observation: &Observation) -> Result<()> {
    let is_exact = |row: &&Row| {
        let parts = row.parts_of_i(observation.basis);
        parts.iter().flatten().any(|part| part.noise_sigma <= 0.0)
    };
    let Some(row) = observation.rows.iter().find(is_exact) else { return Ok(()) };
    let [a, b] = observation.names(row);
    refuse!("visibility of {a}-{b} at {:.6} h: sigma = 0 Jy is not allowed: above 0", row.time_h)
}

/// Times closer than this many seconds are one.
const SAME_S: f64 = 0.5;

/// Hours of the frames and the frame of every row; rows of a frame get its time, so that closure
/// quantities find each other.
pub fn frames_of(observation: &mut Observation) -> (Vec<f64>, Vec<usize>) {
    let mut hours: Vec<f64> = Vec::new();
    let mut of_rows = Vec::with_capacity(observation.rows.len());
    for row in &mut observation.rows {
        match hours.last() {
            Some(last) if (row.time_h - last) * 3600.0 < SAME_S => row.time_h = *last,
            _ => hours.push(row.time_h),
        }
        of_rows.push(hours.len() - 1);
    }
    (hours, of_rows)
}
