//! The integrators that render scenes, by name.

use kerrlight_geodesic::Integrator;
use serde::de::{Deserializer, Error};
use serde::{Deserialize, Serializer};

/// Those in Mino time, and the closed form.
const NAMES: &[&str] = &["rk45-mino", "dop853-mino", "taylor-mino", "elliptic"];

/// Writes the name.
pub fn serialize<S: Serializer>(integrator: &Integrator, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(integrator.name())
}

/// Reads the name.
pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Integrator, D::Error> {
    let name = String::deserialize(from)?;
    let known = Integrator::named(&name).filter(|_| NAMES.contains(&name.as_str()));
    known.ok_or_else(|| D::Error::unknown_variant(&name, NAMES))
}
