//! Sums over rays that data of another program ask for, where the geometry is known.

use super::detail::{Detail, RaySampling};
use super::known_geometry;
use super::refinement::{MEANS, by_chance};
use crate::fit::Sampling;
use crate::fit::geometry::Geometry;
use crate::fit::journal::{Forgetful, Memory};
use crate::fit::settings::{
    AxisSearch, DataFiles, FitFile, GeometrySearch, LossKind, SearchView, UnknownGeometry,
};
use crate::fit::setup::{FitData, Result};

/// Voxels along each axis and iterations of the volumes that are compared.
const NODES: usize = 24;
const ITERATIONS: usize = 30;
/// Pixels of all frames that are compared, about.
const PIXELS: usize = 20_000;
/// Returns the rays of a pixel and the panels of a ray that images of another program ask for, or the panels that visibilities
/// do: more than one where they explain the data better by more than chance. None where settings say how many rays a pixel has,
/// where the geometry has yet to be found, and of other data.
///
/// # Errors
/// If a setting is missing or out of range, or the linear problem of the data has no solution.
pub fn rays_of_data(file: &FitFile, measured: &FitData) -> Result<Option<RaySampling>> {
    if !is_open(file)? {
        return Ok(None);
    }
    let pixels = file.screen.pixels;
    let frames = (PIXELS / (pixels * pixels)).max(2);
    let fine = SearchView { trials: 1, nodes: NODES, iterations: ITERATIONS, pixels, frames };
    let search = GeometrySearch { fine, ..GeometrySearch::default() };
    let unknown = UnknownGeometry { free: Vec::new(), search };
    let detail = Detail {
        file,
        measured,
        unknown: &unknown,
        memory: Memory::new(&Forgetful),
        scale: &|_| 1.0,
    };
    detail.rays_asked_for(known_geometry(file)).map(Some)
}

/// Returns whether images or visibilities are all that is compared, and nobody has said how many rays a pixel has.
fn is_open(file: &FitFile) -> Result<bool> {
    let is_plain = file.polarization.is_none()
        && file.quiescent.is_none()
        && file.effects.absorption.is_none()
        && file.change.is_none();
    let is_known = matches!(file.axis, AxisSearch::Known {})
        && file.band.is_none()
        && file.unknown_geometry()?.is_none();
    let compares = |kind: LossKind| file.loss.iter().all(|loss| loss.data == kind);
    let is_measured = match file.data {
        Some(DataFiles::Movie { .. }) => compares(LossKind::Image),
        Some(DataFiles::Visibilities { .. }) => compares(LossKind::Visibilities),
        _ => false,
    };
    let is_linear = file.linear.is_some() && matches!(file.region.nodes, Sampling::Gauss { .. });
    Ok(file.screen.samples_per_pixel.is_none() && is_plain && is_known && is_measured && is_linear)
}

impl Detail<'_> {
    /// Returns the rays that data of another program ask for in a geometry that is known, through the pixels of the settings. Data
    /// have to be convex: volumes are compared.
    fn rays_asked_for(&self, geometry: Geometry) -> Result<RaySampling> {
        let place = self.first(1.0)?;
        if !self.through(&place, |problem| Ok(problem.is_convex()))? {
            return Ok(RaySampling::default());
        }
        let mut here = self.solved(place, geometry)?;
        loop {
            let at = here.place.at;
            let mut sums = self.finer_sums(&here.place, MEANS);
            sums.retain(|finer| finer.pixels == at.pixels);
            let among = self.pointed_to(&here, sums, by_chance)?;
            let Some(there) = self.asked_for(&here, among)? else { return Ok(at.rays) };
            here = there;
        }
    }
}

/// The settings with these rays. What settings say of the rays of a pixel stays.
#[must_use]
pub fn through(mut file: FitFile, rays: RaySampling) -> FitFile {
    if let Sampling::Gauss { split, .. } = &mut file.region.nodes {
        *split *= rays.panels;
    }
    if file.screen.samples_per_pixel.is_none() {
        file.screen.ring_rays = file.screen.ring_rays.or(rays.ring);
    }
    file.screen.samples_per_pixel = Some(rays.per_side * rays.per_side);
    file
}
