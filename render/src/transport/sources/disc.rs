//! The thin disc in the equatorial plane.

use crate::emission::disc::{DiscModel, Photon};
use crate::transport::layers::Origin;
use crate::transport::optics::Optics;
use crate::transport::polarized::{PolarizedRay, share};
use crate::transport::result::{Accumulator, PASSES, Place};
use kerrlight_geodesic::{Kerr, Outcome, PlaneCrossing, TracedRay, orbits};

/// Crossings of a ray that are located in closed form; rays with more are traced step by step.
pub(in crate::transport) const CROSSINGS: usize = 4;

/// Radii at which the brightest light of a disc is looked for.
const RADII: u32 = 8;

/// Light of the disc along one ray.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct DiscRay<'a> {
    pub ray: &'a TracedRay,
    pub crossings: &'a [PlaneCrossing],
    /// Optical depth of the gas in front of each crossing; empty without absorption.
    pub depths: &'a [f64],
    pub polarized: Option<PolarizedRay<'a>>,
    /// Factor of the camera's motion in the redshift.
    pub blueshift: Option<f64>,
}

impl DiscModel {
    /// dx/dt of its matter at a point of the plane (M): on circular geodesics, or as it plunges.
    pub(in crate::transport) fn velocity(&self, hole: &Kerr, [x, y, _]: [f64; 3]) -> [f64; 3] {
        let r = x.hypot(y);
        let rates = self.plunging_velocity(r).map(|[t, fall, _, turn]| [fall / t, turn / t]);
        let [fall, turn] = rates.unwrap_or([0.0, orbits::keplerian_angular_velocity(hole, r)]);
        [fall * x / r - turn * y, fall * y / r + turn * x, 0.0]
    }

    /// Returns whether it hides what is behind a crossing.
    #[inline]
    pub(in crate::transport) fn hides_at(&self, crossing: &PlaneCrossing) -> bool {
        self.opaque && self.covers(crossing.radius)
    }

    /// Its brightest light along rays with these constants of motion, wherever they meet it; that of electrons in the field where
    /// light is polarised.
    pub(in crate::transport) fn brightest(
        &self,
        optics: &Optics,
        polarized: Option<PolarizedRay<'_>>,
        [lambda, eta]: [f64; 2],
    ) -> f64 {
        let [inner, outer] = self.edges();
        let light = |k: u32| {
            let r = inner + (outer - inner) * f64::from(k) / f64::from(RADII);
            let boost = match polarized {
                Some(polarized) => polarized.brightest_of_disc(self, r, eta),
                None => optics.spectral_index.map_or(1.0, |index| {
                    self.redshift(r, &Photon { lambda, eta, outward: true }).powf(3.0 + index)
                }),
            };
            boost * self.intensity(r)
        };
        (0..=RADII).map(light).fold(0.0, f64::max)
    }

    /// Returns the place at which a crossing at 1/r passes it: see
    /// [`Passes`](crate::transport::result::Passes).
    #[inline]
    fn place(&self, inverse_radius: f64) -> f32 {
        let [outer, inner, _] = self.inverse;
        ((inverse_radius - outer) / (inner - outer)) as f32
    }

    /// Returns the place of crossings that a ray does not get to.
    #[inline]
    fn end(&self, ray: &TracedRay) -> f32 {
        match ray.outcome {
            _ if ray.surface.is_some() || ray.until < ray.mino_total => 0.0,
            Outcome::Escaped => self.place(0.0),
            Outcome::Captured => self.place(self.inverse[2]),
            _ => 0.0,
        }
    }

    /// Adds its light: I = g^{3+α} I_em at every crossing up to the ray's last light.
    #[inline(always)]
    pub(in crate::transport) fn add(
        &self,
        optics: &Optics,
        seen: &DiscRay<'_>,
        light: &mut Accumulator,
    ) {
        let end = seen.ray.last_time();
        let known = seen.crossings.len().min(PASSES);
        light.passes[known..].fill(self.end(seen.ray));
        for (number, crossing) in seen.crossings.iter().enumerate() {
            if crossing.mino_time > end {
                break;
            }
            if let Some(place) = light.passes.get_mut(number) {
                *place = self.place(1.0 / crossing.radius);
            }
            if self.covers(crossing.radius) {
                let kind = if self.plunges_at(crossing.radius) { 16 } else { 0 };
                light.disc_images |= 1 << (kind + number.min(15));
                let depth = seen.depths.get(number).copied().unwrap_or(0.0);
                self.add_crossing(optics, crossing, depth, seen, light);
            }
        }
    }

    #[inline(always)]
    fn add_crossing(
        &self,
        optics: &Optics,
        crossing: &PlaneCrossing,
        depth: f64,
        seen: &DiscRay<'_>,
        light: &mut Accumulator,
    ) {
        let TracedRay { lambda, eta, .. } = *seen.ray;
        let r = crossing.radius;
        let g = match optics.spectral_index {
            Some(_) => {
                // The backward ray falls where light moves outward.
                let outward = crossing.rates[0] > 0.0;
                self.redshift(r, &Photon { lambda, eta, outward })
            }
            None => 1.0,
        };
        let stokes = seen.polarized.map(|polarized| polarized.of_disc(self, crossing));
        let boost = match stokes {
            // g^{3+α} is in it, with the field and the slant.
            Some(stokes) => stokes.i,
            None => optics.spectral_index.map_or(1.0, |index| g.powf(3.0 + index)),
        };
        let mut intensity = boost * self.intensity(r);
        if depth > 0.0 {
            intensity *= (-depth).exp();
        }
        let (color, mino_time) =
            (self.color(r, g * seen.blueshift.unwrap_or(1.0)), crossing.mino_time);
        light.add(intensity, g, color, mino_time);
        if let Some(stokes) = stokes {
            light.add_stokes(intensity, share(&stokes));
        }
        let origin = Origin { source: optics.numbering.disc, mino_time };
        light.mark(intensity, Place::of_crossing(crossing), origin);
    }
}
