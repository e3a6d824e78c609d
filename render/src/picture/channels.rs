//! Channels of pictures: the one list that rendering, `inspect` and the documents share.

use super::pixels::Pixel;
use crate::scene::DEFAULT_CHANNELS;
use crate::transport::Layers;
use crate::transport::PreparedScene;
use kerrlight_geodesic::Outcome;

/// Tests whether a scene has a channel, with pixels refined or not.
pub(super) type Present = fn(&PreparedScene, bool) -> bool;

pub(super) fn always(_: &PreparedScene, _: bool) -> bool {
    true
}

/// A channel of a picture.
pub struct ChannelKind {
    /// Its name in the file.
    pub name: &'static str,
    /// Unit, empty for a number without one.
    pub unit: &'static str,
    /// Meaning of its values.
    pub meaning: &'static str,
    /// Tests whether a scene has it, with pixels refined or not.
    pub(super) present: Present,
    /// Source of its values in a pixel.
    pub(super) value: Value,
    /// True if pictures have it only where `screen.channels` names it or its layer.
    pub on_request: bool,
    /// True if it is in the unit of intensity.
    pub(super) scales: bool,
}

/// Source of a channel in a pixel: its light and its central ray, or what is kept besides.
#[derive(Clone, Copy)]
pub(super) enum Value {
    Pixel(fn(&Pixel) -> f64),
    Layers(fn(&Layers) -> f64),
}

impl std::fmt::Debug for ChannelKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("ChannelKind").field(&self.name).finish()
    }
}

impl ChannelKind {
    /// The values of pixels as they are kept, times `unit`; `layers` are as many, or none.
    pub(super) fn values(&self, pixels: &[Pixel], layers: &[Layers], unit: f64) -> Vec<f32> {
        match self.value {
            Value::Pixel(value) => {
                pixels.iter().map(|pixel| (value(pixel) * unit) as f32).collect()
            }
            Value::Layers(value) => {
                layers.iter().map(|layer| (value(layer) * unit) as f32).collect()
            }
        }
    }

    /// Returns whether a name in `screen.channels` means it.
    pub(super) fn is_meant(&self, name: &str) -> bool {
        let default = name == DEFAULT_CHANNELS && !self.on_request;
        name == self.name || name == self.layer() || default
    }

    /// The layer that it belongs to; its own name where that has no dot.
    pub fn layer(&self) -> &'static str {
        self.name.split_once('.').map_or(self.name, |(layer, _)| layer)
    }

    const fn new(
        name: &'static str,
        unit: &'static str,
        meaning: &'static str,
        value: fn(&Pixel) -> f64,
    ) -> Self {
        let (value, present) = (Value::Pixel(value), always as Present);
        ChannelKind { name, unit, meaning, present, value, on_request: false, scales: false }
    }
}

const fn stokes(
    name: &'static str,
    meaning: &'static str,
    value: fn(&Pixel) -> f64,
) -> ChannelKind {
    ChannelKind { scales: true, ..ChannelKind::new(name, "intensity_unit", meaning, value) }
}

const LIGHT: &str = "linear light: emission in scene units times its colour, plus the sky";

/// The channels that pictures have without a request.
pub static CHANNELS: [ChannelKind; 15] = [
    ChannelKind::new("R", "scene unit", LIGHT, |p| f64::from(p.rgb[0])),
    ChannelKind::new("G", "scene unit", LIGHT, |p| f64::from(p.rgb[1])),
    ChannelKind::new("B", "scene unit", LIGHT, |p| f64::from(p.rgb[2])),
    ChannelKind {
        scales: true,
        ..ChannelKind::new(
            "intensity",
            "intensity_unit",
            "mean over the pixel, without the sky",
            |p| p.intensity,
        )
    },
    ChannelKind {
        present: |prepared, _| prepared.polarization()[0],
        ..stokes("Q", "Stokes Q, positive for polarisation along north and south", |p| p.stokes[0])
    },
    ChannelKind {
        present: |prepared, _| prepared.polarization()[0],
        ..stokes("U", "Stokes U, positive along north-east and south-west", |p| p.stokes[1])
    },
    ChannelKind {
        present: |prepared, _| prepared.polarization()[1],
        ..stokes("V", "Stokes V, positive for right-handed light (IAU)", |p| p.stokes[2])
    },
    ChannelKind {
        present: |_, refined| refined,
        scales: true,
        ..ChannelKind::new(
            "error",
            "intensity_unit",
            "estimated absolute error of the intensity, where pixels are refined",
            |p| p.error,
        )
    },
    ChannelKind {
        present: |prepared, _| prepared.has_redshift(),
        ..ChannelKind::new(
            "redshift",
            "",
            "intensity-weighted mean of g = nu_obs/nu_em along the central ray; 0 without emission",
            |p| p.center.redshift,
        )
    },
    ChannelKind::new(
        "crossings",
        "",
        "crossings of the equatorial plane outside the horizon by the central ray",
        |p| f64::from(p.center.crossings),
    ),
    ChannelKind::new(
        "radius",
        "M",
        "of the brightest contribution to the central ray; 0: none",
        |p| p.center.radius,
    ),
    ChannelKind::new("azimuth", "rad", "of the brightest contribution to the central ray", |p| {
        p.center.azimuth
    }),
    ChannelKind::new("delay", "M", "of the brightest contribution to the central ray", |p| {
        p.center.delay
    }),
    ChannelKind {
        present: |prepared, _| prepared.absorbs(),
        ..ChannelKind::new(
            "optical_depth",
            "",
            "of the gas along the central ray, up to where it ends or nothing is seen any more",
            |p| p.center.optical_depth,
        )
    },
    ChannelKind::new(
        "outcome",
        "",
        "of the central ray: 0 captured, 1 escaped, 2 met an opaque surface, 3 unresolved",
        |p| outcome_code(p.center.outcome),
    ),
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
