//! From a point of the lattice down to the minimum beside it.

use super::{AxisLoss, Effort, Scanner};
use crate::dynamics::Axis;
use crate::simd::Scalar;
use kerrlight_geodesic::OutOfRange;

/// A pattern search: six directions about the best one so far, half as far away when none is better.
pub(super) struct Refinement<'a, 's, T: Scalar> {
    pub scanner: &'a Scanner<'s, T>,
    pub effort: Effort,
    pub halvings: usize,
}

/// Steps of one length.
const MOVES: usize = 6;

impl<T: Scalar + Default> Refinement<'_, '_, T> {
    /// None if the scan was cancelled.
    pub fn run(&self, from: Axis, step: f64) -> Result<Option<AxisLoss>, OutOfRange> {
        let Some(losses) = self.scanner.losses(&[from], self.effort)? else { return Ok(None) };
        let mut best = losses[0];
        let mut step = step;
        for level in 0..=self.halvings {
            for _ in 0..MOVES {
                let about = around(best.axis, step, level);
                let Some(losses) = self.scanner.losses(&about, self.effort)? else {
                    return Ok(None);
                };
                let least = losses.into_iter().min_by(|a, b| a.loss.total_cmp(&b.loss));
                match least.filter(|least| least.loss < best.loss) {
                    Some(least) => best = least,
                    None => break,
                }
            }
            step *= 0.5;
        }
        Ok(Some(best))
    }
}

/// Six directions at an angle from an axis; every other level half a turn of the hexagon further.
fn around(axis: Axis, angle: f64, level: usize) -> Vec<Axis> {
    let n = axis.vector();
    let least = (0..3).fold(0, |k, c| if n[c].abs() < n[k].abs() { c } else { k });
    let mut unit = [0.0; 3];
    unit[least] = 1.0;
    let east = Axis::new(axis.tangent(unit)).unwrap_or(axis).vector();
    let north = [
        n[1] * east[2] - n[2] * east[1],
        n[2] * east[0] - n[0] * east[2],
        n[0] * east[1] - n[1] * east[0],
    ];
    let direction = |k: usize| {
        let turn = core::f64::consts::PI * (2 * k + level % 2) as f64 / 6.0;
        let (sin, cos) = turn.sin_cos();
        let along = angle.tan();
        axis.moved(core::array::from_fn(|c| along * (cos * east[c] + sin * north[c])))
    };
    (0..6).map(direction).collect()
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
}
