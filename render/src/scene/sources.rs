//! What shines: gas, disc, hot spots, meshes and skies.

use super::rotation::Rotation;
use serde::{Deserialize, Serialize};

/// A volumetric flow with an analytic density and motion (Gold et al. 2020, ApJ 897, 148, section
/// 3.2), in physical units: intensities of its scene are erg s⁻¹ cm⁻² Hz⁻¹ sr⁻¹. With redshift the
/// emissivity goes like ν^−α and the absorption like ν^−(5/2 + α), α = `effects.spectral_index`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// How the density falls with the radius.
    pub profile: GasProfile,
    /// The radius x = 1 of the profile, in M.
    pub scale_radius: f64,
    /// h of the density's factor exp(−(h cos θ)²/2): 0 for a sphere.
    pub flatness: f64,
    /// How it moves.
    pub motion: GasMotion,
    /// Emissivity at density 1 and the observed frequency, in erg s⁻¹ cm⁻³ Hz⁻¹ sr⁻¹.
    pub emissivity: f64,
    /// Absorption coefficient in cm⁻¹ over the emissivity.
    #[serde(default)]
    pub absorptivity: f64,
    /// Radius in M beyond which there is none.
    pub outer_radius: f64,
    /// Linear colour of its light in the R, G, B channels, dimensionless.
    #[serde(default = "white")]
    pub color: [f32; 3],
}

/// How the density of a gas falls with x = r/scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum GasProfile {
    /// exp(−x²/2).
    Gaussian,
    /// x^−slope.
    PowerLaw {
        /// The slope.
        slope: f64,
    },
}

/// How a gas moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum GasMotion {
    /// On circles with −u_φ/u_t = l₀ R^{3/2}/(1 + R), R = r sin θ, down to the horizon.
    AngularMomentum {
        /// l₀.
        l0: f64,
    },
    /// On circles about +z with Ω = 1/(R^{3/2} + a), R = r sin θ; dark where that is not slower
    /// than light.
    Keplerian,
    /// Falling from rest at infinity without angular momentum.
    FreeFall,
}

/// A thin disc in the equatorial plane with the flux profile of Page & Thorne (1974).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    /// Inner edge in M; without it the innermost stable circular orbit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inner_edge: Option<f64>,
    /// Outer edge in M.
    pub outer_edge: f64,
    /// Intensity in the gas frame where the flux profile peaks; it defines the scene units.
    pub peak_intensity: f64,
    /// Whether the disc hides what is behind it.
    pub opaque: bool,
    /// Temperature in K where the flux profile peaks, of a disc that shines like a black body: its
    /// R, G, B are those of a black body, times its colour, which is white then unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_temperature_k: Option<f64>,
    /// Matter that falls in from the innermost stable orbit; without it all is dark inside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plunging: Option<Plunging>,
    /// Linear colour of its light in the R, G, B channels, dimensionless.
    #[serde(default = "white")]
    pub color: [f32; 3],
}

/// Light of a disc's matter between the innermost stable orbit and the horizon, where it falls with
/// the energy and angular momentum that it had there (Cunningham 1975, ApJ 202, 788). The flux of
/// Page & Thorne (1974) is 0 from that orbit on inward, so that it says nothing about this light:
/// I = intensity (r/r_isco)^exponent in the matter's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plunging {
    /// Intensity in the matter's frame at the innermost stable orbit, scene units.
    pub intensity: f64,
    /// Exponent of r.
    pub exponent: f64,
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// A Gaussian hot spot on a circular Keplerian orbit about any axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Orbit radius in M.
    pub radius: f64,
    /// Angle along the orbit at time 0, in degrees from the image of the x axis when z is
    /// tipped onto the orbit's axis along the shortest way.
    pub phase_deg: f64,
    /// Axis of the orbit, a vector of any length; the spot turns about it right-handed.
    #[serde(default = "up")]
    pub axis: [f64; 3],
    /// Standard deviation of the Gaussian in M.
    pub sigma: f64,
    /// Emissivity at the centre, in intensity per M.
    pub peak_emissivity: f64,
    /// Time in M since which differential rotation shears the spot; without it the spot keeps
    /// its shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheared_since: Option<f64>,
    /// Linear colour of its light in the R, G, B channels, dimensionless.
    #[serde(default = "white")]
    pub color: [f32; 3],
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// A triangle mesh as a surface. Its coordinates are r n in M: Boyer–Lindquist ones taken as
/// Cartesian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// OBJ, glTF or GLB file, relative to the scene file.
    pub path: String,
    /// M for one unit of the file.
    pub scale: f64,
    /// Where the file's origin comes to lie, in M.
    #[serde(default)]
    pub position: [f64; 3],
    /// Axis about which it is turned first, a vector of any length.
    #[serde(default = "up")]
    pub rotation_axis: [f64; 3],
    /// By how much it is turned, right-handed, in degrees.
    #[serde(default)]
    pub rotation_deg: f64,
    /// Whether it hides what is behind it.
    pub opaque: bool,
    /// Intensity in scene units, in the surface's frame, where its colour is 1; 0: black.
    pub brightness: f64,
    /// Linear colour of its light (R, G, B; dimensionless); without it that of its materials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<[f32; 3]>,
    /// How its matter moves; needed when `effects.redshift` is on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<MeshVelocity>,
}

/// How the matter of a mesh moves, for its redshift: the surface itself stays where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MeshVelocity {
    /// At rest in Boyer–Lindquist coordinates.
    Static,
    /// About +z with Ω(r) = 1/(r^{3/2} + a).
    Keplerian,
}

/// Emission on the nodes of a box that matter on circles about an axis carries along. Coordinates
/// are r n in M: Boyer–Lindquist ones taken as Cartesian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VolumeSource {
    /// NPZ or NPY file, relative to the scene file.
    pub path: String,
    /// Emissivity where the file has 1, in intensity per M.
    pub factor: f64,
    /// Coordinates of the first node in M; without it those of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<[f64; 3]>,
    /// Coordinates of the last node in M; without it those of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<[f64; 3]>,
    /// Axis about which it turns right-handed, a vector of any length; without it that of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// How fast it turns; `velocity` means the same, as fits call it.
    #[serde(alias = "velocity")]
    pub rotation: Rotation,
    /// Time in M at which it is as in the file; needed if it turns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_time: Option<f64>,
    /// Time in M before which nothing of it shines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub injection_time: Option<f64>,
    /// Where it shines, at rest while matter passes through; wherever the file has light without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<VolumeRegion>,
    /// Linear colour of its light in the R, G, B channels, dimensionless.
    #[serde(default = "white")]
    pub color: [f32; 3],
}

/// Where a volume shines: r_min ≤ r < r_max, |z| ≤ z_width, as the region of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VolumeRegion {
    /// Least radius, M.
    pub r_min: f64,
    /// Largest radius, M.
    pub r_max: f64,
    /// Largest |z|, M; any without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z_width: Option<f64>,
}

impl VolumeRegion {
    /// Whether a point at height z and radius r (both in M) lies in it.
    pub fn holds(&self, z: f64, r: f64) -> bool {
        r >= self.r_min && r < self.r_max && self.z_width.is_none_or(|width| z.abs() <= width)
    }
}

/// What the rays that escape see: `[sky.checker]`, `[sky.stars]`, `[sky.catalogue]` or `[sky.image]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
#[non_exhaustive]
pub enum Sky {
    /// A checkered sphere with a colour per quadrant, to see how directions are bent.
    Checker(Checker),
    /// Random stars, the same for the same seed.
    Stars(Stars),
    /// Stars of a catalogue.
    Catalogue(StarCatalogue),
    /// An equirectangular picture as seen from inside with +z up: azimuth 0 at the centre
    /// and growing to the left, +z along the upper edge.
    Image(SkyImage),
}

/// A checkered sky.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checker {
    /// Side of a field in degrees; must divide 180.
    pub field_deg: f64,
    /// Factor on the linear colours.
    pub brightness: f64,
}

/// Random stars.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stars {
    /// Mean number of stars on the whole sphere.
    pub count: u32,
    /// Angular radius of a star's disc in degrees.
    pub radius_deg: f64,
    /// Factor on the linear colours.
    pub brightness: f64,
    /// Seed of the pattern.
    pub seed: u64,
}

/// Stars of a catalogue, as points whose light is spread over pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StarCatalogue {
    /// CSV file, relative to the scene file.
    pub path: String,
    /// Light of a star of magnitude 0, in scene units × square degrees.
    pub brightness: f64,
    /// Full width at half maximum of the Gaussian point-spread function, in pixels.
    #[serde(default = "two")]
    pub psf_fwhm_pixels: f64,
}

fn two() -> f64 {
    2.0
}

/// A picture as sky.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkyImage {
    /// PNG, JPEG, HDR or EXR file, relative to the scene file.
    pub path: String,
    /// Factor on the linear colours.
    pub brightness: f64,
}
