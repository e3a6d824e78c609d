//! Problem of a fit: settings with their data.

use crate::Error;
use crate::fit::settings::{AxisSearch, FitFile, refuse};
use crate::fit::setup::{self, FitData, Instrument, RaySampling};
use crate::fit::{Motion, Objective};
use crate::representation::Registry;
use kerrlight_vlbi::array::Array;
use kerrlight_vlbi::light_curve::LightCurve;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::ImageGrid;
use kerrlight_vlbi::simulate::Movie;

/// A fit with its data: all that can be found wrong is, before anything is computed for long.
pub struct Problem {
    /// Settings.
    pub settings: FitFile,
    /// Representations beside kerrlight's own.
    pub registry: Registry,
    /// Rays.
    pub instrument: Instrument,
    /// Data.
    pub measured: FitData,
    /// Motion.
    pub motion: Motion,
    /// Rays that were chosen because the data ask for them.
    pub rays: Option<RaySampling>,
}

impl Problem {
    /// Simulates the data: what `settings.simulation` says, seen by `array` where there is an observation.
    ///
    /// # Errors
    /// If settings are missing, out of range or contradict each other.
    pub fn simulated(settings: FitFile, array: Option<&Array>) -> Result<Self, Error> {
        Self::new(settings, Registry::new(), |settings, instrument| {
            FitData::simulated(settings, instrument, array)
        })
    }

    /// Takes measured visibilities, whose preparation `settings.data` describes.
    ///
    /// # Errors
    /// As [`Problem::simulated`], and if visibilities lack errors, mass or distance.
    pub fn of_visibilities(settings: FitFile, observation: Observation) -> Result<Self, Error> {
        Self::new(settings, Registry::new(), |settings, _| {
            FitData::of_visibilities(settings, observation, "the observation")
        })
    }

    /// Takes images in Jy/pixel, rows from the top.
    ///
    /// # Errors
    /// As [`Problem::simulated`], and if there are other pixels than the settings say, on another field of the sky.
    pub fn of_movie(settings: FitFile, movie: Movie) -> Result<Self, Error> {
        Self::new(settings, Registry::new(), |settings, _| {
            let Movie { grid, pixels } = movie;
            check_grid(settings, grid, pixels.len())?;
            let frames = kerrlight_common::frames::Frames::of(pixels, grid.pixels());
            FitData::of_movie(settings, frames, [grid.width, grid.height], "the movie")
        })
    }

    /// Takes the light curve of an unresolved source, which `settings.data` describes.
    ///
    /// # Errors
    /// As [`Problem::simulated`], and if a Stokes parameter or an error is missing.
    pub fn of_light_curve(settings: FitFile, curve: LightCurve) -> Result<Self, Error> {
        Self::new(settings, Registry::new(), |settings, _| {
            FitData::of_light_curve(settings, curve, "the light curve")
        })
    }

    /// Checks settings, traces rays and takes the data that `measure` makes.
    ///
    /// # Errors
    /// If settings are missing, out of range or contradict each other or the data; and those of `measure`.
    pub fn new<E: From<Error>>(
        settings: FitFile,
        registry: Registry,
        measure: impl FnOnce(&FitFile, &Instrument) -> Result<FitData, E>,
    ) -> Result<Self, E> {
        settings.check_ranges().map_err(Error::from)?;
        setup::check_memory_budget(&settings, &registry)?;
        setup::check(&settings, &registry)?;
        let instrument = Instrument::new(&settings)?;
        FitData::check_origin(&settings)?;
        let measured = measure(&settings, &instrument)?;
        let motion = setup::motion(&settings, measured.times.clone())?;
        let mut problem = Self { settings, registry, instrument, measured, motion, rays: None };
        problem.check()?;
        // After all checks: choosing rays takes the solution of linear problems.
        problem.resolve()?;
        Ok(problem)
    }

    /// Takes as many rays as data of another program ask for.
    fn resolve(&mut self) -> Result<(), Error> {
        let rays = setup::rays_of_data(&self.settings, &self.measured)?;
        self.rays = rays.filter(|rays| *rays != RaySampling::default());
        if let Some(rays) = self.rays {
            self.settings = setup::through(self.settings.clone(), rays);
            self.instrument = Instrument::new(&self.settings)?;
        }
        Ok(())
    }

    /// Refuses what settings and data do not allow together.
    fn check(&self) -> Result<(), Error> {
        let Self { settings, registry, instrument, measured, motion, .. } = self;
        if let Some(band) = &settings.band {
            setup::check_band(settings, measured, band)?;
        }
        // Times at which emission may change are those of the rays.
        setup::representation(settings, registry, setup::emission_times(instrument, motion))?;
        if settings.unknown_geometry()?.is_some() {
            let geometry = setup::known_geometry(settings);
            setup::in_geometry(settings, instrument, measured, &geometry, RaySampling::default())?;
        }
        let seen = self.objective(instrument, motion, measured)?.observed().len();
        if let Some(held_out) = &settings.held_out {
            setup::check_folds(held_out, seen)?;
        }
        if matches!(settings.axis, AxisSearch::Scan(_)) && seen < 2 {
            refuse!(
                "axis.scan needs at least 2 frame times: a single frame does not constrain the axis"
            );
        }
        Ok(())
    }

    /// Returns the objective, seen through these rays.
    ///
    /// # Errors
    /// If a loss needs data that are not there.
    pub fn objective(
        &self,
        instrument: &Instrument,
        motion: &Motion,
        measured: &FitData,
    ) -> Result<Objective<f32>, Error> {
        let pixels = self.settings.screen.pixels * self.settings.screen.pixels;
        let data = measured.terms(&self.settings.loss, pixels)?;
        Ok(Objective { model: instrument.forward(motion)?, data })
    }
}
/// Refuses a movie that is no whole images, or of another field than that of the settings.
fn check_grid(settings: &FitFile, grid: ImageGrid, numbers: usize) -> Result<(), Error> {
    if grid.pixels() == 0 || numbers == 0 || !numbers.is_multiple_of(grid.pixels()) {
        refuse!("the movie has {numbers} numbers: no images of {} x {}", grid.width, grid.height);
    }
    setup::check_field(settings, grid, "the movie")
}
