//! Time of a step of a fit on a graphics device, kernel by kernel, by the device's own clock: scene "1" of BH-NeRF (Levis et
//! al. 2022), as many pixels a step as have `points` nodes; beside the device's highest rates.
//!
//! `cargo run --release -p kerrlight-tomo --features wgpu --example device_times -- representation=bhnerf`
//!
//! Settings, all optional: `representation` (bhnerf, feature-grid, grid), `optimiser` (adam, muon), `points` (57344), `steps`
//! (200), `stretch` (256: after so many the state comes back), `device`.

mod paper;

use kerrlight_geodesic::gpu::{Adapter, Compute, GpuError, KernelTime, Needs, adapter};
use kerrlight_render::dynamics::Axis;
use kerrlight_tomo::fit::graphics::{GraphicsFit, open};
use kerrlight_tomo::fit::{
    Batch, BatchSize, Drawn, ForwardModel, State, StepDevice, Stretch, Training,
};
use kerrlight_tomo::optimise::Muon;
use kerrlight_tomo::representation::{
    Activation, FeatureGrid, FeatureGridSettings, Grid, GridSettings, Network, NetworkSettings,
    Representation,
};
use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

type Answer<T> = Result<T, Box<dyn Error>>;

fn main() -> Answer<()> {
    let split = |word: String| word.split_once('=').map(|(a, b)| (a.to_owned(), b.to_owned()));
    let words: BTreeMap<String, String> = std::env::args().skip(1).filter_map(split).collect();
    let word = |name: &str, usual: &str| words.get(name).map_or(usual, String::as_str).to_owned();
    let device = adapter(words.get("device").map(String::as_str))?;
    println!("{}, driver {}", device.name(), device.driver());
    ceilings(&device)?;
    let field = representation(&word("representation", "bhnerf"))?;
    let muon = (word("optimiser", "adam") == "muon").then(Muon::default);
    let size = |name: &str, usual: &str| word(name, usual).parse::<usize>();
    let sizes = [size("points", "57344")?, size("steps", "200")?, size("stretch", "256")?];
    steps_of(&device, field, muon, sizes)
}

/// A representation and, of a network, its operations a point: forward, and forward and back.
type Chosen = (Box<dyn Representation<f32>>, Option<[usize; 2]>);

fn representation(name: &str) -> Answer<Chosen> {
    let (low, high) = ([-5.0; 3], [5.0; 3]);
    Ok(match name {
        "bhnerf" => {
            let network = Network::new(NetworkSettings::bhnerf())?;
            let operations = network.operations();
            (Box::new(network), Some(operations))
        }
        "feature-grid" => {
            let (coarsest, levels, activation, initial) = (8, 4, Activation::Sigmoid, -1.0);
            let settings = FeatureGridSettings { coarsest, levels, low, high, activation, initial };
            (Box::new(FeatureGrid::new(settings)?), None)
        }
        "grid" => {
            let (nodes, activation, initial) = ([64; 3], Activation::Sigmoid, -10.0);
            (Box::new(Grid::new(GridSettings { nodes, low, high, activation, initial })?), None)
        }
        other => return Err(format!("{other}: bhnerf, feature-grid or grid").into()),
    })
}

/// Numbers that kernels of the ceilings work on, bytes each.
const FLOATS: u32 = 1 << 25;
const CEILINGS: &str = "
@group(0) @binding(0) var<storage, read> from_here: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> to_there: array<vec4<f32>>;

@compute @workgroup_size(256)
fn copied(@builtin(global_invocation_id) at: vec3<u32>) {
    to_there[at.x] = from_here[at.x];
}

@compute @workgroup_size(256)
fn multiplied(@builtin(global_invocation_id) at: vec3<u32>) {
    let by = from_here[at.x % 16u];
    var a = from_here[at.x];
    var b = a + by;
    var c = b + by;
    var d = c + by;
    for (var k = 0u; k < 512u; k++) {
        a = fma(a, by, by);
        b = fma(b, by, by);
        c = fma(c, by, by);
        d = fma(d, by, by);
    }
    to_there[at.x] = a + b + c + d;
}
";

/// Measures the device's highest rates of products, sums and copies.
fn ceilings(adapter: &Adapter) -> Result<(), GpuError> {
    let device = Compute::open(adapter, Needs { invocations: 256, ..Needs::default() })?;
    // SAFETY: there are as many invocations as vectors, and the loop counts up.
    let kernels = unsafe { device.kernels_unchecked(CEILINGS, &["copied", "multiplied"])? };
    let bytes = (4 * u64::from(FLOATS)).min(device.largest_buffer());
    let (from, to) = (device.storage(bytes)?, device.storage(bytes)?);
    let tasks = [0, 1].map(|k| device.bind(&kernels[k], &[(0, &from), (1, &to)]));
    let [copied, multiplied] = tasks;
    let (copied, multiplied) = (copied?, multiplied?);
    let groups = [bytes as u32 / 16 / 256, 1];
    device.start_timing()?;
    for _ in 0..5 {
        device.run(|commands| {
            commands.dispatch(&copied, groups);
            commands.dispatch(&multiplied, groups);
        })?;
    }
    let times = device.times();
    let least = |entry: &str| {
        let of_it = times.iter().filter(|time| &*time.entry == entry);
        of_it.map(|time| time.seconds).fold(f64::INFINITY, f64::min)
    };
    let vectors = bytes as f64 / 16.0;
    println!(
        "at most {:.2} TFLOP/s, {:.2} TB/s (copies of {} MiB)",
        vectors * 4.0 * 4.0 * 512.0 * 2.0 / least("multiplied") * 1e-12,
        2.0 * bytes as f64 / least("copied") * 1e-12,
        bytes >> 20
    );
    Ok(())
}

/// Steps from rays that have so many points.
fn steps_of(
    adapter: &Adapter,
    (field, operations): Chosen,
    muon: Option<Muon>,
    [points, steps, most]: [usize; 3],
) -> Answer<()> {
    let field = &*field;
    let (objective, axis) = (paper::objective(16)?, paper::axis());
    let model = &objective.model;
    let (pairs, held) = pairs_with(model, axis, points);
    let batch = BatchSize::Pixels(pairs.len());
    let training = Training { muon, ..paper::training(batch, steps as u64) };
    let now = State::<f32>::new(field, axis, &training).now;
    let mut fit = GraphicsFit::new(open(adapter)?, &objective, field, &training, None)?;
    let stretch = |steps: usize| Stretch {
        objective: &objective,
        axis,
        occupancy: None,
        draws: vec![Drawn::Pixels(pairs.clone()); steps],
        rates: vec![1e-3; steps],
    };
    fit.take(&stretch(3), &now)?;
    fit.device().start_timing()?;
    fit.take(&stretch(10), &now)?;
    table(&fit.device().times(), 10.0, |entry| {
        let [forward, all] = operations?;
        let a_point = match entry {
            "forward" | "weights_back" => forward,
            "units_back" => all - 2 * forward,
            _ => return None,
        };
        Some(held as f64 * a_point as f64)
    });
    let most = fit.most().min(steps).min(most);
    let (start, before) = (Instant::now(), processor_time());
    for _ in 0..steps / most {
        fit.take(&stretch(most), &now)?;
    }
    let taken = (steps / most * most) as f64;
    println!(
        "{} pairs, {held} points, {} parameters: {:.3} ms a step in all, {:.3} ms of them this thread's work",
        pairs.len(),
        field.parameters(),
        start.elapsed().as_secs_f64() * 1e3 / taken,
        (processor_time() - before) * 1e3 / taken
    );
    Ok(())
}

/// Rays in frames, all over the screen, that have so many points, and how many exactly.
fn pairs_with(model: &ForwardModel<f32>, axis: Axis, points: usize) -> (Vec<(u32, u32)>, usize) {
    let mut all = Batch::default();
    all.set((0..model.rays()).map(|ray| (ray as u32, 0)));
    all.gather(model, axis, None);
    let (mut pairs, mut held) = (Vec::new(), 0);
    while held < points {
        // A stride that visits all rays.
        let k = pairs.len();
        let ray = (k * 1009) % model.rays();
        held += all.starts[ray + 1] - all.starts[ray];
        pairs.push((ray as u32, (k % model.frames()) as u32));
    }
    (pairs, held)
}

/// Seconds that this thread has computed for; 0 where Linux does not tell.
fn processor_time() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    told.split(' ').next().and_then(|word| word.parse::<f64>().ok()).unwrap_or_default() * 1e-9
}

/// Kernels with what they took a step.
fn table(times: &[KernelTime], steps: f64, flop: impl Fn(&str) -> Option<f64>) {
    let mut sums: BTreeMap<&str, (usize, f64)> = BTreeMap::new();
    for KernelTime { entry, seconds } in times {
        let (count, sum) = sums.entry(entry).or_default();
        (*count, *sum) = (*count + 1, *sum + seconds);
    }
    for (entry, (count, sum)) in &sums {
        let (each, a_step) = (*count as f64 / steps, sum / steps);
        let rate = flop(entry).map(|flop| format!("{:8.2} TFLOP/s", flop / a_step * 1e-12));
        println!("{entry:14} {each:5.1} {:9.1} us {}", 1e6 * a_step, rate.unwrap_or_default());
    }
    println!(
        "all kernels          {:9.1} us",
        1e6 * sums.values().map(|s| s.1).sum::<f64>() / steps
    );
}
