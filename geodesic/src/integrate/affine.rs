//! The independent referee: Hamilton's equations in the affine parameter and Cartesian
//! Kerr–Schild coordinates, regular at the poles and at the horizon, by the Runge–Kutta
//! method of order 5(4) of the crate `ode_solvers` (`rk45-affine`).
//!
//! It shares no equation of motion with the Mino-time tracers: no separation, no potential,
//! no conserved quantity but the energy.
//!
//! A backward ray is a future-directed ray of the reflected coordinates t → −t, φ → −φ,
//! in which Kerr's metric is the same and the backward ray falls through the future horizon.
//! There g^{μν} = η^{μν} − f l^μ l^ν with f = 2r³/(r⁴ + a²z²) and
//! l = ((rx + ay)/(r² + a²), (ry − ax)/(r² + a²), z/r); x + iy = (r + ia) sin θ e^{iφ}
//! (Kerr & Schild 1965; Visser 2007, arXiv:0706.0622, eqs. 32–42).

mod equations;

use crate::error::{Error, check};
use crate::integrate::outcome::{Outcome, Unresolved};
use crate::numbers::dual::Dual;
use crate::numbers::polynomial::{Polynomial, hermite};
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;
use core::f64::consts::{PI, TAU};
use equations::{MINO_TIME, State, derivative, radius};
use nalgebra::SVector;
use ode_solvers::{Dopri5, OutputType};

/// The end of a step, with first and second derivatives.
#[derive(Debug, Clone)]
struct Node {
    s: f64,
    y: State<f64>,
    first: State<f64>,
    second: State<f64>,
}

impl Node {
    fn new(spin: f64, s: f64, y: State<f64>) -> Self {
        let first = derivative(spin, &y);
        // y'' = J(y) y': the derivative of the right-hand side along itself.
        let along: State<Dual<f64, 1>> =
            core::array::from_fn(|k| Dual { value: y[k], slope: [first[k]] });
        let second = derivative(spin, &along).map(|d| d.slope[0]);
        Node { s, y, first, second }
    }

    fn end(&self, k: usize) -> [f64; 3] {
        [self.y[k], self.first[k], self.second[k]]
    }
}

/// The interpolant of value, first and second derivative at both ends of a step.
fn quintic(h: f64, start: [f64; 3], end: [f64; 3]) -> [f64; 6] {
    let scaled = |[y, first, second]: [f64; 3]| [y, h * first, 0.5 * h * h * second];
    let mut out = [0.0; 6];
    hermite::<3>(&scaled(start), &scaled(end), &mut out);
    out
}

/// Equations of motion, and when to stop, for the solver.
struct Motion {
    hole: Kerr,
    outer: f64,
}

impl ode_solvers::System<f64, SVector<f64, 8>> for Motion {
    fn system(&self, _: f64, y: &SVector<f64, 8>, dy: &mut SVector<f64, 8>) {
        *dy = SVector::from(derivative(self.hole.spin(), &(*y).into()));
    }

    fn solout(&mut self, _: f64, y: &SVector<f64, 8>, dy: &SVector<f64, 8>) -> bool {
        let r = radius(self.hole.spin(), [y[0], y[1], y[2]]);
        let outward = y[0] * dy[0] + y[1] * dy[1] + y[2] * dy[2] > 0.0;
        r <= self.hole.horizon() || (r >= self.outer && outward)
    }
}

/// The tracer in the affine parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineTracer {
    tolerance: f64,
}

/// A ray traced in the affine parameter, from a finite observer to the horizon or back to
/// the observer's radius.
#[derive(Debug, Clone)]
pub struct AffinePath {
    hole: Kerr,
    nodes: Vec<Node>,
    outcome: Outcome,
    end: f64,
    /// Azimuth and time of the observer less their Kerr–Schild values.
    origin: [f64; 2],
}

impl AffineTracer {
    /// A tracer with this relative and absolute local error.
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\].
    pub fn new(tolerance: f64) -> Result<Self, Error> {
        let ok = (1e-14..=1e-2).contains(&tolerance);
        check("tolerance", tolerance, ok, "a number in [1e-14, 1e-2]")?;
        Ok(AffineTracer { tolerance })
    }

    /// Follows the photon that arrives at (α, β), in M, backward.
    ///
    /// # Errors
    /// If the observer is at infinity, which no affine parameter reaches, or the ray does
    /// not exist ([`Observer::ray`]).
    pub fn trace(
        &self,
        hole: &Kerr,
        observer: &Observer,
        alpha: f64,
        beta: f64,
    ) -> Result<AffinePath, Error> {
        let w = observer.inverse_radius();
        check("observer radius", 1.0 / w, w > 0.0, "a finite radius")?;
        // Refuses what no tracer can follow.
        observer.ray(hole, alpha, beta)?;
        let start = start(hole, observer, alpha, beta);
        let motion = Motion { hole: *hole, outer: 1.0 / w };
        let reach = 1e3 / w;
        let mut solver = Dopri5::new(
            motion,
            0.0,
            reach,
            reach,
            SVector::from(start),
            self.tolerance,
            self.tolerance,
        );
        solver.set_output(OutputType::Sparse);
        let solved = solver.integrate().is_ok();
        let nodes: Vec<Node> = solver
            .x_out()
            .iter()
            .zip(solver.y_out())
            .map(|(s, y)| Node::new(hole.spin(), *s, (*y).into()))
            .collect();
        let origin = [observer.azimuth() - hole.azimuth_closed_form(w), hole.tortoise(w) - 1.0 / w];
        let lost = Outcome::Unresolved(Unresolved::StepLimit);
        let mut path = AffinePath { hole: *hole, nodes, outcome: lost, end: 0.0, origin };
        path.finish(solved, 1.0 / w);
        Ok(path)
    }
}

/// Initial data of the reflected ray from Bardeen's labels: p_φ = λ = −α sin i,
/// p_θ = −β, p_r = −√R/Δ in Boyer–Lindquist coordinates.
fn start(hole: &Kerr, observer: &Observer, alpha: f64, beta: f64) -> State<f64> {
    let (a, r) = (hole.spin(), 1.0 / observer.inverse_radius());
    let (s, c) = (observer.inclination().sin(), observer.inclination().cos());
    let lambda = -alpha * s;
    let carter = (alpha + a * s).powi(2) + beta * beta;
    let delta = r * r - 2.0 * r + a * a;
    let p = r * r + a * a - a * lambda;
    let root = (p * p - delta * carter).max(0.0).sqrt();
    let radial = (2.0 * r - a * lambda - root) / delta;
    let sigma = r * r + a * a * c * c;
    let swirl = -alpha + a * s * radial;
    let polar = (-r * beta - a * c * swirl) / sigma;
    let azimuthal = (r * swirl - a * c * beta) / sigma;
    // At Kerr–Schild azimuth 0: n = (s, 0, c), ê_θ = (c, 0, −s), ê_φ = (0, 1, 0).
    let momentum = [s * radial + c * polar, azimuthal, c * radial - s * polar];
    [r * s, a * s, r * c, momentum[0], momentum[1], momentum[2], 0.0, 0.0]
}

impl AffinePath {
    fn finish(&mut self, solved: bool, outer: f64) {
        let [.., a, b] = self.nodes.as_slice() else { return };
        self.end = b.s;
        if !solved {
            return;
        }
        let r = radius(self.hole.spin(), [b.y[0], b.y[1], b.y[2]]);
        let (outcome, target) = if r <= self.hole.horizon() {
            (Outcome::Captured, self.hole.horizon())
        } else {
            (Outcome::Escaped, outer)
        };
        // Bisection: the radius is monotonic in the last step.
        let (mut lo, mut hi) = (a.s, b.s);
        while hi - lo > 1e-15 * hi {
            let middle = 0.5 * (lo + hi);
            if middle <= lo || middle >= hi {
                break;
            }
            let y = self.state(middle);
            let before = (radius(self.hole.spin(), [y[0], y[1], y[2]]) > target)
                == (outcome == Outcome::Captured);
            if before { lo = middle } else { hi = middle }
        }
        self.outcome = outcome;
        self.end = hi;
    }

    /// Returns the outcome of the ray; `Escaped` means back at the observer's radius.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Radius of the observer.
    pub(crate) fn start_radius(&self) -> f64 {
        self.nodes
            .first()
            .map_or(0.0, |node| radius(self.hole.spin(), [node.y[0], node.y[1], node.y[2]]))
    }

    /// Mino time in M⁻¹ from the observer to the horizon or back to the observer's radius.
    pub fn mino_total(&self) -> f64 {
        self.state(self.end)[MINO_TIME]
    }

    /// Smallest radius in M of a ray that came back.
    pub fn closest_approach(&self) -> Option<f64> {
        let y = self.state(self.closest_affine()?);
        Some(radius(self.hole.spin(), [y[0], y[1], y[2]]))
    }

    /// Mino time of the smallest radius of a ray that came back.
    fn closest_approach_time(&self) -> Option<f64> {
        Some(self.state(self.closest_affine()?)[MINO_TIME])
    }

    /// Affine parameter of the smallest radius, where dr/ds = 0 on the dense output.
    fn closest_affine(&self) -> Option<f64> {
        if self.outcome != Outcome::Escaped {
            return None;
        }
        let r = |s: f64| {
            let y = self.state(s);
            radius(self.hole.spin(), [y[0], y[1], y[2]])
        };
        // Golden-section search: the radius has one minimum.
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let (mut lo, mut hi) = (0.0, self.end);
        for _ in 0..100 {
            let (p, q) = (hi - golden * (hi - lo), lo + golden * (hi - lo));
            if r(p) < r(q) { hi = q } else { lo = p }
        }
        Some(0.5 * (lo + hi))
    }

    /// Mino time at the start of the step before the one that holds `mino_time`.
    pub(crate) fn step_before(&self, mino_time: f64) -> f64 {
        let k = self.nodes.partition_point(|node| node.y[MINO_TIME] <= mino_time);
        self.nodes.get(k.saturating_sub(2)).map_or(0.0, |node| node.y[MINO_TIME])
    }

    /// Number of accepted steps.
    pub fn steps(&self) -> usize {
        self.nodes.len().saturating_sub(1)
    }

    /// Largest |H| at the ends of all steps, H = ½ g^{μν} p_μ p_ν, dimensionless: 0 but for the integrator's error.
    pub fn largest_hamiltonian(&self) -> f64 {
        let value = |node: &Node| {
            let [x, y, z, px, py, pz, _, _] = node.y;
            let (a, r) = (self.hole.spin(), radius(self.hole.spin(), [x, y, z]));
            let f = 2.0 * r.powi(3) / (r.powi(4) + a * a * z * z);
            let sum = r * r + a * a;
            let along = 1.0 + (r * x + a * y) / sum * px + (r * y - a * x) / sum * py + z / r * pz;
            0.5 * (px * px + py * py + pz * pz - 1.0 - f * along * along)
        };
        self.nodes.iter().map(|node| value(node).abs()).fold(0.0, f64::max)
    }

    fn state(&self, s: f64) -> State<f64> {
        let k = self.nodes.partition_point(|node| node.s <= s).clamp(1, self.nodes.len() - 1);
        let (a, b) = (&self.nodes[k - 1], &self.nodes[k]);
        let h = b.s - a.s;
        core::array::from_fn(|k| Polynomial(&quintic(h, a.end(k), b.end(k))).value((s - a.s) / h))
    }

    /// The affine parameter at a Mino time.
    fn affine(&self, mino_time: f64) -> f64 {
        let k = self
            .nodes
            .partition_point(|node| node.y[MINO_TIME] <= mino_time)
            .clamp(1, self.nodes.len() - 1);
        let (a, b) = (&self.nodes[k - 1], &self.nodes[k]);
        let h = b.s - a.s;
        let clock = quintic(h, a.end(MINO_TIME), b.end(MINO_TIME));
        a.s + h * Polynomial(&clock).solve(mino_time, 0.0, 1.0)
    }

    /// The position at a Mino time in \[0, [`mino_total`](Self::mino_total)\], and its rates of change: r, θ, azimuth
    /// in \[−π, π\] and delay t_o − t.
    pub fn at(&self, mino_time: f64) -> PathPoint {
        self.point(self.affine(mino_time).min(self.end))
    }

    fn point(&self, s: f64) -> PathPoint {
        let y = self.state(s);
        let a = self.hole.spin();
        let r = radius(a, [y[0], y[1], y[2]]).max(self.hole.horizon() * (1.0 + f64::EPSILON));
        let w = 1.0 / r;
        // e^{iφ} sin θ = (x + iy)/(r + ia); reflected back.
        let angle = (r * y[1] - a * y[0]).atan2(r * y[0] + a * y[1]);
        let reflected = angle - self.hole.azimuth_closed_form(w);
        let azimuth = (self.origin[0] - reflected + PI).rem_euclid(TAU) - PI;
        let cos_theta = (y[2] / r).clamp(-1.0, 1.0);
        let sin_theta = y[0].hypot(y[1]) / r.hypot(a);
        let delay = y[6] - (self.hole.tortoise(w) - r) + self.origin[1];
        let [inverse_radius_rate, polar] = self.rates(&y, r);
        // Along the meridian, and without dragging −λ/sin θ along the circle of latitude.
        let (sin, cos) = azimuth.sin_cos();
        let lambda = y[0] * y[4] - y[1] * y[3];
        let [meridian, around] = [polar * cos_theta, lambda].map(|part| -part / sin_theta);
        let velocity = [meridian * cos - around * sin, meridian * sin + around * cos, polar];
        PathPoint {
            mino_time: y[MINO_TIME],
            inverse_radius: w,
            inverse_radius_rate,
            direction: [sin_theta * cos, sin_theta * sin, cos_theta],
            velocity,
            azimuth,
            delay,
        }
    }

    /// d(1/r)/dτ and d cos θ/dτ, from the rates of the Kerr–Schild coordinates.
    fn rates(&self, y: &State<f64>, r: f64) -> [f64; 2] {
        let (a, [x, y_, z, ..]) = (self.hole.spin(), *y);
        let [dx, dy, dz, _, _, _, _, clock] = derivative(a, y);
        let sum = r * r + a * a;
        // From (x² + y²)/(r² + a²) + z²/r² = 1.
        let across = (x * dx + y_ * dy) / sum + z * dz / (r * r);
        let dr = across / (r * ((x * x + y_ * y_) / (sum * sum) + z * z / r.powi(4)));
        [-dr / (r * r) / clock, (r * dz - z * dr) / (r * r) / clock]
    }

    /// The pieces of the path with lo ≤ r ≤ hi (M) as intervals of Mino time (M⁻¹), in order: at most
    /// two, since the radius has at most one minimum.
    pub fn intervals_within(&self, lo: f64, hi: f64, intervals: &mut Vec<[f64; 2]>) {
        intervals.clear();
        let total = self.mino_total();
        let turning = self.closest_approach_time();
        let legs = match turning {
            Some(turning) => vec![[0.0, turning], [turning, total]],
            None => vec![[0.0, total]],
        };
        for [start, end] in legs {
            let r = [start, end].map(|time| self.at(time).radius());
            let (least, most) = (r[0].min(r[1]), r[0].max(r[1]));
            if most < lo || least > hi {
                continue;
            }
            let bound = |k: usize| {
                let limit = r[k].clamp(lo, hi);
                if limit == r[k] { [start, end][k] } else { self.time_at(limit, [start, end]) }
            };
            let piece = [bound(0), bound(1)];
            match intervals.last_mut() {
                Some(last) if piece[0] <= last[1] * (1.0 + 1e-14) => last[1] = piece[1],
                _ if piece[1] > piece[0] => intervals.push(piece),
                _ => {}
            }
        }
    }

    /// Returns the time at which the radius takes a value between two Mino times of one leg: bisection.
    fn time_at(&self, target: f64, [mut lo, mut hi]: [f64; 2]) -> f64 {
        let rising = self.at(hi).radius() > self.at(lo).radius();
        for _ in 0..100 {
            let middle = 0.5 * (lo + hi);
            if middle <= lo || middle >= hi {
                break;
            }
            if (self.at(middle).radius() < target) == rising { lo = middle } else { hi = middle }
        }
        0.5 * (lo + hi)
    }

    /// Mino times in M⁻¹ of the crossings of the equatorial plane.
    pub fn equatorial_crossings(&self) -> Vec<f64> {
        let mut crossings = Vec::new();
        for pair in self.nodes.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            if (a.y[2] > 0.0) != (b.y[2] > 0.0) && a.y[2] != 0.0 {
                let h = b.s - a.s;
                let height = quintic(h, a.end(2), b.end(2));
                let s = a.s + h * Polynomial(&height).solve(0.0, 0.0, 1.0);
                if s < self.end {
                    crossings.push(self.state(s)[MINO_TIME]);
                }
            }
        }
        crossings
    }
}

#[cfg(test)]
mod tests;
