//! The interstellar medium towards Sgr A*.

use crate::Error;
use crate::observation::{MissingMetadata, Observation, Row};
use core::f64::consts::{LN_2, PI};
use kerrlight_common::units::{MICROARCSECOND, SPEED_OF_LIGHT};

/// Line of the history of simulated visibilities that are scattered.
pub const SCATTERED: &str = "scattering of Sgr A* (Johnson et al. 2018)";

/// The mean kernel of diffractive scattering by a thin screen (Psaltis et al. 2018, arXiv:1805.01242; Johnson et al. 2018,
/// ApJ 865, 104). Phases of the screen have the power spectrum |q|^−(α + 2) exp(−|q|² r_in²) P(φ), where the wander of the
/// magnetic field gives P = (1 + k sin²(φ − φ₀))^−(α/2 + 1), their dipole model.
///
/// A baseline b has exp(−½ D(b/(1 + M))), with the phase structure function D ∝ λ² and the magnification M. Where
/// b/(1 + M) is far below r_in, which baselines at centimetres are, it is a Gaussian whose width grows as λ²; far above,
/// D grows as |b|^α. Between them, D is the closed form of these papers along each axis. Refraction is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScatteringKernel {
    /// Kernels along the major axis, and along the minor axis.
    axes: [Axis; 2],
    /// Position angle of the major axis in degrees east of north.
    position_angle_deg: f64,
    /// Power α of the structure function above the inner scale.
    power: f64,
    /// (1 + M) r_in in metres: the baseline that the inner scale is to an observer.
    inner_baseline_m: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    /// Full width at half maximum in µas at 1 cm, of the Gaussian on short baselines.
    fwhm_uas: f64,
    /// Bend of D, dimensionless: D ∝ (1 + bend (b/inner)²)^(α/2) − 1.
    bend: f64,
}

impl ScatteringKernel {
    /// The kernel of Sgr A* (Johnson et al. 2018): 1.380 × 0.703 mas at 1 cm, 81.9° east of north, α = 1.38,
    /// r_in = 800 km, and a screen at 2.82 kpc from here and 5.53 kpc from there.
    pub fn sgr_a() -> Self {
        let (power, inner_scale_m, magnification) = (1.38, 800e3, 2.82 / 5.53);
        let fwhm_uas = [1380.0, 703.0];
        Self {
            axes: axes(fwhm_uas, power),
            position_angle_deg: 81.9,
            power,
            inner_baseline_m: (1.0 + magnification) * inner_scale_m,
        }
    }

    /// The kernel's Fourier transform, real, at (u, v) in wavelengths.
    pub fn transform(&self, uv: [f64; 2], frequency_hz: f64) -> f64 {
        let wavelength_m = SPEED_OF_LIGHT / frequency_hz;
        let (sin, cos) = self.position_angle_deg.to_radians().sin_cos();
        // East is u, north is v: the major axis points along (sin, cos).
        let along = [uv[0] * sin + uv[1] * cos, uv[0] * cos - uv[1] * sin];
        let baseline = uv[0].hypot(uv[1]) * wavelength_m / self.inner_baseline_m;
        let exponent = |(q, axis): (f64, Axis)| {
            // exp(−(π q FWHM)²/(4 ln 2)) is a Gaussian's transform; its width at 1 cm grows as λ².
            let fwhm_rad = axis.fwhm_uas * (100.0 * wavelength_m).powi(2) * MICROARCSECOND;
            (PI * q * fwhm_rad).powi(2) / (4.0 * LN_2)
                * self.flattening(axis.bend * baseline * baseline)
        };
        (-along.into_iter().zip(self.axes).map(exponent).sum::<f64>()).exp()
    }

    /// D at t = bend (b/inner)² in units of its parabola at b = 0.
    fn flattening(&self, t: f64) -> f64 {
        if t == 0.0 {
            return 1.0;
        }
        // ((1 + t)^(α/2) − 1)/(α t/2), with all digits for small t.
        let half = 0.5 * self.power;
        (half * t.ln_1p()).exp_m1() / (half * t)
    }
}

/// Both axes of a screen whose Gaussian on short baselines has these widths: D of the closed form has the limits of
/// ∫ P(φ) [₁F₁(−α/2; ½; −(r cos φ)²/(4 r_in²)) − 1] dφ, to which the spectrum integrates along its radius.
fn axes(fwhm_uas: [f64; 2], power: f64) -> [Axis; 2] {
    let wander = wander((fwhm_uas[1] / fwhm_uas[0]).powi(2), power);
    // |cos|^α has kinks: the midpoint rule is right to 1e-10 with so many points.
    let means = |f: fn(f64) -> f64| {
        let cosines = || directions(20_000).map(|phi| (spectrum(phi, wander, power), f(phi).abs()));
        let total: f64 = cosines().map(|(weight, _)| weight).sum();
        let mean = |n: f64| cosines().map(|(weight, c)| weight * c.powf(n)).sum::<f64>() / total;
        [mean(2.0), mean(power)]
    };
    let bend = |[square, other]: [f64; 2]| {
        // With x = b/inner D over its parabola is (2/α)(bend x²)^(α/2 − 1) far out, in the integral
        // 4 √π ⟨|cos|^α⟩/(α 2^α Γ((1 + α)/2) ⟨cos²⟩) x^(α − 2): both are equal for this bend.
        let ratio = 0.5 * square * gamma(0.5 * (1.0 + power)) * power.exp2() / (PI.sqrt() * other);
        ratio.powf(1.0 / (1.0 - 0.5 * power))
    };
    [
        Axis { fwhm_uas: fwhm_uas[0], bend: bend(means(f64::cos)) },
        Axis { fwhm_uas: fwhm_uas[1], bend: bend(means(f64::sin)) },
    ]
}

/// Middles of `count` equal pieces of half a turn.
fn directions(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(move |j| (f64::from(j) + 0.5) * PI / f64::from(count))
}

/// P(φ) of the dipole model, φ counted from the major axis, not normalised.
fn spectrum(phi: f64, wander: f64, power: f64) -> f64 {
    (1.0 + wander * phi.sin().powi(2)).powf(-0.5 * power - 1.0)
}

/// The k of P(φ) with which D on short baselines is `ratio` (below 1) times as large along the minor axis as along the
/// major axis.
fn wander(ratio: f64, power: f64) -> f64 {
    let ratio_of = |wander: f64| {
        let sums = directions(400).fold([0.0, 0.0], |[sin, cos], phi| {
            let weight = spectrum(phi, wander, power);
            [sin + weight * phi.sin().powi(2), cos + weight * phi.cos().powi(2)]
        });
        sums[0] / sums[1]
    };
    // The ratio falls with k from 1, an isotropic screen: 80 halvings are exact to rounding.
    let [mut low, mut high] = [0.0, 1e4];
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if ratio_of(middle) > ratio {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Γ(s) for s of 0.5 to 2: ∫ exp(s t − eᵗ) dt, of which sums over equal steps are right to the last digits.
fn gamma(s: f64) -> f64 {
    let t = |j: i32| 0.05 * f64::from(j);
    (-1600..120).map(|j| (s * t(j) - t(j).exp()).exp()).sum::<f64>() * 0.05
}

/// Multiplies all visibilities by a kernel's transform.
///
/// # Errors
/// If the frequency is not known.
pub fn scatter(observation: &mut Observation, kernel: &ScatteringKernel) -> Result<(), Error> {
    let factors = factors(observation, kernel)?;
    for (row, factor) in observation.rows.iter_mut().zip(factors) {
        row.products.iter_mut().for_each(|product| *product *= factor);
    }
    Ok(())
}

/// Divides all visibilities and their errors by a kernel's transform: a model without scattering fits them as the
/// scattered model fits the data, with the same χ² (Fish et al. 2014, ApJ 795, 134).
///
/// # Errors
/// If the frequency is not known, or a row is scattered to nothing.
pub fn unscatter(observation: &mut Observation, kernel: &ScatteringKernel) -> Result<(), Error> {
    let factors = factors(observation, kernel)?;
    for (row, factor) in observation.rows.iter_mut().zip(factors) {
        if factor < LEAST {
            let length = row.uv[0].hypot(row.uv[1]);
            let allowed = "wavelengths at which scattering leaves 1e-100 of a point's visibility";
            return Err(Error::out_of_range("length of a baseline", length, allowed));
        }
        row.products.iter_mut().for_each(|product| *product /= factor);
        row.noise_sigma.iter_mut().for_each(|sigma| *sigma /= factor);
    }
    Ok(())
}

/// Least visibility of a point after scattering for errors to be divided by it: their squares are finite.
const LEAST: f64 = 1e-100;

/// A kernel's transform on every row.
fn factors(
    observation: &Observation,
    kernel: &ScatteringKernel,
) -> Result<Vec<f64>, MissingMetadata> {
    let factor = |row: &Row| {
        let frequency_hz = observation.frequency_of(row).ok_or(MissingMetadata("the frequency"))?;
        Ok(kernel.transform(row.uv, frequency_hz))
    };
    observation.rows.iter().map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;
    use crate::observation::Basis;

    /// A baseline of q wavelengths at an angle from the major axis.
    fn at(q: f64, angle_deg: f64, frequency_hz: f64) -> f64 {
        let (sin, cos) = (81.9 + angle_deg).to_radians().sin_cos();
        ScatteringKernel::sgr_a().transform([q * sin, q * cos], frequency_hz)
    }

    /// −ln of the Gaussian that falls to half its peak at q = 2 ln 2/(π·FWHM).
    fn gaussian(q: f64, fwhm_uas: f64, frequency_hz: f64) -> f64 {
        let squared_cm = (100.0 * SPEED_OF_LIGHT / frequency_hz).powi(2);
        (PI * q * fwhm_uas * squared_cm * MICROARCSECOND).powi(2) / (4.0 * LN_2)
    }

    /// ₁F₁(−α/2; ½; −y) − 1 by its series, multiplied with exp(y) by Kummer's transformation.
    fn hypergeometric(power: f64, y: f64) -> f64 {
        let (mut term, mut sum) = (1.0, 1.0);
        for n in 0..400 {
            let n = f64::from(n);
            term *= (0.5 + 0.5 * power + n) / (0.5 + n) * y / (n + 1.0);
            sum += term;
        }
        sum * (-y).exp() - 1.0
    }

    /// −ln of the kernel from the integral over directions of the power spectrum.
    fn integrated(q: f64, angle_deg: f64, frequency_hz: f64) -> f64 {
        let power = 1.38;
        let wander = wander((703.0f64 / 1380.0).powi(2), power);
        let x = q * SPEED_OF_LIGHT / frequency_hz / (1.0 + 2.82 / 5.53) / 800e3;
        let (mut sum, mut parabola) = (0.0, 0.0);
        for phi in directions(400) {
            let weight = spectrum(phi, wander, power);
            let y = (0.5 * x * (phi - angle_deg.to_radians()).cos()).powi(2);
            sum += weight * hypergeometric(power, y);
            parabola += weight * power * (0.5 * x * phi.cos()).powi(2);
        }
        gaussian(q, 1380.0, frequency_hz) * sum / parabola
    }

    /// On baselines far below the inner scale the kernel is the Gaussian of both widths, at any angle.
    #[test]
    fn exact_gaussian_on_short_baselines() {
        for (frequency, q) in [(230e9, 2e6), (22e9, 2e5), (1e9, 1e4)] {
            for angle in [0.0f64, 30.0, 90.0] {
                let found = -at(q, angle, frequency).ln();
                let (sin, cos) = angle.to_radians().sin_cos();
                let right =
                    gaussian(q * cos, 1380.0, frequency) + gaussian(q * sin, 703.0, frequency);
                assert!((found / right - 1.0).abs() < 1e-4, "{frequency} {angle}: {found} {right}");
                let integral = integrated(q, angle, frequency);
                assert!((integral / right - 1.0).abs() < 1e-4, "{frequency} {angle}: {integral}");
            }
        }
        assert_eq!(at(0.0, 0.0, 230e9), 1.0);
    }

    /// The closed form has the power α far above the inner scale, and is the integral there along both axes.
    #[test]
    fn exact_power_law_on_long_baselines() {
        let kernel = ScatteringKernel::sgr_a();
        let d = |t: f64| t * kernel.flattening(t);
        assert!((d(4e12) / d(1e12) / 4.0f64.powf(0.69) - 1.0).abs() < 1e-6);
        for angle in [0.0, 90.0] {
            let (found, right) = (-at(3e10, angle, 230e9).ln(), integrated(3e10, angle, 230e9));
            assert!((found / right - 1.0).abs() < 0.015, "{angle}: {found}, {right}");
        }
    }

    /// The integral of the spectrum, which the closed form meets within 0.02 along the axes and 0.03 between them.
    #[test]
    fn exact_integral_of_the_spectrum() {
        for (angle, bound) in [(0.0, 0.02), (45.0, 0.03), (90.0, 0.001)] {
            for q in [1e9, 2e9, 4e9, 6e9, 8e9, 10e9] {
                let (found, right) = (at(q, angle, 226e9), (-integrated(q, angle, 226e9)).exp());
                assert!((found - right).abs() < bound, "{q} at {angle}: {found}, {right}");
            }
        }
    }

    /// Numbers of eht-imaging 1.3.2 at 1.3 mm: its closed form, and its integral.
    #[test]
    fn code_numbers_of_eht_imaging() {
        let frequency = SPEED_OF_LIGHT / 1.3e-3;
        for (q, angle, closed, integral) in [
            (4e9, 0.0, 0.590_621, 0.576_766_015),
            (6e9, 0.0, 0.366_599, 0.353_232_766),
            (8e9, 0.0, 0.210_763, 0.201_351_135),
            (4e9, 90.0, 0.855_918, 0.855_285_234),
            (8e9, 90.0, 0.613_759, 0.613_474_916),
            (6e9, 45.0, 0.519_102, 0.493_642_089),
        ] {
            let found = at(q, angle, frequency);
            assert!((found - closed).abs() < 2e-6, "{q} at {angle}: {found}");
            let found = (-integrated(q, angle, frequency)).exp();
            // Both are sums of a numerical quadrature.
            assert!((found - integral).abs() < 1e-6, "{q} at {angle}: {found}");
        }
        let (six, eight) = (at(6e9, 0.0, 226.191_789_062_5e9), at(8e9, 0.0, 226.191_789_062_5e9));
        assert!((six - 0.341_37).abs() < 1e-5 && (eight - 0.188_96).abs() < 1e-5);
    }

    /// All four products have the kernel's factor and the errors that they had; undone, they are what they were.
    #[test]
    fn exact_scattered_products() {
        let kernel = ScatteringKernel::sgr_a();
        let products = [1.0, 2.0, -0.5, 0.25].map(|x| Complex64::new(x, 0.5 - x));
        let row =
            |uv| Row { products, noise_sigma: [0.1, 0.2, 0.3, 0.4], ..Row::empty(4.0, [0, 1], uv) };
        let mut observation = Observation::empty(Basis::Circular);
        observation.frequency_hz = Some(230e9);
        observation.rows = vec![row([2e9, 1e9]), row([-1e9, 5e9])];
        let is_everywhere = |row: &Row, factor: f64| {
            let mut pairs = row.products.iter().zip(products);
            pairs.all(|(found, product)| (found - product * factor).norm() < 1e-14)
        };
        scatter(&mut observation, &kernel).unwrap();
        for row in &observation.rows {
            let factor = kernel.transform(row.uv, 230e9);
            assert!((0.1..0.95).contains(&factor) && is_everywhere(row, factor), "{factor}");
            assert_eq!(row.noise_sigma, [0.1, 0.2, 0.3, 0.4]);
        }
        unscatter(&mut observation, &kernel).unwrap();
        assert!(observation.rows.iter().all(|row| is_everywhere(row, 1.0)));
    }

    #[test]
    fn exact_gamma_function() {
        for (s, right) in [(0.5, PI.sqrt()), (1.0, 1.0), (1.5, PI.sqrt() / 2.0), (2.0, 1.0)] {
            assert!((gamma(s) / right - 1.0).abs() < 1e-13, "{s}: {}", gamma(s));
        }
    }
}
