//! Recovers orbiting hot spots from their movie: scenes "1", "4" and "8" of BH-NeRF (Levis et al. 2022),
//! noise-free images, known axis. Prints PSNR against time.
//!
//! `cargo run --release -p kerrlight-tomo --example recover_spots -- representation=bhnerf scene=4`
//!
//! Settings, all optional: `representation` (bhnerf, grid, linear-grid, mlp4d), `scene` (1, 4, 8), `steps`, `rate`
//! (the first; it falls linearly to `last` of it), `pixels` a step, `warm_up`, `every`, `cells` and `threshold` of
//! the mask of what shines (`warm_up=0`: none), `seed`.

// Other examples use more of it.
#[allow(dead_code)]
mod paper;

use kerrlight_render::dynamics::Axis;
use kerrlight_tomo::fit::{
    BatchSize, Data, ImageTerm, Objective, OccupancyPlan, OccupancySettings, Outcome, Region,
    State, Trainer, Training, Weighted,
};
use kerrlight_tomo::optimise::{Adam, Polynomial};
use kerrlight_tomo::representation::{
    Activation, Grid, GridSettings, Network, NetworkSettings, Representation,
};
use paper::Truth;
use std::collections::BTreeMap;
use std::error::Error;
use std::time::{Duration, Instant};

const NODES: usize = 64;

const REGION: Region = Region { r_min: 2.0, r_max: 5.0, z_width: f64::INFINITY };

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
        muon: None,
        rate: Polynomial { from, to: from * words.get("last", 0.01)?, steps, power: 1.0 },
        axis_rate: None,
        ramp: 0,
        batch: BatchSize::Pixels(words.get("pixels", 512)?),
        occupancy: (warm_up > 0).then_some(plan),
        change: None,
        region: REGION,
        keep_every: 50,
        divergence: 1e3,
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let split = |word: String| word.split_once('=').map(|(a, b)| (a.to_owned(), b.to_owned()));
    let words = Words(std::env::args().skip(1).filter_map(split).collect());
    let axis = Axis::new([0.5, 0.0, -(0.75f64.sqrt())])?;
    let truth = Truth::scene(&words.get("scene", "1".to_owned())?, axis)?;
    let lines = paper::lines_in(REGION, &paper::screen(64), 100)?;
    let model = paper::forward_model(&lines, paper::FRAMES)?;
    let term = Box::new(ImageTerm::new(truth.movie(&model), lines.pixels, 1.0)?);
    let data = Data { image: Some(Weighted { weight: 1.0, term }), others: Vec::new() };
    let objective = Objective { model, data };
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
