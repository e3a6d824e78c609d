//! From settings to what is recovered and how it is learnt.

use super::config::{self, Activation, FitFile, Kind};
use super::setup::region;
use crate::program::{OwnSettings, own};
use anyhow::{Context, bail};
use kerrlight_tomo::fit::{BatchSize, OccupancyPlan, OccupancySettings, Region, Training};
use kerrlight_tomo::optimise::{Adam, Lbfgs, Polynomial};
use kerrlight_tomo::representation::{
    self, FeatureGrid, FeatureGridSettings, Grid, GridSettings, Network, NetworkSettings,
};

/// What is recovered.
pub fn representation(
    file: &FitFile,
) -> anyhow::Result<Box<dyn representation::Representation<f32>>> {
    let chosen = &file.representation;
    let network = |settings: NetworkSettings| {
        Network::new(NetworkSettings {
            degree: chosen.degree,
            width: chosen.width,
            hidden_layers: chosen.hidden_layers,
            skip_after: settings.skip_after.filter(|layer| *layer <= chosen.hidden_layers),
            length_scale: chosen.length_scale,
            time_scale: chosen.time_scale,
            activation: activation(chosen.activation),
            ..settings
        })
        .context("representation")
    };
    let r = file.region.r_max;
    Ok(match &chosen.kind {
        Kind::Own(name) => own(name, &own_settings(file))?,
        Kind::Bhnerf => Box::new(network(NetworkSettings::bhnerf())?),
        Kind::Mlp4d => Box::new(network(NetworkSettings::mlp4d())?),
        Kind::FeatureGrid if chosen.activation == Activation::Linear => bail!(
            "representation.activation = linear is not allowed: sigmoid or softplus with feature-grid, whose network's output has any sign"
        ),
        Kind::FeatureGrid => {
            let settings = FeatureGridSettings {
                coarsest: chosen.coarsest,
                levels: chosen.levels,
                low: [-r; 3],
                high: [r; 3],
                activation: activation(chosen.activation),
                initial: FAINT,
            };
            Box::new(FeatureGrid::new(settings).context("representation")?)
        }
        Kind::Grid | Kind::LinearGrid => {
            // As dark as a network starts, sigmoid(−10).
            let (activation, initial) = match chosen.activation {
                _ if chosen.kind == Kind::LinearGrid => (representation::Activation::Linear, 0.0),
                Activation::Linear => (representation::Activation::Linear, 0.0),
                other => (activation(other), -10.0),
            };
            let settings = GridSettings {
                nodes: [chosen.nodes; 3],
                low: [-r; 3],
                high: [r; 3],
                activation,
                initial,
            };
            Box::new(Grid::new(settings).context("representation")?)
        }
    })
}

/// A feature grid starts with a faint glow, 1/55: darker ones start late.
const FAINT: f64 = -4.0;

fn own_settings(file: &FitFile) -> OwnSettings {
    let Region { r_min, r_max, z_width } = region(&file.region);
    OwnSettings { r_min, r_max, z_width, table: file.representation.own.clone() }
}

fn activation(chosen: Activation) -> representation::Activation {
    match chosen {
        Activation::Sigmoid => representation::Activation::Sigmoid,
        Activation::Softplus => representation::Activation::Softplus,
        Activation::Linear => representation::Activation::Linear,
    }
}

/// How it is learnt.
pub fn training(file: &FitFile, axis_rate: Option<Polynomial>) -> anyhow::Result<Training> {
    let chosen = &file.training;
    let (name, rate) = rates(file);
    let batch = match chosen.batch {
        config::Batch::Pixels(0) | config::Batch::Frames(0) => {
            bail!("training.batch of 0 is not allowed: 1 or more")
        }
        config::Batch::Pixels(count) => BatchSize::Pixels(count),
        config::Batch::Frames(count) => BatchSize::Frames(count),
        config::Batch::All => BatchSize::All,
    };
    let lbfgs = lbfgs(file)?;
    if chosen.log_every == 0 {
        bail!("training.log_every = 0 is not allowed: 1 or more");
    }
    let occupancy = chosen.occupancy.as_ref().map(occupancy).transpose()?;
    if occupancy.is_some() && file.representation.kind == Kind::Mlp4d {
        bail!("training.occupancy is not for mlp4d, which has no co-rotating coordinates");
    }
    Ok(Training {
        seed: file.seed,
        adam: Adam::default(),
        lbfgs,
        rate: rate.checked().context(name)?,
        axis_rate,
        ramp: chosen.ramp,
        batch,
        occupancy,
        penalties: super::penalty::penalties(file)?,
        region: region(&file.region),
        keep_every: 50,
        divergence: 1e3,
    })
}

/// What is allowed and most probably not meant.
pub fn caution(file: &FitFile) -> Option<&'static str> {
    let training = &file.training;
    let is_dark = file.representation.kind == Kind::Grid && training.start == config::Start::Drawn;
    (is_dark && training.occupancy.is_some()).then_some(
        "a grid that starts in the dark is lit node by node: the mask of training.occupancy takes what is still dark for \
         empty, and holds it back; leave the mask out, or take a linear start",
    )
}

/// Rates, and what they are called: voxels may have their own, as their parameters are of another size.
fn rates(file: &FitFile) -> (&'static str, Polynomial) {
    let chosen = &file.training;
    let (from, to, name) = match (&file.representation.kind, chosen.grid_rate) {
        (Kind::Grid, Some(from)) => {
            (from, chosen.grid_last_rate.unwrap_or(chosen.last_rate), "training.grid_rate")
        }
        (Kind::FeatureGrid, _) if chosen.feature_rate.is_some() => (
            chosen.feature_rate.unwrap_or(chosen.rate),
            chosen.feature_last_rate.unwrap_or(chosen.last_rate),
            "training.feature_rate",
        ),
        _ => (chosen.rate, chosen.last_rate, "training.rate"),
    };
    (name, Polynomial { from, to, steps: chosen.steps, power: 1.0 })
}

fn occupancy(chosen: &config::Occupancy) -> anyhow::Result<OccupancyPlan> {
    let config::Occupancy { cells, threshold, memory, warm_up, every } = *chosen;
    if !(2..=256).contains(&cells) {
        bail!("training.occupancy.cells = {cells} is not allowed: 2 to 256");
    }
    for (name, value) in [("threshold", threshold), ("memory", memory)] {
        if !(0.0..1.0).contains(&value) {
            bail!("training.occupancy.{name} = {value} is not allowed: 0 to 1, 1 excluded");
        }
    }
    Ok(OccupancyPlan {
        settings: OccupancySettings { cells, threshold, memory },
        warm_up,
        every: every.max(1),
    })
}

/// Quasi-Newton steps, if they are asked for and the loss is the same at every step.
fn lbfgs(file: &FitFile) -> anyhow::Result<Option<Lbfgs>> {
    if file.training.optimiser == config::Optimiser::Adam {
        return Ok(None);
    }
    if file.training.batch != config::Batch::All {
        bail!(
            "training.optimiser = lbfgs needs the same data at every step: give training.batch = \"all\" (pixels and frames are random)"
        );
    }
    let linear = file.representation.activation == Activation::Linear;
    if file.representation.kind == Kind::Grid && linear {
        bail!(
            "training.optimiser = lbfgs knows no bounds: a grid with activation linear is held at 0 or above; take representation = linear-grid, or activation sigmoid or softplus"
        );
    }
    Ok(Some(Lbfgs::default()))
}
