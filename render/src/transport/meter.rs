//! Meter of the time that a picture takes.

use crate::emission::medium::Part;
use std::time::{Duration, Instant};

/// Time spent on each part, on all threads together. A meter that is off reads no clock.
#[derive(Debug, Clone, Copy, Default)]
pub struct Meter {
    on: bool,
    spent: [Duration; 6],
    /// Current part of the work, and its start.
    current: Option<(Part, Instant)>,
}

impl Meter {
    /// A meter that runs.
    pub fn running() -> Self {
        Meter { on: true, ..Meter::default() }
    }

    /// Time spent on a part.
    pub fn spent(&self, part: Part) -> Duration {
        self.spent[part as usize]
    }

    /// Starts to count time for a part.
    #[inline]
    pub(super) fn switch(&mut self, part: Part) {
        if self.on {
            self.stop();
            self.current = Some((part, Instant::now()));
        }
    }

    /// Stops counting time.
    pub(super) fn stop(&mut self) {
        if let Some((part, since)) = self.current.take() {
            self.spent[part as usize] += since.elapsed();
        }
    }
}
