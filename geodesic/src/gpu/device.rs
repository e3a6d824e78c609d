//! The graphics devices of this computer.

use super::error::GpuError;
use core::future::Future;
use core::task::{Context, Poll, Waker};
use std::sync::{Arc, Mutex};

/// A graphics device of this computer.
#[derive(Debug, Clone)]
pub struct Adapter {
    inner: wgpu::Adapter,
    info: wgpu::AdapterInfo,
}

/// The graphics devices that there are, real ones before software.
pub fn adapters() -> Vec<Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let found = wait(wgpu::Instance::new(descriptor).enumerate_adapters(wgpu::Backends::PRIMARY));
    let mut adapters: Vec<Adapter> =
        found.into_iter().map(|inner| Adapter { info: inner.get_info(), inner }).collect();
    adapters.sort_by_key(Adapter::rank);
    adapters
}

/// The device number `wanted` of [`adapters`], or the first one whose name holds these letters; without it the first.
///
/// # Errors
/// If there is none.
pub fn adapter(wanted: Option<&str>) -> Result<Adapter, GpuError> {
    let all = adapters();
    if all.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let Some(wanted) = wanted else { return Ok(all[0].clone()) };
    let letters = wanted.to_lowercase();
    let number: Option<usize> = wanted.parse().ok();
    let found = match number {
        Some(number) => all.get(number),
        None => all.iter().find(|adapter| adapter.name().to_lowercase().contains(&letters)),
    };
    found.cloned().ok_or_else(|| GpuError::NoSuchAdapter {
        wanted: wanted.to_owned(),
        present: all.iter().map(|adapter| adapter.name().to_owned()).collect(),
    })
}

impl Adapter {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// What it is: `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub fn kind(&self) -> &'static str {
        match self.info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete",
            wgpu::DeviceType::IntegratedGpu => "integrated",
            wgpu::DeviceType::VirtualGpu => "virtual",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "other",
        }
    }

    /// The programming interface: `vulkan`, `metal` or `dx12`.
    pub fn interface(&self) -> &'static str {
        self.info.backend.to_str()
    }

    /// The driver and its version.
    pub fn driver(&self) -> String {
        [&self.info.driver, &self.info.driver_info]
            .map(|text| text.trim())
            .join(" ")
            .trim()
            .to_owned()
    }

    /// Bytes of the largest buffer that a shader may see.
    pub fn largest_buffer(&self) -> u64 {
        let limits = self.inner.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// Invocations in the largest workgroup, and bytes of its memory.
    pub fn workgroup(&self) -> (u32, u32) {
        let limits = self.inner.limits();
        (limits.max_compute_invocations_per_workgroup, limits.max_compute_workgroup_storage_size)
    }

    fn rank(&self) -> u8 {
        match self.kind() {
            "discrete" => 0,
            "integrated" => 1,
            "software" => 3,
            _ => 2,
        }
    }
}

/// A device that is open.
#[derive(Debug)]
pub(super) struct Device {
    pub inner: wgpu::Device,
    pub queue: wgpu::Queue,
    pub name: String,
    /// Bytes of the largest buffer.
    pub largest: u64,
    lost: Arc<Mutex<Option<String>>>,
}

/// The smallest buffer that is any use.
const LEAST_BUFFER: u64 = 1 << 20;

impl Device {
    pub fn open(adapter: &Adapter) -> Result<Self, GpuError> {
        let largest = adapter.largest_buffer();
        if largest < LEAST_BUFFER || adapter.workgroup().0 < 64 {
            let why = format!(
                "its limits are too small (a buffer of {largest} bytes, workgroups of {})",
                adapter.workgroup().0
            );
            return Err(GpuError::Refused(why));
        }
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: largest,
            max_buffer_size: largest,
            ..wgpu::Limits::downlevel_defaults()
        };
        let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (inner, queue) = wait(adapter.inner.request_device(&descriptor))
            .map_err(|error| GpuError::Refused(error.to_string()))?;
        let lost = Arc::new(Mutex::new(None));
        let note = Arc::clone(&lost);
        inner.set_device_lost_callback(move |_, why| {
            *note.lock().unwrap_or_else(|held| held.into_inner()) = Some(why);
        });
        Ok(Device { inner, queue, name: adapter.name().to_owned(), largest, lost })
    }

    /// Does `work`, and reports what the device says of it; `bytes` is what it takes of memory.
    pub fn attempt<T>(&self, bytes: u64, work: impl FnOnce() -> T) -> Result<T, GpuError> {
        let filters = [
            wgpu::ErrorFilter::Internal,
            wgpu::ErrorFilter::Validation,
            wgpu::ErrorFilter::OutOfMemory,
        ];
        let scopes = filters.map(|filter| self.inner.push_error_scope(filter));
        let done = work();
        // Scopes end in the reverse of their order.
        let errors = scopes.into_iter().rev().filter_map(|scope| wait(scope.pop()));
        let error = errors.collect::<Vec<_>>().into_iter().next();
        self.alive()?;
        match error {
            None => Ok(done),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { bytes }),
            Some(error) => Err(GpuError::Failed(error.to_string())),
        }
    }

    /// Waits until everything that was submitted is done.
    pub fn finish(&self) -> Result<(), GpuError> {
        let done = self.inner.poll(wgpu::PollType::wait_indefinitely());
        self.alive()?;
        done.map(|_| ()).map_err(|error| GpuError::Failed(error.to_string()))
    }

    fn alive(&self) -> Result<(), GpuError> {
        let lost = self.lost.lock().unwrap_or_else(|held| held.into_inner());
        lost.clone().map_or(Ok(()), |why| Err(GpuError::Lost(why)))
    }
}

/// Waits for a future; those of a graphics device on this computer are ready at once, or after a moment.
fn wait<F: Future>(future: F) -> F::Output {
    let mut future = core::pin::pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        match future.as_mut().poll(&mut context) {
            Poll::Ready(done) => return done,
            Poll::Pending => std::thread::yield_now(),
        }
    }
}
