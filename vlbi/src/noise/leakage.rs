//! Leakage between the feeds of stations.

use super::generator;
use crate::Complex64;
use crate::Error;
use crate::observation::{Basis, Observation};
use crate::polarimetry::{Leakage, jones, leaked, turns};
use rand::RngExt;
use rand_distr::StandardNormal;

/// Draws d_R and d_L of every station, constant over the observation, real and imaginary parts normal with
/// |d|² = `amplitude`² in the mean, and applies them to RR, LL, RL and LR, whose rotation of feeds has been taken out.
///
/// # Errors
/// If the products are Stokes parameters, or the observation does not hold what the rotation of feeds follows from.
pub fn apply_leakage(
    observation: &mut Observation,
    amplitude: f64,
    seed: u64,
) -> Result<Leakage, Error> {
    if observation.basis != Basis::Circular {
        let allowed = "products of circular feeds, which Stokes parameters are not";
        return Err(Error::out_of_range("leakage", amplitude, allowed));
    }
    let mut random = generator(seed, 5);
    let mut draw = || {
        let parts = [0, 1].map(|_| random.sample::<f64, _>(StandardNormal));
        Complex64::new(parts[0], parts[1]) * (amplitude * core::f64::consts::FRAC_1_SQRT_2)
    };
    let leakage: Leakage = observation.stations.iter().map(|_| [draw(), draw()]).collect();
    let turns = turns(observation)?;
    for (row, turns) in observation.rows.iter_mut().zip(turns) {
        let [rr, ll, rl, lr] = row.products;
        let [first, second] =
            [0, 1].map(|k| jones(leakage[usize::from(row.stations[k])], turns[k]));
        row.products = leaked(&[[rr, rl], [lr, ll]], &first, &second);
    }
    Ok(leakage)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Station;
    use crate::earth::SourcePosition;

    /// Mean squares of 20,000 draws, within five standard errors: of |d|, and of its real part.
    #[test]
    fn exact_moments() {
        let mut observation = Observation::empty(Basis::Circular);
        observation.stations = ["A", "B"].map(Station::named).to_vec();
        (observation.position, observation.mjd) = (Some(SourcePosition::SGR_A), Some(57850));
        let draw = |seed| apply_leakage(&mut observation, 0.1, seed).unwrap().concat();
        let all: Vec<Complex64> = (0..5000).flat_map(draw).collect();
        assert_eq!(all.len(), 20_000);
        let mean = |f: fn(&Complex64) -> f64| all.iter().map(f).sum::<f64>() / 20_000.0;
        let error = 5.0 / 20_000f64.sqrt();
        assert!((mean(Complex64::norm_sqr) / 0.01 - 1.0).abs() < error);
        assert!((mean(|d| d.re * d.re) / 0.005 - 1.0).abs() < error * 2.0f64.sqrt());
        assert!(mean(|d| d.re).abs() < 0.1 * error && mean(|d| d.im).abs() < 0.1 * error);
    }
}
