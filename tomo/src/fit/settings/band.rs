//! The search for a world in which a light curve is that of a flare in an orbital band.

use crate::fit::linear::Roughness;
use serde::{Deserialize, Serialize};

/// Numbers at equal distances.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// The first.
    pub from: f64,
    /// The last.
    pub to: f64,
    /// From one to the next, above 0.
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BandSettings {
    /// Inclinations, degrees.
    pub inclinations_deg: Steps,
    /// Angular velocities over that of `motion.velocity`; below 0 matter turns the other way.
    pub rotation_factors: Vec<f64>,
    /// Position angles of the spin, degrees east of north.
    pub position_angles_deg: Vec<f64>,
    /// Radii of the band, M.
    pub radii: Steps,
    /// Standard deviations of the band across its circle, M.
    pub widths: Vec<f64>,
    /// Its standard deviation in z, M.
    pub height: f64,
    /// Correlation lengths of the emission, M.
    pub lengths: Vec<f64>,
    /// Rings between the axis and the largest radius of the region.
    pub nodes: usize,
    /// What shines beside the flare; nothing, without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<BackgroundSettings>,
}

/// Light that no flare explains, in Q and in U: all combinations of these, each as probable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
