//! Whole rays of a picture, followed step by step on a graphics device.

use super::bytes::{float, single};
use super::compute::{Compute, Kernel};
use super::error::GpuError;
use super::kernel::{self, whole_rays};
use crate::integrate::assembly::TaylorStep;
use crate::rays::block::{DeviceEnd, DevicePaths};
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use crate::wgsl::{self, STEP_BYTES};

/// The kernel `kerr_path`.
#[derive(Debug)]
pub(super) struct PathKernel(Vec<Kernel>);

/// Steps that a ray gets room for beyond those that another kernel has counted: compilers round each in its own way.
const SPARE: usize = 2;

impl PathKernel {
    pub fn new(device: &Compute) -> Result<Self, GpuError> {
        Ok(PathKernel(kernel::compiled(device, &wgsl::paths(), &["kerr_path"])?))
    }

    /// Follows the rays at the points (`x[k]`, `y[k]`), whose `ends` are known with quadratures, all the way.
    pub fn follow(
        &self,
        device: &Compute,
        (hole, view): (&Kerr, &View),
        (x, y): (&[f64], &[f64]),
        ends: &[DeviceEnd],
        paths: &mut DevicePaths,
    ) -> Result<(), GpuError> {
        paths.clear();
        let most = (device.largest_buffer() / STEP_BYTES as u64) as usize;
        let mut first = 0;
        while first < ends.len() {
            let mut steps = 0;
            let fits = |end: &&DeviceEnd| {
                steps += room(end);
                steps <= most
            };
            let some = first..first + ends[first..].iter().take_while(fits).count().max(1);
            let points = wgsl::point_bytes(&x[some.clone()], &y[some.clone()]);
            self.follow_some(device, (hole, view), &points, &ends[some.clone()], paths)?;
            first = some.end;
        }
        Ok(())
    }

    fn follow_some(
        &self,
        device: &Compute,
        (hole, view): (&Kerr, &View),
        points: &[u8],
        ends: &[DeviceEnd],
        paths: &mut DevicePaths,
    ) -> Result<(), GpuError> {
        let task = whole_rays(hole, view, ends.len());
        let (mut rooms, mut all) = (Vec::with_capacity(8 * ends.len()), 0);
        for end in ends {
            rooms.extend([all, room(end)].into_iter().flat_map(|word| (word as u32).to_le_bytes()));
            all += room(end);
        }
        let (inputs, bytes) = ([points, &rooms], [(all * STEP_BYTES) as u64]);
        let outputs = kernel::run(device, &self.0, task.rays, &task.bytes(), &inputs, &bytes)?;
        let mut rest = &outputs[0][..];
        for end in ends {
            let (own, others) = rest.split_at(room(end) * STEP_BYTES);
            take(end, own, paths);
            rest = others;
        }
        Ok(())
    }
}

/// Steps of a ray that there is room for.
fn room(end: &DeviceEnd) -> usize {
    if end.is_trusted { end.steps as usize + SPARE } else { 0 }
}

/// Takes the steps of a ray up to the one that is marked as its last.
fn take(end: &DeviceEnd, bytes: &[u8], paths: &mut DevicePaths) {
    let steps = bytes.chunks_exact(STEP_BYTES);
    let Some(last) = steps.clone().position(|step| float(step, 4) == 1.0) else {
        return paths.push_unknown();
    };
    let scale = float(bytes, 3);
    paths.push((scale, end.outcome, end.error), steps.take(last + 1).map(step));
}

fn step(bytes: &[u8]) -> TaylorStep {
    let mut step = TaylorStep {
        length: float(bytes, 0),
        leg: float(bytes, 1),
        centre: float(bytes, 2),
        series: Default::default(),
    };
    for (k, coefficient) in step.series.iter_mut().flatten().enumerate() {
        *coefficient = single(bytes, 6 + k);
    }
    step
}
