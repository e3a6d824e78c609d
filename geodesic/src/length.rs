//! Path length ∫Σ dτ along a piece of a ray, and where it has a given value.

use crate::scalar::Elementary;

/// Nodes of the Gauss–Legendre rule on each part of the piece.
pub(crate) const NODES: usize = 12;
/// Equal parts of Mino time whose lengths are series of their own.
const PARTS: usize = 16;

/// The length along a piece of a ray: on each part the Legendre series through the density at the
/// nodes of the rule, integrated term by term, so that no more points of the ray are needed to
/// find as many lengths as one likes.
pub(crate) struct Length<T> {
    start: T,
    /// Mino time of a part.
    part: T,
    /// Legendre coefficients of the density dL/dτ on each part.
    density: [[T; NODES]; PARTS],
    /// Length from the start of the piece to the start of each part, and to its end.
    so_far: [T; PARTS + 1],
}

impl<T: Elementary> Length<T> {
    /// Of the piece from `start` to `end`, by the rule with [`NODES`] nodes.
    pub fn new([start, end]: [T; 2], rule: &[(f64, f64)], density: impl Fn(T) -> T) -> Self {
        let zero = T::constant(0.0);
        let part = (end - start) / T::constant(PARTS as f64);
        let mut length =
            Length { start, part, density: [[zero; NODES]; PARTS], so_far: [zero; PARTS + 1] };
        for k in 0..PARTS {
            let from = length.edge(k);
            for (node, weight) in rule {
                let value = density(from + part * T::constant(*node)) * T::constant(*weight);
                let basis = legendre::<f64, NODES>(2.0 * node - 1.0);
                for (n, (sum, p)) in length.density[k].iter_mut().zip(basis).enumerate() {
                    *sum = *sum + value * T::constant(p * (2 * n + 1) as f64);
                }
            }
            // The higher terms integrate to 0 over the whole part.
            length.so_far[k + 1] = length.so_far[k] + part * length.density[k][0];
        }
        length
    }

    /// The whole.
    pub fn total(&self) -> T {
        self.so_far[PARTS]
    }

    fn edge(&self, k: usize) -> T {
        self.start + self.part * T::constant(k as f64)
    }

    /// The Mino time at which the length is `target`.
    pub fn find(&self, target: T) -> T {
        let (k, one) = (self.part_of(target), T::constant(1.0));
        let rest = target - self.so_far[k];
        // Newton's method on [−1, 1] from a linear guess; the length grows monotonically.
        let half = T::constant(0.5) * self.part;
        let mut x = rest / (half * self.density[k][0]) - one;
        for _ in 0..8 {
            let (length, density) = self.within(k, x);
            let step = (rest / half - length) / density;
            let next = x + step;
            x = if next.value().abs() <= 1.0 { next } else { T::constant(next.value().signum()) };
            if step.value().abs() < 1e-15 {
                break;
            }
        }
        if !T::IS_PLAIN {
            // Once more for the derivatives, which the last step brings but roughly.
            let (length, density) = self.within(k, x);
            x = x + (rest / half - length) / density;
        }
        self.edge(k) + half * (x + one)
    }

    fn part_of(&self, target: T) -> usize {
        self.so_far[1..PARTS].partition_point(|s| s.value() <= target.value())
    }

    /// ∫ from −1 to `x` of the density on part `k`, and the density at `x`.
    fn within(&self, k: usize, x: T) -> (T, T) {
        // ∫P_n = (P_{n+1} − P_{n−1})/(2n + 1).
        let basis = legendre::<T, { NODES + 1 }>(x);
        let c = &self.density[k];
        let mut length = c[0] * (x + T::constant(1.0));
        let mut density = c[0];
        for n in 1..NODES {
            let share = T::constant(1.0 / (2 * n + 1) as f64);
            length = length + c[n] * (basis[n + 1] - basis[n - 1]) * share;
            density = density + c[n] * basis[n];
        }
        (length, density)
    }
}

/// P₀(x) to P_{N−1}(x).
fn legendre<T: Elementary, const N: usize>(x: T) -> [T; N] {
    let mut p = [T::constant(1.0); N];
    p[1] = x;
    for n in 2..N {
        let [a, b] = [(2 * n - 1) as f64 / n as f64, (n - 1) as f64 / n as f64];
        p[n] = T::constant(a) * x * p[n - 1] - T::constant(b) * p[n - 2];
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::gauss_legendre;

    #[test]
    fn exact_lengths_of_a_known_density() {
        let rule = gauss_legendre(NODES);
        let length = Length::new([0.2, 1.7], &rule, |t: f64| t.exp());
        let expected = 1.7f64.exp() - 0.2f64.exp();
        assert!((length.total() / expected - 1.0).abs() < 1e-14);
        for share in [0.0, 1e-3, 0.25, 0.5, 0.77, 1.0] {
            let time = length.find(share * expected);
            assert!((time - (0.2f64.exp() + share * expected).ln()).abs() < 1e-14, "{share}");
        }
    }
}
