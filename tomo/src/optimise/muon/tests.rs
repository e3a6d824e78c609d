use super::super::adam::tests::repeats;
use super::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const MUON: Muon = Muon { beta: 0.95, scale: 5.0 };

fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..count).map(|_| random.random_range(-1.0..1.0)).collect()
}

/// Multiplies matrices that are row by row; `inner` columns of the first.
fn product(a: &[f64], b: &[f64], rows: usize, inner: usize) -> Vec<f64> {
    let columns = b.len() / inner;
    let mut out = vec![0.0; rows * columns];
    multiply(a, Shape::by_rows(rows, inner), b, Shape::by_rows(inner, columns), &mut out, false);
    out
}

fn transposed(a: &[f64], rows: usize) -> Vec<f64> {
    let columns = a.len() / rows;
    (0..a.len()).map(|k| a[k % rows * columns + k / rows]).collect()
}

/// An orthogonal matrix, by Gram and Schmidt's rows.
fn rotation(side: usize, seed: u64) -> Vec<f64> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for row in numbers(side * side, seed).chunks(side) {
        let mut row = row.to_vec();
        for _ in 0..2 {
            for other in &rows {
                let dot: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
                row.iter_mut().zip(other).for_each(|(a, b)| *a -= dot * b);
            }
        }
        let norm = row.iter().map(|a| a * a).sum::<f64>().sqrt();
        rows.push(row.into_iter().map(|a| a / norm).collect());
    }
    rows.concat()
}

#[test]
fn exact_singular_values_of_a_diagonal_follow_the_polynomial() {
    let values = [1.0, 0.3, 0.05, 0.01, 0.0];
    let norm = values.iter().map(|s: &f64| s * s).sum::<f64>().sqrt();
    for (rows, columns) in [(5, 5), (5, 7), (7, 5)] {
        let mut x = vec![0.0; rows * columns];
        values.iter().enumerate().for_each(|(k, s)| x[k * columns + k] = *s);
        let found = orthogonal(x, rows, columns);
        for (k, found) in found.iter().enumerate() {
            let (row, column) = (k / columns, k % columns);
            let mut s = if row == column { values[row] / norm } else { 0.0 };
            for _ in 0..Muon::ITERATIONS {
                s = 3.4445 * s - 4.7750 * s.powi(3) + 2.0315 * s.powi(5);
            }
            assert!((found - s).abs() < 1e-12, "{rows}x{columns}, {row}, {column}: {found} {s}");
            assert!(row != column || row == 4 || (0.65..1.25).contains(&s));
        }
    }
    assert!(orthogonal(vec![0.0f32; 6], 2, 3) == [0.0; 6]);
}

#[test]
fn exact_beside_matrices_it_is_adam() {
    let matrices = [
        WeightMatrix { offset: 3, rows: 4, columns: 5 },
        WeightMatrix { offset: 23, rows: 2, columns: 2 },
    ];
    let (mut x, mut y) = (numbers(40, 1), numbers(40, 1));
    let (mut of_x, mut of_y) = (AdamState::new(40), AdamState::new(40));
    for step in 0..20 {
        let gradient = numbers(40, 100 + step);
        MUON.step(0.01, &gradient, &matrices, &mut of_x, &mut x);
        of_y.step(0.01, &gradient, &mut y);
    }
    assert!(x[..3] == y[..3] && x[27..] == y[27..] && x[3..27] != y[3..27]);
}

/// Gradient of ½ tr (X − C)ᵀ A (X − C) B, and its value.
fn quadratic(x: &[f64], c: &[f64], a: &[f64], b: &[f64], side: usize) -> (f64, Vec<f64>) {
    let apart: Vec<f64> = x.iter().zip(c).map(|(x, c)| x - c).collect();
    let gradient = product(&product(a, &apart, side, side), b, side, side);
    (0.5 * apart.iter().zip(&gradient).map(|(x, g)| x * g).sum::<f64>(), gradient)
}

/// A symmetric matrix with eigenvalues of 1 down to `least`.
fn curved(side: usize, least: f64, seed: u64) -> Vec<f64> {
    let q = rotation(side, seed);
    let mut scaled = q.clone();
    for (k, row) in scaled.chunks_mut(side).enumerate() {
        let value = least.powf(k as f64 / (side - 1) as f64);
        row.iter_mut().for_each(|x| *x *= value);
    }
    product(&transposed(&q, side), &scaled, side, side)
}

#[test]
fn exact_curvature_of_kronecker_form_does_not_slow_it_down() {
    let side = 12;
    let (a, b) = (curved(side, 1e-2, 1), curved(side, 1e-2, 2));
    let goal = numbers(side * side, 3);
    let matrix = [WeightMatrix { offset: 0, rows: side, columns: side }];
    let end = |matrices: &[WeightMatrix], rate: f64| {
        let mut x = vec![0.0; side * side];
        let mut state = AdamState::new(side * side);
        let steps = 400;
        for step in 0..steps {
            let (_, gradient) = quadratic(&x, &goal, &a, &b, side);
            let rate = rate * (1.0 - f64::from(step) / f64::from(steps));
            MUON.step(rate, &gradient, matrices, &mut state, &mut x);
        }
        let apart = x.iter().zip(&goal).map(|(x, c)| (x - c).powi(2)).sum::<f64>();
        (apart / goal.iter().map(|c| c * c).sum::<f64>()).sqrt()
    };
    let rates = [0.003, 0.01, 0.03, 0.1];
    let best = |matrices: &[WeightMatrix]| {
        rates.iter().map(|rate| end(matrices, *rate)).fold(f64::INFINITY, f64::min)
    };
    let (muon, adam) = (best(&matrix), best(&[]));
    assert!(muon < 0.3 * adam, "{muon} {adam}");
}

#[test]
fn exact_rotations_of_inputs_and_units_leave_the_path_the_same() {
    let (rows, columns) = (6, 9);
    let (left, right) = (rotation(rows, 1), rotation(columns, 2));
    let turn = |x: &[f64]| product(&product(&left, x, rows, rows), &right, rows, columns);
    let matrix = [WeightMatrix { offset: 0, rows, columns }];
    let mut x = numbers(rows * columns, 3);
    let mut y = turn(&x);
    let (mut of_x, mut of_y) = (AdamState::new(54), AdamState::new(54));
    for step in 0..30 {
        let gradient = numbers(rows * columns, 100 + step);
        MUON.step(0.01, &gradient, &matrix, &mut of_x, &mut x);
        MUON.step(0.01, &turn(&gradient), &matrix, &mut of_y, &mut y);
    }
    let most = turn(&x).iter().zip(&y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    assert!(most < 1e-10, "{most}");
}

#[test]
fn regress_same_bits_on_any_threads_and_after_a_break() {
    let matrices: Vec<WeightMatrix> =
        (0..4).map(|k| WeightMatrix { offset: 5 + 1200 * k, rows: 30, columns: 40 }).collect();
    let count = 5 + 4800 + 7;
    repeats(count, |step, state, x| {
        let gradient: Vec<f32> = numbers(count, step).into_iter().map(|x| x as f32).collect();
        MUON.step(1e-3, &gradient, &matrices, state, x);
    });
}
