//! Correlations of circular feeds: what Stokes parameters give in each of them, how feeds turn on the sky, and leakage
//! between them.

mod feeds;
mod jones;
mod problem;
mod products;
mod table;

pub use feeds::{derotate, feed_rotation, is_turning, published_rotation, turns};
pub use jones::{Leakage, SharedLeakage, jones, leaked, response};
pub use problem::{LeakageDatum, LeakageProblem, LeakageSolution};
pub use products::{Product, Products};
pub use table::{LeakageDistance, LeakageTable, StationLeakage};

/// Refusal of data whose products are Stokes parameters: leakage is of feeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("leakage needs the products of circular feeds (RR, LL, RL, LR): these data are I, Q, U, V")]
pub struct NoFeeds;

/// Stokes parameters that a model has: I, Q and U, in this order. V is 0.
pub const MODELLED: usize = 3;
