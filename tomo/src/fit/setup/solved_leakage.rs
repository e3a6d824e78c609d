//! Leakage that a fit solves for in turn with the emission.

use super::leakage::{LeakageUnknown, observing};
use super::{FitData, Result};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::polarimetry::{Leakage, LeakageProblem, LeakageTable, SharedLeakage};

/// Leakage beside a model.
#[derive(Clone, Debug)]
pub struct SolvedLeakage {
    /// Leakage of all stations that observe, with errors.
    pub table: LeakageTable,
    /// The largest change of any d since it was solved for last.
    pub moved: f64,
}

/// Times that gains and leakage are solved for in turn beside one model, at most.
const SWEEPS: usize = 40;
/// Changes of d below this part of what is expected of it end the rounds.
const SETTLED: f64 = 1e-3;
/// Changes of d below this are none.
const STILL: f64 = 1e-9;

impl FitData {
    /// Solves for the leakage beside images of I, Q and U of all frames, with gains where these are free; terms of the loss
    /// see it from now on. None if leakage is not solved for.
    ///
    /// # Errors
    /// If data make no term.
    pub fn solve_leakage(&self, movie: &[f32]) -> Result<Option<SolvedLeakage>> {
        let (Some(unknown), Some((observation, _))) = (&self.leakage, &self.visibilities) else {
            return Ok(None);
        };
        let (seen, before) = (self.beside(movie)?, unknown.shared.get());
        // From none, so that what is found depends on the images alone.
        unknown.shared.set(SharedLeakage::none(observation.stations.len()).get());
        let mut errors = Vec::new();
        for _ in 0..SWEEPS {
            let data = seen.iter().flat_map(|scan| scan.term.beside(&scan.model)).collect();
            let problem = LeakageProblem {
                stations: observation.stations.len(),
                amplitude: unknown.settings.amplitude,
                data,
            };
            let last = unknown.shared.get();
            let found = problem.solve(&last);
            let change = largest_change(&last, &found.leakage);
            unknown.shared.set(found.leakage);
            errors = found.errors;
            // Without gains the data beside the model stay the same: once is enough.
            if self.gains.is_none() || change < STILL {
                break;
            }
        }
        let now = unknown.shared.get();
        let observes = observing(observation);
        let table = LeakageTable::new(&observation.stations, &now, &errors, |k| observes[k]);
        Ok(Some(SolvedLeakage { table, moved: largest_change(&before, &now) }))
    }

    /// Emission and leakage in turn, until no d moves by more than a thousandth of what is expected of it, or as often as
    /// settings say: `images` solves for the emission beside the leakage that was found last and gives I, Q and U of all
    /// frames. `told` hears what each round has found. None if leakage is not solved for; `images` is then called once.
    ///
    /// # Errors
    /// Those of `images`, or if data make no term.
    pub fn in_turn<E: From<crate::Error>>(
        &self,
        mut images: impl FnMut() -> core::result::Result<Vec<f32>, E>,
        mut told: impl FnMut(usize, &SolvedLeakage),
    ) -> core::result::Result<Option<SolvedLeakage>, E> {
        let Some(LeakageUnknown { settings, .. }) = &self.leakage else {
            images()?;
            return Ok(None);
        };
        let mut last = None;
        for round in 1..=settings.rounds {
            let found = self.solve_leakage(&images()?)?;
            found.iter().for_each(|found| told(round, found));
            let settled =
                found.as_ref().is_none_or(|found| found.moved < SETTLED * settings.amplitude);
            last = found;
            if settled {
                break;
            }
        }
        Ok(last)
    }

    /// Takes the leakage of a table as what was found last; stations that it does not have keep theirs.
    pub fn restore_leakage(&self, table: &LeakageTable) {
        if let (Some(unknown), Some((observation, _))) = (&self.leakage, &self.visibilities) {
            let known = unknown.shared.get();
            let of = |(k, station): (usize, &kerrlight_vlbi::array::Station)| {
                table.of(&station.name).unwrap_or(known[k])
            };
            unknown.shared.set(observation.stations.iter().enumerate().map(of).collect());
        }
    }
}

fn largest_change(a: &Leakage, b: &Leakage) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b): (&Complex64, &Complex64)| (a - b).norm()).fold(0.0, f64::max)
}
