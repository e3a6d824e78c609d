use super::*;
use crate::points::{Coordinates, CoordinatesMut};
use kerrlight_geodesic::vector::{cross, dot, rotate};

const COUNT: usize = 20_003;

struct Case {
    axis: Axis,
    points: [Vec<f64>; 3],
    angles: Vec<f64>,
    gradient: [Vec<f64>; 3],
}

fn example() -> Case {
    let column = |k: usize| -> Vec<f64> {
        (0..COUNT).map(|i| ((i * (2 * k + 3)) % 1009) as f64 / 100.9 - 5.0).collect()
    };
    let axis = Axis::new([0.5, 0.3, -0.8]).unwrap();
    let (points, gradient) = ([1, 2, 3].map(column), [4, 5, 6].map(column));
    Case { axis, points, angles: column(7), gradient }
}

fn columns<T>(x: &[Vec<T>; 3]) -> Coordinates<'_, T> {
    Coordinates::xyz(&x[0], &x[1], &x[2])
}

fn columns_mut<T>(x: &mut [Vec<T>; 3]) -> CoordinatesMut<'_, T> {
    let [x, y, z] = x;
    CoordinatesMut::xyz(x, y, z)
}

impl Case {
    fn pulled(&self, axis: Axis) -> [Vec<f64>; 3] {
        let mut out = [(); 3].map(|()| vec![f64::NAN; COUNT]);
        let turned = Turned { points: columns(&self.points), angles: &self.angles };
        pull_back(axis, turned, columns_mut(&mut out));
        out
    }

    fn loss(&self, axis: Axis) -> f64 {
        let pulled = self.pulled(axis);
        let dot = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        pulled.iter().zip(&self.gradient).map(|(a, b)| dot(a, b)).sum()
    }

    /// Gradients of the axis, the angles and the points.
    fn vjp(&self) -> ([f64; 3], Vec<f64>, [Vec<f64>; 3]) {
        let (mut angles, mut points) = (vec![0.0; COUNT], [(); 3].map(|()| vec![0.0; COUNT]));
        let turned = Turned { points: columns(&self.points), angles: &self.angles };
        let (of_angles, of_points) = (Some(&mut angles[..]), Some(columns_mut(&mut points)));
        let wanted = Cotangents { angles: of_angles, points: of_points };
        let axis = pull_back_vjp(self.axis, turned, columns(&self.gradient), wanted);
        (axis, angles, points)
    }
}

#[test]
fn exact_rotations_in_both_precisions() {
    let case = example();
    let pulled = case.pulled(case.axis);
    let single = case.points.clone().map(|c| c.iter().map(|x| *x as f32).collect::<Vec<_>>());
    let angles: Vec<f32> = case.angles.iter().map(|x| *x as f32).collect();
    let mut of_single = [(); 3].map(|()| vec![f32::NAN; COUNT]);
    let turned = Turned { points: columns(&single), angles: &angles };
    pull_back(case.axis, turned, columns_mut(&mut of_single));
    for k in 0..COUNT {
        let point = [0, 1, 2].map(|c| case.points[c][k]);
        let exact = rotate(case.axis.vector(), case.angles[k], point);
        for c in 0..3 {
            assert!((pulled[c][k] - exact[c]).abs() < 1e-14);
            assert!((f64::from(of_single[c][k]) - exact[c]).abs() < 5e-6);
        }
    }
}

#[test]
fn exact_derivatives_by_central_differences() {
    let case = example();
    let (of_axis, of_angles, of_points) = case.vjp();
    let step = 1e-6;
    let size = of_axis.iter().fold(0.0f64, |size, x| size.max(x.abs()));
    for direction in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -0.2, 0.9]] {
        let tangent = case.axis.tangent(direction);
        let at = |h: f64| case.loss(case.axis.moved(tangent.map(|x| h * x)));
        let difference = (at(step) - at(-step)) / (2.0 * step);
        let product: f64 = of_axis.iter().zip(direction).map(|(a, b)| a * b).sum();
        assert!((difference - product).abs() < 1e-7 * size, "{difference} {product}");
    }
    let value = |case: &Case, k: usize| -> f64 {
        let pulled = case.pulled(case.axis);
        (0..3).map(|c| pulled[c][k] * case.gradient[c][k]).sum()
    };
    for k in [0, 1, 5003, COUNT - 1] {
        let mut moved = [example(), example()];
        for (case, h) in moved.iter_mut().zip([step, -step]) {
            case.angles[k] += h;
        }
        let difference = (value(&moved[0], k) - value(&moved[1], k)) / (2.0 * step);
        assert!((difference - of_angles[k]).abs() < 1e-7 * 30.0, "{difference} {}", of_angles[k]);
        for (c, of_points) in of_points.iter().enumerate() {
            let mut moved = [example(), example()];
            for (case, h) in moved.iter_mut().zip([step, -step]) {
                case.points[c][k] += h;
            }
            let difference = (value(&moved[0], k) - value(&moved[1], k)) / (2.0 * step);
            assert!((difference - of_points[k]).abs() < 1e-7 * 10.0);
        }
    }
}

#[test]
fn exact_adjoint_of_points_angles_and_axis() {
    // ⟨J v, w⟩ = ⟨v, Jᵀ w⟩ with the derivative written out in three dimensions.
    let case = example();
    let (of_axis, of_angles, of_points) = case.vjp();
    let axis = case.axis.vector();
    let change = case.axis.tangent([0.2, 0.7, -0.4]);
    let (mut left, mut right, mut size) = (0.0, 0.0, 0.0);
    for k in 0..COUNT {
        let x = [0, 1, 2].map(|c| case.points[c][k]);
        let g = [0, 1, 2].map(|c| case.gradient[c][k]);
        let dx = [0, 1, 2].map(|c| case.gradient[(c + 1) % 3][k] - 1.0);
        let (angle, turn) = (case.angles[k], 0.1 * x[0] - 0.3);
        let (sin, cos) = angle.sin_cos();
        let (swirl, around) = (cross(change, x), cross(axis, rotate(axis, angle, x)));
        let moved = rotate(axis, angle, dx);
        let derivative: [f64; 3] = core::array::from_fn(|c| {
            let tilt = dot(change, x) * axis[c] + dot(axis, x) * change[c];
            moved[c] + turn * around[c] + sin * swirl[c] + (1.0 - cos) * tilt
        });
        left += dot(g, derivative);
        size += dot(g, derivative).abs();
        right += of_angles[k] * turn + (0..3).map(|c| of_points[c][k] * dx[c]).sum::<f64>();
    }
    right += dot(of_axis, change);
    assert!((left - right).abs() < 1e-12 * size, "{left} {right} {size}");
}

#[test]
fn regress_same_bits_on_any_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (example().pulled(example().axis), example().vjp()))
    };
    assert!(on(1) == on(3));
}

#[test]
fn exact_angular_velocities() {
    let kepler = AngularVelocity::Keplerian { drag: 0.5 }.checked().unwrap();
    assert!((kepler.rate(4.0) - 1.0 / 8.5).abs() < 1e-16);
    let paper = AngularVelocity::bhnerf().checked().unwrap();
    // One turn a unit of time at 3.5, pulled back right-handed.
    let angle = paper.angle([0.0, 2.1, -2.8], 0.25, 0.0);
    assert!((angle - core::f64::consts::FRAC_PI_2).abs() < 1e-15);
    let (radii, rates) = (vec![1.0, 2.0, 4.0], vec![3.0, 1.0, 2.0]);
    let table = AngularVelocity::Table { radii, rates }.checked().unwrap();
    for (r, rate) in [(0.5, 3.0), (1.5, 2.0), (2.0, 1.0), (3.0, 1.5), (4.0, 2.0), (9.0, 2.0)] {
        assert_eq!(table.rate(r), rate);
    }
    for model in [kepler, paper, table] {
        for r in [1.3, 2.2, 3.9, 7.0] {
            let difference = (model.rate(r + 1e-6) - model.rate(r - 1e-6)) / 2e-6;
            assert!((difference - model.slope(r)).abs() < 1e-8, "{model:?} {r}");
        }
    }
}

#[test]
fn numbers_out_of_range_are_named() {
    let of = |model: AngularVelocity| model.checked().unwrap_err().to_string();
    let table = |radii: &[f64], rates: &[f64]| AngularVelocity::Table {
        radii: radii.to_vec(),
        rates: rates.to_vec(),
    };
    let text = of(table(&[1.0, 1.0], &[1.0, 2.0]));
    assert_eq!(text, "radii = 1 is not allowed: above 0, growing");
    let text = of(table(&[1.0], &[1.0, 2.0]));
    assert_eq!(text, "rates = 2 is not allowed: as many as radii, 1 or more");
    let text = Axis::new([0.0; 3]).unwrap_err().to_string();
    assert_eq!(text, "axis = [0.0, 0.0, 0.0] is not allowed: finite numbers, not all zero");
    assert!(Axis::new([1e-200, 0.0, -1e-200]).is_ok());
}
