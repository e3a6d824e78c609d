//! Emission that does not move: an image on the screen, the same in every frame, that is recovered beside the moving
//! emission.

mod with_static_image;

pub use with_static_image::WithStaticImage;

use super::loss::regulariser::{Prior, Regulariser, Shape};
use crate::Error;
use kerrlight_common::simd::Float;

/// An image that is added to every frame: one of each Stokes parameter where frames have several, a number of each
/// where they are fluxes.
///
/// Its parameters stand behind those of the emission, in the box from 0 to [`most`](Self::most): one for each pixel of
/// an image of I; two for each pixel of Q and U, which count with opposite signs.
#[derive(Clone, Debug, PartialEq)]
pub struct Quiescent {
    /// Pixels of an image; 1 of a flux.
    pub pixels: usize,
    /// Mask of the images of a frame whose pixels may be negative.
    pub signed: Vec<bool>,
    /// The largest parameter.
    pub most: f64,
    /// Unit of its parameters: the largest brightness, Jy in a pixel.
    pub upper: f64,
    /// Jy in a pixel that is as bright as 1 M of emission 1: the unit of brightness for penalties.
    pub jy_per_pixel: f64,
    /// Penalties on the brightness, as integrals over the screen.
    pub priors: Vec<Prior>,
    /// Distance of pixels, M.
    pub spacing: f64,
}

/// Parameters of a block, all of one sign and one image.
struct Block {
    first: usize,
    pixel: usize,
    sign: f64,
}

impl Quiescent {
    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let check = Error::check;
        let positive = |x: f64| x > 0.0 && x.is_finite();
        check("quiescent pixels", self.pixels as f64, self.pixels > 0, "1 or more")?;
        check("quiescent upper", self.upper, positive(self.upper), "above 0")?;
        check("quiescent most", self.most, positive(self.most), "above 0")?;
        check("jy_per_pixel", self.jy_per_pixel, positive(self.jy_per_pixel), "above 0")?;
        check("spacing of pixels", self.spacing, positive(self.spacing), "above 0")?;
        for Prior { regulariser, weight } in &self.priors {
            let known = matches!(regulariser, Regulariser::Smoothness | Regulariser::Sparsity);
            check("quiescent penalty", *weight, known, "smoothness or sparsity")?;
            let ok = weight.is_finite() && *weight >= 0.0;
            check("quiescent penalty", *weight, ok, "0 or above")?;
        }
        Ok(self)
    }

    /// Number of parameters.
    pub fn columns(&self) -> usize {
        let blocks = self.signed.iter().map(|signed| if *signed { 2 } else { 1 });
        self.pixels * blocks.sum::<usize>()
    }

    /// Jy in a pixel for a parameter of 1.
    pub fn unit(&self) -> f64 {
        self.upper / self.most
    }

    fn blocks(&self) -> impl Iterator<Item = Block> + '_ {
        let mut first = 0;
        let signs: [&[f64]; 2] = [&[1.0], &[1.0, -1.0]];
        let images = self.signed.iter().enumerate();
        let all = images.flat_map(move |(image, signed)| {
            signs[usize::from(*signed)].iter().map(move |sign| (image * self.pixels, *sign))
        });
        all.map(move |(pixel, sign)| {
            let block = Block { first, pixel, sign };
            first += self.pixels;
            block
        })
    }

    /// Its own of the parameters of a field.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn of<'a, T>(&self, parameters: &'a [T]) -> &'a [T] {
        &parameters[parameters.len() - self.columns()..]
    }

    /// The same, to be written.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn of_mut<'a, T>(&self, parameters: &'a mut [T]) -> &'a mut [T] {
        let first = parameters.len() - self.columns();
        &mut parameters[first..]
    }

    /// Adds its light (Jy) to the images of a frame, from all parameters of a field.
    ///
    /// # Panics
    /// If there are fewer parameters than its own, or other pixels.
    pub fn add<T: Float>(&self, parameters: &[T], image: &mut [T]) {
        let parameters = self.of(parameters);
        for Block { first, pixel, sign } in self.blocks() {
            let scale = T::of(sign * self.unit());
            let into = image[pixel..pixel + self.pixels].iter_mut();
            into.zip(&parameters[first..]).for_each(|(pixel, x)| *pixel += scale * *x);
        }
    }

    /// Adds what a gradient with respect to the images of a frame takes from its own parameters, the last of those of
    /// a field.
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn back<T: Float>(&self, of_image: &[T], gradient: &mut [T]) {
        let gradient = self.of_mut(gradient);
        for Block { first, pixel, sign } in self.blocks() {
            let scale = T::of(sign * self.unit());
            let into = gradient[first..first + self.pixels].iter_mut();
            into.zip(&of_image[pixel..]).for_each(|(out, slope)| *out += scale * *slope);
        }
    }

    /// Its images (Jy in a pixel) of all parameters of a field.
    ///
    /// # Panics
    /// If there are fewer parameters than its own.
    pub fn images<T: Float>(&self, parameters: &[T]) -> Vec<T> {
        let mut images = vec![T::zero(); self.pixels * self.signed.len()];
        self.add(parameters, &mut images);
        images
    }

    /// Its own parameters for a round image of I, a Gaussian with a standard deviation of a quarter of the field.
    pub(super) fn round(&self) -> Vec<f64> {
        let side = self.pixels.isqrt().max(1);
        let away = |k: usize| (k as f64 + 0.5) / side as f64 - 0.5;
        let mut all = vec![0.0; self.columns()];
        for Block { first, pixel, .. } in self.blocks() {
            if !self.signed[pixel / self.pixels] {
                for (k, x) in all[first..first + self.pixels].iter_mut().enumerate() {
                    let square = away(k % side).powi(2) + away(k / side).powi(2);
                    // 1/(2σ²) = 8 for a σ of a quarter.
                    *x = self.most * (-8.0 * square).exp();
                }
            }
        }
        all
    }

    /// Its penalties; adds their gradient to that of all parameters of a field.
    ///
    /// # Panics
    /// If there are fewer parameters than its own.
    pub fn penalty<T: Float>(&self, parameters: &[T], gradient: &mut [T]) -> f64 {
        self.priors.iter().map(|prior| self.one(prior, parameters, gradient)).sum()
    }

    /// The second derivative of its penalties times a direction, added to that of all parameters of a field.
    pub(super) fn bend(&self, direction: &[f64], out: &mut [f64]) {
        // Smoothness is quadratic: its gradient at a direction is its second derivative times that.
        // Sparsity is linear in the box and has none.
        for prior in self.priors.iter().filter(|p| p.regulariser == Regulariser::Smoothness) {
            self.one(prior, direction, out);
        }
    }

    fn one<T: Float>(&self, prior: &Prior, parameters: &[T], gradient: &mut [T]) -> f64 {
        let (side, spacing) = (self.pixels.isqrt(), self.spacing);
        // One layer of thickness 1 makes an integral over the screen of that over a volume.
        let shape = Shape { nodes: [1, side, side], spacing: [1.0, spacing, spacing] };
        // Of the brightness in M of emission: a factor for each power of it.
        let unit = self.unit() / self.jy_per_pixel;
        let powers = if prior.regulariser == Regulariser::Smoothness { unit * unit } else { unit };
        let (all, out) = (self.of(parameters), self.of_mut(gradient));
        let blocks = all.chunks_exact(self.pixels).zip(out.chunks_exact_mut(self.pixels));
        let weight = prior.weight * powers;
        let of = |(x, slopes): (&[T], &mut [T])| {
            prior.regulariser.value_and_gradient(x, shape, weight, slopes)
        };
        blocks.map(of).sum()
    }
}
