use super::super::{Dtft, Method, Transform};
use super::*;
use crate::conformance;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// (u, v) of three frames: inside, none, and up to twice beyond what pixels resolve.
fn frames(grid: ImageGrid) -> Vec<Vec<[f64; 2]>> {
    let mut random = Pcg64Mcg::seed_from_u64(21);
    let mut uv = |n: usize, reach: f64| -> Vec<[f64; 2]> {
        let reach = reach / grid.pixel_rad;
        (0..n).map(|_| [0, 1].map(|_| random.random_range(-reach..reach))).collect()
    };
    let mut inside = uv(100, 0.5);
    // Edges: the origin, the axes, the last frequency that pixels resolve.
    let nyquist = 0.5 / grid.pixel_rad;
    inside.extend([[0.0, 0.0], [nyquist, -nyquist], [-nyquist, 0.0], [0.0, nyquist]]);
    vec![inside, Vec::new(), uv(300, 1.0)]
}

/// Images of both signs, and of one pixel alone in a corner, where the correction is largest: no
/// image errs more than its worst pixel.
fn movies(grid: ImageGrid) -> [Vec<f64>; 2] {
    let mut random = Pcg64Mcg::seed_from_u64(22);
    let mixed = (0..3 * grid.pixels()).map(|_| random.random_range(-1.0..1.0)).collect();
    let corner = |k: usize| if k.is_multiple_of(grid.pixels()) { 2.5 } else { 0.0 };
    [mixed, (0..3 * grid.pixels()).map(corner).collect()]
}

/// The largest error in units of accuracy × Σ|I|.
fn worst<T: Float>(grid: ImageGrid, pulse: Pulse, accuracy: f64, movie: &[f64]) -> f64 {
    let frames = frames(grid);
    let single: Vec<T> = movie.iter().map(|x| T::of(*x)).collect();
    let fast = Nufft::new(grid, pulse, &frames, accuracy).unwrap();
    let direct = Dtft::<f64>::new(grid, pulse, &frames, 0);
    let mut found = vec![Complex::new(T::zero(), T::zero()); Operator::<T>::data(&fast)];
    let mut expected = vec![Complex::new(0.0, 0.0); direct.data()];
    fast.forward(&single, &mut found);
    direct.forward(movie, &mut expected);
    let flux = movie[..grid.pixels()].iter().map(|x| x.abs()).sum::<f64>();
    let error = |(a, b): (&Complex<T>, &Complex<f64>)| {
        (Complex::new(a.re.double(), a.im.double()) - b).norm()
    };
    found.iter().zip(&expected).map(error).fold(0.0, f64::max) / (accuracy * flux)
}

#[test]
fn exact_error_is_below_the_accuracy_asked_for() {
    for (width, height) in [(64, 64), (1, 1), (3, 40), (37, 50)] {
        let grid = ImageGrid::new(width, height, 1e-9).unwrap();
        for movie in movies(grid) {
            for accuracy in (1..=13).map(|exponent| 10f64.powi(-exponent)) {
                let found = worst::<f64>(grid, Pulse::Delta, accuracy, &movie);
                println!("{width} x {height} {accuracy} {found}");
                assert!(found <= 1.0, "{width} x {height}, {accuracy}: {found}");
            }
            for accuracy in (1..=6).map(|exponent| 10f64.powi(-exponent)) {
                let found = worst::<f32>(grid, Pulse::Triangle, accuracy, &movie);
                println!("f32 {width} x {height} {accuracy} {found}");
                assert!(found <= 1.0, "f32, {width} x {height}, {accuracy}: {found}");
            }
        }
    }
}

fn conforms<T: Float>(accuracy: f64, tolerance: f64) {
    for (width, height) in [(13, 80), (64, 64)] {
        let grid = ImageGrid::new(width, height, 1e-9).unwrap();
        let fast = Nufft::new(grid, Pulse::Triangle, &frames(grid), accuracy).unwrap();
        conformance::operator::<T>("fast transform", &fast, tolerance);
    }
}

#[test]
fn exact_adjoint_in_both_precisions() {
    conforms::<f64>(1e-3, 1e-14);
    conforms::<f64>(1e-12, 1e-14);
    conforms::<f32>(1e-3, 1e-6);
}

#[test]
fn exact_accuracies_out_of_range_are_refused() {
    let grid = ImageGrid::new(4, 4, 1e-9).unwrap();
    for accuracy in [0.0, 1e-14, 0.2, f64::NAN, -1.0] {
        assert!(Nufft::new(grid, Pulse::Delta, &[], accuracy).is_err(), "{accuracy}");
    }
    for method in [Method::Fast(1e-7), Method::Cheaper(1e-7)] {
        assert!(Transform::<f32>::new(grid, Pulse::Delta, &[], method, 0).is_err());
        assert!(Transform::<f64>::new(grid, Pulse::Delta, &[], method, 0).is_ok());
    }
}
