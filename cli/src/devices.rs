//! `kerrlight devices`, and the device that `--device` names.

use crate::answer::Answer;
use clap::Args;
use kerrlight_geodesic::RayDevice;
use kerrlight_tomo::fit::{Objective, StepDevice, Training};
use kerrlight_tomo::representation::Representation;
use serde::Serialize;
use std::sync::Arc;

/// Arguments of `kerrlight devices`.
#[derive(Debug, Args)]
pub struct Devices {}

/// Device that traces rays.
#[derive(Debug, Args)]
pub struct DeviceOption {
    /// Device that traces rays: `cpu`, `gpu` (the first graphics device, in floats), or a name or
    /// number of `kerrlight devices` [default: cpu]
    #[arg(long = "device", value_name = "DEVICE")]
    name: Option<String>,
}

/// Device that takes the steps of a fit.
#[derive(Debug, Args)]
pub struct StepsOption {
    /// Device that takes the steps: cpu, gpu or a name of `devices` [default: cpu]
    #[arg(long = "device", value_name = "DEVICE")]
    name: Option<String>,
}

/// Refuses fits that a device does not do.
pub type CheckSteps =
    fn(&Objective<f32>, &dyn Representation<f32>, &Training) -> Result<(), kerrlight_tomo::Error>;

/// Makes of an open device one that takes the steps of a fit.
pub type TakeSteps = Box<
    dyn FnOnce(
            &Objective<f32>,
            &dyn Representation<f32>,
            &Training,
        ) -> anyhow::Result<Box<dyn StepDevice>>
        + Send,
>;

/// An open device for a fit.
pub type FitDevice = (CheckSteps, TakeSteps);

/// A graphics device as it is listed.
#[derive(Serialize)]
struct Listed {
    name: String,
    kind: &'static str,
    interface: &'static str,
    driver: String,
    /// Bytes of the largest buffer that a shader may see.
    largest_buffer_bytes: u64,
    /// Invocations of the largest workgroup.
    workgroup_invocations: u32,
    /// Bytes of its memory.
    workgroup_bytes: u32,
}

impl Devices {
    /// The processor and all graphics devices.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let threads = rayon::current_num_threads();
        let devices = graphics::listed();
        let mut text = format!("cpu  {threads} threads\n");
        for (number, device) in devices.iter().enumerate() {
            text += &format!("{number:<4} {}\n", device.line());
        }
        text += match devices.is_empty() {
            true => graphics::ABSENT,
            false => "--device gpu takes the first graphics device, --device NAME another one\n",
        };
        let devices = serde_json::to_value(devices)?;
        Ok(Answer::text(text).with("threads", threads).with("devices", devices))
    }
}

impl Listed {
    fn line(&self) -> String {
        let Listed { name, kind, interface, driver, .. } = self;
        let limits = format!(
            "buffers up to {} MiB, workgroups of {} with {} KiB",
            self.largest_buffer_bytes >> 20,
            self.workgroup_invocations,
            self.workgroup_bytes >> 10
        );
        format!("{name}: {kind}, {interface}, driver {driver}; {limits}")
    }
}

impl DeviceOption {
    /// The device, opened; `None` is this processor.
    pub fn open(&self) -> anyhow::Result<Option<Arc<dyn RayDevice>>> {
        chosen(self.name.as_deref()).map(graphics::open).transpose()
    }
}

impl StepsOption {
    /// The device, opened; `None` is this processor.
    pub fn open(&self) -> anyhow::Result<Option<FitDevice>> {
        chosen(self.name.as_deref()).map(graphics::open_for_fits).transpose()
    }
}

/// The graphics device that is meant, if one is: the first one, or that of a name.
fn chosen(name: Option<&str>) -> Option<Option<&str>> {
    match name {
        None | Some("cpu") => None,
        Some("gpu") => Some(None),
        name => Some(name),
    }
}

/// Says where rays are traced, and what of the scene is not.
pub fn announce(device: &dyn RayDevice, rest: &[&str]) {
    let rest = match rest {
        [] => String::new(),
        some => format!("; on this processor: {}", some.join(", ")),
    };
    eprintln!("rays on {} in floats, about six digits{rest}", device.name());
}

#[cfg(feature = "gpu")]
mod graphics {
    use super::{FitDevice, Listed};
    use anyhow::Context;
    use kerrlight_geodesic::RayDevice;
    use kerrlight_geodesic::gpu::{self, GpuError, GpuTracer};
    use kerrlight_tomo::fit::graphics::{self, GraphicsFit};
    use std::sync::Arc;

    pub const ABSENT: &str = "no graphics device: install the driver of your card, or Mesa's \
                              software device\n(Debian, Ubuntu: apt install mesa-vulkan-drivers)\n";

    pub fn listed() -> Vec<Listed> {
        let list = |adapter: &gpu::Adapter| {
            let (workgroup_invocations, workgroup_bytes) = adapter.workgroup();
            Listed {
                name: adapter.name().to_owned(),
                kind: adapter.kind(),
                interface: adapter.interface(),
                driver: adapter.driver(),
                largest_buffer_bytes: adapter.largest_buffer(),
                workgroup_invocations,
                workgroup_bytes,
            }
        };
        gpu::adapters().iter().map(list).collect()
    }

    pub fn open(name: Option<&str>) -> anyhow::Result<Arc<dyn RayDevice>> {
        let opened: Result<_, GpuError> =
            gpu::adapter(name).and_then(|adapter| GpuTracer::open(&adapter));
        let tracer = opened.with_context(|| format!("--device {}", name.unwrap_or("gpu")))?;
        Ok(Arc::new(tracer))
    }

    pub fn open_for_fits(name: Option<&str>) -> anyhow::Result<FitDevice> {
        let option = format!("--device {}", name.unwrap_or("gpu"));
        let opened: Result<_, GpuError> =
            gpu::adapter(name).and_then(|adapter| graphics::open(&adapter));
        let device = opened.with_context(|| option.clone())?;
        let take: super::TakeSteps = Box::new(move |objective, representation, training| {
            let fit = GraphicsFit::new(device, objective, representation, training, None);
            Ok(Box::new(fit.context(option)?))
        });
        Ok((graphics::check, take))
    }
}

#[cfg(not(feature = "gpu"))]
mod graphics {
    use super::Listed;
    use anyhow::bail;
    pub use open as open_for_fits;

    pub const ABSENT: &str = "graphics devices are not looked for: this kerrlight was built \
                              without them\n(cargo build --release --features gpu)\n";

    pub fn listed() -> Vec<Listed> {
        Vec::new()
    }

    pub fn open<T>(name: Option<&str>) -> anyhow::Result<T> {
        bail!(
            "--device {}: this kerrlight was built without graphics devices, only `cpu` is there: \
             build it with `cargo build --release --features gpu`",
            name.unwrap_or("gpu")
        )
    }
}
