//! Tracing: from a ray's initial data to its path.

use crate::error::{Error, check};
use crate::integrate::path::Path;
use crate::integrate::run::Run;
use crate::integrate::runge_kutta::{DormandPrince5, DormandPrince8};
use crate::integrate::stepper::{RungeKutta, Taylor};
use crate::numbers::scalar::Elementary;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::quantities::Quantities;

/// Method by which a ray is followed in Mino time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Method {
    /// The adaptive Runge–Kutta method of order 5(4) of Dormand & Prince (1980), with quintic
    /// dense output: `rk45-mino`.
    Rk45,
    /// The adaptive Runge–Kutta method of order 8(5,3) of Hairer, Nørsett & Wanner (1993),
    /// with dense output of degree 9: `dop853-mino`.
    Dop853,
    /// Taylor series of an order that grows with the digits requested, which are their own
    /// dense output: `taylor-mino`. The fastest at every tolerance, and the default.
    #[default]
    Taylor,
}

/// An adaptive tracer in Mino time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracer {
    method: Method,
    tolerance: f64,
    max_steps: u32,
}

/// A local error that small keeps the sum over the many steps of order 5 near the tolerance.
const RK45_MARGIN: f64 = 0.2;

/// Digits are cheap in a Taylor series, and its error estimate has no safety of its own.
const TAYLOR_MARGIN: f64 = 0.05;

/// Steps after which a ray is given up unless the caller says otherwise.
const MAX_STEPS: u32 = 100_000;

impl Tracer {
    /// A tracer by the default method whose local error per step stays below `tolerance`, in
    /// units in which b·w, the direction, the azimuth and delay/b are of order one (b the
    /// impact parameter). Next to the critical curve the error in w is held to that fraction
    /// of the distance from the photon orbit.
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\].
    pub fn new(tolerance: f64) -> Result<Self, Error> {
        Self::with_method(Method::default(), tolerance)
    }

    /// A tracer by a method of choice; see [`new`](Self::new).
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\].
    pub fn with_method(method: Method, tolerance: f64) -> Result<Self, Error> {
        let ok = (1e-14..=1e-2).contains(&tolerance);
        check("tolerance", tolerance, ok, "a number in [1e-14, 1e-2]")?;
        Ok(Tracer { method, tolerance, max_steps: MAX_STEPS })
    }

    /// The same tracer with another limit on the number of steps of a ray.
    pub fn with_max_steps(mut self, max_steps: u32) -> Self {
        self.max_steps = max_steps;
        self
    }

    /// The tolerance.
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// The method.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Follows `ray` backward to the horizon or to infinity, into `path`. A ray that was made for another hole is
    /// [given up](crate::Unresolved::OtherHole).
    pub fn trace(&self, hole: &Kerr, ray: &Ray, quantities: Quantities, path: &mut Path) {
        match (quantities.azimuth, quantities.time) {
            (false, false) => self.run::<4>(hole, ray, path),
            (false, true) => self.run::<5>(hole, ray, path),
            (true, false) => self.run::<9>(hole, ray, path),
            (true, true) => self.run::<10>(hole, ray, path),
        }
    }

    fn run<const N: usize>(&self, hole: &Kerr, ray: &Ray, path: &mut Path) {
        let (tolerance, limit) = (self.tolerance, self.max_steps);
        match self.method {
            Method::Rk45 => {
                let tolerance = RK45_MARGIN * tolerance;
                let stepper = RungeKutta::<DormandPrince5, N, 7, 3>::new(tolerance);
                Run::<f64, _, N>::new(hole, ray, tolerance, path, stepper).go(limit);
            }
            Method::Dop853 => {
                let stepper = RungeKutta::<DormandPrince8, N, 13, 5>::new(tolerance);
                Run::<f64, _, N>::new(hole, ray, tolerance, path, stepper).go(limit);
            }
            Method::Taylor => {
                let tolerance = TAYLOR_MARGIN * tolerance;
                let stepper = Taylor::new::<f64>(tolerance);
                Run::<f64, _, N>::new(hole, ray, tolerance, path, stepper).go(limit);
            }
        }
    }
}

/// Follows a ray of any kind of number by its Taylor series ([`Method::Taylor`]): with
/// [`Dual`](crate::Dual) numbers the path carries its exact derivatives, with
/// [`Double`](crate::Double) ones about 28 digits.
///
/// ```
/// use kerrlight_geodesic::{Dual, Inclination, Kerr, Observer, Path, Quantities, trace_series};
/// // Derivatives with respect to spin (0), inclination (1), α (2) and β (3).
/// let hole = Kerr::from_spin(Dual::<f64, 4>::parameter(0.9, 0))?;
/// let observer = Observer::at_infinity(Inclination::from_radians(Dual::parameter(1.0, 1))?);
/// let ray = observer.ray(&hole, Dual::parameter(-6.0, 2), Dual::parameter(2.0, 3))?;
/// let mut path = Path::empty();
/// trace_series(1e-13, &hole, &ray, Quantities::ALL, &mut path)?;
/// let hit = path.at(path.equatorial_crossings().next().unwrap());
/// println!("r = {}, dr/da = {}", hit.radius().value, hit.radius().slope[0]);
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
///
/// # Errors
/// If the ray was made for another hole, or `tolerance` is not in \[1e-30, 1e-2\]; below the number's own rounding it
/// counts as that.
pub fn trace_series<T: Elementary>(
    tolerance: f64,
    hole: &Kerr<T>,
    ray: &Ray<T>,
    quantities: Quantities,
    path: &mut Path<T>,
) -> Result<(), Error> {
    ray.check_hole(hole)?;
    let ok = (1e-30..=1e-2).contains(&tolerance);
    check("tolerance", tolerance, ok, "a number in [1e-30, 1e-2]")?;
    let tolerance = TAYLOR_MARGIN * tolerance;
    let stepper = || Taylor::new::<T>(tolerance);
    match (quantities.azimuth, quantities.time) {
        (false, false) => Run::<T, _, 4>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
        (false, true) => Run::<T, _, 5>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
        (true, false) => Run::<T, _, 9>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
        (true, true) => Run::<T, _, 10>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Inclination, Observer, Outcome};

    fn trace(spin: f64, degrees: f64, alpha: f64, beta: f64, tolerance: f64) -> Path {
        let hole = Kerr::new(spin).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
        let ray = observer.ray(&hole, alpha, beta).unwrap();
        let mut path = Path::new();
        Tracer::new(tolerance).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
        path
    }

    /// λ = 2a around an extremal hole: the straight part of the critical curve, |β| < √3.
    /// Beside it rays fall or turn.
    #[test]
    fn exact_fates_on_the_straight_part_of_an_extremal_critical_curve() {
        for tolerance in [1e-12, 1e-9, 1e-6] {
            for beta in [0.0, 0.4, 0.8, 1.6] {
                for (alpha, outcome) in [
                    (2.0, Outcome::Captured),
                    (2.0 * (1.0 + 1e-10), Outcome::Escaped),
                    (2.0 * (1.0 - 1e-10), Outcome::Captured),
                ] {
                    for spin in [1.0, -1.0] {
                        let path = trace(spin, 90.0, -spin * alpha, beta, tolerance);
                        assert_eq!(path.outcome(), outcome, "a = {spin}: ({alpha}, {beta})");
                        assert!(path.steps() < 20_000);
                    }
                }
            }
            assert_eq!(trace(1.0, 90.0, -2.0, 1.8, tolerance).outcome(), Outcome::Escaped);
        }
    }

    /// A ray that leaves a finite observer returns to the observer's radius after twice the
    /// Mino time of its turning point, and reaches infinity later.
    #[test]
    fn exact_symmetry_about_the_turning_point() {
        let hole = Kerr::new(0.7).unwrap();
        let inclination = Inclination::from_degrees(40.0).unwrap();
        let observer = Observer::at_radius(inclination, 50.0).unwrap();
        let ray = observer.ray(&hole, 7.0, 4.0).unwrap();
        let mut path = Path::new();
        Tracer::new(1e-12).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
        let (turning, r_min) = path.turning_point().unwrap();
        assert!((path.at(turning).radius() / r_min - 1.0).abs() < 1e-12);
        for part in [0.0, 0.3, 0.8] {
            let (before, after) = (path.at(part * turning), path.at((2.0 - part) * turning));
            assert!((before.radius() / after.radius() - 1.0).abs() < 1e-10);
            // Rates repeat too: azimuth and time are odd about the turning point but for
            // their polar parts, which a hole without spin does not have.
        }
        assert!((path.at(0.0).radius() / 50.0 - 1.0).abs() < 1e-14);
        assert_eq!((path.at(0.0).azimuth, path.at(0.0).delay.abs() < 1e-12), (0.0, true));
        let mut intervals = Vec::new();
        path.intervals_within(10.0, 20.0, &mut intervals);
        assert_eq!(intervals.len(), 2);
        for (interval, radii) in intervals.iter().zip([[20.0, 10.0], [10.0, 20.0]]) {
            for (mino_time, r) in interval.iter().zip(radii) {
                assert!((path.at(*mino_time).radius() / r - 1.0).abs() < 1e-10);
            }
        }
        path.intervals_within(0.5 * r_min, 20.0, &mut intervals);
        assert_eq!(intervals.len(), 1);
    }
}
