//! What is simulated, and the array that sees it.

use super::FieldSettings;
use kerrlight_vlbi::noise::GainErrors;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Frames of a movie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Movie {
    /// Number of frames.
    #[schemars(range(min = 1, max = 100_000), extend("unit" = "frames"))]
    pub frames: usize,
    /// Time of the first frame, M.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub from: f64,
    /// Time of the last frame, M.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub to: f64,
}

/// What is simulated.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Gaussian spots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spot: Vec<Spot>,
    /// Arcs about the z axis with a Gaussian cross-section.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tube: Vec<Tube>,
    /// Letters and digits, extruded along the axis, their tops away from the hole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub glyph: Vec<GlyphShape>,
    /// A field drawn from a prior of voxels with the fit's seed, in the cube about the region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<FieldSettings>,
    /// Rings on the screen about the hole, the same in every frame.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ring: Vec<Ring>,
}

/// A Gaussian spot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Centre when the spot was round, M: x, y, z.
    #[schemars(inner(range(min = -1e6, max = 1e6)), extend("unit" = "M"))]
    pub center: [f64; 3],
    /// Standard deviation, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub sigma: f64,
    /// Emission at the centre.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "emission at the centre"))]
    pub amplitude: f64,
    /// Time for which differential rotation has sheared it by the reference time, M.
    #[serde(default)]
    #[schemars(range(min = -1e6, max = 1e6), extend("unit" = "M"))]
    pub wound_for: f64,
    /// When it shines; always without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shines: Option<Shines>,
}

/// An arc about the z axis, in the plane of the hole, with a Gaussian cross-section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tube {
    /// Radius of the arc, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// Standard deviation across it, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub sigma: f64,
    /// Azimuths of its ends, degrees.
    #[schemars(inner(range(min = -720.0, max = 720.0)), extend("unit" = "degrees"))]
    pub azimuth_deg: [f64; 2],
    /// Emission on the arc, far from its ends.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "emission on the arc"))]
    pub amplitude: f64,
}

/// A ring on the screen about the hole, the same in every frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Radius, M; 0 is a round spot.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// Standard deviation across it, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub sigma: f64,
    /// Stokes I, Jy.
    #[schemars(range(min = 0.0, max = 1e15), extend("unit" = "Jy"))]
    pub flux_jy: f64,
    /// Stokes Q, of the same shape, Jy.
    #[serde(default)]
    #[schemars(range(min = -1e15, max = 1e15), extend("unit" = "Jy"))]
    pub q_jy: f64,
    /// Stokes U, of the same shape, Jy.
    #[serde(default)]
    #[schemars(range(min = -1e15, max = 1e15), extend("unit" = "Jy"))]
    pub u_jy: f64,
    /// By which part of its mean the brightest side is brighter.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "a part of the mean brightness"))]
    pub asymmetry: f64,
    /// Position angle of the brightest side, degrees east of north.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees east of north"))]
    pub brightest_deg: f64,
}

/// Spots on an arc are this many of their standard deviations apart: closer, nothing of a flat arc changes in double
/// precision.
const SPACING: f64 = 0.4;

impl Tube {
    /// The spots that it is made of.
    pub fn spots(&self) -> Vec<Spot> {
        let [from, to] = self.azimuth_deg.map(f64::to_radians);
        let length = self.radius * (to - from).abs();
        let count = (length / (SPACING * self.sigma)).ceil().clamp(1.0, 1e5);
        let share = length / count / (core::f64::consts::TAU.sqrt() * self.sigma);
        let spot = |k: usize| {
            let (sin, cos) = (from + (to - from) * (k as f64 + 0.5) / count).sin_cos();
            Spot {
                center: [self.radius * cos, self.radius * sin, 0.0],
                sigma: self.sigma,
                amplitude: self.amplitude * share,
                wound_for: 0.0,
                shines: None,
            }
        };
        (0..count as usize).map(spot).collect()
    }
}

/// When emission appears and fades.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shines {
    /// Time at which it has reached half of its brightness, M; ever since without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub from: Option<f64>,
    /// Time at which it has faded to half, M; for ever without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub until: Option<f64>,
    /// Time constant of the logistic rise and decay, M.
    #[schemars(range(min = 1e-6, max = 1e9), extend("unit" = "M"))]
    pub rise: f64,
}

impl Shines {
    /// The share of the brightness at a time.
    pub fn at(&self, time: f64) -> f64 {
        let logistic = |t: f64| 1.0 / (1.0 + (-t / self.rise).exp());
        let rising = self.from.map_or(1.0, |from| logistic(time - from));
        rising * self.until.map_or(1.0, |until| logistic(until - time))
    }
}

/// What a letter looks like.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlyphShape {
    /// The letter or digit.
    pub letter: char,
    /// Its middle: x, y, z in M.
    pub center: [f64; 3],
    /// Height, above 0 M.
    pub height: f64,
    /// Extent along the axis, above 0 M.
    pub thickness: f64,
    /// Standard deviation of the blurred edges, above 0 M and at most the height.
    pub softness: f64,
    /// Emission in broad strokes.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "emission in the strokes"))]
    pub amplitude: f64,
}

/// The array that sees the simulated movie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// `EHT2017`, `ngEHT`, or an array file in eht-imaging's format.
    pub array: String,
    /// `sgra`, `m87`, or `RA,DEC` in hours and degrees.
    pub source: String,
    /// Modified Julian date.
    pub mjd: i32,
    /// Hours of UTC of the first scan and of one after the last; this or `gmst`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub utc: Option<[f64; 2]>,
    /// The same in hours of Greenwich mean sidereal time, beginning on the day `mjd`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gmst: Option<[f64; 2]>,
    /// Number of scans, a frame each.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "scans"))]
    pub scans: u32,
    /// Integration time of a scan, above 0 s.
    pub integration_s: f64,
    /// Frequency, above 0 GHz.
    pub frequency_ghz: f64,
    /// Bandwidth, above 0 GHz.
    pub bandwidth_ghz: f64,
    /// Least and greatest elevation, degrees.
    pub elevation_deg: [f64; 2],
    /// Noise that is added; errors are thermal in both cases.
    pub noise: Noise,
    /// Gain errors of the stations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gains: Option<GainErrors>,
    /// Root mean square of |d| of the leakage, drawn once for each feed; needs a loss of polarised visibilities.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "a root mean square of |d|"))]
    pub leakage: Option<f64>,
    /// Fraction of each amplitude that the fit adds to its error in quadrature.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "part of the amplitude"))]
    #[schemars(example = 0.02)]
    pub systematic: Option<f64>,
    /// Time of the first scan, M.
    #[serde(default)]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub first_time: f64,
}

/// Noise of simulated data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Noise {
    /// None; errors are those of thermal noise.
    None,
    /// Thermal.
    Thermal,
}
