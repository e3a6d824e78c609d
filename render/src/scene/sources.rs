//! Sources of light: gas, disc, hot spots, meshes and skies.

use super::rotation::Rotation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A volumetric flow with an analytic density and motion (Gold et al. 2020, ApJ 897, 148, section
/// 3.2), in physical units: intensities of its scene are erg s⁻¹ cm⁻² Hz⁻¹ sr⁻¹. With redshift the
/// emissivity goes like ν^−α and the absorption like ν^−(5/2 + α), α = `effects.spectral_index`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// Density over x = r/`scale_radius`.
    pub profile: GasProfile,
    /// Radius x = 1, M, above 0.
    pub scale_radius: f64,
    /// h of the factor exp(−(h cos θ)²/2): 0 for a sphere.
    #[schemars(range(min = 0.0, max = 1e4), extend("unit" = "a factor"))]
    pub flatness: f64,
    /// Motion of the gas.
    pub motion: GasMotion,
    /// Emissivity at density 1 and the observed frequency, erg s⁻¹ cm⁻³ Hz⁻¹ sr⁻¹; scales as ν^−α.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "erg s⁻¹ cm⁻³ Hz⁻¹ sr⁻¹"))]
    pub emissivity: f64,
    /// Absorption coefficient, cm⁻¹, over the emissivity; scales as ν^(−5/2 − α).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e30), extend("unit" = "cm⁻¹ over the emissivity"))]
    pub absorptivity: f64,
    /// No gas beyond, M; above the horizon.
    #[schemars(range(max = 1e6), extend("unit" = "M"))]
    pub outer_radius: f64,
    /// Linear colour of its light: R, G, B.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0.0, max = 1e6)), extend("unit" = "a colour"))]
    pub color: [f32; 3],
}

/// Profile of the density of a gas with x = r/scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum GasProfile {
    /// exp(−x²/2).
    Gaussian,
    /// x^−slope.
    PowerLaw {
        /// The slope.
        #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "an exponent"))]
        slope: f64,
    },
}

/// Motion of a gas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum GasMotion {
    /// Circles with −u_φ/u_t = l₀ R^{3/2}/(1 + R), R = r sin θ, down to the horizon.
    AngularMomentum {
        /// l₀.
        #[schemars(range(min = -10.0, max = 10.0), extend("unit" = "M"))]
        l0: f64,
    },
    /// Circles about +z with Ω = 1/(R^{3/2} + a), R = r sin θ; with redshift, dark where that is not slower than light.
    Keplerian,
    /// Falling from rest at infinity without angular momentum.
    FreeFall,
}

/// A thin disc in the equatorial plane with the flux profile of Page & Thorne (1974).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    /// Inner edge, M, at or outside the innermost stable orbit; that orbit without it.
    pub inner_edge: Option<f64>,
    /// Outer edge, M, outside the inner one.
    #[schemars(range(max = 1e9), extend("unit" = "M"))]
    pub outer_edge: f64,
    /// Intensity in the gas frame at the flux peak of the profile that starts at the innermost stable orbit,
    /// wherever the inner edge is.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub peak_intensity: f64,
    /// True if it hides what is behind it.
    pub opaque: bool,
    /// Temperature at the flux peak, K: black-body colours; with redshift only with `spectral_index = 1`.
    #[schemars(range(min = 300.0, max = 1e8), extend("unit" = "K"))]
    pub peak_temperature_k: Option<f64>,
    /// Emission of matter that falls in from the innermost stable orbit, which `inner_edge` must be; dark inside
    /// without it.
    pub plunging: Option<Plunging>,
    /// Linear colour of its light: R, G, B.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0.0, max = 1e6)), extend("unit" = "a colour"))]
    pub color: [f32; 3],
}

/// Light of a disc's matter between the innermost stable orbit and the horizon, where it falls with
/// the energy and angular momentum that it had there (Cunningham 1975, ApJ 202, 788). The flux of
/// Page & Thorne (1974) is 0 from that orbit on inward, so that it says nothing about this light:
/// I = intensity (r/r_isco)^exponent in the matter's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plunging {
    /// Intensity in the gas frame at that orbit.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub intensity: f64,
    /// Exponent of (r/r_isco) inside.
    #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "an exponent"))]
    pub exponent: f64,
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// A Gaussian hot spot on a circular Keplerian orbit about any axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Radius of the orbit, M, outside of 3 M and the photon orbit of the spin along `axis`.
    #[schemars(range(max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// Angle along the orbit at time 0, degrees.
    #[schemars(range(min = -3600.0, max = 3600.0), extend("unit" = "degrees"))]
    pub phase_deg: f64,
    /// Axis of the orbit, right-handed, a vector of any length.
    #[serde(default = "up")]
    pub axis: [f64; 3],
    /// Standard deviation, M, at most the radius.
    #[schemars(range(min = 1e-3), extend("unit" = "M"))]
    pub sigma: f64,
    /// Emissivity at the centre, intensity per M.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "intensity per M"))]
    pub peak_emissivity: f64,
    /// Time at which a round spot lights up, M, at most 2000 before `observer.time`. Differential rotation shears
    /// it from then on, and it is dark before. With slow light this is a time of emission. Rigid and always lit
    /// without it.
    pub sheared_since: Option<f64>,
    /// Linear colour of its light: R, G, B.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0.0, max = 1e6)), extend("unit" = "a colour"))]
    pub color: [f32; 3],
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// A triangle mesh as a surface. Its coordinates are r n in M: Boyer–Lindquist ones taken as
/// Cartesian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// OBJ (with its MTL), glTF or GLB file; what it refers to lies beside or below it.
    pub path: String,
    /// M per unit of the file.
    #[schemars(range(min = 1e-9, max = 1e9), extend("unit" = "M per unit of the file"))]
    pub scale: f64,
    /// x, y, z of the origin of the file, M.
    #[serde(default)]
    #[schemars(inner(range(min = -1e6, max = 1e6)), extend("unit" = "M"))]
    pub position: [f64; 3],
    /// Axis of the rotation that is applied after scaling, right-handed.
    #[serde(default = "up")]
    pub rotation_axis: [f64; 3],
    /// Its angle, degrees.
    #[serde(default)]
    #[schemars(range(min = -3600.0, max = 3600.0), extend("unit" = "degrees"))]
    pub rotation_deg: f64,
    /// True if it hides what is behind it.
    pub opaque: bool,
    /// Intensity in the frame of the surface where its colour is 1; 0: black.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub brightness: f64,
    /// Linear colour of its light: R, G, B; that of its materials without it.
    #[schemars(inner(range(min = 0.0, max = 1e6)), extend("unit" = "a colour"))]
    pub color: Option<[f32; 3]>,
    /// Motion of its matter, for the redshift, with which it is needed.
    pub velocity: Option<MeshVelocity>,
}

/// Motion of the matter of a mesh, for its redshift: the surface itself stays where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MeshVelocity {
    /// Rest in Boyer–Lindquist coordinates.
    Static,
    /// Rotation about +z with Ω(r) = 1/(r^{3/2} + a).
    Keplerian,
}

/// Emission on the nodes of a box that matter on circles about an axis carries along. Coordinates
/// are r n in M: Boyer–Lindquist ones taken as Cartesian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VolumeSource {
    /// NPZ or NPY file.
    pub path: String,
    /// Emissivity where the file has 1, intensity per M.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "intensity per M"))]
    pub factor: f64,
    /// Coordinates of the first node, M; those of the file without it.
    #[schemars(inner(range(min = -1e6, max = 1e6)), extend("unit" = "M"))]
    pub low: Option<[f64; 3]>,
    /// Coordinates of the last node, M; those of the file without it.
    #[schemars(inner(range(min = -1e6, max = 1e6)), extend("unit" = "M"))]
    pub high: Option<[f64; 3]>,
    /// Rotation axis, right-handed; that of the file without it.
    pub axis: Option<[f64; 3]>,
    /// Motion of the matter; `velocity` means the same, as fits call it.
    #[serde(alias = "velocity")]
    #[schemars(with = "super::rotation::RotationKeys")]
    pub rotation: Rotation,
    /// Time at which the volume is as in the file, M; needed if it rotates.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub reference_time: Option<f64>,
    /// Dark before this time, M; always lit without it.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub injection_time: Option<f64>,
    /// Lit only where r_min ≤ r < r_max and |z| ≤ z_width, at rest; everywhere without it.
    pub region: Option<VolumeRegion>,
    /// Linear colour of its light: R, G, B.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0.0, max = 1e6)), extend("unit" = "a colour"))]
    pub color: [f32; 3],
}

/// The table of a scene in which keys of volumes that have two names have their own.
pub(super) fn with_own_names(mut scene: toml::Table) -> toml::Table {
    let volumes = scene.get_mut("volume").and_then(toml::Value::as_array_mut);
    for volume in volumes.into_iter().flatten().filter_map(toml::Value::as_table_mut) {
        if let Some(rotation) = volume.remove("velocity") {
            volume.insert("rotation".to_owned(), rotation);
        }
    }
    scene
}

/// Region in which a volume shines: r_min ≤ r < r_max, |z| ≤ z_width, as the region of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VolumeRegion {
    /// Least radius, M.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "M"))]
    pub r_min: f64,
    /// Largest radius, M.
    #[schemars(range(max = 1e6), extend("unit" = "M"))]
    pub r_max: f64,
    /// Largest |z|, M, above 0; any without it.
    #[schemars(range(max = 1e6), extend("unit" = "M"))]
    pub z_width: Option<f64>,
}

impl VolumeRegion {
    /// Returns whether a point at height z and radius r (both in M) lies in it.
    pub fn holds(&self, z: f64, r: f64) -> bool {
        r >= self.r_min && r < self.r_max && self.z_width.is_none_or(|width| z.abs() <= width)
    }
}

/// Sky that rays which escape see: `[sky.checker]`, `[sky.stars]`, `[sky.catalogue]` or `[sky.image]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checker {
    /// Side of a square, degrees, above 0.5; divides 180.
    pub field_deg: f64,
    /// Factor on the colours.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub brightness: f64,
}

/// Random stars.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stars {
    /// Mean number of stars on the sphere.
    #[schemars(range(min = 1, max = 10_000_000), extend("unit" = "stars"))]
    pub count: u32,
    /// Radius of a star, degrees, above 0.
    #[schemars(range(max = 2.0), extend("unit" = "degrees"))]
    pub radius_deg: f64,
    /// Brightness of a star.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub brightness: f64,
    /// Seed of the pattern.
    pub seed: u64,
}

/// Stars of a catalogue, as points whose light is spread over pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StarCatalogue {
    /// CSV. Its first line names the columns: `lon`, `lat` (or `ra`, `dec`) in degrees, `magnitude` (or `mag`), and
    /// optionally `color_index` (B − V; white without it). `lon` is the azimuth, `lat` the angle above the
    /// equatorial plane of the hole.
    pub path: String,
    /// Light of a star of magnitude 0, in scene units × square degrees.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub brightness: f64,
    /// Full width at half maximum of the Gaussian point-spread function, pixels.
    #[serde(default = "two")]
    #[schemars(range(min = 1.6, max = 64.0), extend("unit" = "pixels"))]
    pub psf_fwhm_pixels: f64,
}

fn two() -> f64 {
    2.0
}

/// A picture as sky.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkyImage {
    /// Equirectangular image: PNG or JPEG (sRGB), HDR or EXR (linear).
    pub path: String,
    /// Factor on the linear colours.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "scene units"))]
    pub brightness: f64,
}
