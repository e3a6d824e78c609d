//! A small fit: nine by nine rays about a hole of spin 0.6, four frames, an orbiting field that is not lit from the
//! beginning.

use kerrlight_geodesic::infall::Mixture;
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_tomo::dynamics::infall::{Falling, Law};
use kerrlight_tomo::dynamics::{AngularVelocity, Axis, Injection};
use kerrlight_tomo::fit::{
    BatchSize, Data, ForwardModel, ImageTerm, LightCurveTerm, Motion, Objective, OccupancyPlan,
    OccupancySettings, Redshift, Region, Sampling, SightlineRequest, Sightlines, State, Training,
    Weighted,
};
use kerrlight_tomo::optimise::{Adam, Polynomial};
use kerrlight_tomo::representation::{
    Activation, FeatureGrid, FeatureGridSettings, Grid, GridSettings, Network, NetworkSettings,
    Representation,
};
use std::sync::Arc;

pub const SIDE: usize = 9;
const FRAMES: usize = 4;
const REGION: Region = Region { r_min: 3.0, r_max: 6.0, z_width: 4.0 };

pub fn axis() -> Axis {
    Axis::new([0.1, 0.5, 0.8]).unwrap()
}

/// The forward model with delays and redshift.
pub fn model() -> ForwardModel<f32> {
    model_of(AngularVelocity::Keplerian { drag: 0.6 })
}

/// Between circular orbits and free fall; with β_r = 1 on circles down to the innermost stable one.
fn falling(beta_r: f64) -> AngularVelocity {
    let mixture = Mixture { xi: 0.8, beta_r, beta_phi: 0.9 };
    AngularVelocity::Falling(Arc::new(Falling::new(Law::Family { spin: 0.6, mixture }).unwrap()))
}

fn model_of(velocity: AngularVelocity) -> ForwardModel<f32> {
    let hole = Kerr::new(0.6).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(55.0).unwrap());
    let at = |k: usize| -6.0 + 12.0 * k as f64 / (SIDE - 1) as f64;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..SIDE * SIDE).map(|k| (at(k % SIDE), -at(k / SIDE))).unzip();
    let sampling = Sampling::Gauss { order: 4, split: 1 };
    let request = SightlineRequest { region: REGION, sampling, delay: true, momentum: true };
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap();
    let motion = Motion {
        velocity,
        reference: 3.0,
        injection: Some(Injection { time: 1.0 }),
        times: vec![0.0, 9.0, 17.0, 40.0],
    };
    ForwardModel::new(&lines, &motion, &hole, Some(Redshift { power: 2.5 })).unwrap()
}

/// What a loss is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Images alone.
    Images,
    /// Images and a light curve.
    ImagesAndFlux,
    /// Images of matter that falls.
    Falling,
    /// Images of matter on circles, and within the innermost stable one on its way to the horizon.
    Plunging,
}

pub fn objective(kind: Kind) -> Objective<f32> {
    let movie: Vec<f32> =
        (0..FRAMES * SIDE * SIDE).map(|k| (k as f32 * 0.37).sin().abs()).collect();
    let term = Box::new(ImageTerm::new(movie, SIDE * SIDE, 0.5).unwrap());
    let mut data = Data { image: Some(Weighted { weight: 0.7, term }), others: Vec::new() };
    if kind == Kind::ImagesAndFlux {
        let (flux, sigma) = (vec![1.0, 3.0, 2.0, 5.0], [0.5, 1.0, 2.0, 0.7]);
        let term = LightCurveTerm::new(flux, &sigma, SIDE * SIDE).unwrap();
        data.others.push(Weighted { weight: 0.4, term: Box::new(term) });
    }
    let model = match kind {
        Kind::Images | Kind::ImagesAndFlux => model(),
        Kind::Falling => model_of(falling(0.8)),
        Kind::Plunging => model_of(falling(1.0)),
    };
    Objective { model, data }
}

pub fn training(batch: BatchSize, masked: bool) -> Training {
    let rate = Polynomial { from: 3e-2, to: 1e-3, steps: 40, power: 1.0 };
    let settings = OccupancySettings { cells: 12, threshold: 0.6, memory: 0.5 };
    Training {
        seed: 11,
        adam: Adam::default(),
        muon: None,
        lbfgs: None,
        rate,
        axis_rate: None,
        ramp: 3,
        batch,
        parts: 1,
        occupancy: masked.then_some(OccupancyPlan { settings, warm_up: 10, every: 7 }),
        penalties: None,
        change: None,
        region: REGION,
        keep_every: 8,
        divergence: 1e3,
    }
}

pub fn start(representation: &dyn Representation<f32>, training: &Training) -> State<f32> {
    State::new(representation, axis(), training)
}

/// A network of another width, depth and skip than the paper's.
pub fn small() -> Network {
    let settings = NetworkSettings {
        width: 20,
        shift: -1.0,
        length_scale: 6.0,
        activation: Activation::Softplus,
        ..NetworkSettings::bhnerf()
    };
    Network::new(settings).unwrap()
}

/// The paper's network, less dark at the start.
pub fn bhnerf() -> Network {
    let settings = NetworkSettings { shift: -1.0, ..NetworkSettings::bhnerf() };
    Network::new(settings).unwrap()
}

/// Its last function takes the encoded point.
pub fn late() -> Network {
    let settings = NetworkSettings {
        width: 40,
        hidden_layers: 2,
        skip_after: Some(2),
        shift: -1.0,
        length_scale: 6.0,
        ..NetworkSettings::bhnerf()
    };
    Network::new(settings).unwrap()
}

/// Of places and times.
pub fn mlp4d() -> Network {
    let settings = NetworkSettings {
        width: 70,
        hidden_layers: 2,
        skip_after: Some(2),
        degree: 2,
        shift: 0.0,
        length_scale: 6.0,
        time_scale: 40.0,
        activation: Activation::Linear,
        ..NetworkSettings::mlp4d()
    };
    Network::new(settings).unwrap()
}

/// Voxels with other numbers of nodes along each axis, of a box that does not hold all of the region.
pub fn voxels(activation: Activation) -> Grid {
    let (low, high) = ([-6.0, -6.0, -5.0], [6.0, 5.5, 6.0]);
    Grid::new(GridSettings { nodes: [9, 7, 8], low, high, activation, initial: 0.3 }).unwrap()
}

/// Features on three grids of such a box.
pub fn features() -> FeatureGrid {
    let (low, high) = ([-6.0; 3], [6.0, 5.5, 6.0]);
    let activation = Activation::Softplus;
    let settings =
        FeatureGridSettings { coarsest: 3, levels: 3, low, high, activation, initial: -1.0 };
    FeatureGrid::new(settings).unwrap()
}
