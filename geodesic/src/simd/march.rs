//! Rays followed panel by panel inside a sphere, several a SIMD register.
//!
//! A ray's way is cut into legs, each of panels of equal Mino time: the approach to the sphere,
//! which is not sampled; legs that grow with the distance from infinity; the rest of the way
//! inwards, to the turning point or most of the way to the horizon; and either the same way out
//! again or, for rays that fall, one last panel with a pace of its own (see [`PanelRule`]). From the start of a panel every node is one application of the addition theorems
//! (`radial`, `polar`); the rates of azimuth and time are integrated over the same nodes.

use super::lanes::{Lanes, MAX_LANES, transpose_plain};
use super::math::atan2;
use super::motion::{Camera, Motion};
use super::panel::{PanelRule, integral};
use super::polar::{Direction, PolarStep};
use super::radial::RadialStep;
use super::radial_sum::closed_forms;
use crate::spacetime::quantities::Quantities;

/// Columns of nodes.
pub(super) const COLUMNS: usize = 8;

/// Legs and panels of rays that are marched together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// True if the last leg is the panel before the horizon.
    pub falls: bool,
    /// Panels of the approach to the sphere.
    pub approach: u32,
    /// Legs of growing length after the entry into the sphere.
    pub entry: u32,
    /// Panels of the rest of the way inwards.
    pub inward: u32,
    /// Panels of the way out, or of the last leg.
    pub last: u32,
    /// Legs of falling length before the exit.
    pub exit: u32,
    /// Panels of each leg of growing or falling length.
    pub split: u32,
}

impl Key {
    /// Panels with nodes.
    pub fn sampled(&self) -> u32 {
        (self.entry + self.exit) * self.split + self.inward + self.last
    }
}

/// Far out, where Σ has its double pole at infinity, a panel is `GROWTH` − 1 times as long as the
/// Mino time since infinity at its start, so that the next one starts at `GROWTH` times that.
pub(crate) const GROWTH: f64 = 3.0;

/// Rays side by side.
#[derive(Clone, Copy)]
pub(super) struct RayLanes<V> {
    pub alpha: V,
    pub beta: V,
    /// Mino time from the observer to the sphere.
    pub approach: V,
    /// Mino time since infinity at the entry into the sphere.
    pub since: V,
    /// Mino time of the uniform panels of the way inwards.
    pub inward: V,
    /// Mino time of the uniform panels of the way out, or of the last leg.
    pub last: V,
    /// 1/r of the sphere.
    pub entry: V,
}

/// A step from the start of a panel.
#[derive(Clone, Copy)]
pub(super) struct Jump<V> {
    /// Its Mino time.
    h: V,
    radial: RadialStep<V>,
    polar: PolarStep<V>,
}

impl<V: Lanes<f64>> Jump<V> {
    #[inline(always)]
    fn new(cam: &Camera, motion: &Motion<V>, h: V) -> Self {
        Jump { h, radial: RadialStep::new(motion, h), polar: PolarStep::new(cam, motion, h) }
    }

    /// Room for the steps of a panel.
    #[inline(always)]
    pub fn room(cam: &Camera) -> Vec<Self> {
        let one = V::splat(1.0);
        let motion = Motion::new(cam, one, one);
        vec![Jump::new(cam, &motion, V::splat(1e-3)); MAX_ORDER + 1]
    }
}

/// The panels of a leg.
struct Panels<V> {
    /// Mino time of each.
    length: V,
    /// True if the pace falls to zero at the end.
    falls: bool,
}

impl<V: Lanes<f64>> Panels<V> {
    /// Mino time since the start of the panel, over its length, at the rule's variable s.
    fn place(&self, s: f64) -> f64 {
        PanelRule::pace(s, self.falls).0
    }

    /// Its derivative.
    fn pace(&self, s: f64) -> f64 {
        PanelRule::pace(s, self.falls).1
    }
}

/// State of rays.
struct State<V> {
    time: V,
    w: V,
    speed: V,
    direction: Direction<V>,
    /// Azimuth of the frame of the direction.
    frame: V,
    /// ∫ of the smooth parts of the rates of time and azimuth.
    integrals: [V; 2],
    /// The closed forms of time and azimuth, to which those at w are added `sense` times.
    closed: [V; 2],
    /// −1 inwards, 1 outwards.
    sense: V,
}

/// A march of some rays.
pub(super) struct March<'a, V> {
    pub cam: &'a Camera,
    pub motion: Motion<V>,
    pub rule: &'a PanelRule,
    /// Columns that are filled besides radius, cos θ, weight and Mino time.
    pub wanted: Quantities,
    pub rows: &'a mut [[f64; MAX_ORDER * MAX_LANES]; COLUMNS],
    /// Steps to the nodes and to the end of the present leg's panels.
    pub jumps: &'a mut [Jump<V>],
}

/// Destination of each lane's next node, and the columns.
type Target<'a, 'b> = (&'a mut [usize; MAX_LANES], &'a mut [&'b mut [f64]; COLUMNS]);

/// Values at the nodes of a panel.
struct Known<V> {
    rates: [[V; 2]; MAX_ORDER],
    angles: [V; MAX_ORDER],
    depths: [V; MAX_ORDER],
}

impl<V: Lanes<f64>> March<'_, V> {
    /// Returns whether more than the polar angle is needed of the direction.
    #[inline(always)]
    fn turns(&self) -> bool {
        self.wanted.azimuth || self.wanted.time
    }

    /// Marches all legs; the nodes of panel after panel of ray `l` go to `columns` from
    /// `starts[l]` on.
    #[inline(always)]
    pub fn run(
        &mut self,
        lanes: &RayLanes<V>,
        key: Key,
        mut starts: [usize; MAX_LANES],
        columns: &mut [&mut [f64]; COLUMNS],
    ) {
        let mut state = self.start(lanes);
        let whole = key.entry + 1;
        for leg in 0..whole + 2 + key.exit {
            let growing = |k: u32| lanes.since * V::splat((GROWTH - 1.0) * GROWTH.powi(k as i32));
            let (length, panels) = match leg {
                0 => (lanes.approach, key.approach),
                k if k < whole => (growing(k - 1), key.split),
                k if k == whole => (lanes.inward, key.inward),
                k if k == whole + 1 => (lanes.last, key.last),
                k => (growing(key.exit - 1 - (k - whole - 2)), key.split),
            };
            if leg == whole + 1 && !key.falls {
                self.turn(&mut state);
            }
            if panels == 0 {
                continue;
            }
            let length = length * V::splat(1.0 / f64::from(panels));
            let panel = Panels { length, falls: leg == whole + 1 && key.falls };
            self.leg(&mut state, &panel, panels, (leg > 0).then_some((&mut starts, &mut *columns)));
            if leg == 0 {
                // Known without any step.
                state.w = lanes.entry;
                state.speed = self.motion.radial(lanes.entry).max(V::splat(0.0)).sqrt();
            }
        }
    }

    /// One leg of so many panels, whose nodes go to a target if there is one.
    #[inline(always)]
    fn leg(
        &mut self,
        state: &mut State<V>,
        panel: &Panels<V>,
        panels: u32,
        mut target: Option<Target<'_, '_>>,
    ) {
        self.prepare(panel);
        let sampled = target.is_some();
        for _ in 0..panels {
            if sampled || self.turns() {
                self.panel(state, panel, sampled);
            }
            if let Some((starts, columns)) = &mut target {
                self.scatter(starts, columns);
            }
            self.cross(state);
        }
    }

    #[inline(always)]
    fn start(&self, lanes: &RayLanes<V>) -> State<V> {
        let (s, cam) = (V::splat, self.cam);
        let (sin, cos, zero) = (s(cam.sin_i), s(cam.cos_i), s(0.0));
        let (alpha, beta) = (lanes.alpha, lanes.beta);
        let w = s(cam.w_obs);
        let closed = closed_forms(cam, w);
        State {
            time: zero,
            w,
            speed: self.motion.radial(w).max(zero).sqrt(),
            direction: Direction {
                n: [sin, zero, cos],
                velocity: [-(beta * cos), alpha, beta * sin],
            },
            frame: zero,
            integrals: [zero; 2],
            closed,
            sense: s(-1.0),
        }
    }

    /// Passes the turning point: what follows mirrors what was before.
    #[inline(always)]
    fn turn(&self, state: &mut State<V>) {
        if self.turns() {
            let [time, azimuth] = closed_forms(self.cam, state.w);
            let twice = V::splat(2.0);
            state.closed = [
                time.neg_mul_add(twice, state.closed[0]),
                azimuth.neg_mul_add(twice, state.closed[1]),
            ];
        }
        state.sense = V::splat(1.0);
    }

    /// The steps of a leg's panels.
    #[inline(always)]
    fn prepare(&mut self, panels: &Panels<V>) {
        let order = self.rule.order();
        for i in 0..=order {
            let s = self.rule.nodes().get(i).copied().unwrap_or(1.0);
            let h = panels.length * V::splat(panels.place(s));
            self.jumps[i] = Jump::new(self.cam, &self.motion, h);
        }
    }

    /// The nodes of a panel.
    #[inline(always)]
    fn panel(&mut self, state: &mut State<V>, panels: &Panels<V>, sampled: bool) {
        let zero = V::splat(0.0);
        let (rates, angles) = ([[zero; 2]; MAX_ORDER], [zero; MAX_ORDER]);
        let mut known = Known { rates, angles, depths: [zero; MAX_ORDER] };
        let turns = self.turns();
        for i in 0..self.rule.order() {
            let Jump { h, radial, polar } = self.jumps[i];
            let w = radial.jump(state.w, state.speed);
            let [_, _, u0] = state.direction.n;
            let u = if turns {
                let [x, y, u] = polar.jump(&state.direction);
                known.angles[i] = atan2(y, x) + polar.turn;
                let pace = panels.pace(self.rule.nodes()[i]);
                known.rates[i] = self.rates(w, radial.arrive(state.w, w), u, pace);
                u
            } else {
                polar.jump_u(u0, state.direction.velocity[2])
            };
            known.depths[i] = w;
            if sampled {
                self.record(panels, i, w, u);
                self.store(3, i, state.time + h);
                if self.wanted.velocity {
                    self.store(6, i, radial.arrive(state.w, w));
                    self.store(7, i, polar.arrive_u(u0, u));
                }
            }
        }
        if turns {
            self.integrate(state, panels.length, &known, sampled);
        }
    }

    /// Radius, cos θ and path weight of a node.
    #[inline(always)]
    fn record(&mut self, panels: &Panels<V>, i: usize, w: V, u: V) {
        let r = w.recip();
        let flat = u * V::splat(self.cam.spin);
        let sigma = r.mul_add(r, flat * flat);
        self.store(0, i, r);
        self.store(1, i, u);
        let share = self.rule.weights()[i] * panels.pace(self.rule.nodes()[i]);
        self.store(2, i, sigma * panels.length * V::splat(share));
    }

    #[inline(always)]
    fn store(&mut self, column: usize, i: usize, x: V) {
        x.store(&mut self.rows[column][i * V::LANES..]);
    }

    /// The smooth parts of the rates of time and azimuth per unit of the rule's variable.
    #[inline(always)]
    fn rates(&self, w: V, speed: V, u: V, pace: f64) -> [V; 2] {
        let (s, m) = (V::splat, &self.motion);
        let spin = self.cam.spin;
        let w2 = w * w;
        let g = m.kappa.mul_add(w2, s(1.0)) + speed.abs();
        let pull = m.b * s(0.5) / g;
        let time = w2.mul_add(pull * s(spin * spin), pull);
        let flat = u * s(spin);
        let time = flat.mul_add(flat, time + (m.lambda - s(spin)) * s(spin));
        let turn = (pull * w2).neg_mul_add(s(spin), s(spin));
        [time * s(pace), turn * s(pace)]
    }

    /// Time and azimuth at the nodes and at the end of a panel.
    #[inline(always)]
    fn integrate(&mut self, state: &mut State<V>, length: V, known: &Known<V>, sampled: bool) {
        let rule = self.rule;
        if sampled {
            for i in 0..rule.order() {
                let closed = closed_forms(self.cam, known.depths[i]);
                let [time, azimuth] =
                    integral(rule.cumulative(i), &known.rates, length, state.integrals);
                // The closed form of time falls where that of the azimuth grows.
                let time = closed[0].mul_add(state.sense, time + state.closed[0]);
                let azimuth = closed[1].neg_mul_add(state.sense, azimuth - state.closed[1]);
                self.store(4, i, azimuth + (state.frame + known.angles[i]));
                self.store(5, i, time);
            }
        }
        state.integrals = integral(rule.weights(), &known.rates, length, state.integrals);
    }

    /// Goes to the end of the panel.
    #[inline(always)]
    fn cross(&self, state: &mut State<V>) {
        let Jump { h, radial, polar } = self.jumps[self.rule.order()];
        let w = radial.jump(state.w, state.speed);
        state.speed = radial.arrive(state.w, w);
        state.w = w;
        let direction = &mut state.direction;
        if self.turns() {
            let n = polar.jump(direction);
            *direction = Direction { n, velocity: polar.arrive(direction, n) };
            state.frame = state.frame + polar.turn;
        } else {
            let [_, _, u] = direction.n;
            let next = polar.jump_u(u, direction.velocity[2]);
            direction.velocity[2] = polar.arrive_u(u, next);
            direction.n[2] = next;
        }
        state.time = state.time + h;
    }

    /// The rows of a panel to where its rays' columns are.
    #[inline(always)]
    fn scatter(&self, starts: &mut [usize; MAX_LANES], columns: &mut [&mut [f64]; COLUMNS]) {
        let order = self.rule.order();
        for (row, column) in self.rows.iter().zip(columns) {
            if column.is_empty() {
                continue;
            }
            if order == super::lanes::CHUNK {
                V::transpose_into(row, V::LANES, column, starts.as_slice());
            } else {
                let starts = starts.get(..V::LANES).unwrap_or(&[]);
                transpose_plain(row, V::LANES, order, column, starts);
            }
        }
        for start in starts {
            *start += order;
        }
    }
}

/// The most nodes a panel may have.
pub(super) const MAX_ORDER: usize = 16;
