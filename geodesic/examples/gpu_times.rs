//! Speed of a graphics device, by its own clock: rays with crossings and samples, and pictures of a disc in front of a sky
//! by the shader of the example `gpu_disc`.
//!
//! `cargo run --release -p kerrlight-geodesic --features wgpu --example gpu_times -- [DEVICE]`

use kerrlight_geodesic::gpu::{Compute, Needs, adapter};
use kerrlight_geodesic::{Camera, Inclination, Kerr, Motion, Observer, View, orbits, wgsl};

type Answer<T> = Result<T, Box<dyn std::error::Error>>;

/// Times of which the median is printed.
const REPEATS: usize = 15;

fn main() -> Answer<()> {
    let adapter = adapter(std::env::args().nth(1).as_deref())?;
    println!("{}, driver {}", adapter.name(), adapter.driver());
    let device = Compute::open(&adapter, Needs::default())?;
    for spin in [0.0, 0.9] {
        for (side, samples) in [(64, 0), (64, 100), (256, 100), (512, 0)] {
            rays(&device, spin, side, samples)?;
        }
    }
    for (width, height) in [(960, 540), (1920, 1080), (3840, 2160)] {
        disc(&device, width, height)?;
    }
    Ok(())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// A square screen of 20 M: all rays, with four crossings each and so many samples.
fn rays(device: &Compute, spin: f64, side: usize, samples: u32) -> Answer<()> {
    let hole = Kerr::new(spin)?;
    let count = side * side;
    let row = 64 * 1024;
    let view = View::Screen(Observer::at_infinity(Inclination::from_degrees(60.0)?));
    let task = wgsl::Task {
        rays: count as u32,
        crossings: 4,
        samples,
        row,
        ..wgsl::Task::new(hole, view)
    };
    let at = |k: usize| -10.0 + 20.0 * (k as f64 + 0.5) / side as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = (0..count).map(|k| (at(k % side), -at(k / side))).unzip();
    let points = device.storage(16 * count as u64)?;
    device.write(&points, &wgsl::point_bytes(&x, &y))?;
    let room = |bytes: usize| device.storage((count * bytes) as u64);
    let buffers = [
        device.uniform(&task.bytes())?,
        points,
        room(wgsl::END_BYTES)?,
        room(4 * wgsl::CROSSING_BYTES)?,
        room(samples as usize * wgsl::SAMPLE_BYTES)?,
    ];
    // SAFETY: indices of the tracer are below the numbers of its task, and its loops count up.
    let kernels =
        unsafe { device.kernels_unchecked(&wgsl::program(), &["kerr_trace", "kerr_sample"])? };
    let bindings: Vec<_> = (0..).zip(&buffers).collect();
    let bound = [device.bind(&kernels[0], &bindings)?, device.bind(&kernels[1], &bindings)?];
    let groups = [(count as u32).min(row).div_ceil(64), (count as u32).div_ceil(row)];
    device.start_timing()?;
    for _ in 0..REPEATS {
        device.run(|commands| {
            bound
                .iter()
                .take(1 + samples.min(1) as usize)
                .for_each(|b| commands.dispatch(b, groups));
        })?;
    }
    let times = device.times();
    let of = |entry: &str| -> Vec<f64> {
        times.iter().filter(|time| &*time.entry == entry).map(|time| time.seconds).collect()
    };
    let sampled = of("kerr_sample");
    println!(
        "spin {spin}, {side} x {side} rays, {samples} samples: traced in {:.3} ms, sampled in {:.3} ms",
        1e3 * median(of("kerr_trace")),
        if sampled.is_empty() { 0.0 } else { 1e3 * median(sampled) }
    );
    Ok(())
}

/// The picture of `gpu_disc`.
fn disc(device: &Compute, width: u32, height: u32) -> Answer<()> {
    let hole = Kerr::new(0.9)?;
    let camera = Camera::new(&hole, Inclination::from_degrees(82.0)?, 40.0, Motion::Static)?;
    let task = wgsl::Task::new(hole, View::Camera(camera));
    let mut uniform = task.bytes()[..192].to_vec();
    uniform.extend([width, height].into_iter().flat_map(u32::to_le_bytes));
    let edges = [0.55, orbits::isco(&hole) as f32, 16.0, 0.0, 0.0, 0.0f32];
    uniform.extend(edges.into_iter().flat_map(f32::to_le_bytes));
    let source = wgsl::library() + include_str!("gpu_disc.wgsl");
    // SAFETY: the tracer's loops count up, and the picture's index is below its size.
    let kernels = unsafe { device.kernels_unchecked(&source, &["paint"])? };
    let buffers =
        [device.uniform(&uniform)?, device.storage(16 * u64::from(width) * u64::from(height))?];
    let bindings: Vec<_> = (0..).zip(&buffers).collect();
    let bound = device.bind(&kernels[0], &bindings)?;
    device.start_timing()?;
    for _ in 0..REPEATS {
        device.run(|commands| {
            commands.dispatch(&bound, [width.div_ceil(8), height.div_ceil(8)]);
        })?;
    }
    let taken = median(device.times().into_iter().map(|time| time.seconds).collect());
    println!(
        "disc and sky, {width} x {height}: {:.2} ms, {:.0} a second",
        1e3 * taken,
        1.0 / taken
    );
    Ok(())
}
