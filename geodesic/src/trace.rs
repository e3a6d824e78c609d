//! From a ray's initial data to its path.

use crate::error::{OutOfRange, check};
use crate::hermite::Quintic;
use crate::kerr::Kerr;
use crate::mino::{FULL, System, has_azimuth, has_time, index};
use crate::observer::Ray;
use crate::path::{Node, Outcome, Path, Unresolved, turn};
use crate::runge_kutta::{Control, DormandPrince5, Method, Step, step};

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

/// The adaptive Runge–Kutta method of order 5(4) in Mino time (`rk45-mino`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracer {
    tolerance: f64,
    max_steps: u32,
}

/// Longest step in scaled Mino time: short against half a polar or azimuthal period
/// (at least 1.8), so that a step holds at most one crossing of the equator.
const LONGEST_STEP: f64 = 0.8;

impl Tracer {
    /// A tracer whose local error per step stays below `tolerance`, in units in which
    /// b·w, the direction, the azimuth and delay/b are of order one (b the impact
    /// parameter). Next to the critical curve the error in w is held to that fraction of
    /// the distance from the photon orbit.
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\].
    pub fn new(tolerance: f64) -> Result<Self, OutOfRange> {
        let ok = (1e-14..=1e-2).contains(&tolerance);
        check("tolerance", tolerance, ok, "a number in [1e-14, 1e-2]")?;
        Ok(Tracer { tolerance, max_steps: 100_000 })
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

    /// Follows `ray` backward to the horizon or to infinity, into `path`.
    pub fn trace(&self, hole: &Kerr, ray: &Ray, want: Want, path: &mut Path) {
        match (want.azimuth, want.time) {
            (false, false) => Run::<4>::new(self, hole, ray, path).go(),
            (false, true) => Run::<5>::new(self, hole, ray, path).go(),
            (true, false) => Run::<9>::new(self, hole, ray, path).go(),
            (true, true) => Run::<10>::new(self, hole, ray, path).go(),
        }
    }
}

/// One ray under way, with `N` variables.
struct Run<'a, const N: usize> {
    tracer: &'a Tracer,
    ray: &'a Ray,
    system: System<f64>,
    path: &'a mut Path,
    y: [f64; N],
    f: [f64; N],
    s: f64,
    leg: f64,
    constants: [f64; 2],
    turned: f64,
}

impl<'a, const N: usize> Run<'a, N> {
    fn new(tracer: &'a Tracer, hole: &Kerr, ray: &'a Ray, path: &'a mut Path) -> Self {
        let system = System::new(hole, ray);
        path.reset(hole, ray, system.scale);
        path.has_azimuth = has_azimuth(N);
        path.has_time = has_time(N);
        let leg = if ray.inward { 1.0 } else { -1.0 };
        let y = system.start::<N>(ray, leg);
        let f = system.derivative(&y, leg);
        let w = ray.inverse_radius;
        let mut constants = [ray.azimuth - leg * hole.azimuth_closed_form(w), 0.0];
        if w > 0.0 {
            constants[1] = leg * hole.tortoise(w);
        }
        let turned = start_angle(ray);
        Run { tracer, ray, system, path, y, f, s: 0.0, leg, constants, turned }
    }

    fn go(mut self) {
        self.push_node();
        let tolerance = self.tracer.tolerance;
        let mut control = Control::new(DormandPrince5::TABLEAU.order);
        let mut h = (0.5 * tolerance.powf(0.2)).min(LONGEST_STEP);
        for _ in 0..self.tracer.max_steps {
            let trial = step::<DormandPrince5, N, 7>(&self.system, &self.y, &self.f, self.leg, h);
            let error = self.error_norm(&trial, h);
            let factor = control.factor(error);
            if error <= 1.0 {
                self.accept(trial.y, trial.f, h);
                if self.handle_events() {
                    return;
                }
                if let Some(outcome) = self.stalled(h) {
                    self.path.end = self.s;
                    self.path.outcome = outcome;
                    return;
                }
            }
            h = (h * factor).min(LONGEST_STEP);
        }
        self.path.end = self.s;
        self.path.outcome = Outcome::Unresolved(Unresolved::StepLimit);
    }

    /// What becomes of a ray that no longer moves in radius within rounding.
    fn stalled(&self, h: f64) -> Option<Outcome> {
        let (w, rate) = (self.y[index::W], self.y[index::DW]);
        if rate.abs() * h > 2.0 * f64::EPSILON * w || self.f[index::DW].abs() > 1e-12 {
            return None;
        }
        let horizon = self.system.scale * self.ray.potential.horizon;
        let at_horizon = w >= horizon * (1.0 - 1e-12);
        let lost = Outcome::Unresolved(Unresolved::PhotonOrbit);
        Some(if at_horizon { Outcome::Captured } else { lost })
    }

    /// The largest local error in units of what the tolerance allows.
    fn error_norm(&self, trial: &Step<N>, h: f64) -> f64 {
        let (y, error) = (&trial.y, &trial.error);
        let mut radial = 1.0;
        if let Some(barrier) = &self.ray.potential.barrier {
            let b = self.system.scale;
            let from =
                (self.y[index::W] - b * barrier.w).abs().min((y[index::W] - b * barrier.w).abs());
            radial = from.max(b * barrier.width()).min(1.0);
        }
        let rounding = 4.0 * f64::EPSILON;
        let radial = (self.tracer.tolerance * radial).max(rounding);
        let other = self.tracer.tolerance.max(rounding);
        let mut norm = (error[index::W].abs().max(error[index::DW].abs())) / radial;
        for e in error.iter().take(N.min(index::AZIMUTH)).skip(index::U) {
            norm = norm.max(e.abs() / other);
        }
        if has_azimuth(N) || has_time(N) {
            // These grow without bound where g vanishes, at the horizon of an extremal hole,
            // and cannot be better than g's own rounding.
            let blur = rounding * h * self.system.blur(y, self.leg).abs();
            for k in (if has_azimuth(N) { index::AZIMUTH } else { N - 1 })..N {
                let allowed = other * y[k].abs().max(1.0) + blur * trial.f[k].abs();
                norm = norm.max(error[k].abs() / allowed);
            }
        }
        // A step that left the numbers' range is rejected like any other bad one.
        if norm.is_nan() { f64::INFINITY } else { norm }
    }

    fn accept(&mut self, y: [f64; N], f: [f64; N], h: f64) {
        let before = [self.y[index::X.min(N - 1)], self.y[index::Y.min(N - 1)]];
        self.y = y;
        self.f = f;
        self.s += h;
        self.path.steps += 1;
        self.project();
        if has_azimuth(N) {
            let after = [self.y[index::X], self.y[index::Y]];
            self.turned += turn(self.path.rotation_sign, before, after);
        }
        self.push_node();
    }

    /// Puts dw/dτ back on dw/dτ = ±√W wherever the root is well conditioned. Next to the
    /// critical curve this is what keeps the ray on its own side of the barrier.
    fn project(&mut self) {
        let potential = &self.ray.potential;
        let value = potential.value(self.y[index::W] / self.system.scale);
        let rate = self.y[index::DW];
        let floor = match &potential.barrier {
            Some(barrier) if barrier.height < 0.0 => barrier.height.abs().min(0.25),
            Some(_) => 0.0,
            None => 0.25,
        };
        if value > floor {
            let sign = if potential.captures() { self.leg } else { rate };
            self.y[index::DW] = value.sqrt().copysign(sign);
            self.f[index::W] = self.y[index::DW];
        }
    }

    fn push_node(&mut self) {
        let mut y = [0.0; FULL];
        let mut f = [0.0; FULL];
        let last = if has_time(N) { N - 1 } else { N };
        y[..last].copy_from_slice(&self.y[..last]);
        f[..last].copy_from_slice(&self.f[..last]);
        if has_time(N) {
            y[FULL - 1] = self.y[N - 1];
            f[FULL - 1] = self.f[N - 1];
        }
        self.path.nodes.push(Node {
            s: self.s,
            y,
            f,
            second: self.system.second_derivative(&self.y, self.leg),
            leg: self.leg,
            constants: self.constants,
            turned: self.turned,
        });
    }

    /// Looks for events in the step just taken; true if the ray has ended in it.
    fn handle_events(&mut self) -> bool {
        let [.., a, b] = self.path.nodes.as_slice() else { return false };
        let ended = end_of_ray(a, b, self.system.scale * self.ray.potential.horizon);
        if side(a) != side(b) {
            let s = locate(a, b, index::U, 0.0);
            if ended.is_none_or(|(end, _)| s < end) {
                self.path.crossings.push(s);
            }
        }
        let turned = a.leg * b.y[index::DW] < 0.0;
        if turned {
            let potential = &self.ray.potential;
            self.path.turning = Some(locate_turning(a, b));
            self.path.turning_w = if a.leg > 0.0 {
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

    /// On an outward leg g is written with −dw/dτ and the closed forms change sign; the
    /// constants take up the difference.
    fn change_leg(&mut self) {
        let w = self.y[index::W] / self.system.scale;
        let hole = self.path.hole;
        self.constants[0] += 2.0 * self.leg * hole.azimuth_closed_form(w);
        self.constants[1] -= 2.0 * self.leg * hole.tortoise(w);
        self.leg = -self.leg;
        self.f = self.system.derivative(&self.y, self.leg);
        self.push_node();
    }
}

/// Where and how the ray ends in the step from `a` to `b`, if it does; `horizon` is b·w there.
fn end_of_ray(a: &Node, b: &Node, horizon: f64) -> Option<(f64, Outcome)> {
    let (w, rate) = (b.y[index::W], b.y[index::DW]);
    // Within rounding: a ray on the straight part of an extremal hole's critical curve
    // approaches the horizon but never reaches it.
    if w >= horizon * (1.0 - 64.0 * f64::EPSILON) && rate >= 0.0 {
        return Some((locate(a, b, index::W, horizon.min(w)), Outcome::Captured));
    }
    if w <= 0.0 && rate < 0.0 {
        return Some((locate(a, b, index::W, 0.0), Outcome::Escaped));
    }
    None
}

/// atan2(y, x) at the start; on the axis the direction in which the ray leaves it.
fn start_angle(ray: &Ray) -> f64 {
    let [x, y, _] = ray.position;
    if x == 0.0 && y == 0.0 { ray.velocity[1].atan2(ray.velocity[0]) } else { y.atan2(x) }
}

/// On which side of the equatorial plane a ray is, or is about to be.
fn side(node: &Node) -> bool {
    let (u, rate) = (node.y[index::U], node.y[index::DU]);
    if u == 0.0 { rate > 0.0 } else { u > 0.0 }
}

/// Where in the step from `a` to `b` variable `k` takes the value `target`.
fn locate(a: &Node, b: &Node, k: usize, target: f64) -> f64 {
    let h = b.s - a.s;
    let end = |node: &Node| [node.y[k], node.f[k], node.f[k + 1]];
    a.s + h * Quintic::new(h, end(a), end(b)).solve(target, 0.0, 1.0)
}

/// Where dw/dτ changes sign: on the interpolant of w, whose slope is monotonic there.
fn locate_turning(a: &Node, b: &Node) -> f64 {
    let h = b.s - a.s;
    let end = |node: &Node| [node.y[index::W], node.f[index::W], node.f[index::DW]];
    let radial = Quintic::new(h, end(a), end(b));
    let (mut lo, mut hi) = (0.0, 1.0);
    let sign = radial.slope(0.0).signum();
    while hi - lo > 1e-15 {
        let mid = 0.5 * (lo + hi);
        if radial.slope(mid) * sign > 0.0 { lo = mid } else { hi = mid }
    }
    a.s + h * 0.5 * (lo + hi)
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
