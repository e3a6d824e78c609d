//! The radial potential W(w) = (dw/dτ)², w = 1/r, and what it allows a ray to do.

use crate::numbers::scalar::Elementary;

/// W(w) = 1 + A w² + B w³ + C w⁴ with A = a² − η − λ², B = 2\[η + (λ − a)²\], C = −a²η
/// (the quartic R(r) of Gralla & Lupsasca 2020, arXiv:1910.12881, times w⁴).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialPotential<T = f64> {
    /// A, B and C.
    pub coefficients: [T; 3],
    /// w at the horizon.
    pub horizon: T,
    /// The minimum of W between infinity and the horizon, if there is one there or at most a
    /// little behind the horizon.
    pub barrier: Option<Barrier<T>>,
}

/// The minimum of W outside the horizon: where it is negative the ray turns. If the minimum
/// lies a little behind the horizon, as for rays next to the straight part of an extremal
/// hole's critical curve, it is the horizon itself, where W is a square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barrier<T = f64> {
    /// The w = 1/r in M⁻¹ at which W is smallest, to the nearest double.
    pub w: f64,
    /// W there, rounded from twice the working precision.
    pub height: T,
    /// dW/dw there: 0 within rounding, but at a horizon with the minimum behind it.
    pub slope: T,
    /// Coefficients of (w − w_min)², ³ and ⁴.
    pub expansion: [T; 3],
}

impl<T: Elementary> Barrier<T> {
    /// W at a distance x = w − w_min, without cancellation near the minimum.
    fn value(&self, x: T) -> T {
        let [c2, c3, c4] = self.expansion;
        self.height + x * (self.slope + x * (c2 + x * (c3 + x * c4)))
    }

    /// The distance in w = 1/r (M⁻¹) from the minimum at which W differs from its least value by as much
    /// as that value itself: how closely the ray approaches the spherical photon orbit.
    pub fn width(&self) -> f64 {
        (self.height.value() / self.expansion[0].value()).abs().sqrt()
    }

    fn narrow<N>(self, narrow: impl Fn(T) -> N) -> Barrier<N> {
        let Barrier { w, height, slope, expansion } = self;
        let height = narrow(height);
        Barrier { w, height, slope: narrow(slope), expansion: expansion.map(narrow) }
    }
}

impl<T: Elementary> RadialPotential<T> {
    /// Takes A, B, C and w at the horizon.
    pub(crate) fn new(coefficients: [T; 3], horizon: T) -> Self {
        let barrier = barrier(&coefficients, horizon.value());
        RadialPotential { coefficients, horizon, barrier }
    }

    /// The same with less precision.
    pub(crate) fn narrow<N>(self, narrow: impl Fn(T) -> N) -> RadialPotential<N> {
        RadialPotential {
            coefficients: self.coefficients.map(&narrow),
            horizon: narrow(self.horizon),
            barrier: self.barrier.map(|barrier| barrier.narrow(&narrow)),
        }
    }

    /// W(w).
    pub fn value(&self, w: T) -> T {
        if let Some(barrier) = &self.barrier {
            let x = w - T::constant(barrier.w);
            // Near the barrier the terms cancel; far from it the expansion about it does.
            if x.value().abs() < 0.25 * barrier.w {
                return barrier.value(x);
            }
        }
        let [a, b, c] = self.coefficients;
        T::constant(1.0) + w * w * (a + w * (b + w * c))
    }

    /// dW/dw.
    pub fn slope(&self, w: T) -> T {
        let [two, three, four] = [2.0, 3.0, 4.0].map(T::constant);
        if let Some(barrier) = &self.barrier {
            let x = w - T::constant(barrier.w);
            if x.value().abs() < 0.25 * barrier.w {
                let [c2, c3, c4] = barrier.expansion;
                return barrier.slope + x * (two * c2 + x * (three * c3 + x * four * c4));
            }
        }
        let [a, b, c] = self.coefficients;
        w * (two * a + w * (three * b + w * four * c))
    }

    /// Returns whether a ray from far away falls into the hole: W has no root outside the horizon.
    pub fn captures(&self) -> bool {
        self.barrier.is_none_or(|barrier| barrier.height.value() >= 0.0)
    }

    /// w at the turning point of a ray that comes from outside, if it turns.
    pub fn outer_turning_point(&self) -> Option<T> {
        self.turning_barrier().map(|b| self.root_between(0.0, b.w))
    }

    /// w at the turning point of a ray that comes from inside the barrier, if it turns.
    pub fn inner_turning_point(&self) -> Option<T> {
        self.turning_barrier().map(|b| self.root_between(self.horizon.value(), b.w))
    }

    fn turning_barrier(&self) -> Option<Barrier<T>> {
        self.barrier.filter(|b| b.height.value() < 0.0)
    }

    /// The root of W between a point where W ≥ 0 and the barrier, where W < 0: Newton's
    /// method inside a shrinking bracket, then two steps of it in full.
    fn root_between(&self, mut positive: f64, mut negative: f64) -> T {
        // W is nearly a parabola about the barrier: its root is where Newton starts.
        let mut w = negative;
        if let Some(barrier) = &self.barrier {
            let step = barrier.width().min((positive - negative).abs());
            w = negative + step.copysign(positive - negative);
        }
        for _ in 0..100 {
            let value = self.value(T::constant(w)).value();
            if value == 0.0 {
                break;
            }
            if value > 0.0 {
                positive = w
            } else {
                negative = w
            }
            let newton = w - value / self.slope(T::constant(w)).value();
            let inside = (newton - positive) * (newton - negative) < 0.0;
            let next = if inside { newton } else { 0.5 * (positive + negative) };
            let done = (next - w).abs() <= f64::EPSILON * w;
            w = next;
            if done {
                break;
            }
        }
        self.polish(T::constant(w))
    }

    /// Brings the digits and derivatives of a number wider than a double to the root.
    fn polish(&self, root: T) -> T {
        if T::IS_PLAIN {
            return root;
        }
        let once = root - self.value(root) / self.slope(root);
        once - self.value(once) / self.slope(once)
    }
}

/// dW/dw = w (2A + 3B w + 4C w²): with W(0) = 1 and W ≥ 0 at the horizon, W has roots
/// outside the horizon only if its first minimum lies there and is negative.
fn barrier<T: Elementary>(coefficients: &[T; 3], horizon: f64) -> Option<Barrier<T>> {
    let [a, b, c] = coefficients.map(T::value);
    if a >= 0.0 {
        return None;
    }
    let discriminant = 9.0 * b * b - 32.0 * a * c;
    if discriminant < 0.0 {
        return None;
    }
    let w = -4.0 * a / (3.0 * b + discriminant.sqrt());
    if w.is_nan() || w > 1.1 * horizon {
        return None;
    }
    let behind = w > horizon * (1.0 - 8.0 * f64::EPSILON);
    let w = if behind { horizon } else { w };
    let x = T::constant(w);
    let [da, db, dc] = *coefficients;
    let [one, two, three, four, six] = [1.0, 2.0, 3.0, 4.0, 6.0].map(T::constant);
    let height = one + x * x * (da + x * (db + x * dc));
    let zero = T::constant(0.0);
    Some(Barrier {
        w,
        height: if behind && height.value() < 0.0 { zero } else { height },
        slope: x * (two * da + x * (three * db + x * (four * dc))),
        expansion: [da + x * (three * db + x * (six * dc)), db + x * (four * dc), dc],
    })
}

#[cfg(test)]
mod tests {
    use crate::{Inclination, Kerr, Observer};

    fn ray(spin: f64, degrees: f64, alpha: f64, beta: f64) -> crate::Ray {
        let hole = Kerr::new(spin).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
        observer.ray(&hole, alpha, beta).unwrap()
    }

    /// The critical impact parameter of Schwarzschild is 3√3; 1e-15 is 5 units in its last place.
    #[test]
    fn exact_schwarzschild_fate_next_to_the_critical_curve() {
        let critical = 27f64.sqrt();
        for degrees in [0.0, 17.0, 60.0, 90.0] {
            assert!(ray(0.0, degrees, 0.0, critical * (1.0 - 1e-15)).potential.captures());
            assert!(!ray(0.0, degrees, 0.0, critical * (1.0 + 1e-15)).potential.captures());
        }
    }

    /// Bardeen 1973: critical λ at 90° inclination (spin a → −a mirrors the screen).
    #[test]
    fn paper_critical_impact_parameters_of_equatorial_rays() {
        let cases = [(0.9, 2.8444214035, -6.8323192304), (0.99, 2.2517243354, -6.9833234311)];
        for (spin, prograde, retrograde) in cases {
            for (lambda, outside) in [(prograde, 1.0), (retrograde, -1.0f64)] {
                let alpha = -lambda;
                let step = 2e-10f64.copysign(-outside);
                assert!(!ray(spin, 90.0, alpha + step, 0.0).potential.captures());
                assert!(ray(spin, 90.0, alpha - step, 0.0).potential.captures());
                assert!(!ray(-spin, 90.0, -alpha - step, 0.0).potential.captures());
                assert!(ray(-spin, 90.0, -alpha + step, 0.0).potential.captures());
            }
        }
    }

    #[test]
    fn exact_turning_points_are_roots_from_far_to_near_critical() {
        let cases = [
            (0.0, 5.2, 1.0),
            (0.0, 1e6, 0.0),
            (0.94, 7.0, 3.0),
            (0.5, -27f64.sqrt() + 1e-9, 2.0),
            (-1.0, 1e3, -1e3),
            (0.94, 0.5, 6.0),
        ];
        for (spin, alpha, beta) in cases {
            let p = ray(spin, 60.0, alpha, beta).potential;
            let w = p.outer_turning_point().expect("turns");
            let scale = 1e-14 * (p.slope(w) * w).abs() + 1e-30;
            assert!(p.value(w).abs() < scale, "{spin} {alpha} {beta}: W = {:e}", p.value(w));
            assert!(w > 0.0 && w < p.horizon);
        }
        // b = r/√(1 − 2/r) of Schwarzschild at r = 10.
        let b = 10.0 / (1.0f64 - 0.2).sqrt();
        let w = ray(0.0, 30.0, b, 0.0).potential.outer_turning_point().unwrap();
        assert!((w * 10.0 - 1.0).abs() < 1e-15);
    }
}
