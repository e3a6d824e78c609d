//! Features, the network and its derivatives on lanes of points.

use super::super::grid::cells::{Geometry, Located, interpolate, keep_inside};
use super::super::grid::scatter::Contribution;
use super::super::{Activation, Coordinates};
use super::layout::{FEATURES, Layout, MAX_INPUTS, WIDTH};
use kerrlight_common::simd::{Float, Lanes, MAX_LANES, Task};

/// Weights and biases of the network.
struct Network<'a, T> {
    first: &'a [T],
    first_biases: &'a [T],
    second: &'a [T],
    second_biases: &'a [T],
    last: &'a [T],
    last_bias: T,
}

impl<'a, T: Float> Network<'a, T> {
    #[inline(always)]
    fn of(layout: &Layout, parameters: &'a [T]) -> Self {
        let all = &parameters[layout.network_start()..];
        let [first, second, last] = layout.kernels();
        Self {
            first_biases: &all[first.end..first.end + WIDTH],
            first: &all[first],
            second_biases: &all[second.end..second.end + WIDTH],
            second: &all[second],
            last_bias: all[last.end],
            last: &all[last],
        }
    }

    /// Rectified units of a layer.
    #[inline(always)]
    fn layer<V: Lanes<T>>(weights: &[T], biases: &[T], inputs: &[V]) -> [V; WIDTH] {
        // Loops, not `map`: what the compiler leaves of a closure lacks the instruction set.
        let mut units = [V::splat(T::zero()); WIDTH];
        for (unit, bias) in units.iter_mut().zip(biases) {
            *unit = V::splat(*bias);
        }
        for (input, row) in inputs.iter().zip(weights.chunks_exact(WIDTH)) {
            for (unit, weight) in units.iter_mut().zip(row) {
                *unit = V::splat(*weight).mul_add(*input, *unit);
            }
        }
        for unit in &mut units {
            *unit = V::splat(T::zero()).max(*unit); // in this order a NaN stays one
        }
        units
    }

    #[inline(always)]
    fn forward<V: Lanes<T>>(&self, inputs: &[V]) -> Units<V> {
        let first = Self::layer(self.first, self.first_biases, inputs);
        let second = Self::layer(self.second, self.second_biases, &first);
        let mut output = V::splat(self.last_bias);
        for (unit, weight) in second.iter().zip(self.last) {
            output = V::splat(*weight).mul_add(*unit, output);
        }
        Units { first, second, output }
    }
}

/// Units of the network on features.
struct Units<V> {
    first: [V; WIDTH],
    second: [V; WIDTH],
    output: V,
}

/// Gradients of the network, lane by lane.
struct Sums<V> {
    first: [[V; WIDTH]; MAX_INPUTS],
    first_biases: [V; WIDTH],
    second: [[V; WIDTH]; WIDTH],
    second_biases: [V; WIDTH],
    last: [V; WIDTH],
    last_bias: V,
}

impl<V: Copy> Sums<V> {
    #[inline(always)]
    fn new(zero: V) -> Self {
        Self {
            first: [[zero; WIDTH]; MAX_INPUTS],
            first_biases: [zero; WIDTH],
            second: [[zero; WIDTH]; WIDTH],
            second_biases: [zero; WIDTH],
            last: [zero; WIDTH],
            last_bias: zero,
        }
    }

    /// Overwrites parameters in their order with the sums over lanes.
    #[inline(always)]
    fn store<T: Float>(&self, inputs: usize, out: &mut [T])
    where
        V: Lanes<T>,
    {
        let first = self.first[..inputs].iter().flatten().chain(&self.first_biases);
        let second = self.second.iter().flatten().chain(&self.second_biases);
        let all = first.chain(second).chain(&self.last).chain([&self.last_bias]);
        for (out, lanes) in out.iter_mut().zip(all) {
            *out = lanes.sum();
        }
    }

    /// Adds a gradient of the output; returns that of the inputs.
    #[inline(always)]
    fn backward<T: Float>(
        &mut self,
        network: &Network<'_, T>,
        inputs: &[V],
        [first_units, second_units]: &[[V; WIDTH]; 2],
        slope: V,
    ) -> [V; MAX_INPUTS]
    where
        V: Lanes<T>,
    {
        let zero = V::splat(T::zero());
        self.last_bias = self.last_bias + slope;
        let mut second = [zero; WIDTH];
        let weights = network.last.iter().zip(&mut self.last);
        let units_and_slopes = second_units.iter().zip(&mut second);
        for ((weight, sum), (unit, out)) in weights.zip(units_and_slopes) {
            *sum = unit.mul_add(slope, *sum);
            *out = V::select(zero.lt(*unit), V::splat(*weight) * slope, zero);
        }
        for (sum, slope) in self.second_biases.iter_mut().zip(second) {
            *sum = *sum + slope;
        }
        let mut first = [zero; WIDTH];
        let rows = network.second.chunks_exact(WIDTH).zip(&mut self.second);
        for ((weights, sums), (unit, out)) in rows.zip(first_units.iter().zip(&mut first)) {
            let of_unit = row(weights, sums, *unit, &second);
            *out = V::select(zero.lt(*unit), of_unit, zero);
        }
        for (sum, slope) in self.first_biases.iter_mut().zip(first) {
            *sum = *sum + slope;
        }
        let mut slopes = [zero; MAX_INPUTS];
        let rows = network.first.chunks_exact(WIDTH).zip(&mut self.first);
        for ((weights, sums), (input, out)) in rows.zip(inputs.iter().zip(&mut slopes)) {
            *out = row(weights, sums, *input, &first);
        }
        slopes
    }
}

/// One input of a layer: adds its part to the gradients of its weights, returns its own.
#[inline(always)]
fn row<T: Float, V: Lanes<T>>(
    weights: &[T],
    sums: &mut [V; WIDTH],
    input: V,
    slopes: &[V; WIDTH],
) -> V {
    let mut own = V::splat(T::zero());
    for ((weight, sum), slope) in weights.iter().zip(sums).zip(slopes) {
        *sum = input.mul_add(*slope, *sum);
        own = V::splat(*weight).mul_add(*slope, own);
    }
    own
}

/// Features of lanes of points, and whether they are inside.
#[inline(always)]
fn features<T: Float, V: Lanes<T>>(
    layout: &Layout,
    geometries: &[Geometry<T>],
    parameters: &[T],
    at: &Coordinates<'_, T>,
    from: usize,
) -> ([V; MAX_INPUTS], V) {
    let mut inputs = [V::splat(T::zero()); MAX_INPUTS];
    let mut inside = V::splat(T::one());
    for (level, geometry) in geometries.iter().enumerate() {
        let located: Located<T, V> = geometry.locate(at, from);
        for feature in 0..FEATURES {
            let plane = &parameters[layout.plane(level, feature)];
            let corners = geometry.corners::<V>(plane, &located.corner);
            inputs[level * FEATURES + feature] = interpolate(&corners, &located.within).0;
        }
        // All grids share the box: any of them tells.
        inside = located.inside;
    }
    (inputs, inside)
}

/// Emission at points, and what its derivatives need.
pub struct Forward<'a, T> {
    pub layout: &'a Layout,
    pub geometries: &'a [Geometry<T>],
    pub activation: Activation,
    pub parameters: &'a [T],
    pub at: Coordinates<'a, T>,
    pub values: &'a mut [T],
    /// Features, units and the activation's slope, [`Layout::kept`] lanes one after the other, if wanted.
    pub kept: Option<&'a mut [T]>,
}

impl<T: Float> Task<T> for Forward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(mut self) {
        let network = Network::of(self.layout, self.parameters);
        let (layout, geometries, parameters) = (self.layout, self.geometries, self.parameters);
        let count = layout.inputs();
        for (k, values) in self.values.chunks_mut(V::LANES).enumerate() {
            let from = k * V::LANES;
            let (inputs, inside) = features::<T, V>(layout, geometries, parameters, &self.at, from);
            let inputs = &inputs[..count];
            let units = network.forward(inputs);
            let (value, slope) = self.activation.apply::<T, V>(units.output);
            keep_inside(inside, value).store(values);
            if let Some(kept) = &mut self.kept {
                let kept = kept[from * self.layout.kept()..].chunks_exact_mut(V::LANES);
                let slope = keep_inside(inside, slope);
                let all = inputs.iter().chain(&units.first).chain(&units.second).chain([&slope]);
                for (kept, lanes) in kept.zip(all) {
                    lanes.store(kept);
                }
            }
        }
    }
}

/// Gradients of features, of the network and, if wanted, of points.
pub struct Backward<'a, T> {
    pub layout: &'a Layout,
    pub geometries: &'a [Geometry<T>],
    pub parameters: &'a [T],
    pub at: Coordinates<'a, T>,
    pub cotangents: &'a [T],
    /// Values as [`Forward`] has left them.
    pub kept: &'a [T],
    /// dL/dfeature, all features of a point side by side.
    pub slopes: &'a mut [T],
    /// Gradient of the network, overwritten.
    pub network: &'a mut [T],
    /// dL/dx of each point, if wanted.
    pub pulls: Option<&'a mut [[T; 3]]>,
}

impl<T: Float> Task<T> for Backward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(mut self) {
        let network = Network::of(self.layout, self.parameters);
        let (layout, geometries, parameters) = (self.layout, self.geometries, self.parameters);
        let count = layout.inputs();
        let zero = V::splat(T::zero());
        let mut sums = Sums::new(zero);
        for (k, out) in self.slopes.chunks_mut(V::LANES * count).enumerate() {
            let from = k * V::LANES;
            let mut kept = self.kept[from * self.layout.kept()..].chunks_exact(V::LANES);
            let mut inputs = [zero; MAX_INPUTS];
            let mut units = [[zero; WIDTH]; 2];
            let mut slope = zero;
            let all =
                inputs[..count].iter_mut().chain(units.as_flattened_mut()).chain([&mut slope]);
            for (lanes, kept) in all.zip(&mut kept) {
                *lanes = V::load_or(kept, T::zero());
            }
            // Lanes behind the last point have the cotangent 0 and add nothing to the sums.
            let slope = V::load_or(&self.cotangents[from..], T::zero()) * slope;
            let slopes = sums.backward(&network, &inputs[..count], &units, slope);
            let mut lanes = [T::zero(); MAX_LANES];
            for (input, slopes) in slopes.iter().take(count).enumerate() {
                slopes.store(&mut lanes);
                let out = out.iter_mut().skip(input).step_by(count);
                out.zip(&lanes).for_each(|(out, lane)| *out = *lane);
            }
            if let Some(pulls) = &mut self.pulls {
                let pulls = &mut pulls[from..];
                pull::<T, V>(layout, geometries, parameters, &self.at, from, &slopes, pulls);
            }
        }
        sums.store(count, self.network);
    }
}

/// dL/dx of lanes of points.
#[inline(always)]
fn pull<T: Float, V: Lanes<T>>(
    layout: &Layout,
    geometries: &[Geometry<T>],
    parameters: &[T],
    at: &Coordinates<'_, T>,
    from: usize,
    slopes: &[V; MAX_INPUTS],
    out: &mut [[T; 3]],
) {
    let mut sum = [V::splat(T::zero()); 3];
    for (level, geometry) in geometries.iter().enumerate() {
        let located: Located<T, V> = geometry.locate(at, from);
        for feature in 0..FEATURES {
            let plane = &parameters[layout.plane(level, feature)];
            let corners = geometry.corners::<V>(plane, &located.corner);
            let (_, along) = interpolate(&corners, &located.within);
            for (k, sum) in sum.iter_mut().enumerate() {
                let weight =
                    slopes[level * FEATURES + feature] * V::splat(geometry.axes[k].per_length);
                *sum = weight.mul_add(along[k], *sum);
            }
        }
    }
    let mut lanes = [[T::zero(); MAX_LANES]; 3];
    for (lanes, sum) in lanes.iter_mut().zip(sum) {
        sum.store(lanes);
    }
    for (lane, out) in out.iter_mut().take(V::LANES).enumerate() {
        *out = [lanes[0][lane], lanes[1][lane], lanes[2][lane]];
    }
}

/// Cells of points in one grid.
pub struct Corners<'a, T> {
    pub geometry: &'a Geometry<T>,
    pub at: Coordinates<'a, T>,
    pub contributions: &'a mut [Contribution<T>],
}

impl<T: Float> Task<T> for Corners<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        for (k, contributions) in self.contributions.chunks_mut(V::LANES).enumerate() {
            let located: Located<T, V> = self.geometry.locate(&self.at, k * V::LANES);
            located.contribute(keep_inside(located.inside, V::splat(T::one())), contributions);
        }
    }
}
