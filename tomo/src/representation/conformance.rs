//! Tests that every representation must pass; a new one is tested by one line.
//!
//! ```
//! use kerrlight_tomo::representation::conformance::{Subject, check};
//! use kerrlight_tomo::representation::{Activation, Grid, GridSettings};
//!
//! let (low, high) = ([-1.0; 3], [1.0; 3]);
//! let activation = Activation::Linear;
//! let grid = Grid::new(GridSettings { nodes: [2, 2, 2], low, high, activation, initial: 0.0 })?;
//! // Two nodes along each axis: a product of (1 ± x)/2, of each parameter.
//! let tangent = |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| {
//!     let mut sum = (0.0, 0.0);
//!     for node in 0..8usize {
//!         let sign = [4, 2, 1].map(|bit| if node & bit == 0 { -1.0 } else { 1.0 });
//!         let w: [f64; 3] = core::array::from_fn(|k| 0.5 * (1.0 + sign[k] * at[k]));
//!         let dw: [f64; 3] = core::array::from_fn(|k| 0.5 * sign[k] * dat[k]);
//!         let product = w[0] * w[1] * w[2];
//!         let change = dw[0] * w[1] * w[2] + w[0] * dw[1] * w[2] + w[0] * w[1] * dw[2];
//!         sum = (sum.0 + p[node] * product, sum.1 + dp[node] * product + p[node] * change);
//!     }
//!     sum
//! };
//! check(&Subject { representation: &grid, within: 0.9, parameter_noise: 1.0, tangent: &tangent });
//! # Ok::<(), kerrlight_tomo::Error>(())
//! ```

use super::{Coordinates, CoordinatesMut, Gradient, Groups, Representation, Workspace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Value at one point and its derivative along a direction: (parameters, their direction, point,
/// its direction). Written plainly and independently of the representation.
pub type Tangent<'a> = dyn Fn(&[f64], &[f64], &[f64], &[f64]) -> (f64, f64) + Sync + 'a;

/// Representation that is tested, with its points.
pub struct Subject<'a> {
    /// The representation in double precision.
    pub representation: &'a dyn Representation<f64>,
    /// Points are drawn from −within to within along each axis.
    pub within: f64,
    /// Uniform noise of ± this much is added to the initial parameters.
    pub parameter_noise: f64,
    /// The same function, written plainly.
    pub tangent: &'a Tangent<'a>,
}

/// Points in a column each, parameters and cotangents, drawn at random.
struct Draw {
    parameters: Vec<f64>,
    columns: Vec<Vec<f64>>,
    cotangents: Vec<f64>,
}

/// A gradient: of parameters, and of coordinates column by column.
struct Product {
    parameters: Vec<f64>,
    coordinates: Vec<Vec<f64>>,
}

/// Relative to the largest component, what a central difference in f64 resolves.
const DIFFERENCE: f64 = 1e-7;
/// Largest difference of sums in another order, relative to the sum of sizes.
const ROUNDING: f64 = 1e-12;

/// Checks all that the interface promises.
///
/// # Panics
/// If a promise is broken, with the numbers.
pub fn check(subject: &Subject<'_>) {
    plain_values_and_adjoint(subject);
    central_differences(subject);
    overwrites_and_accumulates(subject);
    batches_and_order(subject);
    threads(subject);
    linked(subject);
    recorded(subject);
    nothing_at_all(subject);
    extreme_coordinates(subject);
    projection(subject);
}

impl Subject<'_> {
    fn draw(&self, points: usize, seed: u64) -> Draw {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut parameters = vec![f64::NAN; self.representation.parameters()];
        self.representation.initialise(seed, &mut parameters);
        let noise = self.parameter_noise;
        parameters.iter_mut().for_each(|x| *x += random.random_range(-noise..=noise));
        self.representation.project(&mut parameters);
        let mut column = |limit: f64| -> Vec<f64> {
            (0..points).map(|_| random.random_range(-limit..=limit)).collect()
        };
        let columns = (0..self.representation.dimension()).map(|_| column(self.within)).collect();
        Draw { parameters, columns, cotangents: column(1.0) }
    }

    fn eval(&self, parameters: &[f64], columns: &[Vec<f64>]) -> Vec<f64> {
        let at = coordinates(columns);
        let mut values = vec![f64::NAN; at.len()];
        self.representation.eval(parameters, at, &mut values, &mut Workspace::new());
        assert!(values.iter().all(|value| value.is_finite()), "a value is not finite");
        values
    }

    fn vjp(&self, draw: &Draw) -> Product {
        let mut product = draw.zeros();
        self.add_vjp(draw, &mut product);
        product
    }

    fn add_vjp(&self, draw: &Draw, product: &mut Product) {
        let (parameters, at) = (&draw.parameters, coordinates(&draw.columns));
        let gradient = product.gradient();
        let mut workspace = Workspace::new();
        self.representation.vjp(parameters, at, &draw.cotangents, gradient, &mut workspace);
    }
}

impl Draw {
    fn zeros(&self) -> Product {
        let coordinates = self.columns.iter().map(|column| vec![0.0; column.len()]).collect();
        Product { parameters: vec![0.0; self.parameters.len()], coordinates }
    }

    fn point(&self, k: usize) -> Vec<f64> {
        self.columns.iter().map(|column| column[k]).collect()
    }

    /// The points `indices`, in that order.
    fn pick(&self, indices: &[usize]) -> Draw {
        let of = |all: &Vec<f64>| indices.iter().map(|k| all[*k]).collect();
        let columns = self.columns.iter().map(of).collect();
        let cotangents = of(&self.cotangents);
        Draw { parameters: self.parameters.clone(), columns, cotangents }
    }
}

impl Product {
    fn gradient(&mut self) -> Gradient<'_, f64> {
        let coordinates = match self.coordinates.as_mut_slice() {
            [x, y, z] => CoordinatesMut::xyz(x, y, z),
            [t, x, y, z] => CoordinatesMut::txyz(t, x, y, z),
            other => panic!("{} dimensions", other.len()),
        };
        Gradient { parameters: &mut self.parameters, coordinates: Some(coordinates) }
    }
}

fn coordinates(columns: &[Vec<f64>]) -> Coordinates<'_, f64> {
    match columns {
        [x, y, z] => Coordinates::xyz(x, y, z),
        [t, x, y, z] => Coordinates::txyz(t, x, y, z),
        other => panic!("{} dimensions", other.len()),
    }
}

fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |largest, x| x.abs().max(largest))
}

fn same(a: &[f64], b: &[f64], what: &str) {
    let equal = a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    assert!(a.len() == b.len() && equal, "{what} differ");
}

fn close(a: &[f64], b: &[f64], what: &str) {
    let scale = largest(a).max(largest(b));
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= ROUNDING * scale, "{what}: {a:e} and {b:e} of {scale:e}");
    }
}

/// Values against the plain function, and ⟨J v, w⟩ = ⟨v, Jᵀ w⟩ with its directional derivative.
fn plain_values_and_adjoint(subject: &Subject<'_>) {
    let draw = subject.draw(40, 1);
    let direction = subject.draw(40, 2);
    let values = subject.eval(&draw.parameters, &draw.columns);
    let product = subject.vjp(&draw);
    let (mut left, mut size) = (0.0, 0.0);
    let mut plain = Vec::new();
    for (k, cotangent) in draw.cotangents.iter().enumerate() {
        let (point, change) = (draw.point(k), direction.point(k));
        let (parameters, changes) = (&draw.parameters, &direction.parameters);
        let (value, derivative) = (subject.tangent)(parameters, changes, &point, &change);
        plain.push(value);
        left += cotangent * derivative;
        size += (cotangent * derivative).abs();
    }
    close(&values, &plain, "values and the plain function");
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let columns = product.coordinates.iter().zip(&direction.columns);
    let right = dot(&product.parameters, &direction.parameters)
        + columns.map(|(a, b)| dot(a, b)).sum::<f64>();
    assert!((left - right).abs() <= ROUNDING * size, "adjoint: {left:e} {right:e} of {size:e}");
}

/// Differences across a kink (of a ReLU, of a cell) mean nothing: one in ten may be off, and by what
/// one kink can do.
fn agree(differences: &[(f64, f64)], scale: f64, what: &str) {
    let errors = differences.iter().map(|(a, b)| (a - b).abs() / scale);
    let bad = errors.clone().filter(|error| *error > DIFFERENCE || error.is_nan()).count();
    let worst = errors.fold(0.0, f64::max);
    let all = differences.len();
    assert!(10 * bad <= all, "{what}: {bad} of {all} differences off, by up to {worst:e}");
}

fn central_differences(subject: &Subject<'_>) {
    let (draw, step) = (subject.draw(12, 3), 1e-6);
    let product = subject.vjp(&draw);
    let total = |parameters: &[f64]| {
        let values = subject.eval(parameters, &draw.columns);
        values.iter().zip(&draw.cotangents).map(|(a, b)| a * b).sum::<f64>()
    };
    // Of the parameters that matter here, a hundred spread evenly (a grid's are mostly elsewhere).
    let of = |k: &usize| product.parameters[*k] != 0.0;
    let matter: Vec<usize> = (0..draw.parameters.len()).filter(of).collect();
    let every = (matter.len() / 100).max(1);
    let mut pairs = Vec::new();
    for k in matter.into_iter().step_by(every) {
        let at = |shift: f64| {
            let mut parameters = draw.parameters.clone();
            parameters[k] += shift;
            total(&parameters)
        };
        pairs.push(((at(step) - at(-step)) / (2.0 * step), product.parameters[k]));
    }
    agree(&pairs, largest(&product.parameters), "parameters");
    for (d, column) in product.coordinates.iter().enumerate() {
        let at = |shift: f64| {
            let mut columns = draw.columns.clone();
            columns[d].iter_mut().for_each(|x| *x += shift);
            subject.eval(&draw.parameters, &columns)
        };
        let (up, down) = (at(step), at(-step));
        let pairs: Vec<_> = (0..column.len())
            .map(|k| (draw.cotangents[k] * (up[k] - down[k]) / (2.0 * step), column[k]))
            .collect();
        agree(&pairs, largest(column), "coordinates");
    }
}

fn overwrites_and_accumulates(subject: &Subject<'_>) {
    // `eval` above starts from NaN; the gradient adds to what is there.
    let draw = subject.draw(200, 4);
    let once = subject.vjp(&draw);
    let mut thrice = subject.vjp(&draw);
    subject.add_vjp(&draw, &mut thrice);
    subject.add_vjp(&draw, &mut thrice);
    let triple = |x: &Vec<f64>| x.iter().map(|x| 3.0 * x).collect::<Vec<_>>();
    close(&triple(&once.parameters), &thrice.parameters, "three times the gradient");
    for (one, three) in once.coordinates.iter().zip(&thrice.coordinates) {
        close(&triple(one), three, "three times the gradient of coordinates");
    }
}

/// A point's own numbers do not depend on its batch, to the last bit; sums over points only by
/// rounding.
fn batches_and_order(subject: &Subject<'_>) {
    let draw = subject.draw(401, 5);
    let values = subject.eval(&draw.parameters, &draw.columns);
    let product = subject.vjp(&draw);
    let backward: Vec<usize> = (0..401).rev().collect();
    let mut sums = vec![0.0; draw.parameters.len()];
    for part in [&backward[..13], &backward[13..14], &backward[14..]] {
        let some = draw.pick(part);
        let picked = |all: &[f64]| part.iter().map(|k| all[*k]).collect::<Vec<_>>();
        same(&subject.eval(&some.parameters, &some.columns), &picked(&values), "values");
        let of_part = subject.vjp(&some);
        sums.iter_mut().zip(&of_part.parameters).for_each(|(sum, x)| *sum += x);
        for (part, all) in of_part.coordinates.iter().zip(&product.coordinates) {
            same(part, &picked(all), "gradients of coordinates");
        }
    }
    close(&sums, &product.parameters, "the gradient in parts");
}

fn threads(subject: &Subject<'_>) {
    let draw = subject.draw(8_011, 6);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let run = || (subject.eval(&draw.parameters, &draw.columns), subject.vjp(&draw));
        pool.unwrap_or_else(|error| panic!("{error}")).install(run)
    };
    let (values, product) = on(1);
    for threads in [2, 3, 8] {
        let (again, product_again) = on(threads);
        same(&values, &again, "values on other threads");
        same(&product.parameters, &product_again.parameters, "gradients on other threads");
        for (a, b) in product.coordinates.iter().zip(&product_again.coordinates) {
            same(a, b, "gradients of coordinates on other threads");
        }
    }
}

/// Both at once are the same as one after the other, with the gradient of coordinates and without.
fn linked(subject: &Subject<'_>) {
    let draw = subject.draw(5_000, 7);
    let starts: Vec<usize> = (0..).map(|k| 31 * k + k % 3).take_while(|p| *p < 5000).collect();
    // The last group is empty, as that of a ray that misses the region.
    let starts = [starts, vec![5000, 5000]].concat();
    let link = |groups: core::ops::Range<usize>, values: &[f64], cotangents: &mut [f64]| {
        assert!(starts[groups.end] - starts[groups.start] == values.len());
        cotangents.iter_mut().zip(values).for_each(|(c, v)| *c = v + 1.0);
    };
    let groups = Groups { starts: &starts, link: &link };
    let values = subject.eval(&draw.parameters, &draw.columns);
    let cotangents = values.iter().map(|v| v + 1.0).collect();
    let Draw { parameters, columns, .. } = draw;
    let draw = Draw { parameters, columns, cotangents };
    let expected = subject.vjp(&draw);
    for wanted in [true, false] {
        let (mut product, mut again) = (draw.zeros(), vec![f64::NAN; 5000]);
        let (at, workspace) = (coordinates(&draw.columns), &mut Workspace::new());
        let mut gradient = product.gradient();
        gradient.coordinates = gradient.coordinates.filter(|_| wanted);
        let (parameters, out) = (&draw.parameters, &mut again);
        subject.representation.eval_vjp(parameters, at, groups, out, gradient, workspace);
        same(&again, &values, "values");
        close(&product.parameters, &expected.parameters, "the gradient of both at once");
        for (a, b) in product.coordinates.iter().zip(&expected.coordinates).filter(|_| wanted) {
            same(a, b, "gradients of coordinates of both at once");
        }
    }
}

/// Recording on the way forward changes no bit on the way back, and nothing if other points came in between.
fn recorded(subject: &Subject<'_>) {
    let workspace = &mut Workspace::new();
    for (seed, count) in [(11, 3_000), (12, 3_000), (13, 40)] {
        let draw = subject.draw(count, seed);
        let Draw { parameters, columns, cotangents } = &draw;
        let expected = subject.vjp(&draw);
        let mut values = vec![f64::NAN; count];
        let representation = subject.representation;
        representation.eval_recorded(parameters, coordinates(columns), &mut values, workspace);
        same(&values, &subject.eval(parameters, columns), "recorded values");
        // The second time without anything recorded.
        for _ in 0..2 {
            let (mut product, at) = (draw.zeros(), coordinates(columns));
            let into = product.gradient();
            representation.vjp_recorded(parameters, at, cotangents, into, workspace);
            same(&product.parameters, &expected.parameters, "the recorded gradient");
            for (a, b) in product.coordinates.iter().zip(&expected.coordinates) {
                same(a, b, "recorded gradients of coordinates");
            }
        }
    }
}

fn nothing_at_all(subject: &Subject<'_>) {
    let draw = subject.draw(0, 8);
    assert!(subject.eval(&draw.parameters, &draw.columns).is_empty());
    assert!(subject.vjp(&draw).parameters.iter().all(|x| *x == 0.0));
}

fn extreme_coordinates(subject: &Subject<'_>) {
    let sizes = [0.0, -0.0, 1e-300, -1e-30, 5.0, -10.0, 1e3, -1e6, 1e9, -1e12];
    let dimension = subject.representation.dimension();
    let mut draw = subject.draw(sizes.len() * dimension, 9);
    for (d, column) in draw.columns.iter_mut().enumerate() {
        column[d * sizes.len()..(d + 1) * sizes.len()].copy_from_slice(&sizes);
    }
    subject.eval(&draw.parameters, &draw.columns);
    let product = subject.vjp(&draw);
    assert!(largest(&product.parameters).is_finite());
    let finite = |column: &Vec<f64>| column.iter().all(|x| x.is_finite());
    assert!(finite(&product.parameters) && product.coordinates.iter().all(finite));
}

fn projection(subject: &Subject<'_>) {
    let mut start = vec![0.0; subject.representation.parameters()];
    subject.representation.initialise(10, &mut start);
    let mut projected = start.clone();
    subject.representation.project(&mut projected);
    same(&start, &projected, "initial parameters and the allowed ones");
    start.iter_mut().enumerate().for_each(|(k, x)| *x -= (k % 7) as f64);
    subject.representation.project(&mut start);
    projected.clone_from(&start);
    subject.representation.project(&mut projected);
    same(&start, &projected, "allowed parameters");
}
