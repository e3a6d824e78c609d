//! A thin disc in the equatorial plane.

use super::black_body::BlackBody;
use super::page_thorne::PageThorne;
use crate::scene::{Disc, Plunging};
use kerrlight_geodesic::flow::keplerian_redshift;
use kerrlight_geodesic::{Kerr, orbits, plunge::Plunge};

/// A disc around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct DiscModel {
    hole: Kerr,
    profile: PageThorne,
    /// Largest flux of the profile.
    peak: f64,
    scale: f64,
    inner: f64,
    outer: f64,
    /// 1/r of its outer edge, of its inner one and of the horizon.
    pub(crate) inverse: [f64; 3],
    /// True if it hides what is behind it.
    pub opaque: bool,
    color: [f32; 3],
    /// Temperature (K) where the intensity is 1, and colours, of a disc that shines like a black
    /// body.
    black_body: Option<(f64, BlackBody)>,
    /// Matter inside the innermost stable orbit and its light, if it shines.
    plunging: Option<(Plunge, Plunging)>,
}

/// The photon of a ray where it meets the disc.
#[derive(Debug, Clone, Copy)]
pub struct Photon {
    /// λ = L/E in M.
    pub lambda: f64,
    /// η = Q/E² in M².
    pub eta: f64,
    /// True if light moves outward: where the backward ray falls inward.
    pub outward: bool,
}

impl DiscModel {
    /// The disc of a scene.
    pub fn new(disc: &Disc, hole: &Kerr) -> Self {
        let profile = PageThorne::new(hole);
        let (_, peak) = profile.peak();
        let inner = match disc.plunging {
            Some(_) => hole.horizon(),
            None => disc.inner_edge.unwrap_or_else(|| orbits::isco(hole)),
        };
        let outer = disc.outer_edge;
        DiscModel {
            hole: *hole,
            profile,
            peak,
            scale: disc.peak_intensity / peak,
            inner,
            outer,
            inverse: [outer, inner, hole.horizon()].map(f64::recip),
            opaque: disc.opaque,
            color: disc.color,
            black_body: disc.peak_temperature_k.map(|t| (t, BlackBody::new(t))),
            plunging: disc.plunging.map(|law| (Plunge::new(hole), law)),
        }
    }

    /// Returns whether there is disc at radius r (M).
    pub fn covers(&self, r: f64) -> bool {
        (self.inner..=self.outer).contains(&r)
    }

    /// Its inner and its outer radius, M.
    pub fn edges(&self) -> [f64; 2] {
        [self.inner, self.outer]
    }

    /// Returns whether some of its matter plunges.
    pub fn plunges(&self) -> bool {
        self.plunging.is_some()
    }

    /// The flow of the matter at radius r, if that plunges, and its light.
    fn plunge_at(&self, r: f64) -> Option<&(Plunge, Plunging)> {
        self.plunging.as_ref().filter(|(flow, _)| r < flow.isco())
    }

    /// Returns whether the matter at radius r (M) plunges.
    pub fn plunges_at(&self, r: f64) -> bool {
        self.plunge_at(r).is_some()
    }

    /// Contravariant Boyer–Lindquist four-velocity (angular components in M⁻¹) at radius r (M) where matter plunges; `None`
    /// elsewhere.
    pub fn plunging_velocity(&self, r: f64) -> Option<[f64; 4]> {
        self.plunge_at(r).and_then(|(flow, _)| flow.velocity(r))
    }

    /// g = ν_obs/ν_em, dimensionless, of light from radius r (M): of circular geodesics, and of matter that plunges
    /// from the innermost of them. 0 where there is no such light.
    pub fn redshift(&self, r: f64, photon: &Photon) -> f64 {
        let Photon { lambda, eta, outward } = *photon;
        let g = match self.plunge_at(r) {
            Some((flow, _)) => flow.redshift(r, lambda, eta, outward),
            None => keplerian_redshift(&self.hole, r, lambda),
        };
        g.unwrap_or(0.0)
    }

    /// Linear colour (R, G, B) of its light from radius r (M), shifted by the ratio g. A black body at T is seen as one at gT
    /// (I_ν/ν³ is invariant), and T⁴ goes like the flux.
    pub fn color(&self, r: f64, g: f64) -> [f32; 3] {
        let Some((peak, colors)) = &self.black_body else { return self.color };
        let flux = match self.plunge_at(r) {
            // The flux that has this intensity outside of the innermost stable orbit.
            Some(_) => self.intensity(r) / self.scale,
            None => self.profile.flux(r),
        };
        // Roots, since a power would be computed ahead of the question above.
        let shade = colors.color(g * peak * (flux / self.peak).sqrt().sqrt());
        core::array::from_fn(|k| self.color[k] * shade[k])
    }

    /// Intensity in scene units in the gas frame at radius r (M) (isotropic; F = πI).
    pub fn intensity(&self, r: f64) -> f64 {
        match self.plunge_at(r) {
            Some((flow, law)) => law.intensity * (r / flow.isco()).powf(law.exponent),
            None => self.scale * self.profile.flux(r),
        }
    }
}
