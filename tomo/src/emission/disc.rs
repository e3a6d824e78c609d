//! A thin disc in the equatorial plane.

use super::black_body::BlackBody;
use super::page_thorne::PageThorne;
use crate::scene::Disc;
use kerrlight_geodesic::{Kerr, orbits};

/// A disc around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct DiscModel {
    profile: PageThorne,
    /// Largest flux of the profile.
    peak: f64,
    scale: f64,
    inner: f64,
    outer: f64,
    /// Whether it hides what is behind it.
    pub opaque: bool,
    color: [f32; 3],
    /// Temperature (K) where the intensity is 1, and colours, of a disc that shines like a black
    /// body.
    black_body: Option<(f64, BlackBody)>,
}

impl DiscModel {
    /// The disc of a scene.
    pub fn new(disc: &Disc, hole: &Kerr) -> Self {
        let profile = PageThorne::new(hole);
        let (_, peak) = profile.peak();
        DiscModel {
            profile,
            peak,
            scale: disc.peak_intensity / peak,
            inner: disc.inner_edge.unwrap_or_else(|| orbits::isco(hole)),
            outer: disc.outer_edge,
            opaque: disc.opaque,
            color: disc.color,
            black_body: disc.peak_temperature_k.map(|t| (t, BlackBody::new(t))),
        }
    }

    /// Whether there is disc at radius r.
    pub fn covers(&self, r: f64) -> bool {
        (self.inner..=self.outer).contains(&r)
    }

    /// Linear colour of its light from radius r, shifted by g. A black body at T is seen as one at gT
    /// (I_ν/ν³ is invariant), and T⁴ goes like the flux.
    pub fn color(&self, r: f64, g: f64) -> [f32; 3] {
        let Some((peak, colors)) = &self.black_body else { return self.color };
        // Roots, since a power would be computed ahead of the question above.
        let shade = colors.color(g * peak * (self.profile.flux(r) / self.peak).sqrt().sqrt());
        core::array::from_fn(|k| self.color[k] * shade[k])
    }

    /// Intensity in the gas frame at radius r (isotropic; F = πI).
    pub fn intensity(&self, r: f64) -> f64 {
        self.scale * self.profile.flux(r)
    }
}
