//! The loss of a positive image, and its gradient.
//!
//! Parameters are the logarithms of the pixels' shares of the flux, up to a constant, and that of the flux over its
//! expectation: every image is positive, and shape and flux are apart.

use kerrlight_tomo::fit::linear::Prior;
use kerrlight_tomo::fit::{FrameTerm, Shape, Weighted};

/// Part of the mean light below which a pixel is dark.
const DARK: f64 = 1e-3;

/// Number of data of a term in some frames.
pub(crate) fn count(term: &dyn FrameTerm<f64>, frames: &[usize]) -> usize {
    frames.iter().map(|frame| term.degrees_of_freedom(*frame)).sum()
}

/// χ² per datum of a term in some frames; adds `weight` times its gradient.
pub(crate) fn reduced_chi2(
    term: &dyn FrameTerm<f64>,
    frames: &[usize],
    images: &[f64],
    weight: f64,
    gradient: &mut [f64],
) -> f64 {
    // A part of the frames may have no datum of a kind.
    let scale = 1.0 / count(term, frames).max(1) as f64;
    let of_frame =
        |frame: &usize| term.value_and_gradient(*frame, images, weight * scale, gradient);
    scale * frames.iter().map(of_frame).sum::<f64>()
}

/// A Gaussian prior of the flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluxPrior {
    /// Its mean, Jy.
    pub jy: f64,
    /// Its standard deviation, Jy.
    pub sigma_jy: f64,
}

/// Loss of an image.
pub struct ImageProblem<'a> {
    /// Data; the loss has their weights times χ² per datum.
    pub terms: &'a [Weighted<dyn FrameTerm<f64>>],
    /// Frames that count.
    pub frames: Vec<usize>,
    /// Penalties on the brightness over its mean, as integrals over a field of side 1.
    pub priors: &'a [Prior],
    /// Shares of the flux where light is expected, with the factor on the entropy relative to them.
    pub envelope: Option<(&'a [f64], f64)>,
    /// Factor on all penalties.
    pub strength: f64,
    /// Prior of the flux.
    pub flux: FluxPrior,
    /// Pixels along a side.
    pub side: usize,
}

impl ImageProblem<'_> {
    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.side * self.side + 1
    }

    /// Parameters of an image with the expected flux, from its pixels' shares.
    pub fn parameters_of(&self, shares: &[f64]) -> Vec<f64> {
        shares.iter().map(|share| share.ln()).chain([0.0]).collect()
    }

    /// The pixels' shares of the flux, and the flux in Jy.
    pub fn light(&self, parameters: &[f64]) -> (Vec<f64>, f64) {
        let (last, logs) = parameters.split_last().unwrap_or((&0.0, &[]));
        // A common constant changes no share: with the largest logarithm at 0 none overflows.
        let most = logs.iter().fold(f64::NEG_INFINITY, |most, x| most.max(*x));
        let mut shares: Vec<f64> = logs.iter().map(|x| (x - most).exp()).collect();
        let sum: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= sum);
        (shares, self.flux.jy * last.exp())
    }

    /// Pixels, Jy.
    pub fn image(&self, parameters: &[f64]) -> Vec<f64> {
        let (shares, flux) = self.light(parameters);
        shares.into_iter().map(|share| share * flux).collect()
    }

    /// Factors on parameters under which the entropy has about the same bend with each: roots of the expected shares over
    /// their mean. The outskirts, where hardly any light is expected, keep a tenth of the mean.
    pub(super) fn scales(&self) -> Vec<f64> {
        let pixels = self.side * self.side;
        let of = |k: usize| self.envelope.map_or(1.0, |(expected, _)| expected[k] * pixels as f64);
        (0..pixels).map(|k| of(k).sqrt().max(0.1)).chain([1.0]).collect()
    }

    /// The sum of all slopes, that of a pixel as if it had [`DARK`] of the mean light where it is darker and the gradient wants it
    /// brighter; gives it that much.
    pub(super) fn raise(&self, parameters: &mut [f64], gradient: &[f64]) -> f64 {
        let (shares, _) = self.light(parameters);
        let floor = DARK / shares.len() as f64;
        let all = parameters.iter().zip(&shares);
        let (bright, most) =
            all.fold(
                (0.0, 0.0),
                |so_far: (f64, f64), (x, share)| {
                    if *share > so_far.1 { (*x, *share) } else { so_far }
                },
            );
        let mut slope = gradient.last().map_or(0.0, |g| g.abs());
        // The flux, last among the parameters, has no share: the zip leaves it out.
        for ((x, share), g) in parameters.iter_mut().zip(&shares).zip(gradient) {
            if *share < floor && *g < 0.0 {
                // A slope with ln s goes as s: it is small in the dark, whatever is missing.
                slope -= g * floor / share;
                // Shares go as e^x: differences of parameters are logarithms of their ratios.
                *x = bright + (floor / most).ln();
            } else {
                slope += g.abs();
            }
        }
        slope
    }

    /// Number of data of each kind.
    pub(super) fn counts(&self) -> Vec<usize> {
        self.terms.iter().map(|term| count(&*term.term, &self.frames)).collect()
    }

    /// The loss of the data and of a flux in Jy alone, its gradient with respect to the pixels, without that of the flux's
    /// prior, and the slope of the latter with ln F.
    pub(super) fn data_and_gradient(&self, image: &[f64], flux: f64) -> (f64, Vec<f64>, f64) {
        let mut gradient = vec![0.0; image.len()];
        let one = |Weighted { weight, term }: &Weighted<dyn FrameTerm<f64>>| {
            weight * reduced_chi2(&**term, &self.frames, image, *weight, &mut gradient)
        };
        let value: f64 = self.terms.iter().map(one).sum();
        let (prior, slope) = self.flux_prior(flux);
        (value + prior, gradient, slope)
    }

    /// χ² per datum of each kind of data.
    pub fn chi2(&self, image: &[f64]) -> Vec<f64> {
        let mut none = vec![0.0; image.len()];
        let one = |term: &Weighted<dyn FrameTerm<f64>>| {
            reduced_chi2(&*term.term, &self.frames, image, 0.0, &mut none)
        };
        self.terms.iter().map(one).collect()
    }

    /// The weighted sum of χ² per datum.
    pub fn misfit(&self, image: &[f64]) -> f64 {
        self.chi2(image).iter().zip(self.terms).map(|(chi2, term)| term.weight * chi2).sum()
    }

    /// The loss; overwrites the gradient.
    pub fn value_and_gradient(&self, parameters: &[f64], gradient: &mut [f64]) -> f64 {
        let (shares, flux) = self.light(parameters);
        let image: Vec<f64> = shares.iter().map(|share| share * flux).collect();
        let (mut value, of_image, slope) = self.data_and_gradient(&image, flux);
        // All pixels go as F: the slope with ln F is Σ g I. Penalties see shares alone.
        let pull: f64 = of_image.iter().zip(&image).map(|(g, i)| g * i).sum();
        let mut of_shares: Vec<f64> = of_image.iter().map(|g| g * flux).collect();
        value += self.penalties(&shares, &mut of_shares);
        value += self.entropy(&shares, &mut of_shares);
        // ∂s_j/∂x_k = s_j (δ_jk − s_k): what all shares have in common is no slope.
        let mean: f64 = of_shares.iter().zip(&shares).map(|(g, s)| g * s).sum();
        for ((out, g), share) in gradient.iter_mut().zip(&of_shares).zip(&shares) {
            *out = share * (g - mean);
        }
        gradient[shares.len()] = pull + slope;
        value
    }

    /// The prior of the flux as one datum of each kind, and its slope with ln F.
    fn flux_prior(&self, flux: f64) -> (f64, f64) {
        let one = |term: &Weighted<dyn FrameTerm<f64>>| {
            term.weight / count(&*term.term, &self.frames).max(1) as f64
        };
        let scale: f64 = self.terms.iter().map(one).sum();
        let off = (flux - self.flux.jy) / self.flux.sigma_jy;
        (scale * off * off, 2.0 * scale * off * flux / self.flux.sigma_jy)
    }

    /// Σ s ln(s/m), which is 0 or above and 0 where s = m; adds its gradient with respect to the shares.
    fn entropy(&self, shares: &[f64], gradient: &mut [f64]) -> f64 {
        let Some((expected, weight)) = self.envelope else { return 0.0 };
        let weight = weight * self.strength;
        let mut value = 0.0;
        for ((out, share), expected) in gradient.iter_mut().zip(shares).zip(expected) {
            // A share that has underflowed has none of it, and its parameter no slope.
            let log = if *share > 0.0 { (share / expected).ln() } else { 0.0 };
            value += weight * share * log;
            *out += weight * (log + 1.0);
        }
        value
    }

    /// Penalties on the brightness over its mean; adds their gradient with respect to the shares.
    fn penalties(&self, shares: &[f64], gradient: &mut [f64]) -> f64 {
        let (n, side) = (shares.len() as f64, self.side);
        let spacing = 1.0 / side as f64;
        // One layer of thickness 1: the integral over a volume is that over the field.
        let shape = Shape { nodes: [1, side, side], spacing: [1.0, spacing, spacing] };
        let brightness: Vec<f64> = shares.iter().map(|share| share * n).collect();
        let mut of_brightness = vec![0.0; shares.len()];
        let one = |Prior { regulariser, weight }: &Prior| {
            let weight = weight * self.strength;
            regulariser.value_and_gradient(&brightness, shape, weight, &mut of_brightness)
        };
        let value: f64 = self.priors.iter().map(one).sum();
        gradient.iter_mut().zip(&of_brightness).for_each(|(out, g)| *out += g * n);
        value
    }
}
