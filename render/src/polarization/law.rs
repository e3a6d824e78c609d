//! Laws of polarised emission whose exponents, field and frame are free: programs differ in them.

use super::{Gas, Stokes, SynchrotronView, view};
use crate::Error;
use kerrlight_geodesic::{ScreenPoint, ZamoFrame};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Directions of a field's components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Components {
    /// The Boyer–Lindquist coordinates: B^θ and B^φ are angles.
    Coordinate,
    /// Unit vectors along these.
    Orthonormal,
}

/// Frame of the components of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FieldFrame {
    /// Frame of the gas; orthonormal only.
    Gas,
    /// Bⁱ of ideal magnetohydrodynamics: bᵗ = Bⁱ u_i, bⁱ = (Bⁱ + bᵗ uⁱ)/uᵗ.
    Ideal,
    /// The same with u_i and u_t in place of uⁱ and uᵗ, as in the program of Levis et al. 2024 (Nature Astronomy).
    Lowered,
}

/// Unit of the field's strength.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Normalisation {
    /// Its own unit.
    None,
    /// Its mean over all points where emission may be.
    MeanField,
}

/// A mixture of fields, B^r = radial sinⁿθ + vertical cos θ, B^θ = −vertical sin θ, B^φ = toroidal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MixedField {
    /// Component along +z.
    #[schemars(range(min = -1e12, max = 1e12), extend("unit" = "a share of the field"))]
    pub vertical: f64,
    /// Away from the hole.
    #[schemars(range(min = -1e12, max = 1e12), extend("unit" = "a share of the field"))]
    pub radial: f64,
    /// Around +z.
    #[schemars(range(min = -1e12, max = 1e12), extend("unit" = "a share of the field"))]
    pub toroidal: f64,
    /// n: 0, the same at all latitudes; 1, none on the axis.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "an exponent"))]
    pub radial_sine_power: f64,
}

/// Law of the light of gas, and of its polarisation: I ∝ g^a |b|^c sin^s θ_B per unit of emission, a linearly polarised
/// part Π with the electric vector along k × b, and no V.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PolarizationLaw {
    /// B^r = radial sinⁿθ + vertical cos θ, B^θ = −vertical sin θ, B^φ = toroidal, with n = radial_sine_power.
    pub field: MixedField,
    /// Directions of the components.
    pub components: Components,
    /// Frame of the components.
    pub frame: FieldFrame,
    /// Exponent of g: 2 + spectral index in the textbook.
    #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "an exponent"))]
    pub redshift_power: f64,
    /// Exponent of |b|: 1 + spectral index in the textbook.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "an exponent"))]
    pub field_power: f64,
    /// Exponent of sin θ_B: 1 + spectral index in the textbook.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "an exponent"))]
    pub sine_power: f64,
    /// Linearly polarised part of the light.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "a part of the light"))]
    pub fraction: f64,
    /// Unit of |b|.
    pub normalisation: Normalisation,
    /// Added to all position angles on the sky, degrees east of north.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees east of north"))]
    pub turn_deg: f64,
}

impl PolarizationLaw {
    /// Refuses numbers out of their ranges, and components that nobody measures.
    ///
    /// # Errors
    /// With the key, its value and what is allowed.
    pub fn check(&self) -> Result<(), Error> {
        let MixedField { vertical, radial, toroidal, .. } = self.field;
        if [vertical, radial, toroidal].iter().all(|component| *component == 0.0) {
            let allowed = "at least one of vertical, radial and toroidal is not 0";
            return Err(Error::out_of_range("polarization.field.vertical", 0.0, allowed));
        }
        if self.frame == FieldFrame::Gas && self.components == Components::Coordinate {
            let allowed = "orthonormal components with frame = \"gas\", which has no coordinates";
            return Err(Error::out_of_range("polarization.components", f64::NAN, allowed));
        }
        let ranges = [
            ("polarization.field.vertical", vertical, [-1e12, 1e12], "-1e12 to 1e12"),
            ("polarization.field.radial", radial, [-1e12, 1e12], "-1e12 to 1e12"),
            ("polarization.field.toroidal", toroidal, [-1e12, 1e12], "-1e12 to 1e12"),
            ("polarization.fraction", self.fraction, [0.0, 1.0], "0 to 1"),
            (
                "polarization.field.radial_sine_power",
                self.field.radial_sine_power,
                [0.0, 20.0],
                "0 to 20",
            ),
            ("polarization.redshift_power", self.redshift_power, [-20.0, 20.0], "-20 to 20"),
            ("polarization.field_power", self.field_power, [0.0, 20.0], "0 to 20"),
            ("polarization.sine_power", self.sine_power, [0.0, 20.0], "0 to 20"),
            ("polarization.turn_deg", self.turn_deg, [-360.0, 360.0], "-360 to 360"),
        ];
        let wrong = ranges.into_iter().find(|(_, x, [low, high], _)| !(low..=high).contains(&x));
        wrong.map_or(Ok(()), |(field, x, _, allowed)| Err(Error::out_of_range(field, x, allowed)))
    }

    /// The field that gas measures, along e_r, e_θ, e_φ of the frame boosted to its velocity; `None` on the axis, where
    /// components along coordinates have no meaning.
    pub fn field_of_gas(&self, frame: &ZamoFrame, gas: Gas) -> Option<[f64; 3]> {
        let MixedField { vertical, radial, toroidal, radial_sine_power } = self.field;
        let [sin, cos] = frame.polar_angle();
        let field =
            [radial * sin.powf(radial_sine_power) + vertical * cos, -vertical * sin, toroidal];
        if self.frame == FieldFrame::Gas {
            return Some(field);
        }
        let [x, y, z] = field;
        let field = match self.components {
            Components::Coordinate => [0.0, x, y, z],
            Components::Orthonormal => frame.to_coordinates([0.0, x, y, z]),
        };
        let lower = frame.to_covariant(gas.0);
        let time = field[1] * lower[1] + field[2] * lower[2] + field[3] * lower[3];
        let by = match self.frame {
            FieldFrame::Lowered => lower,
            _ => frame.to_coordinates(gas.0),
        };
        let of = |k: usize| (field[k] + time * by[k]) / by[0];
        // With lowered components b is not normal to u: its part along u is left out.
        let measured = gas.measured(frame.contravariant([time, of(1), of(2), of(3)]));
        measured.iter().all(|component| component.is_finite()).then_some(measured)
    }

    /// Returns the view of gas along a ray; `None` where the gas is dark.
    pub fn view(
        &self,
        frame: &ZamoFrame,
        screen: &ScreenPoint,
        photon: [f64; 4],
        gas: Gas,
    ) -> Option<SynchrotronView> {
        view(frame, screen, photon, gas, self.field_of_gas(frame, gas)?)
    }

    /// Stokes parameters per unit of emission and affine parameter, of a field that is measured in `unit`.
    pub fn stokes(&self, seen: &SynchrotronView, unit: f64) -> Stokes {
        let strength = seen.field / unit;
        if strength <= 0.0 || seen.sin_pitch <= 0.0 {
            return Stokes::default();
        }
        let i = seen.redshift.powf(self.redshift_power)
            * strength.powf(self.field_power)
            * seen.sin_pitch.powf(self.sine_power);
        let [q, u] = seen.direction.map(|part| self.fraction * i * part);
        Stokes { i, q, u, v: 0.0 }.turned(self.turn_deg.to_radians())
    }
}
