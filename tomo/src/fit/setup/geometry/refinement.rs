//! Models as fine as data of another program ask for: more voxels, rays of a pixel, pixels, and panels of a ray.

use super::detail::{Detail, Place, RaySampling, Resolution};
use super::search_data::SearchData;
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
/// Rays along each side of a pixel of another program, at most.
const MOST_EVEN: usize = 8;
/// Decrease of χ²/2 by four standard deviations of the noise along one direction: more than chance, between models with as many
/// unknowns.
const CLEAR: f64 = 8.0;

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
pub(super) fn by_chance(problem: &GeometryProblem<'_, f32>) -> f64 {
    (0.5 * problem.data()).sqrt()
}

impl Detail<'_> {
    /// The best volume of a geometry.
    pub fn solved(&self, place: Place, geometry: Geometry) -> Result<Solved> {
        let best = self.through(&place, |problem| {
            let first = problem.solve(geometry)?;
            // Once more from its own end, where the finer models begin that it is compared with.
            problem.solve_from(geometry, &first.x)
        })?;
        Ok(Solved { best, place })
    }

    /// The resolution that explains most among some, if that is more than chance does. Pixels near the critical curve, which
    /// ask for many rays, are compared as well: the geometry stays.
    pub fn asked_for(&self, here: &Solved, among: Vec<Resolution>) -> Result<Option<Solved>> {
        let chance = self.through(&here.place, |problem| Ok(by_chance(problem)))?;
        self.lowest(here, among, chance)
    }

    /// The resolution that explains most among some, if χ²/2 becomes lower by more than `chance`.
    fn lowest(&self, here: &Solved, among: Vec<Resolution>, chance: f64) -> Result<Option<Solved>> {
        let (geometry, errors) = (here.best.geometry, here.place.errors);
        let voxels = self.through(&here.place, |problem| Ok(problem.voxels()))?;
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

    /// The resolutions to whose sums over rays residuals point, by a gain of more than `chance`, where little but these can explain
    /// them: a volume need not be solved for to tell.
    pub fn pointed_to(
        &self,
        here: &Solved,
        mut among: Vec<Resolution>,
        chance: impl Fn(&GeometryProblem<'_, f32>) -> f64,
    ) -> Result<Vec<Resolution>> {
        let is_pointed_to = |at: &Resolution| {
            let there = self.place(*at, here.place.errors)?;
            self.through(&here.place, |problem| {
                self.through(&there, |other| Ok(problem.gain(&here.best, other)? > chance(problem)))
            })
        };
        let pointed_to = among.iter().map(is_pointed_to).collect::<Result<Vec<bool>>>()?;
        let mut each = pointed_to.into_iter();
        among.retain(|_| each.next() == Some(true));
        Ok(among)
    }

    /// The even lattice of rays, the same in all pixels, through which another program has computed images; none where means
    /// over pixels explain these as well.
    pub fn matched(&self, here: &Solved) -> Result<Option<Solved>> {
        let Place { at, seen, .. } = &here.place;
        let is_said = self.file.screen.ring_rays.is_some();
        if !self.has_open_rays(seen) || at.rays.ring.is_none() || is_said {
            return Ok(None);
        }
        let even = |per_side| RaySampling { per_side, ring: None, ..at.rays };
        let all = (MEANS..=MOST_EVEN).map(|n| Resolution { rays: even(n), ..*at });
        let among = self.pointed_to(here, all.collect(), |_| CLEAR)?;
        self.lowest(here, among, CLEAR)
    }

    /// Four times as many rays in each pixel near the critical curve, where residuals point to them and χ²/2 becomes clearly lower: as many
    /// unknowns explain more. Too few make ripples there, in which steps end and intervals miss the truth.
    pub fn ringed(&self, here: &Solved) -> Result<Option<Solved>> {
        let Place { at, seen, .. } = &here.place;
        let is_open = self.has_open_rays(seen) && self.file.screen.ring_rays.is_none();
        let Some(rays) = at.rays.grown().filter(|_| is_open) else { return Ok(None) };
        let among = self.pointed_to(here, vec![Resolution { rays, ..*at }], |_| CLEAR)?;
        self.lowest(here, among, CLEAR)
    }

    /// Returns whether the data are images and nobody has said which rays their pixels have.
    fn has_open_rays(&self, seen: &SearchData) -> bool {
        let screen = &self.file.screen;
        seen.is_images() && screen.samples_per_pixel.is_none() && self.file.polarization.is_none()
    }

    /// Resolutions with finer sums over rays, along them and over pixels. Pixels of images have at most `most` rays along each
    /// side.
    pub fn finer_sums(&self, place: &Place, most: usize) -> Vec<Resolution> {
        let Place { at, seen, .. } = place;
        let mut all = Vec::new();
        if self.has_open_rays(seen) && at.rays.per_side < most {
            all.push(Resolution { rays: at.rays.denser(), ..*at });
        }
        if !seen.is_images() && self.measured.pulse == Pulse::Delta {
            let pixels = finer(at.pixels);
            let most = 2 * self.unknown.search.fine.pixels;
            all.extend((pixels <= most).then_some(Resolution { pixels, ..*at }));
        }
        if (at.rays.panels as usize) < MOST {
            let rays = RaySampling { panels: 2 * at.rays.panels, ..at.rays };
            all.push(Resolution { rays, ..*at });
        }
        all
    }

    /// The resolution with more voxels, which explain more in any case, where χ² is above its expectation: down to half a pixel,
    /// and none where a prior says what is between them, or `even` rays explain the data.
    pub fn more_voxels(&self, here: &Solved, even: Option<&Solved>) -> Result<Option<Resolution>> {
        let Place { at, seen, .. } = &here.place;
        let nodes = finer(at.nodes);
        let of = even.unwrap_or(here);
        let reduced = self.through(&of.place, |problem| problem.left(&of.best))?;
        let (asks, degree) = self.through(&here.place, |problem| {
            let excess = problem.excess(problem.scale * reduced);
            Ok((excess > 0.0 && problem.gaussian.is_none(), problem.effort.degree))
        })?;
        let voxels = Voxels::cube(nodes, self.file.region.r_max, degree);
        // Of thinned images the distance between the pixels that are seen.
        let apart = spacing(&self.file.screen)? * self.file.screen.pixels as f64
            / seen.view.file.screen.pixels as f64;
        let is_wide = voxels.shape().spacing[0] >= 0.5 * apart;
        Ok((asks && is_wide).then_some(Resolution { nodes, ..*at }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::journal::{Forgetful, Memory};
    use crate::fit::settings::{
        FitFile, GeometrySearch, Hole, Kind, SearchView, Spot, Truth, UnknownGeometry,
    };
    use crate::fit::setup::geometry::known_geometry;
    use crate::fit::setup::{FitData, Instrument};

    /// Returns the rays along each side of a pixel that are told from means, of images through so many.
    fn told(per_side: usize) -> Option<usize> {
        let spot = Spot { center: [4.5, 0.0, 0.0], sigma: 1.2, amplitude: 1.0, ..Spot::default() };
        let truth = Truth { spot: vec![spot], ..Truth::default() };
        let mut file = FitFile::new(Hole::new(0.6), 50.0, [2.0, 9.0], Kind::LinearGrid)
            .simulating(truth, 4, 0.0, 40.0, 1e-3);
        file.screen.pixels = 16;
        let mut seen = file.clone();
        seen.screen.samples_per_pixel = Some(per_side * per_side);
        let instrument = Instrument::new(&seen).unwrap();
        let measured = FitData::simulated(&seen, &instrument, None).unwrap();
        let fine = SearchView { trials: 1, nodes: 24, iterations: 60, pixels: 16, frames: 4 };
        let search = GeometrySearch { fine, ..GeometrySearch::default() };
        let detail = Detail {
            file: &file,
            measured: &measured,
            unknown: &UnknownGeometry { free: Vec::new(), search },
            memory: Memory::new(&Forgetful),
            scale: &|_| 1.0,
        };
        let first = detail.first(1.0).unwrap();
        let means = Resolution { rays: first.at.rays.denser(), ..first.at };
        let here = detail.solved(detail.place(means, 1.0).unwrap(), known_geometry(&file)).unwrap();
        let matched = detail.matched(&here).unwrap();
        matched.map(|there| there.place.at.rays.per_side)
    }

    /// Pixels near the critical curve have 16, 64 and 256 rays, no more, and none of their own among samples.
    #[test]
    fn exact_rays_of_the_ring_grow() {
        let means = RaySampling::default().denser();
        let all: Vec<_> = core::iter::successors(Some(means), |rays| rays.grown()).collect();
        assert_eq!(all.iter().map(|rays| rays.ring).collect::<Vec<_>>(), [16, 64, 256].map(Some));
        assert!(RaySampling::default().ringed().is_none());
    }

    /// Images of another program through an even lattice are told from means by the pixels that the photon ring crosses.
    #[test]
    fn exact_rays_of_another_program_are_told() {
        assert_eq!([2, 3, 5].map(told), [Some(2), Some(3), Some(5)]);
    }
}
