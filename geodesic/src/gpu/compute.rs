//! Shaders on an open device: buffers that stay there, kernels, and commands in their order.

use super::device::{Adapter, Device, Needs};
use super::error::GpuError;
use super::times::{KernelTime, Stopwatch};
use std::borrow::Cow;
use std::sync::{Arc, Mutex, PoisonError};

/// An open device for shaders of one's own.
///
/// ```no_run
/// use kerrlight_geodesic::gpu::{self, Compute, Needs};
///
/// let device = Compute::open(&gpu::adapter(None)?, Needs::default())?;
/// let source = "@group(0) @binding(0) var<storage, read_write> x: array<u32>;
///     @compute @workgroup_size(64)
///     fn double(@builtin(global_invocation_id) at: vec3<u32>) { x[at.x] *= 2u; }";
/// let kernels = device.kernels(source, &["double"])?;
/// let x = device.storage(4 * 64)?;
/// device.write(&x, &[1; 256])?;
/// let double = device.bind(&kernels[0], &[(0, &x)])?;
/// device.run(|commands| commands.dispatch(&double, [1, 1]))?;
/// assert_eq!(device.read(&[&x])?[0], [2; 256]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Compute {
    device: Device,
    /// Times of kernels, while they are measured.
    times: Mutex<Option<Vec<KernelTime>>>,
    /// Memory through which buffers have been read, to be used again.
    readers: Mutex<Vec<wgpu::Buffer>>,
}

/// Memory of the device.
#[derive(Debug)]
pub struct Buffer {
    inner: wgpu::Buffer,
}

/// An entry point of a shader.
#[derive(Debug)]
pub struct Kernel {
    pipeline: wgpu::ComputePipeline,
    entry: Arc<str>,
}

/// An entry point with the buffers that it works on.
#[derive(Debug)]
pub struct Bound {
    pipeline: wgpu::ComputePipeline,
    entry: Arc<str>,
    groups: wgpu::BindGroup,
}

/// Commands that the device does one after the other.
#[derive(Debug)]
pub struct Commands {
    encoder: wgpu::CommandEncoder,
    /// Kernels in a row share a pass.
    pass: Option<wgpu::ComputePass<'static>>,
    stopwatch: Option<Stopwatch>,
}

impl Commands {
    fn new(device: &Device, is_timed: bool) -> Self {
        let descriptor = wgpu::CommandEncoderDescriptor::default();
        Self {
            encoder: device.inner.create_command_encoder(&descriptor),
            pass: None,
            stopwatch: is_timed.then(|| Stopwatch::new(device)),
        }
    }

    /// Runs a kernel on so many workgroups, columns and rows; what it writes the next one sees.
    pub fn dispatch(&mut self, bound: &Bound, groups: [u32; 2]) {
        let Self { encoder, pass, stopwatch } = self;
        if let Some(stopwatch) = stopwatch {
            // A pass of its own for each, whose ends are timed.
            let mut timed = stopwatch.begin(encoder, &bound.entry);
            return bound.dispatch(&mut timed, groups);
        }
        let pass = pass.get_or_insert_with(|| {
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()).forget_lifetime()
        });
        bound.dispatch(pass, groups);
    }

    /// Makes all bytes of a buffer 0.
    pub fn clear(&mut self, buffer: &Buffer) {
        self.pass = None;
        self.encoder.clear_buffer(&buffer.inner, 0, None);
    }

    /// Copies a buffer to one of the same size.
    fn copy(&mut self, from: &wgpu::Buffer, to: &wgpu::Buffer) {
        self.pass = None;
        self.encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
    }

    fn submit(mut self, device: &Device) -> Option<Stopwatch> {
        // The end of a pass is written when it is dropped.
        self.pass = None;
        if let Some(stopwatch) = &self.stopwatch {
            stopwatch.end(&mut self.encoder);
        }
        device.queue.submit([self.encoder.finish()]);
        self.stopwatch
    }
}

impl Bound {
    fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, groups: [u32; 2]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.groups, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }
}

impl Compute {
    /// Opens a device that has what is needed.
    ///
    /// # Errors
    /// If it refuses, or its limits are too small.
    pub fn open(adapter: &Adapter, needs: Needs) -> Result<Self, GpuError> {
        Ok(Self {
            device: Device::open(adapter, needs)?,
            times: Mutex::default(),
            readers: Mutex::default(),
        })
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        &self.device.name
    }

    /// Bytes of the largest buffer that a shader may see.
    pub fn largest_buffer(&self) -> u64 {
        self.device.largest
    }

    /// Memory that shaders read and write, zero at first.
    ///
    /// # Errors
    /// If there is not so much.
    pub fn storage(&self, bytes: u64) -> Result<Buffer, GpuError> {
        self.made(bytes, &[], wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)
    }

    /// A uniform with these bytes.
    ///
    /// # Errors
    /// If the device fails.
    pub fn uniform(&self, bytes: &[u8]) -> Result<Buffer, GpuError> {
        self.made(bytes.len() as u64, bytes, wgpu::BufferUsages::UNIFORM)
    }

    /// Memory with these bytes, which shaders read.
    pub(super) fn input(&self, bytes: &[u8]) -> Result<Buffer, GpuError> {
        self.made(bytes.len() as u64, bytes, wgpu::BufferUsages::STORAGE)
    }

    fn made(
        &self,
        bytes: u64,
        content: &[u8],
        usage: wgpu::BufferUsages,
    ) -> Result<Buffer, GpuError> {
        // No binding may be empty.
        let size = bytes.max(32).next_multiple_of(16);
        if size > self.device.largest {
            return Err(GpuError::OutOfMemory { bytes });
        }
        let inner = self.device.attempt(size, || {
            let made = self.device.inner.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            if !content.is_empty() {
                self.device.queue.write_buffer(&made, 0, content);
            }
            made
        })?;
        Ok(Buffer { inner })
    }

    /// Puts bytes (a multiple of 4) at the start of a buffer before what runs next; what runs already does not see them.
    ///
    /// # Errors
    /// If they do not fit, or the device fails.
    pub fn write(&self, buffer: &Buffer, bytes: &[u8]) -> Result<(), GpuError> {
        self.device.attempt(0, || self.device.queue.write_buffer(&buffer.inner, 0, bytes))
    }

    /// Compiles the entry points of a shader.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn kernels(&self, source: &str, entries: &[&str]) -> Result<Vec<Kernel>, GpuError> {
        let checks = wgpu::ShaderRuntimeChecks::checked();
        // SAFETY: with all checks no shader can do harm.
        unsafe { self.compiled(source, entries, checks) }
    }

    /// Makes kernels like [`kernels`](Self::kernels), without the checks of indices and the counter in each loop by which
    /// one that does not end is ended: a network's kernels then take a quarter less time.
    ///
    /// # Safety
    /// All indices have to be within their arrays, and all loops of the shader have to end.
    ///
    /// # Errors
    /// What the compiler says.
    pub unsafe fn kernels_unchecked(
        &self,
        source: &str,
        entries: &[&str],
    ) -> Result<Vec<Kernel>, GpuError> {
        // SAFETY: it does no harm, as the caller says.
        unsafe { self.compiled(source, entries, wgpu::ShaderRuntimeChecks::unchecked()) }
    }

    /// Compiles with some checks.
    ///
    /// # Safety
    /// Without the checks that are not made, the shader does no harm.
    pub(super) unsafe fn compiled(
        &self,
        source: &str,
        entries: &[&str],
        checks: wgpu::ShaderRuntimeChecks,
    ) -> Result<Vec<Kernel>, GpuError> {
        self.device.attempt(0, || {
            let descriptor = wgpu::ShaderModuleDescriptor {
                label: None,
                source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(source)),
            };
            // SAFETY: as the caller says.
            let module =
                unsafe { self.device.inner.create_shader_module_trusted(descriptor, checks) };
            let kernel = |entry: &&str| {
                let descriptor = wgpu::ComputePipelineDescriptor {
                    label: Some(entry),
                    layout: None,
                    module: &module,
                    entry_point: Some(entry),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    cache: None,
                };
                let pipeline = self.device.inner.create_compute_pipeline(&descriptor);
                Kernel { pipeline, entry: Arc::from(*entry) }
            };
            entries.iter().map(kernel).collect()
        })
    }

    /// A kernel with a buffer for each binding of group 0 that it uses.
    ///
    /// # Errors
    /// If they do not fit.
    pub fn bind(&self, kernel: &Kernel, buffers: &[(u32, &Buffer)]) -> Result<Bound, GpuError> {
        self.device.attempt(0, || {
            let entries: Vec<_> = buffers
                .iter()
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: buffer.inner.as_entire_binding(),
                })
                .collect();
            let groups = self.device.inner.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &kernel.pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            let Kernel { pipeline, entry } = kernel;
            Bound { pipeline: pipeline.clone(), entry: entry.clone(), groups }
        })
    }

    /// Hands commands to the device, and does not wait for them.
    ///
    /// # Errors
    /// If the device fails.
    pub fn run(&self, record: impl FnOnce(&mut Commands)) -> Result<(), GpuError> {
        let mut times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        let stopwatch = self.device.attempt(0, || {
            let mut commands = Commands::new(&self.device, times.is_some());
            record(&mut commands);
            commands.submit(&self.device)
        })?;
        if let (Some(times), Some(stopwatch)) = (&mut *times, stopwatch) {
            times.extend(stopwatch.read(&self.device)?);
        }
        Ok(())
    }

    /// Starts to measure the times of kernels by the device's clock, up to [`times`](Self::times). Each
    /// [`run`](Self::run) then waits until it is done.
    ///
    /// # Errors
    /// If the device has no clock.
    pub fn start_timing(&self) -> Result<(), GpuError> {
        Stopwatch::check(&self.device)?;
        *self.times.lock().unwrap_or_else(PoisonError::into_inner) = Some(Vec::new());
        Ok(())
    }

    /// Returns the times of kernels since [`start_timing`](Self::start_timing), in their order, and stops measuring.
    pub fn times(&self) -> Vec<KernelTime> {
        self.times.lock().unwrap_or_else(PoisonError::into_inner).take().unwrap_or_default()
    }

    /// The bytes of buffers once all commands are done.
    ///
    /// # Errors
    /// If the device fails.
    pub fn read(&self, buffers: &[&Buffer]) -> Result<Vec<Vec<u8>>, GpuError> {
        self.read_as(buffers, <[u8]>::to_vec)
    }

    /// Reads the bytes of buffers once all commands are done.
    ///
    /// # Errors
    /// If the device fails.
    pub fn read_as<T>(
        &self,
        buffers: &[&Buffer],
        made: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, GpuError> {
        self.run_and_read(|_| {}, buffers, made)
    }

    /// Hands commands to the device, untimed, and reads the bytes of buffers once all are done.
    pub(super) fn run_and_read<T>(
        &self,
        record: impl FnOnce(&mut Commands),
        buffers: &[&Buffer],
        made: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, GpuError> {
        let bytes = buffers.iter().map(|buffer| buffer.inner.size()).sum();
        let copies = self.device.attempt(bytes, || {
            let mut commands = Commands::new(&self.device, false);
            record(&mut commands);
            let copied = buffers.iter().map(|Buffer { inner }| {
                let to = self.reader(inner.size());
                commands.copy(inner, &to);
                to
            });
            let copies: Vec<_> = copied.collect();
            commands.submit(&self.device);
            copies
        })?;
        let read = self.device.read(&copies, made)?;
        copies.iter().for_each(wgpu::Buffer::unmap);
        *self.readers.lock().unwrap_or_else(PoisonError::into_inner) = copies;
        Ok(read)
    }

    /// Memory of this size to read through: some of the last time's, or new.
    fn reader(&self, size: u64) -> wgpu::Buffer {
        let mut readers = self.readers.lock().unwrap_or_else(PoisonError::into_inner);
        let found = readers.iter().position(|reader| reader.size() == size);
        found.map_or_else(|| self.device.readable(size), |k| readers.swap_remove(k))
    }

    /// Gives the device up: everything after that is [`GpuError::Lost`]. What a card that is unplugged does, for tests.
    pub fn lose(&self) {
        self.device.inner.destroy();
    }
}
