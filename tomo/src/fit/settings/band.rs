//! The search for a geometry in which a light curve is that of a flare in an orbital band.

use crate::fit::linear::Roughness;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Numbers at equal distances.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Distance between values.
    #[schemars(range(min = 1e-3))]
    pub step: f64,
}

impl Steps {
    /// All of them.
    pub fn values(&self) -> Vec<f64> {
        // Whole steps still count if rounding leaves a little less than the last one.
        let count = ((self.to - self.from) / self.step + 1e-9).floor();
        let count = if count.is_finite() { count.clamp(-1.0, 1e5) as i64 } else { -1 };
        (0..=count).map(|k| self.from + k as f64 * self.step).collect()
    }
}

/// Geometries that are compared, and what is thought of the emission in each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BandSettings {
    /// Inclinations that are compared, degrees.
    #[schemars(extend("minimum" = 0.0, "maximum" = 180.0, "unit" = "degrees"))]
    pub inclinations_deg: Steps,
    /// Angular velocities over `motion.velocity`; negative: the other way.
    #[schemars(inner(range(min = -10.0, max = 10.0)), extend("unit" = "a factor"))]
    pub rotation_factors: Vec<f64>,
    /// Position angles of the spin, degrees east of north; others than 0 need `stokes = ["Q", "U"]` with equal
    /// errors. `observer.position_angle_deg` is 0.
    #[schemars(inner(range(min = -360.0, max = 360.0)), extend("unit" = "degrees east of north"))]
    pub position_angles_deg: Vec<f64>,
    /// Radii of the band, M.
    #[schemars(extend("minimum" = 1e-3, "maximum" = 1e6, "unit" = "M"))]
    pub radii: Steps,
    /// Standard deviations of the band across its circle, M.
    #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "M"))]
    pub widths: Vec<f64>,
    /// Standard deviation in z, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub height: f64,
    /// Correlation lengths of the emission, M.
    #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "M"))]
    pub lengths: Vec<f64>,
    /// Rings of the grid between the axis and `region.r_max`, closer than the narrowest width.
    #[schemars(range(min = 4, max = 128), extend("unit" = "rings between the axis and region.r_max"))]
    pub nodes: usize,
    /// Emission beside the flare, in Q and in U independent of each other: a constant and what varies about it.
    pub background: Option<BackgroundSettings>,
}

/// Light that no flare explains, in Q and in U: all combinations of these, each as probable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BackgroundSettings {
    /// Standard deviation of the constant, Jy.
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "Jy"))]
    pub constant_jy: f64,
    /// Standard deviations of what varies, Jy.
    #[schemars(inner(range(min = 0.0, max = 1000.0)), extend("unit" = "Jy"))]
    pub variation_jy: Vec<f64>,
    /// Its correlation times, minutes.
    #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "minutes"))]
    pub correlation_min: Vec<f64>,
    /// ν of its Matérn covariance.
    pub matern: Vec<Roughness>,
}
