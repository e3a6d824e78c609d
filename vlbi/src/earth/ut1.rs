//! UT1 − UTC, from a built-in table of the International Earth Rotation and Reference Systems
//! Service (series EOP 20 C04, daily since 1999) or as given.

use super::EarthError;
use super::leap_seconds::tai_minus_utc;
use crate::Error;
use std::sync::OnceLock;

/// Source of UT1 − UTC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ut1 {
    /// The built-in table.
    Table,
    /// A value in seconds, for all times.
    Given(f64),
}

impl Ut1 {
    /// UT1 − UTC in seconds at a UTC date.
    ///
    /// # Errors
    /// If the date is outside the table.
    pub fn seconds(self, mjd_utc: f64) -> Result<f64, Error> {
        match self {
            Ut1::Given(seconds) => Ok(seconds),
            Ut1::Table => ut1_minus_utc(mjd_utc),
        }
    }
}

struct Table {
    first: i32,
    /// A value a day in microseconds.
    microseconds: Vec<i32>,
}

fn table() -> &'static Table {
    static TABLE: OnceLock<Table> = OnceLock::new();
    TABLE.get_or_init(|| read(include_str!("ut1_utc.txt")))
}

/// Lines of a day, its value, and what each of the following days adds.
fn read(text: &str) -> Table {
    let mut table = Table { first: 0, microseconds: Vec::new() };
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut cells = line.split(' ').map(|cell| cell.parse::<i32>().expect("a whole number"));
        let day = cells.next().expect("a day");
        if table.microseconds.is_empty() {
            table.first = day;
        }
        assert_eq!(day, table.first + table.microseconds.len() as i32, "no day is left out");
        let mut value = 0;
        for step in cells {
            value += step;
            table.microseconds.push(value);
        }
    }
    table
}

/// UT1 − UTC in seconds, linear between the days of the table (which leaves 0.02 ms), leap
/// seconds apart.
///
/// # Errors
/// If the date is outside the table.
pub fn ut1_minus_utc(mjd_utc: f64) -> Result<f64, Error> {
    let Table { first, microseconds } = table();
    let last = first + microseconds.len() as i32 - 1;
    let unknown = || EarthError::Ut1Unknown { mjd: mjd_utc, first: *first, last };
    if !(f64::from(*first)..=f64::from(last)).contains(&mjd_utc) {
        return Err(unknown().into());
    }
    // The last value of the table ends an interval and begins none.
    let day = (mjd_utc.floor() as i32).min(last - 1);
    let seconds = |day: i32| f64::from(microseconds[(day - first) as usize]) * 1e-6;
    // Within a day UT1 − TAI is smooth; the leap second comes at its end.
    let leap = tai_minus_utc(day + 1)? - tai_minus_utc(day)?;
    let change = seconds(day + 1) - leap - seconds(day);
    Ok(seconds(day) + (mjd_utc - f64::from(day)) * change)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// astropy 8.0 on the IERS's data of November 2026.
    #[test]
    fn code_astropy_values() {
        let value = ut1_minus_utc(57850.0 + 4.0 / 24.0).unwrap();
        assert!((value - 0.461_635_62).abs() < 1e-6, "{value}");
        assert!((ut1_minus_utc(57850.0).unwrap() - 0.461_904_6).abs() < 1e-6);
    }

    /// Across the leap second at the end of 2016 UT1 − UTC jumps, UT1 does not.
    #[test]
    fn exact_leap_second() {
        let before = ut1_minus_utc(57_753.999_999).unwrap();
        let after = ut1_minus_utc(57754.0).unwrap();
        assert!((after - before - 1.0).abs() < 1e-5, "{before} {after}");
        assert!(before.abs() < 0.9 && after.abs() < 0.9);
    }

    #[test]
    fn exact_days_outside_are_named() {
        let message = ut1_minus_utc(40000.0).unwrap_err().to_string();
        assert!(message.contains("MJD 40000") && message.contains("51179"), "{message}");
        assert!(ut1_minus_utc(f64::NAN).is_err());
        assert!(ut1_minus_utc(1e300).is_err());
    }
}
