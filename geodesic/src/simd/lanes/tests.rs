use super::{Array, Element, InstructionSet, Lanes, MAX_LANES, Task, dispatch};
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Numbers of every sign and size, and those that are none.
const NUMBERS: [f64; 12] = [
    0.0,
    -0.0,
    1.0,
    -2.5,
    FRAC_1_SQRT_2,
    SQRT_2,
    3e-30,
    -7e20,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    33.0,
];

trait Number: Element {
    fn of(x: f64) -> Self;
    fn double(self) -> f64;
}

impl Number for f32 {
    fn of(x: f64) -> f32 {
        x as f32
    }
    fn double(self) -> f64 {
        self.into()
    }
}

impl Number for f64 {
    fn of(x: f64) -> f64 {
        x
    }
    fn double(self) -> f64 {
        self
    }
}

/// Results of every operation on two registers of numbers.
struct Operations<T>([T; MAX_LANES], [T; MAX_LANES]);

impl<T: Number> Task<T> for Operations<T> {
    type Output = Vec<[T; MAX_LANES]>;

    #[inline(always)]
    fn run<V: Lanes<T>>(self) -> Self::Output {
        let Self(x, y) = self;
        let mut out = vec![[T::ZERO; MAX_LANES]; 17];
        for from in (0..MAX_LANES).step_by(V::LANES) {
            let (x, y) = (V::load(&x[from..]), V::load(&y[from..]));
            let (zero, one) = (V::splat(T::ZERO), V::splat(T::ONE));
            let (mantissa, exponent) = x.split();
            let both = V::both(x.lt(y), zero.lt(y));
            let flag = |holds: bool| if holds { one } else { zero };
            let results = [
                x + y,
                x - y,
                x * y,
                x / y,
                -x,
                x.abs(),
                x.sqrt(),
                x.min(y),
                x.max(y),
                x.copysign(y),
                V::select(x.lt(y), one, zero),
                V::select(both, x, y),
                mantissa,
                exponent,
                V::two_to_the(one + one),
                flag(V::any(zero.lt(zero))),
                flag(V::all(zero.lt(one))),
            ];
            for (out, result) in out.iter_mut().zip(results) {
                result.store(&mut out[from..]);
            }
        }
        out
    }
}

fn same<T: Number>(wide: &[[T; MAX_LANES]], one: &[[T; MAX_LANES]], what: &str) {
    for (operation, (wide, one)) in wide.iter().zip(one).enumerate() {
        for (lane, (a, b)) in wide.iter().zip(one).enumerate() {
            let (a, b) = (a.double(), b.double());
            let equal = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            assert!(equal, "{what}: operation {operation}, lane {lane}: {a} {b}");
        }
    }
}

/// Every register, and arrays, against one number at a time.
fn check<T: Number + Lanes<T, Mask = bool>>() {
    let number = |k: usize| T::of(NUMBERS[k % NUMBERS.len()]);
    for shift in 0..NUMBERS.len() {
        let x = core::array::from_fn(number);
        let y = core::array::from_fn(|k| number(k + shift));
        let one = Operations(x, y).run::<T>();
        for set in InstructionSet::ALL {
            same(&dispatch(set, Operations(x, y)), &one, &format!("{set:?}"));
        }
        same(&Operations(x, y).run::<Array<T, 16>>(), &one, "16 numbers");
        same(&Operations(x, y).run::<Array<T, 4>>(), &one, "4 numbers");
    }
}

#[test]
fn exact_same_operations_in_every_register() {
    check::<f32>();
    check::<f64>();
}

/// The front of a slice, its sum, and what lies beyond a slice's end.
struct Fronts;

impl<T: Number> Task<T> for Fronts {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let all: [T; MAX_LANES] = core::array::from_fn(|k| T::of(k as f64 + 1.0));
        for len in 0..=V::LANES {
            let sum: f64 = (1..=len).map(|k| k as f64).sum();
            assert_eq!(V::load_or(&all[..len], T::ZERO).sum().double(), sum);
            let rest = (V::LANES - len) as f64 * len as f64;
            assert_eq!(V::load(&all[..len]).sum().double(), sum + rest);
            let mut out = [T::ZERO; MAX_LANES];
            V::load(&all).store(&mut out[..len]);
            let expected = |k: usize| if k < len { k as f64 + 1.0 } else { 0.0 };
            assert!(out.iter().enumerate().all(|(k, x)| x.double() == expected(k)));
        }
    }
}

#[test]
fn exact_fronts_of_slices() {
    for set in InstructionSet::ALL {
        dispatch::<f32, _>(set, Fronts);
        dispatch::<f64, _>(set, Fronts);
    }
}

/// Eight stored registers, turned; lines that would leave the target are dropped.
struct Turn;

impl<T: Number> Task<T> for Turn {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let rows: Vec<T> = (0..8 * V::LANES).map(|k| T::of(k as f64)).collect();
        let starts: Vec<usize> = (0..V::LANES).map(|l| 9 * l).collect();
        let mut out = vec![T::of(-1.0); 9 * V::LANES];
        V::transpose_into(&rows, V::LANES, &mut out, &starts);
        for (k, x) in out.iter().enumerate() {
            let (l, s) = (k / 9, k % 9);
            let expected = if s < 8 { (s * V::LANES + l) as f64 } else { -1.0 };
            assert_eq!(x.double(), expected, "lane {l}, row {s}");
        }
    }
}

#[test]
fn exact_transpositions() {
    for set in InstructionSet::ALL {
        dispatch::<f32, _>(set, Turn);
        dispatch::<f64, _>(set, Turn);
    }
}
