//! Taylor series of the equations of motion: the right-hand sides are polynomials and one
//! division, so that every coefficient follows from the earlier ones by products of series
//! (Jorba & Zou 2005, Experimental Mathematics 14, 99).

use crate::integrate::mino::{System, has_azimuth, has_time, index};
use crate::numbers::polynomial::Polynomial;
use crate::numbers::scalar::Scalar;

/// Highest order that a series can have.
pub(crate) const MAX_ORDER: usize = 40;

type Row<T> = [T; MAX_ORDER + 3];

/// Number of polynomials that describe a state of `N` variables: those that are derivatives of
/// others need none of their own. They are w, u, then x, y, I_φ if there is azimuth, then I_t.
pub(crate) const fn rows(n: usize) -> usize {
    2 + if has_azimuth(n) { 3 } else { 0 } + if has_time(n) { 1 } else { 0 }
}

/// Taylor coefficients of one state, and what their recurrences need.
#[derive(Debug, Clone)]
pub(crate) struct Series<T> {
    rows: [Row<T>; 6],
    w2: Row<T>,
    u2: Row<T>,
    g: Row<T>,
    w2_over_g: Row<T>,
    time_over_g: Row<T>,
}

impl<T: Scalar> Series<T> {
    pub fn new() -> Self {
        let zero = [T::constant(0.0); MAX_ORDER + 3];
        Series { rows: [zero; 6], w2: zero, u2: zero, g: zero, w2_over_g: zero, time_over_g: zero }
    }

    /// The coefficients up to `order` of row number `k`.
    #[inline(always)]
    pub fn row(&self, k: usize, order: usize) -> &[T] {
        &self.rows[k][..=order]
    }

    /// Expands about the state `y`: coefficients of s^k up to k = `order` ≤ 40.
    #[inline(always)]
    pub fn expand<const N: usize>(&mut self, system: &System<T>, y: &[T; N], leg: T, order: usize) {
        self.start(y);
        for k in 0..order {
            self.squares(k);
            self.g[k] = system.gauge() * self.w2[k]
                + leg * (self.rows[0][k + 1] * T::constant((k + 1) as f64));
            if k == 0 {
                self.g[0] = self.g[0] + T::constant(1.0);
            }
            self.advance::<N>(system, k);
        }
    }

    /// The state at a distance `h` from the one that was expanded.
    #[inline(always)]
    pub fn state<const N: usize>(&self, h: T, order: usize) -> [T; N] {
        use index::{DU, DW, DX, DY, U, W, X, Y};
        let row = |k: usize| Polynomial(self.row(k, order));
        let mut y = [T::constant(0.0); N];
        (y[W], y[DW]) = row(0).both(h);
        (y[U], y[DU]) = row(1).both(h);
        if has_azimuth(N) {
            (y[X], y[DX]) = row(2).both(h);
            (y[Y], y[DY]) = row(3).both(h);
            y[index::AZIMUTH] = row(4).value(h);
        }
        if has_time(N) {
            y[N - 1] = row(rows(N) - 1).value(h);
        }
        y
    }

    #[inline(always)]
    fn start<const N: usize>(&mut self, y: &[T; N]) {
        use index::{DU, DW, DX, DY, U, W, X, Y};
        (self.rows[0][0], self.rows[0][1]) = (y[W], y[DW]);
        (self.rows[1][0], self.rows[1][1]) = (y[U], y[DU]);
        if has_azimuth(N) {
            (self.rows[2][0], self.rows[2][1]) = (y[X], y[DX]);
            (self.rows[3][0], self.rows[3][1]) = (y[Y], y[DY]);
            self.rows[4][0] = y[index::AZIMUTH];
        }
        if has_time(N) {
            self.rows[rows(N) - 1][0] = y[N - 1];
        }
    }

    /// Coefficient k of w² and u².
    #[inline(always)]
    fn squares(&mut self, k: usize) {
        let (w, u) = (&self.rows[0][..=k], &self.rows[1][..=k]);
        let (mut w2, mut u2) = (T::constant(0.0), T::constant(0.0));
        for ((w, w_back), (u, u_back)) in
            w.iter().zip(w.iter().rev()).zip(u.iter().zip(u.iter().rev()))
        {
            w2 = w2 + *w * *w_back;
            u2 = u2 + *u * *u_back;
        }
        (self.w2[k], self.u2[k]) = (w2, u2);
    }

    /// Coefficient k of all products, from which the next coefficient of every row follows.
    #[inline(always)]
    fn advance<const N: usize>(&mut self, system: &System<T>, k: usize) {
        let zero = T::constant(0.0);
        let (mut w3, mut u3, mut xu2, mut yu2) = (zero, zero, zero, zero);
        let [w, u, x, y] = [0, 1, 2, 3].map(|row| self.rows[row][..=k].iter());
        let squares = self.w2[..=k].iter().rev().zip(self.u2[..=k].iter().rev());
        if has_azimuth(N) {
            for (((w, u), (x, y)), (w2, u2)) in w.zip(u).zip(x.zip(y)).zip(squares) {
                w3 = w3 + *w * *w2;
                u3 = u3 + *u * *u2;
                xu2 = xu2 + *x * *u2;
                yu2 = yu2 + *y * *u2;
            }
        } else {
            for ((w, u), (w2, u2)) in w.zip(u).zip(squares) {
                w3 = w3 + *w * *w2;
                u3 = u3 + *u * *u2;
            }
        }
        let second = T::constant(1.0) / T::constant(((k + 1) * (k + 2)) as f64);
        let [linear, square, cubic] = system.radial();
        self.rows[0][k + 2] =
            second * (linear * self.rows[0][k] + square * self.w2[k] + cubic * w3);
        let (angular, spin2) = system.polar();
        let twice = spin2 + spin2;
        self.rows[1][k + 2] = second * ((spin2 - angular) * self.rows[1][k] - twice * u3);
        if has_azimuth(N) {
            self.rows[2][k + 2] = -(second * (angular * self.rows[2][k] + twice * xu2));
            self.rows[3][k + 2] = -(second * (angular * self.rows[3][k] + twice * yu2));
        }
        if has_azimuth(N) || has_time(N) {
            self.quadratures::<N>(system, k);
        }
    }

    /// Coefficient k + 1 of I_φ and I_t from coefficient k of w²/g and (1 + a²w²)/g.
    #[inline(always)]
    fn quadratures<const N: usize>(&mut self, system: &System<T>, k: usize) {
        let inv = T::constant(1.0) / self.g[0];
        let per_next = T::constant(1.0) / T::constant((k + 1) as f64);
        let zero = T::constant(0.0);
        let (mut azimuth, mut time) = (self.w2[k], zero);
        let [half, a2, frame, tilt] = system.time();
        time = time + a2 * self.w2[k];
        if k == 0 {
            time = time + T::constant(1.0);
        }
        let g = self.g[1..=k].iter().rev();
        for ((w2, lift), g) in self.w2_over_g.iter().zip(&self.time_over_g).zip(g) {
            azimuth = azimuth - *w2 * *g;
            time = time - *lift * *g;
        }
        if has_azimuth(N) {
            self.w2_over_g[k] = azimuth * inv;
            let [constant, factor] = system.azimuth();
            let constant = if k == 0 { constant } else { zero };
            self.rows[4][k + 1] = per_next * (constant - factor * self.w2_over_g[k]);
        }
        if has_time(N) {
            self.time_over_g[k] = time * inv;
            let frame = if k == 0 { frame } else { zero };
            self.rows[rows(N) - 1][k + 1] =
                per_next * (half * self.time_over_g[k] + frame + tilt * self.u2[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Double, Inclination, Kerr, Observer};

    /// The first coefficients are the right-hand side; a short step of the series, taken
    /// back by the series about its end, returns to the start.
    #[test]
    fn exact_first_coefficients_and_return() {
        let hole = Kerr::from_spin(Double::from(0.9)).unwrap();
        let inclination = Inclination::from_radians(Double::from(1.1)).unwrap();
        let observer = Observer::at_radius(inclination, 12.0).unwrap();
        let ray = observer.ray(&hole, Double::from(-4.0), Double::from(3.0)).unwrap();
        let system = System::new(&hole, &ray);
        let leg = Double::from(1.0);
        let start: [Double; 10] = system.start(&ray, 1.0);
        let slope = system.derivative(&start, leg);
        let mut series = Series::new();
        series.expand(&system, &start, leg, 40);
        for (row, k) in
            [index::W, index::U, index::X, index::Y, index::AZIMUTH, 9].iter().enumerate()
        {
            assert_eq!(series.rows[row][0], start[*k]);
            assert!((series.rows[row][1] - slope[*k]).hi.abs() < 1e-30);
        }
        let h = Double::from(0.2);
        let end: [Double; 10] = series.state(h, 40);
        series.expand(&system, &end, leg, 40);
        let back: [Double; 10] = series.state(-h, 40);
        for (back, start) in back.iter().zip(start) {
            assert!((*back - start).hi.abs() < 1e-29);
        }
    }
}
