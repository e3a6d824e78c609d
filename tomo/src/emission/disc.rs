//! A thin disc in the equatorial plane.

use super::page_thorne::PageThorne;
use crate::scene::Disc;
use kerrlight_geodesic::{Kerr, orbits};

/// A disc around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct DiscModel {
    profile: PageThorne,
    scale: f64,
    inner: f64,
    outer: f64,
    /// Whether it hides what is behind it.
    pub opaque: bool,
    /// Linear colour.
    pub color: [f32; 3],
}

impl DiscModel {
    /// The disc of a scene.
    pub fn new(disc: &Disc, hole: &Kerr) -> Self {
        let profile = PageThorne::new(hole);
        let (_, peak) = profile.peak();
        DiscModel {
            profile,
            scale: disc.peak_intensity / peak,
            inner: disc.inner_edge.unwrap_or_else(|| orbits::isco(hole)),
            outer: disc.outer_edge,
            opaque: disc.opaque,
            color: disc.color,
        }
    }

    /// Whether there is disc at radius r.
    pub fn covers(&self, r: f64) -> bool {
        (self.inner..=self.outer).contains(&r)
    }

    /// Intensity in the gas frame at radius r (isotropic; F = πI).
    pub fn intensity(&self, r: f64) -> f64 {
        self.scale * self.profile.flux(r)
    }
}
