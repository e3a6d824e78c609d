//! What a picture can hold: the one list of channels that rendering, `inspect` and the
//! documents share.

use super::RenderError;
use super::pixels::Pixel;
use crate::Error;
use crate::transport::PreparedScene;
use kerrlight_geodesic::Outcome;

/// A channel of a picture.
pub struct ChannelKind {
    /// Its name in the file.
    pub name: &'static str,
    /// Unit, empty for a number without one.
    pub unit: &'static str,
    /// What it holds.
    pub meaning: &'static str,
    /// Whether a scene has it, with pixels refined or not.
    present: fn(&PreparedScene, bool) -> bool,
    /// How it is taken from a pixel.
    value: fn(&Pixel) -> f64,
    /// Whether it is in the unit of intensity.
    pub(super) scales: bool,
}

impl std::fmt::Debug for ChannelKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("ChannelKind").field(&self.name).finish()
    }
}

impl ChannelKind {
    /// The value of a pixel as it is kept, times `unit`.
    pub(super) fn value(&self, pixel: &Pixel, unit: f64) -> f32 {
        ((self.value)(pixel) * unit) as f32
    }

    const fn new(
        name: &'static str,
        unit: &'static str,
        meaning: &'static str,
        value: fn(&Pixel) -> f64,
    ) -> Self {
        ChannelKind { name, unit, meaning, present: |_, _| true, value, scales: false }
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

/// Every channel, in the order in which they are listed.
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

/// The channels of a picture of `prepared`: all that it has, or those requested.
pub(super) fn chosen(
    prepared: &PreparedScene,
    refined: bool,
    asked: Option<&[String]>,
) -> Result<Vec<&'static ChannelKind>, Error> {
    let all: Vec<&ChannelKind> =
        CHANNELS.iter().filter(|kind| (kind.present)(prepared, refined)).collect();
    let Some(asked) = asked else { return Ok(all) };
    let find = |name: &String| all.iter().find(|kind| kind.name == name).copied();
    if let Some(name) = asked.iter().find(|name| find(name).is_none()) {
        let there: Vec<&str> = all.iter().map(|kind| kind.name).collect();
        return Err(RenderError::Channel { name: name.clone(), there: there.join(", ") }.into());
    }
    // In the list's order, each once.
    Ok(all.into_iter().filter(|kind| asked.iter().any(|name| name == kind.name)).collect())
}

/// What the channels of a picture hold, for whoever opens its file.
pub(super) fn legend(channels: &[&ChannelKind]) -> String {
    let line = |kind: &&ChannelKind| {
        let unit = if kind.unit.is_empty() { String::new() } else { format!(" ({})", kind.unit) };
        format!("{}{unit}: {}", kind.name, kind.meaning)
    };
    channels.iter().map(line).collect::<Vec<_>>().join(". ")
}
