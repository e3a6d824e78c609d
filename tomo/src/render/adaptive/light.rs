//! What single rays see, and whether two of them see the same piece of the picture.

use crate::transport::{Fate, Glimpse};

/// What a ray adds to its cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Light {
    pub(super) intensity: f64,
    pub(super) rgb: [f32; 3],
    pub(super) stokes: [f64; 3],
    pub(super) kind: Kind,
    pub(super) unresolved: bool,
}

/// What rays of one smooth piece of the picture have in common.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Kind {
    /// Lensing band and fate.
    pub(super) band: (u32, Fate),
    /// Images of the disc that are seen.
    pub(super) disc_images: u32,
    /// Whether there is emission.
    pub(super) lit: bool,
}

impl Light {
    /// Whether a lensing band or the end of rays lies between two rays.
    pub(super) fn other_band(&self, other: &Light) -> bool {
        self.kind.band != other.kind.band
    }
}

impl From<&Glimpse> for Light {
    fn from(seen: &Glimpse) -> Self {
        let band = (seen.crossings, seen.fate);
        let (disc_images, lit) = (seen.disc_images, seen.radius > 0.0);
        Light {
            intensity: seen.intensity,
            rgb: seen.rgb,
            stokes: seen.stokes,
            kind: Kind { band, disc_images, lit },
            unresolved: seen.fate == Fate::Unresolved,
        }
    }
}

/// Largest less least.
pub(super) fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    high - low
}
