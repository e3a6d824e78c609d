//! What is recovered, and how.

use super::{FieldKind, PriorOfVoxels};
use crate::fit::BatchSize;
use crate::representation::Activation;
use crate::representation::Degree;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is recovered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Representation {
    /// Which: the other numbers are those of its kind.
    pub kind: Kind,
    /// Nodes of a grid along each axis; [`grid_nodes`](Self::grid_nodes) has the usual number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<usize>,
    /// Cells of the coarsest grid of features along each axis; each further one has twice as many.
    #[serde(default = "coarsest")]
    pub coarsest: usize,
    /// Grids of features.
    #[serde(default = "levels")]
    pub levels: usize,
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
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub length_scale: f64,
    /// Unit of time of a network, M.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-3, max = 1e9), extend("unit" = "M"))]
    pub time_scale: f64,
    /// Numbers of a representation that a program of one's own adds.
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

/// How it is recovered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// Rule of the steps.
    #[serde(default)]
    pub optimiser: Optimiser,
    /// Steps.
    pub steps: u64,
    /// First learning rate, in units of the parameters.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, in the same unit, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
    /// First learning rate of a grid, whose parameters are of another size than a network's; `rate`, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub grid_rate: Option<f64>,
    /// Last learning rate of a grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub grid_last_rate: Option<f64>,
    /// First learning rate of a feature grid; `rate`, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub feature_rate: Option<f64>,
    /// Last learning rate of a feature grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub feature_last_rate: Option<f64>,
    /// Steps over which rates grow to that.
    #[serde(default)]
    pub ramp: u64,
    /// What a step looks at.
    pub batch: BatchSize,
    /// From where parameters start.
    #[serde(default)]
    pub start: Start,
    /// Mask of what shines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occupancy: Option<Occupancy>,
    /// Steps from one line of the log to the next.
    #[schemars(range(min = 1), extend("unit" = "steps"))]
    pub log_every: u64,
    /// Most seconds from one checkpoint to the next.
    #[serde(default = "checkpoint_seconds")]
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "seconds"))]
    pub checkpoint_seconds: f64,
}

/// The linear problem of voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// Largest emission that is allowed.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "the largest emission"))]
    pub upper: f64,
    /// Mean flux of a frame, Jy: what closure quantities alone do not know, and need.
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
    /// A prior of the voxels; none, without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorOfVoxels>,
    /// What is between the nodes.
    #[serde(default = "cubic")]
    pub degree: Degree,
    /// Times that nodes may be admitted again.
    pub rounds: usize,
    /// Iterations of each round.
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
        /// Nodes of that grid along each axis.
        nodes: usize,
        /// Every how many-eth frame it looks at.
        stride: usize,
        /// Steps of the fit to its solution.
        steps: u64,
        /// Iterations of each round in place of those of the table `linear`: a start may be rough.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        iterations: Option<usize>,
    },
}

/// Mask of what shines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Occupancy {
    /// Cells along each axis.
    #[schemars(range(min = 2, max = 256), extend("unit" = "cells along each axis"))]
    pub cells: usize,
    /// Part of the peak below which a cell is empty.
    pub threshold: f64,
    /// The share of the brightness that is remembered from one refresh to the next.
    pub memory: f64,
    /// Steps without it.
    pub warm_up: u64,
    /// Steps from one look to the next.
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
        /// Where it starts.
        start: [f64; 3],
        /// First learning rate, in units of the parameters.
        #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
        rate: f64,
        /// Last learning rate, in the same unit, reached linearly.
        #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
        last_rate: f64,
    },
}

/// A search of the whole sphere of axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisScan {
    /// Directions that are tried.
    #[schemars(range(min = 12, max = 100_000), extend("unit" = "directions"))]
    pub directions: usize,
    /// Number of frames in use, spread over all.
    #[schemars(range(min = 2), extend("unit" = "frames"))]
    pub frames: usize,
    /// Pixels along a side of the model that is fitted to them; all that there are if it is more than half of them.
    #[schemars(range(min = 8), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Nodes along each axis of a grid with which all pixels are then fitted, for axes near the best one; without
    /// it that is the scan's.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 8, max = 128), extend("unit" = "nodes along each axis"))]
    pub refine: Option<usize>,
    /// First learning rate (radians a step) of the refinement that follows; 0: the axis stays where the scan found it.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, in the same unit, reached linearly.
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

fn checkpoint_seconds() -> f64 {
    60.0
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
    /// Quasi-Newton steps on all data, for small problems.
    Lbfgs,
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

    /// What messages list is what settings are read as.
    #[test]
    fn exact_names_are_those_of_the_settings() {
        for kind in Kind::BUILT_IN {
            assert_eq!(toml::Value::try_from(&kind).unwrap().as_str(), Some(kind.name()));
        }
    }
}
