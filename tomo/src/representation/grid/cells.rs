//! Trilinear interpolation on lanes of points, and its derivatives.

use super::super::{Activation, Coordinates};
use super::Share;
use super::scatter::{Contribution, NOWHERE};
use crate::Error;
use kerrlight_common::simd::{Float, Lanes, MAX_LANES, Task, math};

/// One axis of the box.
#[derive(Clone, Copy)]
pub struct Axis<T> {
    pub low: T,
    /// Cells a unit of length.
    pub per_length: T,
    pub cells: T,
}

/// The box and its nodes.
#[derive(Clone, Copy)]
pub struct Geometry<T> {
    pub axes: [Axis<T>; 3],
    pub nodes: [usize; 3],
}

/// Checks that a box has finite corners, the second above the first.
pub fn check_box(low: [f64; 3], high: [f64; 3]) -> Result<(), Error> {
    for (low, high) in low.into_iter().zip(high) {
        Error::check("low", low, low.is_finite(), "a finite number")?;
        Error::check("high", high, high.is_finite() && high > low, "above low")?;
    }
    Ok(())
}

/// Places of lanes of points.
pub struct Located<T, V> {
    /// First corner of each lane's cell.
    pub corner: [usize; MAX_LANES],
    /// Position in the cell, 0 to 1 along each axis.
    pub within: [V; 3],
    /// 1 inside the box, 0 outside.
    pub inside: V,
    unit: core::marker::PhantomData<T>,
}

impl<T: Float> Geometry<T> {
    /// Nodes from `low` to `high`, both included.
    pub fn new(nodes: [usize; 3], low: [f64; 3], high: [f64; 3]) -> Self {
        let axis = |k: usize| Axis {
            low: T::of(low[k]),
            per_length: T::of((nodes[k] - 1) as f64 / (high[k] - low[k])),
            cells: T::of((nodes[k] - 1) as f64),
        };
        Self { axes: [axis(0), axis(1), axis(2)], nodes }
    }

    /// Cells of lanes of points.
    #[inline(always)]
    pub fn locate<V: Lanes<T>>(&self, at: &Coordinates<'_, T>, from: usize) -> Located<T, V> {
        let (zero, one) = (V::splat(T::zero()), V::splat(T::one()));
        let (mut corner, mut inside, mut within) = ([0; MAX_LANES], one, [zero; 3]);
        for ((axis, nodes), (column, within)) in
            self.axes.iter().zip(self.nodes).zip(at.columns().iter().zip(&mut within))
        {
            // Lanes behind the last point take the first node: every grid has it.
            let x = V::load_or(&column[from..], axis.low);
            let u = (x - V::splat(axis.low)) * V::splat(axis.per_length);
            inside = V::select(u.lt(zero), zero, inside);
            inside = V::select(V::splat(axis.cells).lt(u), zero, inside);
            // A NaN is neither here nor there: it stays inside and makes the value one.
            let u = V::splat(axis.cells).min(zero.max(u));
            // ⌊u⌋; at a node the tie may go to either cell, whose values are the same there.
            let cell = math::round(u - V::splat(T::of(0.5)));
            let cell = V::splat(axis.cells - T::one()).min(zero.max(cell));
            *within = u - cell;
            let mut cells = [T::zero(); MAX_LANES];
            cell.store(&mut cells);
            for (corner, cell) in corner.iter_mut().zip(cells) {
                *corner = *corner * nodes + (cell.to_usize().unwrap_or(0)).min(nodes - 2);
            }
        }
        Located { corner, within, inside, unit: core::marker::PhantomData }
    }

    /// Numbers at the eight corners, x slowest.
    #[inline(always)]
    pub fn corners<V: Lanes<T>>(&self, parameters: &[T], corner: &[usize; MAX_LANES]) -> [V; 8] {
        let [_, ny, nz] = self.nodes;
        let mut numbers = [[T::zero(); MAX_LANES]; 8];
        for (lane, corner) in corner.iter().enumerate().take(V::LANES) {
            // Neighbours along z lie side by side: four places give all eight corners.
            for (k, start) in [0, nz, ny * nz, (ny + 1) * nz].into_iter().enumerate() {
                let pair = &parameters[corner + start..corner + start + 2];
                numbers[2 * k][lane] = pair[0];
                numbers[2 * k + 1][lane] = pair[1];
            }
        }
        // A loop: a closure of `map` would be compiled without the instruction set.
        let mut corners = [V::splat(T::zero()); 8];
        for (corner, lanes) in corners.iter_mut().zip(&numbers) {
            *corner = V::load_or(lanes, T::zero());
        }
        corners
    }
}

#[inline(always)]
fn between<T: Float, V: Lanes<T>>(from: V, to: V, part: V) -> V {
    part.mul_add(to - from, from)
}

/// The interpolated number and its slopes along x, y and z in cells.
#[inline(always)]
pub fn interpolate<T: Float, V: Lanes<T>>(c: &[V; 8], within: &[V; 3]) -> (V, [V; 3]) {
    let [x, y, z] = *within;
    let mut along_z = [z; 4];
    let mut of_z = [z; 4];
    for k in 0..4 {
        along_z[k] = between(c[2 * k], c[2 * k + 1], z);
        of_z[k] = c[2 * k + 1] - c[2 * k];
    }
    let along_y = [between(along_z[0], along_z[1], y), between(along_z[2], along_z[3], y)];
    let value = between(along_y[0], along_y[1], x);
    let of_x = along_y[1] - along_y[0];
    let of_y = between(along_z[1] - along_z[0], along_z[3] - along_z[2], x);
    let of_z = between(between(of_z[0], of_z[1], y), between(of_z[2], of_z[3], y), x);
    (value, [of_x, of_y, of_z])
}

/// Emission at points.
pub(super) struct Values<'a, T> {
    pub geometry: Geometry<T>,
    pub activation: Activation,
    pub parameters: &'a [T],
    pub at: Coordinates<'a, T>,
    pub values: &'a mut [T],
}

impl<T: Float> Task<T> for Values<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        for (k, values) in self.values.chunks_mut(V::LANES).enumerate() {
            let located = self.geometry.locate::<V>(&self.at, k * V::LANES);
            let corners = self.geometry.corners::<V>(self.parameters, &located.corner);
            let (number, _) = interpolate(&corners, &located.within);
            let (value, _) = self.activation.apply::<T, V>(number);
            keep_inside(located.inside, value).store(values);
        }
    }
}

/// Zero outside.
#[inline(always)]
pub fn keep_inside<T: Float, V: Lanes<T>>(inside: V, value: V) -> V {
    let zero = V::splat(T::zero());
    V::select(zero.lt(inside), value, zero)
}

/// Products that each point adds to the nodes of its cell for a cotangent of one, and the others
/// that are wanted.
pub(super) struct Products<'a, T> {
    pub geometry: Geometry<T>,
    pub activation: Activation,
    pub share: Share<'a, T>,
}

impl<T: Float> Task<T> for Products<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let Share { parameters, at, contributions, mut values, mut coordinates } = self.share;
        for (k, contributions) in contributions.chunks_mut(V::LANES).enumerate() {
            let from = k * V::LANES;
            let located = self.geometry.locate::<V>(&at, from);
            let corners = self.geometry.corners::<V>(parameters, &located.corner);
            let (number, slopes) = interpolate(&corners, &located.within);
            let (value, slope) = self.activation.apply::<T, V>(number);
            if let Some(values) = &mut values {
                keep_inside(located.inside, value).store(&mut values[from..]);
            }
            // Without the cotangent, which may be known only once all points of a ray have values.
            let weight = keep_inside(located.inside, slope);
            if let Some((coordinates, cotangents)) = &mut coordinates {
                let weight = weight * V::load_or(&cotangents[from..], T::zero());
                let columns = coordinates.columns().iter_mut().zip(self.geometry.axes);
                for ((column, axis), slope) in columns.zip(slopes) {
                    let out = &mut column[from..];
                    let sum = V::load_or(out, T::zero());
                    (weight * V::splat(axis.per_length)).mul_add(slope, sum).store(out);
                }
            }
            located.contribute(weight, contributions);
        }
    }
}

impl<T: Float, V: Lanes<T>> Located<T, V> {
    /// Writes the contributions of lanes to their nodes.
    #[inline(always)]
    pub fn contribute(&self, weight: V, contributions: &mut [Contribution<T>]) {
        let mut lanes = [[T::zero(); MAX_LANES]; 4];
        let [x, y, z] = self.within;
        for (lanes, v) in lanes.iter_mut().zip([x, y, z, weight]) {
            v.store(lanes);
        }
        for (lane, contribution) in contributions.iter_mut().enumerate() {
            // A u32 holds the corner: grids have at most 2³⁰ nodes.
            let (corner, weight) = (self.corner[lane] as u32, lanes[3][lane]);
            // Points that add nothing are left out of the sort; a NaN is not.
            let corner = if weight == T::zero() { NOWHERE } else { corner };
            let within = [lanes[0][lane], lanes[1][lane], lanes[2][lane]];
            *contribution = Contribution { corner, within, weight };
        }
    }
}
