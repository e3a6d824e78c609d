//! A shader with its bindings, run on bytes.

use super::device::Device;
use super::error::GpuError;
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use crate::wgsl::Task;
use std::borrow::Cow;

/// A buffer bound to a kernel.
#[derive(Debug, Clone, Copy)]
pub(super) enum Binding<'a> {
    /// The uniform.
    Uniform(&'a [u8]),
    /// Bytes that the shader reads.
    Input(&'a [u8]),
    /// Bytes that it writes and reads: so many, zero at first.
    Output(u64),
}

/// The entry points of one shader.
#[derive(Debug)]
pub(super) struct Program {
    layout: wgpu::BindGroupLayout,
    entries: Vec<wgpu::ComputePipeline>,
}

/// Returns the run-time checks of shaders whose loops end by themselves.
fn loops_that_end() -> wgpu::ShaderRuntimeChecks {
    wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() }
}

/// Invocations of a workgroup.
pub(super) const WORKGROUP: u32 = 64;

/// Invocations in a row of the grid: fewer than any device allows.
pub(super) const ROW: u32 = WORKGROUP * 1024;

/// The task of kernels that take rays from end to end, with all quantities.
pub(super) fn whole_rays(hole: &Kerr, view: &View, rays: usize) -> Task {
    Task { rays: rays as u32, row: ROW, ..Task::new(*hole, *view) }
}

impl Program {
    /// Compiles the entry points of `source`; `bindings` has a value of the kind of each binding.
    pub fn new(
        device: &Device,
        source: &str,
        entries: &[&str],
        bindings: &[Binding<'_>],
    ) -> Result<Self, GpuError> {
        device.attempt(0, || {
            let descriptor = wgpu::ShaderModuleDescriptor {
                label: None,
                source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(source)),
            };
            // SAFETY: the shaders of this crate have loops over a counter alone.
            let module =
                unsafe { device.inner.create_shader_module_trusted(descriptor, loops_that_end()) };
            let layout = layout(device, bindings);
            let entries = entries.iter().map(|entry| pipeline(device, &module, &layout, entry));
            Program { entries: entries.collect(), layout }
        })
    }

    /// Runs the entry points one after another on so many invocations, and returns the bytes of each output.
    pub fn run(
        &self,
        device: &Device,
        entries: &[usize],
        invocations: u32,
        bindings: &[Binding<'_>],
    ) -> Result<Vec<Vec<u8>>, GpuError> {
        let bytes = bindings.iter().map(Binding::bytes).sum();
        let read = device.attempt(bytes, || {
            let buffers: Vec<_> = bindings.iter().map(|binding| buffer(device, binding)).collect();
            let outputs: Vec<_> = bindings
                .iter()
                .zip(&buffers)
                .filter(|(binding, _)| matches!(binding, Binding::Output(_)))
                .map(|(_, buffer)| (buffer, readable(device, buffer.size())))
                .collect();
            self.submit(device, entries, invocations, &buffers, &outputs);
            outputs.into_iter().map(|(_, read)| read).collect::<Vec<_>>()
        })?;
        device.read(&read, <[u8]>::to_vec)
    }

    fn submit(
        &self,
        device: &Device,
        entries: &[usize],
        invocations: u32,
        buffers: &[wgpu::Buffer],
        outputs: &[(&wgpu::Buffer, wgpu::Buffer)],
    ) {
        let groups = self.groups(device, buffers);
        let mut encoder =
            device.inner.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for entry in entries {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.entries[*entry]);
            pass.set_bind_group(0, &groups, &[]);
            let columns = invocations.min(ROW).div_ceil(WORKGROUP);
            pass.dispatch_workgroups(columns, invocations.div_ceil(ROW), 1);
        }
        for (from, to) in outputs {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        device.queue.submit([encoder.finish()]);
    }

    fn groups(&self, device: &Device, buffers: &[wgpu::Buffer]) -> wgpu::BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .enumerate()
            .map(|(k, buffer)| wgpu::BindGroupEntry {
                binding: k as u32,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        device.inner.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &entries,
        })
    }
}

impl Binding<'_> {
    fn bytes(&self) -> u64 {
        match self {
            Binding::Uniform(bytes) | Binding::Input(bytes) => bytes.len() as u64,
            Binding::Output(bytes) => *bytes,
        }
    }

    fn kind(&self) -> wgpu::BindingType {
        let ty = match self {
            Binding::Uniform(_) => wgpu::BufferBindingType::Uniform,
            Binding::Input(_) => wgpu::BufferBindingType::Storage { read_only: true },
            Binding::Output(_) => wgpu::BufferBindingType::Storage { read_only: false },
        };
        wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
    }
}

fn layout(device: &Device, bindings: &[Binding<'_>]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = bindings
        .iter()
        .enumerate()
        .map(|(k, binding)| wgpu::BindGroupLayoutEntry {
            binding: k as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: binding.kind(),
            count: None,
        })
        .collect();
    device.inner.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

fn pipeline(
    device: &Device,
    module: &wgpu::ShaderModule,
    layout: &wgpu::BindGroupLayout,
    entry: &str,
) -> wgpu::ComputePipeline {
    let layout = device.inner.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.inner.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&layout),
        module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn buffer(device: &Device, binding: &Binding<'_>) -> wgpu::Buffer {
    let usage = match binding {
        Binding::Uniform(_) => wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        Binding::Input(_) => wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        Binding::Output(_) => wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
    };
    // No binding may be empty.
    let size = binding.bytes().max(32).next_multiple_of(4);
    let made = device.inner.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size,
        usage,
        mapped_at_creation: false,
    });
    if let Binding::Uniform(bytes) | Binding::Input(bytes) = binding {
        device.queue.write_buffer(&made, 0, bytes);
    }
    made
}

pub(super) fn readable(device: &Device, size: u64) -> wgpu::Buffer {
    device.inner.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}
