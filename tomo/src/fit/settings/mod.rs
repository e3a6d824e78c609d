//! Settings of a fit: what is assumed, which data are compared with the model, and how emission is recovered.
//!
//! They are a TOML text; [`FitFile::parse`] checks every key, type and range. Numbers that decide the result have no
//! default.

mod band;
mod change;
mod data;
mod error;
mod faraday;
mod gaussian;
mod held_out;
mod instrument;
mod keys;
mod light_curve;
mod medium;
mod penalties;
mod plain;
mod quiescent;
mod recovery;
mod simulation;
mod static_image;
mod static_polarization;
mod unknown_world;
mod unknowns;
mod view;
mod world;
mod world_search;

pub use band::{BackgroundSettings, BandSettings, Steps};
pub use change::ChangeSettings;
pub use data::{DataFiles, Loss, LossKind};
pub use error::FitError;
pub(crate) use error::{Within, refuse};
pub use faraday::FaradaySettings;
pub use gaussian::{FieldKind, FieldSettings, Negative, PriorOfVoxels};
pub use held_out::{HeldOutBy, HeldOutSettings, Weight};
pub use instrument::{GainPhases, GainSettings, InstrumentSettings, LeakageSettings};
pub use light_curve::{MeanFlux, MeasuredCurve, PerStokes, SimulatedBackground, SimulatedCurve};
pub use medium::{Scattering, Variability};
pub use penalties::{PenaltyKind, PenaltySettings, ProbeSettings};
pub use quiescent::QuiescentSettings;
pub use recovery::{
    AxisScan, AxisSearch, Kind, Linear, Occupancy, Optimiser, Representation, Start, Training,
};
pub use simulation::{GlyphShape, Movie, Noise, Observation, Ring, Shines, Spot, Truth, Tube};
pub use static_image::{
    EnvelopeSettings, ImageSettings, RingSettings, StartImage, StaticData, StaticImageFile,
    StaticVisibilities, StrengthSettings,
};
pub use static_polarization::StaticPolarization;
pub use unknown_world::{PriorSettings, UnknownWorld};
pub use view::{Absorption, Effects, Hole, Motion, Observer, PixelShape, Region, Screen, WidthOf};
pub use world::merge;
pub use world_search::{WorldSearch, WorldSteps, WorldView};

use crate::Error;
use kerrlight_common::toml_file;
use kerrlight_render::polarization::PolarizationLaw;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The settings of a fit. Lengths and times in M = GM/c² unless a name says otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitFile {
    /// One line that says what is fitted.
    pub title: String,
    /// Seed of noise, of the first parameters and of all draws.
    pub seed: u64,
    /// The hole.
    pub hole: Hole,
    /// From where it is seen.
    pub observer: Observer,
    /// Pixels of the model.
    pub screen: Screen,
    /// Where emission is looked for, and how rays are sampled there.
    pub region: Region,
    /// What happens to light, each off unless asked.
    #[serde(default)]
    pub effects: Effects,
    /// How matter turns.
    pub motion: Motion,
    /// The field of the gas and its polarised light; total intensity alone, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polarization: Option<PolarizationLaw>,
    /// A rotation of all position angles that is looked for; none, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faraday: Option<FaradaySettings>,
    /// A weight that is chosen by data that are held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutSettings>,
    /// How emission may change while matter carries it; not at all, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<ChangeSettings>,
    /// What does not move, recovered beside the emission; nothing, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quiescent: Option<QuiescentSettings>,
    /// Frames of a simulated movie, or of an observation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub movie: Option<Movie>,
    /// What is simulated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// What data are simulated with where that differs from what the fit assumes: any part of `hole`,
    /// `observer`, `region`, `effects` and `motion`; and what of the world the fit does not know
    /// ([`UnknownWorld`]).
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "unknown_world::WorldKeys")]
    pub world: toml::Table,
    /// The array that sees the simulated movie.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observation: Option<Observation>,
    /// The light curve of the simulation, of a source that is not resolved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_curve: Option<SimulatedCurve>,
    /// Files, instead of a simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<DataFiles>,
    /// What of the instrument is solved for; nothing, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument: Option<InstrumentSettings>,
    /// What is compared with the data.
    pub loss: Vec<Loss>,
    /// Penalties on the emission beside the data; none unless asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regulariser: Vec<PenaltySettings>,
    /// Where regularisers look at a network; a grid has nodes of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probe: Option<ProbeSettings>,
    /// What is recovered.
    pub representation: Representation,
    /// How.
    pub training: Training,
    /// The linear problem of voxels: needed for `linear-grid`, a start from it and a scan of axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<Linear>,
    /// What is known of the axis.
    pub axis: AxisSearch,
    /// Worlds that are compared first by the light curve of a flare in an orbital band.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band: Option<BandSettings>,
    /// The recovered volume.
    pub output: Output,
}

impl FitFile {
    /// The settings in a TOML text.
    ///
    /// # Errors
    /// On syntax, unknown or missing keys, wrong types and numbers out of range: with the line, the key and what is
    /// allowed.
    ///
    /// # Examples
    /// ```
    /// # use kerrlight_tomo::fit::settings::FitFile;
    /// let error = FitFile::parse("title = \"A flare\"\nseed = 1").unwrap_err();
    /// assert!(error.to_string().contains("missing field `hole`"));
    /// ```
    pub fn parse(text: &str) -> Result<Self, Error> {
        let file = toml_file::read(text).map_err(FitError::Syntax)?;
        keys::check(text, Self::keys())?;
        Ok(file)
    }

    /// Whether the data are visibilities, measured or simulated.
    pub fn has_visibilities(&self) -> bool {
        let simulated = self.observation.is_some() && self.light_curve.is_none();
        matches!(self.data, Some(DataFiles::Visibilities { .. }))
            || (self.data.is_none() && simulated)
    }
}

/// The recovered volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Nodes of the volume along each axis.
    #[schemars(range(min = 2, max = 512), extend("unit" = "nodes along each axis"))]
    pub nodes: usize,
}
