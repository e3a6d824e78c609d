//! Leap seconds, by the IAU's SOFA routines (the crate `sofars`).

use super::EarthError;

/// JD of MJD 0.
pub(crate) const MJD_ZERO: f64 = 2_400_000.5;

/// TAI − UTC in seconds on a day.
///
/// # Errors
/// Before 1972 and after 2105.
pub fn tai_minus_utc(mjd: i32) -> Result<f64, EarthError> {
    let bad = || EarthError::Day(f64::from(mjd));
    if !(41317..=90000).contains(&mjd) {
        return Err(bad());
    }
    let (year, month, day, _) = sofars::cal::jd2cal(MJD_ZERO, f64::from(mjd)).map_err(|_| bad())?;
    // A positive status warns of a year beyond the routine's table of leap seconds.
    match sofars::ts::dat(year, month, day, 0.0) {
        Ok(seconds) => Ok(seconds),
        Err(_) => Err(bad()),
    }
}
