//! UVFITS: visibilities as random groups of a FITS file, stations in an `AIPS AN` table (AIPS
//! memo 117, Greisen 2003/2020).

mod antenna_table;
mod antennas;
#[cfg(test)]
mod flag_tests;
mod flags;
mod frequencies;
mod layout;
mod mounts;
mod read;
#[cfg(test)]
mod selector_tests;
mod selectors;
#[cfg(test)]
pub(super) mod tests;
mod w_coordinate;
mod write;

pub use read::read;
pub use write::write;
