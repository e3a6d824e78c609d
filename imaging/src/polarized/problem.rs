//! The loss of an image's linear polarisation, and its gradient.
//!
//! Q + iU = m I in every pixel with m = w/√(1 + |w|²): light is never polarised by more than all of it. Parameters are the
//! real parts of w, pixel by pixel, then its imaginary parts; all are 0 where nothing is polarised.

use crate::problem::reduced_chi2;
use kerrlight_tomo::fit::FrameTerm;

/// Loss of the polarisation of an image.
pub struct PolarizedProblem<'a> {
    /// Data, compared with images of I, Q and U that follow each other.
    pub term: &'a dyn FrameTerm<f64>,
    /// Frames that count.
    pub frames: Vec<usize>,
    /// Stokes I of the pixels, Jy, which is held.
    pub light: &'a [f64],
    /// Factor on ∫ e |∇m|² over a field of side 1; e is the brightness over its mean.
    pub smoothness: f64,
    /// Pixels along a side.
    pub side: usize,
}

impl PolarizedProblem<'_> {
    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        2 * self.light.len()
    }

    /// Images of I, Q and U, Jy.
    pub fn images(&self, parameters: &[f64]) -> Vec<f64> {
        let (re, im) = parameters.split_at(self.light.len());
        let scaled = |w: &[f64]| -> Vec<f64> {
            let factors = re.iter().zip(im).map(|(a, b)| factor(*a, *b));
            w.iter().zip(factors).zip(self.light).map(|((w, s), light)| w * s * light).collect()
        };
        [self.light.to_vec(), scaled(re), scaled(im)].concat()
    }

    /// χ² per datum of images.
    pub fn chi2(&self, images: &[f64]) -> f64 {
        let mut none = vec![0.0; images.len()];
        reduced_chi2(self.term, &self.frames, images, 0.0, &mut none)
    }

    /// The loss; overwrites the gradient.
    pub fn value_and_gradient(&self, parameters: &[f64], gradient: &mut [f64]) -> f64 {
        let n = self.light.len();
        let images = self.images(parameters);
        let mut of_images = vec![0.0; images.len()];
        let mut value = reduced_chi2(self.term, &self.frames, &images, 1.0, &mut of_images);
        let (re, im) = parameters.split_at(n);
        let factors: Vec<f64> = re.iter().zip(im).map(|(a, b)| factor(*a, *b)).collect();
        let m: Vec<[f64; 2]> = (0..n).map(|k| [factors[k] * re[k], factors[k] * im[k]]).collect();
        let of_light = |k: usize| [1, 2].map(|stokes| of_images[stokes * n + k] * self.light[k]);
        let mut of_m: Vec<[f64; 2]> = (0..n).map(of_light).collect();
        value += self.slopes(&m, &mut of_m);
        for k in 0..n {
            // dm = s (dw − m (m·dw)).
            let along = m[k][0] * of_m[k][0] + m[k][1] * of_m[k][1];
            gradient[k] = factors[k] * (of_m[k][0] - m[k][0] * along);
            gradient[n + k] = factors[k] * (of_m[k][1] - m[k][1] * along);
        }
        value
    }

    /// The penalty on slopes of the fractions, weighted with the light of both pixels; adds its gradient.
    fn slopes(&self, m: &[[f64; 2]], gradient: &mut [[f64; 2]]) -> f64 {
        let (side, mean) = (self.side, self.light.iter().sum::<f64>() / self.light.len() as f64);
        let mut value = 0.0;
        let mut pair = |j: usize, k: usize| {
            // Spacings cancel: |Δm|²/h² times the area h² of a pixel.
            let weight = self.smoothness * 0.5 * (self.light[j] + self.light[k]) / mean;
            for part in 0..2 {
                let step = m[j][part] - m[k][part];
                value += weight * step * step;
                gradient[j][part] += 2.0 * weight * step;
                gradient[k][part] -= 2.0 * weight * step;
            }
        };
        for k in 0..m.len() {
            if k % side + 1 < side {
                pair(k, k + 1);
            }
            if k + side < m.len() {
                pair(k, k + side);
            }
        }
        value
    }
}

/// |m| over |w|.
fn factor(re: f64, im: f64) -> f64 {
    1.0 / (1.0 + re * re + im * im).sqrt()
}
