//! A disc in front of a sky, on a graphics card: the tracer's shader with a shader of one's own behind it, through
//! wgpu alone. It writes `gpu_disc.ppm` and compares the radii that it found with the tracer in doubles.
//!
//! `cargo run --release -p kerrlight-geodesic --features wgpu --example gpu_disc`

use kerrlight_geodesic::{
    Camera, Inclination, Kerr, Motion, Path, Quantities, Tracer, View, orbits, wgsl,
};
use std::future::Future;
use std::task::{Context, Poll, Waker};

const WIDTH: u32 = 960;
const HEIGHT: u32 = 540;
const TANGENT: f32 = 0.55;
const OUTER: f32 = 16.0;

type Answer<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Answer<()> {
    let hole = Kerr::new(0.9)?;
    let inclination = Inclination::from_degrees(82.0)?;
    let camera = Camera::new(&hole, inclination, 40.0, Motion::Static)?;
    let inner = orbits::isco(&hole) as f32;
    let pixels = paint(&uniform(&hole, camera, inner))?;
    write("gpu_disc.ppm", &pixels)?;
    compare(&hole, &camera, inner, &pixels)
}

/// The uniform of the shader: what [`wgsl::Task`] has of hole and camera, then this picture's own numbers.
fn uniform(hole: &Kerr, camera: Camera, inner: f32) -> Vec<u8> {
    let task = wgsl::Task::new(*hole, View::Camera(camera));
    let mut bytes = task.bytes()[..192].to_vec();
    bytes.extend([WIDTH, HEIGHT].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend([TANGENT, inner, OUTER, 0.0, 0.0, 0.0].into_iter().flat_map(f32::to_le_bytes));
    bytes
}

/// Red, green, blue and the radius of the disc (0 beside it) of each pixel.
fn paint(uniform: &[u8]) -> Answer<Vec<[f32; 4]>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = wait(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let limits = wgpu::Limits::downlevel_defaults();
    let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
    let (device, queue) = wait(adapter.request_device(&descriptor))?;
    let buffer = |size: u64, usage| {
        let (label, mapped_at_creation) = (None, false);
        device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation })
    };
    let (here, there) = (wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::COPY_DST);
    let size = u64::from(WIDTH * HEIGHT) * 16;
    let settings = buffer(uniform.len() as u64, wgpu::BufferUsages::UNIFORM | there);
    let painted = buffer(size, wgpu::BufferUsages::STORAGE | here);
    let read = buffer(size, wgpu::BufferUsages::MAP_READ | there);
    queue.write_buffer(&settings, 0, uniform);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    dispatch(&device, &mut encoder, [&settings, &painted]);
    encoder.copy_buffer_to_buffer(&painted, 0, &read, 0, size);
    queue.submit([encoder.finish()]);
    read.map_async(wgpu::MapMode::Read, .., |mapped| mapped.expect("the picture is mapped"));
    device.poll(wgpu::PollType::wait_indefinitely())?;
    let bytes = read.get_mapped_range(..)?.to_vec();
    let floats = bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word));
    Ok(floats.collect::<Vec<_>>().as_chunks::<4>().0.to_vec())
}

/// Compiles the shaders and paints with them.
fn dispatch(
    device: &wgpu::Device,
    encoder: &mut wgpu::CommandEncoder,
    buffers: [&wgpu::Buffer; 2],
) {
    let source = wgsl::library() + include_str!("gpu_disc.wgsl");
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("paint"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let entry = |binding: u32| wgpu::BindGroupEntry {
        binding,
        resource: buffers[binding as usize].as_entire_binding(),
    };
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[entry(0), entry(1)],
    });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(WIDTH.div_ceil(8), HEIGHT.div_ceil(8), 1);
}

/// Futures of wgpu on a computer of one's own are ready at once.
fn wait<F: Future>(future: F) -> F::Output {
    let mut future = std::pin::pin!(future);
    loop {
        if let Poll::Ready(done) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return done;
        }
    }
}

fn write(path: &str, pixels: &[[f32; 4]]) -> std::io::Result<()> {
    let byte = |light: f32| (255.0 * (1.0 - (-light).exp()).powf(1.0 / 2.2)) as u8;
    let mut file = format!("P6 {WIDTH} {HEIGHT} 255\n").into_bytes();
    file.extend(pixels.iter().flat_map(|[r, g, b, _]| [*r, *g, *b].map(byte)));
    std::fs::write(path, file)
}

/// Every hundredth pixel once more in doubles.
fn compare(hole: &Kerr, camera: &Camera, inner: f32, pixels: &[[f32; 4]]) -> Answer<()> {
    let (tracer, mut path) = (Tracer::new(1e-12)?, Path::new());
    let (mut worst, mut elsewhere, mut count) = (0.0f64, 0, 0);
    for (k, [.., found]) in pixels.iter().enumerate().step_by(101) {
        let scale = f64::from(TANGENT) / f64::from(WIDTH / 2);
        let x = (k as f64 % f64::from(WIDTH)).floor() + 0.5 - f64::from(WIDTH / 2);
        let y = (k / WIDTH as usize) as f64 + 0.5 - f64::from(HEIGHT / 2);
        tracer.trace(hole, &camera.ray(x * scale, -y * scale)?, Quantities::POLAR, &mut path);
        let radii = path.equatorial_crossings().map(|time| path.at(time).radius());
        let lit = |r: &f64| *r > f64::from(inner) && *r < f64::from(OUTER);
        let exact = radii.into_iter().find(lit).unwrap_or(0.0);
        count += 1;
        if (exact > 0.0) == (*found > 0.0) {
            worst = worst.max((exact - f64::from(*found)).abs() / exact.max(1.0));
        } else {
            elsewhere += 1;
        }
    }
    println!(
        "{count} pixels: radii of the disc within {worst:.1e}, {elsewhere} on another image of it"
    );
    Ok(())
}
