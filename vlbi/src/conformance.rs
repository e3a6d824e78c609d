//! Tests that every operator and every data term has to pass, in any precision: one call each.

use super::data_terms::DataTerm;
use super::operator::{Float, Operator};
use num_complex::Complex;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A number of the data, real or complex, with the inner product Re Σ x̄ y.
pub(super) trait Datum<T: Float>: Copy {
    /// Makes a value of two numbers.
    fn of(parts: [f64; 2]) -> Self;
    /// Real and imaginary part.
    fn parts(self) -> [f64; 2];
}

impl<T: Float> Datum<T> for T {
    fn of(parts: [f64; 2]) -> Self {
        T::of(parts[0])
    }

    fn parts(self) -> [f64; 2] {
        [self.double(), 0.0]
    }
}

impl<T: Float> Datum<T> for Complex<T> {
    fn of(parts: [f64; 2]) -> Self {
        Complex::new(T::of(parts[0]), T::of(parts[1]))
    }

    fn parts(self) -> [f64; 2] {
        [self.re.double(), self.im.double()]
    }
}

fn dot<T: Float, D: Datum<T>>(a: &[D], b: &[D]) -> f64 {
    let product = |(a, b): (&D, &D)| {
        let ([a_re, a_im], [b_re, b_im]) = (a.parts(), b.parts());
        a_re * b_re + a_im * b_im
    };
    a.iter().zip(b).map(product).sum()
}

fn norm<T: Float, D: Datum<T>>(a: &[D]) -> f64 {
    dot::<T, D>(a, a).sqrt()
}

fn random<T: Float, D: Datum<T>>(count: usize, seed: u64) -> Vec<D> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    (0..count).map(|_| D::of([0, 1].map(|_| random.random_range(-1.0..1.0)))).collect()
}

/// a + s·b.
fn moved<T: Float, D: Datum<T>>(a: &[D], b: &[D], s: f64) -> Vec<D> {
    let sum = |(a, b): (&D, &D)| {
        let (a, b) = (a.parts(), b.parts());
        D::of([a[0] + s * b[0], a[1] + s * b[1]])
    };
    a.iter().zip(b).map(sum).collect()
}

/// ⟨F x, y⟩ = ⟨x, Fᵀ y⟩ within `tolerance` of ‖F x‖ ‖y‖; central differences of F along a
/// direction are F of that direction; `forward` overwrites and `adjoint` adds.
pub(super) fn operator<T: Float>(name: &str, operator: &impl Operator<T>, tolerance: f64) {
    let forward = |movie: &[T]| {
        let mut data: Vec<Complex<T>> = random(operator.data(), 9);
        operator.forward(movie, &mut data);
        data
    };
    let pixels = operator.frames() * operator.pixels();
    let (x, direction) = (random::<T, T>(pixels, 1), random::<T, T>(pixels, 2));
    let y: Vec<Complex<T>> = random(operator.data(), 3);
    let data = forward(&x);
    let start = random::<T, T>(pixels, 4);
    let mut back = start.clone();
    operator.adjoint(&y, &mut back);
    let gained = moved::<T, T>(&back, &start, -1.0);
    let (left, right) = (dot::<T, _>(&data, &y), dot::<T, T>(&gained, &x));
    let scale = norm::<T, _>(&data) * norm::<T, _>(&y);
    assert!(scale > 0.0, "{name} measures nothing");
    assert!((left - right).abs() <= tolerance * scale, "{name}: {left} {right}, of {scale}");
    // The map is linear: a step of 1 is as good as any.
    let ahead = forward(&moved::<T, T>(&x, &direction, 1.0));
    let behind = forward(&moved::<T, T>(&x, &direction, -1.0));
    let exact = forward(&direction);
    let difference = moved::<T, _>(&moved::<T, _>(&ahead, &behind, -1.0), &exact, -2.0);
    let error = norm::<T, _>(&difference) / norm::<T, _>(&exact);
    assert!(error <= 20.0 * tolerance, "{name}: differences are off by {error}");
}

/// Central differences of fourth order with step `h`, along every visibility's real and imaginary
/// part and along random directions, against the gradient; it adds, with the weight requested.
pub(super) fn data_term<T: Float>(
    name: &str,
    term: &dyn DataTerm<T>,
    model: &[Complex<T>],
    h: f64,
    tolerance: f64,
) {
    let zeros = || vec![Complex::new(T::zero(), T::zero()); model.len()];
    assert_eq!(term.visibilities(), model.len(), "{name}");
    let mut gradient = zeros();
    let value = term.value_and_gradient(model, T::one(), &mut gradient);
    assert!(value > 1.0 && term.degrees_of_freedom() > 0, "{name}: {value}");
    let along = |direction: &[Complex<T>]| {
        let at = |s: f64| {
            let model = moved::<T, _>(model, direction, s * h);
            term.value_and_gradient(&model, T::zero(), &mut zeros())
        };
        let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
        let exact = dot::<T, _>(&gradient, direction);
        let scale = norm::<T, _>(&gradient) * norm::<T, _>(direction);
        assert!((slope - exact).abs() <= tolerance * scale, "{name}: {slope} {exact}, of {scale}");
    };
    for k in 0..model.len() {
        for unit in [[1.0, 0.0], [0.0, 1.0]] {
            let mut direction = zeros();
            direction[k] = Datum::<T>::of(unit);
            along(&direction);
        }
    }
    (5..8).for_each(|seed| along(&random(model.len(), seed)));
    let mut sum = gradient.clone();
    term.value_and_gradient(model, T::of(0.5), &mut sum);
    let rest = norm::<T, _>(&moved::<T, _>(&sum, &gradient, -1.5));
    assert!(rest <= tolerance * norm::<T, _>(&gradient), "{name}: weights are off by {rest}");
}

/// χ² of a model by its degrees of freedom; the squares of residuals, one for each, add up to it within `tolerance`.
pub(super) fn reduced_chi2(
    name: &str,
    term: &dyn DataTerm<f64>,
    model: &[Complex<f64>],
    tolerance: f64,
) -> f64 {
    let value = term.value_and_gradient(model, 0.0, &mut vec![Complex::default(); model.len()]);
    let residuals = term.residuals(model);
    let freedom: f64 = residuals.iter().map(|residual| residual.freedom).sum();
    assert!((freedom - term.degrees_of_freedom() as f64).abs() < 1e-8, "{name}: {freedom}");
    let squares: f64 = residuals.iter().map(|residual| residual.value.powi(2)).sum();
    assert!((squares - value).abs() <= tolerance * value, "{name}: {squares} {value}");
    value / freedom
}
