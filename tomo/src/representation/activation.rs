//! Activations: from an unbounded number to an emissivity.

use kerrlight_common::simd::{Float, Lanes, math};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The last function of a representation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Activation {
    /// 1/(1 + e⁻ˣ): between 0 and 1.
    Sigmoid,
    /// ln(1 + eˣ): positive.
    Softplus,
    /// x itself. Emission stays non-negative where parameters do (a grid's are projected).
    Linear,
}

impl Activation {
    /// Value and slope.
    #[inline(always)]
    pub(super) fn apply<T: Float, V: Lanes<T>>(self, x: V) -> (V, V) {
        let one = V::splat(T::one());
        match self {
            Self::Sigmoid => {
                let value = math::sigmoid(x);
                (value, value * (one - value))
            }
            Self::Softplus => (math::softplus(x), math::sigmoid(x)),
            Self::Linear => (x, one),
        }
    }
}
