//! Cost of a digit: errors and times of every integrator, over tolerances, spins and classes of
//! rays, hard ones included.
//!
//! The oracle is the Taylor series in numbers of twice the precision ([`trace_series`] with
//! [`Double`]), which agrees with itself to 1e-24 from one order to another and with the
//! 25-digit references of `tests/reference` (separated integrals by mpmath, no equation in
//! common) to the last digit of a double. The affine integrator shares no equation with it.
//!
//! [`trace_series`]: kerrlight_geodesic::trace_series
//! [`Double`]: kerrlight_geodesic::Double

pub mod estimates;
pub mod hard;
mod oracle;
pub mod rays;
pub mod sweep;

pub use oracle::Oracle;

use kerrlight_geodesic::Integrator;

/// Every integrator with tolerances of so many digits; the closed form has no tolerance.
pub fn settings(digits: &[i32]) -> Vec<(Integrator, f64)> {
    let each = |integrator: &Integrator| {
        let digits: &[i32] = if *integrator == Integrator::Elliptic { &[14] } else { digits };
        digits.iter().map(|digits| (*integrator, 10f64.powi(-digits))).collect::<Vec<_>>()
    };
    Integrator::ALL.iter().flat_map(each).collect()
}
