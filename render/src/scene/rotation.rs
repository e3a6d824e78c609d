//! Motion of the matter of a volume.

use super::invalid::Invalid;
use crate::Error;
use crate::dynamics::{AngularVelocity, Axis, Velocity};
use kerrlight_geodesic::Kerr;
use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Motion of matter about an axis ξ: a name, or a law with numbers.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Rotation {
    /// Rest in Boyer–Lindquist coordinates.
    None,
    /// 1/(r^{3/2} + a ξ_z).
    Keplerian,
    /// A law with numbers.
    Law(Velocity),
}

/// Rotations that are a word.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Word {
    /// Rest.
    None,
    /// Ω = 1/(r^{3/2} + a ξ_z).
    Keplerian,
}

/// Keys of a rotation in a file.
#[derive(JsonSchema)]
#[schemars(untagged)]
#[expect(dead_code, reason = "its schema is all that is needed of it")]
pub(super) enum RotationKeys {
    Word(Word),
    Law(Velocity),
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
             { table = { radii, rates } }, { perturbed = { of, deviation, correlation_length, radii, seed } }, \
             { infall = { xi, beta_r, beta_phi } }, { profile = { radii, angular, radial } }",
        )
    }

    fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Rotation, E> {
        Ok(match Word::deserialize(StrDeserializer::new(word))? {
            Word::None => Rotation::None,
            Word::Keplerian => Rotation::Keplerian,
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Rotation, A::Error> {
        let law = Velocity::deserialize(MapAccessDeserializer::new(map))?;
        if !law.has_seeds() {
            return Err(serde::de::Error::missing_field("seed"));
        }
        Ok(Rotation::Law(law))
    }
}

impl Rotation {
    /// Returns the motion about `axis` through `hole`; `None` if nothing turns.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn about(&self, hole: &Kerr, axis: Axis) -> Result<Option<AngularVelocity>, Error> {
        match self {
            Rotation::None => Ok(None),
            Rotation::Keplerian => {
                Ok(Some(AngularVelocity::Keplerian { drag: hole.spin() * axis.vector()[2] }))
            }
            // Its perturbations have seeds of their own.
            Rotation::Law(law) => law.angular(0, hole.spin() * axis.vector()[2]).map(Some),
        }
    }
}

/// Refuses a law that is none; `key` is that of the rotation.
pub(super) fn check(law: &Velocity, key: &str) -> Result<(), Invalid> {
    let name = match law {
        Velocity::Keplerian { .. } | Velocity::PowerLaw { .. } => return Ok(()),
        Velocity::Table { .. } => "table",
        Velocity::Perturbed(_) => "perturbed",
        Velocity::Infall { .. } => "infall",
        Velocity::Profile { .. } => "profile",
    };
    law.angular(0, 0.0).map(drop).map_err(|error| Invalid::of(&format!("{key}.{name}."), &error))
}
