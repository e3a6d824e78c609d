//! The search for a world in which a light curve is that of a flare in an orbital band.

use crate::fit::linear::Roughness;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Numbers at equal distances.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// The first.
    pub from: f64,
    /// The last.
    pub to: f64,
    /// From one to the next, above 0.
    #[schemars(range(min = 1e-3))]
    pub step: f64,
}

impl Steps {
    /// All of them.
    pub fn values(&self) -> Vec<f64> {
        let count = ((self.to - self.from) / self.step + 1e-9).floor();
        let count = if count.is_finite() { count.clamp(-1.0, 1e5) as i64 } else { -1 };
        (0..=count).map(|k| self.from + k as f64 * self.step).collect()
    }
}

/// Worlds that are compared, and what is thought of the emission in each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BandSettings {
    /// Inclinations, degrees.
    #[schemars(extend("minimum" = 0.0, "maximum" = 180.0, "unit" = "degrees"))]
    pub inclinations_deg: Steps,
    /// Angular velocities over that of `motion.velocity`; below 0 matter turns the other way.
    #[schemars(inner(range(min = -10.0, max = 10.0)), extend("unit" = "a factor"))]
    pub rotation_factors: Vec<f64>,
    /// Position angles of the spin, degrees east of north.
    #[schemars(inner(range(min = -360.0, max = 360.0)), extend("unit" = "degrees east of north"))]
    pub position_angles_deg: Vec<f64>,
    /// Radii of the band, M.
    #[schemars(extend("minimum" = 1e-3, "maximum" = 1e6, "unit" = "M"))]
    pub radii: Steps,
    /// Standard deviations of the band across its circle, M.
    #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "M"))]
    pub widths: Vec<f64>,
    /// Its standard deviation in z, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub height: f64,
    /// Correlation lengths of the emission, M.
    #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "M"))]
    pub lengths: Vec<f64>,
    /// Rings between the axis and the largest radius of the region.
    #[schemars(range(min = 4, max = 128), extend("unit" = "rings between the axis and region.r_max"))]
    pub nodes: usize,
    /// What shines beside the flare; nothing, without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<BackgroundSettings>,
}

/// Light that no flare explains, in Q and in U: all combinations of these, each as probable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BackgroundSettings {
    /// Standard deviation of what is constant, Jy.
    pub constant_jy: f64,
    /// Standard deviations of what varies about it, Jy.
    pub variation_jy: Vec<f64>,
    /// Its correlation times, minutes.
    pub correlation_min: Vec<f64>,
    /// ν of its Matérn covariance.
    pub matern: Vec<Roughness>,
}
