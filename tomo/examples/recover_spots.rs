//! Recovers orbiting hot spots from their movie: scenes "1", "4" and "8" of BH-NeRF (Levis et al. 2022),
//! noise-free images, known axis. Prints PSNR against time.
//!
//! `cargo run --release -p kerrlight-tomo --example recover_spots -- representation=bhnerf scene=4`
//!
//! Settings, all optional: `representation` (bhnerf, grid, linear-grid, mlp4d), `scene` (1, 4, 8), `steps`, `rate`
//! (the first; it falls linearly to `last` of it), `pixels` a step, `warm_up`, `every`, `cells` and `threshold` of
//! the mask of what shines (`warm_up=0`: none), `seed`.

use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_tomo::dynamics::{AngularVelocity, Axis};
use kerrlight_tomo::fit::{
    BatchSize, Chain, Data, ImageTerm, Motion, Objective, OccupancyPlan, OccupancySettings,
    Outcome, Region, Sampling, SightlineRequest, Sightlines, State, Trainer, Training, Weighted,
};
use kerrlight_tomo::optimise::{Adam, Polynomial};
use kerrlight_tomo::representation::{
    Activation, Grid, GridSettings, Network, NetworkSettings, Representation,
};
use std::collections::BTreeMap;
use std::error::Error;
use std::time::{Duration, Instant};

const FRAMES: usize = 128;
const NODES: usize = 64;
const SIDE: usize = 64;

/// A hole without spin seen edge-on from 1000 M, 64 × 64 rays, 100 nodes each.
fn sightlines(hole: &Kerr) -> Result<Sightlines, Box<dyn Error>> {
    let observer = Observer::at_radius(Inclination::from_degrees(90.0)?, 1000.0)?;
    let at = |k: usize| -8.0 + 16.0 * k as f64 / (SIDE - 1) as f64;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..SIDE * SIDE).map(|k| (at(k % SIDE), -at(k / SIDE))).unzip();
    let request = SightlineRequest {
        region: REGION,
        sampling: Sampling::EqualMinoTime { per_ray: 100 },
        delay: false,
        momentum: false,
    };
    Ok(Sightlines::trace(hole, &observer, &alpha, &beta, &request)?)
}

const REGION: Region = Region { r_min: 2.0, r_max: 5.0, z_width: f64::INFINITY };

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Gaussian spots on one orbit at 3.5 M, some sheared since the start.
struct Truth {
    axis: [f64; 3],
    start: [f64; 3],
    /// Orbital phases in 127ths of a turn, and the time since which a spot is sheared.
    spots: Vec<(f64, f64)>,
}

/// `x` turned about a unit vector (Rodrigues).
fn turned(axis: [f64; 3], angle: f64, x: [f64; 3]) -> [f64; 3] {
    let along: f64 = axis.iter().zip(x).map(|(a, x)| a * x).sum();
    let (sin, cos) = angle.sin_cos();
    core::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        cos * x[k] + sin * (axis[i] * x[j] - axis[j] * x[i]) + (1.0 - cos) * along * axis[k]
    })
}

impl Truth {
    fn new(axis: Axis, scene: usize) -> Self {
        let (sin, cos) = 60f64.to_radians().sin_cos();
        let sheared = 32.0 / 127.0;
        let four = [60.0, 75.0, 105.0, 0.0];
        let spots = match scene {
            1 => vec![(0.0, 0.0)],
            4 => four.map(|phase| (phase, 0.0)).to_vec(),
            _ => {
                let new = [25.0, 55.0, 60.0, 40.0].map(|phase| (phase, 0.0));
                four.map(|phase| (phase, sheared)).into_iter().chain(new).collect()
            }
        };
        Self { axis: axis.vector(), start: [3.5 * sin, 0.0, 3.5 * cos], spots }
    }

    /// Emission at time 0.
    fn at(&self, x: [f64; 3]) -> f64 {
        let rate = |r: f64| AngularVelocity::bhnerf().rate(r);
        let spot = |(phase, since): &(f64, f64)| {
            let r = distance(x, [0.0; 3]);
            let back = turned(self.axis, -rate(r) * since, x);
            let center = turned(self.axis, rate(3.5) * phase / 127.0, self.start);
            (-distance(back, center).powi(2) / (2.0 * 0.4 * 0.4)).exp()
        };
        self.spots.iter().map(spot).sum()
    }
}

/// All pixels of all frames.
fn movie(lines: &Sightlines, truth: &Truth) -> Vec<f32> {
    let velocity = AngularVelocity::bhnerf();
    let mut movie = vec![0.0; FRAMES * lines.pixels];
    for (frame, image) in movie.chunks_exact_mut(lines.pixels).enumerate() {
        let time = frame as f64 / (FRAMES - 1) as f64;
        for (ray, pixel) in lines.pixel.iter().enumerate() {
            let light = |k: usize| {
                let x = [0, 1, 2].map(|c| lines.position[c][k]);
                let angle = velocity.angle(x, time, 0.0);
                lines.weight[k] * truth.at(turned(truth.axis, angle, x))
            };
            let sum: f64 = (lines.starts[ray]..lines.starts[ray + 1]).map(light).sum();
            image[*pixel as usize] = sum as f32;
        }
    }
    movie
}

/// The true volume at t = 0, and where an estimate counts.
struct Volume {
    columns: [Vec<f32>; 3],
    truth: Vec<f64>,
    counts: Vec<bool>,
}

impl Volume {
    fn new(truth: &Truth) -> Self {
        let at = |k: usize| -5.0 + 10.0 * k as f64 / (NODES - 1) as f64;
        let node = |k: usize| [at(k / (NODES * NODES)), at(k / NODES % NODES), at(k % NODES)];
        let nodes: Vec<[f64; 3]> = (0..NODES.pow(3)).map(node).collect();
        Self {
            columns: [0, 1, 2].map(|c| nodes.iter().map(|x| x[c] as f32).collect()),
            truth: nodes.iter().map(|x| truth.at(*x)).collect(),
            counts: nodes.iter().map(|x| REGION.holds(*x)).collect(),
        }
    }

    /// Peak signal-to-noise ratio of an estimate, in dB.
    fn psnr(&self, estimate: &[f32]) -> f64 {
        let square = |k: usize| {
            let estimate = if self.counts[k] { f64::from(estimate[k]) } else { 0.0 };
            (self.truth[k] - estimate).powi(2)
        };
        let sum: f64 = (0..self.truth.len()).map(square).sum();
        let peak = self.truth.iter().fold(0.0f64, |peak, x| peak.max(*x));
        10.0 * (peak * peak * self.truth.len() as f64 / sum).log10()
    }
}

/// Words `name=value`.
struct Words(BTreeMap<String, String>);

impl Words {
    fn get<N: std::str::FromStr>(&self, name: &str, usual: N) -> Result<N, String> {
        let wrong = |word: &String| format!("{name}={word} is not allowed: a number");
        self.0.get(name).map_or(Ok(usual), |word| word.parse().map_err(|_| wrong(word)))
    }
}

/// A representation and its usual first rate.
type Chosen = (Box<dyn Representation<f32>>, f64);

/// The representation of this name.
fn representation(name: &str) -> Result<Chosen, Box<dyn Error>> {
    let grid = |activation, initial| {
        let (nodes, low, high) = ([NODES; 3], [-5.0; 3], [5.0; 3]);
        Grid::new(GridSettings { nodes, low, high, activation, initial })
    };
    Ok(match name {
        "bhnerf" => (Box::new(Network::new(NetworkSettings::bhnerf())?), 1e-3),
        "mlp4d" => (Box::new(Network::new(NetworkSettings::mlp4d())?), 1e-3),
        "grid" => (Box::new(grid(Activation::Sigmoid, -10.0)?), 0.1),
        "linear-grid" => (Box::new(grid(Activation::Linear, 0.0)?), 0.05),
        other => return Err(format!("{other}: bhnerf, mlp4d, grid or linear-grid").into()),
    })
}

fn training(words: &Words, rate: f64) -> Result<Training, String> {
    let (from, steps) = (words.get("rate", rate)?, words.get("steps", 300)?);
    let warm_up = words.get("warm_up", 60)?;
    let plan = OccupancyPlan {
        settings: OccupancySettings {
            cells: words.get("cells", 24)?,
            threshold: words.get("threshold", 1e-2)?,
            memory: 0.8,
        },
        warm_up,
        every: words.get("every", 20)?,
    };
    Ok(Training {
        seed: words.get("seed", 1)?,
        adam: Adam::default(),
        rate: Polynomial { from, to: from * words.get("last", 0.01)?, steps, power: 1.0 },
        axis_rate: None,
        ramp: 0,
        batch: BatchSize::Pixels(words.get("pixels", 512)?),
        occupancy: (warm_up > 0).then_some(plan),
        region: REGION,
        keep_every: 50,
        divergence: 1e3,
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let split = |word: String| word.split_once('=').map(|(a, b)| (a.to_owned(), b.to_owned()));
    let words = Words(std::env::args().skip(1).filter_map(split).collect());
    let hole = Kerr::new(0.0)?;
    let (axis, lines) = (Axis::new([0.5, 0.0, -(0.75f64.sqrt())])?, sightlines(&hole)?);
    let truth = Truth::new(axis, words.get("scene", 1)?);
    let times = (0..FRAMES).map(|k| k as f64 / (FRAMES - 1) as f64).collect();
    let velocity = AngularVelocity::bhnerf();
    let motion = Motion { velocity, reference: 0.0, injection: None, times };
    let term = Box::new(ImageTerm::new(movie(&lines, &truth), lines.pixels, 1.0)?);
    let data = Data { image: Some(Weighted { weight: 1.0, term }), others: Vec::new() };
    let objective = Objective { chain: Chain::new(&lines, &motion, &hole, None)?, data };
    let (field, rate) = representation(&words.get("representation", "bhnerf".to_owned())?)?;
    let training = training(&words, rate)?;
    let mut state = State::new(&*field, axis, &training);
    println!("{} nodes on {} rays", lines.points(), lines.rays());
    recover(Trainer::new(objective, &*field, training), &mut state, &Volume::new(&truth))
}

/// Steps; says now and then how far it has come.
fn recover(
    mut trainer: Trainer<'_, f32>,
    state: &mut State<f32>,
    volume: &Volume,
) -> Result<(), Box<dyn Error>> {
    let (mut spent, mut next, mut points) = (Duration::ZERO, Duration::from_millis(250), 0);
    let steps = trainer.training.rate.steps;
    while state.now.step < steps {
        let start = Instant::now();
        match trainer.step(state)? {
            Outcome::Done(loss) => points += loss.points,
            back => println!("{back:?}"),
        }
        spent += start.elapsed();
        if spent >= next || state.now.step == steps {
            next = spent.mul_f64(1.4);
            let psnr =
                volume.psnr(&trainer.emission(&state.now, [0, 1, 2].map(|c| &*volume.columns[c])));
            let (step, seconds) = (state.now.step, spent.as_secs_f64());
            println!("{seconds:7.2} s, step {step:5}: {psnr:.2} dB, {points} evaluations");
        }
    }
    Ok(())
}
