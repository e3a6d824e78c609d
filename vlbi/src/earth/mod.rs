//! The turning Earth: sidereal time, and baselines as a source sees them.

mod leap_seconds;
mod sidereal;
mod ut1;
mod view;

pub(crate) use leap_seconds::MJD_ZERO;
pub use leap_seconds::tai_minus_utc;
pub use sidereal::{Moment, gmst_hours, hours_utc_of_gmst};
pub use ut1::{Ut1, ut1_minus_utc};
pub use view::{Frame, SourcePosition, View};

/// Reason why the Earth's attitude is not known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EarthError {
    /// A day outside the built-in table of UT1 − UTC.
    #[error(
        "UT1 - UTC at MJD {mjd} is not in the built-in table (MJD {first} to {last}): give it in seconds (--ut1-utc, in Python \
         ut1_utc); 0 turns the Earth by less than 14 arcseconds"
    )]
    Ut1Unknown {
        /// The day requested.
        mjd: f64,
        /// First day of the table.
        first: i32,
        /// Last day of the table.
        last: i32,
    },
    /// A day for which leap seconds are not known.
    #[error("MJD = {0} is not allowed: days from 41317 (1972) to 90000 (2105)")]
    Day(f64),
}
