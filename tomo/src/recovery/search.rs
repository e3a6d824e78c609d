//! Searches that come before the emission: the geometry, a band, a rotation of position angles, a weight.

use super::found::{Choice, Found, Searched, Stage};
use super::progress::{At, Progress};
use super::{Problem, Stopped};
use crate::Error;
use crate::fit::geometry::Geometry;
use crate::fit::settings::{FitFile, UnknownGeometry};
use crate::fit::setup::{self, BandScan, FitData, FoundGeometry, Instrument, RaySampling};
use crate::fit::{Motion, Objective};
use kerrlight_render::dynamics::Axis;
use std::sync::{Mutex, PoisonError};

/// Settings, rays, motion and data in the geometry that was found.
pub struct ResolvedFit {
    /// Settings with what was found in place of what was assumed.
    pub file: FitFile,
    /// Rays.
    pub instrument: Instrument,
    /// Motion.
    pub motion: Motion,
    /// The data, where they are not those that were read.
    pub measured: Option<FitData>,
}

impl ResolvedFit {
    /// Puts the problem in a geometry, seen through these rays.
    ///
    /// # Errors
    /// If the geometry is out of range.
    pub fn in_geometry(
        problem: &Problem,
        file: &FitFile,
        geometry: &Geometry,
        rays: RaySampling,
    ) -> Result<Self, Error> {
        let Problem { instrument, measured, .. } = problem;
        let (instrument, motion) = setup::in_geometry(file, instrument, measured, geometry, rays)?;
        let file = setup::through(settled(file, geometry), rays);
        Ok(Self { file, instrument, motion, measured: None })
    }

    fn of(problem: &Problem, choice: &Choice) -> Result<Option<Self>, Error> {
        let Problem { settings, measured, .. } = problem;
        let placed = match choice {
            Choice::Geometry { geometry, resolution } => {
                let file = resolution.refined(settings.clone());
                Self::in_geometry(problem, &file, geometry, resolution.rays)?
            }
            Choice::Band { inclination_deg, position_angle_deg, rotation_factor, background } => {
                let file = setup::in_band_geometry(settings, *inclination_deg, *position_angle_deg);
                let motion = setup::band_motion(&file, measured, *rotation_factor)?;
                let instrument = Instrument::new(&file)?;
                let measured = background.as_ref().map(|values| measured.before(values.clone()));
                Self { file, instrument, motion, measured }
            }
            Choice::Weight(_) => return Ok(None),
        };
        Ok(Some(placed))
    }
}

/// Looks for what of the geometry is not known; none if all of it is.
pub(super) fn placed(
    problem: &Problem,
    progress: &mut dyn Progress,
) -> Result<Option<(ResolvedFit, Option<Searched>)>, Error> {
    let settings = &problem.settings;
    let unknown = settings.unknown_geometry()?;
    let stage = match (&unknown, &settings.band) {
        (Some(_), _) => Stage::Geometry,
        (None, Some(_)) => Stage::Band,
        _ => return Ok(None),
    };
    let (choice, searched) = match (progress.chosen(stage)?, stage, &unknown) {
        (Some(choice), ..) => (choice, None),
        (None, Stage::Geometry, Some(unknown)) => {
            let found = geometry(problem, unknown, progress)?;
            // The fit goes on with what is kept, not with what was found: a resumed fit then has
            // the same bits.
            let choice = progress.keep(&Found::Geometry(problem, unknown, &found))?;
            (choice, Some(Searched::Geometry(Box::new(found))))
        }
        _ => {
            let found = band(problem, progress)?;
            (progress.keep(&Found::Band(problem, &found))?, Some(Searched::Band(found)))
        }
    };
    Ok(ResolvedFit::of(problem, &choice)?.map(|placed| (placed, searched)))
}

fn geometry(
    problem: &Problem,
    unknown: &UnknownGeometry,
    progress: &mut dyn Progress,
) -> Result<FoundGeometry, Error> {
    let journal = progress.journal()?;
    let mut watch = |(search, of): (usize, usize), trials: usize, least: f64| {
        progress.goes_on(At::Geometry { search, of, trials, least })
    };
    let Problem { settings, measured, .. } = problem;
    let found = setup::find_geometry(settings, measured, unknown, &*journal, &mut watch)
        .map_err(|error| error.while_in("search"))?;
    Ok(found.ok_or(Stopped::Kept)?)
}

fn band(problem: &Problem, progress: &mut dyn Progress) -> Result<BandScan, Error> {
    let Problem { settings, measured, .. } = problem;
    let Some(band) = &settings.band else { return Err(Stopped::Kept.into()) };
    let journal = progress.journal()?;
    // Geometries are weighed by several threads, each of which tells.
    let told = Mutex::new(&mut *progress);
    let watch =
        |done: usize| told.lock().unwrap_or_else(PoisonError::into_inner).goes_on(At::Band(done));
    let scan = setup::scan_band(settings, measured, band, &*journal, &watch)
        .map_err(|error| error.while_in("band"))?;
    Ok(scan.ok_or(Stopped::Kept)?)
}

/// The settings with the weight that held-out data choose.
pub(super) fn weighed(
    file: &FitFile,
    objective: &mut Objective<f32>,
    axis: Axis,
    times: [f64; 2],
    progress: &mut dyn Progress,
) -> Result<FitFile, Error> {
    let Some(settings) = &file.held_out else { return Ok(file.clone()) };
    let choice = match progress.chosen(Stage::Weight)? {
        Some(choice) => choice,
        None => {
            let journal = progress.journal()?;
            let mut watch = |value: usize, fold: usize| progress.goes_on(At::HeldOut(value, fold));
            let journal = &*journal;
            let held = setup::hold_out(file, settings, objective, axis, times, journal, &mut watch)
                .map_err(|error| error.while_in("held_out"))?;
            progress.keep(&Found::Weight(file, &held.ok_or(Stopped::Kept)?))?
        }
    };
    Ok(match choice {
        Choice::Weight(chosen) => settings.setting.put(file.clone(), chosen),
        _ => file.clone(),
    })
}

/// The settings with what was found in place of priors.
pub fn settled(file: &FitFile, geometry: &Geometry) -> FitFile {
    let mut file = file.clone();
    for (parameter, _, quantity) in file.quantities_mut() {
        if quantity.prior().is_some() {
            *quantity = (geometry.get(parameter) / parameter.unit()).into();
        }
    }
    // A search is refused where nothing has a prior.
    file.search = None;
    file
}
