//! Numbers of the geometry: known, or with a prior.

use crate::fit::geometry::Prior;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;

/// A number that is known, or that is fitted and has a prior in its place: `0.5`, `{ uniform = [0.0, 1.0] }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Quantity {
    /// Its value.
    Value(f64),
    /// Prior of the number.
    Prior(PriorSettings),
}

/// A prior, in the unit of its key.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum PriorSettings {
    /// The same everywhere from the first to the second value.
    Uniform([f64; 2]),
    /// A bell curve.
    Normal {
        /// The mean.
        mean: f64,
        /// Standard deviation, above 0.
        #[schemars(range(min = 0.0))]
        sigma: f64,
    },
    /// Isotropic prior of an inclination: any direction in space between two angles.
    Isotropic([f64; 2]),
}

impl Quantity {
    /// Its value; the median of its prior if it is not known.
    pub fn value(&self) -> f64 {
        match self {
            Self::Value(value) => *value,
            Self::Prior(prior) => prior.median(),
        }
    }

    /// Its prior, if it is not known.
    pub fn prior(&self) -> Option<PriorSettings> {
        match self {
            Self::Value(_) => None,
            Self::Prior(prior) => Some(*prior),
        }
    }
}

impl From<f64> for Quantity {
    fn from(value: f64) -> Self {
        Self::Value(value)
    }
}

impl From<PriorSettings> for Quantity {
    fn from(prior: PriorSettings) -> Self {
        Self::Prior(prior)
    }
}

impl PriorSettings {
    /// Converts to numbers times `unit`.
    pub(super) fn prior(self, unit: f64) -> Prior {
        match self {
            Self::Uniform([low, high]) => Prior::Uniform { low: low * unit, high: high * unit },
            Self::Isotropic([low, high]) => Prior::Isotropic { low: low * unit, high: high * unit },
            Self::Normal { mean, sigma } => {
                Prior::Normal { mean: mean * unit, sigma: sigma * unit }
            }
        }
    }

    fn median(self) -> f64 {
        // Quantiles of directions are those of angles in radians.
        let unit = match self {
            Self::Isotropic(_) => core::f64::consts::PI / 180.0,
            _ => 1.0,
        };
        self.prior(unit).quantile(0.5) / unit
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(Form)
    }
}

/// Reads a number or a table.
struct Form;

impl<'de> Visitor<'de> for Form {
    type Value = Quantity;

    fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "a number or a prior such as {{ uniform = [0.0, 1.0] }}")
    }

    fn visit_f64<E>(self, value: f64) -> Result<Quantity, E> {
        Ok(Quantity::Value(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Quantity, E> {
        Ok(Quantity::Value(value as f64))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Quantity, A::Error> {
        PriorSettings::deserialize(MapAccessDeserializer::new(map)).map(Quantity::Prior)
    }
}

impl JsonSchema for Quantity {
    fn schema_name() -> Cow<'static, str> {
        "Quantity".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let prior = generator.subschema_for::<PriorSettings>();
        json_schema!({ "anyOf": [{ "type": "number" }, prior] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_common::toml_file;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Table {
        x: Quantity,
    }

    #[test]
    fn exact_a_number_is_a_value_or_a_prior() {
        for (text, expected, value) in [
            ("x = 0.5\n", Quantity::Value(0.5), 0.5),
            ("x = { uniform = [-1.0, 3.0] }\n", PriorSettings::Uniform([-1.0, 3.0]).into(), 1.0),
            // Half of the directions in space are within 60 degrees of an axis that is seen from either side.
            (
                "x = { isotropic = [0.0, 90.0] }\n",
                PriorSettings::Isotropic([0.0, 90.0]).into(),
                60.0,
            ),
            (
                "x = { normal = { mean = 40.0, sigma = 2.0 } }\n",
                PriorSettings::Normal { mean: 40.0, sigma: 2.0 }.into(),
                40.0,
            ),
        ] {
            let table: Table = toml_file::read(text).unwrap();
            assert_eq!(table.x, expected, "{text}");
            assert!((table.x.value() - value).abs() < 1e-9, "{text}");
            let again: Table = toml_file::read(&toml_file::write(&table).unwrap()).unwrap();
            assert_eq!(again, table, "{text}");
        }
        let wrong =
            toml_file::read::<Table>("x = { unifrom = [0.0, 1.0] }").unwrap_err().to_string();
        assert!(wrong.contains("line 1: x") && wrong.contains("`unifrom`"), "{wrong}");
        let wrong = toml_file::read::<Table>("x = \"0.5\"").unwrap_err().to_string();
        assert!(wrong.contains("a number or a prior"), "{wrong}");
    }
}
