//! Velocities between knots: monotone cubics.

use super::trajectory::{Along, Point, Trajectory, Way};
use crate::Error;
use kerrlight_geodesic::Elementary;

/// Inside of any horizon, M.
const INNERMOST: f64 = 0.5;

/// Ω(r) and dr/dt between knots, held beyond the first and the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    radii: Vec<f64>,
    /// Values and slopes at the knots.
    angular: [Vec<f64>; 2],
    radial: [Vec<f64>; 2],
}

impl Profile {
    /// Interpolates these values: monotone cubics (Fritsch & Butland 1984), which have no extrema but those of the
    /// knots and are flat at both ends.
    ///
    /// # Errors
    /// If radii do not grow from above 0, columns are not as long as they are, or radial velocities (dr/dt) are neither
    /// all below 0 nor all above 0 nor all 0.
    pub fn new(radii: Vec<f64>, angular: Vec<f64>, radial: Vec<f64>) -> Result<Self, Error> {
        let range = |field, value, allowed| Err(Error::out_of_range(field, value, allowed));
        let count = radii.len();
        if count < 2 || angular.len() != count || radial.len() != count {
            return range("radii", count as f64, "2 or more, and as many angular and radial ones");
        }
        let grows = |pair: &&[f64]| !(pair[0] > 0.0 && pair[1] > pair[0] && pair[1].is_finite());
        if let Some(pair) = radii.windows(2).find(grows) {
            return range("radii", pair[1], "above 0, growing");
        }
        if let Some(bad) = angular.iter().find(|rate| !rate.is_finite()) {
            return range("angular", *bad, "a finite number");
        }
        let sign = |v: f64| i8::from(v > 0.0) - i8::from(v < 0.0);
        let differs = |v: &&f64| !v.is_finite() || sign(**v) != sign(radial[0]);
        if let Some(bad) = radial.iter().find(differs) {
            return range("radial", *bad, "all below 0, all above 0, or all 0");
        }
        let slopes = |values: &[f64]| monotone_slopes(&radii, values);
        let (of_angular, of_radial) = (slopes(&angular), slopes(&radial));
        Ok(Self { radii, angular: [angular, of_angular], radial: [radial, of_radial] })
    }

    /// Returns whether matter changes its radius.
    pub fn falls(&self) -> bool {
        self.radial[0].iter().any(|v| *v != 0.0)
    }

    /// dr/dt (dimensionless) and Ω (radians per M) at radius r (M).
    pub fn rates<N: Elementary>(&self, r: N) -> [N; 2] {
        let last = self.radii.len() - 1;
        let constant = |k: usize| [self.radial[0][k], self.angular[0][k]].map(N::constant);
        if r.value() <= self.radii[0] {
            return constant(0);
        }
        if r.value() >= self.radii[last] {
            return constant(last);
        }
        let k = self.radii.partition_point(|x| *x <= r.value()) - 1;
        [&self.radial, &self.angular].map(|columns| self.cubic(columns, k, r))
    }

    fn cubic<N: Elementary>(&self, [values, slopes]: &[Vec<f64>; 2], k: usize, r: N) -> N {
        let (width, s) = (self.radii[k + 1] - self.radii[k], N::constant);
        let part = (r - s(self.radii[k])) / s(width);
        let (rise, v0, v1) = (values[k + 1] - values[k], width * slopes[k], width * slopes[k + 1]);
        let [c, d] = [3.0 * rise - 2.0 * v0 - v1, v0 + v1 - 2.0 * rise];
        s(values[k]) + part * (s(v0) + part * (s(c) + part * s(d)))
    }

    /// The fall from the farthest radius to inside of any horizon, or the rise from there.
    pub fn trajectory(&self) -> Trajectory {
        let at = move |r: Along| -> Point<Along> {
            let [fall, turn] = self.rates(r);
            [r, fall, turn]
        };
        let inner = INNERMOST.min(0.5 * self.radii[0]);
        let knots = self.radii.iter().copied();
        let ends: Vec<f64> =
            core::iter::once(inner).chain(knots).chain([super::FARTHEST]).collect();
        let falls = self.radial[0][0] < 0.0;
        let mut ways: Vec<Way<'_>> = ends
            .windows(2)
            .map(|pair| {
                let mut marks = super::geometric(pair[0], pair[1]);
                if falls {
                    marks.reverse();
                }
                Way { marks, at: Box::new(at), rough: false }
            })
            .collect();
        if falls {
            ways.reverse();
        }
        // Times count from the middle: next to it they are short, and so exact.
        Trajectory::new(&ways, ways.len() / 2)
    }
}

/// Slopes at knots: weighted harmonic means of those of both sides, 0 at extrema and at both ends, beyond
/// which values are held.
fn monotone_slopes(radii: &[f64], values: &[f64]) -> Vec<f64> {
    let width = |k: usize| radii[k + 1] - radii[k];
    let secant = |k: usize| (values[k + 1] - values[k]) / width(k);
    let last = radii.len() - 1;
    let inner = |k: usize| {
        let (left, right) = (secant(k - 1), secant(k));
        if left * right <= 0.0 {
            return 0.0;
        }
        let (a, b) = (2.0 * width(k) + width(k - 1), width(k) + 2.0 * width(k - 1));
        (a + b) / (a / left + b / right)
    };
    let slope = |k: usize| if k == 0 || k == last { 0.0 } else { inner(k) };
    (0..=last).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_straight_lines_and_no_new_extrema() {
        let radii = vec![3.0, 4.0, 7.0, 9.0, 20.0];
        let straight = |f: fn(f64) -> f64| radii.iter().map(|r| f(*r)).collect::<Vec<f64>>();
        let lines =
            Profile::new(radii.clone(), straight(|r| 0.1 - 0.003 * r), straight(|r| -0.01 * r));
        let [fall, turn] = lines.unwrap().rates(5.3);
        assert!((turn - (0.1 - 0.0159)).abs() < 1e-15 && (fall + 0.053).abs() < 1e-15);
        let steps = Profile::new(radii, vec![0.1, 0.1, 0.5, 0.5, 0.2], vec![0.0; 5]).unwrap();
        for k in 0..400 {
            let [_, turn] = steps.rates(2.0 + 0.05 * f64::from(k));
            assert!((0.1..=0.5).contains(&turn), "{turn}");
        }
        assert!(!steps.falls());
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let text = |radii: &[f64], radial: &[f64]| {
            let angular = vec![0.1; radii.len()];
            Profile::new(radii.to_vec(), angular, radial.to_vec()).unwrap_err().to_string()
        };
        assert!(text(&[3.0, 2.0], &[-0.1, -0.1]).contains("radii = 2 "));
        assert!(text(&[3.0, 4.0], &[-0.1, 0.1]).contains("radial = 0.1 "));
        assert!(text(&[3.0, 4.0], &[-0.1]).contains("as many"));
    }
}
