//! The sums of a fit's ranks over a network that is slow on purpose: what a step takes, beside what the model of
//! docs/measurements/cluster.md says of it. Ranks are threads that sleep where they would compute, so that two cores are
//! enough for 64 of them; messages, sums and checks are those of a fit.

use super::*;
use crate::ranks::connect;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The network at rank 0: a delay each way, and a bandwidth that all others share each way.
#[derive(Clone, Copy, Debug)]
struct Network {
    delay: Duration,
    /// Bytes a second.
    bandwidth: f64,
}

/// When one direction of rank 0's interface is free again.
type Interface = Arc<Mutex<Instant>>;

/// Forwards what comes at a port of its own to `port`, as late as the network would.
fn proxy(port: u16, network: Network) -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let own = listener.local_addr().unwrap().port();
    let [to, from]: [Interface; 2] = [0; 2].map(|_| Arc::new(Mutex::new(Instant::now())));
    std::thread::spawn(move || {
        while let Ok((other, _)) = listener.accept() {
            let first = TcpStream::connect(("127.0.0.1", port)).unwrap();
            pipe([&other, &first], network, &to);
            pipe([&first, &other], network, &from);
        }
    });
    own
}

fn pipe([from, to]: [&TcpStream; 2], network: Network, interface: &Interface) {
    let [mut from, to] = [from, to].map(|stream| stream.try_clone().unwrap());
    to.set_nodelay(true).unwrap();
    let (sender, receiver) = channel();
    let interface = Arc::clone(interface);
    std::thread::spawn(move || forward(&receiver, to, network, &interface));
    std::thread::spawn(move || take(&mut from, &sender));
}

/// Takes what comes, with the time.
fn take(from: &mut TcpStream, sender: &Sender<(Instant, Vec<u8>)>) {
    let mut bytes = vec![0; 1 << 16];
    while let Ok(length @ 1..) = from.read(&mut bytes) {
        if sender.send((Instant::now(), bytes[..length].to_vec())).is_err() {
            return;
        }
    }
}

/// Gives it away when the interface has had time for it, and the delay is over.
fn forward(
    receiver: &Receiver<(Instant, Vec<u8>)>,
    mut to: TcpStream,
    Network { delay, bandwidth }: Network,
    interface: &Interface,
) {
    for (came, bytes) in receiver {
        let mut free = interface.lock().unwrap();
        *free = came.max(*free) + Duration::from_secs_f64(bytes.len() as f64 / bandwidth);
        let due = *free + delay;
        drop(free);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        if to.write_all(&bytes).is_err() {
            return;
        }
    }
    let _ = to.shutdown(Shutdown::Write);
}

/// Steps of a fit whose data take `compute` on one rank, with gradients of so many numbers, in 64 parts.
#[derive(Clone, Copy)]
struct Steps {
    compute: Duration,
    numbers: usize,
    count: u32,
}

const PARTS: usize = 64;

impl Steps {
    fn run(self, ranks: &mut dyn Ranks<f32>) {
        for _ in 0..self.count {
            let mine = ranks.mine(PARTS);
            std::thread::sleep(self.compute.mul_f64(mine.len() as f64 / PARTS as f64));
            let part = |range: Range<usize>| Part {
                gradient: vec![range.len() as f32; self.numbers],
                ..Part::default()
            };
            let own = nodes(0..PARTS, &mine).into_iter().map(part).collect();
            let sum = ranks.sum(PARTS, 7, own);
            assert!(sum.gradient.iter().all(|x| *x == PARTS as f32));
        }
    }

    /// Seconds of a step of so many ranks, the first one left out.
    fn seconds(self, size: u32, network: Network) -> f64 {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().to_owned();
        let listener = Listener::open(&at, size, String::new()).unwrap();
        let path = at.join("ranks.json");
        let mut address: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let port = address["port"].as_u64().unwrap() as u16;
        address["port"] = proxy(port, network).into();
        std::fs::write(&path, address.to_string()).unwrap();
        let others = (1..size).map(|rank| {
            let at = at.clone();
            std::thread::spawn(move || {
                let connection = connect(&at, rank, "", Box::new(|| ())).unwrap();
                self.run(&mut Other { connection, rank, size });
            })
        });
        let others: Vec<_> = others.collect();
        let connections = listener.gather(|_| Box::new(|| ())).unwrap();
        let mut first = First { connections, run: at };
        Steps { count: 1, ..self }.run(&mut first);
        let (clock, count) = (Instant::now(), self.count - 1);
        Steps { count, ..self }.run(&mut first);
        let seconds = clock.elapsed().as_secs_f64() / f64::from(count);
        others.into_iter().for_each(|other| other.join().unwrap());
        seconds
    }

    /// The same by the model: c/N + 2 d + 2 (N − 1) b/B.
    fn predicted(self, size: u32, Network { delay, bandwidth }: Network) -> f64 {
        let others = f64::from(size - 1);
        let bytes = 4.0 * self.numbers as f64;
        let way = if size > 1 { 2.0 * delay.as_secs_f64() } else { 0.0 };
        self.compute.as_secs_f64() / f64::from(size) + way + 2.0 * others * bytes / bandwidth
    }
}

const MEGABIT: f64 = 125_000.0;

/// A message that has to come and go takes two delays at least, and large ones what the bandwidth says; more, where other
/// programs run.
#[test]
fn exact_a_slow_network_is_as_slow_as_it_should_be() {
    let none = Steps { compute: Duration::ZERO, numbers: 1, count: 4 };
    let network = Network { delay: Duration::from_millis(40), bandwidth: 1000.0 * MEGABIT };
    let seconds = none.seconds(5, network);
    assert!(seconds >= 0.08, "{seconds}");
    let large = Steps { numbers: 250_000, ..none };
    let network = Network { delay: Duration::ZERO, bandwidth: 100.0 * MEGABIT };
    let (seconds, predicted) = (large.seconds(3, network), large.predicted(3, network));
    assert!((predicted - 0.32).abs() < 1e-9);
    assert!(seconds > 0.9 * predicted, "{seconds}");
}

/// Strong scaling (a step of 4 s on one rank) and weak scaling (0.25 s on each), measured and predicted.
#[test]
#[ignore = "long"]
fn regress_scaling_over_slow_networks() {
    let networks = [
        Network { delay: Duration::from_micros(50), bandwidth: 10_000.0 * MEGABIT },
        Network { delay: Duration::from_millis(1), bandwidth: 1000.0 * MEGABIT },
        Network { delay: Duration::from_millis(20), bandwidth: 100.0 * MEGABIT },
    ];
    for network in networks {
        println!("{network:?}");
        for size in [1, 2, 4, 8, 16, 32, 64] {
            let [strong, weak] = [4.0, 0.25 * f64::from(size)].map(|seconds| Steps {
                compute: Duration::from_secs_f64(seconds),
                numbers: 55_169,
                count: 4,
            });
            let row = [strong, weak].map(|steps| {
                let (found, model) = (steps.seconds(size, network), steps.predicted(size, network));
                assert!(found > 0.9 * model, "{found} {model}");
                format!("{found:.3} s, predicted {model:.3} s")
            });
            println!("| {size} | {} |", row.join(" | "));
        }
    }
}
