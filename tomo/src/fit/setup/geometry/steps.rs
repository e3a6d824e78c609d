//! Steps from the ends of all searches to the best geometry, through voxels, pixels and sums along rays as fine as the data ask
//! for.

use super::detail::{Detail, Detailed, Resolution, Sure, Trial};
use super::posterior::{Resampled, polished, surely};
use super::search_data::SearchData;
use crate::fit::geometry::{Free, Geometry, GeometryProblem, Polished, TrialWatch};
use crate::fit::linear::Voxels;
use crate::fit::settings::SearchView;
use crate::fit::setup::{Result, spacing};
use kerrlight_vlbi::operator::Pulse;

/// Voxels, and pixels of visibilities, of a finer model over those of a search, along each side.
const FINER: f64 = 1.5;
/// Rays along each side of a pixel, and panels, at most.
const MOST: usize = 4;
/// Ends nearer than this part of each parameter's scale are the same place.
const ALIKE: f64 = 0.1;

/// Data at a resolution.
pub(super) struct Place {
    pub seen: SearchData,
    pub at: Resolution,
    pub view: SearchView,
    /// Factor of χ².
    pub errors: f64,
}

/// Parts of a model that become finer.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Parts {
    /// Sums over rays: along them and over pixels.
    Sums,
    /// Sums over rays, and voxels.
    All,
}

/// End of steps from a geometry.
#[derive(Clone)]
struct Stepped {
    polished: Polished,
    /// χ²/N times what χ² is multiplied by.
    reduced: f64,
    /// −ln of the density over the number of data.
    per_datum: f64,
}

impl Stepped {
    fn geometry(&self) -> Geometry {
        self.polished.best.geometry
    }
}

fn lowest(all: &[Stepped]) -> Option<&Stepped> {
    all.iter().min_by(|a, b| a.per_datum.total_cmp(&b.per_datum))
}

fn is_alike(free: &[Free], a: &Geometry, b: &Geometry) -> bool {
    free.iter().all(|Free { parameter, .. }| {
        let apart = parameter.difference(a.get(*parameter), b.get(*parameter));
        apart.abs() < ALIKE * parameter.scale()
    })
}

pub(super) fn finer(count: usize) -> usize {
    (FINER * count as f64).round() as usize
}

impl Detail<'_> {
    /// Steps from the ends of all searches, which move to where steps lead, to the best geometry; none if it was cancelled.
    ///
    /// Coarse voxels displace ends, so that the best of them need not lead to the best geometry. Pixels of images are samples
    /// or means: steps are taken with both. Some pixels are left out, at first those near the critical curve of each end:
    /// values are compared once they are the same for all, and as fine as the data ask for.
    pub fn steps(
        &self,
        first: Place,
        trials: &mut [Trial],
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Detailed>> {
        let ends: Vec<Geometry> = trials.iter().map(|trial| trial.end).collect();
        let coarse = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
        let Some(coarse) = coarse.map(|trial| trial.end) else { return Ok(None) };
        let first = self.summed(first, coarse)?;
        let Some(near) = self.each(&first, None, &ends, watch)? else { return Ok(None) };
        let mut best = (first, near);
        if self.may_be_means(&best.0)? {
            let place = self.place(Resolution { rays: 2, ..best.0.at }, best.0.errors)?;
            let Some(near) = self.each(&place, None, &ends, watch)? else { return Ok(None) };
            let least = |all: &[Stepped]| lowest(all).map_or(f64::INFINITY, |end| end.per_datum);
            if least(&near) < least(&best.1) {
                best = (place, near);
            }
        }
        let (place, near) = best;
        let Some(best) = lowest(&near).cloned() else { return Ok(None) };
        let (place, about) = self.refined(place, best)?;
        let ends: Vec<Geometry> = near.iter().map(Stepped::geometry).collect();
        let Some(all) = self.each(&place, Some(about), &ends, watch)? else { return Ok(None) };
        for (trial, stepped) in trials.iter_mut().zip(&all) {
            let Stepped { polished, reduced, .. } = stepped;
            trial.end = stepped.geometry();
            trial.value = polished.best.value;
            trial.reduced_chi2 = reduced / place.errors;
            trial.further = polished.further;
        }
        let Some(best) = lowest(&all) else { return Ok(None) };
        let errors = (self.scale)(best.reduced / place.errors);
        let place = Place { errors, ..place };
        let sure = self.sure(&place, best)?;
        Ok(Some(Detailed { sure, errors, resolution: place.at }))
    }

    /// Returns whether pixels may be means over several rays: those of images that another model has made.
    fn may_be_means(&self, place: &Place) -> Result<bool> {
        let is_plain = self.file.polarization.is_none();
        Ok(place.seen.is_images() && is_plain && !self.are_rays_known() && self.is_foreign()?)
    }

    /// Returns whether settings say how many rays a pixel has.
    fn are_rays_known(&self) -> bool {
        self.file.screen.samples_per_pixel.is_some()
    }

    /// Steps from each geometry, from those that are alike once, without the pixels near the critical curve of a geometry or of
    /// each; none if it was cancelled.
    fn each(
        &self,
        place: &Place,
        about: Option<Geometry>,
        starts: &[Geometry],
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Vec<Stepped>>> {
        let mut all: Vec<Stepped> = Vec::new();
        for start in starts {
            let mut before = starts[..all.len()].iter();
            let stepped = match before.position(|other| is_alike(&self.unknown.free, other, start))
            {
                Some(k) => all[k].clone(),
                None => self.stepped(place, about.unwrap_or(*start), *start)?,
            };
            all.push(stepped);
            let least = all.iter().map(|end| end.polished.best.value).fold(f64::INFINITY, f64::min);
            if !watch(all.len(), least) {
                return Ok(None);
            }
        }
        Ok(Some(all))
    }

    fn stepped(&self, place: &Place, about: Geometry, start: Geometry) -> Result<Stepped> {
        self.smoothly(place, about, |problem| {
            let (polished, reduced) = polished(problem, &problem.solve(start)?)?;
            let per_datum = problem.reduced(polished.best.value);
            Ok(Stepped { polished, reduced, per_datum })
        })
    }

    /// Sums over rays that are as fine as visibilities ask for in a geometry: those that are too coarse ripple, and steps end in
    /// the ripples.
    fn summed(&self, mut place: Place, geometry: Geometry) -> Result<Place> {
        if place.seen.is_images() || !self.is_foreign()? {
            return Ok(place);
        }
        while let Some(there) = self.higher(&place, geometry, Parts::Sums)? {
            place = there;
        }
        Ok(place)
    }

    /// Returns the resolution that the data ask for, and the geometry that steps lead to with it: these follow whenever it has
    /// become higher.
    fn refined(&self, mut place: Place, best: Stepped) -> Result<(Place, Geometry)> {
        let mut geometry = best.geometry();
        if !self.is_foreign()? {
            return Ok((place, geometry));
        }
        while let Some(there) = self.higher(&place, geometry, Parts::All)? {
            geometry = self.stepped(&there, geometry, geometry)?.geometry();
            place = there;
        }
        Ok((place, geometry))
    }

    /// The resolution, higher in one of its parts, that explains most, if that is more than chance does: what lowers χ²/2 by more
    /// than its standard deviation. More voxels explain more in any case, and count where χ² asks for them.
    fn higher(&self, place: &Place, geometry: Geometry, parts: Parts) -> Result<Option<Place>> {
        let (value, chance, voxels) = self.smoothly(place, geometry, |problem| {
            let here = problem.solve(geometry)?;
            let chance = (0.5 * problem.data()).sqrt();
            let asks = problem.excess(problem.scale * problem.reduced(here.chi2)) > 0.0;
            let voxels = self.more_voxels(place, problem)?;
            Ok((here.value, chance, voxels.filter(|_| asks && parts == Parts::All)))
        })?;
        let mut most: Option<(f64, Place)> = None;
        // Whether pixels are means at all was decided where steps began: either model has minima of its own.
        for at in self.finer_sums(place, place.at.rays > 1).into_iter().chain(voxels) {
            let there = self.place(at, place.errors)?;
            let gain = value - self.smoothly(&there, geometry, |p| Ok(p.solve(geometry)?.value))?;
            eprintln!("{:?} gain {gain}", there.at);
            if gain > most.as_ref().map_or(chance, |(most, _)| *most) {
                most = Some((gain, there));
            }
        }
        Ok(most.map(|(_, there)| there))
    }

    /// Resolutions with finer sums over rays, along them and over pixels.
    pub fn finer_sums(&self, place: &Place, may_be_means: bool) -> Vec<Resolution> {
        let Place { at, seen, .. } = place;
        let mut all = Vec::new();
        if seen.is_images() && !self.are_rays_known() && may_be_means && at.rays < MOST {
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

    /// The resolution with more voxels, down to half a pixel; none where a prior says what is between them.
    fn more_voxels(
        &self,
        place: &Place,
        problem: &GeometryProblem<'_, f32>,
    ) -> Result<Option<Resolution>> {
        let nodes = finer(place.at.nodes);
        let voxels = Voxels::cube(nodes, self.file.region.r_max, problem.effort.degree);
        let is_wide = voxels.shape().spacing[0] >= 0.5 * spacing(&place.seen.view.file.screen)?;
        let is_free = problem.gaussian.is_none();
        Ok((is_free && is_wide).then_some(Resolution { nodes, ..place.at }))
    }

    /// Returns the errors of the best geometry, with those that the model has of itself.
    fn sure(&self, place: &Place, best: &Stepped) -> Result<Sure> {
        let resampled: Resampled<'_> = Some((&place.seen, self.unknown, &place.view));
        let about = best.geometry();
        let sure = self.smoothly(place, about, |problem| {
            let (polished, reduced) = polished(problem, &best.polished.best)?;
            surely(problem, resampled, &polished, reduced)
        })?;
        self.beside_its_own(place, sure)
    }
}
