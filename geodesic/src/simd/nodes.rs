//! Nodes of a quadrature along many rays, inside a sphere.

use super::ScreenRays;
use super::column::{Aligned, span};
use super::error::{MAX_STEP, estimate};
use super::lanes::{InstructionSet, Lanes, MAX_LANES, Task, dispatch};
use super::march::{COLUMNS, GROWTH, Jump, Key, MAX_ORDER, March, RayLanes};
use super::motion::{Camera, Clock, Journey, Motion};
use super::panel::{LONGEST_PANEL, PanelRule};
use super::ray_nodes::RayNodes;
use crate::error::{Error, check};
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::quantities::Quantities;

/// Selection of nodes, and of quantities at them.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeRequest {
    /// Radius in M of the sphere outside of which there are no nodes.
    pub radius: f64,
    /// The rule of a panel: at most 16 nodes.
    pub rule: PanelRule,
    /// Number of panels into which each of the coarsest division is cut. Those are at most
    /// 0.4/√max(1, η + λ²) of Mino time: a tenth of a half-turn about the hole or so.
    pub split: u32,
    /// Quantities computed at the nodes.
    pub quantities: Quantities,
}

/// Nodes of many rays in columns, ray after ray: Gauss–Legendre panels in Mino time over the part
/// of each ray inside a sphere, down to the turning point and out again or to the horizon. All
/// integrals over them converge geometrically in the number of panels for integrands that are
/// smooth in Mino time, or go like a half-integer power of Δ at the horizon.
#[derive(Debug, Clone, Default)]
pub struct Nodes {
    /// Ends of each ray's nodes.
    ends: Vec<usize>,
    columns: [Vec<f64>; COLUMNS],
    error: Vec<f64>,
    plan: Vec<Plan>,
}

/// Most panels of a ray before `split`: longer rays have no digits left.
const MOST: f64 = 1e4;

/// Division of a ray.
#[derive(Debug, Clone, Copy)]
struct Plan {
    key: Key,
    /// Mino times of the approach, from infinity to the entry, and of the uniform panels on
    /// either side of the turning point, or of the last leg.
    approach: f64,
    since: f64,
    inward: f64,
    last: f64,
    ray: usize,
}

impl Nodes {
    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.ends.len()
    }

    /// The nodes of ray number `k`; none if there is no such ray.
    pub fn ray(&self, k: usize) -> RayNodes<'_> {
        let range = span(&self.ends, k);
        let column = |c: usize| self.columns[c].get(range.clone()).unwrap_or(&[]);
        let error = self.error.get(k).copied().unwrap_or(f64::NAN);
        RayNodes::of(core::array::from_fn(column), error)
    }

    /// Places nodes on the rays that arrive at (`alpha[k]`, `beta[k]`), each up to the Mino time
    /// `until[k]` if that is given. On the caller's thread; memory is reused.
    ///
    /// # Errors
    /// As for [`Crossings::trace`](super::Crossings::trace), or if a number of the request is out
    /// of its range.
    pub fn trace(
        &mut self,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        until: Option<&[f64]>,
        request: &NodeRequest,
    ) -> Result<(), Error> {
        self.trace_at(InstructionSet::best(), hole, observer, alpha, beta, until, request)
    }

    /// [`trace`](Self::trace) on a given instruction set.
    ///
    /// # Errors
    /// As for [`trace`](Self::trace).
    #[allow(clippy::too_many_arguments)]
    pub fn trace_at(
        &mut self,
        set: InstructionSet,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        until: Option<&[f64]>,
        request: &NodeRequest,
    ) -> Result<(), Error> {
        let rays = ScreenRays::new(hole, observer, alpha, beta)?;
        self.trace_rays(set, rays, until, request)
    }

    /// [`trace_at`](Self::trace_at) of rays that have been checked.
    pub(crate) fn trace_rays(
        &mut self,
        set: InstructionSet,
        screen: ScreenRays<'_>,
        until: Option<&[f64]>,
        request: &NodeRequest,
    ) -> Result<(), Error> {
        let ScreenRays { alpha, beta, .. } = screen;
        let camera = Camera { margin: 0.0, ..screen.camera };
        let radius = request.radius;
        let outside = radius > camera.r_plus() && radius.is_finite();
        check("radius of the sphere", radius, outside, "a finite number above the horizon's (M)")?;
        let order = request.rule.order();
        check("nodes a panel", order as f64, order <= MAX_ORDER, "a number in [1, 16]")?;
        let split = f64::from(request.split);
        check("panels", split, (1.0..=1024.0).contains(&split), "a number in [1, 1024]")?;
        let same = until.is_none_or(|until| until.len() == alpha.len());
        check("number of end times", 0.0, same, "as many as of alpha")?;
        let rays = Rays { camera, alpha, beta, until, request };
        dispatch(set, Planning { rays: &rays, nodes: self });
        self.lay_out(&rays);
        dispatch(set, Marching { rays: &rays, nodes: self });
        screen.turn(&mut self.columns[4]);
        Ok(())
    }

    /// Lays out the destinations of each ray's nodes, and the order in which rays are taken: those
    /// alike together.
    fn lay_out(&mut self, rays: &Rays<'_>) {
        let (order, wanted) = (rays.request.rule.order(), rays.request.quantities);
        self.ends.clear();
        let mut end = 0;
        for plan in &self.plan {
            end += order * plan.key.sampled() as usize;
            self.ends.push(end);
        }
        let filled = [true, true, true, true, wanted.azimuth, wanted.time];
        let filled = filled.into_iter().chain([wanted.velocity; 2]);
        for (column, filled) in self.columns.iter_mut().zip(filled) {
            // Every number is written by the march.
            column.resize(if filled { end } else { 0 }, 0.0);
        }
        self.plan.sort_by_key(|plan| plan.key);
    }

    /// Returns the number of panels on each leg of each ray, in the order of the rays.
    pub(crate) fn layouts(&self) -> Vec<Key> {
        let mut layouts = vec![Key::default(); self.plan.len()];
        self.plan.iter().for_each(|plan| layouts[plan.ray] = plan.key);
        layouts
    }
}

/// Rays to be traced.
struct Rays<'a> {
    camera: Camera,
    alpha: &'a [f64],
    beta: &'a [f64],
    until: Option<&'a [f64]>,
    request: &'a NodeRequest,
}

/// Cuts all rays into legs and panels.
struct Planning<'a> {
    rays: &'a Rays<'a>,
    nodes: &'a mut Nodes,
}

impl Task<f64> for Planning<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<f64>>(self) {
        let Self { rays, nodes } = self;
        nodes.plan.clear();
        nodes.error.clear();
        for from in (0..rays.alpha.len()).step_by(V::LANES) {
            let to = rays.alpha.len().min(from + V::LANES);
            let (alpha, beta) = (V::load(&rays.alpha[from..to]), V::load(&rays.beta[from..to]));
            let times = times(rays, alpha, beta);
            let mut lanes = [[0.0; MAX_LANES]; 7];
            for (time, lane) in times.into_iter().zip(&mut lanes) {
                time.store(lane);
            }
            let [enter, since, duration, escapes, turn, b, error] = lanes;
            for l in 0..to - from {
                let ray = from + l;
                let until = rays.until.map_or(f64::INFINITY, |until| until[ray]);
                let escapes = (escapes[l] > 0.5).then_some(turn[l]);
                let (enter, since, duration) = (enter[l], since[l], duration[l]);
                let way = Way { enter, since, duration, escapes, b: b[l], until };
                nodes.plan.push(way.plan(ray, rays.request));
                nodes.error.push(error[l]);
            }
        }
    }
}

/// Mino times of the entry into the sphere since the observer and since infinity, and of the
/// whole ray, whether it escapes, the turning radius, the scale of its frequencies, and the error
/// of its positions.
#[inline(always)]
fn times<V: Lanes<f64>>(rays: &Rays<'_>, alpha: V, beta: V) -> [V; 7] {
    let s = V::splat;
    let cam = &rays.camera;
    let motion = Motion::new(cam, alpha, beta);
    let clock = Clock::new(&motion);
    let journey = Journey::by(&clock, cam, &motion);
    let (w, start) = ((1.0 / rays.request.radius).max(cam.w_obs), s(cam.w_obs));
    let since = clock.until(s(w), motion.radial(s(w)).max(s(0.0)).sqrt());
    let mut enter = since;
    if w <= cam.w_obs {
        enter = s(0.0);
    } else if cam.w_obs > 0.0 {
        enter = since - clock.until(start, motion.radial(start).sqrt());
    }
    let b = motion.stiffness().sqrt();
    let error = estimate(journey.condition, b, b, s(MAX_STEP), s(0.0));
    // The polar motion has frequencies of the order of a too.
    let b = (motion.stiffness() + s(3.0 * cam.spin * cam.spin)).sqrt();
    [enter, since, journey.duration, journey.escapes, journey.r_turn, b, error]
}

/// A ray's way through the sphere.
struct Way {
    enter: f64,
    since: f64,
    duration: f64,
    /// The turning radius of rays that escape.
    escapes: Option<f64>,
    b: f64,
    until: f64,
}

impl Way {
    fn plan(&self, ray: usize, request: &NodeRequest) -> Plan {
        let (approach, since, split) = (self.enter, self.since, request.split);
        let nothing = Plan { key: Key::default(), approach, since, inward: 0.0, last: 0.0, ray };
        let end = match self.escapes {
            Some(_) => (0.5 * self.duration).min(self.until),
            None => self.duration.min(self.until),
        };
        let length = end - approach;
        // NaN and what rounding leaves of a tangent to the sphere too.
        let enters = length > 0.0 && length.is_finite();
        if !enters || self.escapes.is_some_and(|r| r >= request.radius) {
            return nothing;
        }
        let (entry, far) = self.growing(length);
        let rest = length - far;
        let key = Key { approach: self.panels(approach), entry, split, ..Key::default() };
        let inward = split * self.panels(rest).max(1);
        if self.escapes.is_none() && self.until >= self.duration {
            let last = rest / f64::from(inward);
            let key = Key { falls: true, inward: inward - 1, last: 1, ..key };
            return Plan { key, inward: rest - last, last, ..nothing };
        }
        let leaves = self.escapes.is_some() && self.until >= self.duration - approach;
        let exit = if leaves { entry } else { 0 };
        let last = match self.escapes {
            Some(_) if leaves => rest,
            Some(_) => ((self.duration - approach).min(self.until) - end).max(0.0),
            None => 0.0,
        };
        let key = Key { inward, last: split * self.panels(last), exit, ..key };
        Plan { key, inward: rest, last, ..nothing }
    }

    fn panels(&self, length: f64) -> u32 {
        (self.b * length / LONGEST_PANEL).ceil().clamp(0.0, MOST) as u32
    }

    /// The number and the whole length of the growing legs at the beginning of a way.
    fn growing(&self, length: f64) -> (u32, f64) {
        let (mut legs, mut reach) = (0, self.since);
        while reach * GROWTH < self.since + length
            && reach * (GROWTH - 1.0) < LONGEST_PANEL / self.b
        {
            (legs, reach) = (legs + 1, reach * GROWTH);
        }
        (legs, reach - self.since)
    }
}

/// Fills the columns.
struct Marching<'a> {
    rays: &'a Rays<'a>,
    nodes: &'a mut Nodes,
}

impl Task<f64> for Marching<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<f64>>(self) {
        let Self { rays, nodes } = self;
        let request = rays.request;
        let entry =
            if 1.0 / request.radius > rays.camera.w_obs { 1.0 / request.radius } else { 0.0 };
        let Aligned(rows) = &mut Aligned([[0.0; MAX_ORDER * MAX_LANES]; COLUMNS]);
        let mut jumps = Jump::<V>::room(&rays.camera);
        let plan = core::mem::take(&mut nodes.plan);
        for group in plan.chunk_by(|a, b| a.key == b.key) {
            for block in group.chunks(V::LANES) {
                let key = group[0].key;
                if key.sampled() == 0 {
                    continue;
                }
                let (lanes, starts) = gather::<V>(rays, nodes, block, entry);
                let motion = Motion::new(&rays.camera, lanes.alpha, lanes.beta);
                let mut march = March {
                    cam: &rays.camera,
                    motion,
                    rule: &request.rule,
                    wanted: request.quantities,
                    rows: &mut *rows,
                    jumps: &mut jumps,
                };
                let mut columns = nodes.columns.each_mut().map(Vec::as_mut_slice);
                march.run(&lanes, key, starts, &mut columns);
            }
        }
        nodes.plan = plan;
    }
}

/// Rays into lanes, the last one repeated, and where their nodes go.
#[inline(always)]
fn gather<V: Lanes<f64>>(
    rays: &Rays<'_>,
    nodes: &Nodes,
    block: &[Plan],
    entry: f64,
) -> (RayLanes<V>, [usize; MAX_LANES]) {
    let mut values = [[0.0; MAX_LANES]; 6];
    let mut starts = [0; MAX_LANES];
    for l in 0..V::LANES {
        let Some(plan) = block.get(l).or(block.last()) else { break };
        let Plan { approach, since, inward, last, ray, .. } = *plan;
        let row = [rays.alpha[ray], rays.beta[ray], approach, since, inward, last];
        for (value, x) in values.iter_mut().zip(row) {
            value[l] = x;
        }
        starts[l] = span(&nodes.ends, ray).start;
    }
    let [alpha, beta, approach, since, inward, last] = &values;
    let lanes = RayLanes {
        alpha: V::load(alpha),
        beta: V::load(beta),
        approach: V::load(approach),
        since: V::load(since),
        inward: V::load(inward),
        last: V::load(last),
        entry: V::splat(entry),
    };
    (lanes, starts)
}
