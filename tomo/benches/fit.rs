//! Cost of a step of a fit and of its parts: BH-NeRF's network on scene "1" (Levis et al. 2022), with a mask of what
//! shines, from random pixels and from whole frames; beside the rate of a large matrix product in the same run.
//!
//! Processor time a thread, as in the bench `representation`; threads are as many as `RAYON_NUM_THREADS` says.

#[path = "../examples/paper/mod.rs"]
mod paper;
#[allow(dead_code)]
#[path = "support/mod.rs"]
mod support;

use kerrlight_tomo::fit::{Batch, BatchSize, OccupancySettings, Outcome, State, Trainer, Training};
use kerrlight_tomo::optimise::AdamState;
use kerrlight_tomo::representation::{
    Gradient, Groups, InstructionSet, Network, NetworkSettings, Representation, Workspace,
};
use support::{large_sgemm, least, wanted};

/// Frames of the movie.
const FRAMES: usize = 128;

fn training(batch: BatchSize) -> Training {
    // A step in twenty looks at every cell.
    let mask = OccupancySettings { threshold: 0.01, warm_up: 60, ..OccupancySettings::default() };
    Training { occupancy: Some(mask), ..paper::training(batch, 400) }
}

/// Seconds of the parts of a step on these pairs: points collected and pulled back, the network forward and back,
/// Adam.
fn parts(
    trainer: &Trainer<'_, f32>,
    network: &Network,
    state: &State<f32>,
    pairs: &[(u32, u32)],
) -> ([f64; 3], usize) {
    let (mut batch, mask) = (Batch::default(), state.now.occupancy.as_ref());
    let gather = least(|| {
        batch.set(pairs.iter().copied());
        batch.gather(&trainer.objective.model, paper::axis(), mask);
    });
    let count = Representation::<f32>::parameters(network);
    let (mut gradient, mut values) = (vec![0.0; count], vec![0.0; batch.points()]);
    let mut workspace = Workspace::new();
    let link = |_: core::ops::Range<usize>, values: &[f32], out: &mut [f32]| {
        out.iter_mut().zip(values).for_each(|(out, value)| *out = value - 0.1);
    };
    let through = least(|| {
        gradient.fill(0.0);
        let at = Batch::coordinates(&batch.columns, network);
        let groups = Groups { starts: &batch.starts, link: &link };
        let into = Gradient { parameters: &mut gradient, coordinates: None };
        network.eval_vjp(&state.now.parameters, at, groups, &mut values, into, &mut workspace);
    });
    let (mut memory, mut parameters) = (AdamState::new(count), state.now.parameters.clone());
    let adam = least(|| memory.step(1e-9, &gradient, &mut parameters));
    ([gather, through, adam], batch.points())
}

fn measure(batch: BatchSize, set: InstructionSet) {
    let network = Network::new(NetworkSettings::bhnerf()).expect("the paper's sizes").on(set);
    let training = training(batch);
    let mut state = State::new(&network, paper::axis(), &training);
    let objective = paper::objective(FRAMES).expect("a movie");
    let mut trainer = Trainer::new(objective, &network, training);
    let mut points = 0;
    while state.now.step < 201 {
        let Ok(Outcome::Done(loss)) = trainer.step(&mut state) else { panic!("it diverged") };
        points = loss.points;
    }
    let rays = trainer.objective.model.rays() as u32;
    let pairs: Vec<(u32, u32)> = match batch {
        BatchSize::Pixels(count) => {
            (0..count as u32).map(|k| (k * 7919 % rays, k * 31 % 128)).collect()
        }
        _ => (0..rays).map(|ray| (ray, 37)).collect(),
    };
    let before = large_sgemm();
    let mut steps = 0;
    let step = least(|| {
        // The same state again and again: twenty steps to a refreshment of the mask, as in a run.
        state.now.step = 201 + steps % 20;
        steps += 1;
        if let Ok(Outcome::Done(loss)) = trainer.step(&mut state) {
            points = loss.points;
        }
    });
    let sgemm = before.max(large_sgemm());
    let ([gather, through, adam], some) = parts(&trainer, &network, &state, &pairs);
    let [_, both] = network.operations();
    let rate = |points: usize, seconds: f64| (both * points) as f64 / seconds * 1e-9;
    let whole = rate(points, step);
    println!(
        "{batch:?}, {set:?}: {points} points a step, {:.2} ms, {whole:.0} GFLOP/s, large SGEMM {sgemm:.0} ({:.0} %)",
        step * 1e3,
        100.0 * whole / sgemm
    );
    println!(
        "  parts of {some} points: collected {:.2} ms, network {:.2} ms ({:.0} GFLOP/s), Adam {:.3} ms",
        gather * 1e3,
        through * 1e3,
        rate(some, through),
        adam * 1e3
    );
}

fn main() {
    println!("{} threads", rayon::current_num_threads());
    let all = [BatchSize::Pixels(2048), BatchSize::Frames(4)];
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let chosen = all.iter().filter(|batch| wanted(&format!("{batch:?}, {set:?}")));
        chosen.for_each(|batch| measure(*batch, set));
    }
}
