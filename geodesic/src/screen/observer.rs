//! Place of the observer, and the photon that arrives at a point of the screen.

use crate::error::{Error, check};
use crate::numbers::compensated::Double;
use crate::numbers::dual::Dual;
use crate::numbers::scalar::{Elementary, Scalar};
use crate::spacetime::kerr::Kerr;
use crate::spacetime::radial::RadialPotential;

/// The farthest place of an observer or a camera that is not at infinity, in M: squares of squares of the radius have to
/// be numbers.
pub(crate) const FARTHEST: f64 = 1e30;

/// The angle between the spin axis and the line of sight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inclination<T: Elementary = f64> {
    radians: T,
    sin: T,
    cos: T,
    /// Sine and cosine with twice the digits: they decide the fate of near-critical rays.
    wide: [T::Wide; 2],
}

impl Inclination {
    /// Takes degrees in \[0, 180\]; 0°, 90° and 180° are exact.
    ///
    /// # Errors
    /// If `degrees` is outside the range.
    pub fn from_degrees(degrees: f64) -> Result<Self, Error> {
        let allowed = "an angle in [0, 180] degrees";
        check("inclination", degrees, (0.0..=180.0).contains(&degrees), allowed)?;
        // Reduced to the nearest axis, so that the sine or cosine that vanishes is exactly 0.
        let angle = |degrees: f64| {
            let exact = Double::from(degrees) * Double::PI / Double::from(180.0);
            exact.sin_cos()
        };
        let (sin, cos) = if degrees < 45.0 {
            angle(degrees)
        } else if degrees <= 135.0 {
            let (s, c) = angle(90.0 - degrees);
            (c, s)
        } else {
            let (s, c) = angle(180.0 - degrees);
            (s, -c)
        };
        Ok(Self::of(degrees.to_radians(), sin, cos))
    }

    /// The same angle with all digits of its sine and cosine.
    pub fn widen(self) -> Inclination<Double> {
        let [sin, cos] = self.wide;
        Inclination::of(Double::from(self.radians), sin, cos)
    }

    /// The same angle as parameter number `k` of dual numbers: what follows from it carries
    /// derivatives per radian. Angles that are exact in degrees stay exact.
    pub fn parameter<const D: usize>(self, k: usize) -> Inclination<Dual<f64, D>> {
        let [sin, cos] = self.wide;
        let with = |value, slope: Double| {
            let mut number = Dual::parameter(value, k);
            number.slope = number.slope.map(|unit| unit * slope);
            number
        };
        Inclination::of(Dual::parameter(self.radians, k), with(sin, cos), with(cos, -sin))
    }

    /// The same angle as a constant of another kind of number.
    pub fn lift<T: Elementary>(self) -> Inclination<T> {
        let wide = |x: Double| T::Wide::constant(x.hi) + T::Wide::constant(x.lo);
        let [sin, cos] = self.wide.map(wide);
        Inclination::of(T::constant(self.radians), sin, cos)
    }
}

impl<T: Elementary> Inclination<T> {
    /// Takes radians in \[0, π\], at face value: the double nearest to π/2 is an inclination 6e-17 short of the equator.
    ///
    /// # Errors
    /// If `radians` is outside the range.
    pub fn from_radians(radians: T) -> Result<Self, Error> {
        let angle = radians.value();
        let ok = (0.0..=core::f64::consts::PI).contains(&angle);
        check("inclination", angle, ok, "an angle in [0, pi] radians")?;
        let (sin, cos) = radians.widen().sin_cos();
        Ok(Self::of(radians, sin, cos))
    }

    fn of(radians: T, sin: T::Wide, cos: T::Wide) -> Self {
        Inclination { radians, sin: T::narrow(sin), cos: T::narrow(cos), wide: [sin, cos] }
    }

    /// The angle in radians.
    pub fn radians(&self) -> T {
        self.radians
    }

    /// sin i.
    pub fn sin(&self) -> T {
        self.sin
    }

    /// cos i.
    pub fn cos(&self) -> T {
        self.cos
    }
}

/// An observer who labels arriving photons by Bardeen's screen coordinates.
///
/// α grows to the right on the sky (towards +φ), β upwards (towards the projected spin
/// axis); both in units of M. For a photon of energy E = 1 at infinity
/// λ = L/E = −α sin i, η = Q/E² = (α² − a²) cos²i + β², and p^θ at the observer has the
/// sign of β (Bardeen 1973). At a finite radius (α, β) stay what they are at infinity:
/// labels of the constants of motion, not angles of a local frame.
///
/// Use it for images as a distant astronomer sees them. [`Camera`](crate::Camera) has the local frame,
/// lens and motion of someone near the hole, and [`View`](crate::View) is either of the two.
///
/// ```
/// use kerrlight_geodesic::{Inclination, Kerr, Observer};
///
/// let observer = Observer::at_infinity(Inclination::from_degrees(30.0)?);
/// assert!((observer.lambda(-4.0) - 2.0).abs() < 1e-15); // λ = −α sin i, in M
///
/// // Nearby, some photons turn back before they arrive.
/// let hole = Kerr::new(0.5)?;
/// let near = Observer::at_radius(Inclination::from_degrees(30.0)?, 10.0)?;
/// assert!(near.ray(&hole, 5.0, 0.0).is_ok());
/// assert_eq!(near.ray(&hole, 50.0, 0.0).unwrap_err().field(), "observer radius");
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observer<T: Elementary = f64> {
    inclination: Inclination<T>,
    azimuth: f64,
    inverse_radius: f64,
}

impl Observer {
    /// The same observer for numbers of twice the precision.
    pub fn widen(self) -> Observer<Double> {
        let Observer { inclination, azimuth, inverse_radius } = self;
        Observer { inclination: inclination.widen(), azimuth, inverse_radius }
    }
}

impl<T: Elementary> Observer<T> {
    /// An observer infinitely far away, at azimuth 0.
    pub fn at_infinity(inclination: Inclination<T>) -> Self {
        Observer { inclination, azimuth: 0.0, inverse_radius: 0.0 }
    }

    /// An observer at Boyer–Lindquist radius `radius` in (2, 1e30\] M (outside the ergosphere of every spin), at
    /// azimuth 0.
    ///
    /// # Errors
    /// If `radius` is out of that range.
    pub fn at_radius(inclination: Inclination<T>, radius: f64) -> Result<Self, Error> {
        let ok = radius > 2.0 && radius <= FARTHEST;
        check("observer radius", radius, ok, "above 2 and at most 1e30 (M)")?;
        Ok(Observer { inclination, azimuth: 0.0, inverse_radius: 1.0 / radius })
    }

    /// The same observer at azimuth `azimuth` (radians).
    pub fn with_azimuth(mut self, azimuth: f64) -> Self {
        self.azimuth = azimuth;
        self
    }

    /// The same place seen under another inclination, or with one of another kind of number.
    pub fn with_inclination<U: Elementary>(&self, inclination: Inclination<U>) -> Observer<U> {
        Observer { inclination, azimuth: self.azimuth, inverse_radius: self.inverse_radius }
    }

    /// The inclination.
    pub fn inclination(&self) -> Inclination<T> {
        self.inclination
    }

    /// The azimuth, in radians.
    pub fn azimuth(&self) -> f64 {
        self.azimuth
    }

    /// Returns whether the observer is infinitely far away.
    pub fn is_at_infinity(&self) -> bool {
        self.inverse_radius == 0.0
    }

    /// 1/r of the observer in M⁻¹: 0 at infinity.
    pub fn inverse_radius(&self) -> f64 {
        self.inverse_radius
    }

    /// λ = L/E of the photons that arrive at α: −α sin i.
    pub fn lambda(&self, alpha: T) -> T {
        -(alpha * self.inclination.sin)
    }

    /// The photon that arrives at (α, β), followed backward in time.
    ///
    /// # Errors
    /// If α or β is not in \[−1e12, 1e12\], if the azimuth is not finite, or if no photon with these constants reaches the
    /// observer's radius (a finite observer inside the turning point).
    pub fn ray(&self, hole: &Kerr<T>, alpha: T, beta: T) -> Result<Ray<T>, Error> {
        let (x, y) = (alpha.value(), beta.value());
        check("alpha", x, x.abs() <= 1e12, "a number in [-1e12, 1e12] (M)")?;
        check("beta", y, y.abs() <= 1e12, "a number in [-1e12, 1e12] (M)")?;
        check("observer azimuth", self.azimuth, self.azimuth.is_finite(), "a finite angle")?;
        let (sin, cos) = (self.inclination.sin, self.inclination.cos);
        let a = hole.spin();
        let wide = [a, alpha, beta].map(T::widen);
        let horizon = (T::constant(1.0) / hole.horizon()).widen();
        let coefficients = screen_coefficients(wide, self.inclination.wide);
        let potential = RadialPotential::new(coefficients, horizon).narrow(T::narrow);
        let w = self.inverse_radius;
        if potential.value(T::constant(w)).value() < 0.0 {
            return Err(Error::out_of_range(
                "observer radius",
                1.0 / w,
                "outside the turning point of the ray (alpha, beta)",
            ));
        }
        let zero = T::constant(0.0);
        Ok(Ray {
            lambda: self.lambda(alpha),
            eta: (alpha - a) * (alpha + a) * cos * cos + beta * beta,
            angular: alpha * alpha + beta * beta - a * a * cos * cos,
            position: [sin, zero, cos],
            velocity: [-(beta * cos), alpha, beta * sin],
            rotation_sign: if x.is_sign_negative() { -1.0 } else { 1.0 },
            azimuth: self.azimuth,
            inverse_radius: w,
            inward: true,
            is_from_horizon: false,
            potential,
            spin: a.value(),
        })
    }
}

/// A, B, C of the radial potential as sums of squares of the screen coordinates, with
/// twice the working precision: near the critical curve they decide the ray's fate.
fn screen_coefficients<W: Elementary>([a, alpha, beta]: [W; 3], [sin, cos]: [W; 2]) -> [W; 3] {
    let two = W::constant(2.0);
    let (a2, cos2) = (a * a, cos * cos);
    let (alpha2, beta2) = (alpha * alpha, beta * beta);
    let shifted = alpha + a * sin;
    let quad = a2 + a2 * cos2 - alpha2 - beta2;
    let cubic = two * (shifted * shifted + beta2);
    let quartic = -(a2 * ((alpha2 - a2) * cos2 + beta2));
    [quad, cubic, quartic]
}

/// A photon's constants of motion and where the backward trace of it starts.
#[derive(Debug, Clone, Copy)]
pub struct Ray<T = f64> {
    /// λ = L/E.
    pub lambda: T,
    /// η = Q/E².
    pub eta: T,
    /// η + λ², the conserved square of the angular velocity on the sphere but for a²u².
    pub angular: T,
    /// The starting point on the unit sphere, n = (sin θ cos φ, sin θ sin φ, cos θ), with
    /// the observer's azimuth left out.
    pub position: [T; 3],
    /// dn/dτ of the backward ray without frame dragging.
    pub velocity: [T; 3],
    /// Sense in which the backward ray turns about the axis (the sign of −λ; that of α,
    /// signed zeros included, where λ = 0).
    pub rotation_sign: f64,
    /// Azimuth of the observer in radians, added to every azimuth of the ray.
    pub azimuth: f64,
    /// 1/r of the starting point, M⁻¹.
    pub inverse_radius: f64,
    /// True if the backward ray starts towards the hole.
    pub inward: bool,
    /// True if the photon has no positive energy at infinity, which there is inside the ergosphere alone: it comes from
    /// the horizon. Its path is [captured](crate::Outcome::Captured) where it starts, and not followed through the
    /// ergosphere; the constants above are those for unit energy in the frame of zero angular momentum.
    pub is_from_horizon: bool,
    /// The radial potential W(w).
    pub potential: RadialPotential<T>,
    /// Spin of the hole that the photon passes.
    pub(crate) spin: f64,
}

impl<T: Elementary> Ray<T> {
    /// Checks that this ray was made for `hole`.
    pub(crate) fn check_hole(&self, hole: &Kerr<T>) -> Result<(), Error> {
        check_hole(self.spin, hole.spin().value())
    }
}

/// Checks that what was made for a hole of spin `own` is used with one of spin `given`.
pub(crate) fn check_hole(own: f64, given: f64) -> Result<(), Error> {
    check("spin", given, own == given, "the spin that the ray or the camera was made for")?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_inclinations_in_degrees() {
        let at = |d| Inclination::from_degrees(d).unwrap();
        assert_eq!((at(0.0).sin(), at(0.0).cos()), (0.0, 1.0));
        assert_eq!((at(90.0).sin(), at(90.0).cos()), (1.0, 0.0));
        assert_eq!((at(180.0).sin(), at(180.0).cos()), (0.0, -1.0));
        assert!((at(60.0).cos() - 0.5).abs() < 1e-16);
        for i in 1..180 {
            let d = f64::from(i);
            assert!((at(d).sin() - d.to_radians().sin()).abs() < 4e-16);
            assert!((at(d).cos() - d.to_radians().cos()).abs() < 4e-16);
        }
        assert!(Inclination::from_degrees(180.1).is_err());
        assert!(Inclination::from_radians(f64::NAN).is_err());
    }

    /// u'² = U(u) = η + A u² − a² u⁴ and |n'|² = η + λ² + a²u² at the start.
    #[test]
    fn exact_constraints_at_the_start() {
        let hole = Kerr::new(0.8).unwrap();
        for (i, alpha, beta) in [(17.0, 3.0, -2.0), (90.0, -5.0, 0.5), (0.0, 1.0, 2.0)] {
            let observer = Observer::at_infinity(Inclination::from_degrees(i).unwrap());
            let ray = observer.ray(&hole, alpha, beta).unwrap();
            let (u, du) = (ray.position[2], ray.velocity[2]);
            let a2 = hole.spin().powi(2);
            let quad = a2 - ray.eta - ray.lambda.powi(2);
            assert!((du * du - (ray.eta + quad * u * u - a2 * u.powi(4))).abs() < 1e-13);
            let speed: f64 = ray.velocity.iter().map(|v| v * v).sum();
            assert!((speed - (ray.angular + a2 * u * u)).abs() < 1e-13);
            assert!((ray.angular - (ray.eta + ray.lambda.powi(2))).abs() < 1e-13);
        }
    }
}
