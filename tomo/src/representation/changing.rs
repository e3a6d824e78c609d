//! Emission that changes while matter carries it: fields in space, each of which shines for a part of the time.

use super::{Coordinates, CoordinatesMut, Gradient, Representation, WeightMatrix, Workspace};
use crate::Error;
use kerrlight_common::simd::Float;
use kerrlight_geodesic::vector::norm;
use kerrlight_render::dynamics::{
    AngularVelocity, Axis, Cotangents, Turned, pull_back, pull_back_vjp,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Changes that are allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Allowed {
    /// Emission appears and fades, linear in time between the knots.
    Any,
    /// Emission only appears, between each knot and the next (linear-grid).
    Births,
}

/// Equidistant times, since the reference time, at which a field of emission is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knots {
    /// The first, M.
    pub first: f64,
    /// Distance of knots, M.
    pub spacing: f64,
    /// Number of knots; one is a field that does not change.
    pub count: usize,
    /// Meaning of the fields.
    pub allowed: Allowed,
}

impl Knots {
    /// A field that does not change.
    pub const STEADY: Self = Self { first: 0.0, spacing: 1.0, count: 1, allowed: Allowed::Any };

    /// Spreads knots from one time to another, M, not farther apart than `spacing`.
    ///
    /// # Errors
    /// If the spacing is not above 0, or there would be more than 10,000.
    pub fn between([from, to]: [f64; 2], spacing: f64, allowed: Allowed) -> Result<Self, Error> {
        let steps = ((to - from) / spacing).ceil();
        let ok = spacing > 0.0 && steps.is_finite() && steps < 10_000.0;
        let most = "above 0, with at most 10,000 in the time of the data";
        Error::check("spacing of knots", spacing, ok, most)?;
        // Data of one moment have two knots, too, a whole spacing apart: shares divide by it.
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

    /// The last of them, M.
    pub fn last(&self) -> f64 {
        self.time(self.count - 1)
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
        // Half-open, so that at a knot's own time one slope counts, that of its rise.
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
    /// Velocity of the matter.
    pub velocity: AngularVelocity,
    /// Least and largest radius (M) of matter that shines, of matter that changes its radius.
    pub limits: [f64; 2],
}

/// Fields in space, one a knot, that matter carries: e(t, x) = Σ share_k(t) e_k(x_k), where x_k is the place that the
/// matter at (t, x) has at the knot's label time. Parameters are those of the fields, one after the other.
///
/// A field that changes while matter carries it. Without a [`Carrier`] points are given by the places that their matter has
/// at the reference time ([`Representation::is_carried`]), which are those of all knots.
pub struct Changing<T> {
    inner: Box<dyn Representation<T>>,
    knots: Knots,
    carrier: Option<Carrier>,
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
    /// Angles by which they are turned.
    angle: Vec<T>,
    /// Places at the label time.
    pulled: [Vec<T>; 3],
}

impl<T: Float> Changing<T> {
    /// Takes fields in space and the motion that carries them.
    ///
    /// # Errors
    /// If the inner representation is not one in space, there is no knot, or births have no carrier: each knot's are given at
    /// places of another time.
    pub fn new(
        inner: Box<dyn Representation<T>>,
        knots: Knots,
        carrier: Option<Carrier>,
    ) -> Result<Self, Error> {
        let (check, dimension) = (Error::check, inner.dimension());
        let has_carrier = carrier.is_some() || knots.allowed != Allowed::Births;
        check("carrier", f64::NAN, has_carrier, "a motion that carries births")?;
        check("dimension of a changing field", dimension as f64, dimension == 3, "3")?;
        check("knots", 0.0, knots.count > 0, "1 or more")?;
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
            // Without a share an evaluation would be for nothing.
            if share == (T::zero(), T::zero()) {
                continue;
            }
            let place = [x[k], y[k], z[k]];
            match &self.carrier {
                Some(carrier) => {
                    let (place, elapsed) = (place.map(Float::double), t.double() - label);
                    part.push(k, share, place, elapsed, carrier);
                }
                None => part.push_carried(k, share, place),
            }
        }
        if let Some(carrier) = &self.carrier {
            part.pull(carrier.axis);
        }
        part
    }

    /// Adds what a knot's points take from the coordinates, from the slopes of its field.
    fn of_coordinates(
        &self,
        part: &Part<T>,
        values: &[T],
        slopes: &[Vec<T>; 3],
        cotangents: &[T],
        into: &mut CoordinatesMut<'_, T>,
    ) {
        let [time, to @ ..] = into.columns() else { panic!("points in time and space") };
        // `slopes` hold cotangent and share already, the growth of the share holds neither.
        let grown = |at: usize| cotangents[part.points[at]] * values[at] * part.share[at].1;
        let Some(carrier) = &self.carrier else {
            for (at, k) in part.points.iter().enumerate() {
                time[*k] += grown(at);
                to.iter_mut().zip(slopes).for_each(|(to, slope)| to[*k] += slope[at]);
            }
            return;
        };
        let (angles, places) = part.pull_vjp(carrier.axis, slopes);
        for (at, k) in part.points.iter().enumerate() {
            let (place, elapsed) = (part.place[at], part.elapsed[at]);
            // The place at the label time is R(angle(r, t)) stretch(r, t) x: both factors depend on
            // the radius and on the time.
            let r = norm(place);
            let [stretch, _] = carrier.velocity.step_back(r, elapsed);
            let [by_radius, by_time] = carrier.velocity.step_back_slopes(r, elapsed);
            let of_place = [0, 1, 2].map(|c| places[c][at].double());
            let of_stretch: f64 = (0..3).map(|c| of_place[c] * place[c]).sum();
            let along = |by: [f64; 2]| of_stretch * by[0] + angles[at].double() * by[1];
            time[*k] += T::of(grown(at).double() + along(by_time));
            // At the centre the radius has no direction to change along.
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
        point: usize,
        share: (T, T),
        place: [f64; 3],
        elapsed: f64,
        carrier: &Carrier,
    ) {
        let r = norm(place);
        let [stretch, angle] = carrier.velocity.step_back(r, elapsed);
        let [least, most] = carrier.limits;
        let inside = stretch * r >= least && stretch * r <= most;
        // Matter on circles keeps the radius by which its nodes were chosen.
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

    /// A point that is given by the place that its matter has at the label time, with its share.
    fn push_carried(&mut self, point: usize, share: (T, T), place: [T; 3]) {
        self.points.push(point);
        self.share.push(share);
        self.pulled.iter_mut().zip(place).for_each(|(column, x)| column.push(x));
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

    /// Converts slopes at the label time to those of the angles and of the stretched places.
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

    fn is_carried(&self) -> bool {
        self.carrier.is_none()
    }

    fn matrices(&self) -> Vec<WeightMatrix> {
        let (inner, count) = (self.inner.matrices(), self.inner.parameters());
        let of = |knot: usize| {
            let behind =
                move |m: &WeightMatrix| WeightMatrix { offset: m.offset + knot * count, ..*m };
            inner.iter().map(behind)
        };
        (0..self.knots.count).flat_map(of).collect()
    }

    fn parameters(&self) -> usize {
        self.knots.count * self.inner.parameters()
    }

    fn initialise(&self, seed: u64, parameters: &mut [T]) {
        let (first, others) = parameters.split_at_mut(self.inner.parameters());
        self.inner.initialise(seed, first);
        // All knots start alike, as emission that does not change.
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
            // Slopes with the time need the field itself; parameters alone do not.
            let mut values = vec![T::zero(); part.points.len()];
            let mut slopes: [Vec<T>; 3] = core::array::from_fn(|_| values.clone());
            self.inner.eval(own, part.coordinates(), &mut values, workspace);
            let [x, y, z] = &mut slopes;
            let columns = CoordinatesMut::xyz(x, y, z);
            let gradient = Gradient { parameters: out, coordinates: Some(columns) };
            self.inner.vjp(own, part.coordinates(), &inner, gradient, workspace);
            self.of_coordinates(&part, &values, &slopes, cotangents, into);
        }
    }
}

#[cfg(test)]
mod tests;
