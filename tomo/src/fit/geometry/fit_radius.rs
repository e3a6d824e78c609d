//! Chooses the radius of the quadratic form about the best geometry: until values have risen clearly above the ripples.

use super::gauss_newton::Polished;
use super::problem::GeometryProblem;
use super::quadratic_form::{Evaluations, Form, along};
use crate::Error;
use kerrlight_common::simd::Float;
use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen, Vector3};

/// Rise up to which values along each axis are taken, in units of −ln of the density.
const RISE: f64 = 8.0;
/// And by so many ripples.
const CLEAR: f64 = 2.5;
/// Number of times a step is doubled that does not rise so far, at most and, as a parabola through three values leaves
/// nothing, at least.
const DOUBLINGS: usize = 6;
const FEWEST: usize = 1;

/// Values along a principal axis of the errors that the data alone leave.
struct Axis {
    /// One standard deviation, in units of scales.
    step: DVector<f64>,
    /// Steps away from the best geometry and what the value has risen by.
    risen: Vec<(f64, f64)>,
    doublings: usize,
}

/// A parabola through them.
struct Parabola {
    /// Per step, and per step and step.
    slope: f64,
    bend: f64,
    /// Sum of squares of what it leaves, and how many values more than coefficients there are.
    left: (f64, usize),
}

/// Radius of the quadratic form.
pub(super) struct Reach {
    /// Places are these columns times ξ with |ξ| ≤ 1, in units of scales.
    pub columns: DMatrix<f64>,
    /// True if ripples asked for a longer way than errors of the data.
    pub is_wide: bool,
    value: f64,
    ripple: f64,
    axes: Vec<Axis>,
}

impl Axis {
    fn far(&self) -> f64 {
        (self.doublings as f64).exp2()
    }

    /// Returns whether there is more to see: not where bounds end both ways.
    fn goes_on(&self) -> bool {
        let far = 0.99 * self.far();
        self.doublings < DOUBLINGS && self.risen.iter().any(|(t, _)| t.abs() > far)
    }

    /// Fits a parabola through the best geometry, whose own ripple counts as those of the others.
    fn parabola(&self) -> Parabola {
        let all = || self.risen.iter().copied().chain([(0.0, 0.0)]);
        let row = |t: f64| Vector3::new(1.0, t, 0.5 * t * t);
        let normal: Matrix3<f64> = all().map(|(t, _)| row(t) * row(t).transpose()).sum();
        let right: Vector3<f64> = all().map(|(t, rise)| row(t) * rise).sum();
        // Bounds may leave fewer than three places: a flat parabola keeps such an axis open.
        let found = normal.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * right);
        let square = |(t, rise): (f64, f64)| (rise - row(t).dot(&found)).powi(2);
        let more = (self.risen.len() + 1).saturating_sub(3);
        Parabola { slope: found[1], bend: found[2], left: (all().map(square).sum(), more) }
    }

    /// Returns the rise of the parabola where values end.
    fn rise(&self) -> f64 {
        0.5 * self.parabola().bend * self.far().powi(2)
    }
}

/// Standard deviation of the ripples along some axes.
fn ripple(axes: &[Axis]) -> f64 {
    let left = axes.iter().map(|axis| axis.parabola().left);
    let (squares, more) = left.fold((0.0, 0), |(a, b), (c, d)| (a + c, b + d));
    (squares / (more.max(1) as f64)).sqrt()
}

impl Reach {
    /// The values that were looked at.
    pub fn seen(&self) -> Evaluations {
        let mut seen = Evaluations::default();
        for (k, axis) in self.axes.iter().enumerate() {
            for (t, rise) in &axis.risen {
                seen.places.push(along(self.axes.len(), k, t / axis.far()));
                seen.values.push(self.value + rise);
            }
        }
        seen
    }

    /// Returns the form from the axes alone; those along which values do not rise are open.
    pub fn form(&self) -> Form {
        let n = self.axes.len();
        let of = |k: usize| (self.axes[k].parabola(), self.axes[k].far());
        let slope = |k: usize, _| of(k).0.slope * of(k).1;
        // Above 0, so that the form has an inverse; the prior then bounds an axis without a rise.
        let rise = |k: usize| (of(k).0.bend * of(k).1.powi(2)).max(1e-6);
        Form {
            slopes: vec![DVector::from_fn(n, slope)],
            bends: DMatrix::from_fn(n, n, |a, b| if a == b { rise(a) } else { 0.0 }),
            // Of a slope through the two ends and the middles between: Σ ξ² = 2 (1 + ¼).
            uncertain: DMatrix::from_diagonal_element(n, n, self.ripple.powi(2) / 2.5),
            ripple: self.ripple,
        }
    }
}

impl<T: Float> GeometryProblem<'_, T> {
    /// Looks along the principal axes of a covariance, farther along those whose rise the ripples hide: these are alike at
    /// neighbouring places, and move the middle of what is seen by more than they seem to. None if the covariance is not
    /// finite.
    pub(super) fn reach(&self, polished: &Polished) -> Result<Option<Reach>, Error> {
        let Some(mut axes) = self.principal(polished) else { return Ok(None) };
        for axis in &mut axes {
            self.step(polished, axis)?;
            // As far as errors of the data ask for; ripples may ask for more once all are known.
            while axis.doublings < FEWEST || axis.rise() < RISE && axis.goes_on() {
                self.double(polished, axis)?;
            }
        }
        let mut is_wide = false;
        loop {
            let enough = CLEAR * ripple(&axes);
            let hidden = |axis: &&mut Axis| axis.rise() < enough && axis.goes_on();
            // Each new value changes the ripples of all: the axis followed least far goes first.
            let Some(axis) = axes.iter_mut().filter(hidden).min_by_key(|axis| axis.doublings)
            else {
                break;
            };
            self.double(polished, axis)?;
            is_wide = true;
        }
        let columns: Vec<DVector<f64>> = axes.iter().map(|axis| &axis.step * axis.far()).collect();
        let columns = DMatrix::from_columns(&columns);
        let (value, ripple) = (polished.best.value, ripple(&axes));
        Ok(Some(Reach { columns, is_wide, value, ripple, axes }))
    }

    fn principal(&self, polished: &Polished) -> Option<Vec<Axis>> {
        let n = self.free.len();
        // Principal axes depend on units: in those of scales parameters change images alike.
        let scale = |k: usize| self.free[k].parameter.scale();
        let of = |a: usize, b: usize| polished.covariance[a * n + b] / (scale(a) * scale(b));
        let covariance = DMatrix::from_fn(n, n, of);
        if covariance.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(covariance);
        let axis = |k: usize| {
            let step = eigenvectors.column(k) * eigenvalues[k].max(0.0).sqrt();
            Axis { step, risen: Vec::new(), doublings: 0 }
        };
        Some((0..n).map(axis).collect())
    }

    fn double(&self, polished: &Polished, axis: &mut Axis) -> Result<(), Error> {
        axis.doublings += 1;
        self.step(polished, axis)
    }

    /// Looks at both ends of an axis; where a bound is in between, there.
    fn step(&self, polished: &Polished, axis: &mut Axis) -> Result<(), Error> {
        let (best, far) = (&polished.best, axis.far());
        for t in [-far, far] {
            if let Some((there, part)) =
                self.beside(best, &polished.responses, &(&axis.step * t))?
            {
                axis.risen.push((part * t, there.value - best.value));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(doublings: usize, value: impl Fn(f64) -> f64) -> Axis {
        let ends = (0..=doublings).map(|k| (k as f64).exp2());
        let risen = ends.flat_map(|far| [-far, far].map(|t| (t, value(t) - value(0.0)))).collect();
        Axis { step: DVector::from_element(1, 1.0), risen, doublings }
    }

    #[test]
    fn exact_parabolas_and_what_they_leave() {
        let plain = axis(2, |t| 3.0 + 0.4 * t + 0.5 * 1.6 * t * t);
        let Parabola { slope, bend, left } = plain.parabola();
        assert!((slope - 0.4).abs() < 1e-12 && (bend - 1.6).abs() < 1e-12);
        assert!(left.0 < 1e-20 && left.1 == 4);
        assert!((plain.rise() - 0.5 * 1.6 * 16.0).abs() < 1e-9);
        // A step beside the middle, which no parabola follows.
        let rippled = axis(2, |t| 0.5 * 1.6 * t * t + if t == 0.0 { 0.0 } else { 0.6 });
        assert!(ripple(&[plain]) < 1e-10);
        let cubic = axis(2, |t| 0.5 * 1.6 * t * t + 0.05 * t.powi(3));
        assert!(ripple(&[cubic]) > 0.05 && (rippled.rise() - 12.8).abs() < 2.0);
    }

    #[test]
    fn exact_an_axis_ends_where_bounds_hold_both_sides() {
        let mut held = axis(1, |t| t * t);
        assert!(held.goes_on());
        held.risen = vec![(-0.4, 0.1), (0.3, 0.2)];
        assert!(!held.goes_on());
    }
}
