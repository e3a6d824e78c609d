//! Light curves: the flux of an unresolved source over time, in Stokes parameters.
//!
//! Position angles are those of `kerrlight_render::polarization`: of the electric vector, from north towards east, Q = P cos 2χ,
//! U = P sin 2χ (IAU 1973). Circular feeds measure RR = I + V, LL = I − V, RL = Q + iU, LR = Q − iU.

use super::array::Station;
use super::observation::{Basis, Measured, Observation, Row};
use kerrlight_common::stokes::StokesParameter;

/// A flux density, Jy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flux {
    /// Its value, Jy.
    pub jy: f64,
    /// Its standard deviation, Jy, where it is known.
    pub sigma_jy: Option<f64>,
}

/// Measurement at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// Hours of UTC.
    pub time_h: f64,
    /// I, Q, U and V, those that were measured.
    pub stokes: [Option<Flux>; 4],
    /// Name of the instrument, such as a baseline; may be empty.
    pub by: String,
}

impl Sample {
    /// Returns whether any parameter was measured.
    pub fn has_flux(&self) -> bool {
        self.stokes.iter().any(Option::is_some)
    }
}

/// Fluxes in the order of their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightCurve {
    /// Measurements.
    pub samples: Vec<Sample>,
}

/// Part of the power on baselines within a site that may be imaginary.
const INCOHERENT: f64 = 0.05;
/// Standard deviations of the power of noise that are chance.
const BY_CHANCE: f64 = 3.0;
/// Baselines shorter than this many metres are within a site.
pub const SITE_M: f64 = 10e3;
/// The same in wavelengths, where no one tells where the stations are: 10 km at 1.3 mm.
pub const SITE_WAVELENGTHS: f64 = 8e6;

impl LightCurve {
    /// Returns the light curve of the baselines within a site (ALMA–APEX, JCMT–SMA) for a source that they do not resolve: the
    /// real parts of I = (RR + LL)/2, Q = (RL + LR)/2, U = (RL − LR)/2i and V = (RR − LL)/2, row by row.
    pub fn of_sites(observation: &Observation) -> Self {
        let near = |row: &&Row| is_within_site(observation, row);
        let sample = |row: &Row| {
            let by = observation.names(row).join("-");
            Sample { time_h: row.time_h, stokes: stokes(row, observation.basis), by }
        };
        let mut samples: Vec<Sample> = observation.rows.iter().filter(near).map(sample).collect();
        // Files of Stokes I alone have it twice: their V is no measurement.
        if samples.iter().all(|sample| sample.stokes[3].is_none_or(|v| v.jy == 0.0)) {
            samples.iter_mut().for_each(|sample| sample.stokes[3] = None);
        }
        // Stations of one hand measure no Stokes parameter.
        samples.retain(Sample::has_flux);
        samples.sort_by(|a, b| a.time_h.total_cmp(&b.time_h));
        Self { samples }
    }

    /// Returns the imaginary part of the power of I on the baselines within a site, as a share of all, where it is above 5 %: next to
    /// nothing for an unresolved source in the middle of the field, a half where phases are not calibrated.
    pub fn incoherent_part(observation: &Observation) -> Option<f64> {
        let near = observation.stokes_i().filter(|(row, _)| is_within_site(observation, row));
        let (mut imaginary, mut all, mut scatter) = (0.0, 0.0, 0.0);
        for (_, i) in near {
            // Noise is in both parts, and would be most of what is weak.
            let noise = if i.noise_sigma > 0.0 { i.noise_sigma.powi(2) } else { 0.0 };
            imaginary += i.visibility.im.powi(2) - noise;
            all += i.visibility.norm_sqr() - 2.0 * noise;
            scatter += 2.0 * noise.powi(2);
        }
        let is_beyond = all > 0.0 && imaginary > INCOHERENT * all + BY_CHANCE * scatter.sqrt();
        is_beyond.then(|| imaginary / all)
    }

    /// Samples from the first to the second hour.
    #[must_use]
    pub fn cropped(mut self, [from, to]: [f64; 2]) -> Self {
        self.samples.retain(|sample| (from..=to).contains(&sample.time_h));
        self
    }

    /// Means of so many samples at a time, by 1/σ² where all have errors; the last has the rest. Those without a parameter have no
    /// part in its mean.
    #[must_use]
    pub fn averaged(self, count: usize) -> Self {
        Self { samples: self.samples.chunks(count.max(1)).map(mean).collect() }
    }

    /// Means over so many seconds: a sample begins a new one where it is as much as that later than the first of the last.
    /// Gaps are never bridged by more.
    #[must_use]
    pub fn averaged_over(self, seconds: f64) -> Self {
        let mut bins: Vec<Vec<Sample>> = Vec::new();
        for sample in self.samples {
            // Times of files are rounded: a millisecond early is in time.
            let joins =
                |bin: &&mut Vec<Sample>| (sample.time_h - bin[0].time_h) * 3600.0 < seconds - 1e-3;
            match bins.last_mut().filter(joins) {
                Some(bin) => bin.push(sample),
                None => bins.push(vec![sample]),
            }
        }
        Self { samples: bins.iter().map(|bin| mean(bin)).collect() }
    }

    /// Drops samples that are later than so many seconds after the one before.
    #[must_use]
    pub fn without_gaps(self, most_s: f64) -> Self {
        let late = |k: usize| {
            let times = [k - 1, k].map(|k| self.samples[k].time_h);
            (times[1] - times[0]) * 3600.0 > most_s
        };
        let kept = (0..self.samples.len()).filter(|k| *k == 0 || !late(*k));
        Self { samples: kept.map(|k| self.samples[k].clone()).collect() }
    }

    /// Less what is steady: I, Q, U and V, Jy.
    #[must_use]
    pub fn less(mut self, steady: [f64; 4]) -> Self {
        for sample in &mut self.samples {
            for (flux, steady) in sample.stokes.iter_mut().zip(steady) {
                *flux = flux.map(|flux| Flux { jy: flux.jy - steady, ..flux });
            }
        }
        self
    }

    /// Adds `degrees` (east of north) to position angles: Q + iU times e^{2iχ}, as for Faraday rotation that is taken back.
    /// Samples with one of Q and U lose it.
    #[must_use]
    pub fn turned(mut self, degrees: f64) -> Self {
        let (sin, cos) = (2.0 * degrees.to_radians()).sin_cos();
        for sample in &mut self.samples {
            let [_, q, u, _] = &mut sample.stokes;
            (*q, *u) = match (*q, *u) {
                (Some(a), Some(b)) => (Some(mixed(a, cos, b, -sin)), Some(mixed(a, sin, b, cos))),
                _ => (None, None),
            };
        }
        self
    }

    /// Sets the same standard deviations (Jy) at all times of the parameters that have one here.
    #[must_use]
    pub fn with_sigmas(mut self, sigmas: [Option<f64>; 4]) -> Self {
        for sample in &mut self.samples {
            for (flux, sigma) in sample.stokes.iter_mut().zip(sigmas) {
                *flux = flux.map(|flux| Flux { sigma_jy: sigma.or(flux.sigma_jy), ..flux });
            }
        }
        self
    }

    /// Sets this I (Jy) at all times, with this error, or without one with that of the I that was there.
    #[must_use]
    pub fn with_intensity(mut self, jy: f64, sigma_jy: Option<f64>) -> Self {
        for sample in &mut self.samples {
            let sigma_jy = sigma_jy.or_else(|| sample.stokes[0].and_then(|flux| flux.sigma_jy));
            sample.stokes[0] = Some(Flux { jy, sigma_jy });
        }
        self
    }

    /// Returns whether all samples have a parameter.
    pub fn has(&self, parameter: StokesParameter) -> bool {
        self.samples.iter().all(|sample| sample.stokes[parameter.index()].is_some())
    }
}

/// a x + b y of independent fluxes.
fn mixed(x: Flux, a: f64, y: Flux, b: f64) -> Flux {
    let sigma = |(x, y): (f64, f64)| (a * x).hypot(b * y);
    Flux { jy: a * x.jy + b * y.jy, sigma_jy: x.sigma_jy.zip(y.sigma_jy).map(sigma) }
}

/// Weights of fluxes in their mean: 1/σ² where all have errors.
fn weights(all: &[Flux]) -> Vec<f64> {
    let sigmas: Option<Vec<f64>> = all.iter().map(|flux| flux.sigma_jy).collect();
    let weights: Vec<f64> = match sigmas.filter(|all| all.iter().all(|sigma| *sigma > 0.0)) {
        Some(sigmas) => sigmas.iter().map(|sigma| sigma.powi(-2)).collect(),
        None => vec![1.0; all.len()],
    };
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// The mean of some samples, whose time is that of their fluxes.
fn mean(samples: &[Sample]) -> Sample {
    let mut shares = vec![0.0; samples.len()];
    let mut of = |k: usize| -> Option<Flux> {
        let has = |sample: &Sample| sample.stokes[k];
        let all: Vec<Flux> = samples.iter().filter_map(has).collect();
        let weights = weights(&all);
        let places = (0..samples.len()).filter(|place| samples[*place].stokes[k].is_some());
        places.zip(&weights).for_each(|(place, weight)| shares[place] += weight);
        let jy = all.iter().zip(&weights).map(|(flux, w)| w * flux.jy).sum::<f64>();
        let sigmas: Option<Vec<f64>> = all.iter().map(|flux| flux.sigma_jy).collect();
        let of_mean = |sigmas: Vec<f64>| {
            sigmas.iter().zip(&weights).map(|(s, w)| (s * w).powi(2)).sum::<f64>().sqrt()
        };
        (!all.is_empty()).then(|| Flux { jy, sigma_jy: sigmas.map(of_mean) })
    };
    let stokes = [of(0), of(1), of(2), of(3)];
    if shares.iter().all(|share| *share == 0.0) {
        shares.fill(1.0);
    }
    let same = samples.iter().all(|sample| sample.by == samples[0].by);
    let times = samples.iter().zip(&shares).map(|(sample, share)| share * sample.time_h);
    Sample {
        time_h: times.sum::<f64>() / shares.iter().sum::<f64>(),
        stokes,
        by: if same { samples[0].by.clone() } else { String::new() },
    }
}

fn is_within_site(observation: &Observation, row: &Row) -> bool {
    let place = |k: u16| observation.stations.get(usize::from(k)).and_then(position);
    match row.stations.map(place) {
        [Some(a), Some(b)] => kerrlight_geodesic::vector::distance(a, b) < SITE_M,
        _ => row.uv[0].hypot(row.uv[1]) < SITE_WAVELENGTHS,
    }
}

/// Files that do not tell where a station is may have zeros.
fn position(station: &Station) -> Option<[f64; 3]> {
    station.position.filter(|place| place.iter().any(|x| x.abs() > 1.0))
}

fn stokes(row: &Row, basis: Basis) -> [Option<Flux>; 4] {
    let of = |k: usize| row.product(k).filter(|product| !product.is_unmeasured());
    let real = |product: Measured| Flux {
        jy: product.visibility.re,
        sigma_jy: (product.noise_sigma > 0.0).then_some(product.noise_sigma),
    };
    if basis == Basis::Stokes {
        return [0, 1, 2, 3].map(|k| of(k).map(real));
    }
    let half = |a: f64, b: f64, x: Measured, y: Measured| Flux {
        jy: 0.5 * (a + b),
        sigma_jy: Some(0.5 * x.noise_sigma.hypot(y.noise_sigma)).filter(|sigma| *sigma > 0.0),
    };
    let parallel = of(0).zip(of(1));
    let crossed = of(2).zip(of(3));
    [
        parallel.map(|(r, l)| half(r.visibility.re, l.visibility.re, r, l)),
        crossed.map(|(a, b)| half(a.visibility.re, b.visibility.re, a, b)),
        // U = (RL − LR)/2i: of a real U the imaginary parts.
        crossed.map(|(a, b)| half(a.visibility.im, -b.visibility.im, a, b)),
        parallel.map(|(r, l)| half(r.visibility.re, -l.visibility.re, r, l)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;

    fn sample(time_h: f64, q: f64, u: f64) -> Sample {
        let flux = |jy: f64| Some(Flux { jy, sigma_jy: Some(0.02) });
        Sample { time_h, stokes: [flux(2.0), flux(q), flux(u), None], by: String::new() }
    }

    /// RL = Q + iU, LR = Q − iU, RR = I + V, LL = I − V, of one polarised source.
    #[test]
    fn exact_fluxes_of_circular_feeds() {
        let (i, q, u, v) = (2.5, -0.2, 0.13, 0.01);
        let c = Complex64::new;
        let row = Row {
            products: [c(i + v, 0.0), c(i - v, 0.0), c(q, u), c(q, -u)],
            noise_sigma: [0.3, 0.4, 0.6, 0.8],
            ..Row::empty(4.0, [0, 1], [1e6, 1e6])
        };
        let far = Row { uv: [1e9, 0.0], ..row };
        let mut observation = Observation::empty(Basis::Circular);
        observation.stations = ["AA", "AP"].map(Station::named).to_vec();
        observation.rows = vec![far, row];
        let curve = LightCurve::of_sites(&observation);
        assert_eq!((curve.samples.len(), curve.samples[0].by.as_str()), (1, "AA-AP"));
        for (found, expected) in curve.samples[0].stokes.iter().zip([i, q, u, v]) {
            assert!((found.unwrap().jy - expected).abs() < 1e-15);
        }
        let sigmas = curve.samples[0].stokes.map(|flux| flux.unwrap().sigma_jy.unwrap());
        assert_eq!(sigmas, [0.25, 0.5, 0.5, 0.25]);
        assert_eq!(LightCurve::incoherent_part(&observation), None);
        assert!(observation.is_polarized());
        for turned in &mut observation.rows[1].products {
            *turned *= c(0.6, 0.8);
        }
        // Less the noise in both parts.
        observation.rows[1].noise_sigma = [0.03, 0.04, 0.06, 0.08];
        let noise = 0.025 * 0.025;
        let expected = (0.64 * i * i - noise) / (i * i - 2.0 * noise);
        assert!((LightCurve::incoherent_part(&observation).unwrap() - expected).abs() < 1e-12);
    }

    /// Stokes I as RR and LL has no V.
    #[test]
    fn exact_total_intensity_alone_has_no_circular_polarisation() {
        let c = |re: f64| Measured { visibility: Complex64::new(re, 0.0), noise_sigma: 0.1 };
        let mut observation = Observation::empty(Basis::Circular);
        observation.stations = ["AA", "AP"].map(Station::named).to_vec();
        observation.rows = vec![Row::total_intensity(4.0, [0, 1], [1e6, 1e6], c(2.5))];
        let curve = LightCurve::of_sites(&observation.as_equal_hands());
        assert_eq!(curve.samples[0].stokes[0].unwrap().jy, 2.5);
        assert_eq!(curve.samples[0].stokes[3], None);
        assert!(!observation.is_polarized());
    }

    #[test]
    fn exact_preparation_of_a_curve() {
        let all = (0..9).map(|k| sample(9.0 + 0.01 * f64::from(k), 0.3, f64::from(k)));
        let curve = LightCurve { samples: all.collect() };
        let means = curve.averaged(4);
        assert_eq!(means.samples.len(), 3);
        assert_eq!(means.samples[2].stokes[2].unwrap().sigma_jy, Some(0.02));
        assert!((means.samples[1].stokes[2].unwrap().jy - 5.5).abs() < 1e-14);
        assert!((means.samples[1].time_h - 9.055).abs() < 1e-12);
        assert!((means.samples[0].stokes[1].unwrap().sigma_jy.unwrap() - 0.01).abs() < 1e-15);
        // Samples without a parameter have no part in its mean.
        let mut some = [1.0, 2.0, 3.0].map(|u| sample(9.0, 0.3, u));
        some[1].stokes[2] = None;
        let mean = LightCurve { samples: some.to_vec() }.averaged(3).samples.remove(0);
        assert_eq!(mean.stokes[2].unwrap().jy, 2.0);
        // A sample whose error is 100 times as large has a weight of 1e-4.
        let flux = |jy: f64, sigma: f64| Some(Flux { jy, sigma_jy: Some(sigma) });
        let mut pair = [sample(9.0, 0.3, 0.0), sample(9.0, 0.3, 0.0)];
        (pair[0].stokes[0], pair[1].stokes[0]) = (flux(1.0, 0.01), flux(3.0, 1.0));
        let mean = LightCurve { samples: pair.to_vec() }.averaged(2).samples.remove(0);
        let i = mean.stokes[0].unwrap();
        assert!((i.jy - (1.0 + 3e-4) / 1.0001).abs() < 1e-14);
        assert!((i.sigma_jy.unwrap() - 0.01 / 1.0001f64.sqrt()).abs() < 1e-16);
        let scans = [9.0, 9.003, 9.006, 9.5, 9.503].map(|t| sample(t, 0.3, t));
        let scans = LightCurve { samples: scans.to_vec() }.averaged_over(21.6);
        let times: Vec<f64> = scans.samples.iter().map(|sample| sample.time_h).collect();
        assert_eq!(times.len(), 3, "{times:?}");
        for (found, expected) in times.iter().zip([9.0015, 9.006, 9.5015]) {
            assert!((found - expected).abs() < 1e-12, "{times:?}");
        }
        let late =
            LightCurve { samples: [9.0, 9.02, 9.10, 9.12].map(|t| sample(t, 0.0, 0.0)).to_vec() };
        let times: Vec<f64> = late.without_gaps(100.0).samples.iter().map(|s| s.time_h).collect();
        assert_eq!(times, [9.0, 9.02, 9.12]);
        let turned = LightCurve { samples: vec![sample(1.0, 0.3, 0.1)] }.less([1.0, 0.1, 0.1, 0.0]);
        let turned = turned.turned(45.0).samples.remove(0);
        let jy = turned.stokes.map(|flux| flux.map_or(f64::NAN, |flux| flux.jy));
        assert!((jy[0] - 1.0).abs() < 1e-15 && jy[1].abs() < 1e-15 && (jy[2] - 0.2).abs() < 1e-15);
        let crop = LightCurve { samples: vec![sample(1.0, 0.0, 0.0), sample(2.0, 0.0, 0.0)] };
        assert_eq!(crop.cropped([1.5, 2.0]).samples.len(), 1);
    }
}
