//! The spreading kernel φ(z) = exp(β(√(1 − z²) − 1)), |z| ≤ 1, of Barnett, Magland & af Klinteberg
//! (2019, SIAM J. Sci. Comput. 41, C479) for twofold oversampling.

use core::f64::consts::{FRAC_PI_2, PI};

/// Most cells that a kernel is wide.
pub const MOST_CELLS: usize = 16;
/// Points of a quadrature over the kernel: its error is that of the ends, e^−β/1e5.
const POINTS: usize = 400;

/// A kernel `width` cells wide.
#[derive(Debug, Clone, Copy)]
pub struct Kernel {
    /// Width in cells.
    pub width: usize,
    beta: f64,
}

impl Kernel {
    /// The narrowest whose error is below `accuracy` for every single pixel: about 66·10^(−0.965
    /// width), the rate e^(−π√½ width) of the paper's theorem 7 with a factor that was measured.
    pub fn of_accuracy(accuracy: f64) -> Self {
        let width = width_of(accuracy);
        // The paper's choice for twofold oversampling, a little below π w (1 − 1/4).
        Kernel { width, beta: 2.3 * width as f64 }
    }

    /// First cell of the kernel around `at` (in cells), and its values from there on.
    pub fn values(&self, at: f64) -> (f64, impl Iterator<Item = f64>) {
        let half = 0.5 * self.width as f64;
        let first = (at - half).ceil();
        let kernel = *self;
        let value = move |k: usize| {
            let z = (first + k as f64 - at) / half;
            // Rounding may put the ends of the kernel beyond 1.
            (kernel.beta * ((1.0 - z * z).max(0.0).sqrt() - 1.0)).exp()
        };
        (first, (0..self.width).map(value))
    }

    /// Its Fourier transform ∫ φ(2t/width) cos(2πtf) dt at `count` frequencies (k − count/2)/cells.
    pub fn transform(&self, count: usize, cells: usize) -> Vec<f64> {
        let half = 0.5 * self.width as f64;
        let step = PI / POINTS as f64;
        // With z = sin θ the root is gone, and the ends have no weight.
        let nodes: Vec<(f64, f64)> = (1..POINTS)
            .map(|k| (k as f64 * step - FRAC_PI_2).sin_cos())
            .map(|(sin, cos)| (sin, step * half * cos * (self.beta * (cos - 1.0)).exp()))
            .collect();
        let at = |k: usize| {
            let frequency = (k as f64 - (count / 2) as f64) / cells as f64;
            nodes.iter().map(|(z, w)| w * (2.0 * PI * frequency * half * z).cos()).sum()
        };
        (0..count).map(at).collect()
    }
}

/// Width in cells of the kernel for an accuracy.
pub fn width_of(accuracy: f64) -> usize {
    let digits = -accuracy.log10();
    (((digits + 1.85) / 0.965).ceil().max(2.0) as usize).min(MOST_CELLS)
}

/// Cells of the finer grid of an axis: twice the pixels at least, a product of 2, 3 and 5.
pub fn cells(pixels: usize, width: usize) -> usize {
    let least = (2 * pixels).max(2 * width + 6);
    let smooth = |mut n: usize| {
        for prime in [2usize, 3, 5] {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
        }
        n == 1
    };
    (least..).filter(|n| n.is_multiple_of(2)).find(|n| smooth(*n)).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sizes() {
        let kernel = Kernel::of_accuracy(1e-6);
        assert_eq!(kernel.width, 9);
        assert_eq!(
            [3, 64, 100, 511, 1024].map(|n| cells(n, kernel.width)),
            [24, 128, 200, 1024, 2048]
        );
    }

    /// The transform at 0 is the kernel's integral; by the midpoint rule, whose error is the ends'.
    #[test]
    fn exact_transform_at_zero() {
        let kernel = Kernel::of_accuracy(1e-8);
        let n = 1_000_000;
        let half = 0.5 * kernel.width as f64;
        let value = |k: usize| {
            let z: f64 = (k as f64 + 0.5) / f64::from(n) * 2.0 - 1.0;
            (kernel.beta * ((1.0 - z * z).sqrt() - 1.0)).exp()
        };
        let sum: f64 = (0..n as usize).map(value).sum::<f64>() * 2.0 * half / f64::from(n);
        assert!((kernel.transform(1, 64)[0] / sum - 1.0).abs() < 1e-11);
    }
}
