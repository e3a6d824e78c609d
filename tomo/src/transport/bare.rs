//! Scenes of a disc and a sky alone, in closed form, without any effect but lensing and redshift:
//! the cheapest rays, of which nothing is asked that such a scene does not have. What such a block
//! costs is what it would cost in a library that had no other effects.

use super::ray::{Block, ray_result};
use super::rays::{End, MOST_HITS, TracedRay, needs_stepping};
use super::result::{Accumulator, RayResult};
use super::surface::{Hit, Seen};
use super::{Fate, Part, PreparedScene, Scratch};
use crate::scene::Scene;
use kerrlight_geodesic::{Observer, OutOfRange};

/// Whether rays of the closed form have nothing to ask but a disc and the sky.
pub(super) fn is_bare(scene: &Scene) -> bool {
    let effects = &scene.effects;
    let plunges = scene.disc.as_ref().is_some_and(|disc| disc.plunging.is_some());
    let asked = effects.polarization
        || effects.half_orbits.is_some()
        || effects.ray_bundles
        || plunges
        || !effects.lensing;
    let there = scene.gas.is_some()
        || !scene.volume.is_empty()
        || !scene.spot.is_empty()
        || !scene.mesh.is_empty();
    !asked && !there
}

impl PreparedScene {
    /// [`observe_block`](Self::observe_block) of a bare scene, which looks alike at all times.
    pub(super) fn observe_bare(
        &self,
        observer: &Observer,
        block: Block<'_>,
        scratch: &mut Scratch,
        seen: &mut [RayResult],
    ) -> Result<(), OutOfRange> {
        let Block { alpha, beta, times } = block;
        let rays = alpha.len();
        let Some(now) = seen.get_mut(..rays) else { return Ok(()) };
        let clock = scratch.meter.start();
        let wanted = if self.disc.is_some() { MOST_HITS } else { 1 };
        scratch.crossings.trace(&self.hole, observer, alpha, beta, wanted)?;
        scratch.meter.stop(Part::Rays, clock);
        let clock = scratch.meter.start();
        // The question is asked once a block.
        let fallback = match self.spectral_index {
            None => self.shade_disc(observer, alpha, None, scratch, now),
            Some(index) => self.shade_disc(observer, alpha, Some(index), scratch, now),
        };
        scratch.meter.stop(Part::Surfaces, clock);
        let clock = scratch.meter.start();
        self.add_sky(observer, (alpha, beta), scratch, now)?;
        scratch.meter.stop(Part::Sky, clock);
        if !fallback.is_empty() {
            scratch.traced.resize(rays, TracedRay::default());
            scratch.volume.reset(0);
        }
        for k in fallback {
            let (place, times) = (block.place(k), &[self.time]);
            let ray = self.step(k, place, times, scratch)?;
            self.shade(k, Some(&ray), place, (times, &[]), scratch, now)?;
        }
        for later in 1..times.len() {
            seen.copy_within(..rays, later * rays);
        }
        Ok(())
    }

    /// Light of the disc along the rays of a block, and what becomes of them; the numbers of those
    /// that have to be traced by steps, which are left unresolved.
    #[inline(always)]
    fn shade_disc(
        &self,
        observer: &Observer,
        alpha: &[f64],
        spectral_index: Option<f64>,
        scratch: &Scratch,
        seen: &mut [RayResult],
    ) -> Vec<usize> {
        let mut fallback = Vec::new();
        let sin = observer.inclination().sin();
        for (k, (seen, alpha)) in seen.iter_mut().zip(alpha).enumerate() {
            let ends = scratch.crossings.ends(k);
            let hits = scratch.crossings.ray(k).map(|crossing| Hit::new(&crossing));
            let surface = self.surface(hits.clone(), f64::INFINITY);
            let all = self.disc.is_none()
                || surface.is_some()
                || hits.clone().count() >= ends.crossings as usize;
            if !all || needs_stepping(ends.error, self.tolerance) {
                *seen = RayResult::default();
                fallback.push(k);
                continue;
            }
            let light = Seen {
                lambda: -alpha * sin,
                eta: f64::NAN,
                screen: None,
                shift: None,
                spectral_index,
            };
            let mut gathered = Accumulator::new();
            self.add_disc(hits, light, surface.unwrap_or(f64::INFINITY), &mut gathered);
            let end = if ends.escapes { End::Escaped } else { End::Captured };
            let traced =
                TracedRay { end, surface, crossings: ends.crossings, ..TracedRay::default() };
            *seen = ray_result(&traced, gathered);
        }
        fallback
    }

    /// Light of the sky along the rays of a block that escape.
    fn add_sky(
        &self,
        observer: &Observer,
        place: (&[f64], &[f64]),
        scratch: &mut Scratch,
        seen: &mut [RayResult],
    ) -> Result<(), OutOfRange> {
        let Some(sky) = &self.sky else { return Ok(()) };
        let escaped = |k: &usize| seen[*k].fate == Fate::Escaped;
        let outward: Vec<usize> = (0..seen.len()).filter(escaped).collect();
        self.find_exits(observer, place, &outward, &mut scratch.samples, |k, exit| {
            for (channel, light) in seen[k].rgb.iter_mut().zip(sky.color(exit)) {
                *channel += light;
            }
        })
    }
}
