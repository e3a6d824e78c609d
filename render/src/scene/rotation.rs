//! How the matter of a volume moves.

use super::invalid::{Invalid, number};
use crate::Error;
use crate::dynamics::{AngularVelocity, Axis, Velocity};
use kerrlight_geodesic::Kerr;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How matter moves about an axis ξ: a name, or a law with numbers.
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
            // Its perturbations have seeds of their own.
            Rotation::Law(law) => law.angular(0, hole.spin() * axis.vector()[2]).map(Some),
        }
    }
}

/// Ranges that a scene keeps to; `key` is that of the law.
pub(super) fn check(law: &Velocity, key: &str) -> Result<(), Invalid> {
    let name = |name: &str| format!("{key}.{name}");
    match law {
        Velocity::Keplerian { drag } => {
            let drag = drag.unwrap_or(0.0);
            number(name("keplerian.drag"), drag, drag.abs() <= 1e3, "a number in [-1000, 1000]")
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
            ranges(law, &name("table"))
        }
        Velocity::Perturbed(by) => {
            check(&by.of, &name("perturbed.of"))?;
            ranges(law, &name("perturbed"))
        }
        Velocity::Infall { drag, .. } => {
            let drag = drag.unwrap_or(0.0);
            number(name("infall.drag"), drag, drag.abs() <= 1.0, "a number in [-1, 1] (M)")?;
            ranges(law, &name("infall"))
        }
        Velocity::Profile { angular, radial, .. } => {
            angular.iter().try_for_each(|rate| rate_in_range(name("profile.angular"), *rate))?;
            let key =
                |v: f64| number(name("profile.radial"), v, v.abs() < 1.0, "a number in (-1, 1)");
            radial.iter().try_for_each(|v| key(*v))?;
            ranges(law, &name("profile"))
        }
    }
}

fn ranges(law: &Velocity, key: &str) -> Result<(), Invalid> {
    law.angular(0, 0.0).map(drop).map_err(|error| Invalid::of(&format!("{key}."), &error))
}

fn rate_in_range(key: String, rate: f64) -> Result<(), Invalid> {
    number(key, rate, rate.abs() <= 1e3, "a number in [-1000, 1000] (radians per M)")
}
