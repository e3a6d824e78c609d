//! A rotation of all position angles that is not known.

use serde::{Deserialize, Serialize};

/// How the rotation of position angles between source and observer is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaradaySettings {
    /// Rotations that are tried first, at equal distances over 180°.
    pub angles: usize,
    /// Iterations of the linear problem for each of them.
    pub iterations: usize,
}
