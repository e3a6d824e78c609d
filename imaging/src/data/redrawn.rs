//! Simulated measurements of a static image with other noise.

use crate::Error;
use kerrlight_tomo::fit::settings::Loss;
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::operator::{Method, Operator, Transform};

/// Simulates the measurement of a static image, with the gains that explain the data best beside it and with other
/// noise. Data without visibilities stay as they are.
///
/// # Errors
/// If data make no term.
pub fn redrawn(
    measured: &FitData,
    losses: &[Loss],
    image: &[f64],
    seed: u64,
) -> Result<FitData, Error> {
    let mut copy = measured.without_truth();
    let (Some((observation, _)), Some(sky)) = (&mut copy.visibilities, measured.sky) else {
        return Ok(copy);
    };
    let uv: Vec<[f64; 2]> = observation.stokes_i().map(|(row, _)| row.uv).collect();
    let transform = Transform::<f64>::new(sky, measured.pulse, &[uv], Method::Direct, 0)?;
    let mut model = vec![Complex64::default(); transform.data()];
    transform.forward(image, &mut model);
    let gains = measured.gains(losses, &model)?.unwrap_or_default();
    let gains = gains.by_station();
    let basis = observation.basis;
    let names: Vec<String> = observation.stations.iter().map(|s| s.name.clone()).collect();
    let seen = observation.rows.iter_mut().filter(|row| row.stokes_i(basis).is_some());
    for (row, v) in seen.zip(model) {
        let [first, second] = row
            .stations
            .map(|k| gains.at(&names[usize::from(k)], row.time_h).unwrap_or(1.0.into()));
        // Both parallel hands; in a basis of Stokes parameters the second has no part in I.
        let v = v * first * second.conj();
        (row.products[0], row.products[1]) = (v, v);
    }
    add_thermal_noise(observation, seed);
    Ok(copy)
}
