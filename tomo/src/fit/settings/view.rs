//! The hole, the view of it, what happens to light, and how matter turns.

use crate::fit::{Region as Limits, Sampling};
use kerrlight_render::dynamics::Velocity;
use kerrlight_vlbi::operator::Pulse;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// a, M.
    #[schemars(range(min = -1.0, max = 1.0), extend("unit" = "a/M"))]
    pub spin: f64,
    /// Mass in solar masses; needed for hours and microarcseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-20, max = 1e15), extend("unit" = "solar masses"))]
    pub mass_msun: Option<f64>,
    /// Distance; needed for microarcseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-9, max = 1e12), extend("unit" = "kpc"))]
    pub distance_kpc: Option<f64>,
}

/// From where it is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Observer {
    /// Angle to the spin axis, degrees.
    #[schemars(range(min = 0.0, max = 180.0), extend("unit" = "degrees"))]
    pub inclination_deg: f64,
    /// M; infinity without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
}

/// Pixels of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// Along each side.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Width in M: of the outer edges, or from the first to the last pixel's centre.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub width: f64,
    /// What the width is of.
    pub width_of: WidthOf,
    /// Field of view on the sky, if it is not `width` in units of the hole's angular size.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
    pub field_uas: Option<f64>,
    /// Jy in a pixel of a sight line with 1 M of emission 1.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "Jy per M of emission 1"))]
    pub jy_per_pixel: f64,
    /// Rays of each pixel near the critical curve, whose mean is its light; one in the middle, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ring_rays: Option<usize>,
    /// What a pixel is to visibilities; without it, [`PixelShape::Triangle`] to those that are simulated and
    /// [`PixelShape::Delta`] to those that are read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pulse: Option<PixelShape>,
}

/// What a pixel is to visibilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PixelShape {
    /// Two pixels wide, linear between centres, as eht-imaging simulates images.
    Triangle,
    /// A square.
    Rectangle,
    /// A sample of a smooth image: the sum over pixels is the Fourier integral.
    Delta,
}

impl PixelShape {
    /// Its pulse.
    pub fn pulse(self) -> Pulse {
        match self {
            Self::Triangle => Pulse::Triangle,
            Self::Rectangle => Pulse::Rectangle,
            Self::Delta => Pulse::Delta,
        }
    }
}

/// What a width is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WidthOf {
    /// The pixels' outer edges.
    Edges,
    /// The centres of the first and the last pixel.
    Centers,
}

/// Where emission is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Least radius, M.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "M"))]
    pub r_min: f64,
    /// Largest radius, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub r_max: f64,
    /// Largest |z|, M.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3), extend("unit" = "M"))]
    pub z_width: Option<f64>,
    /// Nodes on rays.
    pub nodes: Sampling,
}

impl Region {
    /// Its limits; without `z_width` there is none of |z|.
    pub fn limits(&self) -> Limits {
        let z_width = self.z_width.unwrap_or(f64::INFINITY);
        Limits { r_min: self.r_min, r_max: self.r_max, z_width }
    }
}

/// What happens to light.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Effects {
    /// Whether light takes its time.
    #[serde(default)]
    pub slow_light: bool,
    /// Emission goes like g to this power; without it there is no redshift.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "an exponent"))]
    pub redshift_power: Option<f64>,
    /// A grey medium at rest that dims what lies behind it; what shines does not absorb.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absorption: Option<Absorption>,
}

/// κ = coefficient · exp(−½ [(r/radius)² + (z/height)²]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Absorption {
    /// Per M.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "per M"))]
    pub coefficient: f64,
    /// M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub height: f64,
}

/// How matter turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Angular velocity about the axis.
    pub velocity: Velocity,
    /// The axis of the truth, or the known one: a vector of any length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// Time at which the volume is the recovered one, M.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub reference_time: f64,
    /// Time at which it begins to shine, M.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub injection_time: Option<f64>,
}
