//! Oracles that kerrlight is held against: one file a paper or a source, none of which
//! shares a formula with what it judges.
//!
//! `cargo run --release -p kerrlight-validation` runs all of them, writes
//! `docs/measurements/validation.md`, and fails if one fails.

pub mod accuracy;
pub mod bardeen;
pub mod experiments;
pub mod hamilton;
pub mod mpmath;
pub mod page_thorne;
pub mod photon_ring;
pub mod report;
pub mod schwarzschild;
mod search;
pub mod sky;

use report::Case;

/// Runs every oracle.
pub fn run_all() -> Vec<Case> {
    [
        schwarzschild::cases(),
        bardeen::cases(),
        photon_ring::cases(),
        page_thorne::cases(),
        mpmath::cases(),
        hamilton::cases(),
    ]
    .concat()
}
