use super::*;
use crate::fit::linear::tests::normal;
use crate::fit::tests::{dot, moved};
use crate::representation::Degree;

fn law(roughness: Roughness, correlation_length: f64) -> Matern {
    Matern { mean: 0.4, amplitude: 0.3, correlation_length, roughness }
}

/// Covariances of a node with all nodes, from the waves.
fn covariances(field: &GaussianField, node: [usize; 3]) -> Vec<f64> {
    let [nx, ny, nz] = field.shape.nodes;
    let wave = |n: usize, k: usize, j: usize| {
        let norm = if k == 0 { 1.0 } else { 2.0 } / n as f64;
        norm.sqrt() * (core::f64::consts::PI * k as f64 * (j as f64 + 0.5) / n as f64).cos()
    };
    let at = |k: usize| [k / (ny * nz), k / nz % ny, k % nz];
    let value = |k: usize| -> f64 {
        let along = [nx, ny, nz].into_iter().zip(at(k)).zip(node);
        along.map(|((n, k), j)| wave(n, k, j)).product()
    };
    let all = field.amplitudes.iter().enumerate().map(|(k, a)| a * a * value(k));
    let all = Modes::new(field.shape).sum(&all.collect::<Vec<f64>>());
    let here = field.spread[(node[0] * ny + node[1]) * nz + node[2]];
    all.iter().zip(&field.spread).map(|(x, spread)| x * here * spread).collect()
}

/// Largest error of the covariance with the middle of the grid, in several directions and far from the edges, in units of
/// the variance.
fn worst(roughness: Roughness, nodes: usize) -> f64 {
    let law = law(roughness, 1.5);
    let field = GaussianField::new(law, &Voxels::cube(nodes, 6.0, Degree::Linear)).unwrap();
    let middle = nodes / 2;
    let all = covariances(&field, [middle; 3]);
    let off = |steps: [usize; 3], far: usize| {
        let [x, y, z] = steps.map(|step| middle + step * far);
        let squares = steps.iter().map(|step| (step * far * step * far) as f64);
        let distance = squares.sum::<f64>().sqrt() * field.shape.spacing[0];
        let found = all[(x * nodes + y) * nodes + z];
        let expected = roughness.correlation(distance / law.correlation_length);
        (found / law.amplitude.powi(2) - expected).abs()
    };
    let ways = [[1, 0, 0], [0, 1, 1], [1, 1, 1], [2, 0, 1]];
    let all = ways.iter().flat_map(|steps| (1..=nodes / 8).map(|far| off(*steps, far)));
    all.fold(0.0, f64::max)
}

/// Covariances approach Matérn's as nodes come closer, 3 and then 6 a correlation length: with a rough field, of which a grid
/// leaves out what is finer than its cells, in proportion to the distance of the nodes, with a smooth one to its square.
#[test]
fn exact_covariances_approach_materns() {
    for (roughness, most, ratio) in
        [(Roughness::Half, 0.23, 0.6), (Roughness::FiveHalves, 0.08, 0.35)]
    {
        let [coarse, fine] = [25, 49].map(|nodes| worst(roughness, nodes));
        assert!(coarse < most && fine < ratio * coarse, "{roughness:?} {coarse} {fine}");
    }
}

/// The mean over a cell of the variance between the nodes is the square of the amplitude, in the middle and, for what
/// depends on the edges, at all nodes.
#[test]
fn exact_amplitudes_are_those_between_the_nodes() {
    const N: usize = 16;
    for degree in [Degree::Linear, Degree::Cubic] {
        let law = law(Roughness::Half, 2.0);
        let field = GaussianField::new(law, &Voxels::cube(N, 8.0, degree)).unwrap();
        let taps = degree.taps();
        let first = N / 2 - 1;
        let node = |k: usize| [k / taps / taps, k / taps % taps, k % taps].map(|k| first + k);
        let columns: Vec<Vec<f64>> =
            (0..taps.pow(3)).map(|k| covariances(&field, node(k))).collect();
        let (mut sum, mut count) = (0.0, 0.0);
        let place = |k: usize| (k as f64 + 0.5) / 6.0;
        for within in (0..216).map(|k| [k / 36, k / 6 % 6, k % 6].map(place)) {
            let shares = within.map(|t| degree.weights(t));
            let share = |k: usize| {
                let at = [k / taps / taps, k / taps % taps, k % taps];
                (0..3).map(|c| shares[c][at[c]]).product::<f64>()
            };
            for (a, column) in columns.iter().enumerate() {
                for b in 0..taps.pow(3) {
                    let [x, y, z] = node(b);
                    sum += share(a) * share(b) * column[(x * N + y) * N + z];
                }
            }
            count += 1.0;
        }
        let found: f64 = sum / count;
        assert!((found.sqrt() / law.amplitude - 1.0).abs() < 0.01, "{degree:?} {}", found.sqrt());
        // The same at an edge as in the middle.
        let of =
            |node: [usize; 3]| covariances(&field, node)[(node[0] * N + node[1]) * N + node[2]];
        assert!((of([0, 3, N - 1]) / of([N / 2; 3]) - 1.0).abs() < 1e-10);
    }
}

/// L makes of a draw the white noise that it was made of, wave by wave, and its square is the value.
#[test]
fn exact_draws_become_white_again() {
    for roughness in [Roughness::Half, Roughness::FiveHalves] {
        let voxels = Voxels { nodes: [6, 5, 7], ..Voxels::cube(6, 4.0, Degree::Cubic) };
        let field = GaussianField::new(law(roughness, 1.7), &voxels).unwrap();
        let draw = field.drawn(5);
        let noise = normal(field.count(), 5);
        let value = field.value_and_gradient(&draw, 1.0, &mut vec![0.0; field.count()]);
        assert!((value / dot(&noise, &noise) - 1.0).abs() < 1e-11, "{value}");
    }
}

#[test]
fn exact_slopes_and_second_derivatives_are_differences() {
    let voxels = Voxels::cube(5, 4.0, Degree::Cubic);
    for roughness in [Roughness::Half, Roughness::FiveHalves] {
        let field = GaussianField::new(law(roughness, 3.0), &voxels).unwrap();
        let field = field.clone().about(field.drawn(1));
        let (x, along) = (normal(125, 2), normal(125, 3));
        let at = |step: f64| {
            let mut slopes = vec![0.0; 125];
            (field.value_and_gradient(&moved(&x, &along, step), 0.7, &mut slopes), slopes)
        };
        let ([up, down], (_, slopes)) = ([at(1e-4), at(-1e-4)], at(0.0));
        let difference = (up.0 - down.0) / 2e-4;
        assert!((dot(&slopes, &along) / difference - 1.0).abs() < 1e-6, "{difference}");
        let mut bent = vec![0.0; 125];
        field.add_curvature(&along, 0.7, &mut bent);
        for (bent, (up, down)) in bent.iter().zip(up.1.iter().zip(&down.1)) {
            let difference = (up - down) / 2e-4;
            assert!((difference - bent).abs() < 1e-6 * bent.abs().max(1.0), "{difference} {bent}");
        }
    }
}

/// The conditions for the nearest field in a box: no slope inside, none that points into the box at its walls.
#[test]
fn exact_nearest_fields_satisfy_the_conditions() {
    let voxels = Voxels::cube(9, 4.0, Degree::Cubic);
    let law = Matern { mean: 0.1, ..law(Roughness::Half, 2.0) };
    let field = GaussianField::new(law, &voxels).unwrap();
    let (draw, upper) = (field.drawn(7), 0.5);
    assert!(draw.iter().any(|x| *x < 0.0) && draw.iter().any(|x| *x > upper));
    let nearest = field.drawn_between(upper, 7);
    let (mut slopes, mut scale) = (vec![0.0; nearest.len()], vec![0.0; nearest.len()]);
    field.clone().about(draw).value_and_gradient(&nearest, 1.0, &mut slopes);
    field.value_and_gradient(&vec![0.0; nearest.len()], 1.0, &mut scale);
    let most = 1e-4 * scale.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    for (x, slope) in nearest.iter().zip(slopes) {
        assert!((0.0..=upper).contains(x));
        let is_right = match *x {
            0.0 => slope > -most,
            x if x >= upper => slope < most,
            _ => slope.abs() < most,
        };
        assert!(is_right, "{x} {slope}");
    }
}

#[test]
fn numbers_out_of_range_are_named() {
    let voxels = Voxels::cube(5, 4.0, Degree::Cubic);
    let text = |law| GaussianField::new(law, &voxels).unwrap_err().to_string();
    let law = law(Roughness::Half, 1.0);
    assert!(text(Matern { amplitude: 0.0, ..law }).contains("amplitude = 0 "));
    assert!(text(Matern { correlation_length: -1.0, ..law }).contains("correlation_length = -1 "));
    assert!(text(Matern { mean: f64::NAN, ..law }).contains("mean = NaN "));
}
