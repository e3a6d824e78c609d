//! Path length ∫Σ dτ along a piece of a ray, and where it has a given value.

use crate::numbers::legendre;
use crate::numbers::scalar::Elementary;

/// Nodes of the Gauss–Legendre rule on each part of the piece.
pub(crate) const NODES: usize = 16;
/// Relative size that the last terms of a part's series may have; those left out are smaller still.
const SMALL: f64 = 1e-10;
/// Size of the last terms below which halves that are not smoother than the whole show noise of the density, which
/// no halving removes.
const NOISY: f64 = 1e-3;
/// Largest number of halvings of a part: from a light year to a hole of a stellar mass.
const HALVINGS: i32 = 48;

/// The length along a piece of a ray: on each part the Legendre series through the density at the
/// nodes of the rule, integrated term by term, so that no more points of the ray are needed to
/// find as many lengths as one likes. Parts are halved until their series have converged: far
/// out, where Σ dτ is dr and dτ is dr/r², all of the length is in the first instants.
pub(crate) struct Length<T> {
    start: T,
    whole: T,
    parts: Vec<Part<T>>,
    total: T,
}

struct Part<T> {
    /// Start and share of the piece, in shares of the Mino time.
    from: f64,
    width: f64,
    /// Length from the start of the piece to its start.
    so_far: T,
    /// Legendre coefficients of the density dL/dτ.
    density: [T; NODES],
}

/// A node of the rule with the Legendre polynomials there.
struct Node {
    place: f64,
    weight: f64,
    basis: [f64; NODES],
}

impl Node {
    fn new((place, weight): (f64, f64)) -> Self {
        Node { place, weight, basis: legendre::first(2.0 * place - 1.0) }
    }
}

impl<T: Elementary> Length<T> {
    /// Integrates the piece from `start` to `end`, by the rule with [`NODES`] nodes.
    pub fn new([start, end]: [T; 2], rule: &[(f64, f64)], density: impl Fn(T) -> T) -> Self {
        let zero = T::constant(0.0);
        let mut length = Length { start, whole: end - start, parts: Vec::new(), total: zero };
        let smallest = 0.5f64.powi(HALVINGS);
        let nodes: Vec<Node> = rule.iter().copied().map(Node::new).collect();
        let mut next = vec![(0.5, 0.5, f64::INFINITY), (0.0, 0.5, f64::INFINITY)];
        while let Some((from, width, before)) = next.pop() {
            let series = length.series(from, width, &nodes, &density);
            let size = |c: &T| c.value().abs();
            let last = (size(&series[NODES - 1]) + size(&series[NODES - 2])) / size(&series[0]);
            let is_noise = last < NOISY && last > 0.5 * before;
            if last > SMALL && width > smallest && !is_noise {
                let half = 0.5 * width;
                next.extend([(from + half, half, last), (from, half, last)]);
                continue;
            }
            length.parts.push(Part { from, width, so_far: length.total, density: series });
            // The higher terms integrate to 0 over the whole part.
            length.total = length.total + length.whole * T::constant(width) * series[0];
        }
        length
    }

    fn series(
        &self,
        from: f64,
        width: f64,
        nodes: &[Node],
        density: impl Fn(T) -> T,
    ) -> [T; NODES] {
        let mut series = [T::constant(0.0); NODES];
        for Node { place, weight, basis } in nodes {
            let time = self.start + self.whole * T::constant(from + width * place);
            let value = density(time) * T::constant(*weight);
            for (n, (sum, p)) in series.iter_mut().zip(basis).enumerate() {
                *sum = *sum + value * T::constant(p * (2 * n + 1) as f64);
            }
        }
        series
    }

    /// The whole.
    pub fn total(&self) -> T {
        self.total
    }

    /// The Mino time at which the length is `target`.
    pub fn find(&self, target: T) -> T {
        let later = self.parts[1..].partition_point(|part| part.so_far.value() <= target.value());
        let part = &self.parts[later];
        let (one, half) = (T::constant(1.0), self.whole * T::constant(0.5 * part.width));
        let rest = (target - part.so_far) / half;
        // Newton's method on [−1, 1] from a linear guess; the length grows monotonically.
        let mut x = rest / part.density[0] - one;
        let newton = |x: T| {
            let (length, density) = part.within(x);
            (rest - length) / density
        };
        for _ in 0..8 {
            let step = newton(x);
            let next = x + step;
            x = if next.value().abs() <= 1.0 { next } else { T::constant(next.value().signum()) };
            if step.value().abs() < 1e-15 {
                break;
            }
        }
        if !T::IS_PLAIN {
            // Once more for the derivatives, which the last step brings but roughly.
            x = x + newton(x);
        }
        self.start + self.whole * T::constant(part.from) + half * (x + one)
    }
}

impl<T: Elementary> Part<T> {
    /// ∫ from −1 to `x` of the density, and the density at `x`.
    fn within(&self, x: T) -> (T, T) {
        // ∫P_n = (P_{n+1} − P_{n−1})/(2n + 1).
        let basis = legendre::first::<T, { NODES + 1 }>(x);
        let c = &self.density;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::quadrature::gauss_legendre;

    /// Light that comes straight in: L = r, dτ = dr/r².
    #[test]
    fn exact_lengths_from_far_away() {
        let rule = gauss_legendre(NODES);
        let radius = 1e9;
        let length = Length::new([1.0 / radius, 0.5], &rule, |t: f64| t.powi(-2));
        assert!((length.total() / (radius - 2.0) - 1.0).abs() < 1e-13);
        assert!(length.parts.len() < 100);
        for l in [1.0, 1e5, 0.5e9, 1e9 - 100.0] {
            let r = 1.0 / length.find(l);
            assert!((r - (radius - l)).abs() < 1e-12 * radius, "{r} after {l}");
        }
    }

    /// Far out w = 1/r is known to the tolerance, not to its last digit. Halving such a density to the end took
    /// 2^48 parts.
    #[test]
    fn exact_noise_of_the_density_ends_the_halving() {
        let rule = gauss_legendre(NODES);
        for (radius, noise) in [(1e6, 1e-6), (1e9, 1e-4)] {
            let rough = |t: f64| t.powi(-2) * (1.0 + noise * (1e17 * t).sin());
            let length = Length::new([1.0 / radius, 0.5], &rule, rough);
            assert!((length.total() / radius - 1.0).abs() < 10.0 * noise, "{}", length.total());
            assert!(length.parts.len() < 200, "{}", length.parts.len());
        }
    }

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
