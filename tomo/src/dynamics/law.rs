//! Laws of the angular velocity, as files write them.

use super::{AngularVelocity, Perturbation};
use crate::Error;
use serde::{Deserialize, Serialize};

/// A law of the angular velocity Ω(r), as scenes and fits write it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Velocity {
    /// 1/(r^{3/2} + drag).
    Keplerian {
        /// The spin, for orbits about it.
        drag: f64,
    },
    /// rate (radius/r)^exponent.
    PowerLaw {
        /// Where the rate is reached, M.
        radius: f64,
        /// Radians per M.
        rate: f64,
        /// 1.5: Keplerian without spin, 0: like a rigid body.
        exponent: f64,
    },
    /// Linear between these, held beyond the first and the last.
    Table {
        /// Growing, M.
        radii: Vec<f64>,
        /// Radians per M.
        rates: Vec<f64>,
    },
    /// Another law, and a Gaussian process over the radius.
    Perturbed(Perturbed),
}

/// A law and a Gaussian process over the radius, which is drawn from a seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Perturbed {
    /// The law without it.
    pub of: Box<Velocity>,
    /// Its standard deviation, radians per M.
    pub deviation: f64,
    /// Its correlation length, M.
    pub correlation_length: f64,
    /// The first and the last radius of its table of 100 rows, M.
    pub radii: [f64; 2],
    /// What it is drawn from; in fits, their own seed by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

/// Radii of the table of a perturbed law.
const ROWS: usize = 100;

impl Velocity {
    /// Ω(r); perturbations without a seed are drawn from `seed`.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn angular(&self, seed: u64) -> Result<AngularVelocity, Error> {
        match self.clone() {
            Velocity::Keplerian { drag } => AngularVelocity::Keplerian { drag },
            Velocity::PowerLaw { radius, rate, exponent } => {
                AngularVelocity::PowerLaw { radius, rate, exponent }
            }
            Velocity::Table { radii, rates } => AngularVelocity::Table { radii, rates },
            Velocity::Perturbed(law) => {
                let Perturbed { of, deviation, correlation_length, radii, seed: own } = law;
                let by = Perturbation { deviation, correlation_length, radii, rows: ROWS };
                of.angular(seed)?.perturbed(by, own.unwrap_or(seed))?
            }
        }
        .checked()
    }

    /// Itself with `seed` for the perturbations that have none.
    #[must_use]
    pub fn seeded(mut self, seed: u64) -> Self {
        let mut law = &mut self;
        while let Velocity::Perturbed(by) = law {
            by.seed.get_or_insert(seed);
            law = &mut by.of;
        }
        self
    }

    /// Whether all perturbations have seeds.
    pub fn has_seeds(&self) -> bool {
        match self {
            Velocity::Perturbed(by) => by.seed.is_some() && by.of.has_seeds(),
            _ => true,
        }
    }
}
