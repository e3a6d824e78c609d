//! Times of kernels, by the clock of the device.

use super::device::Device;
use super::error::GpuError;
use std::sync::Arc;

/// Time that a kernel took.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelTime {
    /// Its entry point.
    pub entry: Arc<str>,
    /// Seconds by the clock of the device.
    pub seconds: f64,
}

/// The clock's readings about the kernels of a run.
#[derive(Debug)]
pub(super) struct Stopwatch {
    readings: wgpu::QuerySet,
    entries: Vec<Arc<str>>,
    resolved: wgpu::Buffer,
    /// Nanoseconds.
    unit: f32,
}

/// The most kernels of a run that are timed.
const MOST: u32 = 2048;

impl Stopwatch {
    /// # Errors
    /// If the device has no clock.
    pub fn check(device: &Device) -> Result<(), GpuError> {
        let there = device.inner.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let missing = || GpuError::Refused("it has no clock that shaders are timed by".to_owned());
        there.then_some(()).ok_or_else(missing)
    }

    pub fn new(device: &Device) -> Self {
        let readings = device.inner.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: 2 * MOST,
        });
        let resolved = device.inner.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 16 * u64::from(MOST),
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let unit = device.queue.get_timestamp_period();
        Self { readings, entries: Vec::new(), resolved, unit }
    }

    /// A pass for one kernel.
    pub fn begin<'a>(
        &mut self,
        encoder: &'a mut wgpu::CommandEncoder,
        entry: &Arc<str>,
    ) -> wgpu::ComputePass<'a> {
        let number = self.entries.len() as u32;
        let writes = (number < MOST).then(|| wgpu::ComputePassTimestampWrites {
            query_set: &self.readings,
            beginning_of_pass_write_index: Some(2 * number),
            end_of_pass_write_index: Some(2 * number + 1),
        });
        if writes.is_some() {
            self.entries.push(entry.clone());
        }
        let descriptor = wgpu::ComputePassDescriptor { label: None, timestamp_writes: writes };
        encoder.begin_compute_pass(&descriptor)
    }

    /// Marks the end, behind the last kernel.
    pub fn end(&self, encoder: &mut wgpu::CommandEncoder) {
        let readings = 2 * self.entries.len() as u32;
        if readings > 0 {
            encoder.resolve_query_set(&self.readings, 0..readings, &self.resolved, 0);
        }
    }

    /// Returns the times of the kernels, once they are done.
    pub fn read(self, device: &Device) -> Result<Vec<KernelTime>, GpuError> {
        let to = device.attempt(self.resolved.size(), || {
            let to = device.readable(self.resolved.size());
            let descriptor = wgpu::CommandEncoderDescriptor::default();
            let mut encoder = device.inner.create_command_encoder(&descriptor);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &to, 0, to.size());
            device.queue.submit([encoder.finish()]);
            to
        })?;
        let bytes = device.read(&[to], <[u8]>::to_vec)?.concat();
        let ticks = bytes.as_chunks::<8>().0.iter().map(|word| u64::from_le_bytes(*word));
        let ticks: Vec<u64> = ticks.collect();
        let took =
            |ends: &[u64]| f64::from(self.unit) * 1e-9 * ends[1].saturating_sub(ends[0]) as f64;
        let times = self.entries.into_iter().zip(ticks.chunks_exact(2));
        Ok(times.map(|(entry, ends)| KernelTime { entry, seconds: took(ends) }).collect())
    }
}
