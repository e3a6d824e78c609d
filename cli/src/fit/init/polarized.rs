//! Settings of the polarisation of a static image, guessed from visibilities.

use super::template::digits;
use kerrlight_tomo::fit::verdict::CHANCE;
use kerrlight_vlbi::light_curve::LightCurve;
use kerrlight_vlbi::observation::{Basis, Observation};

/// Tables of a static image that polarised data add.
#[derive(Default)]
pub struct Tables {
    /// `[instrument.leakage]`, where it is to be solved for.
    pub leakage: String,
    /// `[polarization]`.
    pub polarization: String,
}

impl Tables {
    /// Returns the tables for these data; empty where RL and LR are no more than noise. Files whose name says that leakage was
    /// taken out (`dtermcal`) and Stokes parameters are compared by ratios; of others leakage is solved for. `varies` says
    /// whether the source does.
    pub fn of(observation: &Observation, file: &str, varies: bool, folds: usize) -> Self {
        if !is_polarized(observation) {
            return Self::default();
        }
        let calibrated = file.to_ascii_lowercase().contains("dterm");
        let by_ratios = calibrated || observation.basis == Basis::Stokes;
        let (data, leakage) = match by_ratios {
            true => (
                "data = \"polarimetric-ratios\"\nleast_snr = 3.0 #! weaker baselines tell nothing\nleakage_left = 0.01 #! what \
                 calibration of leakage leaves of it: a per cent",
                String::new(),
            ),
            false => (
                "data = \"polarized-visibilities\"\nleakage_left = 0.0",
                "[instrument.leakage]\namplitude = 0.05 #! nothing says that leakage was taken out of these data: 5 % are expected\nrounds = 8"
                    .to_owned(),
            ),
        };
        let scatter = if varies { scatter(observation) } else { None };
        let variability = scatter.map_or(String::new(), |jy| {
            format!(
                "variability = {{ jy = {}, uv = 2e9, power = 1.25 }} #! the standard deviation of Q and U on the baselines within a site, and as total intensity with the length of baselines\n",
                digits(jy)
            )
        });
        let strength = match folds {
            0 | 1 => String::new(),
            folds => format!(
                "\nstrength = {{ values = [0.01, 0.1, 1.0, 10.0, 100.0], folds = {folds} }}"
            ),
        };
        let polarization = format!(
            "[polarization]\n{data}\n{variability}smoothness = 0.01\niterations = 1000\nbeam_uas = 20.0 #! as published images of \
             M87* and Sgr A* are seen{strength}"
        );
        Self { leakage, polarization }
    }
}

/// Returns whether RL and LR, or Q and U, are more than noise: χ² of none is above what chance makes of it.
fn is_polarized(observation: &Observation) -> bool {
    let crossed = match observation.basis {
        Basis::Circular => [2, 3],
        Basis::Stokes => [1, 2],
    };
    let (mut chi2, mut count) = (0.0, 0.0f64);
    for row in &observation.rows {
        for datum in crossed.into_iter().filter_map(|k| row.measured(k)) {
            if datum.noise_sigma <= 0.0 {
                continue;
            }
            chi2 += datum.visibility.norm_sqr() / datum.noise_sigma.powi(2);
            // |V|²/σ² has the squares of a real and an imaginary part.
            count += 2.0;
        }
    }
    // χ² of n data scatters by √(2n).
    chi2 > count + CHANCE * (2.0 * count).sqrt()
}

/// Root mean square of the standard deviations of Q and U on the baselines within a site, Jy; none where there are too few.
fn scatter(observation: &Observation) -> Option<f64> {
    // Real parts of phases that are not calibrated scatter without any change of the source.
    if LightCurve::incoherent_part(observation).is_some() {
        return None;
    }
    let curve = LightCurve::of_sites(observation);
    let of = |stokes: usize| {
        let values = curve.samples.iter().filter_map(|sample| Some(sample.stokes[stokes]?.jy));
        let values: Vec<f64> = values.filter(|x| x.is_finite()).collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let square: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
        (values.len() > FEWEST).then(|| square / (count - 1.0))
    };
    let jy = (0.5 * (of(1)? + of(2)?)).sqrt();
    (jy > 0.0).then_some(jy)
}

/// A scatter of so few samples says nothing.
const FEWEST: usize = 9;
