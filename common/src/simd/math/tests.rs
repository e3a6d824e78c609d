use super::*;
use crate::simd::{Array, InstructionSet, Task, dispatch};

/// Largest error of a function over arguments, the same with every register.
struct Errors<'a, T, F> {
    arguments: &'a [f64],
    compute: F,
    exact: fn(f64) -> f64,
    relative: bool,
    unit: core::marker::PhantomData<T>,
}

macro_rules! function {
    ($name:ident, $call:expr) => {
        struct $name;
        impl Function for $name {
            #[inline(always)]
            fn call<T: Float, V: Lanes<T>>(&self, x: V) -> V {
                $call(x)
            }
        }
    };
}

trait Function {
    fn call<T: Float, V: Lanes<T>>(&self, x: V) -> V;
}
function!(Sin, |x| sin_cos::<T, V>(x).0);
function!(Cos, |x| sin_cos::<T, V>(x).1);
function!(Exp, exp::<T, V>);
function!(Sigmoid, sigmoid::<T, V>);
function!(Softplus, softplus::<T, V>);

impl<T: Float, F: Function> Task<T> for Errors<'_, T, F> {
    type Output = f64;
    #[inline(always)]
    fn run<V: Lanes<T>>(self) -> f64 {
        let mut worst = 0.0f64;
        for x in self.arguments.chunks(V::LANES) {
            let rounded: Vec<T> = x.iter().map(|x| T::of(*x)).collect();
            let mut out = vec![T::zero(); x.len()];
            self.compute.call::<T, V>(V::load_or(&rounded, T::zero())).store(&mut out);
            for (x, y) in rounded.iter().zip(out) {
                let exact = (self.exact)(x.double());
                let scale = if self.relative { exact.abs() } else { 1.0 };
                worst = worst.max((y.double() - exact).abs() / scale);
                assert!(y.is_finite());
            }
        }
        worst
    }
}

fn worst<T: Float + Lanes<T, Mask = bool>>(
    arguments: &[f64],
    compute: impl Function + Copy,
    exact: fn(f64) -> f64,
    relative: bool,
) -> f64 {
    let errors =
        || Errors::<T, _> { arguments, compute, exact, relative, unit: core::marker::PhantomData };
    let of = InstructionSet::ALL.map(|set| dispatch(set, errors()));
    let wide = errors().run::<Array<T, 16>>();
    of.into_iter().fold(wide, f64::max)
}

fn points(limit: f64) -> Vec<f64> {
    (0..100_001).map(|k| limit * (2.0 * f64::from(k) / 1e5 - 1.0)).collect()
}

impl<F: Function> Function for &F {
    #[inline(always)]
    fn call<T: Float, V: Lanes<T>>(&self, x: V) -> V {
        F::call(self, x)
    }
}

#[test]
fn exact_sine_and_cosine_by_the_standard_library() {
    for limit in [1.0, 40.0, 8000.0, 1e6, 1e12] {
        let x = points(limit);
        for (of32, of64) in [
            (worst::<f32>(&x, &Sin, f64::sin, false), worst::<f64>(&x, &Sin, f64::sin, false)),
            (worst::<f32>(&x, &Cos, f64::cos, false), worst::<f64>(&x, &Cos, f64::cos, false)),
        ] {
            assert!(of32 < 1.2e-7, "{limit} {of32:e}");
            assert!(of64 < 2.5e-16, "{limit} {of64:e}");
        }
    }
}

#[test]
fn exact_exponentials_by_the_standard_library() {
    let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
    let softplus = |x: f64| x.max(0.0) + (-x.abs()).exp().ln_1p();
    for limit in [0.3, 5.0, 80.0] {
        let x = points(limit);
        for (of32, of64) in [
            (worst::<f32>(&x, &Exp, f64::exp, true), worst::<f64>(&x, &Exp, f64::exp, true)),
            (worst::<f32>(&x, &Sigmoid, sigmoid, true), worst::<f64>(&x, &Sigmoid, sigmoid, true)),
            (
                worst::<f32>(&x, &Softplus, softplus, true),
                worst::<f64>(&x, &Softplus, softplus, true),
            ),
        ] {
            assert!(of32 < 5e-7, "{limit} {of32:e}");
            assert!(of64 < 1e-15, "{limit} {of64:e}");
        }
    }
}

#[test]
fn beyond_all_bounds_functions_stay_finite() {
    let x = [-3e38, -1e30, -1e9, -200.0, 200.0, 1e9, 1e30, 3e38];
    for error in [
        worst::<f32>(&x, &Sin, f64::sin, false),
        worst::<f64>(&x, &Cos, f64::cos, false),
        worst::<f32>(&x, &Sigmoid, |x| f64::from(x > 0.0), false),
    ] {
        assert!(error < 1e-6, "{error:e}");
    }
}
