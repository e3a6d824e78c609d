//! Recovers orbiting hot spots from their movie: scenes "1" and "4" of BH-NeRF (Levis et al. 2022),
//! noise-free images, known axis. Prints PSNR against time.
//!
//! `cargo run --release -p kerrlight-tomo --example recover_spots -- bhnerf`
//!
//! Arguments, all optional: `bhnerf`, `grid`, `linear-grid` or `mlp4d`; steps; first learning rate (it falls
//! linearly to a hundredth); pixels a step; spots (1 or 4).

use kerrlight_geodesic::bundle::Samples;
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_tomo::dynamics::{AngularVelocity, Axis, Turned, pull_back};
use kerrlight_tomo::optimise::{Adam, AdamState, Polynomial};
use kerrlight_tomo::representation::{
    Activation, Coordinates, CoordinatesMut, Gradient, Grid, GridSettings, Groups, Network,
    NetworkSettings, Representation, Workspace,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::error::Error;
use std::time::{Duration, Instant};

const FRAMES: usize = 128;
const NODES: usize = 64;

/// Points of all rays inside 5 M, ray after ray, and their weights in the sum that is a pixel.
#[derive(Default)]
struct Rays {
    points: [Vec<f32>; 3],
    /// Angle by which emission is pulled back in a unit of time.
    rates: Vec<f32>,
    weights: Vec<f32>,
    starts: Vec<usize>,
    /// Radii between which points lie.
    region: [f64; 2],
}

/// A hole without spin seen edge-on from 1000 M, 64 × 64 rays, 100 points each, equidistant in Mino
/// time; weights are chords.
fn trace() -> Result<Rays, Box<dyn Error>> {
    let hole = Kerr::new(0.0)?;
    let observer = Observer::at_radius(Inclination::from_degrees(90.0)?, 1000.0)?;
    let at = |k: usize| -8.0 + 16.0 * k as f64 / 63.0;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..64 * 64).map(|k| (at(k % 64), at(k / 64))).unzip();
    let mut samples = Samples::default();
    samples.trace(&hole, &observer, &alpha, &beta, 100)?;
    let flow = AngularVelocity::bhnerf();
    let mut rays = Rays { starts: vec![0], region: [f64::INFINITY, 0.0], ..Rays::default() };
    for k in 0..samples.rays() {
        let ray = samples.ray(k);
        let angles = ray.theta.iter().zip(ray.azimuth);
        let position = |(r, (theta, phi)): (&f64, (&f64, &f64))| {
            [r * theta.sin() * phi.cos(), r * theta.sin() * phi.sin(), r * theta.cos()]
        };
        let positions: Vec<[f64; 3]> = ray.radius.iter().zip(angles).map(position).collect();
        for (i, (x, r)) in positions.iter().zip(ray.radius).enumerate().filter(|(_, p)| *p.1 < 5.0)
        {
            let chord = if i == 0 { 0.0 } else { distance(*x, positions[i - 1]) };
            rays.points.iter_mut().zip(x).for_each(|(column, x)| column.push(*x as f32));
            rays.rates.push(flow.angle(*x, 1.0, 0.0) as f32);
            rays.weights.push(chord as f32);
            rays.region = [rays.region[0].min(*r), rays.region[1].max(*r)];
        }
        if rays.weights.len() > rays.starts[rays.starts.len() - 1] {
            rays.starts.push(rays.weights.len());
        }
    }
    Ok(rays)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Gaussian spots on one orbit at 3.5 M.
struct Truth {
    centres: Vec<[f64; 3]>,
}

impl Truth {
    /// At these 127ths of a turn, against the sense of the axis.
    fn new(axis: Axis, phases: &[u32]) -> Self {
        let (sin, cos) = 60f64.to_radians().sin_cos();
        let start = [[3.5 * sin], [0.0], [3.5 * cos]];
        let centre = |phase: &u32| {
            let angles = [-std::f64::consts::TAU * f64::from(*phase) / 127.0];
            let [mut x, mut y, mut z] = [[0.0]; 3];
            let points = Coordinates::xyz(&start[0], &start[1], &start[2]);
            let pulled = CoordinatesMut::xyz(&mut x, &mut y, &mut z);
            pull_back(axis, Turned { points, angles: &angles }, pulled);
            [x[0], y[0], z[0]]
        };
        Self { centres: phases.iter().map(centre).collect() }
    }

    fn at(&self, x: [f64; 3]) -> f64 {
        let spot = |c: &[f64; 3]| (-distance(x, *c).powi(2) / (2.0 * 0.4 * 0.4)).exp();
        self.centres.iter().map(spot).sum()
    }
}

/// A batch of pixels: (ray, frame) pairs and their points at the reference time.
#[derive(Default)]
struct Batch {
    pairs: Vec<(usize, usize)>,
    starts: Vec<usize>,
    points: [Vec<f32>; 3],
    times: Vec<f32>,
    angles: Vec<f32>,
    weights: Vec<f32>,
    pulled: [Vec<f32>; 3],
}

impl Batch {
    fn gather(&mut self, rays: &Rays, axis: Axis) {
        self.points.iter_mut().for_each(Vec::clear);
        for column in [&mut self.times, &mut self.angles, &mut self.weights] {
            column.clear();
        }
        self.starts.clear();
        self.starts.push(0);
        for (ray, frame) in &self.pairs {
            let (range, time) = (rays.starts[*ray]..rays.starts[ray + 1], time(*frame));
            for (to, from) in self.points.iter_mut().zip(&rays.points) {
                to.extend_from_slice(&from[range.clone()]);
            }
            self.times.resize(self.times.len() + range.len(), time);
            self.angles.extend(rays.rates[range.clone()].iter().map(|rate| rate * time));
            self.weights.extend_from_slice(&rays.weights[range]);
            self.starts.push(self.weights.len());
        }
        self.pulled.iter_mut().for_each(|column| column.resize(self.weights.len(), 0.0));
        let [a, b, c] = &mut self.pulled;
        let [x, y, z] = &self.points;
        let turned = Turned { points: Coordinates::xyz(x, y, z), angles: &self.angles };
        pull_back(axis, turned, CoordinatesMut::xyz(a, b, c));
    }

    fn coordinates(&self, dimension: usize) -> Coordinates<'_, f32> {
        let [x, y, z] = if dimension == 4 { &self.points } else { &self.pulled };
        match dimension {
            4 => Coordinates::txyz(&self.times, x, y, z),
            _ => Coordinates::xyz(x, y, z),
        }
    }
}

fn time(frame: usize) -> f32 {
    frame as f32 / (FRAMES - 1) as f32
}

/// All pixels of all frames, frame after frame.
fn movie(rays: &Rays, axis: Axis, truth: &Truth) -> Vec<f32> {
    let mut batch = Batch::default();
    let count = rays.starts.len() - 1;
    let mut pixels = Vec::with_capacity(FRAMES * count);
    for frame in 0..FRAMES {
        batch.pairs = (0..count).map(|ray| (ray, frame)).collect();
        batch.gather(rays, axis);
        let [x, y, z] = &batch.pulled;
        for ends in batch.starts.windows(2) {
            let light = |k: usize| {
                f64::from(batch.weights[k]) * truth.at([x[k], y[k], z[k]].map(f64::from))
            };
            pixels.push((ends[0]..ends[1]).map(light).sum::<f64>() as f32);
        }
    }
    pixels
}

/// The true volume at t = 0, and where an estimate counts.
struct Volume {
    columns: [Vec<f32>; 4],
    truth: Vec<f64>,
    counts: Vec<bool>,
}

impl Volume {
    fn new(region: [f64; 2], truth: &Truth) -> Self {
        let at = |k: usize| -5.0 + 10.0 * k as f64 / (NODES - 1) as f64;
        let node = |k: usize| [at(k / (NODES * NODES)), at(k / NODES % NODES), at(k % NODES)];
        let nodes: Vec<[f64; 3]> = (0..NODES.pow(3)).map(node).collect();
        let column = |c: usize| nodes.iter().map(|x| x[c] as f32).collect();
        let counts = |x: &[f64; 3]| (region[0]..=region[1]).contains(&distance(*x, [0.0; 3]));
        Self {
            columns: [vec![0.0; nodes.len()], column(0), column(1), column(2)],
            truth: nodes.iter().map(|x| truth.at(*x)).collect(),
            counts: nodes.iter().map(counts).collect(),
        }
    }

    /// Peak signal-to-noise ratio of an estimate, in dB.
    fn psnr(&self, estimate: impl Fn(usize) -> f64) -> f64 {
        let square = |(k, (truth, counts)): (usize, (&f64, &bool))| {
            (truth - if *counts { estimate(k) } else { 0.0 }).powi(2)
        };
        let sum: f64 = self.truth.iter().zip(&self.counts).enumerate().map(square).sum();
        let peak = self.truth.iter().fold(0.0f64, |peak, x| peak.max(*x));
        10.0 * (peak * peak * self.truth.len() as f64 / sum).log10()
    }

    fn psnr_of(
        &self,
        representation: &dyn Representation<f32>,
        parameters: &[f32],
        workspace: &mut Workspace,
    ) -> f64 {
        let [t, x, y, z] = &self.columns;
        let mut values = vec![0.0; t.len()];
        let at = match representation.dimension() {
            4 => Coordinates::txyz(t, x, y, z),
            _ => Coordinates::xyz(x, y, z),
        };
        representation.eval(parameters, at, &mut values, workspace);
        self.psnr(|k| f64::from(values[k]))
    }
}

/// Steps of Adam on random pixels; says how far it has come now and then.
struct Fit<'a> {
    representation: &'a dyn Representation<f32>,
    schedule: Polynomial,
    pixels: usize,
}

impl Fit<'_> {
    fn run(&self, rays: &Rays, axis: Axis, movie: &[f32], volume: &Volume) -> f64 {
        let (count, mut random) = (self.representation.parameters(), Pcg64::seed_from_u64(1));
        let (mut parameters, mut gradient) = (vec![0.0; count], vec![0.0; count]);
        self.representation.initialise(1, &mut parameters);
        let (mut state, mut workspace) = (AdamState::new(count), Workspace::new());
        let (mut batch, mut values) = (Batch::default(), Vec::new());
        let (mut spent, mut next) = (Duration::ZERO, Duration::from_millis(250));
        let mut psnr = 0.0;
        for step in 0..self.schedule.steps {
            let start = Instant::now();
            let all = rays.starts.len() - 1;
            let pair = |_| (random.random_range(0..all), random.random_range(0..FRAMES));
            batch.pairs = (0..self.pixels).map(pair).collect();
            batch.gather(rays, axis);
            values.resize(batch.weights.len(), 0.0);
            gradient.fill(0.0);
            let link = |groups: core::ops::Range<usize>, values: &[f32], out: &mut [f32]| {
                mean_square(&batch, movie, all, groups, values, out);
            };
            let groups = Groups { starts: &batch.starts, link: &link };
            let into = Gradient { parameters: &mut gradient, coordinates: None };
            let at = batch.coordinates(self.representation.dimension());
            let space = &mut workspace;
            self.representation.eval_vjp(&parameters, at, groups, &mut values, into, space);
            let rate = self.schedule.rate(step);
            Adam::default().step(rate, &gradient, &mut state, &mut parameters);
            self.representation.project(&mut parameters);
            spent += start.elapsed();
            if spent >= next || step + 1 == self.schedule.steps {
                next = spent.mul_f64(1.4);
                psnr = volume.psnr_of(self.representation, &parameters, &mut workspace);
                println!("{:7.2} s, step {:5}: {psnr:.2} dB", spent.as_secs_f64(), step + 1);
            }
        }
        psnr
    }
}

/// Cotangents of Σ (pixel − datum)²/pixels.
fn mean_square(
    batch: &Batch,
    movie: &[f32],
    rays: usize,
    groups: core::ops::Range<usize>,
    values: &[f32],
    cotangents: &mut [f32],
) {
    let first = batch.starts[groups.start];
    for group in groups {
        let range = batch.starts[group]..batch.starts[group + 1];
        let here = range.start - first..range.end - first;
        let (weights, (ray, frame)) = (&batch.weights[range], batch.pairs[group]);
        let pixel: f32 = weights.iter().zip(&values[here.clone()]).map(|(w, e)| w * e).sum();
        let slope = 2.0 * (pixel - movie[frame * rays + ray]) / batch.pairs.len() as f32;
        cotangents[here].iter_mut().zip(weights).for_each(|(c, w)| *c = slope * w);
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let name = words.next().unwrap_or_else(|| "bhnerf".to_owned());
    let steps = words.next().map_or(Ok(300), |word| word.parse())?;
    let rate = words.next().map(|word| word.parse::<f64>()).transpose()?;
    let pixels = words.next().map_or(Ok(512), |word| word.parse())?;
    let phases: &[u32] = match words.next().as_deref() {
        None | Some("1") => &[0],
        Some("4") => &[60, 75, 105, 0],
        Some(other) => return Err(format!("{other} spots: 1 or 4").into()),
    };
    let (low, high, activation) = ([-5.0; 3], [5.0; 3], Activation::Sigmoid);
    let nodes = [NODES; 3];
    let (representation, usual): (Box<dyn Representation<f32>>, f64) = match name.as_str() {
        "bhnerf" => (Box::new(Network::new(NetworkSettings::bhnerf())?), 1e-3),
        "mlp4d" => (Box::new(Network::new(NetworkSettings::mlp4d())?), 1e-3),
        "grid" => {
            let settings = GridSettings { nodes, low, high, activation, initial: -10.0 };
            (Box::new(Grid::new(settings)?), 0.1)
        }
        "linear-grid" => {
            let activation = Activation::Linear;
            let settings = GridSettings { nodes, low, high, activation, initial: 0.0 };
            (Box::new(Grid::new(settings)?), 0.01)
        }
        other => return Err(format!("{other}: bhnerf, grid, linear-grid or mlp4d").into()),
    };
    let (rays, axis) = (trace()?, Axis::new([0.5, 0.0, -0.75f64.sqrt()])?);
    println!("{} points on {} rays", rays.weights.len(), rays.starts.len() - 1);
    let truth = Truth::new(axis, phases);
    let movie = movie(&rays, axis, &truth);
    let frame =
        |k: usize| movie.chunks(rays.starts.len() - 1).nth(k).map_or(0.0, |f| f.iter().sum());
    let sums: [f32; 2] = [frame(0), frame(64)];
    println!("frames 0 and 64 sum to {sums:?}");
    let volume = Volume::new(rays.region, &truth);
    println!("an empty volume: {:.2} dB", volume.psnr(|_| 0.0));
    let from = rate.unwrap_or(usual);
    let schedule = Polynomial { from, to: from / 100.0, steps, power: 1.0 }.checked()?;
    let fit = Fit { representation: representation.as_ref(), schedule, pixels };
    fit.run(&rays, axis, &movie, &volume);
    Ok(())
}
