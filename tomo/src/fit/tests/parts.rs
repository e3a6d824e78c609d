//! Steps that are cut into parts: the same whoever has which, and up to rounding the same as uncut ones.

use super::training::{network, objective, settings, start};
use super::*;
use crate::fit::parts::{Part, Ranks, combine, nodes, share};
use crate::fit::trainer::Trainer;
use crate::fit::training::Training;
use std::ops::Range;
use std::sync::{Arc, Barrier, Mutex};

/// What ranks of one process give each other.
struct Table {
    parts: Mutex<Vec<Vec<Part<f32>>>>,
    states: Mutex<Vec<u32>>,
    barrier: Barrier,
}

struct Rank {
    rank: usize,
    size: usize,
    table: Arc<Table>,
}

impl Ranks<f32> for Rank {
    fn mine(&self, parts: usize) -> Range<usize> {
        share(self.rank, self.size, parts)
    }

    fn sum(&mut self, parts: usize, state: u32, own: Vec<Part<f32>>) -> Part<f32> {
        self.table.parts.lock().unwrap()[self.rank] = own;
        self.table.states.lock().unwrap()[self.rank] = state;
        self.table.barrier.wait();
        let all = self.table.parts.lock().unwrap().clone();
        assert!(self.table.states.lock().unwrap().iter().all(|other| *other == state));
        self.table.barrier.wait();
        let ranges = (0..self.size).flat_map(|k| nodes(0..parts, &share(k, self.size, parts)));
        combine(0..parts, &mut ranges.zip(all.into_iter().flatten()))
    }
}

fn training(batch: BatchSize, parts: usize) -> Training {
    Training { batch, parts, ..settings() }
}

/// State and losses after so many steps of `size` ranks, of which all find the same.
fn run(training: &Training, size: usize, steps: u64) -> (State<f32>, Vec<Outcome>) {
    let table = Arc::new(Table {
        parts: Mutex::new(vec![Vec::new(); size]),
        states: Mutex::new(vec![0; size]),
        barrier: Barrier::new(size),
    });
    let one = |rank: usize| {
        let network = network();
        let mut trainer = Trainer::new(objective(), &network, training.clone());
        trainer.ranks = Some(Box::new(Rank { rank, size, table: Arc::clone(&table) }));
        let mut state = start(training);
        let outcomes = (0..steps).map(|_| trainer.step(&mut state).unwrap()).collect();
        (state, outcomes)
    };
    let mut all: Vec<(State<f32>, Vec<Outcome>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..size).map(|rank| scope.spawn(move || one(rank))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    all.remove(0)
}

#[test]
fn exact_any_number_of_ranks_takes_the_same_steps() {
    for batch in [BatchSize::Pixels(30), BatchSize::Frames(3), BatchSize::All] {
        let training = training(batch, 8);
        let network = network();
        let mut alone = start(&training);
        let mut trainer = Trainer::new(objective(), &network, training.clone());
        let outcomes: Vec<Outcome> = (0..12).map(|_| trainer.step(&mut alone).unwrap()).collect();
        for size in [1, 2, 4, 7] {
            assert!(run(&training, size, 12) == (alone.clone(), outcomes.clone()), "{size} ranks");
        }
    }
}

/// The gradient of a step is the same function however it is cut; sums in another order differ by rounding.
#[test]
fn exact_parts_add_up_to_the_whole() {
    for batch in [BatchSize::Pixels(30), BatchSize::Frames(3)] {
        let found = [1, 2, 5].map(|parts| {
            let (training, network) = (training(batch, parts), network());
            let state = start(&training);
            let mut trainer = Trainer::new(objective(), &network, training);
            let (parameters, axis) = (&state.now.parameters[..], state.now.axis);
            let mut of_axis = [0.0; 3];
            let place = Place { parameters, axis, occupancy: None, step: 3 };
            let loss = trainer.loss(place, &mut of_axis);
            (loss, of_axis, trainer.gradient().to_vec())
        });
        let [(loss, of_axis, gradient), others @ ..] = &found;
        let size = gradient.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        let turn = of_axis.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        assert!(size > 0.0 && turn > 0.0);
        for (other, axis, slopes) in others {
            assert_eq!(loss.points, other.points);
            assert!((loss.total - other.total).abs() < 1e-6 * loss.total);
            for (a, b) in of_axis.iter().zip(axis) {
                assert!((a - b).abs() < 1e-5 * turn, "{a} {b}");
            }
            for (a, b) in gradient.iter().zip(slopes) {
                assert!((a - b).abs() < 1e-5 * size, "{a} {b}");
            }
        }
    }
}

#[test]
fn exact_nodes_of_all_ranks_are_all_parts_once() {
    for parts in 1..40 {
        for size in 1..12 {
            let all: Vec<Range<usize>> =
                (0..size).flat_map(|k| nodes(0..parts, &share(k, size, parts))).collect();
            assert!(all.iter().map(Range::len).sum::<usize>() == parts);
            assert!(all.windows(2).all(|pair| pair[0].end == pair[1].start));
            // As many sums as the two ends of a rank's parts need.
            let most = 2 * parts.ilog2() as usize + 1;
            assert!((0..size).all(|k| nodes(0..parts, &share(k, size, parts)).len() <= most));
        }
    }
}
