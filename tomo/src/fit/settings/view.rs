//! The hole, the view of it, what happens to light, and how matter turns.

use super::{FitFile, Quantity};
use crate::fit::geometry::Parameter;
use crate::fit::{Region as Limits, Sampling};
use kerrlight_render::dynamics::Velocity;
use kerrlight_vlbi::operator::Pulse;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// Spin a along +z: a value or a prior.
    #[schemars(extend("minimum" = -1.0, "maximum" = 1.0, "unit" = "a/M"))]
    pub spin: Quantity,
    /// Mass, solar masses; needed for hours and microarcseconds.
    #[schemars(range(min = 1e-20, max = 1e15), extend("unit" = "solar masses"))]
    #[schemars(example = 4.154e6)]
    pub mass_msun: Option<f64>,
    /// Distance, kpc; needed for microarcseconds.
    #[schemars(range(min = 1e-9, max = 1e12), extend("unit" = "kpc"))]
    #[schemars(example = 8.178)]
    pub distance_kpc: Option<f64>,
}

/// Direction of the observer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Observer {
    /// Angle between +z and the line of sight: a value or a prior.
    #[schemars(extend("minimum" = 0.0, "maximum" = 180.0, "unit" = "degrees"))]
    pub inclination_deg: Quantity,
    /// Position angle of +z on the sky: a value or a prior. At 0 it points north; 0 without it.
    #[serde(default = "north", skip_serializing_if = "is_north")]
    #[schemars(extend("minimum" = -360.0, "maximum" = 360.0, "unit" = "degrees east of north"))]
    pub position_angle_deg: Quantity,
    /// Boyer–Lindquist radius of the observer, above 2 M; infinity without it.
    #[schemars(example = 1000.0)]
    pub radius: Option<f64>,
}

fn north() -> Quantity {
    Quantity::Value(0.0)
}

fn is_north(angle: &Quantity) -> bool {
    *angle == north()
}

/// Pixels of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// Pixels along each side.
    #[schemars(range(min = 2, max = 4096), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Width of the screen, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub width: f64,
    /// Distance that `width` spans.
    #[serde(default)]
    pub width_of: WidthOf,
    /// Width on the sky, µas; that of `width` at the hole's mass and distance without it.
    #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
    #[schemars(example = 120.0)]
    pub field_uas: Option<f64>,
    /// Jy in the pixel of a sight line with 1 M of emission 1: the unit of emission.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "Jy per M of emission 1"))]
    pub jy_per_pixel: f64,
    /// Rays of each pixel near the critical curve, whose mean is its light; without it one, or 16 of light curves, and where images
    /// of another program ask for means.
    #[schemars(example = 8)]
    #[schemars(range(min = 1, max = 1024), extend("unit" = "rays"))]
    pub ring_rays: Option<usize>,
    /// Rays of each pixel on a regular grid, a square number, whose mean is its light; without it one, or as many as images
    /// of another program ask for.
    #[schemars(example = 4)]
    #[schemars(range(min = 1, max = 64), extend("unit" = "rays"))]
    pub samples_per_pixel: Option<usize>,
    /// Pixel shape seen by visibilities; triangle for simulated data and delta for measured data without it.
    #[schemars(example = PixelShape::Delta)]
    pub pulse: Option<PixelShape>,
}

/// Shape of a pixel in visibilities.
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

/// Distance that a width spans.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WidthOf {
    /// The pixels' outer edges.
    #[default]
    Edges,
    /// The centres of the first and the last pixel.
    Centers,
}

/// Region in which emission is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Least radius, M.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "M"))]
    pub r_min: f64,
    /// Largest radius, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub r_max: f64,
    /// Largest |z|, M; unlimited without it.
    #[schemars(range(min = 1e-3), extend("unit" = "M"))]
    #[schemars(example = 4.0)]
    pub z_width: Option<f64>,
    /// Quadrature along rays. Images without noise need order 12; `quadrature_error` in `results.json` tells.
    pub nodes: Sampling,
}

impl Region {
    /// Its limits; without `z_width` there is none of |z|.
    pub fn limits(&self) -> Limits {
        let z_width = self.z_width.unwrap_or(f64::INFINITY);
        Limits { r_min: self.r_min, r_max: self.r_max, z_width }
    }
}

/// Effects on light.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Effects {
    /// True if emission is evaluated at the time when the light passed.
    #[serde(default)]
    pub slow_light: bool,
    /// Emission scales as g to this power, 2 + spectral index; no redshift without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "an exponent"))]
    #[schemars(example = 2.0)]
    pub redshift_power: Option<f64>,
    /// A grey medium at rest inside the region, κ = coefficient · exp(−½[(r/radius)² + (z/height)²]), which dims
    /// what lies behind it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = Absorption { coefficient: 0.1, radius: 6.0, height: 2.0 })]
    pub absorption: Option<Absorption>,
}

/// κ = coefficient · exp(−½ [(r/radius)² + (z/height)²]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Absorption {
    /// κ at the centre, per M.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "per M"))]
    pub coefficient: f64,
    /// Scale of r, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// Scale of z, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub height: f64,
}

/// Motion of matter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Law of motion; positive Ω is right-handed about the axis. Numbers of `infall` are values or priors.
    pub velocity: Velocity<Quantity>,
    /// Rotation axis, a vector of any length; needed with `[axis.known]` and for simulations.
    pub axis: Option<[f64; 3]>,
    /// Time at which the volume is the recovered one, M.
    #[serde(default)]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub reference_time: f64,
    /// Emission is dark before this time, M; always lit without it.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    #[schemars(example = 0.0)]
    pub injection_time: Option<f64>,
}

impl Motion {
    /// The law of motion; of what is not known, with the median of its prior.
    pub fn law(&self) -> Velocity {
        self.velocity.clone().map(&|quantity: Quantity| quantity.value())
    }

    /// Returns whether the velocity is another one where the hole spins otherwise.
    pub fn follows_spin(&self) -> bool {
        let mut law = &self.velocity;
        while let Velocity::Perturbed(by) = law {
            law = &by.of;
        }
        matches!(law, Velocity::Keplerian { drag: None } | Velocity::Infall { drag: None, .. })
    }
}

impl FitFile {
    /// Numbers that may have a prior: their parameters, their keys, and themselves.
    pub(crate) fn quantities_mut(&mut self) -> Vec<(Parameter, &'static str, &mut Quantity)> {
        let Observer { inclination_deg, position_angle_deg, .. } = &mut self.observer;
        let mut all = vec![
            (Parameter::Spin, "hole.spin", &mut self.hole.spin),
            (Parameter::Inclination, "observer.inclination_deg", inclination_deg),
            (Parameter::PositionAngle, "observer.position_angle_deg", position_angle_deg),
        ];
        if let Velocity::Infall { xi, beta_r, beta_phi, .. } = &mut self.motion.velocity {
            all.extend([
                (Parameter::Xi, "motion.velocity.infall.xi", xi),
                (Parameter::BetaR, "motion.velocity.infall.beta_r", beta_r),
                (Parameter::BetaPhi, "motion.velocity.infall.beta_phi", beta_phi),
            ]);
        }
        all
    }

    /// The same as they are.
    pub(super) fn quantities(&self) -> Vec<(Parameter, &'static str, Quantity)> {
        let mut file = self.clone();
        file.quantities_mut().into_iter().map(|(p, key, quantity)| (p, key, *quantity)).collect()
    }
}
