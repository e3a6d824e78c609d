//! One step of an embedded Runge–Kutta method. The method is data; the loop over its
//! stages is written once.

use crate::mino::System;

/// Butcher tableau of an explicit embedded method whose last stage is the first of the
/// next step (FSAL).
pub(crate) struct Tableau<const S: usize> {
    /// Order p of the propagated solution; the embedded one has p − 1.
    pub order: u8,
    /// a_ij below the diagonal; the last row holds the weights of the solution.
    pub stages: [[f64; S]; S],
    /// Weights of the solution less those of the embedded one.
    pub error: [f64; S],
}

/// A method whose coefficients the compiler knows, so that the loops over its stages unroll.
pub(crate) trait Method<const S: usize> {
    const TABLEAU: Tableau<S>;
}

/// Dormand & Prince 1980, J. Comp. Appl. Math. 6, 19: order 5(4), seven stages.
pub(crate) struct DormandPrince5;

impl Method<7> for DormandPrince5 {
    const TABLEAU: Tableau<7> = DORMAND_PRINCE_5;
}

const DORMAND_PRINCE_5: Tableau<7> = Tableau {
    order: 5,
    stages: [
        [0.0; 7],
        [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0, 0.0],
        [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0, 0.0],
        [
            9017.0 / 3168.0,
            -355.0 / 33.0,
            46732.0 / 5247.0,
            49.0 / 176.0,
            -5103.0 / 18656.0,
            0.0,
            0.0,
        ],
        [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    ],
    error: [
        71.0 / 57600.0,
        0.0,
        -71.0 / 16695.0,
        71.0 / 1920.0,
        -17253.0 / 339200.0,
        22.0 / 525.0,
        -1.0 / 40.0,
    ],
};

/// What a step arrives at.
pub(crate) struct Step<const N: usize> {
    /// State at the end.
    pub y: [f64; N],
    /// Its derivative.
    pub f: [f64; N],
    /// Estimate of the local error.
    pub error: [f64; N],
}

/// `y` plus `h` times the slopes that stage `I` starts from.
#[inline(always)]
fn argument<M: Method<S>, const N: usize, const S: usize, const I: usize>(
    y: &[f64; N],
    k: &[[f64; N]; S],
    h: f64,
) -> [f64; N] {
    let mut slope = [0.0; N];
    for (k, weight) in k.iter().zip(M::TABLEAU.stages[I]).take(I) {
        if weight != 0.0 {
            for (slope, k) in slope.iter_mut().zip(k) {
                *slope += weight * k;
            }
        }
    }
    core::array::from_fn(|n| y[n] + h * slope[n])
}

/// One step of length `h` from `y` with derivative `f`.
#[inline(always)]
pub(crate) fn step<M: Method<S>, const N: usize, const S: usize>(
    system: &System<f64>,
    y: &[f64; N],
    f: &[f64; N],
    leg: f64,
    h: f64,
) -> Step<N> {
    let mut k = [[0.0; N]; S];
    k[0] = *f;
    let mut end = *y;
    // Written out, so that each stage is compiled with its own coefficients.
    macro_rules! stages {
        ($($i:literal)*) => {$(
            if $i < S {
                end = argument::<M, N, S, $i>(y, &k, h);
                k[$i] = system.derivative(&end, leg);
            }
        )*};
    }
    stages!(1 2 3 4 5 6);
    let mut error = [0.0; N];
    for (k, weight) in k.iter().zip(M::TABLEAU.error) {
        for (error, k) in error.iter_mut().zip(k) {
            *error += h * weight * k;
        }
    }
    Step { y: end, f: k[S - 1], error }
}

/// Step-size control with memory of the last error (Gustafsson's PI controller with the
/// constants of Hairer, Nørsett & Wanner, Solving ODEs I, II.4).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Control {
    exponent: f64,
    /// Logarithm of the last accepted error.
    last: f64,
}

impl Control {
    const BETA: f64 = 0.04;

    pub fn new(order: u8) -> Self {
        Control { exponent: 1.0 / f64::from(order) - 0.75 * Self::BETA, last: 1e-4f64.ln() }
    }

    /// Factor for the next step after one whose error, in units of the tolerance, was
    /// `error`; at most 1 after a rejected one.
    pub fn factor(&mut self, error: f64) -> f64 {
        let logarithm = error.max(1e-10).ln();
        if error > 1.0 {
            return (0.9 * (-self.exponent * logarithm).exp()).max(0.2);
        }
        let factor = 0.9 * (Self::BETA * self.last - self.exponent * logarithm).exp();
        self.last = logarithm.max(-9.2);
        factor.clamp(0.2, 6.0)
    }
}
