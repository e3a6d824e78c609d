//! Representations that have kernels.

use super::adam::Learning;
use super::grid::{Level, Levels};
use super::kernels::Field;
use super::network::Network;
use super::pixels::Points;
use super::shape::{Front, Shape};
use crate::Error;
use crate::fit::learning::device::DeviceError;
use crate::representation::{
    Activation, BuiltIn, FeatureGrid, FeatureGridSettings, GridSettings, NetworkSettings,
    Representation,
};
use kerrlight_geodesic::gpu::Compute;

/// Puts the kernels of a representation there; with `of_places` they find dL/dplace, too.
///
/// # Errors
/// If it has none, or the device fails.
pub fn on_device(
    device: &Compute,
    representation: &dyn Representation<f32>,
    points: &Points,
    learning: &Learning,
    most: Option<usize>,
    of_places: bool,
) -> Result<Field, Error> {
    let network = |shape: &Shape| Network::new(device, shape, points, learning, most, of_places);
    Ok(match representation.built_in() {
        Some(BuiltIn::Network(of)) => network(&shape(of.settings()))?.field,
        Some(BuiltIn::Grid(grid)) => {
            voxels(grid.settings()).voxels(device, points, learning, of_places)?
        }
        Some(BuiltIn::FeatureGrid(grid)) => {
            let levels = levels(grid.settings());
            let network = network(&behind(grid.settings(), &levels))?;
            levels.features(device, network, points, learning, of_places)?
        }
        None => {
            return Err(DeviceError("representation.kind: no kernels".to_owned()).into());
        }
    })
}

/// Returns whether parameters are held at zero or above.
pub fn is_positive(representation: &dyn Representation<f32>) -> bool {
    let Some(BuiltIn::Grid(grid)) = representation.built_in() else { return false };
    grid.settings().activation == Activation::Linear
}

/// The number of a last function in shaders.
fn number(activation: Activation) -> u32 {
    match activation {
        Activation::Sigmoid => 0,
        Activation::Softplus => 1,
        Activation::Linear => 2,
    }
}

fn shape(settings: &NetworkSettings) -> Shape {
    let length = (1.0 / settings.length_scale) as f32;
    let first = match settings.dimension {
        4 => (1.0 / settings.time_scale) as f32,
        _ => length,
    };
    Shape {
        front: Front::Encoded {
            scales: [first, length, length, length],
            dimension: settings.dimension,
            degree: settings.degree,
        },
        start: 0,
        width: settings.width,
        hidden: settings.hidden_layers,
        skip: settings.skip_after,
        activation: number(settings.activation),
        shift: settings.shift as f32,
    }
}

/// Nodes of a box, so many along each axis.
fn level(nodes: [usize; 3], low: [f64; 3], high: [f64; 3], planes: usize) -> Level {
    let per_length = |k: usize| ((nodes[k] - 1) as f64 / (high[k] - low[k])) as f32;
    Level {
        low: low.map(|x| x as f32),
        nodes,
        per_length: [0, 1, 2].map(per_length),
        planes,
        offset: 0,
    }
}

fn voxels(settings: &GridSettings) -> Levels {
    let all = vec![level(settings.nodes, settings.low, settings.high, 1)];
    Levels { all, activation: number(settings.activation) }
}

/// The grids of features, coarsest first, as parameters have them.
fn levels(settings: &FeatureGridSettings) -> Levels {
    let mut offset = 0;
    let made = |k: usize| {
        let nodes = [(settings.coarsest << k) + 1; 3];
        let made =
            Level { offset, ..level(nodes, settings.low, settings.high, FeatureGrid::FEATURES) };
        offset += FeatureGrid::FEATURES * nodes[0].pow(3);
        made
    };
    Levels {
        all: (0..settings.levels).map(made).collect(),
        activation: number(settings.activation),
    }
}

/// The network behind them.
fn behind(settings: &FeatureGridSettings, levels: &Levels) -> Shape {
    Shape {
        front: Front::Given(levels.columns()),
        start: levels.parameters(),
        width: FeatureGrid::WIDTH,
        hidden: 2,
        skip: None,
        activation: number(settings.activation),
        shift: 0.0,
    }
}
