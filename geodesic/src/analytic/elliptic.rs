//! Elliptic integrals and functions with real results, accurate up to a modulus of 1.
//!
//! The modulus is always given by the complementary parameter m₁ = 1 − m, which callers
//! know without cancellation. Carlson's R_F is needed for a conjugate pair of arguments, and
//! the Jacobi functions have to hold up next to m = 1; that, and that it is short, is why
//! the crate has its own.

use core::f64::consts::FRAC_PI_2;

/// Where a quadratically convergent iteration may stop: √ε.
const HALF_PRECISION: f64 = 1e-8;

/// The arithmetic-geometric mean of two numbers ≥ 0 (0 if one of them is).
pub(crate) fn agm(mut a: f64, mut b: f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        return 0.0;
    }
    while (a - b).abs() > HALF_PRECISION * a {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    0.5 * (a + b)
}

/// ∫₀^{π/2} (a cos² + b sin²) dχ / \[(cos² + p sin²) √(cos² + k_c² sin²)\] for p > 0 and
/// k_c > 0 (Bulirsch 1969, Numer. Math. 13, 305).
pub(crate) fn cel(kc: f64, p: f64, mut a: f64, mut b: f64) -> f64 {
    let (mut kc, mut e, mut m, mut p) = (kc, kc, 1.0, p.sqrt());
    b /= p;
    loop {
        let f = a;
        a += b / p;
        let g = e / p;
        b = 2.0 * (b + f * g);
        p += g;
        let m_before = m;
        m += kc;
        if (m_before - kc).abs() <= HALF_PRECISION * m_before {
            return FRAC_PI_2 * (b + a * m) / (m * (m + p));
        }
        kc = 2.0 * e.sqrt();
        e = kc * m;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(x: f64, y: f64, tolerance: f64) {
        assert!((x / y - 1.0).abs() < tolerance, "{x} is not {y}");
    }

    /// Gauss's constant, and K(m) = ln(4/√m₁) + O(m₁ ln m₁) as m → 1.
    #[test]
    fn exact_arithmetic_geometric_mean() {
        close(1.0 / agm(1.0, 2f64.sqrt()), 0.834_626_841_674_073_2, 4e-16);
        let k = FRAC_PI_2 / agm(1.0, 1e-10);
        close(k, (4e10f64).ln(), 1e-15);
        assert_eq!(agm(1.0, 0.0), 0.0);
    }

    /// Π(n | m = 0) = π/(2√(1 − n)), and E/K by Legendre's relation at m = 1/2.
    #[test]
    fn exact_complete_integrals() {
        for p in [1e-300f64, 1e-20, 1e-3, 0.5, 1.0, 7.0] {
            close(p.sqrt() * cel(1.0, p, 1.0, 1.0), FRAC_PI_2, 4e-16);
        }
        let kc = 0.5f64.sqrt();
        let (k, e) = (cel(kc, 1.0, 1.0, 1.0), cel(kc, 1.0, 1.0, 0.5));
        close(2.0 * e * k - k * k, FRAC_PI_2, 1e-15);
        close(k, FRAC_PI_2 / agm(1.0, kc), 1e-15);
    }
}
