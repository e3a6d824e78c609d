//! Ranks that say nothing: what all of them would say, the first one says.

use std::fs::File;
use std::io::Write;
use std::time::Duration;

/// The terminal of a rank that says nothing, for what only this rank knows.
#[derive(Default)]
pub struct Silence(Option<File>);

/// From now on nothing that this process writes to standard error is seen, if another speaks for it. A panic is.
pub fn hush() -> Silence {
    if !super::is_silent() {
        return Silence::default();
    }
    let kept = aside();
    if let Some(error) = kept.as_ref().and_then(|kept| kept.try_clone().ok()) {
        std::panic::set_hook(Box::new(move |panic| {
            let _ = writeln!(&error, "{panic}");
        }));
    }
    Silence(kept)
}

/// For so long the launcher may take to end a job whose first rank has failed.
const PATIENCE: Duration = Duration::from_secs(3);
/// By so much longer each rank waits than the one before: where several have failed, as with a full disk, the first to speak
/// ends the job.
const STEP: Duration = Duration::from_secs(1);
/// So many ranks wait one after the other.
const STEPS: u32 = 6;

impl Silence {
    /// Tells why this rank ends the job, if it does: a failure of all ranks is told by the first.
    pub fn tell(&self, error: &anyhow::Error) {
        let Some(mut kept) = self.0.as_ref() else { return };
        let rank = super::this().map_or(0, |(rank, _)| rank);
        std::thread::sleep(PATIENCE + STEP * (rank % STEPS));
        let _ = writeln!(kept, "error: rank {rank}: {error:#}");
    }
}

/// Standard error as it was; it goes nowhere now.
#[cfg(unix)]
fn aside() -> Option<File> {
    let nowhere = File::options().write(true).open("/dev/null").ok()?;
    let kept = nix::unistd::dup(std::io::stderr()).ok()?;
    nix::unistd::dup2_stderr(&nowhere).ok()?;
    Some(kept.into())
}

/// It goes on as ever.
#[cfg(not(unix))]
fn aside() -> Option<File> {
    None
}
