//! Kernels from the light of rays to visibilities, their losses, and back to rays.

use super::bytes::{floats, words};
use super::comparisons::Comparisons;
use super::kernels::compiled;
use super::pixels::Pixels;
use crate::fit::loss::objective::Objective;
use kerrlight_geodesic::gpu::{Bound, Buffer, Commands, Compute, GpuError};
use kerrlight_geodesic::wgsl;

const SHADER: &str = include_str!("shaders/visibilities.wgsl");
const ENTRIES: [&str; 7] = ["look", "compare", "close", "pull", "open", "shine", "add_losses"];

/// The most workgroups along either side of a grid.
const MOST: usize = 65_535;

/// The kernels about visibilities, and what they work on.
#[derive(Debug)]
pub struct Visibilities {
    tasks: [Bound; 7],
    task: Buffer,
    piece: Buffer,
    factors: Buffer,
    losses: Buffer,
    frames: Vec<[u32; 4]>,
    most: [usize; 2],
    rays: usize,
    terms: usize,
}

impl Visibilities {
    /// Takes the visibilities of a fit, so many frames at a time, whose losses are kept for so many steps; none if there
    /// are data that only this processor compares.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn new(
        device: &Compute,
        objective: &Objective<f32>,
        pixels: &Pixels,
        frames: usize,
        records: usize,
    ) -> Result<Option<Self>, GpuError> {
        let Some(all) = Comparisons::new(objective) else { return Ok(None) };
        let ([seen, closures], rays) = (all.most(), objective.model.rays());
        // `look` has a workgroup for each visibility, every kernel a row of them for each frame.
        if seen > MOST || frames > MOST || rays == 0 {
            return Ok(None);
        }
        let terms = objective.data.others.len();
        let filled = |bytes: Vec<u8>| -> Result<Buffer, GpuError> {
            let buffer = device.storage(bytes.len() as u64)?;
            device.write(&buffer, &bytes)?;
            Ok(buffer)
        };
        let room = |numbers: usize| device.storage(4 * (frames * numbers) as u64);
        let task = device.uniform(&[0; 32])?;
        let piece = room(4)?;
        let factors = device.storage(4 * terms as u64)?;
        let losses = device.storage(4 * (records * terms) as u64)?;
        let places = filled(floats(&places(objective, &all)))?;
        let [visibilities, quantities] = [filled(words(&all.seen))?, filled(words(&all.closures))?];
        let [legs, uses] = [filled(words(&all.legs))?, filled(words(&all.uses))?];
        let precision = filled(floats(&all.precision))?;
        let [model, of_model] = [room(2 * seen)?, room(2 * seen)?];
        let squares = room(seen + closures)?;
        let [residuals, pulls] = [room(closures)?, room(closures)?];
        let buffers = [
            &task,
            &places,
            &pixels.fluxes,
            &visibilities,
            &piece,
            &model,
            &of_model,
            &squares,
            &factors,
            &quantities,
            &legs,
            &uses,
            &precision,
            &residuals,
            &pulls,
            &pixels.slopes,
            &losses,
        ];
        let tasks = bound(device, buffers)?;
        let (frames, most) = (all.frames, [seen, closures]);
        Ok(Some(Self { tasks, task, piece, factors, losses, frames, most, rays, terms }))
    }

    /// Puts there which frames come next, what terms are multiplied by in the loss, and which record is added to.
    ///
    /// # Errors
    /// If the device fails.
    pub fn set(
        &self,
        device: &Compute,
        frames: &[usize],
        factors: &[f32],
        record: usize,
    ) -> Result<(), GpuError> {
        let piece: Vec<u32> = frames.iter().flat_map(|frame| self.frames[*frame]).collect();
        device.write(&self.piece, &words(&piece))?;
        device.write(&self.factors, &floats(factors))?;
        let [seen, closures] = self.most;
        let task = [frames.len(), self.rays, seen, closures, self.terms, record, 0, 0];
        device.write(&self.task, &words(&task.map(|x| x as u32)))
    }

    /// Computes from the light of rays in so many frames losses, and slopes along the light, which are added.
    pub fn compare(&self, commands: &mut Commands, frames: usize) {
        let [look, compare, close, pull, open, shine, add_losses] = &self.tasks;
        let [seen, closures] = self.most;
        let each = |count: usize| [count.div_ceil(64) as u32, frames as u32];
        if seen == 0 {
            return;
        }
        commands.dispatch(look, [seen as u32, frames as u32]);
        commands.dispatch(compare, each(seen));
        if closures > 0 {
            commands.dispatch(close, each(closures));
            commands.dispatch(pull, each(closures));
            commands.dispatch(open, each(seen));
        }
        commands.dispatch(shine, each(self.rays));
        commands.dispatch(add_losses, [self.terms as u32, 1]);
    }

    /// Forgets the losses.
    pub fn forget(&self, commands: &mut Commands) {
        commands.clear(&self.losses);
    }

    /// χ² of each term of each step.
    pub fn losses(&self) -> &Buffer {
        &self.losses
    }
}

/// East and north of all rays, rad.
fn places(objective: &Objective<f32>, all: &Comparisons) -> Vec<f32> {
    let model = &objective.model;
    let place = |pixel: &u32| {
        let pixel = *pixel as usize;
        all.sky.map_or([0.0; 2], |sky| {
            [sky.east(pixel % sky.width) as f32, sky.north(pixel / sky.width) as f32]
        })
    };
    model.pixel().iter().flat_map(place).collect()
}

/// The kernels with the buffers of all bindings, in their order.
fn bound(device: &Compute, buffers: [&Buffer; 17]) -> Result<[Bound; 7], GpuError> {
    let source = [wgsl::FUNCTIONS, SHADER].join("\n");
    let kernels = compiled(device, &source, &ENTRIES)?;
    let bind = |entry: usize, bindings: &[u32]| {
        let used: Vec<_> = bindings.iter().map(|k| (*k, buffers[*k as usize])).collect();
        device.bind(&kernels[entry], &used)
    };
    Ok([
        bind(0, &[0, 1, 2, 3, 4, 5])?,
        bind(1, &[0, 3, 4, 5, 6, 7, 8])?,
        bind(2, &[0, 4, 5, 9, 10, 13])?,
        bind(3, &[0, 4, 5, 7, 9, 10, 12, 13, 14])?,
        bind(4, &[0, 3, 4, 5, 6, 8, 9, 11, 14])?,
        bind(5, &[0, 1, 3, 4, 6, 15])?,
        bind(6, &[0, 3, 4, 7, 9, 16])?,
    ])
}
