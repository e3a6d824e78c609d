//! Recovers orbiting hot spots from their movie with the linear grid: scenes "1", "4" and "8" of BH-NeRF
//! (Levis et al. 2022), noise-free images, known axis. Prints PSNR against time.
//!
//! `cargo run --release -p kerrlight-tomo --example linear_grid -- 1`
//!
//! Arguments, all optional: scene (1, 4 or 8); seconds; weight of the smoothness (0: none);
//! iterations a round; rounds; coarse nodes; coarse stride; coarse iterations.

mod paper;

use kerrlight_render::dynamics::Axis;
use kerrlight_tomo::fit::linear::{
    Change, Coarse, LinearProblem, LinearProgress, LinearSettings, Prior, Voxels, Weighted,
};
use kerrlight_tomo::fit::{ImageTerm, Regulariser, Sightlines};
use kerrlight_tomo::representation::Degree;
use paper::{FRAMES, Truth, forward_model, lines, processor_time, screen};
use std::error::Error;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// The true volume at t = 0, and where an estimate counts.
struct Volume {
    truth: Vec<f64>,
    counts: Vec<bool>,
}

impl Volume {
    fn new(voxels: &Voxels, truth: &Truth, radii: [f64; 2]) -> Self {
        let nodes: Vec<[f64; 3]> = (0..voxels.count()).map(|k| voxels.position(k)).collect();
        let counts = |x: &[f64; 3]| {
            let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            (radii[0]..=radii[1]).contains(&r)
        };
        Self {
            truth: nodes.iter().map(|x| truth.at(*x)).collect(),
            counts: nodes.iter().map(counts).collect(),
        }
    }

    /// Peak signal-to-noise ratio of an estimate, in dB.
    fn psnr(&self, estimate: &[f64]) -> f64 {
        let square = |((truth, counts), x): ((&f64, &bool), &f64)| {
            (truth - if *counts { *x } else { 0.0 }).powi(2)
        };
        let sum: f64 = self.truth.iter().zip(&self.counts).zip(estimate).map(square).sum();
        let peak = self.truth.iter().fold(0.0f64, |peak, x| peak.max(*x));
        10.0 * (peak * peak * self.truth.len() as f64 / sum).log10()
    }
}

/// What the command line says.
struct Arguments {
    scene: String,
    seconds: f64,
    weight: f64,
    settings: LinearSettings,
}

impl Arguments {
    fn read() -> Result<Self, Box<dyn Error>> {
        let mut words = std::env::args().skip(1);
        let scene = words.next().unwrap_or_else(|| "1".to_owned());
        let seconds = words.next().map_or(Ok(10.0), |word| word.parse())?;
        let weight = words.next().map_or(Ok(0.0), |word| word.parse())?;
        let mut settings = LinearSettings::default();
        settings.iterations = words.next().map_or(Ok(settings.iterations), |word| word.parse())?;
        settings.rounds = words.next().map_or(Ok(settings.rounds), |word| word.parse())?;
        let mut coarse = Coarse { nodes: 32, stride: 8, iterations: 20 };
        coarse.nodes = words.next().map_or(Ok(coarse.nodes), |word| word.parse())?;
        coarse.stride = words.next().map_or(Ok(coarse.stride), |word| word.parse())?;
        coarse.iterations = words.next().map_or(Ok(coarse.iterations), |word| word.parse())?;
        settings.coarse = Some(coarse);
        Ok(Self { scene, seconds, weight, settings })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let Arguments { scene, seconds, weight, settings } = Arguments::read()?;
    let axis = Axis::new([0.5, 0.0, -0.75f64.sqrt()])?;
    let truth = Truth::scene(&scene, axis)?;
    let start = Instant::now();
    let lines = lines(&screen(64), 100)?;
    let model = forward_model(&lines, FRAMES)?;
    println!("{} points on {} rays, {:.2?}", model.points(), model.rays(), start.elapsed());
    let movie = truth.movie(&model);
    let sum = |k: usize| movie[k * 4096..(k + 1) * 4096].iter().map(|x| f64::from(*x)).sum::<f64>();
    println!("frames 0 and 64 sum to {:.5} and {:.5}", sum(0), sum(64));
    let term = ImageTerm::new(movie, model.pixels(), 1.0)?;
    let voxels = Voxels::cube(64, 5.0, Degree::Linear);
    let volume = Volume::new(&voxels, &truth, radii(&lines));
    println!("the truth sums to {:.4}", volume.truth.iter().sum::<f64>());
    println!("an empty volume: {:.2} dB", volume.psnr(&vec![0.0; voxels.count()]));
    let frames: Vec<usize> = (0..FRAMES).collect();
    let smooth = [Prior { regulariser: Regulariser::Smoothness, weight }];
    let problem = LinearProblem {
        model: &model,
        axis,
        frames: &frames,
        terms: &[Weighted { weight: 1.0, term: &term }],
        voxels,
        upper: 2.0,
        flux: None,
        priors: if weight > 0.0 { &smooth } else { &[] },
        gaussian: None,
        change: Change::NONE,
    };

    recover(&problem, &settings, &volume, seconds)
}

/// The least and the greatest radius of the nodes.
fn radii(lines: &Sightlines) -> [f64; 2] {
    let [x, y, z] = &lines.position;
    let radius = |k: usize| (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt();
    (0..x.len()).fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], k| {
        [low.min(radius(k)), high.max(radius(k))]
    })
}

/// Solves the problem within `seconds` and prints what is reached, and when.
fn recover(
    problem: &LinearProblem<'_, f32>,
    settings: &LinearSettings,
    volume: &Volume,
    seconds: f64,
) -> Result<(), Box<dyn Error>> {
    let (start, cpu, mut next) = (Instant::now(), processor_time(), Duration::ZERO);
    let mut watch = |progress: &LinearProgress<'_>| {
        let spent = start.elapsed();
        let over = spent.as_secs_f64() > seconds;
        if progress.round > 0 && (spent >= next || over) {
            next = spent.mul_f64(1.25);
            println!(
                "{:6.2} s, processor {:6.2} s, round {}, {:5} evaluations: {:.2} dB (value {:.4e}, {} nodes, {:.1} M entries)",
                spent.as_secs_f64(),
                processor_time() - cpu,
                progress.round,
                progress.evaluations,
                volume.psnr(&progress.emission()),
                progress.value,
                progress.nodes,
                progress.entries as f64 / 1e6,
            );
        }
        if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let solution = problem.solve(settings, &mut watch)?;
    let emission: Vec<f64> = solution.emission.iter().map(|x| f64::from(*x)).collect();
    println!(
        "{:.2} s, processor {:.2} s: {:.2} dB, {:?} after {} rounds and {} evaluations, {} nodes, {} MB",
        start.elapsed().as_secs_f64(),
        processor_time() - cpu,
        volume.psnr(&emission),
        solution.ending,
        solution.rounds,
        solution.evaluations,
        solution.nodes,
        solution.bytes >> 20
    );
    if let Some(certificate) = solution.certificate {
        println!(
            "value {:.4e}, gap {:.3e} and violation {:.3e} of those of nothing",
            certificate.value,
            certificate.relative_gap(),
            certificate.relative_violation()
        );
    }
    Ok(())
}
