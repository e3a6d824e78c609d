//! Rotations about one axis by an angle a point, on lanes, and their derivative.

use super::Axis;
use crate::points::{Coordinates, CoordinatesMut};
use core::ops::Range;
use kerrlight_common::simd::{Float, InstructionSet, Lanes, Task, dispatch, math};

/// Points that one thread takes at a time.
const SHARE: usize = 8192;

/// Points and the angles by which they are turned.
#[derive(Clone, Copy, Debug)]
pub struct Turned<'a, T> {
    /// Points in space where light was emitted.
    pub points: Coordinates<'a, T>,
    /// Angle of each, radians, right-handed about the axis.
    pub angles: &'a [T],
}

impl<'a, T> Turned<'a, T> {
    fn range(&self, range: Range<usize>) -> Self {
        Self { points: self.points.range(range.clone()), angles: &self.angles[range] }
    }

    fn halves(&self) -> (Self, Self, usize) {
        let (all, middle) = (self.angles.len(), self.angles.len() / 2);
        (self.range(0..middle), self.range(middle..all), middle)
    }
}

/// `pulled` = R(axis, angle) x of each point; overwritten.
///
/// Pulls points back on all threads; a point's result depends on nothing else.
///
/// # Panics
/// If lengths differ or points are not in space.
pub fn pull_back<T: Float>(axis: Axis, turned: Turned<'_, T>, pulled: CoordinatesMut<'_, T>) {
    check(&turned, pulled.len(), pulled.dimension());
    if turned.angles.len() > SHARE {
        let (left, right, middle) = turned.halves();
        let (first, second) = pulled.split_at(middle);
        let more = || pull_back(axis, right, second);
        rayon::join(|| pull_back(axis, left, first), more);
        return;
    }
    let axis = axis.vector().map(T::of);
    dispatch(InstructionSet::best(), Forward { axis, turned, pulled });
}

fn check<T>(turned: &Turned<'_, T>, length: usize, dimension: usize) {
    assert!(turned.points.dimension() == 3 && dimension == 3);
    assert!(turned.points.len() == length && turned.angles.len() == length);
}

/// Gradients that [`pull_back_vjp`] adds to, if wanted.
#[derive(Debug, Default)]
pub struct Cotangents<'a, T> {
    /// Gradient with respect to the angles.
    pub angles: Option<&'a mut [T]>,
    /// Gradient with respect to the points, angles held.
    pub points: Option<CoordinatesMut<'a, T>>,
}

impl<T> Cotangents<'_, T> {
    fn split_at(self, middle: usize) -> (Self, Self) {
        let (angles, more_angles) = self.angles.map(|all| all.split_at_mut(middle)).unzip();
        let (points, more_points) = self.points.map(|all| all.split_at(middle)).unzip();
        let right = Self { angles: more_angles, points: more_points };
        (Self { angles, points }, right)
    }
}

/// Gradient along the sphere with respect to the axis of a loss whose gradient with respect to the
/// pulled-back points is `gradient`; adds the other gradients that are wanted.
///
/// Pulls gradients back. Where the angle depends on the radius, the gradient with respect to the
/// points has dL/dangle · dangle/dr · x/r besides. Sums are in double precision and do not depend
/// on the number of threads.
///
/// # Panics
/// If lengths differ or points are not in space.
pub fn pull_back_vjp<T: Float>(
    axis: Axis,
    turned: Turned<'_, T>,
    gradient: Coordinates<'_, T>,
    wanted: Cotangents<'_, T>,
) -> [f64; 3] {
    check(&turned, gradient.len(), gradient.dimension());
    if let Some(angles) = &wanted.angles {
        assert!(angles.len() == gradient.len());
    }
    if let Some(points) = &wanted.points {
        assert!(points.len() == gradient.len() && points.dimension() == 3);
    }
    axis.tangent(sum(axis.vector().map(T::of), turned, gradient, wanted))
}

/// The gradient in the space around the sphere, by halves.
fn sum<T: Float>(
    axis: [T; 3],
    turned: Turned<'_, T>,
    gradient: Coordinates<'_, T>,
    wanted: Cotangents<'_, T>,
) -> [f64; 3] {
    if turned.angles.len() <= SHARE {
        return dispatch(InstructionSet::best(), Backward { axis, turned, gradient, wanted });
    }
    let (left, right, middle) = turned.halves();
    let (first, second) = wanted.split_at(middle);
    let (of_left, of_right) =
        (gradient.range(0..middle), gradient.range(middle..turned.angles.len()));
    let (a, b) =
        rayon::join(|| sum(axis, left, of_left, first), || sum(axis, right, of_right, second));
    core::array::from_fn(|k| a[k] + b[k])
}

#[inline(always)]
fn dot<T: Float, V: Lanes<T>>(a: [V; 3], b: [V; 3]) -> V {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

#[inline(always)]
fn cross<T: Float, V: Lanes<T>>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// R(axis) x for an angle of this sine and cosine (Rodrigues).
#[inline(always)]
fn rotate<T: Float, V: Lanes<T>>(axis: [V; 3], sin: V, cos: V, x: [V; 3]) -> [V; 3] {
    let along = (V::splat(T::one()) - cos) * dot(axis, x);
    let swirl = cross(axis, x);
    // A loop and no `map`: in a closure the intrinsics of the instruction set become calls.
    let mut rotated = [along; 3];
    for k in 0..3 {
        rotated[k] = cos.mul_add(x[k], sin.mul_add(swirl[k], along * axis[k]));
    }
    rotated
}

#[inline(always)]
fn load<T: Float, V: Lanes<T>>(points: &Coordinates<'_, T>, from: usize) -> [V; 3] {
    let mut lanes = [V::splat(T::zero()); 3];
    for (lanes, column) in lanes.iter_mut().zip(points.columns()) {
        *lanes = V::load_or(&column[from..], T::zero());
    }
    lanes
}

#[inline(always)]
fn splat<T: Float, V: Lanes<T>>(x: [T; 3]) -> [V; 3] {
    [V::splat(x[0]), V::splat(x[1]), V::splat(x[2])]
}

struct Forward<'a, T> {
    axis: [T; 3],
    turned: Turned<'a, T>,
    pulled: CoordinatesMut<'a, T>,
}

impl<T: Float> Task<T> for Forward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(mut self) {
        let axis: [V; 3] = splat(self.axis);
        for (k, angles) in self.turned.angles.chunks(V::LANES).enumerate() {
            let from = k * V::LANES;
            let (sin, cos) = math::sin_cos(V::load_or(angles, T::zero()));
            let pulled = rotate(axis, sin, cos, load(&self.turned.points, from));
            for (column, x) in self.pulled.columns().iter_mut().zip(pulled) {
                x.store(&mut column[from..]);
            }
        }
    }
}

struct Backward<'a, T> {
    axis: [T; 3],
    turned: Turned<'a, T>,
    gradient: Coordinates<'a, T>,
    wanted: Cotangents<'a, T>,
}

impl<T: Float> Task<T> for Backward<'_, T> {
    type Output = [f64; 3];
    #[inline(always)]
    fn run<V: Lanes<T>>(mut self) -> [f64; 3] {
        let (axis, zero, one) = (splat(self.axis), V::splat(T::zero()), V::splat(T::one()));
        let mut sum = [0.0; 3];
        for (k, angles) in self.turned.angles.chunks(V::LANES).enumerate() {
            let from = k * V::LANES;
            let (sin, cos) = math::sin_cos(V::load_or(angles, T::zero()));
            let (x, g) = (load(&self.turned.points, from), load(&self.gradient, from));
            let (rest, swirl) = (one - cos, cross(x, g));
            let (along_x, along_g) = (rest * dot(axis, x), rest * dot(axis, g));
            // Rodrigues by ξ: sin (x × g) + (1 − cos)[(ξ·x) g + (ξ·g) x].
            // Lanes beyond the last point hold zeros and add nothing.
            for (c, sum) in sum.iter_mut().enumerate() {
                let of = sin.mul_add(swirl[c], along_g.mul_add(x[c], along_x * g[c]));
                *sum += of.sum().double();
            }
            if let Some(angles) = &mut self.wanted.angles {
                // d(R x)/dangle = ξ × R x.
                let pulled = rotate(axis, sin, cos, x);
                add(dot(g, cross(axis, pulled)), &mut angles[from..]);
            }
            if let Some(points) = &mut self.wanted.points {
                let back = rotate(axis, zero - sin, cos, g);
                for (column, x) in points.columns().iter_mut().zip(back) {
                    add(x, &mut column[from..]);
                }
            }
        }
        sum
    }
}

#[inline(always)]
fn add<T: Float, V: Lanes<T>>(x: V, to: &mut [T]) {
    (V::load_or(to, T::zero()) + x).store(to);
}
