//! What a fit's file may say. Numbers that decide the result have no default.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Frames of a simulated movie, or of an observation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub movie: Option<Movie>,
    /// What is simulated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// What data are simulated with where that differs from what the fit assumes: any part of `hole`,
    /// `observer`, `region`, `effects` and `motion`.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub world: toml::Table,
    /// The array that sees the simulated movie.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observation: Option<Observation>,
    /// Files, instead of a simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<DataFiles>,
    /// What is compared with the data.
    pub loss: Vec<Loss>,
    /// Penalties on the emission beside the data; none unless asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regulariser: Vec<super::penalty::Setting>,
    /// Where regularisers look at a network; a grid has nodes of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probe: Option<super::penalty::ProbeSetting>,
    /// What is recovered.
    pub representation: Representation,
    /// How.
    pub training: Training,
    /// The linear problem of voxels: needed for `linear-grid`, a start from it and a scan of axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<Linear>,
    /// What is known of the axis.
    pub axis: AxisSearch,
    /// The recovered volume.
    pub output: Output,
}

/// The hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// a, M.
    pub spin: f64,
    /// Mass in solar masses; needed for hours and microarcseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_msun: Option<f64>,
    /// Distance; needed for microarcseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_kpc: Option<f64>,
}

/// From where it is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observer {
    /// Angle to the spin axis.
    pub inclination_deg: f64,
    /// M; infinity without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
}

/// Pixels of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// Along each side.
    pub pixels: usize,
    /// Width in M: of the outer edges, or from the first to the last pixel's centre.
    pub width: f64,
    /// What the width is of.
    pub width_of: WidthOf,
    /// Field of view on the sky, if it is not `width` in units of the hole's angular size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field_uas: Option<f64>,
    /// Jy in a pixel of a sight line with 1 M of emission 1.
    pub jy_per_pixel: f64,
}

/// What a width is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WidthOf {
    /// The pixels' outer edges.
    Edges,
    /// The centres of the first and the last pixel.
    Centers,
}

/// Where emission is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Least radius, M.
    pub r_min: f64,
    /// Largest radius, M.
    pub r_max: f64,
    /// Largest |z|, M.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z_width: Option<f64>,
    /// Nodes on rays.
    pub nodes: Nodes,
}

/// Nodes on rays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Nodes {
    /// Gauss–Legendre panels in Mino time inside r_max.
    Gauss {
        /// Nodes of a panel.
        order: usize,
        /// Cuts of the coarsest panels.
        split: u32,
    },
    /// Equidistant in Mino time with chords as weights, as BH-NeRF has them.
    EqualMinoTime {
        /// Nodes of a ray.
        per_ray: usize,
    },
}

/// What happens to light.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effects {
    /// Whether light takes its time.
    #[serde(default)]
    pub slow_light: bool,
    /// Emission goes like g to this power; without it there is no redshift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub redshift_power: Option<f64>,
    /// A grey medium at rest that dims what lies behind it; what shines does not absorb.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absorption: Option<Absorption>,
}

/// κ = coefficient · exp(−½ [(r/radius)² + (z/height)²]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Absorption {
    /// Per M.
    pub coefficient: f64,
    /// M.
    pub radius: f64,
    /// M.
    pub height: f64,
}

/// How matter turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Angular velocity about the axis.
    pub velocity: Velocity,
    /// The axis of the truth, or the known one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// When the volume is what it is.
    pub reference_time: f64,
    /// When it begins to shine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub injection_time: Option<f64>,
}

/// Angular velocity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Velocity {
    /// 1/(r^{3/2} + drag).
    Keplerian {
        /// The spin, for orbits about it.
        drag: f64,
    },
    /// rate · (radius/r)^exponent.
    PowerLaw {
        /// M.
        radius: f64,
        /// Radians a unit of time.
        rate: f64,
        /// 1.5 without spin.
        exponent: f64,
    },
    /// Linear between these.
    Table {
        /// Growing, M.
        radii: Vec<f64>,
        /// Radians a unit of time.
        rates: Vec<f64>,
    },
    /// Another velocity, and a Gaussian process over the radius that is drawn from the fit's seed.
    Perturbed {
        /// The velocity without it.
        of: Box<Velocity>,
        /// Its standard deviation, radians a unit of time.
        deviation: f64,
        /// Its correlation length, M.
        correlation_length: f64,
        /// The first and the last radius of its table of 100 rows, M.
        radii: [f64; 2],
    },
}

/// Frames of a movie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Movie {
    /// How many.
    pub frames: usize,
    /// Time of the first.
    pub from: f64,
    /// Time of the last.
    pub to: f64,
}

/// What is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Gaussian spots at the reference time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spot: Vec<Spot>,
    /// Letters and digits at the reference time, flat in the plane across the axis.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub glyph: Vec<Glyph>,
}

/// A letter that is extruded along the axis, its upper side away from the hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glyph {
    /// Which.
    pub letter: char,
    /// Its middle, M.
    pub center: [f64; 3],
    /// From its lower to its upper edge, M.
    pub height: f64,
    /// Along the axis, M.
    pub thickness: f64,
    /// Standard deviation of its blurred edges, M.
    pub softness: f64,
    /// Emission in the middle of broad strokes.
    pub amplitude: f64,
}

/// A Gaussian spot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Where it was when it was round, M.
    pub center: [f64; 3],
    /// Standard deviation, M.
    pub sigma: f64,
    /// Emission at its centre.
    pub amplitude: f64,
    /// For how long differential rotation has wound it up until the reference time, in units of time.
    #[serde(default)]
    pub wound_for: f64,
}

/// The array that sees the simulated movie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// EHT2017, ngEHT, or a file in eht-imaging's format.
    pub array: String,
    /// sgra, m87, or RA,DEC.
    pub source: String,
    /// Modified Julian date.
    pub mjd: i32,
    /// Hours of UTC from the first scan to one after the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub utc: Option<[f64; 2]>,
    /// The same in hours of Greenwich mean sidereal time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gmst: Option<[f64; 2]>,
    /// Scans.
    pub scans: u32,
    /// Integration time of a scan, s.
    pub integration_s: f64,
    /// Frequency in GHz.
    pub frequency_ghz: f64,
    /// Bandwidth in GHz.
    pub bandwidth_ghz: f64,
    /// Elevations at which stations observe.
    pub elevation_deg: [f64; 2],
    /// Noise that is added to the data.
    pub noise: Noise,
    /// Errors of station gains, none unless asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gains: Option<Gains>,
    /// Time of the first scan, M.
    pub first_time: f64,
}

/// Noise of simulated data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Noise {
    /// None; errors are those of thermal noise.
    None,
    /// Thermal.
    Thermal,
}

/// Random errors of station gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gains {
    /// Standard deviation of ln |g|, one number a station for the whole observation.
    pub constant_amplitude: f64,
    /// Standard deviation of ln |g|, another number for every scan.
    pub scan_amplitude: f64,
    /// Whether phases are uniform on the circle, for every station and scan.
    pub random_phases: bool,
}

/// Measured data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum DataFiles {
    /// Visibilities: UVFITS, eht-imaging's text, the EHT's tables or CSV.
    Visibilities {
        /// The file, relative to the fit's.
        path: PathBuf,
        /// Rows this close in time are averaged and make a frame, s.
        average_s: f64,
        /// Part of each amplitude that is added to its error in quadrature: for what calibration has left.
        systematic: f64,
        /// Time of the first frame, M.
        first_time: f64,
    },
    /// A movie in Jy/pixel: .npz, .npy, .csv, .fits or .exr.
    Movie {
        /// The file, relative to the fit's.
        path: PathBuf,
    },
}

/// Data and their share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Loss {
    /// Which.
    pub data: LossKind,
    /// Factor on χ² a datum.
    pub weight: f64,
    /// Standard deviation of a pixel (image) or of the flux (light curve), Jy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Least signal-to-noise ratio of baselines of closure quantities.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_snr: Option<f64>,
}

/// Kinds of data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LossKind {
    /// Every pixel.
    Image,
    /// Complex visibilities.
    Visibilities,
    /// Debiased amplitudes.
    Amplitudes,
    /// Closure phases.
    ClosurePhases,
    /// Log closure amplitudes.
    LogClosureAmplitudes,
    /// Total flux.
    LightCurve,
}

/// What is recovered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Representation {
    /// Which: the other numbers are those of its kind.
    pub kind: Kind,
    /// Nodes of a grid along each axis.
    #[serde(default = "grid_nodes")]
    pub nodes: usize,
    /// Last function of a grid, or of a network's output − 10.
    #[serde(default = "sigmoid")]
    pub activation: Activation,
    /// Units of a hidden layer.
    #[serde(default = "width")]
    pub width: usize,
    /// Hidden layers.
    #[serde(default = "hidden_layers")]
    pub hidden_layers: usize,
    /// Positional encoding degree.
    #[serde(default = "degree")]
    pub degree: usize,
    /// Unit of length of a network, M.
    #[serde(default = "one")]
    pub length_scale: f64,
    /// Unit of time of a network, M.
    #[serde(default = "one")]
    pub time_scale: f64,
    /// Numbers of a representation that a program of one's own adds.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub own: toml::Table,
}

/// Kinds of representations.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Network of the pulled-back point.
    Bhnerf,
    /// Network of the event.
    Mlp4d,
    /// Voxels, learnt step by step.
    Grid,
    /// Voxels without activation, solved as the convex problem that they are.
    LinearGrid,
    /// One that a program of one's own adds.
    #[serde(untagged)]
    Own(String),
}

/// Last function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// Between 0 and 1.
    Sigmoid,
    /// Above 0.
    Softplus,
    /// None; parameters are held at 0 or above.
    Linear,
}

/// How it is recovered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// Rule of the steps.
    #[serde(default)]
    pub optimiser: Optimiser,
    /// Steps.
    pub steps: u64,
    /// First rate.
    pub rate: f64,
    /// Last rate, reached linearly.
    pub last_rate: f64,
    /// First rate of a grid, whose parameters are of another size than a network's; `rate`, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid_rate: Option<f64>,
    /// Last rate of a grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid_last_rate: Option<f64>,
    /// Steps over which rates grow to that.
    #[serde(default)]
    pub ramp: u64,
    /// What a step looks at.
    pub batch: Batch,
    /// From where parameters start.
    #[serde(default)]
    pub start: Start,
    /// Mask of what shines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occupancy: Option<Occupancy>,
    /// Steps from one line of the log to the next.
    pub log_every: u64,
    /// Most seconds from one checkpoint to the next.
    #[serde(default = "checkpoint_seconds")]
    pub checkpoint_seconds: f64,
}

/// The linear problem of voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// Largest emission that is allowed.
    pub upper: f64,
    /// Factor on ∫ |∇e|² dV.
    #[serde(default)]
    pub smoothness: f64,
    /// Factor on ∫ e dV.
    #[serde(default)]
    pub sparsity: f64,
    /// Times that nodes may be admitted again.
    pub rounds: usize,
    /// Iterations of each round.
    pub iterations: usize,
}

/// From where parameters start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// As the representation draws them.
    #[default]
    Drawn,
    /// Fitted to the solution of the linear problem on a coarse grid.
    Linear {
        /// Nodes of that grid along each axis.
        nodes: usize,
        /// Every how many-eth frame it looks at.
        stride: usize,
        /// Steps of the fit to its solution.
        steps: u64,
    },
}

/// What a step looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Batch {
    /// Random pixels of random frames: images only.
    Pixels(usize),
    /// Random frames, whole.
    Frames(usize),
    /// All frames.
    All,
}

/// Mask of what shines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Occupancy {
    /// Cells along each axis.
    pub cells: usize,
    /// Part of the peak below which a cell is empty.
    pub threshold: f64,
    /// What is remembered from one look to the next.
    pub memory: f64,
    /// Steps without it.
    pub warm_up: u64,
    /// Steps from one look to the next.
    pub every: u64,
}

/// What is known of the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum AxisSearch {
    /// It is `motion.axis`.
    Known {},
    /// It is sought on the whole sphere with coarse linear grids, and learnt from there.
    Scan {
        /// Directions that are tried.
        directions: usize,
        /// Frames that are looked at, spread over all.
        frames: usize,
        /// First rate of what follows; 0: it stays where the scan has found it.
        rate: f64,
        /// Last rate, reached linearly.
        last_rate: f64,
    },
    /// It is learnt from this start.
    From {
        /// Where it starts.
        start: [f64; 3],
        /// First rate.
        rate: f64,
        /// Last rate, reached linearly.
        last_rate: f64,
    },
}

/// The recovered volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Nodes of the volume along each axis.
    pub nodes: usize,
}

fn grid_nodes() -> usize {
    64
}
fn sigmoid() -> Activation {
    Activation::Sigmoid
}
fn width() -> usize {
    128
}
fn hidden_layers() -> usize {
    4
}
fn degree() -> usize {
    3
}
fn one() -> f64 {
    1.0
}
fn checkpoint_seconds() -> f64 {
    60.0
}

/// Rules of steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Optimiser {
    /// Steps along the mean gradient of random parts of the data.
    #[default]
    Adam,
    /// Quasi-Newton steps on all data, for small problems.
    Lbfgs,
}
