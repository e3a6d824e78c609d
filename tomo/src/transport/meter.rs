//! Where the time of a picture goes.

use crate::emission::medium::Part;
use std::time::{Duration, Instant};

/// Time spent on each part, on all threads together. A meter that is off reads no clock.
#[derive(Debug, Clone, Copy, Default)]
pub struct Meter {
    on: bool,
    spent: [Duration; 6],
}

impl Meter {
    /// A meter that runs.
    pub fn running() -> Self {
        Meter { on: true, spent: [Duration::ZERO; 6] }
    }

    /// Time spent on a part.
    pub fn spent(&self, part: Part) -> Duration {
        self.spent[part as usize]
    }

    /// Adds what another one has read.
    pub fn add(&mut self, other: &Meter) {
        self.spent.iter_mut().zip(other.spent).for_each(|(sum, spent)| *sum += spent);
    }

    pub(super) fn start(&self) -> Option<Instant> {
        self.on.then(Instant::now)
    }

    pub(super) fn stop(&mut self, part: Part, start: Option<Instant>) {
        if let Some(start) = start {
            self.spent[part as usize] += start.elapsed();
        }
    }
}
