//! Steps: by the stages of a Runge–Kutta method, or by a Taylor series.

use crate::integrate::mino::{System, has_azimuth, has_time, index};
use crate::integrate::runge_kutta::{Control, Method, step};
use crate::integrate::series::{Series, rows};
use crate::numbers::polynomial::hermite;
use crate::numbers::scalar::Elementary;
use crate::screen::observer::Ray;

/// Longest step in scaled Mino time: short against half a polar or azimuthal period
/// (at least 1.8), so that a step holds at most one crossing of the equator.
pub(crate) const LONGEST_STEP: f64 = 0.8;

/// State of a ray, and its equations.
pub(crate) struct State<'a, T, const N: usize> {
    pub ray: &'a Ray<T>,
    pub system: System<T>,
    pub tolerance: f64,
    pub y: [T; N],
    /// +1 on an inward leg, −1 on an outward one.
    pub leg: f64,
}

/// A step that has been made.
pub(crate) struct Made<T, const N: usize> {
    pub h: f64,
    pub y: [T; N],
    /// Error of every variable.
    pub error: [f64; N],
}

/// Makes steps from a state, each of them also as polynomials.
pub(crate) trait Stepper<T, const N: usize> {
    /// Coefficients of each polynomial.
    fn width(&self) -> usize;

    /// Tries a step; `None` if its error was too large. The next one will
    /// then be shorter.
    fn step(&mut self, state: &State<'_, T, N>, series: &mut Series<T>) -> Option<Made<T, N>>;

    /// Appends the polynomials of the step of length `h` from `state` to `end`.
    fn dense(
        &mut self,
        state: &State<'_, T, N>,
        end: &[T; N],
        h: f64,
        series: &mut Series<T>,
        out: &mut Vec<T>,
    );

    /// Restarts the stepper when the state starts, or changes otherwise than by a step.
    fn restart(&mut self, state: &State<'_, T, N>, series: &mut Series<T>);
}

impl<T: Elementary, const N: usize> State<'_, T, N> {
    /// Returns the largest allowed error of every variable in a step of length `h` to `end`, where the
    /// slopes of azimuth and time are `slope`.
    pub fn allowed(&self, end: &[T; N], slope: [f64; 2], h: f64) -> [f64; N] {
        let rounding = 4.0 * T::EPSILON;
        let mut allowed = [self.tolerance.max(rounding); N];
        // Far from the hole, where b·w is small, it is the relative error that counts.
        let size = self.y[index::W].value().max(end[index::W].value()).clamp(0.01, 1.0);
        let radial = (self.tolerance * self.barrier_distance(end) * size).max(rounding * size);
        (allowed[index::W], allowed[index::DW]) = (radial, radial);
        if has_azimuth(N) || has_time(N) {
            // These grow without bound where g vanishes, at the horizon of an extremal hole,
            // and cannot be better than g's own rounding.
            let leg = T::constant(self.leg);
            let blur = rounding * h * self.system.blur(&self.y, leg).value().abs();
            let first = if has_azimuth(N) { index::AZIMUTH } else { N - 1 };
            for (k, slope) in (first..N).zip(slope) {
                allowed[k] = allowed[k] * end[k].value().abs().max(1.0) + blur * slope.abs();
            }
        }
        allowed
    }

    /// Distance of the step from the photon orbit, at most 1: the error of w is held to a
    /// fraction of it.
    fn barrier_distance(&self, end: &[T; N]) -> f64 {
        let Some(barrier) = &self.ray.potential.barrier else { return 1.0 };
        let b = self.system.scale;
        let from = |y: &[T; N]| (y[index::W].value() - b * barrier.w).abs();
        from(&self.y).min(from(end)).max(b * barrier.width()).min(1.0)
    }
}

/// An embedded Runge–Kutta method of `S` stages whose steps are two-point Hermite
/// interpolants of `D` derivatives at each end.
pub(crate) struct RungeKutta<M, const N: usize, const S: usize, const D: usize> {
    method: core::marker::PhantomData<M>,
    control: Control,
    h: f64,
    slope: [f64; N],
    /// Taylor coefficients of every row at the current state.
    jet: [[f64; D]; 6],
}

impl<M: Method<S>, const N: usize, const S: usize, const D: usize> RungeKutta<M, N, S, D> {
    pub fn new(tolerance: f64) -> Self {
        let order = M::TABLEAU.order;
        RungeKutta {
            method: core::marker::PhantomData,
            control: Control::new(order),
            h: (0.5 * tolerance.powf(1.0 / f64::from(order))).min(LONGEST_STEP),
            slope: [0.0; N],
            jet: [[0.0; D]; 6],
        }
    }

    #[inline(always)]
    fn expand(
        system: &System<f64>,
        y: &[f64; N],
        leg: f64,
        series: &mut Series<f64>,
    ) -> [[f64; D]; 6] {
        series.expand(system, y, leg, D - 1);
        let mut jet = [[0.0; D]; 6];
        for (k, jet) in jet.iter_mut().enumerate().take(rows(N)) {
            jet.copy_from_slice(series.row(k, D - 1));
        }
        jet
    }

    /// Slopes of all variables from their series.
    #[inline(always)]
    fn slopes(&self) -> [f64; N] {
        use index::{DU, DW, DX, DY, U, W, X, Y};
        let jet = &self.jet;
        let mut slope = [0.0; N];
        (slope[W], slope[DW]) = (jet[0][1], 2.0 * jet[0][2]);
        (slope[U], slope[DU]) = (jet[1][1], 2.0 * jet[1][2]);
        if has_azimuth(N) {
            (slope[X], slope[DX]) = (jet[2][1], 2.0 * jet[2][2]);
            (slope[Y], slope[DY]) = (jet[3][1], 2.0 * jet[3][2]);
            slope[index::AZIMUTH] = jet[4][1];
        }
        if has_time(N) {
            slope[N - 1] = jet[rows(N) - 1][1];
        }
        slope
    }

    fn norm(error: &[f64; N], allowed: &[f64; N]) -> f64 {
        let mut norm: f64 = 0.0;
        for (error, allowed) in error.iter().zip(allowed) {
            let ratio = error.abs() / allowed;
            // A step that left the numbers' range is rejected like any other bad one.
            norm = if ratio.is_nan() { f64::INFINITY } else { norm.max(ratio) };
        }
        norm
    }
}

impl<M: Method<S>, const N: usize, const S: usize, const D: usize> Stepper<f64, N>
    for RungeKutta<M, N, S, D>
{
    fn width(&self) -> usize {
        2 * D
    }

    #[inline(always)]
    fn step(&mut self, state: &State<'_, f64, N>, _: &mut Series<f64>) -> Option<Made<f64, N>> {
        let h = self.h;
        let mut trial = step::<M, N, S>(&state.system, &state.y, &self.slope, state.leg, h);
        let last = [trial.f[index::AZIMUTH.min(N - 1)], trial.f[N - 1]];
        let allowed = state.allowed(&trial.y, last, h);
        let mut error = Self::norm(&trial.error, &allowed);
        if let Some(second) = &trial.second_error {
            let other = Self::norm(second, &allowed);
            let share = error / (error * error + 0.01 * other * other).sqrt();
            if share.is_finite() {
                error *= share;
                trial.error = trial.error.map(|e| e * share);
            }
        }
        self.h = (h * self.control.factor(error)).min(LONGEST_STEP);
        // The error is that of an embedded solution of lower order, whose local error is 1/h
        // times larger; the factors make the sums over all steps bounds for 99 % of rays.
        let made = trial.error.map(|e| M::CAUTION * e * h);
        (error <= 1.0).then_some(Made { h, y: trial.y, error: made })
    }

    #[inline(always)]
    fn dense(
        &mut self,
        state: &State<'_, f64, N>,
        end: &[f64; N],
        h: f64,
        series: &mut Series<f64>,
        out: &mut Vec<f64>,
    ) {
        let jet = Self::expand(&state.system, end, state.leg, series);
        let mut powers = [1.0; D];
        for k in 1..D {
            powers[k] = powers[k - 1] * h;
        }
        let at = out.len();
        out.resize(at + rows(N) * 2 * D, 0.0);
        for ((start, end), out) in self.jet.iter().zip(&jet).zip(out[at..].chunks_mut(2 * D)) {
            let scaled = |jet: &[f64; D]| core::array::from_fn(|k| jet[k] * powers[k]);
            hermite::<D>(&scaled(start), &scaled(end), out);
        }
        self.jet = jet;
        self.slope = self.slopes();
    }

    fn restart(&mut self, state: &State<'_, f64, N>, series: &mut Series<f64>) {
        self.jet = Self::expand(&state.system, &state.y, state.leg, series);
        self.slope = self.slopes();
    }
}

/// The Taylor series, to the order and with the step that Jorba & Zou (2005) recommend for
/// the tolerance.
pub(crate) struct Taylor {
    order: usize,
    /// Steps after a failed one are shorter by this factor.
    shrink: f64,
}

impl Taylor {
    pub fn new<T: Elementary>(tolerance: f64) -> Self {
        let digits = -tolerance.max(T::EPSILON).ln();
        Taylor { order: (0.5 * digits).ceil() as usize + 2, shrink: 1.0 }
    }

    /// The largest step for which the last two terms of every series stay below what is
    /// allowed.
    #[inline(always)]
    fn length<T: Elementary, const N: usize>(&self, series: &Series<T>, allowed: &[f64; N]) -> f64 {
        let mut h = f64::INFINITY;
        for order in [self.order - 1, self.order] {
            let mut worst = 0.0f64;
            for (row, variable) in variables::<N>() {
                let last = series.row(row, order)[order].value().abs();
                worst = worst.max(last / allowed[variable]);
            }
            h = h.min((-worst.ln() / order as f64).exp());
        }
        h
    }
}

/// Largest ratio of the rest of a series to its first term: measured (docs/measurements/geodesics.md of the
/// repository).
const CAUTION: f64 = 3.0;

impl Taylor {
    /// Size of the first terms that are left out, by the ratio of the last two that are not to
    /// the two before them: of the largest of all rows and of pairs of orders, since a row may
    /// have vanishing terms, those of an odd or even function every other.
    fn error<T: Elementary, const N: usize>(&self, series: &Series<T>, h: f64) -> [f64; N] {
        let order = self.order;
        let power = h.powi(order as i32 - 3);
        let mut terms = [[0.0; 2]; N];
        let mut largest = [0.0f64; 2];
        for (row, variable) in variables::<N>() {
            let row = series.row(row, order);
            let size = |k: usize| row[order - k].value().abs();
            let earlier = size(3).max(size(2) * h) * power;
            let pair = [size(1) * power * h * h, size(0) * power * h * h * h];
            largest = [largest[0].max(earlier), largest[1].max(pair[0].max(pair[1]))];
            terms[variable] = pair;
        }
        let ratio = (largest[1] / largest[0]).sqrt().clamp(0.02, 1.0);
        let mut error = [0.0; N];
        for (_, variable) in variables::<N>() {
            let [before, last] = terms[variable];
            let next = CAUTION * ratio * last.max(ratio * before);
            error[variable] = next;
            if variable < index::AZIMUTH && variable + 1 < N {
                error[variable + 1] = next * (order + 1) as f64 / h;
            }
        }
        error
    }
}

/// Returns the variable of each row of the series.
fn variables<const N: usize>() -> impl Iterator<Item = (usize, usize)> {
    let azimuth = [(2, index::X), (3, index::Y), (4, index::AZIMUTH)];
    let time = (rows(N) - 1, N - 1);
    [(0, index::W), (1, index::U)]
        .into_iter()
        .chain(azimuth.into_iter().filter(|_| has_azimuth(N)))
        .chain(core::iter::once(time).filter(|_| has_time(N)))
}

impl<T: Elementary, const N: usize> Stepper<T, N> for Taylor {
    fn width(&self) -> usize {
        self.order + 1
    }

    #[inline(always)]
    fn step(&mut self, state: &State<'_, T, N>, series: &mut Series<T>) -> Option<Made<T, N>> {
        series.expand(&state.system, &state.y, T::constant(state.leg), self.order);
        let slope = |k: usize| series.row(k, 1)[1].value();
        let slopes =
            if has_azimuth(N) { [slope(4), slope(rows(N) - 1)] } else { [slope(rows(N) - 1), 0.0] };
        let allowed = state.allowed(&state.y, slopes, LONGEST_STEP);
        let h = (self.length(series, &allowed) * self.shrink).min(LONGEST_STEP);
        let y: [T; N] = series.state(T::constant(h), self.order);
        if h.is_nan() || y.iter().any(|y| !y.value().is_finite()) {
            self.shrink *= 0.5;
            return None;
        }
        self.shrink = 1.0;
        Some(Made { h, y, error: self.error(series, h) })
    }

    #[inline(always)]
    fn dense(
        &mut self,
        _: &State<'_, T, N>,
        _: &[T; N],
        h: f64,
        series: &mut Series<T>,
        out: &mut Vec<T>,
    ) {
        for k in 0..rows(N) {
            let mut power = T::constant(1.0);
            for coefficient in series.row(k, self.order) {
                out.push(*coefficient * power);
                power = power * T::constant(h);
            }
        }
    }

    fn restart(&mut self, _: &State<'_, T, N>, _: &mut Series<T>) {}
}
