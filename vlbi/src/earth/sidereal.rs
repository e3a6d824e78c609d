//! UTC and sidereal time, by the IAU's SOFA routines (the crate `sofars`).

use super::leap_seconds::{MJD_ZERO, tai_minus_utc};
use super::{EarthError, Ut1};
use crate::Error;

/// Mean solar over mean sidereal time, as eht-imaging rounds it.
const SOLAR_PER_SIDEREAL: f64 = 0.997_269_560_184_8;

/// An instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Modified Julian date of the day's 0 h UTC.
    pub mjd: i32,
    /// Hours of UTC since then; may be negative or beyond 24.
    pub hours_utc: f64,
}

impl Moment {
    /// UTC as MJD.
    pub fn mjd_utc(self) -> f64 {
        f64::from(self.mjd) + self.hours_utc / 24.0
    }

    /// UT1 and TT as two-part Julian dates.
    pub(super) fn ut1_tt(self, ut1: Ut1) -> Result<[(f64, f64); 2], Error> {
        let mjd = self.mjd_utc();
        if !(41317.0..=90000.0).contains(&mjd) {
            return Err(EarthError::Day(mjd).into());
        }
        let fraction = self.hours_utc / 24.0;
        let day = MJD_ZERO + f64::from(self.mjd);
        let leap = tai_minus_utc(mjd.floor() as i32)?;
        let ut1 = fraction + ut1.seconds(mjd)? / 86400.0;
        let tt = fraction + (leap + 32.184) / 86400.0;
        Ok([(day, ut1), (day, tt)])
    }
}

/// Greenwich mean sidereal time in hours, in \[0, 24) (IAU 2006).
///
/// # Errors
/// If the day is out of range or its UT1 − UTC not known.
pub fn gmst_hours(moment: Moment, ut1: Ut1) -> Result<f64, Error> {
    let [ut1, tt] = moment.ut1_tt(ut1)?;
    let radians = sofars::erst::gmst06(ut1.0, ut1.1, tt.0, tt.1);
    Ok((radians * 12.0 / core::f64::consts::PI).rem_euclid(24.0))
}

/// A mean sidereal day in hours, as a multiple of 2⁻⁴⁰, so that adding it keeps the last digits of differences of hours.
const SIDEREAL_DAY_H: f64 = 23.934469444435308;

/// Hours of UTC at which Greenwich mean sidereal time is `gmst` hours, in an observation whose first time is `first`
/// hours, taken modulo 24: that one lies between 0 h and 24 h UTC of the day `mjd`.
///
/// # Errors
/// If the day is out of range or its UT1 − UTC not known.
pub fn hours_utc_of_gmst(mjd: i32, gmst: f64, first: f64, ut1: Ut1) -> Result<f64, Error> {
    let midnight = gmst_hours(Moment { mjd, hours_utc: 0.0 }, ut1)?;
    let is_before = first.rem_euclid(24.0) < midnight;
    let day = if is_before { SIDEREAL_DAY_H } else { 0.0 };
    Ok((gmst - midnight) * SOLAR_PER_SIDEREAL + day)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// eht-imaging 1.3.2 through astropy: GMST 17.041752810209 h at MJD 57850, 4 h UTC.
    #[test]
    fn code_ehtim_gmst() {
        // eht-imaging's instant is the double nearest to MJD 57850 1/6, 0.2 µs before 4 h.
        let hours_utc = (57850.0 + 4.0 / 24.0 - 57850.0) * 24.0;
        let moment = Moment { mjd: 57850, hours_utc };
        let given = gmst_hours(moment, Ut1::Given(0.461_635_62)).unwrap();
        assert!((given - 17.041_752_810_209).abs() < 1e-11, "{given}");
        // The table is rounded to a microsecond: 3e-10 h.
        let table = gmst_hours(moment, Ut1::Table).unwrap();
        assert!((table - 17.041_752_810_209).abs() < 3e-10, "{table}");
    }

    /// Also where the day's 0 h UTC has a later sidereal time: the first time lies in the day that is asked for.
    #[test]
    fn exact_gmst_and_back() {
        for mjd in [57850, 57851, 57950, 58100] {
            for first in 0..24 {
                let gmst = |later: f64| f64::from(first) + later;
                let utc = |later: f64| {
                    hours_utc_of_gmst(mjd, gmst(later), gmst(0.0), Ut1::Table).unwrap()
                };
                assert!((0.0..24.0).contains(&utc(0.0)), "{mjd}, {first}: {}", utc(0.0));
                assert!((utc(4.0) - utc(0.0) - 4.0 * SOLAR_PER_SIDEREAL).abs() < 1e-13);
                let back = gmst_hours(Moment { mjd, hours_utc: utc(4.0) }, Ut1::Table).unwrap();
                // Eleven digits of the ratio, and the drift of UT1 over the day.
                let miss = (back - gmst(4.0) + 12.0).rem_euclid(24.0) - 12.0;
                assert!(miss.abs() < 1e-6, "{mjd}, {first}: {miss}");
            }
        }
    }

    #[test]
    fn exact_days_out_of_range() {
        for mjd in [-1_000_000, 0, 41316, 90001, i32::MAX] {
            assert!(gmst_hours(Moment { mjd, hours_utc: 0.0 }, Ut1::Given(0.0)).is_err());
        }
        let nan = Moment { mjd: 57850, hours_utc: f64::NAN };
        assert!(gmst_hours(nan, Ut1::Table).is_err());
    }
}
