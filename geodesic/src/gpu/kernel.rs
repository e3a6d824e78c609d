//! Kernels of this crate's shaders, run on bytes.

use super::compute::{Buffer, Compute, Kernel};
use super::error::GpuError;
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use crate::wgsl::Task;

/// Invocations of a workgroup.
const WORKGROUP: u32 = 64;

/// Invocations in a row of the grid: fewer than any device allows.
pub(super) const ROW: u32 = WORKGROUP * 1024;

/// The task of kernels that take rays from end to end, with all quantities.
pub(super) fn whole_rays(hole: &Kerr, view: &View, rays: usize) -> Task {
    Task { rays: rays as u32, row: ROW, ..Task::new(*hole, *view) }
}

/// Compiles the entry points of a shader, with all run-time checks but that loops end.
pub(super) fn compiled(
    device: &Compute,
    source: &str,
    entries: &[&str],
) -> Result<Vec<Kernel>, GpuError> {
    let checks = wgpu::ShaderRuntimeChecks::checked();
    let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..checks };
    // SAFETY: the shaders of this crate have loops over a counter alone.
    unsafe { device.compiled(source, entries, checks) }
}

/// Runs kernels one after another on so many invocations, and returns the bytes of each output. Their bindings are the
/// uniform, what they read, and outputs of so many bytes, zero at first.
pub(super) fn run(
    device: &Compute,
    kernels: &[Kernel],
    invocations: u32,
    uniform: &[u8],
    inputs: &[&[u8]],
    outputs: &[u64],
) -> Result<Vec<Vec<u8>>, GpuError> {
    let read = inputs.iter().map(|bytes| device.input(bytes));
    let written = outputs.iter().map(|bytes| device.storage(*bytes));
    let buffers = [device.uniform(uniform)].into_iter().chain(read).chain(written);
    let buffers = buffers.collect::<Result<Vec<Buffer>, _>>()?;
    let bindings: Vec<(u32, &Buffer)> = (0..).zip(&buffers).collect();
    let bound = kernels.iter().map(|kernel| device.bind(kernel, &bindings));
    let bound = bound.collect::<Result<Vec<_>, _>>()?;
    let groups = [invocations.min(ROW).div_ceil(WORKGROUP), invocations.div_ceil(ROW)];
    let written: Vec<&Buffer> = buffers.iter().skip(1 + inputs.len()).collect();
    device.run_and_read(
        |commands| bound.iter().for_each(|bound| commands.dispatch(bound, groups)),
        &written,
        <[u8]>::to_vec,
    )
}
