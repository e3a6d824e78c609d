//! Elliptic integrals and functions with real results, accurate up to a modulus of 1.
//!
//! The modulus is always given by the complementary parameter m₁ = 1 − m, which callers
//! know without cancellation. The crate has its own because it needs R_F for a conjugate
//! pair of arguments and Jacobi functions by m₁. Crate `ellip` 1.2.3 has neither: its R_F is
//! good to 2 ε for m₁ down to 1e-30, but its K(m), which has to be given m, is off by 2e-12 at
//! m₁ = 1e-6, 3e-9 at 1e-10 and 2e-5 at 1e-15 from the rounding of m alone.

use core::f64::consts::FRAC_PI_2;

/// Difference at which a quadratically convergent iteration may stop: √ε.
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
        if (m_before - kc).abs() <= HALF_PRECISION * m_before || m.is_nan() {
            return FRAC_PI_2 * (b + a * m) / (m * (m + p));
        }
        kc = 2.0 * e.sqrt();
        e = kc * m;
    }
}

/// Carlson's R_F(x, y, z) = ½ ∫₀^∞ dt/√((t + x)(t + y)(t + z)) for arguments ≥ 0 of which at
/// most one is 0 (Carlson 1995, Numer. Algorithms 10, 13).
pub(crate) fn rf(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    loop {
        let mean = (x + y + z) / 3.0;
        let [dx, dy] = [1.0 - x / mean, 1.0 - y / mean];
        let dz = -dx - dy;
        if dx.abs().max(dy.abs()).max(dz.abs()) < SERIES {
            return rf_series(dx * dy - dz * dz, dx * dy * dz) / mean.sqrt();
        }
        if !mean.is_finite() || mean == 0.0 {
            return 1.0 / mean;
        }
        let (sx, sy, sz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let shift = sx * (sy + sz) + sy * sz;
        (x, y, z) = (0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift));
    }
}

/// R_F(x, y + iv, y − iv) for x ≥ 0 and v > 0.
pub(crate) fn rf_pair(mut x: f64, mut y: f64, mut v: f64) -> f64 {
    loop {
        let mean = (x + 2.0 * y) / 3.0;
        let (re, im) = (1.0 - y / mean, v / mean);
        let modulus2 = re * re + im * im;
        if modulus2.max(4.0 * re * re) < SERIES * SERIES {
            return rf_series(modulus2 - 4.0 * re * re, -2.0 * re * modulus2) / mean.sqrt();
        }
        if !mean.is_finite() || x.max(y.abs()).max(v) == 0.0 {
            return 0.0;
        }
        let modulus = y.hypot(v);
        let real_root =
            if y >= 0.0 { (0.5 * (modulus + y)).sqrt() } else { v / (2.0 * (modulus - y)).sqrt() };
        let shift = 2.0 * x.sqrt() * real_root + modulus;
        (x, y, v) = (0.25 * (x + shift), 0.25 * (y + shift), 0.25 * v);
    }
}

/// Largest difference for the series of R_F about equal arguments: its error is the sixth power.
const SERIES: f64 = 2e-3;

fn rf_series(e2: f64, e3: f64) -> f64 {
    1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0
}

/// sn and cn/sn of u > 0 by descending Landen transformations (Bulirsch 1965, Numer. Math. 7,
/// 78): both keep their relative accuracy for m₁ → 0, where cn/sn becomes small.
pub(crate) fn sn_cs(u: f64, m1: f64) -> (f64, f64) {
    if m1 == 0.0 {
        return (u.tanh(), 1.0 / u.sinh());
    }
    let mut means = [(1.0, m1.sqrt()); 16];
    let mut last = 0;
    while {
        let (a, b) = means[last];
        (a - b).abs() > HALF_PRECISION * a && last < 15
    } {
        let (a, b): (f64, f64) = means[last];
        last += 1;
        means[last] = (0.5 * (a + b), (a * b).sqrt());
    }
    let mean = 0.5 * (means[last].0 + means[last].1);
    let (sin, cos) = (u * mean).sin_cos();
    let (mut a, mut dn) = (cos / sin, 1.0);
    let mut c = mean * a;
    for (mean, root) in means[..=last].iter().rev() {
        a *= c;
        c *= dn;
        dn = (root + a) / (mean + a);
        a = c / mean;
    }
    ((1.0 / (1.0 + c * c).sqrt()).copysign(sin), c)
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

    #[test]
    fn exact_first_kind() {
        close(rf(0.0, 1.0, 1.0), FRAC_PI_2, 1e-15);
        close(rf(2.0, 2.0, 2.0), 0.5f64.sqrt(), 1e-15);
        // R_F(x, y, y) = atanh(√(1 − y/x))/√(x − y).
        close(rf(1.0, 0.19, 0.19), 0.9f64.atanh() / 0.9, 1e-15);
        close(rf_pair(1.0, 0.19, 1e-20), 0.9f64.atanh() / 0.9, 1e-15);
        // Carlson 1995: R_F(½, 1, 0), R_F(0, i, −i).
        close(rf(0.5, 1.0, 0.0), 1.854_074_677_301_371_9, 1e-15);
        close(rf_pair(0.0, 0.0, 1.0), 1.854_074_677_301_371_9, 1e-15);
    }

    /// F(am u) = u, from modulus 0 to within 1e-30 of 1, over most of the half period.
    #[test]
    fn exact_jacobi_functions_invert_the_first_kind() {
        for m1 in [1.0, 0.5, 0.1, 1e-4, 1e-9, 1e-15, 1e-30] {
            let quarter = FRAC_PI_2 / agm(1.0, f64::sqrt(m1));
            for fraction in [1e-9, 0.1, 0.4, 0.7, 0.95, 1.0] {
                let u = fraction * quarter;
                let (sn, cs) = sn_cs(u, m1);
                let cn = cs * sn;
                let dn2 = m1 + (1.0 - m1) * cn * cn;
                close(sn * rf(cn * cn, dn2, 1.0), u, 2e-14);
            }
        }
        let (sn, cs) = sn_cs(20.0, 0.0);
        close(cs, 2.0 * (-20f64).exp(), 1e-15);
        assert_eq!(sn, 1.0);
    }
}
