//! Cost of representations, forward and with the gradient and a step of Adam, over the size of the
//! batch, beside the rate of a large matrix product in the same run. The gradient is checked first,
//! so that nothing wrong is timed.
//!
//! Times are processor time a thread (Linux; elsewhere wall time), which other work on the machine disturbs least. Threads are
//! as many as `RAYON_NUM_THREADS` says.

#[path = "support/mod.rs"]
mod support;

use core::ops::Range;
use kerrlight_tomo::optimise::AdamState;
use kerrlight_tomo::representation::{
    Activation, Coordinates, FeatureGrid, FeatureGridSettings, Gradient, Grid, GridSettings,
    Groups, Network, NetworkSettings, Representation, Workspace,
};
use support::{large_sgemm, least, wanted};

const BATCHES: [usize; 3] = [1_000, 57_344, 1_000_000];

/// A representation with a batch and a state of Adam.
struct Run<'a> {
    representation: &'a dyn Representation<f32>,
    columns: [Vec<f32>; 4],
    parameters: Vec<f32>,
    gradient: Vec<f32>,
    values: Vec<f32>,
    cotangents: Vec<f32>,
    state: AdamState<f32>,
    workspace: Workspace,
}

impl<'a> Run<'a> {
    fn new(representation: &'a dyn Representation<f32>, points: usize) -> Self {
        let wave = |step: f64| (0..points).map(move |k| (5.0 * (k as f64 * step).sin()) as f32);
        let count = representation.parameters();
        let mut parameters = vec![0.0; count];
        representation.initialise(1, &mut parameters);
        // Away from the kinks of rectified units, where differences are no derivatives.
        let jitter = |k: usize| (0.05 * (k as f64 * 1.618).sin()) as f32;
        parameters.iter_mut().enumerate().for_each(|(k, parameter)| *parameter += jitter(k));
        Self {
            representation,
            columns: [0.177, 0.655, 1.292, 0.911].map(|step| wave(step).collect()),
            parameters,
            gradient: vec![0.0; count],
            values: vec![0.0; points],
            cotangents: wave(2.3).collect(),
            state: AdamState::new(count),
            workspace: Workspace::new(),
        }
    }

    fn eval(&mut self) {
        let at = coordinates(&self.columns, self.representation.dimension());
        let (values, workspace) = (&mut self.values, &mut self.workspace);
        self.representation.eval(&self.parameters, at, values, workspace);
    }

    fn vjp(&mut self) {
        let at = coordinates(&self.columns, self.representation.dimension());
        self.gradient.fill(0.0);
        let gradient = Gradient { parameters: &mut self.gradient, coordinates: None };
        let (cotangents, workspace) = (&self.cotangents, &mut self.workspace);
        self.representation.vjp(&self.parameters, at, cotangents, gradient, workspace);
    }

    /// Values and the gradient at once, for cotangents that are known beforehand; 50 points a ray.
    fn both(&mut self) {
        let at = coordinates(&self.columns, self.representation.dimension());
        self.gradient.fill(0.0);
        let gradient = Gradient { parameters: &mut self.gradient, coordinates: None };
        let (all, points) = (&self.cotangents, self.values.len());
        let starts: Vec<usize> = (0..points).step_by(50).chain([points]).collect();
        let link = |groups: Range<usize>, _: &[f32], cotangents: &mut [f32]| {
            cotangents.copy_from_slice(&all[starts[groups.start]..starts[groups.end]]);
        };
        let groups = Groups { starts: &starts, link: &link };
        let (values, workspace) = (&mut self.values, &mut self.workspace);
        self.representation.eval_vjp(&self.parameters, at, groups, values, gradient, workspace);
    }

    fn step(&mut self) {
        self.vjp();
        self.state.step(1e-5, &self.gradient, &mut self.parameters);
        self.representation.project(&mut self.parameters);
    }

    /// Directional derivative of Σ cotangent · value along the gradient, by differences.
    fn check(&mut self) {
        self.vjp();
        let dot = |a: &[f32], b: &[f32]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let size = dot(&self.gradient, &self.gradient);
        let start = self.parameters.clone();
        let mut sum = |scale: f64| {
            let moved = start.iter().zip(&self.gradient).map(|(x, g)| x + scale as f32 * g);
            self.parameters = moved.collect();
            self.eval();
            dot(&self.values, &self.cotangents)
        };
        let step = 1e-3 / size.sqrt();
        let difference = (sum(step) - sum(-step)) / (2.0 * step);
        self.parameters = start;
        assert!((difference / size - 1.0).abs() < 0.02, "{difference:e} {size:e}");
    }
}

fn coordinates(columns: &[Vec<f32>; 4], dimension: usize) -> Coordinates<'_, f32> {
    let [x, y, z, t] = columns;
    Coordinates::of(dimension, t, [x, y, z])
}

/// A name, what it names, and its operations a point.
type Entry<'a> = (&'a str, &'a dyn Representation<f32>, Option<[usize; 2]>);

fn table((name, representation, operations): Entry<'_>) {
    for points in BATCHES {
        let mut run = Run::new(representation, points);
        run.check();
        let before = large_sgemm();
        let [forward, step] = [least(|| run.eval()), least(|| run.step())];
        let both = least(|| run.both());
        let nanoseconds = |seconds: f64| seconds * 1e9 / points as f64;
        let [f, s, b] = [forward, step, both].map(nanoseconds);
        print!(
            "{name}, {points} points: eval {f:.1} ns, vjp and Adam {s:.1} ns, values and gradient at once {b:.1} ns a point"
        );
        if let Some([one, both]) = operations {
            let [one, both] = [one as f64 / f, both as f64 / s];
            let sgemm = before.max(large_sgemm());
            let part = 100.0 * both / sgemm;
            print!("; {one:.0} and {both:.0} GFLOP/s, large SGEMM {sgemm:.0} ({part:.0} %)");
        }
        println!();
    }
}

fn main() {
    println!("{} threads", rayon::current_num_threads());
    let bhnerf = Network::new(NetworkSettings::bhnerf()).expect("the paper's sizes");
    let mlp4d = Network::new(NetworkSettings::mlp4d()).expect("the paper's sizes");
    let (nodes, low, high) = ([64; 3], [-5.0; 3], [5.0; 3]);
    let grid = |activation| {
        let settings = GridSettings { nodes, low, high, activation, initial: 0.1 };
        Grid::new(settings).expect("a grid")
    };
    let (sigmoid, linear) = (grid(Activation::Sigmoid), grid(Activation::Linear));
    let features = FeatureGridSettings {
        coarsest: 8,
        levels: 4,
        low,
        high,
        activation: Activation::Sigmoid,
        initial: -1.0,
    };
    let features = FeatureGrid::new(features).expect("four grids");
    let all: [Entry<'_>; 5] = [
        ("bhnerf", &bhnerf, Some(bhnerf.operations())),
        ("mlp4d", &mlp4d, Some(mlp4d.operations())),
        ("feature-grid", &features, None),
        ("grid 64³, sigmoid", &sigmoid, None),
        ("grid 64³, linear", &linear, None),
    ];
    all.into_iter().filter(|(name, ..)| wanted(name)).for_each(table);
}
