//! Errors of graphics devices.

use core::fmt;

/// Failure of a graphics device.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum GpuError {
    /// There is no adapter, or its driver is not installed.
    NoAdapter,
    /// No adapter has this number or a name with these letters.
    NoSuchAdapter {
        /// Device that was asked for.
        wanted: String,
        /// The names of those that there are.
        present: Vec<String>,
    },
    /// The adapter does not open a device, or its limits are too small.
    Refused(String),
    /// The shaders do not keep the digits that they need on this driver.
    Inexact(String),
    /// There is not enough memory on the card.
    OutOfMemory {
        /// Bytes of the largest buffers that were asked for; 0 for what the driver keeps for itself.
        bytes: u64,
    },
    /// The device was lost: unplugged, reset, or its driver crashed.
    Lost(String),
    /// Anything else: a bug here or in the driver.
    Failed(String),
}

/// Advice for machines without a device.
const HOW: &str = "install the driver of your card, or Mesa's software device (Debian and Ubuntu: \
                   apt install mesa-vulkan-drivers; Fedora: dnf install mesa-vulkan-drivers)";

impl fmt::Display for GpuError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdapter => {
                write!(f, "no graphics device with Vulkan, Metal or DirectX 12 was found: {HOW}")
            }
            Self::NoSuchAdapter { wanted, present } => {
                write!(
                    f,
                    "no graphics device is called `{wanted}`: there is {}",
                    present.join(", ")
                )
            }
            Self::Refused(why) => write!(f, "the graphics device cannot be used: {why}"),
            Self::Inexact(name) => write!(
                f,
                "the driver of {name} reorders sums that must stay as they are: rays next to the \
                 critical curve would be wrong"
            ),
            Self::OutOfMemory { bytes: 0 } => f.write_str("the graphics device has no memory left"),
            Self::OutOfMemory { bytes } => {
                write!(f, "the graphics device has no memory for {} MB", bytes.div_ceil(1_000_000))
            }
            Self::Lost(why) => write!(f, "the graphics device was lost: {why}"),
            Self::Failed(why) => write!(f, "the graphics device failed: {why}"),
        }
    }
}

impl core::error::Error for GpuError {}
