//! What is seen along rays, block by block.
//!
//! Surfaces come first, since they end rays; then what fills space, on quadrature nodes; then spots;
//! then the sky.

use super::rays::{End, TracedRay};
use super::result::{Accumulator, Fate, RayResult, wrap};
use super::spots::SpotTree;
use super::straight::Line;
use super::surface::Seen;
use super::view::View;
use super::{NEAREST, PreparedScene, Scratch};
use crate::emission::medium::Part;
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

impl PreparedScene {
    /// What is seen at (α, β) at the scene's own time.
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn observe(
        &self,
        alpha: f64,
        beta: f64,
        scratch: &mut Scratch,
    ) -> Result<RayResult, OutOfRange> {
        let mut seen = [RayResult::default()];
        self.observe_block(&[alpha], &[beta], &[self.time], scratch, &mut seen)?;
        let [seen] = seen;
        Ok(seen)
    }

    /// What is seen at each (`alpha[k]`, `beta[k]`) at each of `times` (of observation, in M):
    /// ray `k` at time `j` goes to `seen[j · rays + k]`. Rays are traced once for all times.
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn observe_block(
        &self,
        alpha: &[f64],
        beta: &[f64],
        times: &[f64],
        scratch: &mut Scratch,
        seen: &mut [RayResult],
    ) -> Result<(), OutOfRange> {
        let rays = alpha.len();
        scratch.traced.clear();
        scratch.hits.clear();
        if let (View::Screen(observer), false) = (&self.view, self.lensing) {
            return self.observe_straight(observer, Block { alpha, beta, times }, scratch, seen);
        }
        let observer = self.closed_form();
        if let (true, Some(observer)) = (self.bare, observer) {
            return self.observe_bare(observer, Block { alpha, beta, times }, scratch, seen);
        }
        let trees: Vec<_> = times.iter().map(|time| self.spot_tree(*time)).collect();
        let clock = scratch.meter.start();
        match observer {
            Some(observer) => {
                self.trace_block(observer, (alpha, beta), (times, &trees), scratch)?
            }
            None => {
                scratch.traced.resize(rays, TracedRay { by_steps: true, ..TracedRay::default() })
            }
        }
        scratch.meter.stop(Part::Rays, clock);
        scratch.volume.reset(self.media.len() * rays * times.len());
        if let Some(observer) = observer {
            for (m, medium) in
                self.media.iter().enumerate().filter(|(_, m)| m.cell_size().is_none())
            {
                let clock = scratch.meter.start();
                self.fill_block(m, observer, (alpha, beta), times, scratch)?;
                scratch.meter.stop(medium.part(), clock);
            }
        }
        for k in 0..rays {
            let by_steps = scratch.traced[k].by_steps;
            let ray = by_steps.then(|| self.step(k, (alpha[k], beta[k]), times, scratch));
            let ray = ray.transpose()?;
            let place = (alpha[k], beta[k]);
            self.shade(k, ray.as_ref(), place, (times, &trees), scratch, seen)?;
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
        scratch.traced[k] = self.trace_steps(&ray, scratch);
        scratch.meter.stop(Part::Rays, clock);
        let screen = self.screen_point(x, y);
        for (m, medium) in self.media.iter().enumerate() {
            let clock = scratch.meter.start();
            match medium.cell_size() {
                Some(cell) => self.fill_cells((m, k), &ray, (screen, cell), times, scratch),
                None => self.fill_path((m, k), screen, times, scratch),
            }
            scratch.meter.stop(medium.part(), clock);
        }
        Ok(ray)
    }

    /// [`observe_block`](Self::observe_block) without gravitational lensing.
    fn observe_straight(
        &self,
        observer: &Observer,
        block: Block<'_>,
        scratch: &mut Scratch,
        seen: &mut [RayResult],
    ) -> Result<(), OutOfRange> {
        let (rays, times) = (block.alpha.len(), block.times);
        scratch.traced.resize(rays, TracedRay::default());
        scratch.volume.reset(self.media.len() * rays * times.len());
        for k in 0..rays {
            let (alpha, beta) = block.place(k);
            let ray = observer.ray(&self.hole, alpha, beta)?;
            let line = Line::new(observer, self.hole.horizon(), alpha, beta);
            scratch.traced[k] = self.trace_line(&line, &ray, scratch);
            self.fill_line(&line, k, times, scratch);
            self.shade(k, None, (alpha, beta), (times, &[]), scratch, seen)?;
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
    pub(super) fn shade(
        &self,
        k: usize,
        ray: Option<&Ray>,
        (x, y): (f64, f64),
        (times, trees): (&[f64], &[Option<Arc<SpotTree>>]),
        scratch: &mut Scratch,
        seen: &mut [RayResult],
    ) -> Result<(), OutOfRange> {
        let clock = scratch.meter.start();
        let traced = scratch.traced[k].clone();
        let mut still = Accumulator::new();
        let hits = scratch.hits[traced.hits.clone()].iter().copied();
        let screen = self.screen_point(x, y);
        let shift = self.spectral_index.and_then(|_| self.view.blueshift(x, y));
        let TracedRay { lambda, eta, .. } = traced;
        let spectral_index = self.spectral_index;
        let seen_as = Seen { lambda, eta, screen: screen.as_ref(), shift, spectral_index };
        self.add_disc(hits, seen_as, traced.last_time(), &mut still);
        if traced.by_steps {
            self.add_meshes(scratch, traced.last_time(), &mut still);
        }
        scratch.meter.stop(Part::Surfaces, clock);
        let clock = scratch.meter.start();
        let sky = self.sky_light(x, y, &traced, scratch)?;
        scratch.meter.stop(Part::Sky, clock);
        let clock = scratch.meter.start();
        for (j, time) in times.iter().enumerate() {
            let mut gathered = still.clone();
            let rays = scratch.traced.len();
            for (m, medium) in self.media.iter().enumerate() {
                let place = (m * rays + k) * times.len() + j;
                if let Some(light) = scratch.volume.lights.get(place) {
                    gathered.add_light(light, medium.color());
                }
            }
            if let (Some(tree), Some(ray)) = (trees.get(j), ray) {
                let end = traced.last_time();
                match tree {
                    Some(tree) => {
                        self.add_spots(*time, tree, (ray, screen), scratch, end, &mut gathered)
                    }
                    None => self.add_every_spot(*time, (ray, screen), scratch, end, &mut gathered),
                }
            }
            gathered.add_behind(sky);
            let Some(place) = seen.get_mut(j * scratch.traced.len() + k) else { continue };
            *place = ray_result(&traced, gathered);
            if let (Some(index), Some(shift)) = (self.spectral_index, shift) {
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
        traced: &TracedRay,
        scratch: &mut Scratch,
    ) -> Result<[f32; 3], OutOfRange> {
        let (Some(sky), Some(direction), None) = (&self.sky, traced.exit, traced.surface) else {
            return Ok([0.0; 3]);
        };
        if traced.until < traced.total {
            return Ok([0.0; 3]);
        }
        if let (Some(spacing), true) = (self.beams, self.lensing) {
            let ray = self.view.beam(&self.hole, x, y)?;
            let hole = self.hole.lift();
            let end = footprint::of_ray(&hole, &ray, self.tolerance, &mut scratch.beam)?;
            if let Some(end) = end {
                return Ok(sky.mean_color(&Beam::new(&end, spacing)));
            }
        }
        Ok(sky.color(direction))
    }
}

/// The sum of everything along a ray.
#[inline]
pub(super) fn ray_result(traced: &TracedRay, gathered: Accumulator) -> RayResult {
    let fate = match (traced.surface, traced.end) {
        (Some(_), _) => Fate::Surface,
        (None, End::Captured) => Fate::Captured,
        (None, End::Escaped) => Fate::Escaped,
        (None, End::Unresolved) => Fate::Unresolved,
    };
    let mean = if gathered.intensity > 0.0 { gathered.shift / gathered.intensity } else { 0.0 };
    RayResult {
        intensity: gathered.intensity,
        rgb: gathered.rgb,
        redshift: mean,
        crossings: traced.crossings,
        disc_images: gathered.disc_images,
        radius: gathered.place.radius,
        azimuth: wrap(gathered.place.azimuth),
        delay: gathered.place.delay,
        optical_depth: gathered.depth,
        stokes: gathered.stokes,
        fate,
    }
}
