//! The gains of a scan that explain its data best beside a model: a small nonlinear least squares problem.
//!
//! ½χ² = ½ Σ |g₁ ḡ₂ V − D|²/σ² + ½ Σ (ln|g|/s)² in ln|g| and arg g of every station. It is minimised by Newton steps that
//! are damped until the value falls (Levenberg & Marquardt), from phases that are in step with each other as well as
//! data and model allow: those that maximise Σ Re(ḡ₁ D V̄ g₂)/σ², found station by station.

use super::GainPriors;
use crate::Complex64;
use nalgebra::{DMatrix, DVector};

/// Data of a scan, and what is known of its gains.
#[derive(Debug, Clone)]
pub struct GainProblem {
    /// Numbers of the stations of each baseline among those of the scan.
    pairs: Vec<[usize; 2]>,
    data: Vec<Complex64>,
    /// 1/σ² of real and imaginary part.
    weight: Vec<f64>,
    /// 1/s² of ln|g|, 0 where it is fixed.
    precision: Vec<f64>,
    /// Fixed ones among ln|g| of all stations, then arg g of all.
    is_fixed: Vec<bool>,
}

/// Gains of the stations of a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanGains {
    /// ln|g|.
    pub log_amplitude: Vec<f64>,
    /// arg g in radians; 0 for the station that phases count from.
    pub phase: Vec<f64>,
}

impl ScanGains {
    /// All 1.
    pub fn unit(stations: usize) -> Self {
        Self { log_amplitude: vec![0.0; stations], phase: vec![0.0; stations] }
    }

    /// The gain of a station.
    pub fn gain(&self, station: usize) -> Complex64 {
        Complex64::from_polar(self.log_amplitude[station].exp(), self.phase[station])
    }

    /// g₁ ḡ₂ of a baseline.
    pub fn on(&self, [a, b]: [usize; 2]) -> Complex64 {
        let amplitude = (self.log_amplitude[a] + self.log_amplitude[b]).exp();
        Complex64::from_polar(amplitude, self.phase[a] - self.phase[b])
    }

    fn moved(&self, step: &DVector<f64>) -> Self {
        let n = self.phase.len();
        let sum = |x: &[f64], from: usize| x.iter().zip(from..).map(|(x, k)| x + step[k]).collect();
        Self { log_amplitude: sum(&self.log_amplitude, 0), phase: sum(&self.phase, n) }
    }
}

/// ½χ² about some gains.
struct Local {
    value: f64,
    gradient: DVector<f64>,
    bends: DMatrix<f64>,
}

/// Steps at most; a handful is the rule.
const STEPS: usize = 60;
/// Sweeps over the stations that bring phases into step.
const SWEEPS: usize = 12;
/// Steps that promise less than this part of ½χ² + 1 are the last ones.
const ENOUGH: f64 = 1e-13;

impl GainProblem {
    /// Takes visibilities of a scan with the variances of their parts, on baselines of `priors`' stations.
    ///
    /// # Panics
    /// If the numbers of baselines, data and variances differ, or a baseline has no station.
    pub fn new(
        pairs: Vec<[usize; 2]>,
        data: Vec<Complex64>,
        variance: &[f64],
        priors: &GainPriors,
    ) -> Self {
        let n = priors.amplitude_sigma.len();
        assert!(pairs.len() == data.len() && data.len() == variance.len());
        assert!(pairs.iter().flatten().all(|k| *k < n));
        let weight: Vec<f64> = variance.iter().map(|v| v.recip()).collect();
        let is_reference = references(n, &pairs, &data, &weight);
        let sigma = &priors.amplitude_sigma;
        let precision = |s: &f64| if *s > 0.0 { s.powi(-2) } else { 0.0 };
        let phases = is_reference.iter().map(|is| *is || !priors.free_phases);
        Self {
            precision: sigma.iter().map(precision).collect(),
            is_fixed: sigma.iter().map(|s| *s <= 0.0).chain(phases).collect(),
            pairs,
            data,
            weight,
        }
    }

    /// Stations of the scan.
    pub fn stations(&self) -> usize {
        self.precision.len()
    }

    /// Stations of each baseline.
    pub fn pairs(&self) -> &[[usize; 2]] {
        &self.pairs
    }

    /// Returns whether ln|g| of a station is free, with its 1/s².
    pub fn precision(&self, station: usize) -> Option<f64> {
        (!self.is_fixed[station]).then(|| self.precision[station])
    }

    /// Returns whether arg g of a station is free.
    pub fn has_phase(&self, station: usize) -> bool {
        !self.is_fixed[self.stations() + station]
    }

    /// χ² of data and gains.
    pub fn value(&self, model: &[Complex64], gains: &ScanGains) -> f64 {
        let pairs = self.pairs.iter().zip(model).zip(&self.data).zip(&self.weight);
        let data: f64 = pairs.map(|(((p, v), d), w)| w * (gains.on(*p) * v - d).norm_sqr()).sum();
        let prior = gains.log_amplitude.iter().zip(&self.precision).map(|(x, p)| x * x * p);
        data + prior.sum::<f64>()
    }

    /// The gains that explain the data best beside these visibilities of the model. Where the model is dark they are 1.
    pub fn solve(&self, model: &[Complex64]) -> ScanGains {
        let mut gains = self.start(model);
        let (mut now, mut damping) = (self.local(model, &gains, true), 1e-6);
        for _ in 0..STEPS {
            // Exact second derivatives need not be positive far from the minimum.
            let Some(step) = now.step(damping) else {
                damping = (10.0 * damping).max(1e-6);
                continue;
            };
            // What a Newton step takes off a parabola: half of its slope along the step.
            let promise = -0.5 * now.gradient.dot(&step);
            let trial = gains.moved(&step);
            // Of so small a step the rounded values no longer tell whether it helps.
            if promise < ENOUGH * (1.0 + now.value) {
                return trial;
            }
            if 0.5 * self.value(model, &trial) <= now.value {
                (now, gains) = (self.local(model, &trial, true), trial);
                damping *= 0.1;
            } else {
                damping = (10.0 * damping).max(1e-6);
            }
        }
        gains
    }

    /// Standard deviations of ln|g| and of arg g (radians) about these gains, the model taken for granted.
    pub fn errors(&self, model: &[Complex64], gains: &ScanGains) -> ScanGains {
        let n = self.stations();
        let Local { bends, .. } = self.local(model, gains, false);
        let inverse = shifted(bends, 0.0).cholesky().map(|c| c.inverse());
        let sigma = |k: usize| match &inverse {
            _ if self.is_fixed[k] => 0.0,
            Some(inverse) => inverse[(k, k)].sqrt(),
            None => f64::NAN,
        };
        ScanGains {
            log_amplitude: (0..n).map(sigma).collect(),
            phase: (n..2 * n).map(sigma).collect(),
        }
    }

    /// Value, slope and second derivatives of ½χ²; those of Gauss and Newton, which are positive, unless `exact`.
    fn local(&self, model: &[Complex64], gains: &ScanGains, exact: bool) -> Local {
        let n = self.stations();
        let (mut gradient, mut bends) = (DVector::zeros(2 * n), DMatrix::zeros(2 * n, 2 * n));
        for (k, &[a, b]) in self.pairs.iter().enumerate() {
            // ∂(g₁ ḡ₂ V)/∂ln|g| is g₁ ḡ₂ V itself, ∂/∂arg g is i times it at station 1, −i at 2.
            let seen = gains.on([a, b]) * model[k];
            let pull = (seen - self.data[k]).conj() * seen * self.weight[k];
            let size = self.weight[k] * seen.norm_sqr();
            let of_pull = if exact { pull } else { Complex64::new(0.0, 0.0) };
            let sides = [(a, 1.0), (b, -1.0)];
            for (i, sign) in sides {
                gradient[i] += pull.re;
                gradient[n + i] -= sign * pull.im;
                for (j, other) in sides {
                    bends[(i, j)] += size + of_pull.re;
                    bends[(n + i, n + j)] += sign * other * (size - of_pull.re);
                    bends[(i, n + j)] -= other * of_pull.im;
                    bends[(n + j, i)] -= other * of_pull.im;
                }
            }
        }
        for (k, p) in self.precision.iter().enumerate() {
            gradient[k] += p * gains.log_amplitude[k];
            bends[(k, k)] += p;
        }
        // Rows and columns of the identity: the steps of what is fixed are 0.
        for k in (0..2 * n).filter(|k| self.is_fixed[*k]) {
            bends.row_mut(k).fill(0.0);
            bends.column_mut(k).fill(0.0);
            (gradient[k], bends[(k, k)]) = (0.0, 1.0);
        }
        Local { value: 0.5 * self.value(model, gains), gradient, bends }
    }

    /// Amplitudes of 1 and phases in step.
    fn start(&self, model: &[Complex64]) -> ScanGains {
        let n = self.stations();
        let mut gains = ScanGains::unit(n);
        if !(0..n).any(|k| self.has_phase(k)) {
            return gains;
        }
        let mut turned: Vec<Complex64> = (0..n).map(|k| gains.gain(k)).collect();
        let products: Vec<Complex64> = (0..self.pairs.len())
            .map(|k| self.data[k] * model[k].conj() * self.weight[k])
            .collect();
        for sweep in 0..SWEEPS {
            for station in (0..n).filter(|k| self.has_phase(*k)) {
                // Re(ḡ Σ D V̄ g₂/σ²) is largest where g has the phase of the sum.
                let mut sum = Complex64::new(0.0, 0.0);
                for (&[a, b], product) in self.pairs.iter().zip(&products) {
                    // At first only stations that are in step already count.
                    let known = |k: usize| sweep > 0 || k < station || !self.has_phase(k);
                    if a == station && known(b) {
                        sum += product * turned[b];
                    } else if b == station && known(a) {
                        sum += product.conj() * turned[a];
                    }
                }
                if sum.norm() > 0.0 {
                    turned[station] = sum / sum.norm();
                }
            }
        }
        gains.phase = turned.iter().map(|g| g.arg()).collect();
        gains
    }
}

impl Local {
    /// A step downhill; none where the damped second derivatives are not positive.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        Some(-shifted(self.bends.clone(), damping).cholesky()?.solve(&self.gradient))
    }
}

/// A matrix whose diagonal is larger by a part of it, and by a trifle that keeps it from being singular where a model
/// is dark.
fn shifted(mut bends: DMatrix<f64>, part: f64) -> DMatrix<f64> {
    let largest = bends.diagonal().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    for k in 0..bends.nrows() {
        bends[(k, k)] += part * bends[(k, k)].abs() + (part + 1e-13) * 1e-3 * largest;
    }
    bends
}

/// Returns for each set of stations that baselines connect the one with the strongest data: its phase is 0, as data know
/// only differences.
fn references(n: usize, pairs: &[[usize; 2]], data: &[Complex64], weight: &[f64]) -> Vec<bool> {
    let mut set: Vec<usize> = (0..n).collect();
    let mut strength = vec![0.0; n];
    for ((&[a, b], d), w) in pairs.iter().zip(data).zip(weight) {
        let (from, to) = (set[a].max(set[b]), set[a].min(set[b]));
        set.iter_mut().filter(|s| **s == from).for_each(|s| *s = to);
        strength[a] += w * d.norm_sqr();
        strength[b] += w * d.norm_sqr();
    }
    let best = |of: usize| {
        let members = (0..n).filter(|k| set[*k] == of);
        members.fold(of, |best, k| if strength[k] > strength[best] { k } else { best })
    };
    (0..n).map(|k| best(set[k]) == k).collect()
}

#[cfg(test)]
mod tests;
