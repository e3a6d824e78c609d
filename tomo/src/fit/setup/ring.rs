//! Rings on the screen that are simulated: what does not move.

use super::{Result, spacing};
use crate::fit::settings::{FitFile, Ring, Screen, refuse};
use kerrlight_render::polarization::StokesParameter;

/// Light of the rings of a truth, the same in every frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Rings {
    /// I, Q and U, Jy in a pixel, rows from the top; empty without rings.
    images: [Vec<f64>; 3],
}

impl Rings {
    /// Those of settings that have any.
    ///
    /// # Errors
    /// If one lies outside of the screen.
    pub fn new(file: &FitFile) -> Result<Self> {
        let rings = file.truth().map_or(&[][..], |truth| &truth.ring);
        let mut all = Self::default();
        for (k, ring) in rings.iter().enumerate() {
            let shape = shape(ring, &file.screen)?;
            let total: f64 = shape.iter().sum();
            if !(total > 0.0 && total.is_finite()) {
                refuse!("simulation.truth.ring.{k}: no pixel of the screen sees it");
            }
            let fluxes = [ring.flux_jy, ring.q_jy, ring.u_jy];
            for (image, flux) in all.images.iter_mut().zip(fluxes) {
                image.resize(shape.len(), 0.0);
                image.iter_mut().zip(&shape).for_each(|(sum, x)| *sum += flux / total * x);
            }
        }
        Ok(all)
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.images[0].is_empty()
    }

    /// Adds them to all frames of images of these Stokes parameters, which follow each other in each frame.
    pub fn add_to(&self, movie: &mut [f64], parameters: &[StokesParameter]) {
        if self.is_empty() {
            return;
        }
        let pixels = self.images[0].len();
        for (k, image) in movie.chunks_exact_mut(pixels).enumerate() {
            let of = self.of(parameters[k % parameters.len()]);
            image.iter_mut().zip(of).for_each(|(sum, x)| *sum += x);
        }
    }

    /// The same of fluxes.
    pub fn add_to_fluxes(&self, fluxes: &mut [f64], parameters: &[StokesParameter]) {
        let sums = parameters.iter().map(|parameter| self.of(*parameter).iter().sum::<f64>());
        let sums: Vec<f64> = sums.collect();
        for frame in fluxes.chunks_exact_mut(sums.len().max(1)) {
            frame.iter_mut().zip(&sums).for_each(|(flux, sum)| *flux += sum);
        }
    }

    /// Returns the image of a parameter, Jy in a pixel, rows from the top; V has none.
    pub fn of(&self, parameter: StokesParameter) -> &[f64] {
        self.images.get(parameter.index()).map_or(&[], Vec::as_slice)
    }
}

/// Brightness of a ring in each pixel, in any unit.
fn shape(ring: &Ring, screen: &Screen) -> Result<Vec<f64>> {
    let (n, step) = (screen.pixels, spacing(screen)?);
    let at = |k: usize| (k as f64 - 0.5 * (n as f64 - 1.0)) * step;
    let brightest = ring.brightest_deg.to_radians();
    let light = |k: usize| {
        // West to the right, north up.
        let (west, north) = (at(k % n), -at(k / n));
        let angle = (-west).atan2(north);
        let away = (west.hypot(north) - ring.radius) / ring.sigma;
        (1.0 + ring.asymmetry * (angle - brightest).cos()) * (-0.5 * away * away).exp()
    };
    Ok((0..n * n).map(light).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::settings::{Hole, Kind, WidthOf};

    /// East is on the left of an image, north at its top.
    #[test]
    fn exact_rings_are_brightest_where_they_should_be() {
        let plain = FitFile::new(Hole::new(0.0), 30.0, [3.0, 9.0], Kind::LinearGrid).screen;
        let screen = Screen { pixels: 41, width: 20.0, width_of: WidthOf::Centers, ..plain };
        let (radius, sigma, flux_jy) = (5.0, 1.0, 1.0);
        let (q_jy, u_jy, asymmetry, brightest_deg) = (0.0, 0.0, 0.5, 90.0);
        let ring = Ring { radius, sigma, flux_jy, q_jy, u_jy, asymmetry, brightest_deg };
        let shape = shape(&ring, &screen).unwrap();
        let pixel = |row: usize, column: usize| shape[row * 41 + column];
        // Rows and columns 10 and 30 are 5 M from the middle.
        assert!((pixel(20, 10) - 1.5).abs() < 1e-12 && (pixel(20, 30) - 0.5).abs() < 1e-12);
        assert!((pixel(10, 20) - 1.0).abs() < 1e-12 && (pixel(30, 20) - 1.0).abs() < 1e-12);
        // One standard deviation inside of the ring.
        assert!((pixel(12, 20) - (-0.5f64).exp()).abs() < 1e-12);
    }
}
