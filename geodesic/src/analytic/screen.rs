//! Bardeen's screen coordinates and a photon's constants of motion, both ways.

use crate::error::{Error, check};
use crate::screen::observer::Inclination;
use crate::spacetime::kerr::Kerr;

/// λ = L/E (in M) and η = Q/E² (in M²) of the photon that arrives at (α, β), in M
/// (Bardeen 1973).
pub fn constants(hole: &Kerr, inclination: Inclination, alpha: f64, beta: f64) -> (f64, f64) {
    let (a, cos) = (hole.spin(), inclination.cos());
    (-alpha * inclination.sin(), (alpha - a) * (alpha + a) * cos * cos + beta * beta)
}

/// (α, β) with β ≥ 0 of the photon with λ (in M) and η (in M²) at an observer at infinity;
/// its mirror image in the line β = 0 has the same constants. On the axis (sin i = 0) they
/// fix only α² + β², and the point is put at α = 0.
///
/// # Errors
/// If no photon with these constants reaches the inclination.
///
/// # Examples
/// ```
/// use kerrlight_geodesic::{Inclination, Kerr, analytic::screen};
/// let (hole, inclination) = (Kerr::new(0.9)?, Inclination::from_degrees(60.0)?);
/// let (lambda, eta) = screen::constants(&hole, inclination, -3.0, 2.0);
/// let (alpha, beta) = screen::point(&hole, inclination, lambda, eta)?;
/// assert!((alpha + 3.0).abs() < 1e-14 && (beta - 2.0).abs() < 1e-14);
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
pub fn point(
    hole: &Kerr,
    inclination: Inclination,
    lambda: f64,
    eta: f64,
) -> Result<(f64, f64), Error> {
    let (a, sin, cos) = (hole.spin(), inclination.sin(), inclination.cos());
    let reaches = lambda.is_finite() && (sin != 0.0 || lambda == 0.0);
    check("lambda", lambda, reaches, "a finite number, 0 for an observer on the axis")?;
    let alpha = if sin == 0.0 { 0.0 } else { -lambda / sin };
    let beta2 = eta + (a - alpha) * (a + alpha) * cos * cos;
    let allowed = "at least (alpha^2 - a^2) cos^2 i, with alpha = -lambda / sin i";
    check("eta", eta, beta2 >= 0.0 && beta2.is_finite(), allowed)?;
    Ok((alpha, beta2.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_there_and_back() {
        let hole = Kerr::new(-0.7).unwrap();
        for degrees in [0.0, 1e-3, 40.0, 90.0, 135.0, 180.0] {
            let i = Inclination::from_degrees(degrees).unwrap();
            let alpha = if i.sin() == 0.0 { 0.0 } else { 4.0 };
            let (lambda, eta) = constants(&hole, i, alpha, 3.0);
            let back = point(&hole, i, lambda, eta).unwrap();
            assert!((back.0 - alpha).abs() < 1e-14 && (back.1 - 3.0).abs() < 1e-14, "{back:?}");
        }
    }

    #[test]
    fn photons_that_never_arrive_are_named() {
        let hole = Kerr::new(0.5).unwrap();
        let at = |degrees| Inclination::from_degrees(degrees).unwrap();
        assert_eq!(point(&hole, at(0.0), 1.0, 20.0).unwrap_err().field(), "lambda");
        assert_eq!(point(&hole, at(30.0), 5.0, 1.0).unwrap_err().field(), "eta");
        assert!(point(&hole, at(30.0), f64::NAN, 1.0).is_err());
        assert!(point(&hole, at(30.0), 1.0, f64::NAN).is_err());
    }
}
