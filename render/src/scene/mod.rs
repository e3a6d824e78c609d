//! Scenes: the black hole, the observer, the screen and the sources of light.
//!
//! A scene is a TOML text; [`Scene::parse`] checks every key, type and range, and
//! [`Scene::to_toml`] writes the resolved scene with every default spelled out.

mod camera;
mod check;
mod check_sources;
mod check_volume;
mod integrator;
mod invalid;
mod overrides;
mod rotation;
mod sources;

pub use crate::dynamics::{Perturbed, Velocity};
pub use camera::{CameraConfig, CameraKey, CameraMotion, Pose};
pub use invalid::{SceneError, line_of};
pub use overrides::apply_override;
pub use rotation::Rotation;
pub use sources::{
    Checker, Disc, Gas, GasMotion, GasProfile, Mesh, MeshVelocity, Plunging, Sky, SkyImage, Spot,
    StarCatalogue, Stars, VolumeRegion, VolumeSource,
};

use crate::Error;
use crate::polarization::MagneticField;
use invalid::Invalid;
use kerrlight_common::toml_file::{self, Keys};
pub use kerrlight_geodesic::Integrator;
use kerrlight_geodesic::{Kerr, orbits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

static KEYS: LazyLock<Keys> = LazyLock::new(Keys::of::<Scene>);

/// A complete scene: the hole, who looks at it, what shines, and how rays are traced.
///
/// Lengths and times are in M = GM/c² unless a name says otherwise. A scene comes from TOML
/// ([`Scene::parse`], the format of the program's scene files) or from code; both are checked
/// when a picture is made of them. It is plain data: [`render`](crate::picture::render()) makes the
/// picture, [`PreparedScene`](crate::transport::PreparedScene) answers for single rays.
///
/// ```
/// use kerrlight_render::scene::{Scene, apply_override};
///
/// let text = r#"
///     hole = { spin = 0.9 }
///     observer = { inclination_deg = 60.0 }
///     screen = { field_of_view_m = 30.0, width = 64 }
///     tracer = { integrator = "elliptic", tolerance = 1e-8 }
///     disc = { outer_edge = 20.0, peak_intensity = 1.0, opaque = true }
/// "#;
/// let scene = Scene::parse(text)?;
/// assert_eq!(scene.pixel_size(), 30.0 / 64.0); // M
/// assert!(scene.has_emission());
/// // Written out with its defaults it is the same scene.
/// assert_eq!(Scene::parse(&scene.to_toml())?.to_toml(), scene.to_toml());
/// let tilted = Scene::parse(&apply_override(text, "observer.inclination_deg=17")?)?;
/// assert_eq!(tilted.observer.inclination_deg, 17.0);
/// # Ok::<(), kerrlight_render::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// The black hole.
    pub hole: Hole,
    /// Place and time of the observer.
    #[serde(default)]
    pub observer: ObserverConfig,
    /// A camera in place of the observer, except its time, and of the field of view of the screen.
    pub camera: Option<CameraConfig>,
    /// Field of view and pixels.
    pub screen: Screen,
    /// Effects that are simulated. What is off is not computed.
    #[serde(default)]
    pub effects: Effects,
    /// Method by which rays are traced.
    pub tracer: TracerConfig,
    /// A thin disc in the equatorial plane with the flux profile of Page & Thorne (1974).
    pub disc: Option<Disc>,
    /// Magnetic field of the gas, for polarised light: components in the frame of the gas.
    pub magnetic_field: Option<MagneticField>,
    /// Volumetric gas with an analytic density and motion (Gold et al. 2020).
    pub gas: Option<Gas>,
    /// Gaussian hot spots on circular Keplerian orbits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spot: Vec<Spot>,
    /// Emission on the nodes of a box, carried along by rotating matter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub volume: Vec<VolumeSource>,
    /// Surfaces given as triangles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mesh: Vec<Mesh>,
    /// Sky that rays which escape see: one of four. It adds to R, G, B only.
    pub sky: Option<Sky>,
}

/// The black hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// Spin a along +z; negative: the hole rotates against +z.
    #[schemars(range(min = -1.0, max = 1.0), extend("unit" = "a/M"))]
    pub spin: f64,
    /// Mass, solar masses; needed with µas, Jy, gas, or times in seconds.
    #[schemars(range(min = 1e-20, max = 1e15), extend("unit" = "solar masses"))]
    pub mass_msun: Option<f64>,
    /// Distance, kpc; needed with µas, Jy or gas.
    #[schemars(range(min = 1e-9, max = 1e12), extend("unit" = "kpc"))]
    pub distance_kpc: Option<f64>,
}

impl Hole {
    /// GM/c³ in seconds, where the mass is known.
    pub fn seconds(&self) -> Option<f64> {
        self.mass_msun.map(kerrlight_common::units::gravitational_time)
    }

    /// The angle of 1 M in µas, where mass and distance are known.
    pub fn angle_uas(&self) -> Option<f64> {
        Some(kerrlight_common::units::gravitational_angle(self.mass_msun?, self.distance_kpc?))
    }
}

/// Place and time of the observer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ObserverConfig {
    /// Angle between +z and the line of sight, degrees; needed without `[camera]`.
    #[serde(skip_serializing_if = "is_nowhere")]
    #[schemars(range(min = 0.0, max = 180.0), extend("unit" = "degrees"))]
    pub inclination_deg: f64,
    /// Azimuth of the observer, degrees.
    #[schemars(range(min = -3600.0, max = 3600.0), extend("unit" = "degrees"))]
    pub azimuth_deg: f64,
    /// Boyer–Lindquist radius, M, at most 1e9 or `inf`; half the diagonal of the field must stay below 0.9 of it.
    #[schemars(range(min = 10.0), extend("unit" = "M"))]
    pub radius: f64,
    /// Time of observation, M.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub time: f64,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_nowhere(degrees: &f64) -> bool {
    degrees.is_nan()
}

impl Default for ObserverConfig {
    fn default() -> Self {
        let (inclination_deg, radius) = (f64::NAN, f64::INFINITY);
        ObserverConfig { inclination_deg, azimuth_deg: 0.0, radius, time: 0.0 }
    }
}

/// Part of the sky that is rendered. Exactly one of the two fields of view must be given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// Width of the field, M, 1e-9 to 1e7 a side. This or the next, without `[camera]`.
    pub field_of_view_m: Option<f64>,
    /// Width of the field, µas.
    pub field_of_view_uas: Option<f64>,
    /// Pixels per row; pixels are square.
    #[schemars(range(min = 1, max = 16_384), extend("unit" = "pixels"))]
    pub width: u32,
    /// Pixels per column; as many as per row without it.
    #[schemars(range(min = 1, max = 16_384), extend("unit" = "pixels"))]
    pub height: Option<u32>,
    /// Rays per pixel, a square number, on a regular grid.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 1024), extend("unit" = "rays"))]
    pub samples_per_pixel: u32,
    /// Sampling of photon rings, which are narrower than a pixel.
    #[serde(default)]
    pub rings: Rings,
    /// Scales `intensity` to this flux, Jy; scene units without it.
    #[schemars(range(min = 1e-30, max = 1e30), extend("unit" = "Jy"))]
    pub total_flux_jy: Option<f64>,
    /// Refines pixels until the estimated relative L1 error of `intensity` is below this value; needs
    /// `samples_per_pixel = 1`.
    #[schemars(range(min = 1e-6, max = 0.5), extend("unit" = "a part of the light"))]
    pub image_error: Option<f64>,
    /// Channels or layers to write, such as `["intensity"]` or `["default", "A", "sky"]`; `"default"` stands for
    /// all but those on request.
    pub channels: Option<Vec<String>>,
}

/// Name in `screen.channels` of the channels that are kept without it.
pub const DEFAULT_CHANNELS: &str = "default";

fn one() -> u32 {
    1
}

/// Sampling of images of higher order, next to the critical curve.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rings {
    /// Pixels next to the critical curve have more rays, placed along the images; how many depends on the pixels of the whole picture: parts of
    /// a picture are to be rendered with a regular grid.
    #[default]
    Resolved,
    /// Every pixel has `samples_per_pixel` rays on a regular grid.
    RegularGrid,
}

/// Effects that are simulated. What is off is not computed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Effects {
    /// Gravitational lensing; if off, rays are straight lines in the same coordinates.
    pub lensing: bool,
    /// Gravitational redshift and Doppler shift: I = g^{3+α} I_em of a surface, dI = g^{2+α} j ds of a volume.
    pub redshift: bool,
    /// α of the spectrum ν^−α; 1 is the law of bolometric intensity. Needed with `redshift`, unless the next key is
    /// given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -10.0, max = 10.0), extend("unit" = "an exponent"))]
    pub spectral_index: Option<f64>,
    /// 2 + α, as in fits, in place of `spectral_index`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -8.0, max = 12.0), extend("unit" = "an exponent"))]
    pub redshift_power: Option<f64>,
    /// True if emission is evaluated at the time when the light passed.
    pub slow_light: bool,
    /// True if gas absorbs what is behind it.
    pub absorption: bool,
    /// Order of the last lensed image of matter to include; 0: the direct image only; all without it. The sky stays whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 100), extend("unit" = "half-orbits"))]
    pub half_orbits: Option<u32>,
    /// Polarised synchrotron emission; needs `redshift` and `[magnetic_field]`.
    pub polarization: bool,
    /// Lorentz factor of the emitting electrons; without it V is not computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 10.0, max = 1e12), extend("unit" = "a factor"))]
    pub circular_polarization_lorentz_factor: Option<f64>,
    /// Averages the sky over the solid angle between neighbouring rays.
    pub ray_bundles: bool,
}

impl Default for Effects {
    fn default() -> Self {
        Effects {
            lensing: true,
            redshift: false,
            spectral_index: None,
            redshift_power: None,
            slow_light: false,
            absorption: false,
            half_orbits: None,
            polarization: false,
            circular_polarization_lorentz_factor: None,
            ray_bundles: false,
        }
    }
}

impl Effects {
    /// Spectral index α (dimensionless) of the emitted spectrum, if redshift is simulated.
    pub fn index(&self) -> Option<f64> {
        let given = self.spectral_index.or(self.redshift_power.map(|power| power - 2.0));
        self.redshift.then_some(given).flatten()
    }
}

/// Method by which rays are traced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TracerConfig {
    /// `elliptic` (closed form on SIMD lanes, fastest), `taylor-mino`, `dop853-mino` or `rk45-mino`.
    #[serde(with = "integrator")]
    #[schemars(with = "String")]
    pub integrator: Integrator,
    /// Local error of a step, and relative error of the light integrated along a ray.
    #[schemars(range(min = 1e-14, max = 1e-2), extend("unit" = "a part"))]
    pub tolerance: f64,
}

impl Screen {
    /// Pixels from top to bottom.
    pub fn rows(&self) -> u32 {
        self.height.unwrap_or(self.width)
    }

    /// Returns whether the picture keeps a channel that is kept unless others are requested.
    pub fn keeps(&self, channel: &str) -> bool {
        let all = |names: &Vec<String>| names.iter().any(|name| name == DEFAULT_CHANNELS);
        self.channels.as_ref().is_none_or(all) || self.asks(channel)
    }

    /// Returns whether a channel is requested, by its name or with its layer.
    pub fn asks(&self, channel: &str) -> bool {
        let layer = channel.split_once('.').map(|(layer, _)| layer);
        let named = |name: &String| name == channel || layer.is_some_and(|layer| name == layer);
        self.channels.as_ref().is_some_and(|names| names.iter().any(named))
    }
}

impl Scene {
    /// The scene in a TOML text.
    ///
    /// # Errors
    /// On syntax, unknown or missing keys, wrong types and values out of range: with the
    /// line, the key and what is allowed.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let scene: Scene = toml_file::read(text).map_err(SceneError::Syntax)?;
        let table = sources::with_own_names(toml_file::read(text).map_err(SceneError::Syntax)?);
        // Ranges first: the later checks take each value to be in its own.
        let ranges = Self::keys().check(&table).map_err(Invalid::from);
        ranges.and_then(|()| check::check(&scene)).map_err(|invalid| invalid.locate(text))?;
        Ok(scene)
    }

    /// All keys of such a file, with their documentation.
    pub fn keys() -> &'static Keys {
        &KEYS
    }

    /// Returns whether it has a source whose light counts for `intensity`: any but a sky.
    pub fn has_emission(&self) -> bool {
        let lists = [self.spot.is_empty(), self.volume.is_empty(), self.mesh.is_empty()];
        self.disc.is_some() || self.gas.is_some() || lists.contains(&false)
    }

    /// The resolved scene as TOML, defaults included: the disc's inner edge too.
    ///
    /// # Panics
    /// If a program has set a seed above 2^63 − 1, which TOML cannot hold; a scene that was read has none.
    pub fn to_toml(&self) -> String {
        let mut scene = self.clone();
        if let (Some(disc), Ok(hole)) = (&mut scene.disc, Kerr::new(self.hole.spin)) {
            disc.inner_edge.get_or_insert_with(|| orbits::isco(&hole));
        }
        scene.screen.height = Some(scene.screen.rows());
        toml_file::write(&scene).expect("plain tables always serialise") // no maps with odd keys
    }

    /// Returns whether what shines changes with time.
    pub fn changes(&self) -> bool {
        let moves = |volume: &VolumeSource| {
            volume.rotation != Rotation::None || volume.injection_time.is_some()
        };
        !self.spot.is_empty() || self.volume.iter().any(moves)
    }

    /// Width of a pixel in M; with a camera, on its picture plane at distance 1.
    pub fn pixel_size(&self) -> f64 {
        let width = match &self.camera {
            Some(camera) => camera.pose(self.observer.time).plane_width(),
            None => self.field_of_view_m(),
        };
        width / f64::from(self.screen.width)
    }

    /// Width of the field of view in M.
    pub fn field_of_view_m(&self) -> f64 {
        let of_angle = || Some(self.screen.field_of_view_uas? / self.hole.angle_uas()?);
        self.screen.field_of_view_m.or_else(of_angle).unwrap_or(f64::NAN) // excluded by `parse`
    }
}

#[cfg(test)]
mod tests;
