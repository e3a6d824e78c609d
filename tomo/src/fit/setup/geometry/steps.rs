//! Steps from the ends of all searches to the best geometry, through voxels, pixels and sums along rays as fine as the data ask
//! for.

use super::detail::{Detail, Detailed, Place, Resolution, Sure, Trial};
use super::posterior::{Looks, polished, surely};
use super::refinement::{MEANS, MOST, Solved};
use crate::fit::geometry::{Estimate, Free, Geometry, Polished, TrialWatch};
use crate::fit::setup::Result;

/// Ends nearer than this part of each parameter's scale are the same place.
const ALIKE: f64 = 0.1;

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
    // Each end may leave out other pixels: sums over different numbers of data do not compare.
    all.iter().min_by(|a, b| a.per_datum.total_cmp(&b.per_datum))
}

fn is_alike(free: &[Free], a: &Geometry, b: &Geometry) -> bool {
    free.iter().all(|Free { parameter, .. }| {
        let apart = parameter.difference(a.get(*parameter), b.get(*parameter));
        apart.abs() < ALIKE * parameter.scale()
    })
}

impl Detail<'_> {
    /// Steps from the ends of all searches, which move to where steps lead, to the best geometry; none if it was cancelled.
    ///
    /// Coarse voxels displace ends, so that the best of them need not lead to the best geometry. Through single rays some pixels
    /// are left out, at first those near the critical curve of each end: values are compared once they are the same for all,
    /// and as fine as the data ask for.
    pub fn steps(
        &self,
        first: Place,
        trials: &mut [Trial],
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Detailed>> {
        let ends: Vec<Geometry> = trials.iter().map(|trial| trial.end).collect();
        let coarse = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
        let Some(coarse) = coarse.map(|trial| trial.end) else { return Ok(None) };
        let place = self.summed(first, coarse)?;
        let Some(near) = self.each(&place, None, &ends, watch)? else { return Ok(None) };
        let Some(best) = lowest(&near).cloned() else { return Ok(None) };
        let from = best.geometry();
        let (place, refined) = self.refined(place, best)?;
        let about = refined.geometry();
        // The best end has gone on to the last resolution; the others follow from where they are.
        let ends = near.iter().map(Stepped::geometry);
        let ends: Vec<Geometry> = ends.map(|end| if end == from { about } else { end }).collect();
        let Some(all) = self.each(&place, Some(&refined), &ends, watch)? else { return Ok(None) };
        for (trial, stepped) in trials.iter_mut().zip(&all) {
            let Stepped { polished, reduced, .. } = stepped;
            trial.end = stepped.geometry();
            trial.value = polished.best.value;
            trial.reduced_chi2 = reduced / place.errors;
            trial.further = polished.further;
        }
        let Some(best) = lowest(&all) else { return Ok(None) };
        // Finer models and steps have left less than what the factor was chosen by.
        let errors = (self.scale)(best.reduced / place.errors);
        let is_same = errors == place.errors;
        let place = Place { errors, ..place };
        let again = match is_same {
            true => None,
            // Values and derivatives of another factor do not compare.
            false => Some(self.stepped(&place, best.geometry(), &best.polished.best)?),
        };
        let sure = self.sure(&place, again.as_ref().unwrap_or(best))?;
        let resolution = Resolution { rays: place.even.unwrap_or(place.at.rays), ..place.at };
        Ok(Some(Detailed { sure, errors, resolution }))
    }

    /// Steps from each geometry, from those that are alike once, without the pixels near the critical curve of the best end or of
    /// each; none if it was cancelled.
    fn each(
        &self,
        place: &Place,
        best: Option<&Stepped>,
        starts: &[Geometry],
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Vec<Stepped>>> {
        // Steps to it have left out the pixels about another one.
        let known = best.filter(|_| !place.seen.is_images());
        let is_alike = |a: &Geometry, b: &Geometry| is_alike(&self.unknown.free, a, b);
        let mut all: Vec<Stepped> = Vec::new();
        for start in starts {
            let known = known.filter(|end| is_alike(&end.geometry(), start));
            let before = starts[..all.len()].iter().position(|other| is_alike(other, start));
            let stepped = match known.or(before.map(|k| &all[k])) {
                Some(end) => end.clone(),
                None => self.stepped_to(place, best.map_or(*start, Stepped::geometry), *start)?,
            };
            all.push(stepped);
            let least = all.iter().map(|end| end.polished.best.value).fold(f64::INFINITY, f64::min);
            if !watch(all.len(), least) {
                return Ok(None);
            }
        }
        Ok(Some(all))
    }

    fn stepped_to(&self, place: &Place, about: Geometry, start: Geometry) -> Result<Stepped> {
        let start = self.smoothly(place, about, |problem| problem.solve(start))?;
        self.stepped(place, about, &start)
    }

    fn stepped(&self, place: &Place, about: Geometry, start: &Estimate) -> Result<Stepped> {
        self.smoothly(place, about, |problem| {
            let (polished, reduced) = polished(problem, start)?;
            let per_datum = problem.reduced(polished.best.value);
            Ok(Stepped { polished, reduced, per_datum })
        })
    }

    /// Sums over rays that are as fine as the data ask for near a geometry: those that are too coarse ripple, and steps end in
    /// the ripples. Where steps through single rays end, the pixels near the critical curve tell samples from means.
    fn summed(&self, place: Place, geometry: Geometry) -> Result<Place> {
        if !self.is_foreign()? {
            return Ok(place);
        }
        let nearer = match place.seen.is_images() {
            true => self.stepped_to(&place, geometry, geometry)?.geometry(),
            false => geometry,
        };
        let mut here = self.solved(place, nearer)?;
        while let Some(there) = self.asked_for(&here, self.finer_sums(&here.place, MEANS))? {
            here = there;
        }
        Ok(here.place)
    }

    /// Returns the resolution that the data ask for, with the even lattice of rays that explains them better than means do, and the
    /// end of steps with it: these follow whenever it has become higher.
    ///
    /// Steps go through means in any case: values through a lattice that stays, of narrow images that move, have ripples in which
    /// these end.
    fn refined(&self, mut place: Place, mut best: Stepped) -> Result<(Place, Stepped)> {
        if !self.is_foreign()? {
            return Ok((place, best));
        }
        loop {
            let Estimate { geometry, x, .. } = &best.polished.best;
            let again = self.through(&place, |problem| problem.solve_from(*geometry, x))?;
            let here = Solved { best: again, place };
            // Whether pixels are means at all was decided where steps began: either model has minima of its own.
            let rays = here.place.at.rays.per_side;
            let even = self.matched(&here)?;
            let most = if rays > 1 && even.is_none() { MOST } else { rays };
            let mut among = self.finer_sums(&here.place, most);
            among.extend(self.more_voxels(&here, even.as_ref())?);
            let there = match self.asked_for(&here, among)? {
                None if even.is_none() => self.ringed(&here)?,
                there => there,
            };
            let Some(there) = there else {
                let even = even.map(|even| even.place.at.rays);
                return Ok((Place { even, ..here.place }, best));
            };
            best = self.stepped(&there.place, *geometry, &there.best)?;
            place = there.place;
        }
    }

    /// Returns the errors of the best geometry, with those that the model has of itself.
    fn sure(&self, place: &Place, best: &Stepped) -> Result<Sure> {
        let resampled = Some((&place.seen, self.unknown, &place.view));
        let looks = Looks { resampled, shares_rays: self.shares_rays(place) };
        let sure = self.smoothly(place, best.geometry(), |problem| {
            // Pixels of images that count are now those about this geometry.
            let moved = place.seen.is_images().then(|| polished(problem, &best.polished.best));
            let (polished, reduced) = match moved.transpose()? {
                Some(polished) => polished,
                None => (best.polished.clone(), best.reduced),
            };
            surely(problem, looks, &polished, reduced)
        })?;
        let sure = self.beside_its_own(place, sure)?;
        match place.even {
            Some(rays) => {
                self.moved(self.place(Resolution { rays, ..place.at }, place.errors)?, sure)
            }
            None => Ok(sure),
        }
    }

    /// Goes on to where steps through the rays of the data lead: how far that is from the end through means is part of the errors.
    fn moved(&self, place: Place, sure: Sure) -> Result<Sure> {
        let (polished, reduced_chi2) = self.through(&place, |problem| {
            let start = problem.solve(sure.geometry)?;
            polished(problem, &start)
        })?;
        let geometry = polished.best.geometry;
        let spread =
            sure.spread.map(|spread| spread.moved(&self.unknown.free, geometry, "rays of pixels"));
        Ok(Sure { geometry, spread, reduced_chi2 })
    }
}
