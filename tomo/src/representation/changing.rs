//! Emission that changes while matter carries it: fields in space, each of which shines for a part of the time.

use super::{Coordinates, CoordinatesMut, Gradient, Representation, Workspace};
use crate::Error;
use crate::dynamics::{AngularVelocity, Axis, Cotangents, Turned, pull_back, pull_back_vjp};
use crate::simd::Float;
use kerrlight_geodesic::vector::norm;
use serde::{Deserialize, Serialize};

/// Which changes are allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Allowed {
    /// Emission appears and fades: a field at each knot, linear in time in between, at the places that matter has at
    /// the reference time.
    Any,
    /// Emission only appears: a field at the first knot, and what is born between each knot and the next, at the places
    /// that matter has at the later one.
    Births,
}

/// Equidistant times, since the reference time, at which a field of emission is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knots {
    /// The first, M.
    pub first: f64,
    /// From one to the next, M.
    pub spacing: f64,
    /// How many; one is a field that does not change.
    pub count: usize,
    /// What the fields mean.
    pub allowed: Allowed,
}

impl Knots {
    /// A field that does not change.
    pub const STEADY: Self = Self { first: 0.0, spacing: 1.0, count: 1, allowed: Allowed::Any };

    /// From one time to another, M, not farther apart than `spacing`.
    ///
    /// # Errors
    /// If the spacing is not above 0, or there would be more than 10,000.
    pub fn between([from, to]: [f64; 2], spacing: f64, allowed: Allowed) -> Result<Self, Error> {
        let steps = ((to - from) / spacing).ceil();
        if !(spacing > 0.0 && steps.is_finite() && steps < 10_000.0) {
            let allowed = "above 0, with at most 10,000 in the time of the data";
            return Err(Error::out_of_range("spacing of knots", spacing, allowed));
        }
        let steps = (steps as usize).max(1);
        let spacing = (to - from).max(spacing) / steps as f64;
        Ok(Self { first: from, spacing, count: steps + 1, allowed })
    }

    /// Their times, M.
    pub fn times(&self) -> Vec<f64> {
        (0..self.count).map(|knot| self.time(knot)).collect()
    }

    fn time(&self, knot: usize) -> f64 {
        self.first + knot as f64 * self.spacing
    }

    /// The time at which matter is where the field of a knot says, M since the reference time.
    pub fn label_time(&self, knot: usize) -> f64 {
        if self.count > 1 && self.allowed == Allowed::Births { self.time(knot) } else { 0.0 }
    }

    /// The share of a knot's field in the emission at a time, 0 to 1, and by how much it grows per M.
    #[inline(always)]
    pub fn share<T: Float>(&self, knot: usize, time: T) -> (T, T) {
        let (zero, one) = (T::zero(), T::one());
        if self.count == 1 {
            return (one, zero);
        }
        let per_time = T::of(1.0 / self.spacing);
        let u = (time - T::of(self.time(knot))) * per_time;
        let (first, last) = (knot == 0, knot + 1 == self.count);
        let rises = !first && u > -one && u <= zero;
        let falls = !last && self.allowed == Allowed::Any && u > zero && u < one;
        if rises {
            (one + u, per_time)
        } else if falls {
            (one - u, -per_time)
        } else if (u <= -one && !first) || (u >= one && !last && self.allowed == Allowed::Any) {
            (zero, zero)
        } else {
            (one, zero)
        }
    }
}

/// The motion that carries fields along.
#[derive(Clone, Debug, PartialEq)]
pub struct Carrier {
    /// The axis that matter turns about.
    pub axis: Axis,
    /// How it moves.
    pub velocity: AngularVelocity,
    /// Least and largest radius (M) of matter that shines, of matter that changes its radius.
    pub limits: [f64; 2],
}

/// Fields in space, one a knot, that matter carries: e(t, x) = Σ share_k(t) e_k(x_k), where x_k is the place that the
/// matter at (t, x) has at the knot's label time. Parameters are those of the fields, one after the other.
pub struct Changing<T> {
    inner: Box<dyn Representation<T>>,
    knots: Knots,
    carrier: Carrier,
}

/// Points that one knot has a share in.
struct Part<T> {
    points: Vec<usize>,
    /// Share of each, and its growth.
    share: Vec<(T, T)>,
    /// Places, M, and times since the knot's label time, M.
    place: Vec<[f64; 3]>,
    elapsed: Vec<f64>,
    /// Places at the radii that matter has at the label time.
    stretched: [Vec<T>; 3],
    /// By which they are turned.
    angle: Vec<T>,
    /// Places at the label time.
    pulled: [Vec<T>; 3],
}

impl<T: Float> Changing<T> {
    /// Of fields in space and the motion that carries them.
    ///
    /// # Errors
    /// If the inner representation is not one in space, or there is no knot.
    pub fn new(
        inner: Box<dyn Representation<T>>,
        knots: Knots,
        carrier: Carrier,
    ) -> Result<Self, Error> {
        if inner.dimension() != 3 {
            let dimension = inner.dimension() as f64;
            return Err(Error::out_of_range("dimension of a changing field", dimension, "3"));
        }
        if knots.count == 0 {
            return Err(Error::out_of_range("knots", 0.0, "1 or more"));
        }
        Ok(Self { inner, knots, carrier })
    }

    fn of<'a>(&self, parameters: &'a [T], knot: usize) -> &'a [T] {
        let count = self.inner.parameters();
        &parameters[knot * count..(knot + 1) * count]
    }

    /// The points of a knot with its share of each.
    fn part(&self, at: &Coordinates<'_, T>, knot: usize) -> Part<T> {
        let [time, x, y, z] = at.columns() else { panic!("points in time and space") };
        let mut part = Part::default();
        let label = self.knots.label_time(knot);
        for (k, t) in time.iter().enumerate() {
            let share = self.knots.share(knot, *t);
            if share != (T::zero(), T::zero()) {
                let place = [x[k], y[k], z[k]].map(Float::double);
                part.push((k, share), (place, t.double() - label), &self.carrier);
            }
        }
        part.pull(self.carrier.axis);
        part
    }

    /// Adds what a knot's points take from the coordinates, from the slopes of its field.
    fn of_coordinates(
        &self,
        part: &Part<T>,
        (values, slopes): (&[T], &[Vec<T>; 3]),
        cotangents: &[T],
        into: &mut CoordinatesMut<'_, T>,
    ) {
        let (angles, places) = part.pull_vjp(self.carrier.axis, slopes);
        let [time, to @ ..] = into.columns() else { panic!("points in time and space") };
        for (at, k) in part.points.iter().enumerate() {
            let (place, elapsed) = (part.place[at], part.elapsed[at]);
            let r = norm(place);
            let [stretch, _] = self.carrier.velocity.step_back(r, elapsed);
            let [by_radius, by_time] = self.carrier.velocity.step_back_slopes(r, elapsed);
            let of_place = [0, 1, 2].map(|c| places[c][at].double());
            let of_stretch: f64 = (0..3).map(|c| of_place[c] * place[c]).sum();
            let along = |by: [f64; 2]| of_stretch * by[0] + angles[at].double() * by[1];
            let grown = (cotangents[*k] * values[at] * part.share[at].1).double();
            time[*k] += T::of(grown + along(by_time));
            let of_radius = if r > 0.0 { along(by_radius) / r } else { 0.0 };
            for (c, to) in to.iter_mut().enumerate() {
                to[*k] += T::of(stretch * of_place[c] + of_radius * place[c]);
            }
        }
    }
}

impl<T> Default for Part<T> {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            share: Vec::new(),
            place: Vec::new(),
            elapsed: Vec::new(),
            stretched: Default::default(),
            angle: Vec::new(),
            pulled: Default::default(),
        }
    }
}

impl<T: Float> Part<T> {
    /// A point with its share, place and time since the label time, if its matter shines.
    fn push(
        &mut self,
        (point, share): (usize, (T, T)),
        (place, elapsed): ([f64; 3], f64),
        carrier: &Carrier,
    ) {
        let r = norm(place);
        let [stretch, angle] = carrier.velocity.step_back(r, elapsed);
        let [least, most] = carrier.limits;
        let inside = stretch * r >= least && stretch * r <= most;
        if carrier.velocity.falling().is_some() && !inside {
            return;
        }
        self.points.push(point);
        self.share.push(share);
        self.place.push(place);
        self.elapsed.push(elapsed);
        self.angle.push(T::of(angle));
        let columns = self.stretched.iter_mut().zip(place);
        columns.for_each(|(column, x)| column.push(T::of(stretch * x)));
    }

    fn turned(&self) -> Turned<'_, T> {
        let [x, y, z] = &self.stretched;
        Turned { points: Coordinates::xyz(x, y, z), angles: &self.angle }
    }

    fn pull(&mut self, axis: Axis) {
        let mut pulled: [Vec<T>; 3] = core::array::from_fn(|_| vec![T::zero(); self.points.len()]);
        let [a, b, c] = &mut pulled;
        pull_back(axis, self.turned(), CoordinatesMut::xyz(a, b, c));
        self.pulled = pulled;
    }

    /// From slopes at the label time to those of the angles and of the stretched places.
    fn pull_vjp(&self, axis: Axis, [a, b, c]: &[Vec<T>; 3]) -> (Vec<T>, [Vec<T>; 3]) {
        let mut angles = vec![T::zero(); self.points.len()];
        let mut places: [Vec<T>; 3] = core::array::from_fn(|_| angles.clone());
        let [x, y, z] = &mut places;
        let points = Some(CoordinatesMut::xyz(x, y, z));
        let wanted = Cotangents { angles: Some(&mut angles), points };
        pull_back_vjp(axis, self.turned(), Coordinates::xyz(a, b, c), wanted);
        (angles, places)
    }

    fn coordinates(&self) -> Coordinates<'_, T> {
        let [x, y, z] = &self.pulled;
        Coordinates::xyz(x, y, z)
    }
}

impl<T: Float> Representation<T> for Changing<T> {
    fn dimension(&self) -> usize {
        4
    }

    fn parameters(&self) -> usize {
        self.knots.count * self.inner.parameters()
    }

    fn initialise(&self, seed: u64, parameters: &mut [T]) {
        let (first, others) = parameters.split_at_mut(self.inner.parameters());
        self.inner.initialise(seed, first);
        others.chunks_exact_mut(first.len()).for_each(|knot| knot.copy_from_slice(first));
    }

    fn project(&self, parameters: &mut [T]) {
        let knots = parameters.chunks_exact_mut(self.inner.parameters());
        knots.for_each(|knot| self.inner.project(knot));
    }

    fn eval(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        workspace: &mut Workspace,
    ) {
        values.fill(T::zero());
        for knot in 0..self.knots.count {
            let part = self.part(&at, knot);
            if part.points.is_empty() {
                continue;
            }
            let mut found = vec![T::zero(); part.points.len()];
            self.inner.eval(self.of(parameters, knot), part.coordinates(), &mut found, workspace);
            let pairs = part.points.iter().zip(&part.share).zip(found);
            pairs.for_each(|((k, share), found)| values[*k] += share.0 * found);
        }
    }

    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let Gradient { parameters: out, mut coordinates } = gradient;
        for (knot, out) in out.chunks_exact_mut(self.inner.parameters()).enumerate() {
            let part = self.part(&at, knot);
            if part.points.is_empty() {
                continue;
            }
            let own = self.of(parameters, knot);
            let pairs = part.points.iter().zip(&part.share);
            let inner: Vec<T> = pairs.map(|(k, share)| cotangents[*k] * share.0).collect();
            let Some(into) = coordinates.as_mut() else {
                let gradient = Gradient { parameters: out, coordinates: None };
                self.inner.vjp(own, part.coordinates(), &inner, gradient, workspace);
                continue;
            };
            let mut values = vec![T::zero(); part.points.len()];
            let mut slopes: [Vec<T>; 3] = core::array::from_fn(|_| values.clone());
            self.inner.eval(own, part.coordinates(), &mut values, workspace);
            let [x, y, z] = &mut slopes;
            let columns = CoordinatesMut::xyz(x, y, z);
            let gradient = Gradient { parameters: out, coordinates: Some(columns) };
            self.inner.vjp(own, part.coordinates(), &inner, gradient, workspace);
            self.of_coordinates(&part, (&values, &slopes), cotangents, into);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Velocity;
    use crate::representation::conformance::{Subject, check};
    use crate::representation::grid::tests::plain;
    use crate::representation::{Activation, Grid, GridSettings};
    use kerrlight_geodesic::vector::{cross, rotate};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const AXIS: [f64; 3] = [0.36, 0.48, 0.8];

    fn settings() -> GridSettings {
        GridSettings {
            nodes: [5, 4, 6],
            low: [-2.0; 3],
            high: [2.0; 3],
            activation: Activation::Softplus,
            initial: 0.1,
        }
    }

    fn velocity() -> AngularVelocity {
        AngularVelocity::PowerLaw { radius: 1.0, rate: 0.4, exponent: 1.0 }
    }

    fn field(count: usize, allowed: Allowed) -> Changing<f64> {
        let knots = Knots { first: -0.3, spacing: 0.25, count, allowed };
        let axis = Axis::new(AXIS).unwrap();
        let carrier = Carrier { axis, velocity: velocity(), limits: [0.0, 2.0] };
        Changing::new(Box::new(Grid::new(settings()).unwrap()), knots, carrier).unwrap()
    }

    /// Shares of the knots at a time, and their growth: hat functions, or ramps that stay up.
    fn shares(knots: Knots, time: f64) -> Vec<(f64, f64)> {
        let u = (time - knots.first) / knots.spacing;
        let last = knots.count as f64 - 1.0;
        let per_time = if u < 0.0 || u > last { 0.0 } else { 1.0 / knots.spacing };
        let u = u.clamp(0.0, last);
        let hat = |k: usize| {
            let d = u - k as f64;
            ((1.0 - d.abs()).max(0.0), if d.abs() < 1.0 { -d.signum() * per_time } else { 0.0 })
        };
        let hats: Vec<(f64, f64)> = (0..knots.count).map(hat).collect();
        match knots.allowed {
            Allowed::Any => hats,
            // What is there is what was born so far.
            Allowed::Births => {
                let rest =
                    |k: usize| hats[k..].iter().fold((0.0, 0.0), |s, h| (s.0 + h.0, s.1 + h.1));
                (0..knots.count).map(rest).collect()
            }
        }
    }

    /// The same written plainly, and its derivative.
    fn plain_in_time(
        knots: Knots,
        (p, dp): (&[f64], &[f64]),
        (at, dat): (&[f64], &[f64]),
    ) -> (f64, f64) {
        let n = settings().nodes.iter().product::<usize>();
        let (mut sum, mut change) = (0.0, 0.0);
        for (knot, (share, growth)) in shares(knots, at[0]).into_iter().enumerate() {
            let births = knots.count > 1 && knots.allowed == Allowed::Births;
            let label = if births { knots.times()[knot] } else { 0.0 };
            let (x, dx) = ([at[1], at[2], at[3]], [dat[1], dat[2], dat[3]]);
            let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            let dr = x.iter().zip(dx).map(|(x, d)| x * d).sum::<f64>() / r;
            let angle = -0.4 / r * (at[0] - label);
            let dangle = -0.4 / r * dat[0] - angle * dr / r;
            let (here, along) = (rotate(AXIS, angle, x), rotate(AXIS, angle, dx));
            let across = cross(AXIS, here);
            let slope = [0, 1, 2].map(|c| along[c] + dangle * across[c]);
            let own = knot * n..(knot + 1) * n;
            let (e, de) = plain(&settings(), &p[own.clone()], &dp[own], &here, &slope);
            sum += share * e;
            change += share * de + growth * dat[0] * e;
        }
        (sum, change)
    }

    #[test]
    fn exact_changing_fields_conform() {
        for (count, allowed) in
            [(1, Allowed::Any), (2, Allowed::Any), (4, Allowed::Any), (3, Allowed::Births)]
        {
            let field = field(count, allowed);
            let tangent = |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| {
                plain_in_time(field.knots, (p, dp), (at, dat))
            };
            let (representation, within) = (&field, 1.3);
            check(&Subject { representation, within, parameter_noise: 1.0, tangent: &tangent });
        }
    }

    #[test]
    fn exact_values_are_linear_between_knots_and_constant_outside() {
        let softplus = |x: f64| x.exp().ln_1p();
        let [a, b, c] = [0.0, 1.0, 5.0].map(softplus);
        let times = [-9.0, -0.3, -0.175, -0.05, 0.15, 0.2, 7.0];
        let cases = [
            (Allowed::Any, [a, a, 0.5 * (a + b), b, b + 0.8 * (c - b), c, c]),
            (Allowed::Births, [a, a, a + 0.5 * b, a + b, a + b + 0.8 * c, a + b + c, a + b + c]),
        ];
        for (allowed, expected) in cases {
            let field = field(3, allowed);
            let n = field.inner.parameters();
            let parameters: Vec<f64> = (0..3 * n).map(|k| [0.0, 1.0, 5.0][k / n]).collect();
            let (one, zero, mut values) = ([0.3; 7], [0.0; 7], [0.0; 7]);
            let at = Coordinates::txyz(&times, &one, &zero, &zero);
            field.eval(&parameters, at, &mut values, &mut Workspace::new());
            for (value, expected) in values.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-13, "{value} {expected}");
            }
        }
    }

    /// Where matter falls, slopes along random directions are those of central differences.
    #[test]
    fn exact_slopes_of_falling_fields_are_those_of_differences() {
        let law = Velocity::Infall { xi: 0.8, beta_r: 0.8, beta_phi: 0.9, drag: None };
        let settings = GridSettings { low: [-9.0; 3], high: [9.0; 3], ..settings() };
        for allowed in [Allowed::Any, Allowed::Births] {
            let knots = Knots { first: -3.0, spacing: 2.5, count: 3, allowed };
            let velocity = law.angular(0, 0.3).unwrap();
            let axis = Axis::new(AXIS).unwrap();
            let carrier = Carrier { axis, velocity, limits: [2.0, 12.0] };
            let grid = Grid::new(settings.clone()).unwrap();
            let field = Changing::<f64>::new(Box::new(grid), knots, carrier).unwrap();
            let mut random = Pcg64::seed_from_u64(3);
            let mut draw = |low: f64, high: f64| random.random_range(low..high);
            let parameters: Vec<f64> = (0..field.parameters()).map(|_| draw(-1.0, 1.0)).collect();
            for _ in 0..40 {
                let at = [draw(-2.9, 1.9), draw(3.0, 6.0), draw(-5.0, 5.0), draw(-3.0, 3.0)];
                let along = [0; 4].map(|_| draw(-1.0, 1.0));
                let value = |s: f64| {
                    let [t, x, y, z]: [f64; 4] = core::array::from_fn(|k| at[k] + s * along[k]);
                    let (columns, mut value) = ([[t], [x], [y], [z]], [0.0]);
                    let [t, x, y, z] = &columns;
                    let at = Coordinates::txyz(t, x, y, z);
                    field.eval(&parameters, at, &mut value, &mut Workspace::new());
                    value[0]
                };
                let [t, x, y, z] = at.map(|x| [x]);
                let mut slopes = [[0.0]; 4];
                let [dt, dx, dy, dz] = &mut slopes;
                let mut unused = vec![0.0; parameters.len()];
                let coordinates = Some(CoordinatesMut::txyz(dt, dx, dy, dz));
                let into = Gradient { parameters: &mut unused, coordinates };
                let at = Coordinates::txyz(&t, &x, &y, &z);
                field.vjp(&parameters, at, &[1.0], into, &mut Workspace::new());
                let slope: f64 = slopes.iter().zip(along).map(|([s], d)| s * d).sum();
                let h = 1e-5;
                let difference = (value(h) - value(-h)) / (2.0 * h);
                assert!((slope - difference).abs() < 1e-6, "{slope} {difference} {at:?}");
            }
        }
    }

    #[test]
    fn exact_knots_cover_the_time_that_is_asked_for() {
        let between = |from, to, spacing| Knots::between([from, to], spacing, Allowed::Births);
        let knots = between(-10.0, 25.0, 4.0).unwrap();
        assert_eq!((knots.count, *knots.times().last().unwrap()), (10, 25.0));
        assert!(knots.spacing <= 4.0 && knots.label_time(9) == 25.0);
        assert_eq!(between(3.0, 3.0, 4.0).unwrap().count, 2);
        assert!(between(0.0, 1.0, 0.0).is_err());
    }
}
