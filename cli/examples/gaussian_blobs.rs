//! A representation of one's own, in a program that is all of `kerrlight` and this one more: emission as a sum of
//! round Gaussian blobs, whose places, sizes and brightnesses are learnt.
//!
//! ```sh
//! cargo run --release -p kerrlight --example gaussian_blobs -- compare cli/examples/gaussian_blobs.toml
//! ```
//!
//! docs/tutorials/your-own-representation.md walks through it.

use kerrlight_cli::Program;
use kerrlight_tomo::representation::{
    BuildError, Coordinates, Float, Gradient, OwnSettings, Representation, Workspace,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::process::ExitCode;

fn main() -> ExitCode {
    Program::new().representation("gaussian-blobs", build).run()
}

fn build(own: &OwnSettings) -> Result<Box<dyn Representation<f32>>, BuildError> {
    let count = own.number("blobs", 1.0..=4096.0)? as usize;
    let sigma = own.number("sigma", 0.01..=100.0)?;
    Ok(Box::new(GaussianBlobs { count, sigma, r_min: own.r_min, r_max: own.r_max }))
}

/// e(x) = Σ aₖ² exp(−|x − cₖ|²/(2 σₖ²)), with σₖ = sigma · exp(sₖ). The parameters of blob k are its centre (x, y, z in
/// units of sigma), sₖ and aₖ: a square cannot be negative.
struct GaussianBlobs {
    count: usize,
    /// Unit of sizes and distances, M.
    sigma: f64,
    /// Least radius of the centres, M.
    r_min: f64,
    r_max: f64,
}

/// Parameters of a blob.
const EACH: usize = 5;
/// Points that a thread does at a time: sums over them are added up in their order, whatever the threads.
const CHUNK: usize = 512;
/// Exponent beyond which a blob is darker than any rounding.
const DARK: f64 = 40.0;

/// A blob at a point.
struct Lit<T> {
    /// x − c, in units of sigma.
    offset: [T; 3],
    /// 1/σ² in those units.
    inverse: T,
    /// exp(−|x − c|²/(2 σ²)).
    light: T,
}

impl GaussianBlobs {
    /// Nothing where it is dark.
    fn lit<T: Float>(&self, blob: &[T], point: [T; 3]) -> Option<Lit<T>> {
        let unit = T::of(1.0 / self.sigma);
        let offset = [0, 1, 2].map(|c| point[c] * unit - blob[c]);
        let inverse = (T::of(-2.0) * blob[3]).exp();
        let square = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2];
        let depth = T::of(0.5) * square * inverse;
        (depth < T::of(DARK)).then(|| Lit { offset, inverse, light: (-depth).exp() })
    }

    fn value<T: Float>(&self, parameters: &[T], point: [T; 3]) -> T {
        let light = |blob: &[T]| {
            self.lit(blob, point).map_or(T::zero(), |lit| blob[4] * blob[4] * lit.light)
        };
        parameters.chunks_exact(EACH).map(light).fold(T::zero(), |sum, e| sum + e)
    }

    /// Adds cotangent · de/dparameter; returns cotangent · de/dx.
    fn pull<T: Float>(
        &self,
        parameters: &[T],
        point: [T; 3],
        cotangent: T,
        sum: &mut [T],
    ) -> [T; 3] {
        let mut slope = [T::zero(); 3];
        for (blob, sum) in parameters.chunks_exact(EACH).zip(sum.chunks_exact_mut(EACH)) {
            let Some(Lit { offset, inverse, light }) = self.lit(blob, point) else { continue };
            let common = cotangent * light;
            let of_light = common * blob[4] * blob[4] * inverse;
            let mut square = T::zero();
            for c in 0..3 {
                sum[c] += of_light * offset[c];
                slope[c] += -(of_light * offset[c]) * T::of(1.0 / self.sigma);
                square += offset[c] * offset[c];
            }
            sum[3] += of_light * square;
            sum[4] += T::of(2.0) * common * blob[4];
        }
        slope
    }
}

fn point<T: Float>(at: &Coordinates<'_, T>, k: usize) -> [T; 3] {
    let columns = at.columns();
    [columns[0][k], columns[1][k], columns[2][k]]
}

impl<T: Float> Representation<T> for GaussianBlobs {
    fn dimension(&self) -> usize {
        3
    }

    fn parameters(&self) -> usize {
        EACH * self.count
    }

    /// Faint blobs anywhere in the region, all of the same size.
    fn initialise(&self, seed: u64, parameters: &mut [T]) {
        let mut random = Pcg64::seed_from_u64(seed);
        for blob in parameters.chunks_exact_mut(EACH) {
            let center = loop {
                let x: [f64; 3] = [0, 1, 2].map(|_| random.random_range(-self.r_max..self.r_max));
                let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
                if (self.r_min..self.r_max).contains(&r) {
                    break x;
                }
            };
            let start =
                [center[0] / self.sigma, center[1] / self.sigma, center[2] / self.sigma, 0.0, 0.1];
            blob.iter_mut().zip(start).for_each(|(parameter, start)| *parameter = T::of(start));
        }
    }

    fn eval(&self, parameters: &[T], at: Coordinates<'_, T>, values: &mut [T], _: &mut Workspace) {
        values.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, values)| {
            for (k, value) in values.iter_mut().enumerate() {
                *value = self.value(parameters, point(&at, chunk * CHUNK + k));
            }
        });
    }

    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        _: &mut Workspace,
    ) {
        let parts: Vec<(Vec<T>, Vec<[T; 3]>)> = cotangents
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(chunk, cotangents)| {
                let mut sum = vec![T::zero(); parameters.len()];
                let one = |(k, cotangent): (usize, &T)| {
                    self.pull(parameters, point(&at, chunk * CHUNK + k), *cotangent, &mut sum)
                };
                let slopes = cotangents.iter().enumerate().map(one).collect();
                (sum, slopes)
            })
            .collect();
        for (sum, _) in &parts {
            gradient.parameters.iter_mut().zip(sum).for_each(|(all, part)| *all += *part);
        }
        if let Some(mut coordinates) = gradient.coordinates {
            let slopes: Vec<[T; 3]> = parts.into_iter().flat_map(|(_, slopes)| slopes).collect();
            for (c, column) in coordinates.columns().iter_mut().enumerate() {
                column.iter_mut().zip(&slopes).for_each(|(out, slope)| *out += slope[c]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::representation::conformance::{Subject, check};

    /// The sum written plainly, and its derivative along a direction.
    fn tangent(p: &[f64], dp: &[f64], x: &[f64], dx: &[f64]) -> (f64, f64) {
        let (mut value, mut slope) = (0.0, 0.0);
        for (b, db) in p.chunks_exact(EACH).zip(dp.chunks_exact(EACH)) {
            let (width, mut square, mut change) = ((2.0 * b[3]).exp(), 0.0, 0.0);
            for c in 0..3 {
                let offset = x[c] / 0.7 - b[c];
                square += offset * offset;
                change += 2.0 * offset * (dx[c] / 0.7 - db[c]);
            }
            let light = (-0.5 * square / width).exp();
            value += b[4] * b[4] * light;
            let depth = 0.5 * change / width - square * db[3] / width;
            slope += light * (2.0 * b[4] * db[4] - b[4] * b[4] * depth);
        }
        (value, slope)
    }

    #[test]
    fn exact_blobs_conform() {
        let blobs = GaussianBlobs { count: 5, sigma: 0.7, r_min: 0.5, r_max: 2.0 };
        let noise = 0.2;
        check(&Subject {
            representation: &blobs,
            within: 2.0,
            parameter_noise: noise,
            tangent: &tangent,
        });
    }
}
