//! What is seen along rays, block by block.
//!
//! Surfaces come first, since they end rays; then what fills space, on quadrature nodes; then spots;
//! then the sky.

use super::glimpse::{Fate, Gather, Glimpse, wrap};
use super::meter::Part;
use super::rays::{End, Sight};
use super::spots::SpotTree;
use super::straight::Line;
use super::surface::Seen;
use super::view::View;
use super::{NEAREST, Scratch, Stage};
use crate::emission::sky::Beam;
use kerrlight_geodesic::{Observer, OutOfRange, Ray, footprint};
use std::sync::Arc;

/// Rays of a block, and the times of observation at which they are asked.
#[derive(Clone, Copy)]
pub(super) struct Block<'a> {
    pub alpha: &'a [f64],
    pub beta: &'a [f64],
    pub times: &'a [f64],
}

impl Block<'_> {
    /// Where ray number `k` arrives.
    pub fn place(&self, k: usize) -> (f64, f64) {
        (self.alpha[k], self.beta[k])
    }
}

impl Stage {
    /// What is seen at (α, β) at the scene's own time.
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn look(
        &self,
        alpha: f64,
        beta: f64,
        scratch: &mut Scratch,
    ) -> Result<Glimpse, OutOfRange> {
        let mut seen = [Glimpse::default()];
        self.look_many(&[alpha], &[beta], &[self.time], scratch, &mut seen)?;
        let [seen] = seen;
        Ok(seen)
    }

    /// What is seen at each (`alpha[k]`, `beta[k]`) at each of `times` (of observation, in M):
    /// ray `k` at time `j` goes to `seen[j · rays + k]`. Rays are traced once for all times.
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn look_many(
        &self,
        alpha: &[f64],
        beta: &[f64],
        times: &[f64],
        scratch: &mut Scratch,
        seen: &mut [Glimpse],
    ) -> Result<(), OutOfRange> {
        let rays = alpha.len();
        scratch.sights.clear();
        scratch.hits.clear();
        if let (View::Screen(observer), false) = (&self.view, self.lensing) {
            return self.look_straight(observer, Block { alpha, beta, times }, scratch, seen);
        }
        let observer = self.closed_form();
        if let (true, Some(observer)) = (self.bare, observer) {
            return self.look_bare(observer, Block { alpha, beta, times }, scratch, seen);
        }
        let trees: Vec<_> = times.iter().map(|time| self.spot_tree(*time)).collect();
        let clock = scratch.meter.start();
        match observer {
            Some(observer) => self.trace_block(observer, (alpha, beta), &trees, scratch)?,
            None => scratch.sights.resize(rays, Sight { by_steps: true, ..Sight::default() }),
        }
        scratch.meter.stop(Part::Rays, clock);
        scratch.volume.reset(self.media.len() * rays * times.len());
        if let Some(observer) = observer {
            for (m, medium) in self.media.iter().enumerate().filter(|(_, m)| m.grain().is_none()) {
                let clock = scratch.meter.start();
                self.fill_block(m, observer, (alpha, beta), times, scratch)?;
                scratch.meter.stop(medium.part(), clock);
            }
        }
        for k in 0..rays {
            let by_steps = scratch.sights[k].by_steps;
            let ray = by_steps.then(|| self.step(k, (alpha[k], beta[k]), times, scratch));
            let ray = ray.transpose()?;
            let place = (alpha[k], beta[k]);
            self.look_along(k, ray.as_ref(), place, (times, &trees), scratch, seen)?;
        }
        Ok(())
    }

    /// Traces ray number `k` step by step, and gathers the light of what fills space along it.
    pub(super) fn step(
        &self,
        k: usize,
        (x, y): (f64, f64),
        times: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Ray, OutOfRange> {
        let ray = self.view.ray(&self.hole, x, y)?;
        let clock = scratch.meter.start();
        scratch.sights[k] = self.trace_steps(&ray, scratch);
        scratch.meter.stop(Part::Rays, clock);
        let screen = self.screen_point(x, y);
        for (m, medium) in self.media.iter().enumerate() {
            let clock = scratch.meter.start();
            match medium.grain() {
                Some(grain) => self.fill_cells((m, k), &ray, (screen, grain), times, scratch),
                None => self.fill_path((m, k), screen, times, scratch),
            }
            scratch.meter.stop(medium.part(), clock);
        }
        Ok(ray)
    }

    /// [`look_many`](Self::look_many) without gravitational lensing.
    fn look_straight(
        &self,
        observer: &Observer,
        block: Block<'_>,
        scratch: &mut Scratch,
        seen: &mut [Glimpse],
    ) -> Result<(), OutOfRange> {
        let (rays, times) = (block.alpha.len(), block.times);
        scratch.sights.resize(rays, Sight::default());
        scratch.volume.reset(self.media.len() * rays * times.len());
        for k in 0..rays {
            let (alpha, beta) = block.place(k);
            let ray = observer.ray(&self.hole, alpha, beta)?;
            let line = Line::new(observer, self.hole.horizon(), alpha, beta);
            scratch.sights[k] = self.trace_line(&line, &ray, scratch);
            self.fill_line(&line, k, times, scratch);
            self.look_along(k, None, (alpha, beta), (times, &[]), scratch, seen)?;
        }
        Ok(())
    }

    /// The observer, if it is one whose rays are to be had in closed form.
    fn closed_form(&self) -> Option<&Observer> {
        match &self.view {
            View::Screen(observer) => {
                Some(observer).filter(|o| self.closed_form && NEAREST * o.inverse_radius() <= 1.0)
            }
            View::Camera(_) => None,
        }
    }

    /// What is seen along ray number `k`, of which everything is known but the light of the
    /// surfaces, the spots and the sky. `ray` is there and the path of `scratch` is its own if it was
    /// traced step by step.
    pub(super) fn look_along(
        &self,
        k: usize,
        ray: Option<&Ray>,
        (x, y): (f64, f64),
        (times, trees): (&[f64], &[Option<Arc<SpotTree>>]),
        scratch: &mut Scratch,
        seen: &mut [Glimpse],
    ) -> Result<(), OutOfRange> {
        let clock = scratch.meter.start();
        let sight = scratch.sights[k].clone();
        let mut still = Gather::new();
        let hits = scratch.hits[sight.hits.clone()].iter().copied();
        let screen = self.screen_point(x, y);
        let shift = self.redshift.and_then(|_| self.view.blueshift(x, y));
        let Sight { lambda, eta, .. } = sight;
        let redshift = self.redshift;
        let seen_as = Seen { lambda, eta, screen: screen.as_ref(), shift, redshift };
        self.add_disc(hits, seen_as, sight.last_time(), &mut still);
        if sight.by_steps {
            self.add_meshes(scratch, sight.last_time(), &mut still);
        }
        scratch.meter.stop(Part::Surfaces, clock);
        let clock = scratch.meter.start();
        let sky = self.sky_light(x, y, &sight, scratch)?;
        scratch.meter.stop(Part::Sky, clock);
        let clock = scratch.meter.start();
        for (j, time) in times.iter().enumerate() {
            let mut gather = still.clone();
            let rays = scratch.sights.len();
            for (m, medium) in self.media.iter().enumerate() {
                let place = (m * rays + k) * times.len() + j;
                if let Some(light) = scratch.volume.lights.get(place) {
                    gather.add_light(light, medium.color());
                }
            }
            if let (Some(tree), Some(ray)) = (trees.get(j), ray) {
                let end = sight.last_time();
                match tree {
                    Some(tree) => {
                        self.add_spots(*time, tree, (ray, screen), scratch, end, &mut gather)
                    }
                    None => self.add_every_spot(*time, (ray, screen), scratch, end, &mut gather),
                }
            }
            gather.add_behind(sky);
            let Some(place) = seen.get_mut(j * scratch.sights.len() + k) else { continue };
            *place = glimpse(&sight, gather);
            if let (Some(index), Some(shift)) = (self.redshift, shift) {
                place.receive(shift, index);
            }
        }
        scratch.meter.stop(Part::Spots, clock);
        Ok(())
    }

    /// Light of the sky at the end of a ray, dark if it does not get there.
    fn sky_light(
        &self,
        x: f64,
        y: f64,
        sight: &Sight,
        scratch: &mut Scratch,
    ) -> Result<[f32; 3], OutOfRange> {
        let (Some(sky), Some(direction), None) = (&self.sky, sight.exit, sight.surface) else {
            return Ok([0.0; 3]);
        };
        if sight.until < sight.total {
            return Ok([0.0; 3]);
        }
        if let (Some(spacing), true) = (self.beams, self.lensing) {
            let ray = self.view.beam(&self.hole, x, y)?;
            let hole = self.hole.lift();
            let end = footprint::of_ray(&hole, &ray, self.tolerance, &mut scratch.beam)?;
            if let Some(end) = end {
                return Ok(sky.gather(&Beam::new(&end, spacing)));
            }
        }
        Ok(sky.look(direction))
    }
}

/// The sum of everything along a ray.
#[inline]
pub(super) fn glimpse(sight: &Sight, gather: Gather) -> Glimpse {
    let fate = match (sight.surface, sight.end) {
        (Some(_), _) => Fate::Surface,
        (None, End::Captured) => Fate::Captured,
        (None, End::Escaped) => Fate::Escaped,
        (None, End::Unresolved) => Fate::Unresolved,
    };
    let mean = if gather.intensity > 0.0 { gather.shift / gather.intensity } else { 0.0 };
    Glimpse {
        intensity: gather.intensity,
        rgb: gather.rgb,
        redshift: mean,
        crossings: sight.crossings,
        disc_images: gather.disc_images,
        radius: gather.place.radius,
        azimuth: wrap(gather.place.azimuth),
        delay: gather.place.delay,
        optical_depth: gather.depth,
        stokes: gather.stokes,
        fate,
    }
}
