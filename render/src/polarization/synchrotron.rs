//! Optically thin synchrotron emission of electrons with a power law of energies.

use super::{Stokes, SynchrotronView};
use crate::Error;

/// Electrons with isotropic momenta and N(γ) ∝ γ^−p, all of whose limits are far from the
/// Lorentz factors that radiate at the observed frequency: j ∝ ν^−α, p = 2α + 1.
///
/// Emissivities are relative to that of a field of strength 1 (in the scene's unit) normal to
/// the ray:
///
/// - j_I = (|B| sin θ_B)^{1+α} (Narayan et al. 2021, arXiv:2105.01804, eq. 16),
/// - linear polarisation of the fraction Π = (α + 1)/(α + 5/3) = (p + 1)/(p + 7/3), the electric
///   vector normal to the projected field (Ginzburg & Syrovatskii 1965; Rybicki & Lightman
///   1979, eq. 6.38),
/// - j_V/j_I = (4/3) R(p) cot θ_B √(g |B| sin θ_B)/γ₁, if γ₁ is given: the Lorentz factor whose
///   critical frequency (3/2) ν_B γ₁² in a field of strength 1 normal to the ray is the observed one.
///   Per electron j_V/j_I = (4/3) cot θ_B H(x)/(γ F(x)), F = x ∫ₓ^∞ K_{5/3}, H = x K_{1/3} + ∫ₓ^∞ K_{1/3}
///   (Legg & Westfold 1968; Dexter 2016, arXiv:1602.03184, appendix A), and
///   R = [(p + 2)/p · Γ(p/4 + 2/3) Γ(p/4 + 1/3)] / [2^{3/2}/(p + 1) · Γ(p/4 + 19/12) Γ(p/4 − 1/12)].
///   V > 0 where the field points to the observer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    index: f64,
    linear: f64,
    /// (4/3) R(p)/γ₁; 0 without circular polarisation.
    circular: f64,
}

impl PowerLaw {
    /// Electrons that radiate ν^−α, α = `spectral_index`; `lorentz_factor` is γ₁, and without
    /// it V = 0.
    ///
    /// # Errors
    /// If α is not in (−1/3, 10\] (flatter spectra come from the low-energy end of the
    /// electrons and not from their power law), or γ₁ not in \[10, 1e12\].
    pub fn new(spectral_index: f64, lorentz_factor: Option<f64>) -> Result<Self, Error> {
        let (index, field) = (spectral_index, "effects.spectral_index");
        if !(index > -1.0 / 3.0 && index <= 10.0) {
            let allowed = "with polarization: a number above -1/3 and at most 10";
            return Err(Error::out_of_range(field, index, allowed));
        }
        let circular = match lorentz_factor {
            None => 0.0,
            Some(gamma) if (10.0..=1e12).contains(&gamma) => {
                4.0 / 3.0 * circular_ratio(2.0 * index + 1.0) / gamma
            }
            Some(value) => {
                let field = "effects.circular_polarization_lorentz_factor";
                return Err(Error::out_of_range(field, value, "a number in [10, 1e12]"));
            }
        };
        Ok(PowerLaw { index, linear: (index + 1.0) / (index + 5.0 / 3.0), circular })
    }

    /// The emissivity in the gas frame, the direction of its polarisation that on the screen,
    /// relative to that of a field of strength 1 normal to the ray. No power of g is in it.
    ///
    /// Within 1/γ of the field's direction the formula of V does not hold; there |V| is kept to
    /// what Π leaves, √(I² − Q² − U²).
    pub fn emissivity(&self, view: &SynchrotronView) -> Stokes {
        let across = view.field * view.sin_pitch;
        if across <= 0.0 {
            return Stokes::default();
        }
        let i = power(across, 1.0 + self.index);
        let p = self.linear * i;
        let v = if self.circular == 0.0 {
            0.0
        } else {
            let most = (1.0 - self.linear * self.linear).sqrt();
            let cot = view.cos_pitch / view.sin_pitch;
            i * (self.circular * cot * (view.redshift * across).sqrt()).clamp(-most, most)
        };
        Stokes { i, q: p * view.direction[0], u: p * view.direction[1], v }
    }

    /// Returns the light per thickness of a thin layer parallel to the equatorial plane: g^{3+α} (ℓ_p/H) j
    /// (Narayan et al. 2021, eqs. 18 and 19). `None` where the ray runs along the layer.
    pub fn of_layer(&self, view: &SynchrotronView) -> Option<Stokes> {
        let depth = power(view.redshift, 3.0 + self.index) * view.slant;
        depth.is_finite().then(|| self.emissivity(view) * depth)
    }
}

/// x^n, by products where n is a small whole number, as in the usual case α = 1.
#[inline]
fn power(x: f64, n: f64) -> f64 {
    let whole = n as i32;
    if f64::from(whole) == n && (0..=8).contains(&whole) { x.powi(whole) } else { x.powf(n) }
}

/// R(p) of [`PowerLaw`]: ∫ x^{(p−2)/2} H dx / ∫ x^{(p−3)/2} F dx.
fn circular_ratio(p: f64) -> f64 {
    let gamma = |twelfths: f64| libm::tgamma(p / 4.0 + twelfths / 12.0);
    let circular = (p + 2.0) / p * gamma(8.0) * gamma(4.0);
    let total = 8f64.sqrt() / (p + 1.0) * gamma(19.0) * gamma(-1.0);
    circular / total
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light across a field of strength `field` under the angle `pitch`, shifted by g.
    fn seen(redshift: f64, field: f64, pitch: f64) -> SynchrotronView {
        let (sin_pitch, cos_pitch) = pitch.sin_cos();
        let direction = [1.0, 0.0];
        SynchrotronView { redshift, field, sin_pitch, cos_pitch, direction, slant: 1.0 }
    }

    /// Π = 3/4 at α = 1, 9/13 at α = 1/2, 3/5 at α = 0 (p = 3, 2, 1).
    #[test]
    fn exact_linear_fractions() {
        for (alpha, fraction) in [(1.0, 0.75), (0.5, 9.0 / 13.0), (0.0, 0.6)] {
            let law = PowerLaw::new(alpha, None).unwrap();
            assert!((law.linear - fraction).abs() < 1e-15);
        }
    }

    /// Pandya et al. 2016 (arXiv:1602.08749), eq. 33: |j_V/j_I| =
    /// (171/250) p^{49/100} cot θ_B (ν/(3 ν_B sin θ_B))^{−1/2}, a fit that is within 1.4 % of the integral
    /// for p in [2, 6.5].
    #[test]
    fn paper_circular_fraction() {
        for p in [2.0, 2.5, 3.0, 4.0, 5.0, 6.5] {
            let law = PowerLaw::new((p - 1.0) / 2.0, Some(100.0)).unwrap();
            for angle in [0.4f64, 1.0, 2.2] {
                let (redshift, field) = (0.6, 1.7);
                let stokes = law.emissivity(&seen(redshift, field, angle));
                // ν_em/ν_B of the field: (3/2) γ₁²/(g |B|).
                let ratio = 1.5 * 100.0 * 100.0 / (redshift * field);
                let fit = 171.0 / 250.0 * f64::powf(p, 0.49)
                    / angle.tan()
                    / (ratio / (3.0 * angle.sin())).sqrt();
                let fraction = stokes.v / stokes.i;
                assert!((fraction / fit - 1.0).abs() < 0.014, "p = {p}: {fraction} {fit}");
            }
        }
    }

    /// R(p) against quadrature of the light of single electrons, K_ν(x) = ∫ e^{−x cosh t} cosh νt dt.
    #[test]
    fn exact_circular_fraction() {
        let steps =
            |from: f64, to: f64| (0..600).map(move |k| from + (to - from) * f64::from(k) / 600.0);
        // Sums over x = e^s of x F and x H with weights x^{(p − 3)/2} and x^{(p − 2)/2}.
        for p in [2.5, 3.0, 4.0] {
            let (mut total, mut circular) = (0.0, 0.0);
            for x in steps(-26.0, 6.0).map(f64::exp) {
                let (mut f, mut h) = (0.0, 0.0);
                for t in steps(0.0, 15.0) {
                    let half = if t == 0.0 { 0.5 } else { 1.0 };
                    let (cosh, damped) = (t.cosh(), half * (-x * t.cosh()).exp());
                    f += damped * x * (5.0 / 3.0 * t).cosh() / cosh;
                    h += damped * (t / 3.0).cosh() * (x + 1.0 / cosh);
                }
                total += x.powf(0.5 * (p - 1.0)) * f;
                circular += x.powf(0.5 * p) * h;
            }
            let law = PowerLaw::new(0.5 * (p - 1.0), Some(100.0)).unwrap();
            let stokes = law.emissivity(&seen(1.0, 1.0, 0.9));
            let (sin, cos) = 0.9f64.sin_cos();
            let expected = 4.0 / 3.0 * circular / total * cos / sin * sin.sqrt() / 100.0;
            assert!((stokes.v / stokes.i / expected - 1.0).abs() < 1e-6, "p = {p}");
        }
    }
}
