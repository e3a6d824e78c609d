//! Descent from a point of the lattice to the minimum beside it.

use super::{AxisLoss, Effort, Scanner};
use crate::Error;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;

/// Steps of one length.
const MOVES: usize = 6;

impl<T: Float> Scanner<'_, T> {
    /// A pattern search: six directions about the best one so far, half as far away when none is better; at the end
    /// the lowest point of the paraboloid through the last seven. None if the scan was cancelled.
    pub(super) fn refined(
        &self,
        from: Axis,
        mut step: f64,
        effort: Effort,
        halvings: usize,
    ) -> Result<Option<AxisLoss>, Error> {
        let Some(losses) = self.losses(&[from], effort)? else { return Ok(None) };
        let mut best = losses[0];
        let mut lowest = None;
        for level in 0..=halvings {
            for _ in 0..MOVES {
                let about = around(best.axis, step, level);
                let Some(losses) = self.losses(&about, effort)? else { return Ok(None) };
                let differences: Vec<f64> = losses.iter().map(|at| at.loss - best.loss).collect();
                // Axes move on the tangent plane, where the corners are tan(step) away.
                lowest =
                    minimum(&differences, step.tan(), level).map(|along| moved(best.axis, along));
                let least = losses.into_iter().min_by(|a, b| a.loss.total_cmp(&b.loss));
                match least.filter(|least| least.loss < best.loss) {
                    Some(least) => best = least,
                    None => break,
                }
            }
            step *= 0.5;
        }
        let Some(lowest) = lowest else { return Ok(Some(best)) };
        // The paraboloid is a guess, which counts only if the loss there is less.
        let losses = self.losses(&[lowest], effort)?;
        Ok(losses.map(|losses| if losses[0].loss < best.loss { losses[0] } else { best }))
    }
}

/// Directions of the hexagon of a level: every other one is turned by half a side.
fn turn(k: usize, level: usize) -> f64 {
    // Steps of one length and the next then look along twelve directions in place of six.
    core::f64::consts::PI * (2 * k + level % 2) as f64 / 6.0
}

/// Six directions at an angle from an axis.
fn around(axis: Axis, angle: f64, level: usize) -> Vec<Axis> {
    let along = angle.tan();
    let direction = |k: usize| {
        let (sin, cos) = turn(k, level).sin_cos();
        moved(axis, [along * cos, along * sin])
    };
    (0..6).map(direction).collect()
}

/// An axis moved on its tangent plane.
fn moved(axis: Axis, [x, y]: [f64; 2]) -> Axis {
    let [_, east, north] = axis.basis();
    axis.moved(core::array::from_fn(|c| x * east[c] + y * north[c]))
}

/// Returns the minimum of g·u + u·H·u/2, which has these values at the corners of a hexagon of radius `radius`;
/// nothing if it has none inside.
fn minimum(values: &[f64], radius: f64, level: usize) -> Option<[f64; 2]> {
    // Modes 0, 1 and 2 of the six values around the hexagon: a paraboloid has no others.
    let (mut slope, mut mean, mut across) = ([0.0; 2], 0.0, [0.0; 2]);
    for (k, value) in values.iter().enumerate() {
        let (sin, cos) = turn(k, level).sin_cos();
        let (sin_2, cos_2) = (2.0 * turn(k, level)).sin_cos();
        slope = [slope[0] + value * cos / 3.0, slope[1] + value * sin / 3.0];
        mean += value / 6.0;
        across = [across[0] + value * cos_2 / 3.0, across[1] + value * sin_2 / 3.0];
    }
    let g = slope.map(|x| x / radius);
    // u·H·u/2 = r²/2 [(Hxx + Hyy)/2 + (Hxx − Hyy)/2 cos 2φ + Hxy sin 2φ].
    let [mean, difference, mixed] =
        [mean, across[0], across[1]].map(|x| 2.0 * x / (radius * radius));
    let (xx, yy) = (mean + difference, mean - difference);
    let determinant = xx * yy - mixed * mixed;
    let at = [(mixed * g[1] - yy * g[0]) / determinant, (mixed * g[0] - xx * g[1]) / determinant];
    (xx > 0.0 && determinant > 0.0 && at[0].hypot(at[1]) < radius).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_hexagons_lie_at_their_angle() {
        for vector in [[0.0, 0.0, 1.0], [0.3, -0.8, 0.1], [-1.0, 0.0, 0.0]] {
            let axis = Axis::new(vector).unwrap();
            let about = around(axis, 0.2, 1);
            for k in 0..6 {
                assert!((about[k].dot(axis) - 0.2f64.cos()).abs() < 1e-14);
                let side = about[k].dot(about[(k + 1) % 6]).acos();
                let expected = 0.2f64.cos().powi(2) + 0.5 * 0.2f64.sin().powi(2);
                assert!((side.cos() - expected).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn exact_lowest_point_of_a_paraboloid() {
        let (h, lowest) = ([3.0, -0.7, 1.5], [0.021, -0.013]);
        let value = |u: [f64; 2]| {
            let d = [u[0] - lowest[0], u[1] - lowest[1]];
            0.5 * (h[0] * d[0] * d[0] + 2.0 * h[1] * d[0] * d[1] + h[2] * d[1] * d[1])
        };
        for level in [0, 1] {
            let corner = |k: usize| {
                let (sin, cos) = turn(k, level).sin_cos();
                value([0.1 * cos, 0.1 * sin]) - value([0.0; 2])
            };
            let values: Vec<f64> = (0..6).map(corner).collect();
            let found = minimum(&values, 0.1, level).unwrap();
            assert!((found[0] - lowest[0]).abs() < 1e-14 && (found[1] - lowest[1]).abs() < 1e-14);
            let saddle: Vec<f64> = values.iter().map(|v| -v).collect();
            assert_eq!(minimum(&saddle, 0.1, level), None);
            assert_eq!(minimum(&values, 0.02, level).filter(|u| u[0].hypot(u[1]) > 0.02), None);
        }
    }
}
