//! Standing waves of a grid whose edges are mirrors: the eigenvectors of second differences on it.

use crate::fit::loss::regulariser::Shape;
use crate::representation::Degree;
use core::f64::consts::PI;

/// Waves along three axes.
pub(super) struct Modes {
    axes: [Waves; 3],
}

/// Sums over modes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sums {
    /// Waves, at each node.
    Waves,
    /// Squares of waves, at each node.
    Squares,
    /// Numbers of nodes times a wave, for each wave.
    Nodes,
}

/// Waves along an axis.
struct Waves {
    count: usize,
    /// Wave after wave: cos(π k (j + 1/2)/n) of norm 1.
    values: Vec<f64>,
    /// Minus the second difference's eigenvalue, per M².
    bends: Vec<f64>,
    /// Distance of nodes, M.
    spacing: f64,
}

impl Waves {
    fn new(count: usize, spacing: f64) -> Self {
        let n = count as f64;
        let phase = |k: usize| PI * k as f64 / n;
        let wave = |k: usize| {
            // Σ cos² over the nodes is n for the constant wave and n/2 for all others.
            let norm = if k == 0 { n.recip().sqrt() } else { (2.0 / n).sqrt() };
            let phase = phase(k);
            (0..count).map(move |j| norm * (phase * (j as f64 + 0.5)).cos()).collect::<Vec<f64>>()
        };
        // cos φ(j + 1) − 2 cos φj + cos φ(j − 1) = −(2 sin φ/2)² cos φj.
        let bend = |k: usize| (2.0 * (0.5 * phase(k)).sin() / spacing).powi(2);
        Self {
            count,
            values: (0..count).flat_map(wave).collect(),
            bends: (0..count).map(bend).collect(),
            spacing,
        }
    }

    /// Sums along the last of three axes; the axes move on by one.
    fn along_last(&self, numbers: &[f64], sums: Sums) -> Vec<f64> {
        let (n, rows) = (self.count, numbers.len() / self.count);
        let mut out = vec![0.0; numbers.len()];
        for (row, numbers) in numbers.chunks_exact(n).enumerate() {
            let sums = self.summed(numbers, sums);
            sums.iter().enumerate().for_each(|(j, sum)| out[j * rows + row] = *sum);
        }
        out
    }

    fn summed(&self, numbers: &[f64], sums: Sums) -> Vec<f64> {
        let waves = self.values.chunks_exact(self.count);
        if sums == Sums::Nodes {
            return waves.map(|wave| wave.iter().zip(numbers).map(|(x, y)| x * y).sum()).collect();
        }
        let mut out = vec![0.0; self.count];
        for (amplitude, wave) in numbers.iter().zip(waves) {
            let of = |x: &f64| if sums == Sums::Squares { x * x } else { *x };
            out.iter_mut().zip(wave).for_each(|(sum, x)| *sum += amplitude * of(x));
        }
        out
    }
}

impl Modes {
    pub fn new(shape: Shape) -> Self {
        let axis = |k: usize| Waves::new(shape.nodes[k], shape.spacing[k]);
        Self { axes: [0, 1, 2].map(axis) }
    }

    /// −Δ of each wave, per M², z fastest.
    pub fn bends(&self) -> Vec<f64> {
        let [nx, ny, nz] = [0, 1, 2].map(|k| self.axes[k].count);
        let bend = |k: usize| {
            let at = [k / (ny * nz), k / nz % ny, k % nz];
            (0..3).map(|c| self.axes[c].bends[at[c]]).sum::<f64>()
        };
        (0..nx * ny * nz).map(bend).collect()
    }

    /// Mean square over all points of the B-splines about the nodes over that of the nodes themselves, far from edges, of a
    /// field whose waves have these powers, by −Δ (per M²): a B-spline's autocorrelation is the B-spline of degree 2d + 1.
    /// Waves half a step apart from those of the grid have no mirrors.
    pub fn between_nodes(&self, degree: Degree, power: impl Fn(f64) -> f64) -> f64 {
        let axis = |waves: &Waves| -> Vec<[f64; 2]> {
            // Midpoint rule for the integral over all waves of a grid without edges.
            let phase = |k: usize| PI * (k as f64 + 0.5) / waves.count as f64;
            let bend = |phase: f64| (2.0 * (0.5 * phase).sin() / waves.spacing).powi(2);
            let of = |k: usize| [bend(phase(k)), autocorrelation(degree, phase(k))];
            (0..waves.count).map(of).collect()
        };
        let [x, y, z] = [0, 1, 2].map(|k| axis(&self.axes[k]));
        let (mut seen, mut all) = (0.0, 0.0);
        for [a, of_a] in &x {
            for [b, of_b] in &y {
                for [c, of_c] in &z {
                    let power = power(a + b + c);
                    seen += power * of_a * of_b * of_c;
                    all += power;
                }
            }
        }
        seen / all
    }

    /// Σ amplitude · wave at all nodes, z fastest.
    pub fn sum(&self, amplitudes: &[f64]) -> Vec<f64> {
        self.through_all(amplitudes, Sums::Waves)
    }

    /// Σ amplitude · wave² at all nodes.
    pub fn sum_of_squares(&self, amplitudes: &[f64]) -> Vec<f64> {
        self.through_all(amplitudes, Sums::Squares)
    }

    /// Σ number · wave over all nodes, for each wave: the transpose of [`sum`](Self::sum), and its inverse.
    pub fn project(&self, numbers: &[f64]) -> Vec<f64> {
        self.through_all(numbers, Sums::Nodes)
    }

    fn through_all(&self, numbers: &[f64], sums: Sums) -> Vec<f64> {
        // Each sum moves the last axis to the front: after three they are in order again.
        let along = |k: usize, all: &[f64]| self.axes[k].along_last(all, sums);
        along(0, &along(1, &along(2, numbers)))
    }
}

/// Σ B_{2d+1}(m) cos(m θ) over whole numbers m.
fn autocorrelation(degree: Degree, phase: f64) -> f64 {
    // B₃, B₅ and B₇ at 0, 1, 2 and 3; at −m they are the same as at m.
    let shares: &[f64] = match degree {
        Degree::Linear => &[4.0 / 6.0, 1.0 / 6.0],
        Degree::Quadratic => &[66.0 / 120.0, 26.0 / 120.0, 1.0 / 120.0],
        Degree::Cubic => &[2416.0 / 5040.0, 1191.0 / 5040.0, 120.0 / 5040.0, 1.0 / 5040.0],
    };
    let beside = shares.iter().enumerate().skip(1);
    shares[0] + beside.map(|(m, share)| 2.0 * share * (m as f64 * phase).cos()).sum::<f64>()
}
