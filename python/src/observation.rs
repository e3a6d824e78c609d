//! Observations: files to columns, columns to files, closure quantities.

use crate::call::detached;
use crate::refusal::refused;
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::Error;
use kerrlight_vlbi::array::{FeedRotation, MOST_STATIONS, Station, check_position};
use kerrlight_vlbi::earth::{self, SourcePosition, Ut1};
use kerrlight_vlbi::files::{EhtTable, decode, to_csv, to_eht_table, to_obs_text, write_uvfits};
use kerrlight_vlbi::observation::{Averaging, Basis, Channel, Observation, Row};
use kerrlight_vlbi::products::{ClosureCount, ClosureKind, ClosureSet};
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::convert::Infallible;

/// Hours of UTC since 0 h of a day, of hours of Greenwich mean sidereal time of which `first` is the first one.
#[pyfunction]
pub fn hours_utc_of_gmst<'py>(
    py: Python<'py>,
    mjd: i32,
    hours: PyReadonlyArray1<'py, f64>,
    first: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let utc = |hour: &f64| earth::hours_utc_of_gmst(mjd, *hour, first, Ut1::Table);
    let all: Result<Vec<f64>, Error> = hours.as_slice()?.iter().map(utc).collect();
    Ok(all.map_err(refused)?.into_pyarray(py).into_any())
}

/// An observation.
#[pyclass(frozen, module = "kerrlight._core")]
pub struct Visibilities {
    observation: Observation,
}

/// Name, position (metres), SEFDs (Jy), feed rotation (parallactic, elevation, offset in degrees) and leakage of a
/// telescope.
pub type Telescope = (String, Option<[f64; 3]>, [f64; 2], [f64; 3], [Complex64; 2]);

/// Metadata of an observation, beside its rows.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Metadata {
    source: String,
    /// Right ascension (hours) and declination (degrees).
    position: Option<(f64, f64)>,
    mjd: Option<i32>,
    frequency_hz: Option<f64>,
    bandwidth_hz: Option<f64>,
    /// Frequency and bandwidth of each.
    channels: Vec<(f64, f64)>,
    circular: bool,
    stations: Vec<Telescope>,
    history: Vec<String>,
}

/// Columns of rows; those with several numbers a row are flat.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Columns<'py> {
    time: PyReadonlyArray1<'py, f64>,
    integration: PyReadonlyArray1<'py, f64>,
    stations: PyReadonlyArray1<'py, i64>,
    uv: PyReadonlyArray1<'py, f64>,
    products: PyReadonlyArray1<'py, Complex64>,
    sigmas: PyReadonlyArray1<'py, f64>,
    opacity: PyReadonlyArray1<'py, f64>,
    channel: PyReadonlyArray1<'py, i64>,
}

impl Metadata {
    fn observation(self) -> PyResult<Observation> {
        if self.stations.len() > MOST_STATIONS {
            return Err(refused(format!("more than {MOST_STATIONS} stations")));
        }
        let place = |(ra, dec)| SourcePosition::new(ra, dec).map_err(refused);
        let channel = |(frequency_hz, bandwidth_hz): &(f64, f64)| Channel {
            frequency_hz: *frequency_hz,
            bandwidth_hz: *bandwidth_hz,
        };
        Ok(Observation {
            source: self.source,
            position: self.position.map(place).transpose()?,
            mjd: self.mjd,
            frequency_hz: self.frequency_hz,
            bandwidth_hz: self.bandwidth_hz,
            channels: self.channels.iter().map(channel).collect(),
            basis: if self.circular { Basis::Circular } else { Basis::Stokes },
            stations: self
                .stations
                .into_iter()
                .map(station)
                .collect::<Result<_, _>>()
                .map_err(refused)?,
            rows: Vec::new(),
            history: self.history,
        })
    }
}

/// The station with these numbers, whose position is one in metres.
pub fn station((name, position, sefd, feed, leakage): Telescope) -> Result<Station, Error> {
    check_position(&name, position.unwrap_or_default())?;
    let feed_rotation = FeedRotation::told(feed);
    // The centre of the Earth is what tables have of a station whose position nobody told.
    let position = position.filter(|place| *place != [0.0; 3]);
    Ok(Station { position, sefd, feed_rotation, leakage, ..Station::named(&name) })
}

/// Its numbers.
pub fn telescope(station: &Station) -> Telescope {
    let feed = FeedRotation::numbers(station.feed_rotation);
    (station.name.clone(), station.position, station.sefd, feed, station.leakage)
}

impl Columns<'_> {
    fn rows(&self, observation: &Observation) -> PyResult<Vec<Row>> {
        let time = self.time.as_slice()?;
        let (integration, stations) = (self.integration.as_slice()?, self.stations.as_slice()?);
        let (uv, products) = (self.uv.as_slice()?, self.products.as_slice()?);
        let (sigmas, opacity) = (self.sigmas.as_slice()?, self.opacity.as_slice()?);
        let channel = self.channel.as_slice()?;
        let row = |k: usize| {
            Ok(Row {
                time_h: time[k],
                integration_s: integration[k],
                stations: [
                    number(stations[2 * k], observation.stations.len(), "station")?,
                    number(stations[2 * k + 1], observation.stations.len(), "station")?,
                ],
                uv: [uv[2 * k], uv[2 * k + 1]],
                products: [0, 1, 2, 3].map(|p| products[4 * k + p]),
                noise_sigma: [0, 1, 2, 3].map(|p| sigmas[4 * k + p]),
                opacity: [opacity[2 * k] as f32, opacity[2 * k + 1] as f32],
                // Without channels every row has the number 0.
                channel: number(channel[k], observation.channels.len().max(1), "channel")?,
            })
        };
        (0..time.len()).map(row).collect()
    }
}

/// An index, if there is such a thing.
fn number(value: i64, count: usize, what: &str) -> PyResult<u16> {
    let index = u16::try_from(value).ok().filter(|index| usize::from(*index) < count);
    index.ok_or_else(|| refused(format!("{what} = {value} is not allowed: there are {count}")))
}

impl Visibilities {
    /// Wraps an observation.
    pub fn of(observation: Observation) -> Self {
        Visibilities { observation }
    }
}

#[pymethods]
impl Visibilities {
    /// Reads the bytes of a file in any format; the second value names the format.
    #[staticmethod]
    fn decode(py: Python<'_>, bytes: &[u8]) -> PyResult<(Self, String)> {
        let (format, observation) = detached(py, || decode(bytes))?;
        Ok((Visibilities { observation }, format.to_owned()))
    }

    /// Makes an observation from columns.
    #[new]
    fn new(metadata: Metadata, columns: Columns<'_>) -> PyResult<Self> {
        let mut observation = metadata.observation()?;
        observation.rows = columns.rows(&observation)?;
        Ok(Visibilities { observation })
    }

    /// The bytes of a file.
    fn encode<'py>(&self, py: Python<'py>, format: &str) -> PyResult<Bound<'py, PyBytes>> {
        let observation = &self.observation;
        let text = |text: String| text.into_bytes();
        let work = || -> Result<Vec<u8>, Error> {
            match format {
                "uvfits" => write_uvfits(observation),
                "obs-text" => to_obs_text(observation).map(text),
                "eht-csv" => to_eht_table(observation, EhtTable::Csv).map(text),
                "eht-txt" => to_eht_table(observation, EhtTable::Txt).map(text),
                _ => to_csv(observation, true).map(text),
            }
        };
        Ok(PyBytes::new(py, &detached(py, work)?))
    }

    /// Returns the metadata, beside the rows.
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (dict, of) = (PyDict::new(py), &self.observation);
        dict.set_item("source", &of.source)?;
        dict.set_item("position", of.position.map(|place| (place.ra_hours, place.dec_deg)))?;
        dict.set_item("mjd", of.mjd)?;
        dict.set_item("frequency_hz", of.frequency_hz)?;
        dict.set_item("bandwidth_hz", of.bandwidth_hz)?;
        let channel = |channel: &Channel| (channel.frequency_hz, channel.bandwidth_hz);
        dict.set_item("channels", of.channels.iter().map(channel).collect::<Vec<_>>())?;
        dict.set_item("circular", of.basis == Basis::Circular)?;
        dict.set_item("stations", of.stations.iter().map(telescope).collect::<Vec<_>>())?;
        dict.set_item("history", &of.history)?;
        Ok(dict)
    }

    /// The columns of the rows, flat.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (dict, rows) = (PyDict::new(py), &self.observation.rows);
        let column = |of: fn(&Row) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
        dict.set_item("time", column(|row| row.time_h).into_pyarray(py))?;
        dict.set_item("integration", column(|row| row.integration_s).into_pyarray(py))?;
        let stations = rows.iter().flat_map(|row| row.stations.map(i64::from));
        dict.set_item("stations", stations.collect::<Vec<i64>>().into_pyarray(py))?;
        let uv: Vec<f64> = rows.iter().flat_map(|row| row.uv).collect();
        dict.set_item("uv", uv.into_pyarray(py))?;
        let products: Vec<Complex64> = rows.iter().flat_map(|row| row.products).collect();
        dict.set_item("products", products.into_pyarray(py))?;
        let sigmas: Vec<f64> = rows.iter().flat_map(|row| row.noise_sigma).collect();
        dict.set_item("sigmas", sigmas.into_pyarray(py))?;
        let opacity = rows.iter().flat_map(|row| row.opacity.map(f64::from));
        dict.set_item("opacity", opacity.collect::<Vec<f64>>().into_pyarray(py))?;
        let channel: Vec<i64> = rows.iter().map(|row| i64::from(row.channel)).collect();
        dict.set_item("channel", channel.into_pyarray(py))?;
        Ok(dict)
    }

    /// Stokes I of every row and its standard deviation; NaN where a row has none.
    fn stokes_i<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let of = &self.observation;
        let none = (Complex64::new(f64::NAN, f64::NAN), f64::NAN);
        let value =
            |row: &Row| row.stokes_i(of.basis).map_or(none, |i| (i.visibility, i.noise_sigma));
        let (values, sigmas): (Vec<_>, Vec<_>) = of.rows.iter().map(value).unzip();
        Ok((values.into_pyarray(py).into_any(), sigmas.into_pyarray(py).into_any()))
    }

    /// Averaged over intervals of so many seconds, of the clock or of each scan, weighted by 1/σ² or plain.
    fn averaged(
        &self,
        py: Python<'_>,
        seconds: f64,
        in_scans: bool,
        weighted: bool,
    ) -> PyResult<Self> {
        let averaging = Averaging { seconds, in_scans, weighted };
        if !averaging.is_allowed() {
            return Err(refused(format!("seconds = {seconds} is not allowed: [1e-3, 1e9]")));
        }
        let of = &self.observation;
        let work = || Ok::<_, Infallible>(of.averaged(averaging));
        Ok(Visibilities { observation: detached(py, work)? })
    }

    /// Returns the number of rows that repeat the baseline, channel and time of another, and of closure quantities that
    /// averages of scans have, if these are more.
    fn rows_that_do_not_close(
        &self,
        py: Python<'_>,
        phases: bool,
    ) -> PyResult<(usize, Option<usize>)> {
        let kind = if phases { ClosureKind::Phase } else { ClosureKind::LogAmplitude };
        let of = &self.observation;
        let count = || Ok::<_, Infallible>(ClosureCount::of(of, kind, 0.0).of_scans);
        Ok((of.repeats().rows, detached(py, count)?))
    }

    /// Returns Stokes I alone.
    fn total_intensity(&self) -> Self {
        Visibilities { observation: self.observation.total_intensity() }
    }

    /// Independent closure quantities: hours, values, standard deviations, stations (three or four each) and the rows
    /// of their legs with signs.
    fn closures<'py>(
        &self,
        py: Python<'py>,
        phases: bool,
        least_snr: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let kind = if phases { ClosureKind::Phase } else { ClosureKind::LogAmplitude };
        let of = &self.observation;
        let sets = detached(py, || Ok::<_, Infallible>(ClosureSet::of(of, kind, least_snr)))?;
        // Legs count rows with Stokes I; Python wants numbers among all rows.
        let has_i = |(_, row): &(usize, &Row)| row.stokes_i(of.basis).is_some();
        let rows: Vec<i64> =
            of.rows.iter().enumerate().filter(has_i).map(|(k, _)| k as i64).collect();
        let all = || sets.iter().flat_map(|set| set.closures.iter().map(move |c| (set.time_h, c)));
        let dict = PyDict::new(py);
        let width = if phases { 3 } else { 4 };
        let (times, values): (Vec<f64>, Vec<f64>) = all().map(|(t, c)| (t, c.value)).unzip();
        let count = times.len();
        dict.set_item("time", times.into_pyarray(py))?;
        dict.set_item("value", values.into_pyarray(py))?;
        let sigmas: Vec<f64> = all().map(|(_, c)| c.noise_sigma).collect();
        dict.set_item("sigma", sigmas.into_pyarray(py))?;
        let stations = all().flat_map(|(_, c)| c.stations.iter().map(|s| i64::from(*s)));
        let stations = stations.collect::<Vec<i64>>().into_pyarray(py);
        dict.set_item("stations", stations.reshape([count, width])?)?;
        let legs = all().flat_map(|(_, c)| c.legs.iter().map(|leg| rows[leg.visibility]));
        let legs = legs.collect::<Vec<i64>>().into_pyarray(py);
        dict.set_item("rows", legs.reshape([count, width])?)?;
        let signs = all().flat_map(|(_, c)| c.legs.iter().map(|leg| leg.sign));
        let signs = signs.collect::<Vec<i8>>().into_pyarray(py);
        dict.set_item("signs", signs.reshape([count, width])?)?;
        Ok(dict)
    }
}
