//! What is thought about an emission field beside the data: penalties on values at the nodes of a
//! regular grid. None is used unless it is asked for.
//!
//! Every penalty is an integral over the volume (a sum over nodes times the volume of a cell), so that a weight means
//! the same on a finer grid.

use crate::simd::Scalar;
use kerrlight_geodesic::OutOfRange;
use rayon::prelude::*;

/// Nodes of a regular grid, z fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Nodes along x, y and z.
    pub nodes: [usize; 3],
    /// Distances between nodes, M.
    pub spacing: [f64; 3],
}

/// A penalty on a field e(x).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regulariser {
    /// ∫ (√(|∇e|² + ε²) − ε) dV with forward differences: total variation (Rudin, Osher & Fatemi 1992), smoothed
    /// where slopes are below ε.
    TotalVariation {
        /// ε, emission per M.
        epsilon: f64,
    },
    /// ∫ |∇e|² dV with forward differences.
    Smoothness,
    /// ∫ |e| dV; its slope at 0 is that of positive e.
    Sparsity,
    /// ∫ (e ln(e/m) − e + m) dV: entropy relative to a prior level m (Skilling 1989), 0 where e = m.
    /// Below `floor` · m it goes on as the parabola that touches it there, also for negative e.
    Entropy {
        /// m, above 0.
        level: f64,
        /// Above 0, at most 1.
        floor: f64,
    },
}

impl Shape {
    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Volume of a cell, M³.
    pub fn cell(&self) -> f64 {
        self.spacing.iter().product()
    }
}

impl Regulariser {
    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, OutOfRange> {
        let positive = |field, value: f64, most: f64, allowed| {
            let ok = value > 0.0 && value.is_finite() && value <= most;
            if ok { Ok(()) } else { Err(OutOfRange { field, value, allowed }) }
        };
        match self {
            Self::TotalVariation { epsilon } => {
                positive("total variation epsilon", epsilon, f64::MAX, "above 0")?;
            }
            Self::Entropy { level, floor } => {
                positive("entropy level", level, f64::MAX, "above 0")?;
                positive("entropy floor", floor, 1.0, "above 0, at most 1")?;
            }
            Self::Smoothness | Self::Sparsity => {}
        }
        Ok(self)
    }

    /// Whether it is quadratic, or linear, in fields that are nowhere negative.
    pub fn is_quadratic(&self) -> bool {
        matches!(self, Self::Smoothness | Self::Sparsity)
    }

    /// `weight` times the penalty; adds its gradient. By all threads, in an order that does not depend on
    /// their number.
    ///
    /// # Panics
    /// If the lengths are not that of the shape.
    pub fn value_and_gradient<T: Scalar>(
        &self,
        values: &[T],
        shape: Shape,
        weight: f64,
        gradient: &mut [T],
    ) -> f64 {
        assert!(values.len() == shape.count() && gradient.len() == values.len());
        let scale = weight * shape.cell();
        let plane = shape.nodes[1] * shape.nodes[2];
        let of_plane = |(i, out): (usize, &mut [T])| match self {
            Self::TotalVariation { epsilon } => {
                let slope = |square: f64| (square + epsilon * epsilon).sqrt();
                let norm = |square| (slope(square) - epsilon, 1.0 / slope(square));
                Differences { values, shape, norm }.plane(i, scale, out)
            }
            Self::Smoothness => {
                Differences { values, shape, norm: |square| (square, 2.0) }.plane(i, scale, out)
            }
            Self::Sparsity => each(&values[i * plane..], scale, out, |e| (e.abs(), sign(e))),
            Self::Entropy { level, floor } => {
                each(&values[i * plane..], scale, out, |e| entropy(e, *level, floor * level))
            }
        };
        let sums: Vec<f64> = gradient.par_chunks_mut(plane).enumerate().map(of_plane).collect();
        scale * sums.iter().sum::<f64>()
    }
}

fn sign(e: f64) -> f64 {
    if e < 0.0 { -1.0 } else { 1.0 }
}

/// e ln(e/m) − e + m and its slope.
fn entropy(e: f64, m: f64, floor: f64) -> (f64, f64) {
    let of = |e: f64| (e * (e / m).ln() - e + m, (e / m).ln());
    if e >= floor {
        return of(e);
    }
    let ((value, slope), below) = (of(floor), e - floor);
    (value + below * (slope + 0.5 * below / floor), slope + below / floor)
}

/// Sum of a function of each value; adds its slopes.
fn each<T: Scalar>(values: &[T], scale: f64, out: &mut [T], f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let nodes = values.iter().zip(out);
    let one = |(e, out): (&T, &mut T)| {
        let (value, slope) = f(e.double());
        *out += T::of(scale * slope);
        value
    };
    nodes.map(one).sum()
}

/// A function of the squared slope at each node: its value and twice its derivative.
struct Differences<'a, T, F> {
    values: &'a [T],
    shape: Shape,
    norm: F,
}

impl<T: Scalar, F: Fn(f64) -> (f64, f64)> Differences<'_, T, F> {
    /// Forward differences at a node along each axis, 0 beyond the last one.
    #[inline]
    fn slopes(&self, at: [usize; 3], index: usize) -> [f64; 3] {
        let [nx, ny, nz] = self.shape.nodes;
        let here = self.values[index].double();
        let slope = |c: usize, n: usize, stride: usize| {
            if at[c] + 1 < n {
                (self.values[index + stride].double() - here) / self.shape.spacing[c]
            } else {
                0.0
            }
        };
        [slope(0, nx, ny * nz), slope(1, ny, nz), slope(2, nz, 1)]
    }

    /// The value at a node, and the flux F'∇e through each of its forward faces.
    #[inline]
    fn flux(&self, at: [usize; 3], index: usize) -> (f64, [f64; 3]) {
        let slopes = self.slopes(at, index);
        let (value, factor) = (self.norm)(slopes.iter().map(|s| s * s).sum());
        (value, slopes.map(|slope| factor * slope))
    }

    /// Sum over a plane of nodes; the gradient is minus the divergence of the flux. Every node looks at
    /// those behind it, so that planes can be done in any order.
    fn plane(&self, i: usize, scale: f64, out: &mut [T]) -> f64 {
        let [_, ny, nz] = self.shape.nodes;
        let strides = [ny * nz, nz, 1];
        let mut sum = 0.0;
        for (k, out) in out.iter_mut().enumerate() {
            let (at, index) = ([i, k / nz, k % nz], i * ny * nz + k);
            let (value, flux) = self.flux(at, index);
            let mut divergence = 0.0;
            for c in 0..3 {
                let mut through = flux[c];
                if at[c] > 0 {
                    let mut behind = at;
                    behind[c] -= 1;
                    through -= self.flux(behind, index - strides[c]).1[c];
                }
                divergence += through / self.shape.spacing[c];
            }
            *out -= T::of(scale * divergence);
            sum += value;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const SHAPE: Shape = Shape { nodes: [5, 4, 6], spacing: [0.5, 0.25, 0.75] };
    const ALL: [Regulariser; 4] = [
        Regulariser::TotalVariation { epsilon: 0.3 },
        Regulariser::Smoothness,
        Regulariser::Sparsity,
        Regulariser::Entropy { level: 0.4, floor: 0.5 },
    ];

    fn random(seed: u64) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(seed);
        (0..SHAPE.count()).map(|_| random.random::<f64>() + 0.05).collect()
    }

    #[test]
    fn exact_gradients_are_central_differences() {
        let (values, along) = (random(1), random(2));
        for regulariser in ALL {
            let at = |step: f64| -> f64 {
                let moved: Vec<f64> =
                    values.iter().zip(&along).map(|(x, d)| x + step * d).collect();
                regulariser.value_and_gradient(&moved, SHAPE, 1.7, &mut vec![0.0; moved.len()])
            };
            let mut gradient = vec![0.0; values.len()];
            regulariser.value_and_gradient(&values, SHAPE, 1.7, &mut gradient);
            let slope: f64 = gradient.iter().zip(&along).map(|(g, d)| g * d).sum();
            let step = 1e-5;
            let difference = (at(step) - at(-step)) / (2.0 * step);
            let error = (slope - difference).abs() / slope.abs();
            assert!(error < 1e-7, "{regulariser:?}: {slope} {difference}");
        }
    }

    /// A field that rises by a along x has |∇e| = |a| but on the last plane.
    #[test]
    fn exact_values_of_a_ramp() {
        let a = 0.7;
        let ramp: Vec<f64> = (0..SHAPE.count()).map(|k| a * 0.5 * (k / 24) as f64 + 1.0).collect();
        let (weight, sloped) = (2.0, 4.0 * 24.0 * SHAPE.cell());
        let value = |regulariser: Regulariser| {
            regulariser.value_and_gradient(&ramp, SHAPE, weight, &mut vec![0.0; ramp.len()])
        };
        let tv = value(Regulariser::TotalVariation { epsilon: 0.3 });
        assert!((tv - weight * sloped * (a.hypot(0.3) - 0.3)).abs() < 1e-12);
        assert!((value(Regulariser::Smoothness) - weight * sloped * a * a).abs() < 1e-12);
        let sum: f64 = ramp.iter().sum();
        assert!((value(Regulariser::Sparsity) - weight * sum * SHAPE.cell()).abs() < 1e-10);
        let flat = vec![0.4f64; ramp.len()];
        let mut gradient = vec![0.0f64; flat.len()];
        let none = ALL[3].value_and_gradient(&flat, SHAPE, weight, &mut gradient);
        assert!(none.abs() < 1e-12 && gradient.iter().all(|g| g.abs() < 1e-12));
    }

    #[test]
    fn exact_threads_change_no_bit() {
        let values: Vec<f32> = random(3).iter().map(|x| *x as f32).collect();
        let run = |threads, regulariser: Regulariser| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut gradient = vec![0.0f32; values.len()];
            let out = &mut gradient;
            let value = pool.install(|| regulariser.value_and_gradient(&values, SHAPE, 0.3, out));
            (value, gradient)
        };
        for regulariser in ALL {
            assert_eq!(run(1, regulariser), run(5, regulariser));
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let text = |r: Regulariser| r.checked().unwrap_err().to_string();
        assert!(text(Regulariser::TotalVariation { epsilon: 0.0 }).contains("epsilon = 0 "));
        let bad = Regulariser::Entropy { level: 1.0, floor: 1.5 };
        assert!(text(bad).contains("entropy floor = 1.5"));
    }
}
