//! Steps of an optimiser: what they draw, their state, checkpoints, and devices that take them.

pub mod checkpoint;
pub(in crate::fit) mod device;
pub(in crate::fit) mod device_runner;
pub(in crate::fit) mod prediction;
pub(in crate::fit) mod state;
pub(in crate::fit) mod steps;
pub(in crate::fit) mod trainer;
pub(in crate::fit) mod training;
