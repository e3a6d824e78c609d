use kerrlight_tomo::dynamics::{AngularVelocity, Axis};
use kerrlight_tomo::fit::linear::{Prior as Penalty, Weighted};
use kerrlight_tomo::fit::world::*;
use kerrlight_tomo::fit::*;
use std::f64::consts::PI;
fn arg(name: &str, d: f64) -> f64 {
    let v: Vec<String> = std::env::args().collect();
    v.iter().position(|x| x == name).map_or(d, |k| v[k + 1].parse().unwrap())
}
fn screen(side: usize, frames: usize) -> WorldModel {
    let at = |k: usize| 20.0 * ((k as f64 + 0.5) / side as f64 - 0.5);
    let (x, y) = (0..side * side).map(|k| (at(k % side), -at(k / side))).unzip();
    WorldModel {
        x,
        y,
        observer_radius: None,
        region: Region { r_min: 3.0, r_max: 9.0, z_width: 4.0 },
        order: arg("order", 4.0) as usize,
        split: 1,
        slow_light: true,
        redshift: true,
        law: Law::CircularOrbits,
        axis: Axis::new([0.0, 0.0, 1.0]).unwrap(),
        motion: Motion {
            velocity: AngularVelocity::Keplerian { drag: 0.0 },
            reference: 0.0,
            injection: None,
            times: (0..frames).map(|k| 120.0 * k as f64 / frames as f64).collect(),
        },
        jy: 0.3,
    }
}
fn spot(at: [f64; 3]) -> f64 {
    let square = (at[0] - 5.5).powi(2) + at[1].powi(2) + at[2].powi(2);
    (-0.5 * square / 0.49).exp()
}
fn main() {
    let side = arg("side", 20.0) as usize;
    let nf = arg("frames", 12.0) as usize;
    let (model, truth_model) = (screen(side, nf), WorldModel { order: 8, ..screen(side, nf) });
    let truth = World::new(0.6, 1.05, 2.0).with(Parameter::PositionAngle, 0.7);
    let forward: ForwardModel<f32> = truth_model.forward(&truth).unwrap();
    let movie = forward.movie_of(model.axis, &spot, &mut Batch::default());
    let brightest = movie.iter().fold(0.0f64, |most, x| most.max(*x));
    let sigma = arg("noise", 1e-2) * brightest;
    let noise = |k: usize| sigma * (1.7 * k as f64 * (k as f64 * 0.37).sin()).sin() * 2f64.sqrt();
    let data: Vec<f32> = movie.iter().enumerate().map(|(k, x)| (x + noise(k)) as f32).collect();
    let count = data.len() as f64;
    let term = ImageTerm::new(data, side * side, sigma).unwrap();
    let terms = [Weighted { weight: count, term: &term as &dyn FrameTerm<f32> }];
    let free = [
        Free { parameter: Parameter::Spin, prior: Prior::Uniform { low: -0.95, high: 0.95 } },
        Free { parameter: Parameter::Inclination, prior: Prior::Isotropic { low: 0.0, high: PI } },
        Free { parameter: Parameter::PositionAngle, prior: Prior::Uniform { low: -PI, high: PI } },
    ];
    let frames: Vec<usize> = (0..nf).collect();
    let smooth = arg("smooth", 0.0);
    let pen = [Penalty { regulariser: Regulariser::Smoothness, weight: smooth }];
    let problem = WorldProblem {
        model: &model,
        known: World::new(0.0, 0.5, 2.0),
        free: &free,
        frames: &frames,
        terms: &terms,
        half_width: 9.0,
        upper: 3.0,
        penalties: if smooth > 0.0 { &pen } else { &[] },
        watch: &|_| true,
    };
    let effort = Effort {
        nodes: arg("nodes", 16.0) as usize,
        first: arg("first", 30.0) as usize,
        again: arg("again", 15.0) as usize,
        follow: arg("follow", 20.0) as usize,
        steps: arg("steps", 25.0) as usize,
    };
    if arg("scan", 0.0) > 0.0 {
        for p in [Parameter::Inclination, Parameter::PositionAngle, Parameter::Spin] {
            for k in -8..=8 {
                let d = arg("scan", 0.0) * k as f64 / 8.0;
                let w = truth.with(
                    p,
                    (truth.get(p) + d).min(0.99 + PI * (p != Parameter::Spin) as u8 as f64),
                );
                let e = problem
                    .solve(w, &vec![0.0; effort.nodes.pow(3)], effort.nodes, effort.first)
                    .unwrap();
                print!("{:.3}:{:.3} ", d, e.chi2 / count);
            }
            println!();
        }
        return;
    }
    for (k, start) in problem.starts(arg("starts", 8.0) as usize).into_iter().enumerate() {
        let begun = std::time::Instant::now();
        let how = Exploration {
            nodes: effort.nodes,
            iterations: effort.first,
            worlds: arg("worlds", 400.0) as usize,
            seed: 1,
        };
        let e = problem.explore(k, start, &how).unwrap().unwrap();
        let of = |world: &World| free.map(|free| world.get(free.parameter));
        println!(
            "{k}: {:.2?} -> {:.4?}, chi2/N {:.4}, {} ev, conv {}, {:.2?}",
            of(&start),
            of(&e.best.world),
            e.best.chi2 / count,
            e.samples.len(),
            e.converged,
            begun.elapsed()
        );
        if arg("gn", 0.0) == 0.0 {
            continue;
        }
        let start = e.best.world;
        let found = problem.descend(k, start, None, &effort).unwrap().unwrap();
        let of = |world: &World| free.map(|free| world.get(free.parameter));
        println!(
            "{k}: {:.2?} -> {:.4?}, chi2/N {:.4}, {} ev, conv {}, {:.2?}, sigma {:?}",
            of(&start),
            of(&found.end.world),
            found.end.chi2 / count,
            found.evaluations,
            found.converged,
            begun.elapsed(),
            found.covariance().map(|c| [c[0].sqrt(), c[4].sqrt(), c[8].sqrt()])
        );
    }
}
