//! A small fit: nine by nine rays about a hole of spin 0.6, four frames, an orbiting field that is not lit from the
//! beginning.

use kerrlight_geodesic::infall::Mixture;
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::infall::{Falling, Family, Law};
use kerrlight_render::dynamics::{AngularVelocity, Axis, Injection};
use kerrlight_tomo::fit::{
    BatchSize, Data, ForwardModel, FrameTerm, ImageTerm, LightCurveTerm, Motion, Objective,
    OccupancySettings, Redshift, Region, Sampling, Scan, ScanTerm, SightlineRequest, Sightlines,
    State, Training, Weighted,
};
use kerrlight_tomo::optimise::LinearDecay;
use kerrlight_tomo::representation::{
    Activation, FeatureGrid, FeatureGridSettings, Grid, GridSettings, Network, NetworkSettings,
    Representation,
};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::data_terms::{AmplitudeTerm, ClosureTerm, DataTerm, Residual, VisibilityTerm};
use kerrlight_vlbi::observation::{Basis, Measured, Observation, Row};
use kerrlight_vlbi::operator::{ImageGrid, Method, Pulse, Transform};
use kerrlight_vlbi::products::ClosureKind;
use std::f64::consts::TAU;
use std::sync::Arc;

pub const SIDE: usize = 9;
const FRAMES: usize = 4;
/// Approximate light of a frame before a fit, Jy.
const LIGHT: f64 = 15.0;
const REGION: Region = Region { r_min: 3.0, r_max: 6.0, z_width: 4.0 };

pub fn axis() -> Axis {
    Axis::new([0.1, 0.5, 0.8]).unwrap()
}

/// The forward model with delays and redshift.
pub fn model() -> ForwardModel<f32> {
    model_of(AngularVelocity::Keplerian { drag: 0.6 })
}

/// Returns the motion between circular orbits and free fall; with β_r = 1 on circles down to the innermost stable
/// one.
fn falling(beta_r: f64) -> AngularVelocity {
    let mixture = Mixture { xi: 0.8, beta_r, beta_phi: 0.9 };
    let law = Law::Family(Family { spin: 0.6, mixture });
    AngularVelocity::Falling(Arc::new(Falling::new(law).unwrap()))
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

/// Kind of loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Images alone.
    Images,
    /// Images, and a light curve that the processor compares.
    ImagesAndFlux,
    /// Visibilities of three frames, and a light curve.
    Visibilities,
    /// Images, and closure phases, log closure amplitudes and amplitudes of three frames.
    Closures,
    /// Images of matter that falls.
    Falling,
    /// Images of matter on circles, and within the innermost stable one on its way to the horizon.
    Plunging,
}

/// Data that nobody else can compare.
struct Private(LightCurveTerm);

impl FrameTerm<f32> for Private {
    fn name(&self) -> &str {
        "fluxes"
    }
    fn frames(&self) -> usize {
        FrameTerm::<f32>::frames(&self.0)
    }
    fn pixels(&self) -> usize {
        FrameTerm::<f32>::pixels(&self.0)
    }
    fn degrees_of_freedom(&self, frame: usize) -> usize {
        FrameTerm::<f32>::degrees_of_freedom(&self.0, frame)
    }
    fn is_quadratic(&self) -> bool {
        true
    }
    fn value_and_gradient(&self, frame: usize, image: &[f32], weight: f32, to: &mut [f32]) -> f64 {
        self.0.value_and_gradient(frame, image, weight, to)
    }
    fn residuals(&self, frame: usize, image: &[f32]) -> Vec<Residual> {
        self.0.residuals(frame, image)
    }
}

pub fn objective(kind: Kind) -> Objective<f32> {
    let movie: Vec<f32> =
        (0..FRAMES * SIDE * SIDE).map(|k| (k as f32 * 0.37).sin().abs()).collect();
    let term = Box::new(ImageTerm::new(movie, SIDE * SIDE, 0.5).unwrap());
    let mut data = Data { image: Some(Weighted { weight: 0.7, term }), others: Vec::new() };
    if kind == Kind::Visibilities {
        data.image = None;
        data.others.push(scans("visibilities"));
    }
    if kind == Kind::Closures {
        let names = ["closure phases", "log closure amplitudes", "amplitudes"];
        data.others.extend(names.map(scans));
    }
    if matches!(kind, Kind::ImagesAndFlux | Kind::Visibilities) {
        let unit = if kind == Kind::Visibilities { LIGHT } else { 1.0 };
        let flux = [1.0, 3.0, 2.0, 5.0].map(|flux| unit * flux).to_vec();
        let sigma = [0.5, 1.0, 2.0, 0.7].map(|sigma| unit * sigma);
        let term = LightCurveTerm::new(flux, &sigma, SIDE * SIDE).unwrap();
        let term: Box<dyn FrameTerm<f32>> =
            if kind == Kind::Visibilities { Box::new(term) } else { Box::new(Private(term)) };
        data.others.push(Weighted { weight: 0.4, term });
    }
    let model = match kind {
        Kind::Falling => model_of(falling(0.8)),
        Kind::Plunging => model_of(falling(1.0)),
        _ => model(),
    };
    Objective { model, data }
}

/// Simulates the observation of a frame by six stations.
fn seen(frame: usize) -> Observation {
    let mut observation = Observation::empty(Basis::Stokes);
    for (a, b) in (0..6u16).flat_map(|a| (a + 1..6).map(move |b| (a, b))) {
        let at = |station: u16| {
            let turn = f64::from(station * station) * 1.3 + 0.2 * frame as f64;
            [turn.cos(), turn.sin()].map(|x| x * (1.0 + f64::from(station)) * 1e9)
        };
        let (here, there, number) = (at(a), at(b), f64::from(7 * a + b) + frame as f64);
        let uv = [here[0] - there[0], here[1] - there[1]];
        // Two points and an error.
        let points = [[1.0, 4e-11, 6e-11], [0.6, -9e-11, 1e-11], [0.2, number * 1e-10, 0.0]];
        let wave = |[light, east, north]: [f64; 3]| {
            Complex64::from_polar(LIGHT * light, TAU * (uv[0] * east + uv[1] * north))
        };
        let visibility = points.map(wave).iter().sum();
        let i = Measured { visibility, noise_sigma: LIGHT * (0.2 + 0.1 * number.sin()) };
        let row = Row::total_intensity(frame as f64, [a, b], uv, i);
        observation.rows.push(if (a + b) % 3 == 0 { row.swapped(Basis::Stokes) } else { row });
    }
    observation
}

/// Data of visibilities of all frames but one.
fn scans(name: &str) -> Weighted<dyn FrameTerm<f32>> {
    let sky = ImageGrid::new(SIDE, SIDE, 4e-10).unwrap();
    let scan = |frame: usize| {
        let seen = seen(frame);
        let uv = seen.rows.iter().map(|row| row.uv).collect();
        let transform =
            Transform::new(sky, Pulse::Triangle, &[uv], Method::Direct, usize::MAX).unwrap();
        let closures = |kind| Box::new(ClosureTerm::new(&seen, kind, 0.0).unwrap());
        let term: Box<dyn DataTerm<f32> + Send> = match name {
            "visibilities" => Box::new(VisibilityTerm::new(&seen).unwrap()),
            "amplitudes" => Box::new(AmplitudeTerm::new(&seen).unwrap()),
            "closure phases" => closures(ClosureKind::Phase),
            _ => closures(ClosureKind::LogAmplitude),
        };
        (frame != 2).then_some(Scan { transform, term })
    };
    let scans = (0..FRAMES).map(scan).collect();
    let term = ScanTerm::new(name, SIDE * SIDE, name == "visibilities", scans);
    Weighted { weight: 0.3, term: Box::new(term) }
}

pub fn training(batch: BatchSize, masked: bool) -> Training {
    let rate = LinearDecay { from: 3e-2, to: 1e-3, steps: 40 };
    let (cells, threshold, memory, warm_up, every) = (12, 0.6, 0.5, 10, 7);
    let mask = OccupancySettings { cells, threshold, memory, warm_up, every };
    Training {
        seed: 11,
        muon: None,
        rate,
        axis_rate: None,
        ramp: 3,
        batch,
        occupancy: masked.then_some(mask),
        change: None,
        region: REGION,
        keep_every: 8,
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

/// A network of places and times.
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

/// Voxels that are dark.
pub fn dark() -> Grid {
    let settings = GridSettings { initial: 0.0, ..*voxels(Activation::Linear).settings() };
    Grid::new(settings).unwrap()
}

/// Features on three grids of such a box.
pub fn features() -> FeatureGrid {
    let (low, high) = ([-6.0; 3], [6.0, 5.5, 6.0]);
    let activation = Activation::Softplus;
    let settings =
        FeatureGridSettings { coarsest: 3, levels: 3, low, high, activation, initial: -1.0 };
    FeatureGrid::new(settings).unwrap()
}
