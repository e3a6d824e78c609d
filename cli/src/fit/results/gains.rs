//! Gains of stations that a fit has solved for: a table to apply, pictures and numbers.

use super::Estimate;
use super::verdict::Evidence;
use crate::fit::folder::Folder;
use crate::report::{Axis, LinePlot, Marks, Series, Table};
use kerrlight_common::frames::Frames;
use kerrlight_imaging::data::station_of_file;
use kerrlight_imaging::mean_with_error;
use kerrlight_tomo::fit::settings::LossKind;
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::files;
use kerrlight_vlbi::gains::{GainDistance, GainTable, StationGain};
use kerrlight_vlbi::observation::{Averaging, Observation};
use serde::Serialize;

/// The table of all gains.
const TABLE: &str = "gains.csv";
/// That of gains beside the polarisation of a static image, which are found anew.
pub const POLARIZED_TABLE: &str = "polarized_gains.csv";

/// Curves that a plot has room for.
const CURVES: usize = 6;

/// Gains that were found.
pub struct Gains {
    /// Gains that explain the data best beside the model.
    beside: GainTable,
    /// The same less what the method adds to them, with their errors: those that are told.
    table: GainTable,
    distance: Option<GainDistance>,
}

/// The gains, as results.json has them.
#[derive(Serialize)]
pub struct GainResults {
    file: &'static str,
    stations: Vec<StationGains>,
    #[serde(skip_serializing_if = "Option::is_none")]
    beside_the_truth: Option<GainDistance>,
}

/// Gains of a station over all frames.
#[derive(Serialize)]
struct StationGains {
    station: String,
    scans: usize,
    /// exp of the mean of ln|g|.
    amplitude: f64,
    /// Standard deviation of ln|g| about its mean.
    scatter: f64,
    /// Root mean squares of the standard deviations of ln|g| and of arg g.
    amplitude_error: f64,
    phase_error_deg: Option<f64>,
    largest_log_amplitude: f64,
}

/// Own name of a station of the present file; none of stations of other files.
pub type OwnName<'a> = dyn Fn(&str) -> Option<String> + 'a;

/// Writes a table of stations for each file of data: `name`, such as `gains.csv`, then `gains_2.csv`, …
pub fn write_by_file(
    name: &str,
    measured: &FitData,
    folder: &Folder,
    table: impl Fn(&OwnName<'_>) -> String,
) -> anyhow::Result<()> {
    let last = measured.files.iter().copied().max().unwrap_or(0);
    for file in 0..=last {
        let text = table(&|station| {
            if last == 0 {
                return Some(station.to_owned());
            }
            let (own, of) = station_of_file(station);
            (of == file).then(|| own.to_owned())
        });
        let name = match file {
            0 => name.to_owned(),
            _ => name.replace(".csv", &format!("_{}.csv", file + 1)),
        };
        folder.file(&name)?.write(text.as_bytes())?;
    }
    Ok(())
}

/// Adds the root mean square distance of the gains of other images to errors in quadrature.
fn widen(table: &mut GainTable, here: &GainTable, others: &[GainTable]) {
    let count = others.len().max(1) as f64;
    for (k, (gain, here)) in table.gains.iter_mut().zip(&here.gains).enumerate() {
        // The logarithm has the distance of amplitudes as its real part, of phases as imaginary.
        let apart = || others.iter().map(|other| (other.gains[k].gain / here.gain).ln());
        let squares = [
            apart().map(|apart| apart.re * apart.re).sum::<f64>(),
            apart().map(|apart| apart.im * apart.im).sum(),
        ];
        for (error, square) in gain.errors.iter_mut().zip(squares) {
            *error = error.hypot((square / count).sqrt());
        }
    }
}

/// Takes off amplitudes what those beside images of a known sky have more than those beside the sky, or adds it to their errors.
fn calibrate(table: &mut GainTable, sky: &GainTable, images: &[GainTable], takes_off: bool) {
    for (k, (gain, sky)) in table.gains.iter_mut().zip(&sky.gains).enumerate() {
        let more = images.iter().map(|image| (image.gains[k].gain / sky.gain).norm().ln());
        let Some((added, of_mean)) = mean_with_error(&more.collect::<Vec<f64>>()) else { return };
        if takes_off {
            // What is taken off is a mean over images, with an error of its own.
            gain.gain *= (-added).exp();
            gain.errors[0] = gain.errors[0].hypot(of_mean);
        } else {
            gain.errors[0] = gain.errors[0].hypot(added);
        }
    }
}

impl Estimate<'_> {
    /// The gains of all stations and frames, beside these images and what data see of them, where they are solved for; writes their table.
    pub fn gains(&self, movie: &Frames<f32>, seen: &Frames<f32>) -> anyhow::Result<Option<Gains>> {
        // Products of the feeds need images of all Stokes parameters, not of intensity alone.
        let is_polarized =
            self.file.loss.iter().any(|loss| loss.data == LossKind::PolarizedVisibilities);
        if !is_polarized || self.measured.gains.is_none() {
            return Gains::beside(&self.evidence(), movie, &Others::default(), self.folder);
        }
        let table = self.measured.polarized_gains(&seen.to_vec()?)?;
        table.map(|table| Gains::written(TABLE, table, self.measured, self.folder)).transpose()
    }
}

/// Other images of all frames, which tell errors of gains.
#[derive(Default)]
pub struct Others {
    /// Images that may as well be the one that was found: the root mean square distance of their gains is part of the errors.
    pub draws: Vec<Frames<f32>>,
    /// A sky that is known, which tells what the method adds to gains.
    pub known_sky: Option<KnownSky>,
}

/// A known sky in all frames, and images of it.
pub struct KnownSky {
    pub sky: Frames<f32>,
    pub images: Vec<Frames<f32>>,
    /// True if the sky explains the data: what images add to gains is then taken off, and otherwise part of their error.
    pub explains: bool,
}

impl Gains {
    /// The gains of all stations and frames beside images of all frames, where they are solved for; writes their table.
    pub fn beside(
        evidence: &Evidence<'_>,
        movie: &Frames<f32>,
        others: &Others,
        folder: &Folder,
    ) -> anyhow::Result<Option<Self>> {
        let Evidence { measured, losses, .. } = *evidence;
        let of = |movie: &Frames<f32>| -> anyhow::Result<Option<GainTable>> {
            let Some(model) = evidence.model_visibilities(movie)? else { return Ok(None) };
            Ok(measured.gains(losses, &model)?)
        };
        let all = |movies: &[Frames<f32>]| -> anyhow::Result<Vec<GainTable>> {
            movies.iter().filter_map(|movie| of(movie).transpose()).collect()
        };
        let Some(beside) = of(movie)? else { return Ok(None) };
        let mut table = beside.clone();
        widen(&mut table, &beside, &all(&others.draws)?);
        if let Some(known) = &others.known_sky
            && let Some(sky) = of(&known.sky)?
        {
            calibrate(&mut table, &sky, &all(&known.images)?, known.explains);
        }
        Ok(Some(Gains { beside, ..Self::written(TABLE, table, measured, folder)? }))
    }

    /// Writes a table.
    pub fn written(
        name: &str,
        table: GainTable,
        measured: &FitData,
        folder: &Folder,
    ) -> anyhow::Result<Self> {
        write_by_file(name, measured, folder, |own_name| {
            let gains = table.gains.iter().filter_map(|gain| {
                let gain = StationGain { station: own_name(&gain.station)?, ..gain.clone() };
                if measured.average_s == 0.0 {
                    return Some(gain);
                }
                // Rows that were averaged are told by the interval, not by its mean time.
                let averaging = Averaging::over(measured.average_s);
                let (time_h, span_s) = averaging.interval_at(gain.time_h);
                Some(StationGain { time_h, span_s, ..gain })
            });
            files::gains_to_csv(&GainTable { gains: gains.collect() })
        })?;
        let distance = measured.true_gains.as_ref().and_then(|truth| table.distance(truth));
        Ok(Gains { beside: table.clone(), table, distance })
    }

    /// Multiplies a model's visibilities of all rows that have Stokes I by g₁ ḡ₂ of their stations at their times; by 1
    /// where a station has none.
    pub fn put_on(&self, observation: &Observation, model: &mut [Complex64]) {
        let gains = self.beside.by_station();
        for ((row, _), v) in observation.stokes_i().zip(model) {
            let gain = |name: &str| gains.at(name, row.time_h).unwrap_or(1.0.into());
            let [first, second] = observation.names(row).map(gain);
            *v *= first * second.conj();
        }
    }

    /// Returns the gains for results.json.
    pub fn results(&self) -> GainResults {
        GainResults { file: TABLE, stations: self.stations(), beside_the_truth: self.distance }
    }

    /// Sentences for the report.
    pub fn sentences(&self) -> Vec<String> {
        let (kind, phases) = match self.table.has_phases() {
            true => ("Complex gains", "Phases count from the station with the strongest data."),
            false => (
                "Amplitudes of gains",
                "Their phases were not solved for: the data that were fitted do not change with them.",
            ),
        };
        let mut all = vec![format!(
            "{kind} of {} stations were solved for in every frame beside the model; {TABLE} has them, and `kerrlight convert IN OUT --gains {TABLE}` takes them out of data. {phases} A factor on all amplitudes and the flux of the source are told apart by the priors of the amplitudes alone.",
            self.table.stations().len()
        )];
        if let Some(GainDistance { scale, rms, median, .. }) = self.distance {
            all.push(format!(
                "Beside the true gains, apart from a factor {scale:.4} on all amplitudes and a phase that all stations of a frame share, the recovered ones are off by {:.2} % (root mean square; median {:.2} %).",
                100.0 * rms,
                100.0 * median
            ));
        }
        all
    }

    /// A line for every station.
    pub fn details(&self) -> Table {
        let row = |s: StationGains| {
            vec![
                s.station,
                s.scans.to_string(),
                format!("{:.3}", s.amplitude),
                format!("{:.3}", s.scatter),
                format!("{:.3}", s.amplitude_error),
                s.phase_error_deg
                    .map_or("not solved for".to_owned(), |error| format!("{error:.2}")),
            ]
        };
        let head = ["station", "frames", "amplitude", "scatter", "σ of ln|g|", "σ of phase (°)"];
        Table::new(
            "Station gains",
            "Gains that explain the data best beside the model: what a station measures is its gain times what it should. Amplitude and scatter are mean and standard deviation over the frames; σ is what data and priors leave open in one frame beside the model, with the scatter of draws of a static image. Those of a static image are less what the method adds, where a simple shape explains the data. A mean far from 1 is an error of calibration, or of the model.",
            head,
            self.stations().into_iter().map(row).collect(),
        )
    }

    /// Amplitudes of all stations over time, some stations a plot.
    pub fn plots(&self) -> Vec<LinePlot> {
        let names = self.table.stations();
        let count = names.len().div_ceil(CURVES);
        let plot = |(k, names): (usize, &[&str])| {
            let part = if count > 1 { format!(" ({} of {count})", k + 1) } else { String::new() };
            LinePlot {
                title: format!("Gains of stations{part}"),
                caption: "Amplitudes of the gains in every frame with their standard deviations; 1 is a station that is calibrated.".to_owned(),
                x: Axis::new("time", "h UTC"),
                y: Axis { log: true, ..Axis::new("amplitude of the gain", "") },
                series: names.iter().map(|name| self.series(name)).collect(),
            }
        };
        names.chunks(CURVES).enumerate().map(plot).collect()
    }

    fn of<'a>(&'a self, name: &str) -> impl Iterator<Item = &'a StationGain> {
        self.table.gains.iter().filter(move |gain| gain.station == name)
    }

    fn series(&self, name: &str) -> Series {
        let points = self.of(name).map(|g| [g.time_h, g.gain.norm()]).collect();
        let errors = self.of(name).map(|g| g.errors[0] * g.gain.norm()).collect();
        Series::new(name, points, Marks::Points).with_errors(errors)
    }

    fn stations(&self) -> Vec<StationGains> {
        self.table.stations().into_iter().map(|name| self.station(name)).collect()
    }

    fn station(&self, station: &str) -> StationGains {
        let logs: Vec<f64> = self.of(station).map(|gain| gain.gain.norm().ln()).collect();
        let scans = logs.len();
        let mean_of = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / scans as f64;
        let mean = mean_of(&mut logs.iter().copied());
        let error =
            |k: usize| mean_of(&mut self.of(station).map(|gain| gain.errors[k].powi(2))).sqrt();
        StationGains {
            station: station.to_owned(),
            scans,
            amplitude: mean.exp(),
            scatter: mean_of(&mut logs.iter().map(|x| (x - mean).powi(2))).sqrt(),
            amplitude_error: error(0),
            phase_error_deg: self.table.has_phases().then(|| error(1).to_degrees()),
            largest_log_amplitude: logs.iter().fold(0.0, |most: f64, x| most.max(x.abs())),
        }
    }
}
