//! Representation of the emission.

use super::{FitFile, Start};
use crate::representation::Activation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Representation of the emission. A file may hold settings of several representations, to compare them; `kind` says
/// which is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Representation {
    /// Kind of representation: one of kerrlight's, or the name of your own.
    pub kind: Kind,
    /// Last function of a grid or network that is learnt.
    #[serde(default = "sigmoid")]
    pub activation: Activation,
    /// The network of `bhnerf` and `mlp4d`.
    #[serde(default)]
    pub network: Network,
    /// Features on grids of several resolutions, and their network.
    #[serde(default)]
    pub feature_grid: FeatureGrid,
    /// Voxels that are learnt.
    #[serde(default)]
    pub grid: Grid,
    /// Voxels that are solved for.
    #[serde(default)]
    pub linear_grid: LinearGrid,
    /// A representation of your own.
    #[serde(default)]
    pub own: Own,
}

/// A network of positions, or of positions and times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Network {
    /// Units per hidden layer.
    #[schemars(range(min = 1, max = 4096), extend("unit" = "units"))]
    pub width: usize,
    /// Hidden layers.
    #[schemars(range(min = 1, max = 64), extend("unit" = "layers"))]
    pub hidden_layers: usize,
    /// Degree of the positional encoding.
    #[schemars(range(max = 16), extend("unit" = "a degree"))]
    pub degree: usize,
    /// Unit of length, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub length_scale: f64,
    /// Unit of time of `mlp4d`, M.
    #[schemars(range(min = 1e-3, max = 1e9), extend("unit" = "M"))]
    pub time_scale: f64,
    /// First learning rate.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
}

/// Features on grids of several resolutions, and a small network of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureGrid {
    /// Cells of the coarsest grid along each axis, at most 512 in the finest.
    #[schemars(range(min = 1), extend("unit" = "cells along each axis"))]
    pub coarsest: usize,
    /// Number of grids, each twice as fine as the previous.
    #[schemars(range(min = 1, max = 6), extend("unit" = "grids"))]
    pub levels: usize,
    /// First learning rate.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
}

/// Voxels that are learnt step by step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Grid {
    /// Nodes along each axis, 2^30 in all at most.
    #[schemars(range(min = 2, max = 2048), extend("unit" = "nodes along each axis"))]
    pub nodes: usize,
    /// First learning rate.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
}

/// Voxels that are solved for as a linear problem.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinearGrid {
    /// Nodes along each axis, 2^30 in all at most; after a search for the geometry as many as it needed, if these are more.
    #[schemars(range(min = 2, max = 2048), extend("unit" = "nodes along each axis"))]
    pub nodes: usize,
}

/// A representation that a program of one's own adds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Own {
    /// Settings of the representation: any keys that it reads.
    #[schemars(with = "std::collections::BTreeMap<String, schemars::Schema>")]
    pub settings: toml::Table,
    /// First learning rate.
    #[schemars(range(min = 1e-12, max = 10.0), extend("unit" = "a learning rate"))]
    pub rate: f64,
    /// Last learning rate, reached linearly.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a learning rate"))]
    pub last_rate: f64,
}

impl Representation {
    /// The usual numbers of a kind, whose emission is between 0 and 1.
    pub fn of(kind: Kind) -> Self {
        Self {
            kind,
            activation: Activation::Sigmoid,
            network: Network::default(),
            feature_grid: FeatureGrid::default(),
            grid: Grid::default(),
            linear_grid: LinearGrid::default(),
            own: Own::default(),
        }
    }

    /// First and last learning rate of its kind, and the table that holds them; none of voxels that are solved for.
    pub fn rates(&self) -> Option<(&'static str, [f64; 2])> {
        let Self { network, feature_grid, grid, own, .. } = self;
        Some(match self.kind {
            Kind::Bhnerf | Kind::Mlp4d => ("network", [network.rate, network.last_rate]),
            Kind::FeatureGrid => ("feature-grid", [feature_grid.rate, feature_grid.last_rate]),
            Kind::Grid => ("grid", [grid.rate, grid.last_rate]),
            Kind::Own(_) => ("own", [own.rate, own.last_rate]),
            Kind::LinearGrid => return None,
        })
    }

    /// Table of the settings that its kind uses.
    fn table(&self) -> &'static str {
        self.rates().map_or("linear-grid", |(table, _)| table)
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

    /// Returns its name in `representation.kind`.
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
}

impl FitFile {
    /// Returns whether the kind of representation has a use for a key, given as a dotted path.
    pub fn uses(&self, key: &str) -> bool {
        let is_solved = self.representation.kind == Kind::LinearGrid;
        match key.split('.').collect::<Vec<_>>()[..] {
            ["representation", table, _, ..] => table == self.representation.table(),
            ["representation", "activation"] | ["training", ..] => !is_solved,
            _ => true,
        }
    }

    /// Nodes along each axis of the voxels that are solved for: those of the fit, or of its start.
    pub fn voxel_nodes(&self) -> usize {
        match self.training.start {
            Start::Linear { nodes, .. } if self.representation.kind != Kind::LinearGrid => nodes,
            _ => self.representation.linear_grid.nodes,
        }
    }
}

impl Default for Network {
    fn default() -> Self {
        Self {
            width: 128,
            hidden_layers: 4,
            degree: 3,
            length_scale: 2.0,
            time_scale: 1.0,
            rate: 5e-4,
            last_rate: 5e-6,
        }
    }
}

impl Default for FeatureGrid {
    fn default() -> Self {
        Self { coarsest: 8, levels: 4, rate: 1e-2, last_rate: 1e-4 }
    }
}

impl Default for Grid {
    fn default() -> Self {
        Self { nodes: 64, rate: 5e-2, last_rate: 5e-4 }
    }
}

/// Splines need fewer nodes than voxels that are learnt.
impl Default for LinearGrid {
    fn default() -> Self {
        Self { nodes: 36 }
    }
}

impl Default for Own {
    fn default() -> Self {
        Self { settings: toml::Table::new(), rate: 5e-4, last_rate: 5e-6 }
    }
}

fn sigmoid() -> Activation {
    Activation::Sigmoid
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_report_lists_what_a_kind_uses() {
        let hole = crate::fit::settings::Hole::new(0.5);
        let used = |kind, key| FitFile::new(hole.clone(), 60.0, [3.0, 9.0], kind).uses(key);
        assert!(used(Kind::Grid, "representation.grid.rate") && used(Kind::Grid, "hole.spin"));
        assert!(!used(Kind::Grid, "representation.network.rate"));
        assert!(used(Kind::Mlp4d, "representation.network.width"));
        assert!(!used(Kind::LinearGrid, "training.steps"));
        assert!(used(Kind::LinearGrid, "representation.linear-grid.nodes"));
        assert!(!used(Kind::LinearGrid, "representation.grid.nodes"));
        assert!(!used(Kind::LinearGrid, "representation.activation"));
    }

    /// Names that messages list are those that settings are read as.
    #[test]
    fn exact_names_are_those_of_the_settings() {
        for kind in Kind::BUILT_IN {
            assert_eq!(toml::Value::try_from(&kind).unwrap().as_str(), Some(kind.name()));
        }
    }
}
