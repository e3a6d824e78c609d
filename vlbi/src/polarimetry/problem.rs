//! The leakage that explains data best beside a model: Σ |G (J₁ ρ J₂†)_pq − D|²/σ² + Σ |d|²/s² is bilinear in the d of two
//! stations. Damped Gauss–Newton steps in the real and imaginary parts of all d minimise it; the first, from d = 0, is the
//! linear problem of small leakage.

use super::Leakage;
use super::jones::{HANDS, coherency, jones, leaked};
use crate::Complex64;
use nalgebra::{DMatrix, DVector};

/// A product of circular feeds beside a model.
#[derive(Debug, Clone, Copy)]
pub struct LeakageDatum {
    /// Both stations.
    pub stations: [usize; 2],
    /// e^{2iφ} of their feeds.
    pub turns: [Complex64; 2],
    /// Index of the product among RR, LL, RL, LR.
    pub product: usize,
    /// Measured value, Jy.
    pub value: Complex64,
    /// 1/σ² of real and imaginary part.
    pub weight: f64,
    /// g₁ ḡ₂ of the baseline.
    pub gain: Complex64,
    /// I, Q and U of the model, Jy.
    pub model: [Complex64; 3],
}

/// Leakage with its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct LeakageSolution {
    /// d_R and d_L of each station.
    pub leakage: Leakage,
    /// Standard deviations of the real part of both, the model taken for granted; of the imaginary part they are about
    /// the same.
    pub errors: Vec<[f64; 2]>,
    /// χ² of data and prior.
    pub value: f64,
}

/// Data of all frames, with what is known of leakage beforehand.
#[derive(Debug, Clone)]
pub struct LeakageProblem {
    /// Number of stations.
    pub stations: usize,
    /// Root mean square of |d| that is expected, above 0.
    pub amplitude: f64,
    /// The data.
    pub data: Vec<LeakageDatum>,
}

/// Steps at most; a handful is the rule.
const STEPS: usize = 40;
/// Steps that promise less than this part of χ² + 1 are the last ones.
const ENOUGH: f64 = 1e-13;

/// Slopes and second derivatives of ½χ² about some leakage.
struct Local {
    slope: DVector<f64>,
    bends: DMatrix<f64>,
}

/// A derivative of a residual: which d (station, hand), the factor, and whether it is of the conjugate of d.
type Part = ([usize; 2], Complex64, bool);

impl LeakageDatum {
    /// G (J₁ ρ J₂†)_pq − D.
    fn residual(&self, leakage: &Leakage) -> Complex64 {
        let [first, second] = [0, 1].map(|k| jones(leakage[self.stations[k]], self.turns[k]));
        self.gain * leaked(&coherency(self.model), &first, &second)[self.product] - self.value
    }

    /// Derivatives with respect to d of the first station, and to d̄ of the second.
    fn parts(&self, leakage: &Leakage) -> [Part; 2] {
        let [p, q] = HANDS[self.product];
        let sky = coherency(self.model);
        let [first, second] = [0, 1].map(|k| jones(leakage[self.stations[k]], self.turns[k]));
        // d_R stands with e^{2iφ}, d_L with its conjugate.
        let turn = |k: usize, hand: usize| match hand {
            0 => self.turns[k],
            _ => self.turns[k].conj(),
        };
        // Of row p of J the other hand holds d, which multiplies row 1 − p of the sky.
        let of_first: Complex64 = (0..2).map(|s| sky[1 - p][s] * second[q][s].conj()).sum();
        let of_second: Complex64 = (0..2).map(|r| first[p][r] * sky[r][1 - q]).sum();
        [
            ([self.stations[0], p], self.gain * turn(0, p) * of_first, false),
            ([self.stations[1], q], self.gain * turn(1, q).conj() * of_second, true),
        ]
    }
}

impl LeakageProblem {
    /// 1/s² of each real number.
    fn precision(&self) -> f64 {
        // ⟨|d|²⟩ = s² is a variance of s²/2 of each of both parts.
        2.0 / (self.amplitude * self.amplitude)
    }

    /// χ² of data and prior.
    pub fn value(&self, leakage: &Leakage) -> f64 {
        let data: f64 = self.data.iter().map(|d| d.weight * d.residual(leakage).norm_sqr()).sum();
        data + self.precision() * leakage.iter().flatten().map(Complex64::norm_sqr).sum::<f64>()
    }

    /// The minimum that steps from `start` reach.
    pub fn solve(&self, start: &Leakage) -> LeakageSolution {
        let (mut leakage, mut value, mut damping) = (start.clone(), self.value(start), 0.0);
        for _ in 0..STEPS {
            let local = self.local(&leakage);
            let Some(step) = local.step(damping) else {
                damping = (10.0f64 * damping).max(1e-6);
                continue;
            };
            let trial = moved(&leakage, &step);
            let reached = self.value(&trial);
            if reached <= value {
                (leakage, value, damping) = (trial, reached, 0.1 * damping);
            } else {
                damping = (10.0 * damping).max(1e-6);
            }
            if -local.slope.dot(&step) < ENOUGH * (1.0 + value) {
                break;
            }
        }
        let errors = self.local(&leakage).errors();
        LeakageSolution { leakage, errors, value }
    }

    fn local(&self, leakage: &Leakage) -> Local {
        let n = 4 * self.stations;
        let (mut slope, mut bends) = (DVector::zeros(n), DMatrix::zeros(n, n));
        let mut put = |at: usize, to: usize, bend: f64| bends[(at, to)] += bend;
        for datum in &self.data {
            let miss = datum.residual(leakage);
            let slopes = datum.parts(leakage).map(|(place, factor, of_conjugate)| {
                // ∂d/∂Im d = i, ∂d̄/∂Im d = −i.
                let along = Complex64::new(0.0, if of_conjugate { -1.0 } else { 1.0 });
                (number(place), [factor, along * factor])
            });
            for (at, of) in &slopes {
                for (k, a) in of.iter().enumerate() {
                    slope[at + k] += datum.weight * (a.conj() * miss).re;
                    for (to, other) in &slopes {
                        for (l, b) in other.iter().enumerate() {
                            put(at + k, to + l, datum.weight * (a.conj() * b).re);
                        }
                    }
                }
            }
        }
        for (k, d) in leakage.iter().flatten().enumerate() {
            for (part, at) in [d.re, d.im].into_iter().zip(2 * k..) {
                slope[at] += self.precision() * part;
                bends[(at, at)] += self.precision();
            }
        }
        Local { slope, bends }
    }
}

/// Returns the index of the real part of a d among all numbers; the imaginary part is behind it.
fn number([station, hand]: [usize; 2]) -> usize {
    4 * station + 2 * hand
}

fn moved(leakage: &Leakage, step: &DVector<f64>) -> Leakage {
    let of = |(k, d): (usize, &[Complex64; 2])| {
        [0, 1].map(|hand| {
            let at = number([k, hand]);
            d[hand] + Complex64::new(step[at], step[at + 1])
        })
    };
    leakage.iter().enumerate().map(of).collect()
}

impl Local {
    /// Downhill; none where the damped second derivatives are not positive.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut bends = self.bends.clone();
        for k in 0..bends.nrows() {
            bends[(k, k)] *= 1.0 + damping;
        }
        Some(-bends.cholesky()?.solve(&self.slope))
    }

    fn errors(self) -> Vec<[f64; 2]> {
        let stations = self.slope.len() / 4;
        let inverse = self.bends.cholesky().map(|c| c.inverse());
        let sigma = |k: usize| inverse.as_ref().map_or(f64::NAN, |inverse| inverse[(k, k)].sqrt());
        (0..stations).map(|k| [0, 1].map(|hand| sigma(number([k, hand])))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    fn normal(random: &mut Pcg64Mcg) -> Complex64 {
        Complex64::new(random.sample(StandardNormal), random.sample(StandardNormal))
    }

    /// Five stations whose feeds turn by a radian in twenty scans, with leakage of 7 %, and its truth.
    fn problem(noise: f64) -> (LeakageProblem, Leakage) {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        let truth: Leakage = (0..5).map(|_| [0, 1].map(|_| 0.05 * normal(&mut random))).collect();
        let mut data = Vec::new();
        for scan in 0..20 {
            for (a, b) in (0..5usize).flat_map(|a| (a + 1..5).map(move |b| (a, b))) {
                let turn = |k: usize| Complex64::cis(0.05 * f64::from(scan) * (1.0 + k as f64));
                let i = Complex64::new(1.0, 0.0) + 0.3 * normal(&mut random);
                let model = [i, 0.2 * normal(&mut random), 0.2 * normal(&mut random)];
                for product in 0..4 {
                    let mut datum = LeakageDatum {
                        stations: [a, b],
                        turns: [turn(a), turn(b)],
                        product,
                        value: Complex64::default(),
                        weight: noise.max(1e-3).powi(-2),
                        gain: 1.0 + 0.1 * normal(&mut random),
                        model,
                    };
                    datum.value = datum.residual(&truth) + noise * normal(&mut random);
                    data.push(datum);
                }
            }
        }
        (LeakageProblem { stations: 5, amplitude: 0.1, data }, truth)
    }

    /// Slopes and the curvature of Gauss and Newton against central differences of residuals.
    #[test]
    fn exact_derivatives_of_leakage() {
        let (problem, truth) = problem(0.02);
        let at: Leakage = truth.iter().map(|d| d.map(|d| 0.4 * d + 0.02)).collect();
        let slope = problem.local(&at).slope;
        let h = 1e-4;
        for k in 0..20 {
            let unit = DVector::from_fn(20, |j, _| if j == k { h } else { 0.0 });
            let ahead = 0.5 * problem.value(&moved(&at, &unit));
            let behind = 0.5 * problem.value(&moved(&at, &-unit));
            let difference = (ahead - behind) / (2.0 * h);
            assert!((difference - slope[k]).abs() < 1e-6 * slope.amax(), "{k}");
        }
    }

    /// Without noise and with a wide prior the truth comes back; with noise, as closely as the errors say.
    #[test]
    fn exact_leakage_comes_back() {
        let (mut exact, truth) = problem(0.0);
        exact.amplitude = 1e3;
        let found = exact.solve(&vec![[Complex64::default(); 2]; 5]);
        let off = |found: &Leakage| {
            let pairs = found.iter().flatten().zip(truth.iter().flatten());
            pairs.map(|(a, b)| (a - b).norm_sqr()).sum::<f64>()
        };
        assert!(off(&found.leakage).sqrt() < 1e-9, "{}", off(&found.leakage).sqrt());
        let (noisy, _) = problem(0.05);
        let found = noisy.solve(&vec![[Complex64::default(); 2]; 5]);
        let expected: f64 = found.errors.iter().flatten().map(|e| 2.0 * e * e).sum();
        let ratio = off(&found.leakage) / expected;
        assert!((0.3..2.0).contains(&ratio), "{ratio}");
    }
}
