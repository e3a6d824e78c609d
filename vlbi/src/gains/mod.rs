//! Complex gains of stations: what is known of them beforehand, what data say of them beside a model, and tables of
//! them that can be applied.

mod priors;
mod problem;
mod table;

pub use priors::{GainPriors, TABLES as PRIOR_TABLES, is_same_station, table as prior_table};
pub use problem::{GainProblem, ScanGains};
pub use table::{GainDistance, GainTable, GainsByStation, StationGain};
