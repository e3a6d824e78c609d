//! Leakage: V = J₁ ρ J₂†, with the coherencies ρ = [[I + V, Q + iU], [Q − iU, I − V]] of the sky and J = [[1, d_R
//! e^{2iφ}], [d_L e^{−2iφ}, 1]]: data whose rotation of feeds has been taken out.

use crate::Complex64;
use crate::observation::Basis;
use std::sync::{Arc, PoisonError, RwLock};

/// d_R and d_L of each station of an observation.
pub type Leakage = Vec<[Complex64; 2]>;

/// Jones matrix of a station: rows and columns are R and L.
pub type Matrix = [[Complex64; 2]; 2];

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
const ONE: Complex64 = Complex64::new(1.0, 0.0);

/// Coherencies of 1 Jy of I, of Q and of U.
const UNITS: [Matrix; super::MODELLED] = [
    [[ONE, ZERO], [ZERO, ONE]],
    [[ZERO, ONE], [ONE, ZERO]],
    [[ZERO, Complex64::new(0.0, 1.0)], [Complex64::new(0.0, -1.0), ZERO]],
];

/// Hands of RR, LL, RL, LR: 0 is R, 1 is L.
pub const HANDS: [[usize; 2]; 4] = [[0, 0], [1, 1], [0, 1], [1, 0]];

/// J of a station with these d_R and d_L whose feeds are turned by φ: `turn` is e^{2iφ}.
pub fn jones([right, left]: [Complex64; 2], turn: Complex64) -> Matrix {
    [[ONE, right * turn], [left * turn.conj(), ONE]]
}

/// The coherencies of I, Q and U.
pub fn coherency(stokes: [Complex64; super::MODELLED]) -> Matrix {
    let of = |p: usize, q: usize| stokes.iter().zip(&UNITS).map(|(s, unit)| s * unit[p][q]).sum();
    [[of(0, 0), of(0, 1)], [of(1, 0), of(1, 1)]]
}

/// Products RR, LL, RL and LR of coherencies behind two stations.
pub fn leaked(coherency: &Matrix, first: &Matrix, second: &Matrix) -> [Complex64; 4] {
    HANDS.map(|[p, q]| {
        let mut sum = ZERO;
        for (r, row) in coherency.iter().enumerate() {
            for (s, part) in row.iter().enumerate() {
                sum += first[p][r] * part * second[q][s].conj();
            }
        }
        sum
    })
}

/// Returns the response of each product of a row to 1 Jy of I, of Q and of U.
pub fn response(
    basis: Basis,
    first: &Matrix,
    second: &Matrix,
) -> [[Complex64; super::MODELLED]; 4] {
    if basis == Basis::Stokes {
        return [[ONE, ZERO, ZERO], [ZERO, ONE, ZERO], [ZERO, ZERO, ONE], [ZERO; 3]];
    }
    let of = UNITS.map(|unit| leaked(&unit, first, second));
    [0, 1, 2, 3].map(|product| of.map(|parameter| parameter[product]))
}

/// Leakage that is being solved for: all that hold it see what was found last.
#[derive(Debug, Clone)]
pub struct SharedLeakage(Arc<RwLock<Leakage>>);

impl SharedLeakage {
    /// None at so many stations.
    pub fn none(stations: usize) -> Self {
        Self(Arc::new(RwLock::new(vec![[ZERO; 2]; stations])))
    }

    /// Returns the present value.
    pub fn get(&self) -> Leakage {
        // Values are replaced as a whole: what a panic elsewhere has left is one of them.
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Sets the value from now on.
    pub fn set(&self, leakage: Leakage) {
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = leakage;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RR = LL = I, RL = Q + iU, LR = Q − iU without leakage; to first order RL gains (d_R1 e^{2iφ1} + d̄_L2 e^{2iφ2}) I.
    #[test]
    fn exact_signs_of_hands() {
        let (i, q, u) = (Complex64::new(2.0, 0.3), Complex64::new(0.4, -0.1), ONE * 0.7);
        let sky = coherency([i, q, u]);
        let [turn_1, turn_2] = [Complex64::cis(0.8), Complex64::cis(-1.9)];
        let clean = jones([ZERO; 2], turn_1);
        let turned = u * Complex64::new(0.0, 1.0);
        let products = leaked(&sky, &clean, &clean);
        for (found, expected) in products.iter().zip([i, i, q + turned, q - turned]) {
            assert!((found - expected).norm() < 1e-15);
        }
        let (d_r, d_l) = (Complex64::new(3e-6, 1e-6), Complex64::new(-2e-6, 5e-6));
        let (first, second) = (jones([d_r, ZERO], turn_1), jones([ZERO, d_l], turn_2));
        let gained = leaked(&sky, &first, &second)[2] - products[2];
        let expected = (d_r * turn_1 + d_l.conj() * turn_2) * i;
        assert!((gained - expected).norm() < 1e-10, "{gained} {expected}");
        let by_parts = response(Basis::Circular, &first, &second);
        for (row, product) in by_parts.iter().zip(leaked(&sky, &first, &second)) {
            let sum = row[0] * i + row[1] * q + row[2] * u;
            assert!((sum - product).norm() < 1e-15);
        }
    }
}
