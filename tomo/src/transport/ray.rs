//! The only place where a pixel is a sum: light of every source along one ray.
//!
//! Surfaces come first, since they end rays; then what fills space, on quadrature nodes; then spots;
//! then the sky. A block of rays is traced by one call of [`BlockTracer::trace`], which hands what it
//! finds to the [`Sum`].
//!
//! [`BlockTracer::trace`]: kerrlight_geodesic::BlockTracer::trace

use super::meter::Meter;
use super::prepare::PreparedScene;
use super::result::{Accumulator, RayResult};
use super::sources::disc::{Disc, DiscRay};
use super::sources::media::{MediaRay, MediaScratch};
use super::sources::meshes::MeshScratch;
use super::sources::spots::{SpotRay, SpotScratch, SpotTree};
use crate::emission::medium::Part;
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{
    Error, PathOfRay, PathUse, PlaneCrossing, Ray, RayBlock, RayVisitor, TracedRay, Work, footprint,
};
use std::sync::Arc;

/// Rays of a block, and the times of observation at which they are seen.
#[derive(Clone, Copy)]
pub(super) struct Block<'a> {
    pub alpha: &'a [f64],
    pub beta: &'a [f64],
    pub times: &'a [f64],
}

/// Memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(super) rays: RayBlock,
    pub(super) sources: SourceScratch,
    /// Where the time goes; off unless it is replaced.
    pub meter: Meter,
}

/// What each source needs from ray to ray.
#[derive(Debug, Default)]
pub(super) struct SourceScratch {
    pub media: MediaScratch,
    meshes: MeshScratch,
    spots: SpotScratch,
    /// Where the beam of the present ray ends on the sky.
    beam: Option<footprint::Sky>,
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
    ) -> Result<RayResult, crate::Error> {
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
    ) -> Result<(), crate::Error> {
        let Scratch { rays, sources, meter } = scratch;
        sources.media.reset(self.media.len(), alpha.len(), times.len());
        let block = Block { alpha, beta, times };
        let trees: Vec<_> = if self.optics.lensing {
            times.iter().map(|time| self.spots.tree(&self.optics, *time)).collect()
        } else {
            Vec::new()
        };
        let sighted = !self.media.absorb() && self.spots.sight(&self.optics, times.len());
        let request = if sighted { &self.sighting } else { &self.request };
        let mut sum = Sum { scene: self, block, trees, sighted, sources, meter, seen };
        let done = match (self.optics.view.observer(), self.optics.lensing) {
            (Some(observer), false) => sum.along_lines(observer),
            _ => self.tracer.trace(alpha, beta, request, rays, &mut sum),
        };
        meter.stop();
        Ok(done?)
    }
}

/// Sums up the light of a block of rays.
pub(super) struct Sum<'a> {
    pub scene: &'a PreparedScene,
    pub block: Block<'a>,
    /// Trees over the spots at each time.
    trees: Vec<Option<Arc<SpotTree>>>,
    /// Whether it is found from rays' positions which of them may meet spots.
    sighted: bool,
    pub sources: &'a mut SourceScratch,
    pub meter: &'a mut Meter,
    seen: &'a mut [RayResult],
}

impl RayVisitor for Sum<'_> {
    #[inline]
    fn is_opaque_at(&self, crossing: &PlaneCrossing) -> bool {
        self.scene.disc.as_ref().is_some_and(|disc| disc.hides_at(crossing))
    }

    fn needs_path(&self, ray: &Ray) -> PathUse {
        let PreparedScene { meshes, media, spots, optics, .. } = self.scene;
        let meets_mesh = meshes.as_ref().is_some_and(|meshes| meshes.need_path(optics, ray));
        if meets_mesh || media.need_path(ray) {
            return PathUse::Instead;
        }
        if self.sighted || !spots.need_path(ray, &self.trees) {
            return PathUse::None;
        }
        // The depth in front of a spot is that of the last ray whose nodes were taken.
        if media.absorb() { PathUse::Instead } else { PathUse::Beside }
    }

    fn needs_path_at(&self, ray: &TracedRay, nodes: &RayNodes<'_>) -> bool {
        self.scene.spots.may_be_met(&self.scene.optics, ray, nodes, self.block.times)
    }

    fn first_surface(&mut self, path: PathOfRay<'_>) -> Option<f64> {
        let meshes = self.scene.meshes.as_ref()?;
        meshes.meet(&self.scene.optics, path, &mut self.sources.meshes)
    }

    fn take_nodes(
        &mut self,
        sphere: usize,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        nodes: &RayNodes<'_>,
    ) -> bool {
        let PreparedScene { media, optics, .. } = self.scene;
        let seen = self.media_ray(number, ray, crossings);
        media.radiate(media.in_sphere(sphere), optics, &seen, 0, nodes, &mut self.sources.media)
    }

    fn take_beam(&mut self, end: &footprint::Sky) {
        self.sources.beam = Some(*end);
    }

    #[inline(always)]
    fn take(
        &mut self,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        path: Option<PathOfRay<'_>>,
    ) -> Result<(), Error> {
        if let (Some(path), true) = (path, ray.stepped) {
            self.add_cells(number, ray, path);
        }
        self.meter.switch(Part::Surfaces);
        let mut still = Accumulator::new();
        self.add_surfaces(number, ray, crossings, path, &mut still);
        self.meter.switch(Part::Sky);
        let behind = self.sky(ray);
        self.meter.switch(Part::Spots);
        for (j, time) in self.block.times.iter().enumerate() {
            let mut light = still.clone();
            self.scene.media.add(number, j, &self.sources.media, &mut light);
            if let Some(path) = path {
                self.add_spots((number, j), *time, ray, path, &mut light);
            }
            if behind != [0.0; 3] {
                light.add_behind(behind);
            }
            self.finish((number, j), ray, light);
        }
        Ok(())
    }

    fn works_on(&mut self, work: Work) {
        let media = &self.scene.media;
        self.meter.switch(match work {
            Work::Rays => Part::Rays,
            Work::Exits => Part::Sky,
            Work::Nodes(sphere) => media.part(media.in_sphere(sphere)),
        });
    }
}

impl<'a> Sum<'a> {
    fn place(&self, k: usize) -> (f64, f64) {
        (self.block.alpha[k], self.block.beta[k])
    }

    /// Ray number `k` as media see it.
    pub fn media_ray<'r>(
        &self,
        k: usize,
        ray: &'r TracedRay,
        crossings: &'r [PlaneCrossing],
    ) -> MediaRay<'r>
    where
        'a: 'r,
    {
        let ((x, y), scene) = (self.place(k), self.scene);
        let polarized = scene.optics.polarized(x, y, ray.lambda);
        MediaRay { number: k, ray, crossings, polarized, times: self.block.times }
    }

    /// Sums up the light of media made of cells.
    fn add_cells(&mut self, k: usize, ray: &TracedRay, path: PathOfRay<'_>) {
        let PreparedScene { media, optics, .. } = self.scene;
        for medium in media.with_cells() {
            self.meter.switch(medium.1.part());
            let seen = self.media_ray(k, ray, &[]);
            media.radiate_cells(medium, optics, &seen, path, &mut self.sources.media);
        }
    }

    /// Light of the disc and of meshes.
    #[inline(always)]
    fn add_surfaces(
        &self,
        k: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        path: Option<PathOfRay<'_>>,
        light: &mut Accumulator,
    ) {
        let ((x, y), PreparedScene { optics, disc, meshes, .. }) = (self.place(k), self.scene);
        if let Some(disc) = disc {
            let depths = self.sources.media.depths(ray);
            let polarized = optics.polarized(x, y, ray.lambda);
            let blueshift = optics.blueshift(x, y);
            Disc::add(
                disc,
                optics,
                &DiscRay { ray, crossings, depths, polarized, blueshift },
                light,
            );
        }
        if let (Some(meshes), Some(path), true) = (meshes, path, ray.stepped) {
            meshes.add(optics, (path.path, ray.last_time()), &self.sources.meshes, light);
        }
    }

    /// Light of the sky.
    #[inline(always)]
    fn sky(&mut self, ray: &TracedRay) -> [f32; 3] {
        let beam = self.sources.beam.take();
        self.scene.sky.as_ref().map_or([0.0; 3], |sky| sky.light(ray, beam.as_ref()))
    }

    /// Light of the spots at time number `j`.
    fn add_spots(
        &mut self,
        (k, j): (usize, usize),
        time: f64,
        ray: &TracedRay,
        along: PathOfRay<'_>,
        light: &mut Accumulator,
    ) {
        let Some(tree) = self.trees.get(j) else { return };
        let ((x, y), PreparedScene { optics, spots, .. }) = (self.place(k), self.scene);
        let polarized = optics.polarized(x, y, ray.lambda);
        let SourceScratch { media, spots: scratch, .. } = &mut *self.sources;
        let (end, depths) = (ray.last_time(), media.profile());
        let seen = SpotRay { optics, along, end, polarized, depths };
        spots.add(time, tree.as_deref(), &seen, scratch, light);
    }

    /// Writes down what ray number `k` sees at time number `j`.
    #[inline(always)]
    fn finish(&mut self, (k, j): (usize, usize), ray: &TracedRay, light: Accumulator) {
        let (x, y) = self.place(k);
        let Some(seen) = self.seen.get_mut(j * self.block.alpha.len() + k) else { return };
        *seen = light.result(ray);
        let optics = &self.scene.optics;
        if let (Some(index), Some(shift)) = (optics.spectral_index, optics.blueshift(x, y)) {
            seen.receive(shift, index);
        }
    }
}
