//! Simulated observations: the schedule of the array, and corruptions of the data.

use super::Result;
use super::leakage::observing;
use super::polarized::is_polarized;
use crate::fit::settings::{
    FitError, FitFile, Loss, Noise, Observation as Observable, Within, refuse,
};
use kerrlight_vlbi::array::Array;
use kerrlight_vlbi::earth::{Frame, Ut1};
use kerrlight_vlbi::gains::GainTable;
use kerrlight_vlbi::noise::{add_thermal_noise, apply_gains, apply_leakage};
use kerrlight_vlbi::observation::{Basis, Observation};
use kerrlight_vlbi::polarimetry::LeakageTable;
use kerrlight_vlbi::schedule::{self, Clock, Schedule, Setup};
use kerrlight_vlbi::source::Source;

/// Rows of the observation without values, and hours of UTC of its scans.
pub(super) fn schedule_of(
    seen: &Observable,
    array: Option<&Array>,
) -> Result<(Observation, Vec<f64>)> {
    let source: Source = seen
        .source
        .parse()
        .map_err(|error| FitError::Conflict(format!("observation.source: {error}")))?;
    let (clock, [start_h, stop_h]) = clock(seen)?;
    let schedule = Schedule { mjd: seen.mjd, clock, start_h, stop_h, scans: seen.scans };
    let setup = Setup {
        frequency_hz: seen.frequency_ghz * 1e9,
        bandwidth_hz: seen.bandwidth_ghz * 1e9,
        integration_s: seen.integration_s,
        elevation_deg: seen.elevation_deg,
        ut1: Ut1::Table,
        frame: Frame::Catalogue,
    };
    let missing =
        || FitError::missing("simulation.observation.array", "an observation needs its stations");
    let array = array.ok_or_else(missing)?;
    let mut observation = schedule::observe_affordable(array, source.position, &schedule, &setup)
        .within("observation")?;
    observation.source = source.name;
    Ok((observation, schedule.hours_utc(setup.ut1).within("observation")?))
}

/// The clock of the observation and its hours.
fn clock(seen: &Observable) -> Result<(Clock, [f64; 2])> {
    match (seen.utc, seen.gmst) {
        (Some(hours), None) => Ok((Clock::Utc, hours)),
        (None, Some(hours)) => Ok((Clock::Gmst, hours)),
        (Some(_), Some(_)) => refuse!(
            "simulation.observation.gmst is not allowed together with simulation.observation.utc"
        ),
        (None, None) => Err(FitError::missing(
            "simulation.observation.utc",
            "give `utc = [FROM, TO]`, hours of UTC of the first scan and of one after the last, or `gmst = [FROM, TO]`, \
             the same in sidereal time, in [observation]",
        ).into()),
    }
}

/// Corruptions of simulated data.
#[derive(Default)]
pub(super) struct Spoiled {
    pub gains: Option<GainTable>,
    pub leakage: Option<LeakageTable>,
}

/// Leakage, errors of gains, thermal noise and systematic errors, in the order of light's way.
pub(super) fn spoil(
    file: &FitFile,
    fit: &FitFile,
    seen: &Observable,
    observation: &mut Observation,
) -> Result<Spoiled> {
    let gains = seen.gains.as_ref();
    if let Some(name) = gains.and_then(|gains| gains.unknown_station(observation)) {
        refuse!("simulation.observation.gains.stations.{name}: {} has no such station", seen.array);
    }
    let drawn = seen.leakage.map(|amplitude| apply_leakage(observation, amplitude, file.seed));
    let observes = observing(observation);
    let leakage = drawn.transpose().within("simulation.observation.leakage")?.map(|leakage| {
        let exact = vec![[0.0; 2]; leakage.len()];
        LeakageTable::new(&observation.stations, &leakage, &exact, |k| observes[k])
    });
    let gains = gains.map(|gains| apply_gains(observation, gains, file.seed));
    if seen.noise == Noise::Thermal {
        add_thermal_noise(observation, file.seed);
    }
    if let Some(part) = seen.systematic {
        add_systematic("simulation.observation.systematic", part, observation, &fit.loss)?;
    }
    Ok(Spoiled { gains, leakage })
}

/// Adds a part of the amplitude of Stokes I to its error in quadrature; of each product to its own where all are fitted.
pub(super) fn add_systematic(
    name: &str,
    part: f64,
    observation: &mut Observation,
    losses: &[Loss],
) -> Result<()> {
    if !(part >= 0.0 && part.is_finite()) {
        return Err(FitError::range(name, part, "0 or above").into());
    }
    let (basis, is_polarized) = (observation.basis, is_polarized(losses));
    for row in &mut observation.rows {
        if is_polarized {
            for (sigma, product) in row.noise_sigma.iter_mut().zip(row.products) {
                *sigma = sigma.hypot(part * product.norm());
            }
            continue;
        }
        let Some(i) = row.stokes_i(basis) else { continue };
        // The mean of both hands has 1/√2 of the error of each.
        let hands = if basis == Basis::Circular { 2 } else { 1 };
        let hands: Vec<usize> = (0..hands).filter(|k| row.measured(*k).is_some()).collect();
        let of_hand = part * i.visibility.norm() * (hands.len() as f64).sqrt();
        hands.iter().for_each(|k| row.noise_sigma[*k] = row.noise_sigma[*k].hypot(of_hand));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::settings::LossKind;
    use kerrlight_vlbi::Complex64;
    use kerrlight_vlbi::observation::{Measured, Row};

    /// 0.24 of 5 Jy and 0.5 Jy in quadrature are 1.3 Jy: of what is fitted, of Stokes I from both hands too.
    #[test]
    fn exact_systematic_errors() {
        let products = [Complex64::new(3.0, 4.0); 4];
        let i = Measured { visibility: products[0], noise_sigma: 0.5 };
        let row = Row::total_intensity(4.0, [0, 1], [1e9, 0.0], i);
        let added = |kind, basis, noise_sigma| {
            let mut observation = Observation::empty(basis);
            observation.rows = vec![Row { products, noise_sigma, ..row }];
            add_systematic("systematic", 0.24, &mut observation, &[Loss::new(kind)]).unwrap();
            observation.rows[0]
        };
        let half = 0.5f64.sqrt();
        for (basis, sigma) in [(Basis::Stokes, 0.5), (Basis::Circular, half)] {
            let row = added(LossKind::Visibilities, basis, [sigma; 4]);
            assert!((row.stokes_i(basis).unwrap().noise_sigma - 1.3).abs() < 1e-14, "{row:?}");
        }
        let of_all = added(LossKind::PolarizedVisibilities, Basis::Circular, [0.5; 4]).noise_sigma;
        assert!(of_all.iter().all(|sigma| (sigma - 1.3).abs() < 1e-14), "{of_all:?}");
    }
}
