//! Settings of a fit: what is assumed, which data are compared with the model, and how emission is recovered.
//!
//! They are a TOML text; [`FitFile::parse`] checks every key, type and range. Numbers that decide the result have no
//! default.

mod band;
mod data;
mod error;
mod gaussian;
mod held_out;
mod instrument;
mod keys;
mod light_curve;
mod medium;
mod merge;
mod plain;
mod quantity;
mod recovery;
mod representation;
mod simulation;
mod unknown_geometry;
mod unknowns;
mod view;

pub use band::{BackgroundSettings, BandSettings, Steps};
pub use data::{DataFiles, Loss, LossKind, check_losses};
pub use error::FitError;
pub use error::{Within, refuse};
pub use gaussian::{FieldKind, FieldSettings, Negative, PriorOfVoxels};
pub use held_out::{HeldOutSettings, Weight};
pub use instrument::{GainPhases, GainSettings, InstrumentSettings, LeakageSettings};
pub use keys::{check_ranges, read};
pub use light_curve::{MeanFlux, MeasuredCurve, PerStokes, SimulatedCurve};
pub use medium::{Scattering, Variability};
pub use merge::merge;
pub use quantity::{PriorSettings, Quantity};
pub use recovery::{
    AxisScan, AxisSearch, ChangeSettings, Linear, Optimiser, QuiescentSettings, Start, Training,
};
pub use representation::{FeatureGrid, Grid, Kind, LinearGrid, Network, Own, Representation};
pub use simulation::{
    GlyphShape, Movie, Noise, Observation, Ring, Shines, Simulation, Spot, Truth, Tube,
};
pub use unknown_geometry::{GeometrySearch, SearchView, UnknownGeometry};
pub use view::{Absorption, Effects, Hole, Motion, Observer, PixelShape, Region, Screen, WidthOf};

use crate::Error;
use kerrlight_render::polarization::PolarizationLaw;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The settings of a fit. Lengths and times in M = GM/c² unless a name says otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitFile {
    /// Title of the report, one line.
    #[serde(default)]
    pub title: String,
    /// Seed of noise, initial parameters and all random draws.
    #[serde(default = "seed")]
    pub seed: u64,
    /// The black hole.
    pub hole: Hole,
    /// Place of the observer.
    pub observer: Observer,
    /// Square pixels of the model.
    pub screen: Screen,
    /// Region of the emission, and sampling of rays in it.
    pub region: Region,
    /// Effects on light, each off unless given.
    #[serde(default)]
    pub effects: Effects,
    /// Motion of the emitting matter: circles about an axis, or with a radial velocity.
    pub motion: Motion,
    /// Magnetic field of the gas and its polarised light; total intensity alone without it.
    pub polarization: Option<PolarizationLaw>,
    /// Chooses a number of the linear problem by cross-validation.
    pub held_out: Option<HeldOutSettings>,
    /// Emission that changes while matter carries it; without this table it does not.
    pub change: Option<ChangeSettings>,
    /// Emission that does not move, recovered beside the rest: an image on the screen, or a constant flux of each
    /// Stokes parameter of a light curve.
    pub quiescent: Option<QuiescentSettings>,
    /// Simulated data, in place of measured ones.
    pub simulation: Option<Simulation>,
    /// Measured data.
    pub data: Option<DataFiles>,
    /// The search for numbers that have a prior in place of a value.
    pub search: Option<GeometrySearch>,
    /// Instrumental parameters that are fitted with the emission.
    pub instrument: Option<InstrumentSettings>,
    /// Terms of the loss, the sum of weight · χ² per datum.
    pub loss: Vec<Loss>,
    /// Representation of the recovered emission.
    pub representation: Representation,
    /// Optimisation of the representation.
    #[serde(default)]
    pub training: Training,
    /// The linear problem of voxels, for linear-grid, a linear start, a scan of axes and searches.
    pub linear: Option<Linear>,
    /// The rotation axis: known, fitted from a start, or searched.
    #[serde(default)]
    pub axis: AxisSearch,
    /// Geometries that are compared first, by a flare in an orbital band.
    pub band: Option<BandSettings>,
    /// The recovered volume.
    #[serde(default)]
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
        Ok(read(text, Self::keys())?)
    }

    /// Returns whether the data are visibilities, measured or simulated.
    pub fn has_visibilities(&self) -> bool {
        let simulated = self.observation().is_some() && self.simulated_curve().is_none();
        matches!(self.data, Some(DataFiles::Visibilities { .. })) || simulated
    }

    /// Times of the first and the last image of a movie, M; none if data are no movie.
    pub fn span_of_images(&self) -> Option<[f64; 2]> {
        let simulated =
            || self.simulation.as_ref()?.movie.as_ref().map(|movie| [movie.from, movie.to]);
        match &self.data {
            Some(DataFiles::Movie { from, to, .. }) => Some([*from, *to]),
            _ => simulated(),
        }
    }
}

fn seed() -> u64 {
    1
}

impl Default for Output {
    fn default() -> Self {
        Self { nodes: 64 }
    }
}

/// The recovered volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Nodes along each axis.
    #[schemars(range(min = 2, max = 512), extend("unit" = "nodes along each axis"))]
    pub nodes: usize,
}
