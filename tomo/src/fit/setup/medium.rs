//! Corrections of measured visibilities besides errors of calibration: the scattering that the light has passed, and
//! errors for the variability of the source.

use super::Result;
use super::polarized::is_polarized;
use crate::fit::settings::{Loss, Scattering, Variability, Within, refuse};
use kerrlight_vlbi::noise::{ScatteringKernel, unscatter};
use kerrlight_vlbi::observation::Observation;

/// Undoes scattering, then adds to errors what the source varies. `name` is what the data are called in messages.
///
/// # Errors
/// If the kernel of scattering needs a frequency that is not known, or errors of all products would need the
/// variability of polarised light.
pub(super) fn correct(
    observation: &mut Observation,
    losses: &[Loss],
    scattering: Option<Scattering>,
    variability: Option<Variability>,
    name: &str,
) -> Result<()> {
    if scattering == Some(Scattering::SgrA) {
        unscatter(observation, &ScatteringKernel::sgr_a()).within(name)?;
    }
    // That of the source itself, which scattering has not dimmed.
    let Some(variability) = variability else { return Ok(()) };
    if is_polarized(losses) {
        refuse!(
            "data.visibilities.variability is that of total intensity: it is not for polarized-visibilities or \
             polarimetric-ratios"
        );
    }
    // Rows of total intensity have one product, the first.
    for row in &mut observation.rows {
        let sigma = variability.sigma(row.uv[0].hypot(row.uv[1]));
        row.noise_sigma[0] = row.noise_sigma[0].hypot(sigma);
    }
    Ok(())
}
