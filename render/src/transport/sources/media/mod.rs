//! Media that fill space: gas and volumes, with as many nodes along each ray as it takes.

mod cells;
mod depth;

pub(in crate::transport) use depth::DepthProfile;

use crate::Error;
use crate::emission::gas::GasModel;
use crate::emission::medium::{CellSize, Emission, Medium, Moment, Part};
use crate::emission::volume::VolumeModel;
use crate::scene::Scene;
use crate::transport::optics::{Optics, in_cartesian};
use crate::transport::polarized::PolarizedRay;
use crate::transport::quadrature::{Quadrature, Sums, integrate};
use crate::transport::result::{Accumulator, Light};
use crate::transport::tree::enters;
use crate::volume::VolumeFile;
use cells::CellScratch;
use kerrlight_common::units::SPEED_OF_LIGHT;
use kerrlight_geodesic::simd::{NodeRequest, PanelRule, RayNodes};
use kerrlight_geodesic::{Kerr, PlaneCrossing, Ray, SphereNodes, TracedRay};
use std::sync::Arc;

/// Nodes of a panel.
const ORDER: usize = 8;

/// Panels are cut into at most so many times as many.
const FINEST: u32 = 256;

/// The same where cells or thin layers have to be resolved.
const FINEST_OF_CELLS: u32 = 1024;

/// Nodes next to each other in a thin layer are no farther apart, in its standard deviations.
const BETWEEN: f64 = 1.5;

/// Standard deviations beyond which a thin layer is dark.
const BEYOND: f64 = 6.0;

/// Errors of rays fainter than this share of what the medium can reach are measured by that.
const FAINT: f64 = 1e-4;

/// Panels may be longer than cells by so much that rounding does not cut them once more.
const ROUNDING: f64 = 1.05;

/// The media of a scene.
#[derive(Debug, Clone)]
pub(in crate::transport) struct Media {
    all: Vec<Arc<dyn Medium>>,
    /// The numbers of those that are not made of cells.
    smooth: Vec<usize>,
}

/// Scratch space of media, from ray to ray.
#[derive(Debug)]
pub(in crate::transport) struct MediaScratch {
    quadrature: Quadrature,
    sums: Sums,
    cells: CellScratch,
    emission: Emission,
    /// Light of each medium along each ray at each time.
    lights: Vec<Light>,
    rays: usize,
    times: usize,
    /// Optical depth along the last ray.
    profile: DepthProfile,
    /// Optical depth in front of each crossing of the block; empty without absorption.
    depths: Vec<f64>,
}

impl Default for MediaScratch {
    fn default() -> Self {
        MediaScratch {
            quadrature: Quadrature::new(ORDER),
            sums: Sums::default(),
            cells: CellScratch::default(),
            emission: Emission::default(),
            lights: Vec::new(),
            rays: 0,
            times: 0,
            profile: DepthProfile::default(),
            depths: Vec::new(),
        }
    }
}

impl MediaScratch {
    /// Room for the light of so many media along so many rays at so many times.
    pub fn reset(&mut self, media: usize, rays: usize, times: usize) {
        self.lights.clear();
        self.lights.resize(media * rays * times, Light::default());
        (self.rays, self.times) = (rays, times);
        self.profile.clear();
        self.depths.clear();
    }

    /// Returns the light of medium number `m` along ray number `k`, at all times.
    fn lights_of(&mut self, m: usize, k: usize) -> &mut [Light] {
        let first = (m * self.rays + k) * self.times;
        &mut self.lights[first..first + self.times]
    }

    /// Forgets the optical depths: the crossings of another ray follow.
    pub fn forget_crossings(&mut self) {
        self.depths.clear();
    }

    /// The rule of a panel.
    pub fn rule(&self) -> &PanelRule {
        &self.quadrature.rule
    }

    /// The optical depths in front of a ray's crossings; empty without absorption.
    pub fn depths(&self, ray: &TracedRay) -> &[f64] {
        self.depths.get(ray.crossings.clone()).unwrap_or(&[])
    }

    /// Optical depth along the last ray.
    pub fn profile(&self) -> &DepthProfile {
        &self.profile
    }

    /// Takes the depths of the last ray in front of its crossings.
    fn shade(&mut self, ray: &TracedRay, crossings: &[PlaneCrossing]) {
        let end = ray.crossings.end;
        if self.depths.len() < end {
            self.depths.resize(end, 0.0);
        }
        for (depth, crossing) in self.depths[ray.crossings.clone()].iter_mut().zip(crossings) {
            *depth = self.profile.at(crossing.mino_time);
        }
    }
}

/// A ray along which the light of media is summed up.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct MediaRay<'a> {
    /// Its number in the block.
    pub number: usize,
    pub ray: &'a TracedRay,
    pub crossings: &'a [PlaneCrossing],
    pub polarized: Option<PolarizedRay<'a>>,
    /// Times of observation.
    pub times: &'a [f64],
    /// Mino times in M⁻¹ from which on light is of the next image, if images are kept apart.
    pub cuts: Option<[f64; 2]>,
}

impl Media {
    /// The media of a scene with the files of its volumes.
    pub fn new(scene: &Scene, files: &[VolumeFile], hole: &Kerr) -> Result<Self, Error> {
        if files.len() != scene.volume.len() {
            let (value, allowed) = (files.len() as f64, "one file for each [[volume]]");
            return Err(Error::out_of_range("number of volume files", value, allowed));
        }
        let mut all: Vec<Arc<dyn Medium>> = Vec::new();
        if let Some(gas) = &scene.gas {
            let length = 100.0 * SPEED_OF_LIGHT;
            let length = length * scene.hole.seconds().unwrap_or(f64::NAN); // gas needs it
            all.push(Arc::new(GasModel::new(gas, hole, length, &scene.effects)));
        }
        for (source, file) in scene.volume.iter().zip(files) {
            all.push(Arc::new(VolumeModel::new(source, file, hole, &scene.effects)?));
        }
        let smooth = (0..all.len()).filter(|m| all[*m].cell_size().is_none()).collect();
        Ok(Media { all, smooth })
    }

    /// The same with each medium replaced.
    #[cfg(test)]
    pub fn map(mut self, other: impl Fn(Arc<dyn Medium>) -> Arc<dyn Medium>) -> Self {
        self.all = self.all.into_iter().map(other).collect();
        self
    }

    /// Returns the number of media.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &dyn Medium> {
        self.all.iter().map(|medium| &**medium)
    }

    /// dx/dt of the matter of medium number `m` at the point of a path with this radius, cos θ and azimuth; 0 where there
    /// is none.
    pub fn velocity(&self, m: usize, r: f64, cos: f64, azimuth: f64) -> [f64; 3] {
        let medium = self.all.get(m);
        let Some([t, fall, polar, turn]) =
            medium.and_then(|all| all.four_velocity(r, cos, azimuth))
        else {
            return [0.0; 3];
        };
        let rates = [fall / t, polar / t, turn / t];
        in_cartesian([r, cos, azimuth], rates)
    }

    /// Returns whether anything absorbs.
    pub fn absorb(&self) -> bool {
        self.iter().any(|medium| medium.absorbs())
    }

    /// Returns whether some are made of cells.
    pub fn have_cells(&self) -> bool {
        self.smooth.len() < self.all.len()
    }

    /// Those made of cells, with their numbers.
    pub fn with_cells(&self) -> impl Iterator<Item = (usize, &dyn Medium, CellSize)> {
        let numbered = self.iter().enumerate();
        numbered.filter_map(|(m, medium)| Some((m, medium, medium.cell_size()?)))
    }

    /// Returns whether the path of a ray is needed: cells are found along it.
    pub fn need_path(&self, ray: &Ray) -> bool {
        self.with_cells().any(|(_, medium, _)| enters(ray, medium.sphere()))
    }

    /// The number of the medium in sphere number `sphere` of the [`nodes`](Self::nodes).
    pub fn in_sphere(&self, sphere: usize) -> usize {
        self.smooth[sphere]
    }

    /// Returns the part of the plan that the cost of medium number `m` belongs to.
    pub fn part(&self, m: usize) -> Part {
        self.all[m].part()
    }

    /// The coarsest nodes of the media that are not made of cells.
    pub fn nodes(&self, optics: &Optics) -> Vec<SphereNodes> {
        let sphere = |m: &usize| SphereNodes {
            request: request(&*self.all[*m], optics),
            finest: finest(&*self.all[*m]),
        };
        self.smooth.iter().map(sphere).collect()
    }

    /// Sums up the light of medium number `m` along the nodes of a ray, at times of which the first
    /// is number `first` of the block's; whether the nodes are fine enough.
    pub fn radiate(
        &self,
        m: usize,
        optics: &Optics,
        seen: &MediaRay<'_>,
        first: usize,
        nodes: &RayNodes<'_>,
        scratch: &mut MediaScratch,
    ) -> bool {
        let done = self.sum_up(m, optics, seen, first, nodes, scratch);
        if self.all[m].absorbs() {
            scratch.shade(seen.ray, seen.crossings);
        }
        done
    }

    fn sum_up(
        &self,
        m: usize,
        optics: &Optics,
        seen: &MediaRay<'_>,
        first: usize,
        nodes: &RayNodes<'_>,
        scratch: &mut MediaScratch,
    ) -> bool {
        let medium = &*self.all[m];
        let mut emission = core::mem::take(&mut scratch.emission);
        let mut done = true;
        let (resolved, finest) = resolution(medium, nodes, scratch.quadrature.rule.order());
        if !resolved && seen.times.len() > 1 {
            // Not worth the light of all times.
            scratch.emission = emission;
            return false;
        }
        for (j, observed) in seen.times.iter().enumerate() {
            if !medium.changes() && j > 0 {
                let lights = &mut scratch.lights_of(m, seen.number)[first..];
                lights[j] = lights[0];
                continue;
            }
            emission.clear();
            let moment = Moment { observed: *observed, slow_light: optics.slow_light };
            medium.fill(nodes, seen.ray.lambda, moment, &mut emission);
            if let Some(polarized) = &seen.polarized {
                polarized.polarize(medium, nodes, &mut emission);
            }
            let sums = &mut scratch.sums;
            let light = integrate(&scratch.quadrature, nodes, &emission, seen.cuts, sums);
            let enough = optics.tolerance * (light.intensity + FAINT * medium.scale());
            // What shines behind is seen through the depth.
            let is_clear = scratch.sums.transmission_error <= optics.tolerance;
            done &= resolved && (finest || light.error <= enough && is_clear);
            scratch.lights_of(m, seen.number)[first + j] = light;
        }
        scratch.profile.clear();
        if medium.absorbs() {
            // What absorbs does not change: all times have the depths of the first.
            let total = scratch.lights_of(m, seen.number)[first..].first().map_or(0.0, |l| l.depth);
            let depths = &scratch.sums.depths;
            // On straight rays dλ = r² dτ, without the spin's part of Σ.
            let spin = if optics.lensing { optics.hole.spin() } else { 0.0 };
            scratch.profile.set(spin, nodes, &emission, depths, total);
        }
        scratch.emission = emission;
        done
    }

    /// Keeps the light of medium number `m` along ray `k` at time number `j`.
    pub fn keep(&self, m: usize, k: usize, j: usize, light: Light, scratch: &mut MediaScratch) {
        scratch.lights_of(m, k)[j] = light;
    }

    /// Adds the light of all media along ray number `k` at time number `j`; the first is source number `source`.
    #[inline(always)]
    pub fn add(
        &self,
        k: usize,
        j: usize,
        source: u32,
        scratch: &MediaScratch,
        light: &mut Accumulator,
    ) {
        for ((m, medium), source) in self.iter().enumerate().zip(source..) {
            let place = (m * scratch.rays + k) * scratch.times + j;
            if let Some(found) = scratch.lights.get(place) {
                light.add_light(found, medium.color(), source);
            }
        }
    }
}

/// The coarsest nodes of a medium.
fn request(medium: &dyn Medium, optics: &Optics) -> NodeRequest {
    NodeRequest {
        radius: medium.sphere(),
        rule: PanelRule::new(ORDER),
        split: 1,
        quantities: optics.quantities_of(medium),
    }
}

/// Returns the largest number of panels that a coarsest panel is cut into.
pub(in crate::transport) fn finest(medium: &dyn Medium) -> u32 {
    let is_fine = medium.cell_size().is_some() || medium.thin_layer().is_some();
    if is_fine { FINEST_OF_CELLS } else { FINEST }
}

/// Returns whether nodes are close enough for the cells or the layer of a medium, and whether panels are as short as they ever
/// get.
fn resolution(medium: &dyn Medium, nodes: &RayNodes<'_>, order: usize) -> (bool, bool) {
    if let Some(sigma) = medium.thin_layer() {
        return (is_met(nodes.cos_theta, sigma), false);
    }
    let Some(cell) = medium.cell_size() else { return (true, false) };
    let longest = cell.longest(nodes, order);
    (longest <= ROUNDING * cell.size, longest <= ROUNDING * CellSize::FINEST * cell.size)
}

/// Returns whether nodes in a layer of this standard deviation about the equator are close to each other, so that none of it
/// lies between two of them.
fn is_met(cos_theta: &[f64], sigma: f64) -> bool {
    cos_theta.windows(2).all(|pair| {
        let nearest = if pair[0] * pair[1] < 0.0 { 0.0 } else { pair[0].abs().min(pair[1].abs()) };
        nearest > BEYOND * sigma || (pair[1] - pair[0]).abs() <= BETWEEN * sigma
    })
}
