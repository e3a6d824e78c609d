//! Words on the medium that light has passed and on the variability of the source.

use kerrlight_tomo::fit::settings::{Scattering, Variability};

/// Describes the assumptions on both.
pub fn sentences(scattering: Option<Scattering>, variability: Option<Variability>) -> Vec<String> {
    let scattered = scattering.map(|Scattering::SgrA| {
        "Diffractive scattering towards Sgr A* (Johnson et al. 2018) is part of the model: visibilities and errors were divided by its kernel, so that amplitudes below are those of the source behind the screen. Refraction is left out."
            .to_owned()
    });
    let has_intrinsic_variability = variability.map(|law| {
        format!(
            "The source varies: {} Jy/(1 + (|u|/{:e})²)^{} was added to all errors in quadrature. χ² is that of data with these \
             errors.",
            law.jy,
            law.uv,
            0.5 * law.power
        )
    });
    scattered.into_iter().chain(has_intrinsic_variability).collect()
}
