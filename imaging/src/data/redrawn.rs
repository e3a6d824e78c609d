//! Simulated measurements of a static image with other noise.

use crate::Error;
use kerrlight_tomo::fit::settings::Loss;
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::gains::{GainPriors, GainTable, GainsByStation};
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::observation::{Observation, Row};
use kerrlight_vlbi::operator::{Method, Operator, Transform};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Simulates the measurement of a static image with other noise, and with other amplitudes of gains as their priors say. Phases of gains,
/// where they are solved for, are those that explain the data best beside the image. Data without visibilities stay as they are.
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
    let basis = observation.basis;
    let names: Vec<String> = observation.stations.iter().map(|s| s.name.clone()).collect();
    let by_station = gains.by_station();
    let seen = observation.rows.iter_mut().filter(|row| row.stokes_i(basis).is_some());
    for (row, v) in seen.zip(model) {
        // Both parallel hands; in a basis of Stokes parameters the second has no part in I.
        let v = v * factor(row, &by_station, &names);
        (row.products[0], row.products[1]) = (v, v);
    }
    add_thermal_noise(observation, seed);
    if let Some(priors) = &measured.gains {
        let others = other_amplitudes(&gains, priors, &names, seed);
        multiply(observation, &others, &names);
    }
    Ok(copy)
}

/// What gains make of the visibility of a row.
fn factor(row: &Row, gains: &GainsByStation<'_>, names: &[String]) -> Complex64 {
    let [first, second] =
        row.stations.map(|k| gains.at(&names[usize::from(k)], row.time_h).unwrap_or(1.0.into()));
    first * second.conj()
}

/// Makes the random numbers of gains other than those of noise.
const GAINS: u64 = 0x6761_696e;

/// What turns amplitudes of gains into others that their priors say.
fn other_amplitudes(
    gains: &GainTable,
    priors: &GainPriors,
    names: &[String],
    seed: u64,
) -> GainTable {
    let mut others = gains.clone();
    let mut random = Pcg64::seed_from_u64(seed ^ GAINS);
    for gain in &mut others.gains {
        let station = names.iter().position(|name| *name == gain.station);
        let sigma = station.map_or(0.0, |k| priors.amplitude_sigma[k]);
        let off: f64 = random.sample(StandardNormal);
        // In place of the fitted amplitude: fitted ones are pulled to 1 and scatter too little, and
        // a draw on top of them would have twice the prior's variance.
        gain.gain = ((sigma * off).exp() / gain.gain.norm()).into();
    }
    others
}

/// Multiplies data and their errors, so that what noise hides stays hidden.
fn multiply(observation: &mut Observation, gains: &GainTable, names: &[String]) {
    let gains = gains.by_station();
    for row in &mut observation.rows {
        let factor = factor(row, &gains, names);
        row.products.iter_mut().for_each(|product| *product *= factor);
        row.noise_sigma.iter_mut().for_each(|sigma| *sigma *= factor.norm());
    }
}
