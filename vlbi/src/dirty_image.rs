//! Visibilities transformed back to the sky.

use super::operator::{ImageGrid, Method, Operator, Pulse, Transform};
use crate::Error;
use num_complex::Complex;

/// Bytes of exponentials that are kept.
const KEPT: usize = 1 << 20;

/// The dirty image Σ wᵢ Re(Vᵢ e^{−2πi(ul + vm)})/√Σ wᵢ of offsets l to the east and m to the north with the natural weights wᵢ = 1/σᵢ², which for visibilities of
/// noise alone has a standard deviation of 1 in every pixel. Visibilities and σ in the same unit, (u, v) in wavelengths.
///
/// # Errors
/// If the transform cannot be set up.
pub fn in_sigmas(
    grid: ImageGrid,
    uv: Vec<[f64; 2]>,
    visibilities: &[Complex<f64>],
    sigmas: &[f64],
) -> Result<Vec<f32>, Error> {
    let weights = sigmas.iter().map(|sigma| sigma.powi(-2));
    let total: f64 = weights.clone().sum();
    let weighed = visibilities.iter().zip(weights).map(|(v, w)| v * w / total.sqrt());
    let weighed: Vec<Complex<f64>> = weighed.collect();
    // Samples of the sky: the transform of a pixel would weight long baselines down.
    let transform = Transform::<f64>::new(grid, Pulse::Delta, &[uv], Method::Cheaper(1e-6), KEPT)?;
    let mut image = vec![0.0; grid.width * grid.height];
    transform.adjoint(&weighed, &mut image);
    Ok(image.into_iter().map(|x| x as f32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    /// A point source lies where it is, with √(Σ w) times its flux; noise has a standard deviation of 1.
    #[test]
    fn exact_point_source_and_noise() {
        let grid = ImageGrid::new(24, 24, 1e-9).unwrap();
        let mut random = Pcg64::seed_from_u64(8);
        let mut normal = || -> f64 { random.sample(StandardNormal) };
        let uv: Vec<[f64; 2]> = (0..4000).map(|_| [3e9 * normal(), 3e9 * normal()]).collect();
        let at = 24 * 7 + 16;
        let mut sky = vec![0.0; 24 * 24];
        sky[at] = 0.5;
        let transform =
            Transform::<f64>::new(grid, Pulse::Delta, std::slice::from_ref(&uv), Method::Direct, 0)
                .unwrap();
        let mut seen = vec![Complex::new(0.0, 0.0); uv.len()];
        transform.forward(&sky, &mut seen);
        let sigmas = vec![0.2; uv.len()];
        let image = in_sigmas(grid, uv.clone(), &seen, &sigmas).unwrap();
        let expected = 0.5 * (4000.0f32 / 0.04).sqrt();
        assert!((image[at] - expected).abs() < 1e-4 * expected, "{} {expected}", image[at]);
        assert!(image.iter().enumerate().all(|(k, x)| k == at || *x < image[at]));
        let noise: Vec<_> =
            uv.iter().map(|_| Complex::new(0.2 * normal(), 0.2 * normal())).collect();
        let image = in_sigmas(grid, uv, &noise, &sigmas).unwrap();
        let square = image.iter().map(|x| x * x).sum::<f32>() / image.len() as f32;
        assert!((0.8..1.2).contains(&square), "{square}");
    }
}
