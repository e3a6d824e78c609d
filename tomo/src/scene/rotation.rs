//! How fast the matter of a volume turns.

use super::invalid::{Invalid, number};
use crate::Error;
use crate::dynamics::{AngularVelocity, Axis, Perturbation};
use kerrlight_geodesic::Kerr;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Angular velocity Ω(r) of matter on circles about an axis ξ: a name, or a law with numbers.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Rotation {
    /// At rest in Boyer–Lindquist coordinates.
    None,
    /// 1/(r^{3/2} + a ξ_z).
    Keplerian,
    /// A law with numbers.
    Law(Velocity),
}

/// Laws of the angular velocity, with the names and numbers that fits have.
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
    /// What it is drawn from.
    pub seed: u64,
}

/// Rotations that are a word.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    None,
    Keplerian,
}

impl Serialize for Rotation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Rotation::None => Word::None.serialize(serializer),
            Rotation::Keplerian => Word::Keplerian.serialize(serializer),
            Rotation::Law(law) => law.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Rotation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WordOrLaw)
    }
}

struct WordOrLaw;

impl<'de> Visitor<'de> for WordOrLaw {
    type Value = Rotation;

    fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(
            "\"none\", \"keplerian\", or { keplerian = { drag } }, { power-law = { radius, rate, exponent } }, \
             { table = { radii, rates } }, { perturbed = { of, deviation, correlation_length, radii, seed } }",
        )
    }

    fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Rotation, E> {
        Ok(match Word::deserialize(StrDeserializer::new(word))? {
            Word::None => Rotation::None,
            Word::Keplerian => Rotation::Keplerian,
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Rotation, A::Error> {
        Velocity::deserialize(MapAccessDeserializer::new(map)).map(Rotation::Law)
    }
}

impl Rotation {
    /// About `axis` through `hole`; `None` if nothing turns.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn about(&self, hole: &Kerr, axis: Axis) -> Result<Option<AngularVelocity>, Error> {
        match self {
            Rotation::None => Ok(None),
            Rotation::Keplerian => {
                Ok(Some(AngularVelocity::Keplerian { drag: hole.spin() * axis.vector()[2] }))
            }
            Rotation::Law(law) => law.angular().map(Some),
        }
    }
}

impl Velocity {
    /// Ω(r).
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn angular(&self) -> Result<AngularVelocity, Error> {
        match self.clone() {
            Velocity::Keplerian { drag } => AngularVelocity::Keplerian { drag },
            Velocity::PowerLaw { radius, rate, exponent } => {
                AngularVelocity::PowerLaw { radius, rate, exponent }
            }
            Velocity::Table { radii, rates } => AngularVelocity::Table { radii, rates },
            Velocity::Perturbed(by) => {
                let Perturbed { of, deviation, correlation_length, radii, seed } = by;
                let by = Perturbation { deviation, correlation_length, radii, rows: 100 };
                of.angular()?.perturbed(by, seed)?
            }
        }
        .checked()
    }

    /// Ranges that a scene keeps to; `key` is that of the law.
    pub(super) fn check(&self, key: &str) -> Result<(), Invalid> {
        let name = |name: &str| format!("{key}.{name}");
        match self {
            Velocity::Keplerian { drag } => {
                let ok = drag.abs() <= 1e3;
                number(name("keplerian.drag"), *drag, ok, "a number in [-1000, 1000]")
            }
            Velocity::PowerLaw { radius, rate, exponent } => {
                let ok = (1e-6..=1e6).contains(radius);
                number(name("power-law.radius"), *radius, ok, "a radius in [1e-6, 1e6] (M)")?;
                rate_in_range(name("power-law.rate"), *rate)?;
                let ok = (-10.0..=10.0).contains(exponent);
                number(name("power-law.exponent"), *exponent, ok, "a number in [-10, 10]")
            }
            Velocity::Table { rates, .. } => {
                rates.iter().try_for_each(|rate| rate_in_range(name("table.rates"), *rate))?;
                self.ranges(&name("table"))
            }
            Velocity::Perturbed(by) => {
                by.of.check(&name("perturbed.of"))?;
                self.ranges(&name("perturbed"))
            }
        }
    }

    fn ranges(&self, key: &str) -> Result<(), Invalid> {
        self.angular().map(drop).map_err(|error| Invalid::of(&format!("{key}."), &error))
    }
}

fn rate_in_range(key: String, rate: f64) -> Result<(), Invalid> {
    number(key, rate, rate.abs() <= 1e3, "a number in [-1000, 1000] (radians per M)")
}
