//! Simulated observations of images and movies.

use crate::call::detached;
use crate::fourier::pulse;
use crate::observation::{Telescope, Visibilities, station};
use crate::refusal::refused;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::Error;
use kerrlight_vlbi::array::{Array, BUILT_IN, built_in, parse};
use kerrlight_vlbi::earth::{Frame, Ut1};
use kerrlight_vlbi::noise::{Corruptions, GainErrors};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{ImageGrid, Method, Pulse};
use kerrlight_vlbi::schedule::{Clock, Schedule, Setup, observe_affordable};
use kerrlight_vlbi::simulate::{Movie, StokesMovie, fill_stokes};
use kerrlight_vlbi::source::Source;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

/// The stations of a built-in array, or of a text in eht-imaging's format.
#[pyfunction]
pub fn array(name: &str, text: Option<&str>) -> PyResult<Vec<Telescope>> {
    let array = match text {
        Some(text) => parse(text).map_err(refused)?,
        None => built_in(name).ok_or_else(|| {
            refused(format!("array {name}: neither {} nor a file", BUILT_IN.join(" nor ")))
        })?,
    };
    Ok(array.stations.iter().map(crate::observation::telescope).collect())
}

/// Plan of an observation: times, array and source.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Plan {
    stations: Vec<Telescope>,
    source: String,
    mjd: i32,
    hours: (f64, f64),
    gmst: bool,
    scans: u32,
    integration: f64,
    frequency_hz: f64,
    bandwidth_hz: f64,
    elevation_deg: [f64; 2],
    of_date: bool,
    ut1_utc: Option<f64>,
    /// Hours of UTC of the images; none: those of the scans.
    frame_hours: Option<Vec<f64>>,
    pulse: String,
    accuracy: Option<f64>,
    scattering: bool,
    /// Station gains: constant, a scan, and whether phases are random.
    gains: (f64, f64, bool),
    thermal: bool,
    seed: u64,
}

impl Plan {
    fn schedule(&self) -> Schedule {
        let (start_h, stop_h) = self.hours;
        let clock = if self.gmst { Clock::Gmst } else { Clock::Utc };
        Schedule { mjd: self.mjd, clock, start_h, stop_h, scans: self.scans }
    }

    fn setup(&self) -> Setup {
        Setup {
            frequency_hz: self.frequency_hz,
            bandwidth_hz: self.bandwidth_hz,
            integration_s: self.integration,
            elevation_deg: self.elevation_deg,
            ut1: self.ut1_utc.map_or(Ut1::Table, Ut1::Given),
            frame: if self.of_date { Frame::OfDate } else { Frame::Catalogue },
        }
    }

    fn observe(
        &self,
        source: &Source,
        movie: &StokesMovie,
        pulse: Pulse,
    ) -> Result<Observation, Error> {
        let array =
            Array::new(self.stations.iter().cloned().map(station).collect::<Result<_, _>>()?)?;
        let (schedule, setup) = (self.schedule(), self.setup());
        let mut observation = observe_affordable(&array, source.position, &schedule, &setup)?;
        observation.source.clone_from(&source.name);
        let hours = match (&self.frame_hours, movie.i.frames()) {
            (Some(hours), _) => hours.clone(),
            // A single image is seen by all scans, whatever its time.
            (None, 1) => vec![0.0],
            (None, _) => schedule.hours_utc(setup.ut1)?,
        };
        let method = self.accuracy.map_or(Method::Direct, Method::Cheaper);
        let transform = fill_stokes(&mut observation, movie, pulse, &hours, method)?;
        self.corruptions().apply(&mut observation, self.seed)?;
        let version = env!("CARGO_PKG_VERSION");
        observation.history = vec![format!("kerrlight {version} observe, from Python"), transform];
        observation.history.extend(self.corruptions().history());
        observation.history.push(if self.thermal { "noise thermal" } else { "noise none" }.into());
        Ok(observation)
    }

    fn corruptions(&self) -> Corruptions {
        let (constant_amplitude, scan_amplitude, random_phases) = self.gains;
        let gains = GainErrors {
            constant_amplitude,
            scan_amplitude,
            random_phases,
            ..GainErrors::default()
        };
        Corruptions { scattering: self.scattering, gains, thermal: self.thermal }
    }
}

/// Observes a movie of images of width × height pixels over a field (µas) with an array: Stokes I, and Q, U and V
/// where they are given.
#[pyfunction]
pub fn observe(
    py: Python<'_>,
    movie: PyReadonlyArray1<'_, f64>,
    polarized: [Option<PyReadonlyArray1<'_, f64>>; 3],
    screen: (usize, usize, f64),
    plan: Plan,
) -> PyResult<Visibilities> {
    let (width, height, field_uas) = screen;
    let grid = ImageGrid::new(width, height, field_uas * MICROARCSECOND).map_err(refused)?;
    let i = Movie { grid, pixels: movie.as_slice()?.to_vec() };
    let mut movie = StokesMovie::from(i);
    for (stokes, given) in movie.polarized.iter_mut().zip(polarized) {
        *stokes = given.map(|given| given.as_slice().map(<[f64]>::to_vec)).transpose()?;
    }
    let source: Source = plan.source.parse().map_err(refused)?;
    let pulse = pulse(&plan.pulse)?;
    let observation = detached(py, || plan.observe(&source, &movie, pulse))?;
    Ok(Visibilities::of(observation))
}
