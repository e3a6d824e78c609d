//! What is recovered, and how.

use super::{FieldKind, FitFile, PriorOfVoxels};
use crate::fit::BatchSize;
use crate::representation::Activation;
use crate::representation::Degree;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is recovered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Representation {
    /// Kind of representation: one of kerrlight's, or the name of your own. Keys of another kind are passed over,
    /// with a note.
    pub kind: Kind,
    /// Nodes of a grid along each axis, 2^30 in all at most; 64 without it, 36 for linear-grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 2, max = 2048), extend("unit" = "nodes along each axis"))]
    pub nodes: Option<usize>,
    /// Feature grid: cells of the coarsest grid along each axis, at most 512 in the finest.
    #[serde(default = "coarsest")]
    #[schemars(range(min = 1), extend("unit" = "cells along each axis"))]
    pub coarsest: usize,
    /// Feature grid: number of grids, each twice as fine as the previous.
    #[serde(default = "levels")]
    #[schemars(range(min = 1, max = 6), extend("unit" = "grids"))]
    pub levels: usize,
    /// Last function of a grid or network.
    #[serde(default = "sigmoid")]
    pub activation: Activation,
    /// Network: units per hidden layer.
    #[serde(default = "width")]
    #[schemars(range(min = 1, max = 4096), extend("unit" = "units"))]
    pub width: usize,
    /// Network: hidden layers.
    #[serde(default = "hidden_layers")]
    #[schemars(range(min = 1, max = 64), extend("unit" = "layers"))]
    pub hidden_layers: usize,
    /// Network: degree of the positional encoding.
    #[serde(default = "degree")]
    #[schemars(range(max = 16), extend("unit" = "a degree"))]
    pub degree: usize,
    /// Network: unit of length, M.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub length_scale: f64,
    /// Network: unit of time, M.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-3, max = 1e9), extend("unit" = "M"))]
    pub time_scale: f64,
    /// Settings of a representation of your own.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "std::collections::BTreeMap<String, schemars::Schema>")]
    pub own: toml::Table,
}

impl Representation {
    /// Nodes of a grid along each axis: those that are set, or the usual number of its kind. Splines need fewer than
    /// voxels that are learnt.
    pub fn grid_nodes(&self) -> usize {
        self.nodes.unwrap_or(if self.kind == Kind::LinearGrid { 36 } else { 64 })
    }
}

/// Kinds of representations.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Network of the pulled-back point.
    Bhnerf,
    /// Network of the event.
    Mlp4d,
    /// Features on grids of several resolutions and a small network of them, at the pulled-back point.
    FeatureGrid,
    /// Voxels, learnt step by step.
    Grid,
    /// Voxels without activation, solved as the convex problem that they are.
    LinearGrid,
    /// One that a program of one's own adds.
    #[serde(untagged)]
    Own(String),
}

impl Kind {
    /// Those that kerrlight has itself.
    pub const BUILT_IN: [Kind; 5] =
        [Kind::Bhnerf, Kind::Mlp4d, Kind::FeatureGrid, Kind::Grid, Kind::LinearGrid];

    /// What `representation.kind` calls it.
    pub fn name(&self) -> &str {
        match self {
            Kind::Bhnerf => "bhnerf",
            Kind::Mlp4d => "mlp4d",
            Kind::FeatureGrid => "feature-grid",
            Kind::Grid => "grid",
            Kind::LinearGrid => "linear-grid",
            Kind::Own(name) => name,
        }
    }

    /// A few words for it.
    pub fn label(&self) -> &str {
        match self {
            Kind::Bhnerf => "network (BH-NeRF)",
            Kind::Mlp4d => "network of space and time",
            Kind::FeatureGrid => "grids of features",
            Kind::Grid => "grid of voxels",
            Kind::LinearGrid => "linear grid of voxels",
            Kind::Own(name) => name,
        }
    }

    /// Keys of `representation` that it has a use for, `kind` aside; none of one that a program adds, which says itself
    /// what it needs.
    fn keys(&self) -> Option<&'static [&'static str]> {
        Some(match self {
            Kind::Bhnerf => &["activation", "degree", "hidden_layers", "length_scale", "width"],
            Kind::Mlp4d => {
                &["activation", "degree", "hidden_layers", "length_scale", "time_scale", "width"]
            }
            Kind::FeatureGrid => &["activation", "coarsest", "levels"],
            Kind::Grid => &["activation", "nodes"],
            Kind::LinearGrid => &["nodes"],
            Kind::Own(_) => return None,
        })
    }

    /// Keys of `representation` in the text of a fit's file that are another representation's, in their order.
    pub fn foreign_keys(&self, text: &str) -> Vec<String> {
        let (Ok(table), Some(own)) = (text.parse::<toml::Table>(), self.keys()) else {
            return Vec::new();
        };
        let given = table.get("representation").and_then(toml::Value::as_table);
        let given = given.into_iter().flat_map(toml::Table::keys);
        given.filter(|key| *key != "kind" && !own.contains(&key.as_str())).cloned().collect()
    }
}

impl FitFile {
    /// Whether the kind of representation has a use for a key, given as a dotted path.
    pub fn uses(&self, key: &str) -> bool {
        let kind = &self.representation.kind;
        let of_kind = |name: &str| kind.keys().is_none_or(|keys| keys.contains(&name));
        match key.split_once('.') {
            Some(("representation", name)) => name == "kind" || of_kind(name),
            Some(("training", _)) if *kind == Kind::LinearGrid => false,
            Some(("training", "grid_rate" | "grid_last_rate")) => *kind == Kind::Grid,
            Some(("training", "feature_rate" | "feature_last_rate")) => *kind == Kind::FeatureGrid,
            Some(("training", "rate" | "last_rate")) => {
                !matches!(kind, Kind::Grid | Kind::FeatureGrid)
            }
            _ => true,
        }
    }
}

/// How it is recovered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Rule of the steps.
    pub optimiser: Optimiser,
    /// Number of steps.
    pub steps: u64,
    /// First learning rate of a network, of Adam or Muon.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Its last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
    /// First learning rate of a grid.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub grid_rate: f64,
    /// Its last learning rate.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub grid_last_rate: f64,
    /// First learning rate of a feature grid.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub feature_rate: f64,
    /// Its last learning rate.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub feature_last_rate: f64,
    /// Steps over which the rate grows from 0.
    pub ramp: u64,
    /// Data of a step.
    pub batch: BatchSize,
    /// Initial parameters.
    pub start: Start,
    /// A mask that skips dark cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occupancy: Option<Occupancy>,
    /// Steps between lines of the log.
    #[schemars(range(min = 1), extend("unit" = "steps"))]
    pub log_every: u64,
    /// Longest time between checkpoints, s.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "seconds"))]
    pub checkpoint_seconds: f64,
}

/// The linear problem of voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// Largest allowed emission.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "the largest emission"))]
    pub upper: f64,
    /// Mean flux of a frame, Jy; needed with closure quantities alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "Jy"))]
    pub flux_jy: Option<f64>,
    /// Factor on ∫ |∇e|² dV.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub smoothness: f64,
    /// Factor on ∫ e dV.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub sparsity: f64,
    /// Gaussian or log-normal prior of the voxels: every loss then has the weight 1. Not with `[change]` or
    /// `[quiescent]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorOfVoxels>,
    /// B-splines between the nodes; a scan of axes and a `[band]` use trilinear voxels.
    #[serde(default = "cubic")]
    pub degree: Degree,
    /// Rounds in which nodes may be admitted again.
    #[serde(default = "rounds")]
    pub rounds: usize,
    /// Iterations per round, at most.
    #[serde(default = "iterations")]
    pub iterations: usize,
}

impl Linear {
    /// The prior of the voxels, if it is of this kind.
    pub fn prior_of(&self, kind: FieldKind) -> Option<&PriorOfVoxels> {
        self.prior.as_ref().filter(|prior| prior.kind == kind)
    }
}

/// From where parameters start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Start {
    /// As the representation draws them.
    #[default]
    Drawn,
    /// Fitted to the solution of the linear problem on a coarse grid.
    Linear {
        /// Nodes of the linear problem along each axis.
        nodes: usize,
        /// Every so many-eth frame is used.
        stride: usize,
        /// Steps of each round of the fit to its solution, which ends within 5 % of it or after four rounds.
        steps: u64,
        /// Iterations in place of `linear.iterations`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        iterations: Option<usize>,
    },
}

/// Mask of what shines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Occupancy {
    /// Cells along each axis.
    #[schemars(range(min = 2, max = 256), extend("unit" = "cells along each axis"))]
    pub cells: usize,
    /// Cells below this fraction of the peak are empty, 0 to 1, 1 excluded; neighbours of lit cells are kept.
    pub threshold: f64,
    /// Fraction of the old brightness kept at each update, 0 to 1, 1 excluded.
    pub memory: f64,
    /// Steps before the mask is used.
    pub warm_up: u64,
    /// Steps between updates, each at a random point of every cell.
    pub every: u64,
}

/// What is known of the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum AxisSearch {
    /// It is `motion.axis`.
    Known {},
    /// It is sought on the whole sphere with coarse linear grids, and learnt from there.
    Scan(AxisScan),
    /// It is learnt from this start.
    From {
        /// Initial axis, a vector of any length.
        start: [f64; 3],
        /// First learning rate of the axis, radians a step.
        #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
        rate: f64,
        /// Last learning rate, reached linearly.
        #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
        last_rate: f64,
    },
}

/// A search of the whole sphere of axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AxisScan {
    /// Directions that are tried.
    #[schemars(range(min = 12, max = 100_000), extend("unit" = "directions"))]
    pub directions: usize,
    /// Frames of the data that are used.
    #[schemars(range(min = 2), extend("unit" = "frames"))]
    pub frames: usize,
    /// Pixels along each side; all of them if more than half.
    #[schemars(range(min = 8), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Nodes along each axis of a second search near the best axis, with all pixels; 32 is a good value for
    /// visibilities.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 8, max = 128), extend("unit" = "nodes along each axis"))]
    pub refine: Option<usize>,
    /// First learning rate of the axis, radians a step; 0 keeps the axis found.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
}

fn cubic() -> Degree {
    Degree::Cubic
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
fn coarsest() -> usize {
    8
}

fn levels() -> usize {
    4
}

fn degree() -> usize {
    3
}
fn one() -> f64 {
    1.0
}

fn rounds() -> usize {
    4
}

fn iterations() -> usize {
    200
}

impl Default for Training {
    fn default() -> Self {
        Self {
            optimiser: Optimiser::Adam,
            steps: 400,
            rate: 5e-4,
            last_rate: 5e-6,
            grid_rate: 5e-2,
            grid_last_rate: 5e-4,
            feature_rate: 1e-2,
            feature_last_rate: 1e-4,
            ramp: 30,
            batch: BatchSize::Frames(8),
            start: Start::Drawn,
            occupancy: None,
            log_every: 25,
            checkpoint_seconds: 60.0,
        }
    }
}

impl Default for Occupancy {
    fn default() -> Self {
        Self { cells: 24, threshold: 0.003, memory: 0.8, warm_up: 0, every: 20 }
    }
}

impl Default for AxisSearch {
    fn default() -> Self {
        Self::Known {}
    }
}

impl Default for AxisScan {
    fn default() -> Self {
        Self { directions: 200, frames: 16, pixels: 22, refine: None, rate: 1e-3, last_rate: 1e-5 }
    }
}

/// Rules of steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Optimiser {
    /// Steps along the mean gradient of random parts of the data.
    #[default]
    Adam,
    /// The same for all but the weight matrices of networks, which step along orthogonal matrices.
    Muon,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_keys_of_others_are_foreign() {
        let text = "[representation]\nkind = \"grid\"\nnodes = 20\nhidden_layers = 4\nwidth = 64";
        assert_eq!(Kind::Grid.foreign_keys(text), ["hidden_layers", "width"]);
        assert_eq!(Kind::Bhnerf.foreign_keys(text), ["nodes"]);
        assert!(Kind::Own("mine".to_owned()).foreign_keys(text).is_empty());
        // Each key of the table is one of a kind, or of those that a program adds.
        let all = toml::Table::try_from(Representation {
            nodes: Some(1),
            ..toml::from_str("kind = \"grid\"").unwrap()
        });
        for key in all.unwrap().keys().filter(|key| *key != "kind") {
            assert!(
                Kind::BUILT_IN.iter().any(|kind| kind.keys().unwrap().contains(&key.as_str())),
                "{key}"
            );
        }
    }

    #[test]
    fn exact_a_report_lists_what_a_kind_uses() {
        let hole = crate::fit::settings::Hole::new(0.5);
        let used = |kind, key| FitFile::new(hole.clone(), 60.0, [3.0, 9.0], kind).uses(key);
        assert!(used(Kind::Grid, "training.grid_rate") && !used(Kind::Grid, "training.rate"));
        assert!(used(Kind::Bhnerf, "representation.width") && used(Kind::Bhnerf, "hole.spin"));
        assert!(!used(Kind::LinearGrid, "training.steps"));
        assert!(!used(Kind::LinearGrid, "representation.width"));
    }

    /// What messages list is what settings are read as.
    #[test]
    fn exact_names_are_those_of_the_settings() {
        for kind in Kind::BUILT_IN {
            assert_eq!(toml::Value::try_from(&kind).unwrap().as_str(), Some(kind.name()));
        }
    }
}
