//! Models as fine as data of another program ask for: more voxels, rays of a pixel, pixels, and panels of a ray.

use super::detail::{Detail, Place, Resolution};
use crate::fit::geometry::{Estimate, Geometry, GeometryProblem};
use crate::fit::linear::{Voxels, refined};
use crate::fit::setup::{Result, spacing};
use kerrlight_vlbi::operator::Pulse;

/// Voxels, and pixels of visibilities, of a finer model over those of a coarser one, along each side.
const FINER: f64 = 1.5;
/// Rays along each side of a pixel that is a mean, at least.
pub(super) const MEANS: usize = 2;
/// Rays along each side of a pixel, and panels, at most.
pub(super) const MOST: usize = 4;

/// Returns the number along each side of a finer model.
pub(super) fn finer(count: usize) -> usize {
    (FINER * count as f64).round() as usize
}

/// A geometry with its best volume at a resolution.
pub(super) struct Solved {
    pub best: Estimate,
    pub place: Place,
}

/// Standard deviation of χ²/2 by chance.
fn by_chance(problem: &GeometryProblem<'_, f32>) -> f64 {
    (0.5 * problem.data()).sqrt()
}

impl Detail<'_> {
    /// The best volume of a geometry.
    pub fn solved(&self, place: Place, geometry: Geometry) -> Result<Solved> {
        let best = self.through(&place, |problem| {
            let first = problem.solve(geometry)?;
            problem.solve_from(geometry, &first.x)
        })?;
        Ok(Solved { best, place })
    }

    /// The resolution that explains most among some, if that is more than chance does. Pixels near the critical curve, which
    /// ask for many rays, are compared as well: the geometry stays.
    pub fn asked_for(&self, here: &Solved, among: Vec<Resolution>) -> Result<Option<Solved>> {
        let (geometry, errors) = (here.best.geometry, here.place.errors);
        let (chance, voxels) =
            self.through(&here.place, |problem| Ok((by_chance(problem), problem.voxels())))?;
        let mut most: Option<Solved> = None;
        for at in among {
            let place = self.place(at, errors)?;
            let best = self.through(&place, |problem| {
                let x = refined(&voxels, &here.best.x, &problem.voxels())?;
                problem.solve_from(geometry, &x)
            })?;
            if best.value < most.as_ref().map_or(here.best.value - chance, |most| most.best.value) {
                most = Some(Solved { best, place });
            }
        }
        Ok(most)
    }

    /// Returns whether residuals point to what other sums over rays change, where little but these can explain them: a volume
    /// need not be solved for to tell.
    pub fn is_pointed_to(&self, here: &Solved, at: Resolution) -> Result<bool> {
        let there = self.place(at, here.place.errors)?;
        self.through(&here.place, |problem| {
            self.through(&there, |other| Ok(problem.gain(&here.best, other)? > by_chance(problem)))
        })
    }

    /// Resolutions with finer sums over rays, along them and over pixels. Pixels of images have at most `most` rays along each
    /// side.
    pub fn finer_sums(&self, place: &Place, most: usize) -> Vec<Resolution> {
        let Place { at, seen, .. } = place;
        let mut all = Vec::new();
        let are_open = self.file.screen.samples_per_pixel.is_none();
        if seen.is_images() && are_open && self.file.polarization.is_none() && at.rays < most {
            all.push(Resolution { rays: 2 * at.rays, ..*at });
        }
        if !seen.is_images() && self.measured.pulse == Pulse::Delta {
            let pixels = finer(at.pixels);
            let most = 2 * self.unknown.search.fine.pixels;
            all.extend((pixels <= most).then_some(Resolution { pixels, ..*at }));
        }
        if (at.panels as usize) < MOST {
            all.push(Resolution { panels: 2 * at.panels, ..*at });
        }
        all
    }

    /// The resolution with more voxels, which explain more in any case, where χ² is above its expectation: down to half a pixel,
    /// and none where a prior says what is between them.
    pub fn more_voxels(&self, here: &Solved) -> Result<Option<Resolution>> {
        let Place { at, seen, .. } = &here.place;
        let nodes = finer(at.nodes);
        let (asks, degree) = self.through(&here.place, |problem| {
            let excess = problem.excess(problem.scale * problem.reduced(here.best.chi2));
            Ok((excess > 0.0 && problem.gaussian.is_none(), problem.effort.degree))
        })?;
        let voxels = Voxels::cube(nodes, self.file.region.r_max, degree);
        let is_wide = voxels.shape().spacing[0] >= 0.5 * spacing(&seen.view.file.screen)?;
        Ok((asks && is_wide).then_some(Resolution { nodes, ..*at }))
    }
}
