//! Light of single rays, and whether two of them see the same piece of the picture.

use crate::picture::rings::Counted;
use crate::transport::{Passes, RayResult};
use kerrlight_geodesic::Outcome;

/// Light that a ray, or several along photon rings, adds to its cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Light {
    pub(super) intensity: f64,
    pub(super) rgb: [f32; 3],
    pub(super) stokes: [f64; 3],
    pub(super) kind: Kind,
    /// Rays that it took, and those of them that were given up.
    pub(super) rays: u32,
    pub(super) unresolved: u32,
    /// Estimated error of the intensity where it is a mean over rays along photon rings.
    pub(super) mean: Option<f64>,
    /// Passage of the ray by the disc.
    pub(super) passes: Passes,
}

/// Properties that rays of one smooth piece of the picture have in common.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Kind {
    /// Lensing band and outcome.
    pub(super) band: (u32, Outcome),
    /// Images of the disc that are seen.
    pub(super) disc_images: u32,
    /// True if there is emission.
    pub(super) lit: bool,
    /// Sides on which the ray passes the disc.
    pub(super) sides: u8,
}

impl Light {
    /// Returns whether a lensing band or the end of rays lies between two rays.
    pub(super) fn other_band(&self, other: &Light) -> bool {
        self.kind.band != other.kind.band && self.mean.is_none() && other.mean.is_none()
    }

    /// Returns whether two rays see different pieces of the picture; a mean over the rays of a photon
    /// ring sees all of them.
    pub(super) fn other_piece(&self, other: &Light) -> bool {
        self.kind != other.kind && self.mean.is_none() && other.mean.is_none()
    }

    /// Returns the light of a ray.
    pub(super) fn of_ray(seen: &RayResult) -> Self {
        let band = (seen.crossings, seen.outcome);
        let (disc_images, lit) = (seen.disc_images, seen.radius > 0.0);
        Light {
            intensity: seen.intensity,
            rgb: seen.rgb,
            stokes: seen.stokes,
            kind: Kind { band, disc_images, lit, sides: seen.passes.sides() },
            rays: 1,
            unresolved: u32::from(seen.outcome.is_unresolved()),
            mean: None,
            passes: seen.passes,
        }
    }

    /// The share of the way to another ray on which images of the disc lie that neither of them meets.
    pub(super) fn between(&self, other: &Light) -> f64 {
        if self.kind.sides == other.kind.sides || self.mean.is_some() || other.mean.is_some() {
            return 0.0;
        }
        self.passes.between(&other.passes)
    }

    /// Returns the light of a ray, or the mean around it.
    pub(super) fn new((seen, counted): (&RayResult, &Counted)) -> Self {
        let ray = Light::of_ray(seen);
        Light {
            rays: ray.rays + counted.rays,
            unresolved: ray.unresolved + counted.unresolved,
            mean: (counted.rays > 0).then_some(counted.error),
            ..ray
        }
    }
}
