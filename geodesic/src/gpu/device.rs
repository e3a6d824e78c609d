//! The graphics devices of this computer.

use super::error::GpuError;
use core::cell::Cell;
use core::future::Future;
use core::task::{Context, Poll, Waker};
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Arc, Mutex, Once, PoisonError};

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

    /// Returns the kind of device: `discrete`, `integrated`, `virtual`, `software` or `other`.
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
    /// First error that the device reported by itself: it is of no use after that.
    trouble: Arc<Mutex<Option<GpuError>>>,
}

/// Limits that shaders ask of a device; every device that runs the tracer has the default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Invocations of a workgroup.
    pub invocations: u32,
    /// Bytes of a workgroup's memory.
    pub workgroup_bytes: u32,
    /// Buffers that a kernel sees.
    pub buffers: u32,
    /// Bytes of the largest buffer that it sees.
    pub buffer_bytes: u64,
}

impl Default for Needs {
    fn default() -> Self {
        Needs { invocations: 64, workgroup_bytes: 0, buffers: 4, buffer_bytes: 1 << 20 }
    }
}

impl Needs {
    /// The limits to open a device with that has these.
    fn within(self, has: &wgpu::Limits) -> Result<wgpu::Limits, GpuError> {
        let largest = has.max_storage_buffer_binding_size.min(has.max_buffer_size);
        let least = wgpu::Limits::downlevel_defaults();
        for (what, needed, there) in [
            ("bytes of a buffer", self.buffer_bytes, largest),
            (
                "invocations of a workgroup",
                self.invocations.into(),
                has.max_compute_invocations_per_workgroup.into(),
            ),
            (
                "bytes of a workgroup's memory",
                self.workgroup_bytes.into(),
                has.max_compute_workgroup_storage_size.into(),
            ),
            (
                "buffers of a kernel",
                self.buffers.into(),
                has.max_storage_buffers_per_shader_stage.into(),
            ),
        ] {
            if there < needed {
                let why =
                    format!("its limits are too small ({what}: {there}, needed are {needed})");
                return Err(GpuError::Refused(why));
            }
        }
        Ok(wgpu::Limits {
            max_storage_buffer_binding_size: largest,
            max_buffer_size: largest,
            max_compute_workgroup_storage_size: least
                .max_compute_workgroup_storage_size
                .max(self.workgroup_bytes),
            max_storage_buffers_per_shader_stage: least
                .max_storage_buffers_per_shader_stage
                .max(self.buffers),
            ..least
        }
        .or_worse_values_from(has))
    }
}

impl Device {
    pub fn open(adapter: &Adapter, needs: Needs) -> Result<Self, GpuError> {
        let largest = adapter.largest_buffer();
        let limits = needs.within(&adapter.inner.limits())?;
        let descriptor = wgpu::DeviceDescriptor {
            required_limits: limits,
            // A clock, where there is one.
            required_features: adapter.inner.features() & wgpu::Features::TIMESTAMP_QUERY,
            ..Default::default()
        };
        let (inner, queue) = wait(adapter.inner.request_device(&descriptor))
            .map_err(|error| GpuError::Refused(error.to_string()))?;
        let trouble = Arc::default();
        let note = noted(&trouble);
        inner.set_device_lost_callback(move |_, why| note(GpuError::Lost(why)));
        let note = noted(&trouble);
        let failed = move |error: wgpu::Error| note(GpuError::Failed(error.to_string()));
        inner.on_uncaptured_error(Arc::new(failed));
        Ok(Device { inner, queue, name: adapter.name().to_owned(), largest, trouble })
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
        if error.is_some() {
            // That it was lost may have to be asked for.
            let _ = self.poll(wgpu::PollType::Poll);
        }
        self.alive()?;
        match error {
            None => Ok(done),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { bytes }),
            Some(error) => Err(GpuError::Failed(error.to_string())),
        }
    }

    /// Maps buffers when everything that was submitted is done, and reads the bytes of each.
    pub fn read<T>(
        &self,
        buffers: &[wgpu::Buffer],
        made: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, GpuError> {
        let (sent, came) = std::sync::mpsc::channel::<Result<(), wgpu::BufferAsyncError>>();
        self.attempt(0, || {
            for buffer in buffers {
                let sent = sent.clone();
                let told = move |mapped| sent.send(mapped).unwrap_or(());
                buffer.map_async(wgpu::MapMode::Read, .., told);
            }
        })?;
        let done = self.poll(wgpu::PollType::wait_indefinitely());
        self.alive()?;
        done?;
        let failed = |what: &dyn core::fmt::Display| GpuError::Failed(what.to_string());
        let read = |buffer: &wgpu::Buffer| -> Result<T, GpuError> {
            came.recv().map_err(|error| failed(&error))?.map_err(|error| failed(&error))?;
            let view = buffer.get_mapped_range(..).map_err(|error| failed(&error))?;
            Ok(made(&view))
        };
        buffers.iter().map(read).collect()
    }

    /// Makes a buffer that is copied to, and read.
    pub fn readable(&self, size: u64) -> wgpu::Buffer {
        self.inner.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        })
    }

    fn poll(&self, until: wgpu::PollType) -> Result<(), GpuError> {
        let polled = caught(|| self.inner.poll(until)).map_err(GpuError::Lost)?;
        polled.map(|_| ()).map_err(|error| GpuError::Failed(error.to_string()))
    }

    fn alive(&self) -> Result<(), GpuError> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner);
        trouble.clone().map_or(Ok(()), Err)
    }
}

/// Keeps the first trouble.
fn noted(trouble: &Arc<Mutex<Option<GpuError>>>) -> impl Fn(GpuError) + Send + Sync + 'static {
    let trouble = Arc::clone(trouble);
    move |error| {
        trouble.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

thread_local! {
    /// True while a panic of this thread is expected.
    static EXPECTED: Cell<bool> = const { Cell::new(false) };
}

/// Runs work in which wgpu panics if a driver reports a lost card, and returns the words of the panic as an error,
/// unprinted.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !EXPECTED.get() {
                before(panic);
            }
        }));
    });
    EXPECTED.set(true);
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    EXPECTED.set(false);
    done.map_err(|panic| {
        let words = panic.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| panic.downcast_ref::<&str>().copied());
        words.unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ")
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_panics_of_the_library_are_errors() {
        assert_eq!(caught(|| 7), Ok(7));
        let told = caught(|| panic!("Error in {}:\n  lost", "poll")).unwrap_err();
        assert_eq!(told, "Error in poll: lost");
        assert!(!EXPECTED.get());
    }

    #[test]
    fn exact_limits_that_are_too_small_are_named() {
        let has =
            wgpu::Limits { max_compute_workgroup_storage_size: 8192, ..wgpu::Limits::default() };
        let needs = Needs { workgroup_bytes: 16_384, buffers: 8, ..Needs::default() };
        let error = needs.within(&has).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the graphics device cannot be used: its limits are too small (bytes of a workgroup's \
             memory: 8192, needed are 16384)"
        );
        let limits = Needs { workgroup_bytes: 8192, ..needs }.within(&has).unwrap();
        assert_eq!(limits.max_storage_buffers_per_shader_stage, 8);
        // Nothing is asked for that is not there.
        assert_eq!(limits.max_compute_workgroup_storage_size, 8192);
        let none = wgpu::Limits { max_buffer_size: 1000, ..wgpu::Limits::default() };
        let error = Needs::default().within(&none).unwrap_err().to_string();
        assert!(error.contains("bytes of a buffer: 1000"), "{error}");
    }
}
