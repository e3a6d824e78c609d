//! Channels on request: what compositors and engines take apart.

use super::channels::{ChannelKind, Present, Value, always};
use crate::transport::{Layers, PreparedScene};

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

/// Depth where there is nothing: what other renderers write.
const NOTHING: f64 = 1e10;

fn lensed(prepared: &PreparedScene, _: bool) -> bool {
    prepared.has_lensing()
}

fn shining(prepared: &PreparedScene, _: bool) -> bool {
    prepared.has_sources()
}

fn starlit(prepared: &PreparedScene, _: bool) -> bool {
    prepared.sky().is_some()
}

fn bent(prepared: &PreparedScene, _: bool) -> bool {
    prepared.has_sources() && prepared.has_lensing()
}

const fn channel(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    present: Present,
    value: fn(&Layers) -> f64,
) -> ChannelKind {
    let value = Value::Layers(value);
    ChannelKind { name, unit, meaning, present, value, on_request: true, scales: false }
}

/// The channels that pictures have only where `screen.channels` names them or their layers.
pub static REQUESTED: [ChannelKind; 25] = [
    channel("A", "", OPACITY, always, |l| f64::from(l.mixed.opacity.min(1.0))),
    channel("coverage", "", COVERAGE, always, |l| f64::from(l.mixed.coverage.min(1.0))),
    channel("Z", "M", DEPTH, lensed, |l| l.depth.unwrap_or(NOTHING)),
    channel("id", "", ID, always, |l| l.origin.map_or(0.0, |origin| f64::from(origin.source))),
    channel("emission.R", "scene unit", EMISSION, shining, |l| f64::from(l.mixed.emission()[0])),
    channel("emission.G", "scene unit", EMISSION, shining, |l| f64::from(l.mixed.emission()[1])),
    channel("emission.B", "scene unit", EMISSION, shining, |l| f64::from(l.mixed.emission()[2])),
    channel("sky.R", "scene unit", SKY, starlit, |l| f64::from(l.mixed.sky[0])),
    channel("sky.G", "scene unit", SKY, starlit, |l| f64::from(l.mixed.sky[1])),
    channel("sky.B", "scene unit", SKY, starlit, |l| f64::from(l.mixed.sky[2])),
    channel("n0.R", "scene unit", DIRECT, bent, |l| f64::from(l.mixed.orders[0][0])),
    channel("n0.G", "scene unit", DIRECT, bent, |l| f64::from(l.mixed.orders[0][1])),
    channel("n0.B", "scene unit", DIRECT, bent, |l| f64::from(l.mixed.orders[0][2])),
    channel("n1.R", "scene unit", FIRST, bent, |l| f64::from(l.mixed.orders[1][0])),
    channel("n1.G", "scene unit", FIRST, bent, |l| f64::from(l.mixed.orders[1][1])),
    channel("n1.B", "scene unit", FIRST, bent, |l| f64::from(l.mixed.orders[1][2])),
    channel("n2.R", "scene unit", HIGHER, bent, |l| f64::from(l.mixed.orders[2][0])),
    channel("n2.G", "scene unit", HIGHER, bent, |l| f64::from(l.mixed.orders[2][1])),
    channel("n2.B", "scene unit", HIGHER, bent, |l| f64::from(l.mixed.orders[2][2])),
    channel("st.u", "", ST_U, always, |l| l.st()[0]),
    channel("st.v", "", ST_V, always, |l| l.st()[1]),
    channel("st.a", "", ST_A, always, |l| l.st()[2]),
    channel("footprint", "sr", FOOTPRINT, lensed, |l| l.footprint),
    channel("motion.u", "pixels/M", MOTION_U, bent, |l| l.motion[0]),
    channel("motion.v", "pixels/M", MOTION_V, bent, |l| l.motion[1]),
];
