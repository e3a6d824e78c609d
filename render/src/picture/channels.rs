//! Channels of pictures: the one list that rendering, `inspect` and the documents share.

use super::pixels::Pixel;
use crate::scene::DEFAULT_CHANNELS;
use crate::transport::{Layers, PreparedScene};
use kerrlight_geodesic::Outcome;

/// A channel of a picture.
#[derive(Debug)]
pub struct ChannelKind {
    /// Its name in the file.
    pub name: &'static str,
    /// Unit, empty for a number without one.
    pub unit: &'static str,
    /// Meaning of its values.
    pub meaning: &'static str,
    /// Tests whether a scene has it, with pixels refined or not.
    pub(super) present: Present,
    value: Value,
}

type Present = fn(&PreparedScene, bool) -> bool;

/// Source of a channel in a pixel: its light and its central ray, or what is kept besides, on request.
#[derive(Debug)]
enum Value {
    Pixel(fn(&Pixel) -> f64),
    Layers(fn(&Layers) -> f64),
}

impl ChannelKind {
    /// The values of pixels as they are kept, intensities times `unit`; `layers` are as many, or none.
    pub(super) fn values(&self, pixels: &[Pixel], layers: &[Layers], unit: f64) -> Vec<f32> {
        let unit = if self.scales() { unit } else { 1.0 };
        match self.value {
            Value::Pixel(value) => {
                pixels.iter().map(|pixel| (value(pixel) * unit) as f32).collect()
            }
            Value::Layers(value) => {
                layers.iter().map(|layer| (value(layer) * unit) as f32).collect()
            }
        }
    }

    /// Returns whether it is in the unit of intensity.
    pub(super) fn scales(&self) -> bool {
        self.unit == INTENSITY
    }

    /// Returns whether pictures have it only where `screen.channels` names it or its layer.
    pub fn is_on_request(&self) -> bool {
        matches!(self.value, Value::Layers(_))
    }

    /// Returns whether a name in `screen.channels` means it.
    pub(super) fn is_meant(&self, name: &str) -> bool {
        let default = name == DEFAULT_CHANNELS && !self.is_on_request();
        name == self.name || name == self.layer() || default
    }

    /// The layer that it belongs to; its own name where that has no dot.
    pub fn layer(&self) -> &'static str {
        self.name.split_once('.').map_or(self.name, |(layer, _)| layer)
    }
}

const fn channel(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    present: Present,
    value: fn(&Pixel) -> f64,
) -> ChannelKind {
    ChannelKind { name, unit, meaning, present, value: Value::Pixel(value) }
}

const fn on_request(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    present: Present,
    value: fn(&Layers) -> f64,
) -> ChannelKind {
    ChannelKind { name, unit, meaning, present, value: Value::Layers(value) }
}

const ALWAYS: Present = |_, _| true;
const REFINED: Present = |_, refined| refined;
const ABSORBING: Present = |prepared, _| prepared.absorbs();
const SHIFTED: Present = |prepared, _| prepared.has_redshift();
const LINEAR: Present = |prepared, _| prepared.polarization()[0];
const CIRCULAR: Present = |prepared, _| prepared.polarization()[1];
const LENSED: Present = |prepared, _| prepared.has_lensing();
const SHINING: Present = |prepared, _| prepared.has_sources();
const STARLIT: Present = |prepared, _| prepared.sky().is_some();
const BENT: Present = |prepared, _| prepared.has_sources() && prepared.has_lensing();

const LIGHT: &str = "linear light: emission in scene units times its colour, plus the sky";
const MEAN: &str = "mean over the pixel, without the sky";
const STOKES_Q: &str = "Stokes Q, positive for polarisation along north and south";
const STOKES_U: &str = "Stokes U, positive along north-east and south-west";
const STOKES_V: &str = "Stokes V, positive for right-handed light (IAU)";
const ERROR: &str = "estimated absolute error of the intensity, where pixels are refined";
const REDSHIFT: &str =
    "intensity-weighted mean of g = nu_obs/nu_em along the central ray; 0 without emission";
const CROSSINGS: &str = "crossings of the equatorial plane outside the horizon by the central ray";
const RADIUS: &str = "of the brightest contribution to the central ray; 0: none";
const BRIGHTEST: &str = "of the brightest contribution to the central ray";
const DEPTH_OF_GAS: &str =
    "of the gas along the central ray, up to where it ends or nothing is seen any more";
const OUTCOME: &str =
    "of the central ray: 0 captured, 1 escaped, 2 met an opaque surface, 3 unresolved";
const OPACITY: &str = "share of the light from behind that is held up: by the horizon, opaque surfaces and absorbing gas";
const COVERAGE: &str = "share of the pixel in which anything is opaque or shines";
const DEPTH: &str = "path length to the brightest contribution, or else to the surface or horizon that ends the central \
                     ray; 1e10: none";
const ID: &str = "number of the source of the brightest contribution, or else of the surface or horizon that ends the \
                  central ray; 0: sky";
const EMISSION: &str = "linear light without the sky";
const SKY: &str = "linear light of the sky";
const DIRECT: &str = "linear light of the direct image";
const FIRST: &str = "linear light of the first lensed image";
const HIGHER: &str = "linear light of the second lensed image and all later ones";
const ST_U: &str = "where the central ray meets a picture of the sky, from 0 left to 1 right";
const ST_V: &str = "where the central ray meets a picture of the sky, from 0 below to 1 above";
const ST_A: &str = "1 where the central ray meets the sky";
const FOOTPRINT: &str = "solid angle of the sky that the pixel covers; 0: none";
const MOTION_U: &str = "motion to the right of the matter that is the brightest contribution";
const MOTION_V: &str = "motion upwards of the matter that is the brightest contribution";

/// The unit of intensity.
const INTENSITY: &str = "intensity_unit";

/// Depth where there is nothing: what other renderers write.
const NOTHING: f64 = 1e10;

/// Every channel, those on request last.
pub static CHANNELS: [ChannelKind; 40] = [
    channel("R", "scene unit", LIGHT, ALWAYS, |p| f64::from(p.rgb[0])),
    channel("G", "scene unit", LIGHT, ALWAYS, |p| f64::from(p.rgb[1])),
    channel("B", "scene unit", LIGHT, ALWAYS, |p| f64::from(p.rgb[2])),
    channel("intensity", INTENSITY, MEAN, ALWAYS, |p| p.intensity),
    channel("Q", INTENSITY, STOKES_Q, LINEAR, |p| p.stokes[0]),
    channel("U", INTENSITY, STOKES_U, LINEAR, |p| p.stokes[1]),
    channel("V", INTENSITY, STOKES_V, CIRCULAR, |p| p.stokes[2]),
    channel("error", INTENSITY, ERROR, REFINED, |p| p.error),
    channel("redshift", "", REDSHIFT, SHIFTED, |p| p.center.redshift),
    channel("crossings", "", CROSSINGS, ALWAYS, |p| f64::from(p.center.crossings)),
    channel("radius", "M", RADIUS, ALWAYS, |p| p.center.radius),
    channel("azimuth", "rad", BRIGHTEST, ALWAYS, |p| p.center.azimuth),
    channel("delay", "M", BRIGHTEST, ALWAYS, |p| p.center.delay),
    channel("optical_depth", "", DEPTH_OF_GAS, ABSORBING, |p| p.center.optical_depth),
    channel("outcome", "", OUTCOME, ALWAYS, |p| outcome_code(p.center.outcome)),
    on_request("A", "", OPACITY, ALWAYS, |l| f64::from(l.mixed.opacity.min(1.0))),
    on_request("coverage", "", COVERAGE, ALWAYS, |l| f64::from(l.mixed.coverage.min(1.0))),
    on_request("Z", "M", DEPTH, LENSED, |l| l.depth.unwrap_or(NOTHING)),
    on_request("id", "", ID, ALWAYS, |l| l.origin.map_or(0.0, |origin| f64::from(origin.source))),
    on_request("emission.R", "scene unit", EMISSION, SHINING, |l| f64::from(l.mixed.emission()[0])),
    on_request("emission.G", "scene unit", EMISSION, SHINING, |l| f64::from(l.mixed.emission()[1])),
    on_request("emission.B", "scene unit", EMISSION, SHINING, |l| f64::from(l.mixed.emission()[2])),
    on_request("sky.R", "scene unit", SKY, STARLIT, |l| f64::from(l.mixed.sky[0])),
    on_request("sky.G", "scene unit", SKY, STARLIT, |l| f64::from(l.mixed.sky[1])),
    on_request("sky.B", "scene unit", SKY, STARLIT, |l| f64::from(l.mixed.sky[2])),
    on_request("n0.R", "scene unit", DIRECT, BENT, |l| f64::from(l.mixed.orders[0][0])),
    on_request("n0.G", "scene unit", DIRECT, BENT, |l| f64::from(l.mixed.orders[0][1])),
    on_request("n0.B", "scene unit", DIRECT, BENT, |l| f64::from(l.mixed.orders[0][2])),
    on_request("n1.R", "scene unit", FIRST, BENT, |l| f64::from(l.mixed.orders[1][0])),
    on_request("n1.G", "scene unit", FIRST, BENT, |l| f64::from(l.mixed.orders[1][1])),
    on_request("n1.B", "scene unit", FIRST, BENT, |l| f64::from(l.mixed.orders[1][2])),
    on_request("n2.R", "scene unit", HIGHER, BENT, |l| f64::from(l.mixed.orders[2][0])),
    on_request("n2.G", "scene unit", HIGHER, BENT, |l| f64::from(l.mixed.orders[2][1])),
    on_request("n2.B", "scene unit", HIGHER, BENT, |l| f64::from(l.mixed.orders[2][2])),
    on_request("st.u", "", ST_U, ALWAYS, |l| l.st()[0]),
    on_request("st.v", "", ST_V, ALWAYS, |l| l.st()[1]),
    on_request("st.a", "", ST_A, ALWAYS, |l| l.st()[2]),
    on_request("footprint", "sr", FOOTPRINT, LENSED, |l| l.footprint),
    on_request("motion.u", "pixels/M", MOTION_U, BENT, |l| l.motion[0]),
    on_request("motion.v", "pixels/M", MOTION_V, BENT, |l| l.motion[1]),
];

/// The number of an outcome in pictures, where the reason for giving up a ray does not matter.
fn outcome_code(outcome: Outcome) -> f64 {
    match outcome {
        Outcome::Captured => 0.0,
        Outcome::Escaped => 1.0,
        Outcome::Surface => 2.0,
        Outcome::Unresolved(_) => 3.0,
    }
}
