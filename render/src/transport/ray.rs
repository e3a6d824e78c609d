//! The only place where a pixel is a sum: light of every source along one ray.
//!
//! Surfaces come first, since they end rays; then what fills space, on quadrature nodes; then spots;
//! then the sky. A block of rays is traced by one call of [`BlockTracer::trace`], which hands what it
//! finds to the [`Sum`].
//!
//! [`BlockTracer::trace`]: kerrlight_geodesic::BlockTracer::trace

use super::central::CentralScratch;
use super::layers::{HOLE, Layers, Origin, Record};
use super::meter::Meter;
use super::prepare::PreparedScene;
use super::result::{Accumulator, RayResult};
use super::sources::disc::DiscRay;
use super::sources::media::{MediaRay, MediaScratch};
use super::sources::meshes::MeshScratch;
use super::sources::spots::{SpotRay, SpotScratch, SpotTree};
use crate::emission::medium::Part;
use kerrlight_geodesic::analytic::ClosedForm;
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{
    Error, Outcome, PathOfRay, PathUse, PlaneCrossing, Ray, RayBlock, RayVisitor, TracedRay, Work,
    footprint,
};
use std::sync::Arc;

/// Rays of a block, and the times of observation at which they are seen.
#[derive(Clone, Copy)]
pub(crate) struct Block<'a> {
    pub alpha: &'a [f64],
    pub beta: &'a [f64],
    pub times: &'a [f64],
}

/// Memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(super) rays: RayBlock,
    pub(super) sources: SourceScratch,
    pub(super) central: CentralScratch,
    /// Meter of time; off unless it is replaced.
    pub meter: Meter,
}

/// Scratch space of each source, from ray to ray.
#[derive(Debug, Default)]
pub(super) struct SourceScratch {
    pub media: MediaScratch,
    meshes: MeshScratch,
    spots: SpotScratch,
    /// Mino times from which on light of each ray is of the next image; empty unless images are kept apart.
    cuts: Vec<[f64; 2]>,
    /// End of the beam of the present ray on the sky.
    beam: Option<footprint::Sky>,
}

impl PreparedScene {
    /// Returns the result of the ray at (α, β) at the scene's own time.
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

    /// Writes the results at each (`alpha[k]`, `beta[k]`) at each of `times` (of observation, in M): ray `k` at time `j`
    /// goes to `seen[j · rays + k]`. Rays are traced once for all times.
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
        self.observe_layers(Block { alpha, beta, times }, scratch, seen, &mut [])
    }

    /// The same with what is wanted besides, in the same order, unless there is no room for it.
    pub(crate) fn observe_layers(
        &self,
        block: Block<'_>,
        scratch: &mut Scratch,
        seen: &mut [RayResult],
        layers: &mut [Layers],
    ) -> Result<(), crate::Error> {
        let (Scratch { rays, sources, meter, .. }, Block { alpha, beta, times }) = (scratch, block);
        sources.media.reset(self.media.len(), alpha.len(), times.len());
        self.find_cuts(block, !layers.is_empty(), &mut sources.cuts)?;
        let trees: Vec<_> = if self.optics.lensing {
            times.iter().map(|time| self.spots.tree(&self.optics, *time)).collect()
        } else {
            Vec::new()
        };
        let sighted = self.spots.sight(&self.optics, times.len());
        let request = if sighted { &self.sighting } else { &self.request };
        let mut sum = Sum { scene: self, block, trees, sighted, sources, meter, seen, layers };
        let done = match (self.optics.view.observer(), self.optics.lensing) {
            (Some(observer), false) => sum.along_lines(observer),
            _ => self.tracer.trace(alpha, beta, request, rays, &mut sum),
        };
        meter.stop();
        Ok(done?)
    }

    /// Fills `cuts` with the Mino times between the equatorial crossings of each ray, where it turns in θ, if images are
    /// kept apart.
    fn find_cuts(
        &self,
        Block { alpha, beta, .. }: Block<'_>,
        asked: bool,
        cuts: &mut Vec<[f64; 2]>,
    ) -> Result<(), Error> {
        cuts.clear();
        if !(asked && self.optics.wanted.orders && self.optics.lensing) {
            return Ok(());
        }
        let (hole, view) = (&self.optics.hole, &self.optics.view);
        for (x, y) in alpha.iter().zip(beta) {
            let form = ClosedForm::new(hole, &view.ray(hole, *x, *y)?);
            let mut crossings = form.crossings().map(|crossing| crossing.mino_time);
            let times = match view.observer() {
                Some(_) => [(); 3].map(|()| crossings.next().unwrap_or(f64::INFINITY)),
                // A camera's ray may start outwards, where the closed form ends at another radius.
                None => [1, 2, 3].map(|k| form.crossing_time(k)),
            };
            cuts.push([0, 1].map(|k| 0.5 * (times[k] + times[k + 1])));
        }
        Ok(())
    }
}

/// Sums up the light of a block of rays.
pub(super) struct Sum<'a> {
    pub scene: &'a PreparedScene,
    pub block: Block<'a>,
    /// Trees over the spots at each time.
    trees: Vec<Option<Arc<SpotTree>>>,
    /// True if it is found from rays' positions which of them may meet spots.
    sighted: bool,
    pub sources: &'a mut SourceScratch,
    pub meter: &'a mut Meter,
    seen: &'a mut [RayResult],
    /// Other layers: as many, or none.
    layers: &'a mut [Layers],
}

impl RayVisitor for Sum<'_> {
    #[inline]
    fn is_opaque_at(&self, crossing: &PlaneCrossing) -> bool {
        self.scene.disc.as_ref().is_some_and(|disc| disc.hides_at(crossing))
    }

    fn needs_path(&self, ray: &Ray) -> PathUse {
        let PreparedScene { meshes, media, spots, optics, .. } = self.scene;
        // A ray that is traced step by step has its path for spots as well.
        let meets_mesh = meshes.as_ref().is_some_and(|meshes| meshes.need_path(optics, ray));
        if meets_mesh || media.need_path(ray) {
            return PathUse::Instead;
        }
        let may_meet = !self.sighted && spots.need_path(ray, &self.trees);
        if may_meet { self.path_to_spots() } else { PathUse::None }
    }

    fn needs_path_at(&self, ray: &TracedRay, nodes: &RayNodes<'_>) -> PathUse {
        let PreparedScene { spots, optics, .. } = self.scene;
        let may_meet = spots.may_be_met(optics, ray, nodes, self.block.times);
        if may_meet { self.path_to_spots() } else { PathUse::None }
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
        // A path beside the closed form serves spots alone: media of cells have their rays stepped.
        if let (Some(path), true) = (path, ray.stepped) {
            self.add_cells(number, ray, path);
        }
        self.meter.switch(Part::Surfaces);
        // Discs and meshes look the same at all times.
        let mut still = self.accumulator(number, ray, crossings);
        self.add_surfaces(number, ray, crossings, path, &mut still);
        self.meter.switch(Part::Sky);
        let behind = self.sky(ray);
        self.meter.switch(Part::Spots);
        for (j, time) in self.block.times.iter().enumerate() {
            let mut light = still.clone();
            let source = self.scene.optics.numbering.media;
            self.scene.media.add(number, j, source, &self.sources.media, &mut light);
            if let Some(path) = path {
                self.add_spots(number, j, *time, ray, path, &mut light);
            }
            if behind != [0.0; 3] {
                light.add_behind(behind);
            }
            self.finish(number, j, ray, light);
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
    /// Returns the use of the path of a ray that may meet a spot.
    fn path_to_spots(&self) -> PathUse {
        // The depth in front of a spot is that of the last ray whose nodes were taken.
        if self.scene.media.absorb() { PathUse::Instead } else { PathUse::Beside }
    }

    /// No light yet, along ray number `k`.
    #[inline(always)]
    fn accumulator(&self, k: usize, ray: &TracedRay, crossings: &[PlaneCrossing]) -> Accumulator {
        let record = (!self.layers.is_empty()).then(|| self.record(k, ray, crossings));
        Accumulator { record, ..Accumulator::default() }
    }

    /// Returns the Mino times that keep images of ray number `k` apart, infinite behind the last crossing.
    fn cuts(&self, k: usize, ray: &TracedRay) -> Option<[f64; 2]> {
        let cuts = self.sources.cuts.get(k)?;
        if self.scene.optics.view.observer().is_some() {
            return Some(*cuts);
        }
        let of = |order: usize| match (ray.crossing_count as usize) < order + 2 {
            true => f64::INFINITY,
            false => cuts[order],
        };
        Some([of(0), of(1)])
    }

    /// Returns the record of ray number `k`: as long as nothing shines, the surface that ends it.
    fn record(&self, k: usize, ray: &TracedRay, crossings: &[PlaneCrossing]) -> Box<Record> {
        let cuts = self.cuts(k, ray).unwrap_or([f64::INFINITY; 2]);
        Box::new(Record { cuts, origin: self.end(ray, crossings), ..Record::default() })
    }

    /// The opaque surface or the hole that a ray ends at.
    fn end(&self, ray: &TracedRay, crossings: &[PlaneCrossing]) -> Option<Origin> {
        let PreparedScene { optics, meshes, .. } = self.scene;
        let Some(mino_time) = ray.surface else {
            let falls = ray.outcome == Outcome::Captured;
            return falls.then_some(Origin { source: HOLE, mino_time: ray.mino_total });
        };
        let in_plane = crossings.iter().any(|crossing| crossing.mino_time == mino_time);
        let mesh = meshes.as_ref().filter(|_| !in_plane);
        let mesh = mesh.and_then(|all| all.hidden_by(optics, &self.sources.meshes, mino_time));
        Some(Origin { source: mesh.unwrap_or(optics.numbering.disc), mino_time })
    }

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
        let cuts = self.cuts(k, ray);
        MediaRay { number: k, ray, crossings, polarized, times: self.block.times, cuts }
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
            let seen = DiscRay { ray, crossings, depths, polarized, blueshift };
            disc.add(optics, &seen, light);
        }
        if let (Some(meshes), Some(path), true) = (meshes, path, ray.stepped) {
            let (way, depths) = ((path.path, ray.last_time()), self.sources.media.profile());
            meshes.add(optics, way, &self.sources.meshes, depths, light);
        }
    }

    /// Light of the sky.
    #[inline(always)]
    fn sky(&mut self, ray: &TracedRay) -> [f32; 3] {
        // Taken away, so that no later ray uses it.
        let beam = self.sources.beam.take();
        self.scene.sky.as_ref().map_or([0.0; 3], |sky| sky.light(ray, beam.as_ref()))
    }

    /// Light of the spots at time number `j`.
    fn add_spots(
        &mut self,
        k: usize,
        j: usize,
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
    fn finish(&mut self, k: usize, j: usize, ray: &TracedRay, light: Accumulator) {
        let (x, y) = self.place(k);
        let place = j * self.block.alpha.len() + k;
        let Some(seen) = self.seen.get_mut(place) else { return };
        *seen = light.result(ray);
        let optics = &self.scene.optics;
        let mut boost = 1.0;
        if let (Some(index), Some(shift)) = (optics.spectral_index, optics.blueshift(x, y)) {
            boost = seen.receive(shift, index);
        }
        if let (Some(layers), Some(record)) = (self.layers.get_mut(place), &light.record) {
            *layers = Layers::of(ray, record, light.intensity, light.through());
            layers.mixed.boost(boost as f32);
        }
    }
}
