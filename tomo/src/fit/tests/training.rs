//! Steps: repeatable, resumable, and safe from divergence.

use super::*;
use crate::optimise::{LinearDecay, Muon};
use crate::representation::{Network, NetworkSettings};

pub(super) fn settings() -> Training {
    let rate = LinearDecay { from: 3e-2, to: 1e-3, steps: 40 };
    Training {
        seed: 11,
        muon: None,
        rate,
        axis_rate: Some(rate),
        ramp: 3,
        batch: BatchSize::Pixels(30),
        occupancy: Some(OccupancySettings {
            cells: 6,
            threshold: 0.3,
            memory: 0.5,
            warm_up: 10,
            every: 7,
        }),
        change: None,
        region: Region { r_min: 3.0, r_max: 6.0, z_width: 4.0 },
        keep_every: 8,
    }
}

pub(super) fn objective() -> Objective<f32> {
    let movie = movie().iter().map(|x| *x as f32).collect();
    let term = Box::new(ImageTerm::new(movie, SIDE * SIDE, 0.5).unwrap());
    let data = Data { image: Some(Weighted { weight: 1.0, term }), others: Vec::new() };
    Objective { model: forward_model(true, true), data }
}

pub(super) fn network() -> Network {
    let settings =
        NetworkSettings { width: 16, shift: -1.0, length_scale: 6.0, ..NetworkSettings::bhnerf() };
    Network::new(settings).unwrap()
}

pub(super) fn start(training: &Training) -> State<f32> {
    State::new(&network(), Axis::new([0.1, 0.5, 0.8]).unwrap(), training)
}

fn run(training: &Training, state: &mut State<f32>, until: u64) -> Vec<Outcome> {
    let network = network();
    let mut trainer = Trainer::new(objective(), &network, training.clone());
    let mut outcomes = Vec::new();
    while state.now.step < until {
        outcomes.push(trainer.step(state).unwrap());
    }
    outcomes
}

#[test]
fn regress_resumed_from_a_checkpoint_the_same_bits() {
    let muon = Some(Muon::default());
    for (batch, muon) in
        [(BatchSize::Pixels(30), None), (BatchSize::Frames(2), None), (BatchSize::Frames(2), muon)]
    {
        let training = Training { batch, muon, ..settings() };
        let (mut whole, mut broken) = (start(&training), start(&training));
        let losses = run(&training, &mut whole, 40);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let first = pool.install(|| run(&training, &mut broken, 17));
        let bytes = checkpoint::encode(&broken, "spin = 0.6").unwrap();
        assert_eq!(checkpoint::header(&bytes).unwrap().settings, "spin = 0.6");
        let mut broken = checkpoint::decode(&bytes, &start(&training)).unwrap();
        let second = run(&training, &mut broken, 40);
        assert!(broken == whole && [first, second].concat() == losses);
        let (again, all) =
            (checkpoint::encode(&broken, "").unwrap(), checkpoint::encode(&whole, "").unwrap());
        assert!(again == all);
    }
}

#[test]
fn exact_orthogonal_steps_lower_the_loss_of_whole_frames() {
    let training = Training {
        batch: BatchSize::Frames(4),
        muon: Some(Muon::default()),
        occupancy: None,
        rate: LinearDecay { from: 3e-3, to: 0.0, steps: 40 },
        ..settings()
    };
    let mut state = start(&training);
    let outcomes = run(&training, &mut state, 40);
    let loss = |k: usize| match &outcomes[k] {
        Outcome::Done(loss) => loss.total,
        other => panic!("{other:?}"),
    };
    assert!(loss(39) < 0.9 * loss(0), "{} {}", loss(0), loss(39));
}

#[test]
fn exact_the_loss_falls_and_the_mask_saves_work() {
    let mut training = Training { batch: BatchSize::Frames(4), ..settings() };
    let narrow = |mask: OccupancySettings| OccupancySettings { cells: 12, threshold: 0.95, ..mask };
    training.occupancy = training.occupancy.map(narrow);
    let mut state = start(&training);
    let outcomes = run(&training, &mut state, 40);
    let loss = |k: usize| match &outcomes[k] {
        Outcome::Done(loss) => (loss.total, loss.points),
        other => panic!("{other:?}"),
    };
    assert!(loss(39).0 < 0.9 * loss(0).0, "{:?} {:?}", loss(0), loss(39));
    assert!(loss(39).1 < loss(0).1);
    training.occupancy = None;
    let all = run(&training, &mut start(&training), 1);
    assert!(matches!(&all[0], Outcome::Done(first) if first.points == loss(0).1));
}

#[test]
fn exact_a_divergence_is_stepped_back_from() {
    let absurd = LinearDecay { from: 1e30, to: 1e30, steps: 40 };
    let training =
        Training { rate: absurd, ramp: 0, axis_rate: None, occupancy: None, ..settings() };
    let network = network();
    let mut trainer = Trainer::new(objective(), &network, training.clone());
    let mut state = start(&training);
    let fail = loop {
        match trainer.step(&mut state) {
            Ok(Outcome::SteppedBack { to, caution, .. }) => {
                assert!(caution == 0.5f64.powi(state.setbacks as i32) && to == state.now.step);
            }
            Ok(other) => assert!(matches!(other, Outcome::Done(_)), "{other:?}"),
            Err(fail) => break fail,
        }
        assert!(state.now.step < 40);
    };
    let crate::Error::Diverged(fail) = fail else { panic!("{fail}") };
    assert!(fail.setbacks == 12 && fail.to_string().contains("after 12 returns"), "{fail}");
}

#[test]
fn damaged_checkpoints_are_refused() {
    let training = settings();
    let state = start(&training);
    let bytes = checkpoint::encode(&state, "").unwrap();
    for cut in [0, 7, 8, 100, bytes.len() / 2, bytes.len() - 1] {
        assert!(checkpoint::decode(&bytes[..cut], &state).is_err());
    }
    // Every byte counts: lengths, names, numbers.
    for at in (0..bytes.len()).filter(|at| *at < 2000 || at % 97 == 0) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        assert!(checkpoint::decode(&flipped, &state).is_err(), "byte {at}");
    }
    let larger = Network::new(NetworkSettings { width: 17, ..NetworkSettings::bhnerf() }).unwrap();
    let other = State::new(&larger, state.now.axis, &training);
    let text = checkpoint::decode(&bytes, &other).unwrap_err().to_string();
    assert!(text.contains("now.") && text.contains("are expected"), "{text}");
}
