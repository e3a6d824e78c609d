//! Usage of the machine by a process.

/// Processor time and memory of this process so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Usage {
    /// Processor time of all threads, s.
    pub cpu_seconds: f64,
    /// Most memory that was resident, MiB.
    pub peak_mib: f64,
}

/// Returns the usage of this process; nothing where the system does not tell.
#[cfg(unix)]
pub fn usage() -> Option<Usage> {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    let used = getrusage(UsageWho::RUSAGE_SELF).ok()?;
    let micros = used.user_time().num_microseconds() + used.system_time().num_microseconds();
    // macOS counts bytes, the others KiB.
    let unit = if cfg!(target_os = "macos") { 1048576.0 } else { 1024.0 };
    Some(Usage { cpu_seconds: micros as f64 * 1e-6, peak_mib: used.max_rss() as f64 / unit })
}

/// Not known here.
#[cfg(not(unix))]
pub fn usage() -> Option<Usage> {
    None
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn exact_memory_that_is_touched_is_counted() {
        let before = usage().unwrap();
        let touched = vec![1u8; 300 << 20];
        assert_eq!(touched.iter().map(|x| u64::from(*x)).sum::<u64>(), 300 << 20);
        let after = usage().unwrap();
        assert!(after.peak_mib >= 300.0 && after.peak_mib < before.peak_mib + 1000.0);
        assert!(after.cpu_seconds > before.cpu_seconds);
    }
}
