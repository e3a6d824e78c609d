//! Schedules of an array, and the baselines that then see the source.

use super::array::{Array, ArrayError};
use super::earth::{Frame, Moment, SourcePosition, Ut1, View, hours_utc_of_gmst};
use super::observation::{Basis, Observation, Row};
use crate::Error;
use kerrlight_common::memory::{self};
use kerrlight_common::units::SPEED_OF_LIGHT;

/// Clock of the hours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// Coordinated Universal Time.
    Utc,
    /// Greenwich mean sidereal time; the source is seen in [`Frame::Catalogue`] at exactly these. The first scan, modulo
    /// 24 h, lies between 0 h and 24 h UTC of the day.
    Gmst,
}

/// Schedule: `scans` times start + k·(stop − start)/scans, k = 0, 1, …
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Modified Julian date whose 0 h UTC hours count from.
    pub mjd: i32,
    /// Clock of the hours.
    pub clock: Clock,
    /// First scan, in hours.
    pub start_h: f64,
    /// Time at which the scan after the last one would be, in hours.
    pub stop_h: f64,
    /// Number of scans.
    pub scans: u32,
}

/// Setup of a simulated observation besides array, source and schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Observing frequency in Hz.
    pub frequency_hz: f64,
    /// Bandwidth in Hz.
    pub bandwidth_hz: f64,
    /// Integration time of a scan in seconds.
    pub integration_s: f64,
    /// Elevations in degrees between which stations observe, ends excluded, for those without
    /// limits of their own.
    pub elevation_deg: [f64; 2],
    /// UT1 − UTC.
    pub ut1: Ut1,
    /// The Earth's attitude.
    pub frame: Frame,
}

/// Reason why there is no observation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScheduleError {
    /// Sidereal times with precession.
    #[error("hours of GMST require the catalogue frame")]
    GmstOfDate,
    /// A source that is below the horizon of all stations but one.
    #[error("no two stations see the source at any time")]
    NothingSeen,
}

/// Most scans of a schedule.
const MOST_SCANS: u32 = 1_000_000;

fn check(name: &'static str, value: f64, ok: bool, allowed: &'static str) -> Result<(), Error> {
    if ok { Ok(()) } else { Err(Error::out_of_range(name, value, allowed)) }
}

impl Schedule {
    /// The times of the scans in hours of the schedule's clock.
    pub fn hours(&self) -> impl Iterator<Item = f64> {
        let step = (self.stop_h - self.start_h) / f64::from(self.scans);
        (0..self.scans).map(move |k| self.start_h + f64::from(k) * step)
    }

    /// The same in hours of UTC, as rows of the observation have them.
    ///
    /// # Errors
    /// If the day is out of range or its UT1 − UTC not known.
    pub fn hours_utc(&self, ut1: Ut1) -> Result<Vec<f64>, Error> {
        let utc = |hours| match self.clock {
            Clock::Utc => Ok(hours),
            Clock::Gmst => hours_utc_of_gmst(self.mjd, hours, self.start_h, ut1),
        };
        self.hours().map(utc).collect()
    }

    fn check(&self) -> Result<(), Error> {
        let hours = "hours in [-48, 72]";
        check("start", self.start_h, (-48.0..=72.0).contains(&self.start_h), hours)?;
        check("stop", self.stop_h, (-48.0..=72.0).contains(&self.stop_h), hours)?;
        let ok = self.stop_h > self.start_h || self.stop_h == self.start_h && self.scans < 2;
        check("stop", self.stop_h, ok, "later than the start (add 24 h past midnight)")?;
        let ok = (1..=MOST_SCANS).contains(&self.scans);
        check("number of scans", self.scans.into(), ok, "1 to 1000000")
    }
}

impl Setup {
    fn check(&self) -> Result<(), Error> {
        let Setup { frequency_hz, bandwidth_hz, integration_s, elevation_deg: [low, high], .. } =
            *self;
        check(
            "frequency",
            frequency_hz,
            (1e6..=1e15).contains(&frequency_hz),
            "Hz in [1e6, 1e15]",
        )?;
        check("bandwidth", bandwidth_hz, (1.0..=1e12).contains(&bandwidth_hz), "Hz in [1, 1e12]")?;
        let ok = (1e-6..=86400.0).contains(&integration_s);
        check("integration time", integration_s, ok, "seconds in [1e-6, 86400]")?;
        let degrees = "degrees in [-90, 90], the lower limit below the upper";
        check("least elevation", low, (-90.0..=90.0).contains(&low) && low < high, degrees)?;
        check("greatest elevation", high, (-90.0..=90.0).contains(&high), degrees)
    }
}

/// Standard deviation in Jy of the real part (and of the imaginary part) of a correlation of two
/// feeds with SEFDs in Jy; two-bit sampling loses a factor 0.88 (Thompson, Moran & Swenson 2017,
/// eq. 6.45 and table 8.1).
pub fn thermal_sigma(sefd: [f64; 2], bandwidth_hz: f64, integration_s: f64) -> f64 {
    (sefd[0] * sefd[1] / (2.0 * bandwidth_hz * integration_s)).sqrt() / 0.88
}

/// Thermal errors of RR, LL, RL, LR of a pair of stations with SEFDs (R, L).
fn hand_sigmas(first: [f64; 2], second: [f64; 2], setup: &Setup) -> [f64; 4] {
    [[0, 0], [1, 1], [0, 1], [1, 0]]
        .map(|[a, b]| thermal_sigma([first[a], second[b]], setup.bandwidth_hz, setup.integration_s))
}

/// The observation that a schedule makes: every baseline at every scan at which both of its
/// stations see the source, with visibilities of zero and the thermal errors of RR, LL, RL, LR.
///
/// [`simulate::fill`](super::simulate::fill) then sets the visibilities to those of a movie, and
/// [`noise`](super::noise) spoils them.
///
/// ```
/// use kerrlight_vlbi::array::built_in;
/// use kerrlight_vlbi::earth::{Frame, SourcePosition, Ut1};
/// use kerrlight_vlbi::schedule::{Clock, Schedule, Setup, observe};
///
/// let array = built_in("EHT2017").unwrap();
/// let schedule =
///     Schedule { mjd: 57854, clock: Clock::Utc, start_h: 0.0, stop_h: 12.0, scans: 12 };
/// let setup = Setup {
///     frequency_hz: 230e9,
///     bandwidth_hz: 2e9,
///     integration_s: 10.0,
///     elevation_deg: [10.0, 85.0],
///     ut1: Ut1::Table,
///     frame: Frame::OfDate,
/// };
/// let observation = observe(&array, SourcePosition::M87, &schedule, &setup)?;
/// // No baseline is longer than the Earth's diameter, in wavelengths of 1.3 mm.
/// let longest = 2.0 * 6.4e6 / (299_792_458.0 / 230e9);
/// assert!(!observation.rows.is_empty());
/// assert!(observation.rows.iter().all(|row| row.uv[0].hypot(row.uv[1]) < longest));
/// # Ok::<(), kerrlight_vlbi::Error>(())
/// ```
///
/// # Errors
/// If a value is out of range, or a station's position or SEFD not known.
pub fn observe(
    array: &Array,
    source: SourcePosition,
    schedule: &Schedule,
    setup: &Setup,
) -> Result<Observation, Error> {
    schedule.check()?;
    setup.check()?;
    if schedule.clock == Clock::Gmst && setup.frame != Frame::Catalogue {
        return Err(ScheduleError::GmstOfDate.into());
    }
    let positions = array.positions()?;
    check_sefds(array)?;
    let mut observation = Observation {
        position: Some(source),
        mjd: Some(schedule.mjd),
        frequency_hz: Some(setup.frequency_hz),
        bandwidth_hz: Some(setup.bandwidth_hz),
        stations: array.stations.clone(),
        ..Observation::empty(Basis::Circular)
    };
    for hours in schedule.hours() {
        let (time_h, view) = view_at(source, schedule, setup, hours)?;
        scan(&mut observation.rows, array, &positions, setup, time_h, &view);
    }
    Ok(observation)
}

fn check_sefds(array: &Array) -> Result<(), ArrayError> {
    let unfit =
        |s: &&super::array::Station| s.sefd.iter().any(|sefd| !(sefd.is_finite() && *sefd > 0.0));
    match array.stations.iter().find(unfit) {
        None => Ok(()),
        Some(station) => Err(ArrayError::Unfit {
            name: station.name.clone(),
            message: format!("SEFD = {:?} Jy is not allowed: positive and finite", station.sefd),
        }),
    }
}

/// Hours of UTC, and the Earth as the source sees it then.
fn view_at(
    source: SourcePosition,
    schedule: &Schedule,
    setup: &Setup,
    hours: f64,
) -> Result<(f64, View), Error> {
    match schedule.clock {
        Clock::Utc => {
            let moment = Moment { mjd: schedule.mjd, hours_utc: hours };
            Ok((hours, View::new(source, moment, setup.ut1, setup.frame)?))
        }
        Clock::Gmst => {
            let time_h = hours_utc_of_gmst(schedule.mjd, hours, schedule.start_h, setup.ut1)?;
            Ok((time_h, View::at_gmst(source, hours)))
        }
    }
}

/// The baselines of one scan.
fn scan(
    rows: &mut Vec<Row>,
    array: &Array,
    positions: &[[f64; 3]],
    setup: &Setup,
    time_h: f64,
    view: &View,
) {
    let wavelength = SPEED_OF_LIGHT / setup.frequency_hz;
    let up = |k: &usize| {
        let [low, high] = array.stations[*k].elevation_deg.unwrap_or(setup.elevation_deg);
        let elevation = view.elevation_deg(positions[*k]);
        elevation > low && elevation < high
    };
    let seeing: Vec<usize> = (0..positions.len()).filter(up).collect();
    for (index, &i) in seeing.iter().enumerate() {
        for &j in &seeing[index + 1..] {
            let sefds = [i, j].map(|k| array.stations[k].sefd);
            let uv = view.uv(positions[i], positions[j], wavelength);
            rows.push(Row {
                integration_s: setup.integration_s,
                noise_sigma: hand_sigmas(sefds[0], sefds[1], setup),
                // An array has fewer than 2^16 stations.
                ..Row::empty(time_h, [i as u16, j as u16], uv)
            });
        }
    }
}

/// Scans of the trial by which the rows of many are estimated.
const TRIAL: u32 = 256;

/// The same as [`observe`], if there is memory for the rows of all scans.
///
/// # Errors
/// As [`observe`], if no two stations see the source, or if there is no memory for the rows.
pub fn observe_affordable(
    array: &Array,
    source: SourcePosition,
    schedule: &Schedule,
    setup: &Setup,
) -> Result<Observation, Error> {
    if schedule.scans > TRIAL {
        // Over the same hours: as many baselines see the source in a scan.
        let trial = Schedule { scans: TRIAL, ..*schedule };
        let few = observe(array, source, &trial, setup)?.rows.len() as f64;
        let rows = few * f64::from(schedule.scans) / f64::from(TRIAL);
        let what = || format!("about {rows:.0} visibilities of {} scans", schedule.scans);
        memory::afford(what, bytes_of_rows(rows))?;
    }
    let observation = observe(array, source, schedule, setup)?;
    if observation.rows.is_empty() {
        return Err(ScheduleError::NothingSeen.into());
    }
    Ok(observation)
}

/// Bytes of rows of visibilities: when they are made, spoilt, and written.
fn bytes_of_rows(rows: f64) -> f64 {
    2.0 * size_of::<Row>() as f64 * rows
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::array::built_in;

    pub const SCHEDULE: Schedule =
        Schedule { mjd: 57850, clock: Clock::Utc, start_h: 4.0, stop_h: 15.5, scans: 128 };
    pub const SETUP: Setup = Setup {
        frequency_hz: 226_191_789_062.5,
        bandwidth_hz: 1.856e9,
        integration_s: 60.0,
        elevation_deg: [10.0, 85.0],
        ut1: Ut1::Table,
        frame: Frame::Catalogue,
    };

    /// eht-imaging 1.3.2: number of visibilities, and errors of Stokes I.
    #[test]
    fn code_ehtim_visibilities_of_eht2017_and_ngeht() {
        let run = |name: &str| {
            observe(&built_in(name).unwrap(), SourcePosition::SGR_A, &SCHEDULE, &SETUP).unwrap()
        };
        let eht = run("EHT2017");
        assert_eq!(eht.rows.len(), 1705);
        let sigma = |observation: &Observation, pair: [&str; 2]| {
            let row = observation.rows.iter().find(|row| {
                let names = observation.names(row);
                names == pair || names == [pair[1], pair[0]]
            });
            row.unwrap().stokes_i(observation.basis).unwrap().noise_sigma
        };
        assert!((sigma(&eht, ["ALMA", "APEX"]) / 9.97171e-4 - 1.0).abs() < 5e-6);
        assert!((sigma(&eht, ["ALMA", "PV"]) / 8.54718e-4 - 1.0).abs() < 5e-6);
        assert!((sigma(&run("ngEHT"), ["ALMA", "GARS"]) / 1.42453e-3 - 1.0).abs() < 5e-6);
    }

    #[test]
    fn exact_feeds_of_their_own() {
        let mut array = built_in("EHT2017").unwrap();
        array.stations[0].sefd = [3600.0, 8100.0];
        let rows = observe(&array, SourcePosition::SGR_A, &SCHEDULE, &SETUP).unwrap().rows;
        let row = rows.iter().find(|row| row.stations == [0, 4]).unwrap();
        let hand = |sefd: f64| thermal_sigma([sefd, 70.0], 1.856e9, 60.0);
        let expected = 0.5 * hand(3600.0).hypot(hand(8100.0));
        let found = row.stokes_i(Basis::Circular).unwrap().noise_sigma;
        assert!((found / expected - 1.0).abs() < 1e-15);
    }

    #[test]
    fn exact_values_out_of_range_are_named() {
        let array = built_in("EHT2017").unwrap();
        let run = |schedule: Schedule, setup: Setup| {
            observe(&array, SourcePosition::M87, &schedule, &setup).unwrap_err().to_string()
        };
        let message = run(Schedule { stop_h: 3.0, ..SCHEDULE }, SETUP);
        assert!(message.contains("stop = 3"), "{message}");
        assert!(run(Schedule { scans: 0, ..SCHEDULE }, SETUP).contains("scans = 0"));
        assert!(run(Schedule { mjd: 100, ..SCHEDULE }, SETUP).contains("MJD"));
        let message = run(SCHEDULE, Setup { integration_s: f64::NAN, ..SETUP });
        assert!(message.contains("integration time = NaN"), "{message}");
        let gmst = Schedule { clock: Clock::Gmst, ..SCHEDULE };
        assert!(run(gmst, Setup { frame: Frame::OfDate, ..SETUP }).contains("GMST"));
    }

    /// A station's own limits count before the common ones.
    #[test]
    fn exact_elevation_limits() {
        let mut array = built_in("EHT2017").unwrap();
        let count = |array: &Array| {
            let rows = observe(array, SourcePosition::SGR_A, &SCHEDULE, &SETUP).unwrap().rows;
            rows.iter().filter(|row| row.stations.contains(&0)).count()
        };
        let before = count(&array);
        array.stations[0].elevation_deg = Some([89.0, 90.0]);
        assert!(before > 0 && count(&array) == 0);
    }
}
