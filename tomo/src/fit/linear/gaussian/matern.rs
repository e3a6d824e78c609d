//! Matérn's covariance (Matérn 1960), which the prior of a field has.

use crate::Error;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Smoothness of a Matérn field: its ν.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Roughness {
    /// ν = 1/2, covariance exp(−r/ℓ): continuous, with kinks everywhere.
    #[serde(rename = "1/2")]
    Half,
    /// ν = 5/2: twice differentiable in the mean square.
    #[serde(rename = "5/2")]
    FiveHalves,
}

impl Roughness {
    /// ν.
    pub fn nu(self) -> f64 {
        match self {
            Self::Half => 0.5,
            Self::FiveHalves => 2.5,
        }
    }

    /// Correlation of two values that are s correlation lengths apart, s = r/ℓ: exp(−s), or (1 + √5 s + 5 s²/3) exp(−√5 s).
    pub fn correlation(self, s: f64) -> f64 {
        let scaled = (2.0 * self.nu()).sqrt() * s;
        match self {
            Self::Half => (-scaled).exp(),
            Self::FiveHalves => (1.0 + scaled + scaled * scaled / 3.0) * (-scaled).exp(),
        }
    }

    /// Returns the number of times that (κ² − Δ) makes white noise of the field: (ν + 3/2)/2 in three dimensions.
    pub(super) fn times(self) -> usize {
        match self {
            Self::Half => 1,
            Self::FiveHalves => 2,
        }
    }
}

/// A stationary and isotropic Gaussian field in three dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matern {
    /// Mean, emission.
    pub mean: f64,
    /// Standard deviation at a point, emission.
    pub amplitude: f64,
    /// ℓ, M: with κ = √(2ν)/ℓ.
    pub correlation_length: f64,
    /// ν.
    pub roughness: Roughness,
}

impl Matern {
    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let Self { mean, amplitude, correlation_length: length, .. } = self;
        Error::check("mean", mean, mean.is_finite(), "a finite number")?;
        Error::check("amplitude", amplitude, positive(amplitude), "above 0")?;
        Error::check("correlation_length", length, positive(length), "M above 0")?;
        Ok(self)
    }

    /// κ, per M.
    pub fn kappa(&self) -> f64 {
        (2.0 * self.roughness.nu()).sqrt() / self.correlation_length
    }
}
