//! A ray under way: step after step into a path, with its events and the errors it collects.

use crate::integrate::mino::{System, has_azimuth, has_time, index};
use crate::integrate::outcome::{Outcome, Unresolved};
use crate::integrate::path::{Path, Segment, turn};
use crate::integrate::stepper::{Made, State, Stepper};
use crate::integrate::uncertainty::Budget;
use crate::numbers::scalar::Elementary;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;

/// One ray under way, with `N` variables.
pub(crate) struct Run<'a, T, M, const N: usize> {
    state: State<'a, T, N>,
    stepper: M,
    path: &'a mut Path<T>,
    s: T,
    constants: [T; 2],
    turned: T,
    budget: Budget,
    /// Error of W since the last time that dw/dτ was put on ±√W.
    energy: f64,
}

/// Ratio of the truncation errors of cos θ to their estimates: its motion is nearly harmonic, for which every method
/// is better than for the radial motion. Measured (docs/measurements/geodesics.md of the repository).
const HARMONIC: f64 = 0.3;

impl<'a, T: Elementary, M: Stepper<T, N>, const N: usize> Run<'a, T, M, N> {
    /// Stands at the start of `ray`; the steps go into `path`.
    pub fn new(
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
        let state = State { ray, system, tolerance, y, leg };
        let constants = start_constants(hole, ray, leg);
        let energy = start_error(ray);
        let budget = start_budget(&y, &system, energy);
        path.start = budget;
        Run {
            state,
            stepper,
            path,
            s: T::constant(0.0),
            constants,
            turned: start_angle(ray),
            budget,
            energy,
        }
    }

    /// Follows the ray to its end, or until it is given up after `max_steps` steps.
    pub fn go(mut self, max_steps: u32) {
        if self.state.ray.check_hole(&self.path.hole).is_err() {
            self.path.outcome = Outcome::Unresolved(Unresolved::OtherHole);
            return;
        }
        if self.state.ray.is_from_horizon {
            self.path.outcome = Outcome::Captured;
            return;
        }
        self.stepper.restart(&self.state, &mut self.path.series);
        for _ in 0..max_steps {
            let made = self.stepper.step(&self.state, &mut self.path.series);
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

    /// Returns the outcome of a ray that no longer moves in radius within rounding.
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

    /// Adds the errors of a step to the budget: see [`uncertainty`](crate::integrate::uncertainty).
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
        let energy = 2.0 * (rate.abs() * (error[index::DW].abs() + kick) + pull.abs() * slip);
        self.budget.energy = self.energy + energy;
        // The projection leaves w where an error of W has taken it.
        let left = if projected { pull.abs() / rate.abs().max(1e-300) } else { 0.0 };
        self.energy = if projected { 0.0 } else { self.budget.energy };
        let wrong = if projected { self.budget.energy - energy } else { self.budget.energy };
        let truncation = truncation + 0.5 * (h + left) * wrong / (speed * speed);
        self.budget.phase += truncation;
        self.budget.local = error[index::W].abs() / w.abs().max(1e-300);
        self.budget.pull = pull.abs();
        let mut turn = error[index::U].abs() + error[index::DU].abs();
        let (u, climb) = (y[index::U].value().abs(), y[index::DU].value().abs());
        self.budget.polar += HARMONIC * turn + eps * (1.0 + h) * (u + climb);
        if has_azimuth(N) {
            for k in [index::X, index::DX, index::Y, index::DY] {
                turn = turn.max(error[k].abs());
            }
        }
        self.budget.direction += turn + eps * (1.0 + h);
        if has_azimuth(N) || has_time(N) {
            self.spend_on_quadratures(error, y, h, truncation + blur);
        }
    }

    /// Adds the errors of azimuth and delay in a step with an error of `phase`.
    fn spend_on_quadratures(&mut self, error: &[f64; N], y: &[T; N], h: f64, phase: f64) {
        let eps = T::EPSILON;
        // The quadratures dwell longer or shorter where the step's phase is wrong, and know
        // their slope as well as the denominator g.
        let way = T::constant(self.state.leg);
        let g = self.state.system.blur(&self.state.y, way).value().abs();
        let dwell = phase / h + 4.0 * eps * g;
        let quadrature = |k: usize| {
            let (start, end) = (self.state.y[k].value(), y[k].value());
            error[k].abs() + (end - start).abs() * dwell + eps * (end.abs() + h)
        };
        if has_azimuth(N) {
            self.budget.azimuth += quadrature(index::AZIMUTH);
        }
        if has_time(N) {
            // dI_t/ds holds a² cos²θ, and with it twice the error of cos θ.
            let [.., tilt] = self.state.system.time().map(T::value);
            let [start, end] = [&self.state.y, y].map(|y| y[index::U].value().abs());
            let height = end.max(start);
            self.budget.delay += quadrature(N - 1) + 2.0 * h * tilt * height * self.budget.polar;
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

    /// Returns where and how the ray ends in segment `k`, if it does.
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

    /// Returns whether the potential lets the ray reach the horizon.
    fn may_fall(&self) -> bool {
        let potential = &self.state.ray.potential;
        let outside = |w: f64| self.state.ray.inverse_radius < w;
        potential.captures() || !potential.barrier.is_some_and(|barrier| outside(barrier.w))
    }

    fn change_leg(&mut self) {
        let w = self.state.y[index::W] / T::constant(self.state.system.scale);
        self.constants = switch_leg(&self.path.hole, self.state.leg, w, self.constants);
        self.state.leg = -self.state.leg;
        self.stepper.restart(&self.state, &mut self.path.series);
    }
}

/// The constants that azimuth and time start with, on a leg that goes inwards (+1) or outwards (−1).
pub(crate) fn start_constants<T: Elementary>(hole: &Kerr<T>, ray: &Ray<T>, leg: f64) -> [T; 2] {
    let (w, way) = (T::constant(ray.inverse_radius), T::constant(leg));
    let azimuth = T::constant(ray.azimuth) - way * hole.azimuth_closed_form(w);
    let time = if ray.inverse_radius > 0.0 { way * hole.tortoise(w) } else { T::constant(0.0) };
    [azimuth, time]
}

/// The constants of azimuth and time after `leg`, which ends at w. On an outward leg g is written with −dw/dτ and the
/// closed forms change sign; the constants take up the difference.
pub(crate) fn switch_leg<T: Elementary>(
    hole: &Kerr<T>,
    leg: f64,
    w: T,
    [azimuth, time]: [T; 2],
) -> [T; 2] {
    let twice = T::constant(2.0 * leg);
    [azimuth + twice * hole.azimuth_closed_form(w), time - twice * hole.tortoise(w)]
}

/// Error of W at the start: its terms, made of constants of motion that are rounded, cancel in a
/// ray that starts next to its turning point. At infinity W is 1.
fn start_error<T: Elementary>(ray: &Ray<T>) -> f64 {
    /// Roundings of a constant of motion that a camera's frame leaves.
    const ROUNDINGS: f64 = 16.0;
    let [quad, cubic, quartic] = ray.potential.coefficients.map(|c| c.value().abs());
    let w = ray.inverse_radius;
    ROUNDINGS * T::EPSILON * w * w * (quad + w * (cubic + w * quartic))
}

/// Returns the effect of an error of W at the start, one of dw/dτ = √W: the ray is early or late, by the more the
/// closer it starts to its turning point.
fn start_budget<T: Elementary, const N: usize>(
    y: &[T; N],
    system: &System<T>,
    energy: f64,
) -> Budget {
    let (w, rate) = (y[index::W].value(), y[index::DW].value().abs());
    let [a, b, c] = system.radial().map(T::value);
    let speed = rate.hypot(w * (a + w * (b + w * c)));
    let slow = rate.max(energy.sqrt()) * speed;
    let phase = if energy > 0.0 { 0.5 * energy / slow.max(1e-300) } else { 0.0 };
    Budget { phase, ..Budget::default() }
}

/// atan2(y, x) at the start; on the axis the direction in which the ray leaves it.
pub(crate) fn start_angle<T: Elementary>(ray: &Ray<T>) -> T {
    let [x, y, _] = ray.position;
    let on_axis = x.value() == 0.0 && y.value() == 0.0;
    let [x, y] = if on_axis { [ray.velocity[0], ray.velocity[1]] } else { [x, y] };
    if x.value() == 0.0 && y.value() == 0.0 {
        return T::constant(y.value().atan2(x.value()));
    }
    y.atan2(x)
}

/// Returns the side of the equatorial plane on which a ray is, or is about to be.
fn side<T: Elementary, const N: usize>(y: &[T; N]) -> bool {
    let (u, rate) = (y[index::U].value(), y[index::DU].value());
    if u == 0.0 { rate > 0.0 } else { u > 0.0 }
}
