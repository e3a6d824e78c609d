//! Where the time of a picture goes.

use std::time::{Duration, Instant};

/// What work is done for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Rays: their fate, crossings and, where a source needs it, their path.
    Rays,
    /// Nodes inside the gas, its emission and absorption.
    Gas,
    /// Nodes inside volumes, and their emission.
    Volumes,
    /// Light of the disc and of meshes where rays meet them.
    Surfaces,
    /// Hot spots.
    Spots,
    /// The sky, and beams that average it.
    Sky,
}

impl Part {
    /// All of them.
    pub const ALL: [Part; 6] =
        [Part::Rays, Part::Gas, Part::Volumes, Part::Surfaces, Part::Spots, Part::Sky];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Part::Rays => "rays",
            Part::Gas => "gas",
            Part::Volumes => "volumes",
            Part::Surfaces => "surfaces",
            Part::Spots => "spots",
            Part::Sky => "sky",
        }
    }
}

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
