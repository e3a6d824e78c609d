//! The few elliptic functions that the sampler needs, on lanes. Iterations leave a lane alone once
//! it has converged, so that no result depends on what is in the other lanes.
//!
//! Everything here is written for Weierstrass' cubic
//! `p'² = 4p³ − g₂p − g₃ = 4(p − e)(p² + e p + e² − g₂/4)`
//! with one real root e split off, so that three real roots and one real root
//! with a complex pair need no separate treatment.

use super::lanes::Lanes;

/// A real root of `4t³ − g₂ t − g₃` that is far from the other two: the
/// largest if g₃ ≥ 0, else the smallest. `scale > 0` is its order of magnitude.
///
/// Newton's method for the largest root of `s³ − (g₂/4) s − |g₃|/4` from above,
/// where it converges monotonically. The residual is at rounding level, so
/// the split cubic is the given one up to rounding of g₃ even when the other
/// two roots nearly coincide.
#[inline(always)]
pub fn isolated_root<V: Lanes<f64>>(g2: V, g3: V, scale: V) -> V {
    let zero = V::splat(0.0);
    let p = g2 * V::splat(0.25);
    let q = g3.abs() * V::splat(0.25);
    let third = p.max(zero) * V::splat(1.0 / 3.0);
    let c = third.sqrt();
    // cbrt(q) ≤ (q/k² + 2k)/3 for every k > 0, and √p + cbrt(q) bounds the root.
    let k = c.max(scale);
    let bound = c * V::splat(1.732_050_807_568_877_3) + (q / (k * k) + k + k) * V::splat(1.0 / 3.0);
    // Three real roots: between √p (q = 0) and 2√(p/3) (q = 2(p/3)^{3/2}).
    let full = third * c * V::splat(2.0);
    let near = c * V::splat(1.732_050_807_568_877_3)
        + c * V::splat(0.282) * (q / full.max(V::splat(1e-300)));
    let near = near.min(c + c);
    let mut s = V::select(q.lt(full), near, bound);
    let (mut live, half) = (V::splat(1.0), V::splat(0.5));
    for _ in 0..60 {
        let s2 = s * s;
        let f = (s2 - p).mul_add(s, -q);
        let d = s2.mul_add(V::splat(3.0), -p).max(V::splat(1e-300));
        let step = f / d;
        s = V::select(half.lt(live), s - step, s);
        live = V::select((s.abs() * V::splat(1e-15)).lt(step.abs()), live, V::splat(0.0));
        if !V::any(half.lt(live)) {
            break;
        }
    }
    s.copysign(g3)
}

/// Carlson's `R_F(x, m + √D, m − √D)`, D of either sign, for `x > 0` and `m² ≥ D`.
///
/// `∫_p^∞ dt/√(4t³ − g₂t − g₃) = R_F(p − e, p + e/2 ± √D)`, `D = g₂/4 − 3e²/4`.
/// The duplication needs only the product and the sum of the pair:
/// `√y√z = √(m² − D)`, `√y + √z = √(2m + 2√(m² − D))`.
#[inline(always)]
pub fn rf_pair<V: Lanes<f64>>(x: V, m: V, d: V) -> V {
    rf_from(x, m, d, m.mul_add(m, -d))
}

/// [`rf_pair`] where `m² − D` is known to be `product`, however much of it cancels.
#[inline(always)]
pub fn rf_from<V: Lanes<f64>>(x: V, m: V, d: V, product: V) -> V {
    let (mut x, mut m, mut d, mut product) = (x, m, d, product);
    let (zero, half) = (V::splat(0.0), V::splat(0.5));
    let quarter = V::splat(0.25);
    let mut live = V::splat(1.0);
    for _ in 0..40 {
        let pair = product.max(zero).sqrt();
        let sum = (m + pair + m + pair).max(zero);
        let lambda = pair + (x * sum).max(zero).sqrt();
        let now = half.lt(live);
        x = V::select(now, (x + lambda) * quarter, x);
        m = V::select(now, (m + lambda) * quarter, m);
        d = V::select(now, d * V::splat(0.0625), d);
        product = m.mul_add(m, -d);
        let dx = m - x;
        let size = (dx * dx).max(d.abs());
        let mean = x + m + m;
        live = V::select((mean * mean * V::splat(4e-6)).lt(size), live, zero);
        if !V::any(half.lt(live)) {
            break;
        }
    }
    let mean = (x + m + m) * V::splat(1.0 / 3.0);
    let inv = mean.recip();
    let (cx, cm) = ((mean - x) * inv, (mean - m) * inv);
    let yz = cm.mul_add(cm, -(d * inv * inv));
    let e2 = cx.neg_mul_add(cx, yz);
    let e3 = cx * yz;
    // 1 − E₂/10 + E₃/14 + E₂²/24 − 3E₂E₃/44 − 5E₂³/208 + 3E₃²/104 + E₂²E₃/16
    let c2 = e2.mul_add(V::splat(-5.0 / 208.0), V::splat(1.0 / 24.0));
    let c2 = e3.mul_add(V::splat(1.0 / 16.0), c2).mul_add(e2, V::splat(-0.1));
    let c3 = e3.mul_add(V::splat(3.0 / 104.0), V::splat(1.0 / 14.0));
    let c3 = e2.mul_add(V::splat(-3.0 / 44.0), c3);
    let series = e2.mul_add(c2, e3.mul_add(c3, V::splat(1.0)));
    series * inv.sqrt()
}

/// Arithmetic–geometric mean of positive numbers.
#[inline(always)]
pub fn agm<V: Lanes<f64>>(a: V, b: V) -> V {
    let (mut a, mut b) = (a, b);
    let (mut live, half) = (V::splat(1.0), V::splat(0.5));
    for _ in 0..40 {
        let mean = (a + b) * half;
        let apart = (a - b).abs();
        let now = half.lt(live);
        b = V::select(now, (a * b).sqrt(), b);
        a = V::select(now, mean, a);
        // The means of numbers that agree to 1e-8 agree to rounding.
        live = V::select((mean * V::splat(1e-8)).lt(apart), live, V::splat(0.0));
        if !V::any(half.lt(live)) {
            break;
        }
    }
    a
}

/// `V(h) = 1/℘(h)` and `V'(h)` for small h (h to a tenth of the nearest pole or less).
///
/// `℘ = h⁻² + Σ_{k≥2} c_k h^{2k−2}`, `c₂ = g₂/20`, `c₃ = g₃/28`,
/// `c_k = 3/((2k+1)(k−3)) Σ_{m=2}^{k−2} c_m c_{k−m}`.
#[inline(always)]
pub fn reciprocal_weierstrass<V: Lanes<f64>>(g2: V, g3: V, h: V) -> (V, V) {
    let h2 = h * h;
    // cₖ h^{2k}
    let c2 = g2 * V::splat(1.0 / 20.0) * h2 * h2;
    let c3 = g3 * V::splat(1.0 / 28.0) * h2 * h2 * h2;
    let c4 = c2 * c2 * V::splat(1.0 / 3.0);
    let c5 = c2 * c3 * V::splat(3.0 / 11.0);
    let c6 = (c2 * c4 * V::splat(2.0) + c3 * c3) * V::splat(1.0 / 13.0);
    let c7 = (c2 * c5 + c3 * c4) * V::splat(2.0 / 20.0);
    let p = V::splat(1.0) + (c2 + (c3 + (c4 + (c5 + (c6 + c7)))));
    let slope = c3 * V::splat(4.0)
        + c4 * V::splat(6.0)
        + c5 * V::splat(8.0)
        + c6 * V::splat(10.0)
        + c7 * V::splat(12.0);
    let slope = V::splat(2.0) - c2 * V::splat(2.0) - slope;
    let v = h2 / p;
    (v, v * slope * h / (h2 * p))
}
