//! The four products of a baseline as a matrix.

use crate::Complex64;

/// [[RR, RL], [LR, LL]]: rows are the hands of the first station, columns those of the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coherency(pub [[Complex64; 2]; 2]);

/// Hands of RR, LL, RL and LR: 0 is R, 1 is L.
pub(super) const HANDS: [[usize; 2]; 4] = [[0, 0], [1, 1], [0, 1], [1, 0]];

impl Coherency {
    /// Of RR, LL, RL and LR.
    pub fn of([rr, ll, rl, lr]: [Complex64; 4]) -> Self {
        Self([[rr, rl], [lr, ll]])
    }

    /// That of a model without V: RR = LL = I, RL = Q + iU, LR = Q − iU.
    pub fn of_stokes([i, q, u]: [Complex64; 3]) -> Self {
        let turned = Complex64::new(-u.im, u.re);
        Self::of([i, i, q + turned, q - turned])
    }

    /// The baseline the other way round: the conjugate transpose.
    pub(super) fn reversed(&self) -> Self {
        let [[a, b], [c, d]] = self.0.map(|row| row.map(|v| v.conj()));
        Self([[a, c], [b, d]])
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        let of = |p: usize, q: usize| self.0[p][0] * other.0[0][q] + self.0[p][1] * other.0[1][q];
        Self([[of(0, 0), of(0, 1)], [of(1, 0), of(1, 1)]])
    }

    pub(super) fn scaled(&self, factor: Complex64) -> Self {
        Self(self.0.map(|row| row.map(|v| v * factor)))
    }

    /// Not finite where there is none.
    pub(super) fn inverse(&self) -> Self {
        let [[a, b], [c, d]] = self.0;
        Self([[d, -b], [-c, a]]).scaled((a * d - b * c).inv())
    }

    pub(super) fn trace(&self) -> Complex64 {
        self.0[0][0] + self.0[1][1]
    }
}
