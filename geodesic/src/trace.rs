//! From a ray's initial data to its path.

use crate::error::{OutOfRange, check};
use crate::kerr::Kerr;
use crate::mino::{System, has_azimuth, has_time, index};
use crate::observer::Ray;
use crate::path::{Outcome, Path, Segment, Unresolved, turn};
use crate::runge_kutta::{DormandPrince5, DormandPrince8};
use crate::scalar::Elementary;
use crate::stepper::{LONGEST_STEP, Made, RungeKutta, State, Stepper, Taylor};
use crate::uncertainty::Budget;

/// What a ray is asked for beyond r and θ. What is not asked for is not integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Want {
    /// Azimuth, direction and angular velocity.
    pub azimuth: bool,
    /// Coordinate time.
    pub time: bool,
}

impl Want {
    /// r and θ alone.
    pub const POLAR: Want = Want { azimuth: false, time: false };
    /// Everything.
    pub const ALL: Want = Want { azimuth: true, time: true };
}

/// How a ray is followed in Mino time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Method {
    /// The adaptive Runge–Kutta method of order 5(4) of Dormand & Prince (1980), with quintic
    /// dense output: `rk45-mino`.
    Rk45,
    /// The adaptive Runge–Kutta method of order 8(5,3) of Hairer, Nørsett & Wanner (1993),
    /// with dense output of degree 9: `dop853-mino`.
    Dop853,
    /// Taylor series of an order that grows with the digits asked for, which are their own
    /// dense output: `taylor-mino`. The fastest at every tolerance, and the default.
    #[default]
    Taylor,
}

impl Method {
    /// All of them, in the order of their cost at low precision.
    pub const ALL: [Method; 3] = [Method::Rk45, Method::Dop853, Method::Taylor];

    /// The name that commands, files and documents use.
    pub fn name(self) -> &'static str {
        match self {
            Method::Rk45 => "rk45-mino",
            Method::Dop853 => "dop853-mino",
            Method::Taylor => "taylor-mino",
        }
    }
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
    pub fn new(tolerance: f64) -> Result<Self, OutOfRange> {
        Self::with_method(Method::default(), tolerance)
    }

    /// A tracer by a method of choice; see [`new`](Self::new).
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\].
    pub fn with_method(method: Method, tolerance: f64) -> Result<Self, OutOfRange> {
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

    /// Follows `ray` backward to the horizon or to infinity, into `path`.
    pub fn trace(&self, hole: &Kerr, ray: &Ray, want: Want, path: &mut Path) {
        match (want.azimuth, want.time) {
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
/// use kerrlight_geodesic::{Dual, Inclination, Kerr, Observer, Path, Want, trace_series};
/// // Derivatives with respect to spin (0), inclination (1), α (2) and β (3).
/// let hole = Kerr::from_spin(Dual::<f64, 4>::parameter(0.9, 0))?;
/// let observer = Observer::at_infinity(Inclination::from_radians(Dual::parameter(1.0, 1))?);
/// let ray = observer.ray(&hole, Dual::parameter(-6.0, 2), Dual::parameter(2.0, 3))?;
/// let mut path = Path::empty();
/// trace_series(1e-13, &hole, &ray, Want::ALL, &mut path)?;
/// let hit = path.at(path.equatorial_crossings().next().unwrap());
/// println!("r = {}, dr/da = {}", hit.radius().value, hit.radius().slope[0]);
/// # Ok::<(), kerrlight_geodesic::OutOfRange>(())
/// ```
///
/// # Errors
/// If `tolerance` is not in \[1e-30, 1e-2\]; below the number's own rounding it counts as
/// that.
pub fn trace_series<T: Elementary>(
    tolerance: f64,
    hole: &Kerr<T>,
    ray: &Ray<T>,
    want: Want,
    path: &mut Path<T>,
) -> Result<(), OutOfRange> {
    let ok = (1e-30..=1e-2).contains(&tolerance);
    check("tolerance", tolerance, ok, "a number in [1e-30, 1e-2]")?;
    let tolerance = TAYLOR_MARGIN * tolerance;
    let stepper = || Taylor::new::<T>(tolerance);
    match (want.azimuth, want.time) {
        (false, false) => Run::<T, _, 4>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
        (false, true) => Run::<T, _, 5>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
        (true, false) => Run::<T, _, 9>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
        (true, true) => Run::<T, _, 10>::new(hole, ray, tolerance, path, stepper()).go(MAX_STEPS),
    }
    Ok(())
}

/// One ray under way, with `N` variables.
struct Run<'a, T, M, const N: usize> {
    state: State<'a, T, N>,
    stepper: M,
    path: &'a mut Path<T>,
    s: T,
    constants: [T; 2],
    turned: T,
    budget: Budget,
}

impl<'a, T: Elementary, M: Stepper<T, N>, const N: usize> Run<'a, T, M, N> {
    fn new(
        hole: &Kerr<T>,
        ray: &'a Ray<T>,
        tolerance: f64,
        path: &'a mut Path<T>,
        stepper: M,
    ) -> Self {
        let system = System::new(hole, ray);
        path.reset::<N>(hole, ray, system.scale);
        path.width = stepper.width();
        let leg = if ray.inward { 1.0 } else { -1.0 };
        let y = system.start::<N>(ray, leg);
        let (w, way) = (T::constant(ray.inverse_radius), T::constant(leg));
        let azimuth = T::constant(ray.azimuth) - way * hole.azimuth_closed_form(w);
        let time = if ray.inverse_radius > 0.0 { way * hole.tortoise(w) } else { T::constant(0.0) };
        let state = State { ray, system, tolerance, y, leg };
        let constants = [azimuth, time];
        let budget = Budget::default();
        Run {
            state,
            stepper,
            path,
            s: T::constant(0.0),
            constants,
            turned: start_angle(ray),
            budget,
        }
    }

    fn go(mut self, max_steps: u32) {
        self.stepper.restart(&self.state, &mut self.path.series);
        for _ in 0..max_steps {
            let made = self.stepper.step(&self.state, &mut self.path.series, LONGEST_STEP);
            let Some(made) = made else { continue };
            let h = made.h;
            let ended = self.accept(made);
            if ended {
                return;
            }
            if let Some(outcome) = self.stalled(h) {
                self.path.end = self.s;
                self.path.outcome = outcome;
                return;
            }
        }
        self.path.end = self.s;
        self.path.outcome = Outcome::Unresolved(Unresolved::StepLimit);
    }

    /// What becomes of a ray that no longer moves in radius within rounding.
    fn stalled(&self, h: f64) -> Option<Outcome> {
        let (w, rate) = (self.state.y[index::W].value(), self.state.y[index::DW].value());
        let [a, b, c] = self.state.system.radial().map(T::value);
        let pull = w * (a + w * (b + w * c));
        if rate.abs() * h > 2.0 * T::EPSILON * w || pull.abs() > 1e4 * T::EPSILON {
            return None;
        }
        let horizon = self.state.system.scale * self.state.ray.potential.horizon.value();
        let at_horizon = w >= horizon * (1.0 - 1e-12) && self.may_fall();
        let lost = Outcome::Unresolved(Unresolved::PhotonOrbit);
        Some(if at_horizon { Outcome::Captured } else { lost })
    }

    /// Takes the step into the path; true if the ray has ended in it.
    fn accept(&mut self, made: Made<T, N>) -> bool {
        let Made { h, mut y, error } = made;
        let projected = self.project(&mut y);
        self.spend(&error, &y, h, projected);
        let before = [index::X, index::Y]
            .map(|k| [self.state.y[k.min(N - 1)], self.state.y[(k + 1).min(N - 1)]]);
        let path = &mut *self.path;
        self.stepper.dense(&self.state, &y, h, &mut path.series, &mut path.coefficients);
        path.segments.push(Segment {
            s: self.s,
            h,
            leg: self.state.leg,
            constants: self.constants,
            turned: self.turned,
            budget: self.budget,
        });
        let from = side(&self.state.y);
        self.state.y = y;
        if has_azimuth(N) {
            let after = [self.state.y[index::X], self.state.y[index::Y]];
            self.turned = self.turned + turn(self.path.rotation_sign, before, after);
        }
        let ended = self.handle_events(from);
        self.s = self.s + T::constant(h);
        ended
    }

    /// Adds the errors of a step to the budget: see [`uncertainty`](crate::uncertainty).
    fn spend(&mut self, error: &[f64; N], y: &[T; N], h: f64, projected: bool) {
        let eps = T::EPSILON;
        let [a, b, c] = self.state.system.radial().map(T::value);
        let (w, rate) = (y[index::W].value(), y[index::DW].value());
        let pull = w * (a + w * (b + w * c));
        // What the terms of the equation are rounded by.
        let rounding = eps * (w.abs() + h * rate.abs());
        let kick = eps * h * w.abs() * (a.abs() + w.abs() * (b.abs() + w.abs() * c.abs()));
        let speed = rate.hypot(pull).max(1e-300);
        // An error of dw/dτ that the projection has removed does no harm.
        let jerk = if projected { 0.0 } else { error[index::DW].abs() };
        let truncation = (error[index::W].abs() + jerk) / speed;
        let blur = (rounding + kick) / speed;
        self.budget.rounding += blur * blur;
        // Off dw/dτ = ±√W the error of W stays, and speeds the ray up or slows it down.
        let slip = error[index::W].abs() + rounding;
        let energy = 2.0 * (rate.abs() * (jerk + kick) + pull.abs() * slip);
        self.budget.energy = if projected { 0.0 } else { self.budget.energy + energy };
        let truncation = truncation + 0.5 * h * self.budget.energy / (speed * speed);
        self.budget.phase += truncation;
        self.budget.local = error[index::W].abs() / w.abs().max(1e-300);
        let mut turn = error[index::U].abs() + error[index::DU].abs();
        if has_azimuth(N) {
            for k in [index::X, index::DX, index::Y, index::DY] {
                turn = turn.max(error[k].abs());
            }
        }
        self.budget.direction += turn + eps * (1.0 + h);
        if !has_azimuth(N) && !has_time(N) {
            return;
        }
        // The quadratures dwell longer or shorter where the step's phase is wrong, and know
        // their slope as well as the denominator g.
        let way = T::constant(self.state.leg);
        let g = self.state.system.blur(&self.state.y, way).value().abs();
        let dwell = (truncation + blur) / h + 4.0 * eps * g;
        let quadrature = |k: usize| {
            let (start, end) = (self.state.y[k].value(), y[k].value());
            error[k].abs() + (end - start).abs() * dwell + eps * (end.abs() + h)
        };
        if has_azimuth(N) {
            self.budget.azimuth += quadrature(index::AZIMUTH);
        }
        if has_time(N) {
            self.budget.delay += quadrature(N - 1);
        }
    }

    /// Puts dw/dτ back on dw/dτ = ±√W wherever the root is well conditioned. Next to the
    /// critical curve this is what keeps the ray on its own side of the barrier. Whether it
    /// did.
    fn project(&self, y: &mut [T; N]) -> bool {
        let potential = &self.state.ray.potential;
        let value = potential.value(y[index::W] / T::constant(self.state.system.scale));
        let floor = match &potential.barrier {
            Some(barrier) if barrier.height.value() < 0.0 => barrier.height.value().abs().min(0.25),
            Some(_) => 0.0,
            None => 0.25,
        };
        if value.value() <= floor {
            return false;
        }
        let sign = if potential.captures() { self.state.leg } else { y[index::DW].value() };
        y[index::DW] = value.sqrt() * T::constant(1f64.copysign(sign));
        true
    }

    /// Looks for events in the step just taken; true if the ray has ended in it.
    fn handle_events(&mut self, from: bool) -> bool {
        let k = self.path.segments.len() - 1;
        let (s, h) = (self.s, T::constant(self.path.segments[k].h));
        let ended = self.end_of_ray(k).map(|(x, outcome)| (s + h * x, outcome));
        if from != side(&self.state.y) {
            let zero = T::constant(0.0);
            let s = s + h * self.path.polynomial(k, 1).solve(zero, 0.0, 1.0);
            if ended.is_none_or(|(end, _)| s.value() < end.value()) {
                self.path.crossings.push(s);
            }
        }
        let turned = self.state.leg * self.state.y[index::DW].value() < 0.0;
        if turned {
            let potential = &self.state.ray.potential;
            self.path.turning = Some(s + h * self.path.polynomial(k, 0).solve_slope());
            self.path.turning_w = if self.state.leg > 0.0 {
                potential.outer_turning_point()
            } else {
                potential.inner_turning_point()
            };
        }
        if let Some((end, outcome)) = ended {
            self.path.end = end;
            self.path.outcome = outcome;
            return true;
        }
        if turned {
            self.change_leg();
        }
        false
    }

    /// Where and how the ray ends in segment `k`, if it does.
    fn end_of_ray(&self, k: usize) -> Option<(T, Outcome)> {
        let radial = self.path.polynomial(k, 0);
        let (w, rate) = (self.state.y[index::W], self.state.y[index::DW].value());
        let horizon = T::constant(self.state.system.scale) * self.state.ray.potential.horizon;
        // Within rounding: a ray on the straight part of an extremal hole's critical curve
        // approaches the horizon but never reaches it.
        let there = w.value() >= horizon.value() * (1.0 - 64.0 * f64::EPSILON);
        if there && rate >= 0.0 && self.may_fall() {
            let short = w.value() < horizon.value();
            let target = if short { w } else { horizon };
            let mut x = radial.solve(target, 0.0, 1.0);
            if short && !T::IS_PLAIN && rate > 1e-3 {
                // The end's derivatives are those of the horizon, not of where rounding stopped.
                x = x + (horizon - w) / radial.slope(x);
            }
            return Some((x, Outcome::Captured));
        }
        if w.value() <= 0.0 && rate < 0.0 {
            return Some((radial.solve(T::constant(0.0), 0.0, 1.0), Outcome::Escaped));
        }
        None
    }

    /// Whether the potential lets the ray reach the horizon.
    fn may_fall(&self) -> bool {
        let potential = &self.state.ray.potential;
        let outside = |w: f64| self.state.ray.inverse_radius < w;
        potential.captures() || !potential.barrier.is_some_and(|barrier| outside(barrier.w))
    }

    /// On an outward leg g is written with −dw/dτ and the closed forms change sign; the
    /// constants take up the difference.
    fn change_leg(&mut self) {
        let w = self.state.y[index::W] / T::constant(self.state.system.scale);
        let hole = self.path.hole;
        let twice = T::constant(2.0 * self.state.leg);
        self.constants[0] = self.constants[0] + twice * hole.azimuth_closed_form(w);
        self.constants[1] = self.constants[1] - twice * hole.tortoise(w);
        self.state.leg = -self.state.leg;
        self.stepper.restart(&self.state, &mut self.path.series);
    }
}

/// atan2(y, x) at the start; on the axis the direction in which the ray leaves it.
fn start_angle<T: Elementary>(ray: &Ray<T>) -> T {
    let [x, y, _] = ray.position;
    let on_axis = x.value() == 0.0 && y.value() == 0.0;
    let [x, y] = if on_axis { [ray.velocity[0], ray.velocity[1]] } else { [x, y] };
    if x.value() == 0.0 && y.value() == 0.0 {
        return T::constant(y.value().atan2(x.value()));
    }
    y.atan2(x)
}

/// On which side of the equatorial plane a ray is, or is about to be.
fn side<T: Elementary, const N: usize>(y: &[T; N]) -> bool {
    let (u, rate) = (y[index::U].value(), y[index::DU].value());
    if u == 0.0 { rate > 0.0 } else { u > 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Inclination, Observer};

    fn trace(spin: f64, degrees: f64, alpha: f64, beta: f64, tolerance: f64) -> Path {
        let hole = Kerr::new(spin).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
        let ray = observer.ray(&hole, alpha, beta).unwrap();
        let mut path = Path::new();
        Tracer::new(tolerance).unwrap().trace(&hole, &ray, Want::ALL, &mut path);
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
        Tracer::new(1e-12).unwrap().trace(&hole, &ray, Want::ALL, &mut path);
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

    /// What is asked for beside it does not change r and θ.
    #[test]
    fn exact_same_positions_whatever_is_wanted() {
        let hole = Kerr::new(0.94).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(60.0).unwrap());
        let ray = observer.ray(&hole, -4.0, 5.0).unwrap();
        let tracer = Tracer::new(1e-11).unwrap();
        let positions = [(false, false), (false, true), (true, false), (true, true)].map(|w| {
            let mut path = Path::new();
            tracer.trace(&hole, &ray, Want { azimuth: w.0, time: w.1 }, &mut path);
            path.at(0.4 * path.mino_total())
        });
        for p in &positions[1..] {
            assert!((p.radius() / positions[0].radius() - 1.0).abs() < 1e-9);
            assert!((p.cos_theta() - positions[0].cos_theta()).abs() < 1e-9);
        }
        assert_eq!((positions[0].azimuth, positions[0].delay), (0.0, 0.0));
        assert!(positions[1].delay != 0.0 && positions[2].azimuth != 0.0);
    }
}
