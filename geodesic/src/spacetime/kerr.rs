//! The hole: spin, horizons, and the closed forms in which what is singular at
//! the horizon integrates.

use crate::error::{Error, check};
use crate::numbers::dual::Dual;
use crate::numbers::scalar::Elementary;

/// A Kerr black hole in units G = c = M = 1: its spin, and the radii of its horizons.
///
/// Everything else in the crate takes a hole by reference; it is `Copy`, and making one costs a square
/// root. `T` is `f64`, or one of the numbers that carry derivatives or more digits
/// ([`Kerr::from_spin`]). Radii of orbits are functions of a hole in [`orbits`](crate::orbits).
///
/// ```
/// use kerrlight_geodesic::{Kerr, orbits};
///
/// let hole = Kerr::new(0.6)?;
/// assert!((hole.horizon() - 1.8).abs() < 1e-15); // 1 + √(1 − a²), in M
/// assert!((hole.inner_horizon() - 0.2).abs() < 1e-15);
/// assert_eq!(orbits::isco(&Kerr::new(0.0)?), 6.0);
/// assert!(Kerr::new(f64::NAN).is_err());
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kerr<T = f64> {
    spin: T,
    /// r₊ − r₋ = 2√((1 − a)(1 + a)), free of cancellation as |a| → 1.
    horizon_gap: T,
}

impl Kerr {
    /// A hole with spin `a` ∈ \[−1, 1\] (units of M). A negative spin turns the hole the
    /// other way, so that flows about +z become retrograde.
    ///
    /// # Errors
    /// If `spin` is not in \[−1, 1\] (NaN included).
    pub fn new(spin: f64) -> Result<Self, Error> {
        Self::from_spin(spin)
    }

    /// The same hole, its spin a constant of another kind of number.
    pub fn lift<T: Elementary>(&self) -> Kerr<T> {
        Kerr { spin: T::constant(self.spin), horizon_gap: T::constant(self.horizon_gap) }
    }
}

impl<const D: usize> Kerr<Dual<f64, D>> {
    /// The hole without its derivatives.
    pub(crate) fn values(&self) -> Kerr {
        Kerr { spin: self.spin.value, horizon_gap: self.horizon_gap.value }
    }
}

impl<T: Elementary> Kerr<T> {
    /// A hole whose spin is any kind of number. With derivatives |a| = 1 gives infinite
    /// ones, since dr₊/da diverges there.
    ///
    /// # Errors
    /// If the spin's value is not in \[−1, 1\] (NaN included).
    pub fn from_spin(spin: T) -> Result<Self, Error> {
        let a = spin.value();
        check("spin", a, (-1.0..=1.0).contains(&a), "a number in [-1, 1]")?;
        let one = T::constant(1.0);
        let horizon_gap = T::constant(2.0) * ((one - spin) * (one + spin)).sqrt();
        Ok(Kerr { spin, horizon_gap })
    }

    /// Spin a, in units of M.
    pub fn spin(&self) -> T {
        self.spin
    }

    /// Radius of the outer horizon, r₊ = 1 + √(1 − a²).
    pub fn horizon(&self) -> T {
        T::constant(1.0) + T::constant(0.5) * self.horizon_gap
    }

    /// Radius of the inner horizon, r₋ = a²/r₊ (no cancellation as a → 0).
    pub fn inner_horizon(&self) -> T {
        self.spin * self.spin / self.horizon()
    }

    /// r₊ − r₋.
    pub fn horizon_gap(&self) -> T {
        self.horizon_gap
    }

    /// Δ = r² − 2r + a².
    pub fn delta(&self, r: T) -> T {
        (r - self.horizon()) * (r - self.inner_horizon())
    }

    /// Σ = r² + a² cos²θ.
    pub fn sigma(&self, r: T, cos_theta: T) -> T {
        let polar = self.spin * cos_theta;
        r * r + polar * polar
    }

    /// w/(1 − r₋w) · ln[(r − r₊)/(r − r₋)] / x with x = (r₊ − r₋)w/(1 − r₋w), w = 1/r:
    /// the logarithm of both closed forms below, divided by the gap of the horizons so
    /// that it stays regular for a → 1 and for r → ∞. At the horizon, where it diverges, it
    /// is that of the last double outside.
    fn horizon_log(&self, w: T) -> T {
        let inv = w / (T::constant(1.0) - self.inner_horizon() * w);
        let x = self.horizon_gap * inv;
        let ratio = if x.value() == 0.0 {
            T::constant(-1.0) - T::constant(0.5) * x
        } else if x.value() >= 1.0 - T::EPSILON {
            // The last number outside the horizon.
            T::constant((-1.0 + f64::EPSILON).ln_1p()) / x
        } else {
            (-x).ln_1p() / x
        };
        inv * ratio
    }

    /// ∫_r^∞ −a dr/Δ = \[a/(r₊ − r₋)\] ln\[(r − r₊)/(r − r₋)\] as a function of w = 1/r:
    /// the azimuth's term that is singular at the horizon. Zero at infinity.
    pub fn azimuth_closed_form(&self, w: T) -> T {
        self.spin * self.horizon_log(w)
    }

    /// The tortoise coordinate r* = r + 2 ln(r − r₋) + 2r₊/(r₊ − r₋) · ln\[(r − r₊)/(r − r₋)\]
    /// with dr*/dr = (r² + a²)/Δ, as a function of w = 1/r.
    pub fn tortoise(&self, w: T) -> T {
        T::constant(1.0) / w + self.tortoise_regular(w) - T::constant(2.0) * w.ln()
    }

    /// r* − r − 2 ln r: what is left of the tortoise coordinate at infinity (zero there).
    pub fn tortoise_regular(&self, w: T) -> T {
        let two = T::constant(2.0);
        two * (-(self.inner_horizon() * w)).ln_1p() + two * self.horizon() * self.horizon_log(w)
    }
}

#[cfg(test)]
mod tests {
    use super::Kerr;

    #[test]
    fn exact_horizons() {
        let hole = Kerr::new(0.6).unwrap();
        assert!((hole.horizon() - 1.8).abs() < 1e-15);
        assert!((hole.inner_horizon() - 0.2).abs() < 1e-15);
        assert_eq!(Kerr::new(1.0).unwrap().horizon(), 1.0);
        assert_eq!(Kerr::new(0.0).unwrap().inner_horizon(), 0.0);
    }

    #[test]
    fn spin_outside_the_range_names_the_field() {
        let text = Kerr::new(1.2).unwrap_err().to_string();
        assert!(
            text.contains("spin") && text.contains("1.2") && text.contains("[-1, 1]"),
            "{text}"
        );
        assert!(Kerr::new(f64::NAN).is_err());
    }

    /// d(closed form)/dr against a/Δ and (r² + a²)/Δ by central differences.
    #[test]
    fn exact_derivatives_of_the_closed_forms() {
        for a in [-1.0, -0.5, 0.0, 1e-9, 0.7, 1.0 - 1e-12, 1.0] {
            let hole = Kerr::new(a).unwrap();
            for r in [2.5, 4.0, 30.0] {
                let h = 1e-4 * r;
                let diff = |f: &dyn Fn(f64) -> f64| {
                    let d = |h: f64| (f(1.0 / (r + h)) - f(1.0 / (r - h))) / (2.0 * h);
                    (4.0 * d(h) - d(2.0 * h)) / 3.0
                };
                let delta = r * r - 2.0 * r + a * a;
                let azimuth = diff(&|w| hole.azimuth_closed_form(w));
                assert!((azimuth - a / delta).abs() < 1e-9, "a = {a}, r = {r}: {azimuth}");
                let tortoise = diff(&|w| hole.tortoise(w));
                let expected = (r * r + a * a) / delta;
                assert!((tortoise / expected - 1.0).abs() < 1e-9, "a = {a}, r = {r}");
            }
        }
    }

    #[test]
    fn exact_closed_forms_vanish_at_infinity() {
        for a in [-1.0, 0.0, 0.9] {
            let hole = Kerr::new(a).unwrap();
            assert_eq!(hole.azimuth_closed_form(0.0), 0.0);
            assert_eq!(hole.tortoise_regular(0.0), 0.0);
        }
    }
}
