//! `kerrlight convert`: visibilities from one format to another.

use crate::answer::Answer;
use crate::interferometry::arguments;
use crate::interferometry::{self, ObservationFile, Written};
use crate::output::{self, Output};
use anyhow::{Context, anyhow, bail};
use clap::Args;
use kerrlight_vlbi::Error;
use kerrlight_vlbi::array::Station;
use kerrlight_vlbi::files;
use kerrlight_vlbi::gains::is_same_station;
use kerrlight_vlbi::light_curve::LightCurve;
use kerrlight_vlbi::observation::{Averaging, Flags, Observation};
use kerrlight_vlbi::source::Source;
use std::path::PathBuf;

/// Arguments of `kerrlight convert`.
#[derive(Debug, Args)]
pub struct Convert {
    /// UVFITS, eht-imaging's text, the EHT's csv or txt, or kerrlight's CSV
    input: PathBuf,
    /// Output file; the name's ending tells the format, `-` is CSV on standard output
    #[arg(value_name = "OUTPUT.uvfits|.txt|.csv")]
    pub output: PathBuf,
    /// Write the light curve that baselines within a site (ALMA-APEX, JCMT-SMA) have measured: I, Q, U, V as CSV
    #[arg(long, conflicts_with_all = ["format", "stokes_i"])]
    light_curve: bool,
    /// Format to write [default: by the name's ending]
    #[arg(long, value_name = "FORMAT")]
    format: Option<Written>,
    /// Tell source, date, frequency, stations and history in lines of a CSV that start with `#`
    #[arg(long)]
    comments: bool,
    /// Average coherently over this many seconds
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    average: Option<f64>,
    /// Average coherently over all spectral channels and IFs
    #[arg(long)]
    average_channels: bool,
    /// Merge the hands into Stokes I
    #[arg(long)]
    stokes_i: bool,
    /// Leave out a station
    #[arg(long, value_name = "NAME")]
    flag_station: Vec<String>,
    /// Leave out an interval of UTC hours; 20-10 goes over midnight: from 20 h to 10 h by the clock
    #[arg(long, value_name = "FROM-TO", value_parser = arguments::range, allow_hyphen_values = true)]
    flag_utc: Vec<[f64; 2]>,
    /// Leave out baselines shorter than this many wavelengths
    #[arg(long, value_name = "WAVELENGTHS", allow_negative_numbers = true)]
    uv_min: Option<f64>,
    /// Leave out baselines longer than this many wavelengths
    #[arg(long, value_name = "WAVELENGTHS", allow_negative_numbers = true)]
    uv_max: Option<f64>,
    /// Take station gains out: a table as a fit with [instrument.gains] leaves it (gains.csv); rows without a gain are
    /// left out
    #[arg(long, value_name = "GAINS.csv")]
    gains: Option<PathBuf>,
    /// Take leakage out of RR, LL, RL and LR: a table as a fit with [instrument.leakage] leaves it (leakage.csv); rows
    /// without all four, or with another station, are left out
    #[arg(long, value_name = "LEAKAGE.csv")]
    leakage: Option<PathBuf>,
    /// The source, where the input does not tell where it is: sgra, m87, or hours and degrees
    #[arg(long, value_name = "sgra|m87|RA,DEC")]
    source: Option<Source>,
    /// The stations, where the input does not tell where they are: EHT2017, ngEHT or a file
    #[arg(long, value_name = "ARRAY")]
    array: Option<String>,
    /// The day, where the input does not tell
    #[arg(long, value_name = "DAY", allow_negative_numbers = true, value_parser = clap::value_parser!(i32).range(41317..=90000))]
    mjd: Option<i32>,
    /// Frequency in GHz, where the input does not tell
    #[arg(long, value_name = "GHZ", allow_negative_numbers = true)]
    frequency: Option<f64>,
    /// Bandwidth in GHz, where the input does not tell
    #[arg(long, value_name = "GHZ", allow_negative_numbers = true)]
    bandwidth: Option<f64>,
}

impl Convert {
    /// Refuses numbers of options before anything is read.
    fn check_numbers(&self) -> anyhow::Result<()> {
        if let Some(seconds) = self.average.filter(|s| !Averaging::over(*s).is_allowed()) {
            bail!("--average {seconds} is not allowed: seconds in [1e-3, 1e9]");
        }
        for (name, limit) in [("--uv-min", self.uv_min), ("--uv-max", self.uv_max)] {
            if let Some(limit) = limit.filter(|limit| limit.is_nan() || *limit < 0.0) {
                bail!("{name} {limit} is not allowed: wavelengths, 0 or more");
            }
        }
        Ok(())
    }

    /// Converts.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let file = ObservationFile::new(&self.output, self.format, self.comments)?;
        let array = self.array.as_ref().map(PathBuf::from);
        let inputs = std::iter::once(&self.input).chain(&self.gains).chain(&self.leakage);
        inputs.chain(&array).try_for_each(|input| file.output.must_differ_from(input))?;
        self.check_numbers()?;
        let mut observation = interferometry::read(&self.input)?;
        interferometry::note_cautions(&self.input.display().to_string(), &observation);
        self.complete(&mut observation)?;
        let flags = Flags {
            stations: self.flag_station.clone(),
            times_h: self.flag_utc.clone(),
            shorter_than: self.uv_min,
            longer_than: self.uv_max,
        };
        if let Some(name) = flags.unknown_stations(&observation).first() {
            bail!("--flag-station {name}: {} has no such station", self.input.display());
        }
        self.check_intervals(&observation)?;
        let all = observation.rows.len();
        observation = flags.apply(&observation);
        let flagged = all - observation.rows.len();
        // Gains and leakage belong to single times and feeds: they come out before any average.
        self.calibrate(&mut observation)?;
        self.correct_leakage(&mut observation)?;
        if self.stokes_i {
            observation = observation.total_intensity();
        }
        if self.average_channels {
            if !observation.channels.is_empty() && observation.frequency_hz.is_none() {
                bail!("--average-channels needs the frequency of the mean: give --frequency");
            }
            observation = observation.averaged_over_channels();
        }
        if let Some(seconds) = self.average {
            interferometry::warn_of_repeats(&self.input.display().to_string(), &observation);
            observation = observation.averaged(Averaging::over(seconds));
        }
        if observation.rows.is_empty() {
            bail!("{}: no visibilities are left", self.input.display());
        }
        if self.light_curve {
            return self.write_light_curve(&observation);
        }
        file.warn_of_polarization(&observation, &self.input.display().to_string());
        let rows = file.rows_of(&observation);
        if rows == 0 {
            bail!(
                "{}: no Stokes I, the only one that {} holds",
                self.input.display(),
                self.output.display()
            );
        }
        file.write(&observation).map_err(told)?;
        let without = match observation.rows.len() - rows {
            0 => String::new(),
            count => format!(", {count} without Stokes I left out"),
        };
        eprintln!("{rows} rows, {flagged} flagged{without}");
        Ok(Answer::written([&file.output]).with("rows", rows).with("flagged", flagged))
    }

    /// Takes the gains of a table out.
    fn calibrate(&self, observation: &mut Observation) -> anyhow::Result<()> {
        let Some(path) = &self.gains else { return Ok(()) };
        let name = path.display().to_string();
        let table = files::parse_gains(&output::read_text(path)?).context(name.clone())?;
        let (all, lost) = (observation.rows.len(), table.take_out(observation));
        if lost == all {
            bail!("{name} has no gains for the stations and times of {}", self.input.display());
        }
        if lost > 0 {
            eprintln!("{name}: {lost} of {all} rows have no gain and are left out");
        }
        Ok(())
    }

    /// Takes the leakage of a table out.
    fn correct_leakage(&self, observation: &mut Observation) -> anyhow::Result<()> {
        let Some(path) = &self.leakage else { return Ok(()) };
        let name = path.display().to_string();
        let table = files::parse_leakage(&output::read_text(path)?).context(name.clone())?;
        let all = observation.rows.len();
        let input = self.input.display();
        let lost = table.take_out(observation).with_context(|| input.to_string())?;
        if lost == all {
            bail!("{name} has no leakage for rows of {input} that have RR, LL, RL and LR");
        }
        if lost > 0 {
            eprintln!(
                "{name}: {lost} of {all} rows have no leakage or not all four products and are left out"
            );
        }
        Ok(())
    }

    fn write_light_curve(&self, observation: &Observation) -> anyhow::Result<Answer> {
        let curve = LightCurve::of_sites(observation);
        if curve.samples.is_empty() {
            bail!("{}: no baseline lies within a site", self.input.display());
        }
        if let Some(part) = LightCurve::incoherent_part(observation) {
            eprintln!(
                "warning: {:.0} % of the power on baselines within a site is imaginary: their phases are not calibrated, or the source is not unresolved in the middle of the field; these fluxes are not those of the source",
                100.0 * part
            );
        }
        let output = Output::or_pipe(&self.output, &["csv"])?;
        output.must_differ_from(&self.input)?;
        let comments =
            if self.comments { files::observation_comments(observation) } else { String::new() };
        output.write((comments + &files::light_curve_to_csv(&curve)).as_bytes())?;
        let count = curve.samples.len();
        eprintln!("{count} samples");
        Ok(Answer::written([&output]).with("samples", count))
    }

    /// Refuses hours over midnight that no clock shows; tells of intervals without visibilities.
    fn check_intervals(&self, observation: &Observation) -> anyhow::Result<()> {
        for &[from, to] in &self.flag_utc {
            let on_a_clock = (0.0..=24.0).contains(&from) && (0.0..=24.0).contains(&to);
            if from > to && !on_a_clock {
                bail!(
                    "--flag-utc {from}-{to} is not allowed: over midnight, both are hours in [0, 24]"
                );
            }
            let alone = Flags { times_h: vec![[from, to]], ..Flags::default() };
            if alone.apply(observation).rows.len() == observation.rows.len() {
                eprintln!("--flag-utc {from}-{to}: no visibility lies in it");
            }
        }
        Ok(())
    }

    /// Adds what the input does not tell; what it tells stays, with a warning where an option says otherwise.
    fn complete(&self, observation: &mut Observation) -> anyhow::Result<()> {
        let unused = |name: &str, told: String| {
            eprintln!("warning: {name} is not used: {} says {told}", self.input.display());
        };
        if let Some(source) = &self.source {
            let told = *observation.position.get_or_insert(source.position);
            if !agree(told.ra_hours, source.position.ra_hours)
                || !agree(told.dec_deg, source.position.dec_deg)
            {
                unused("--source", format!("{} h, {} deg", told.ra_hours, told.dec_deg));
            }
            if observation.source.is_empty() {
                observation.source.clone_from(&source.name);
            }
        }
        if let Some(mjd) = self.mjd {
            let told = *observation.mjd.get_or_insert(mjd);
            if told != mjd {
                unused("--mjd", told.to_string());
            }
        }
        for (name, value, field) in [
            ("--frequency", self.frequency, &mut observation.frequency_hz),
            ("--bandwidth", self.bandwidth, &mut observation.bandwidth_hz),
        ] {
            match value {
                Some(ghz) if !(1e-9..=1e6).contains(&ghz) => {
                    bail!("{name} {ghz} is not allowed: GHz in [1e-9, 1e6]")
                }
                Some(ghz) => {
                    let told = *field.get_or_insert(ghz * 1e9) / 1e9;
                    if !agree(told, ghz) {
                        unused(name, format!("{told} GHz"));
                    }
                }
                None => {}
            }
        }
        let Some(array) = &self.array else { return Ok(()) };
        let array = arguments::array_of(array)?;
        for station in &mut observation.stations {
            let same = |known: &&Station| is_same_station(&known.name, &station.name);
            let Some(known) = array.stations.iter().find(same) else { continue };
            match (station.position, known.position) {
                (None, _) => fill(station, known),
                (Some(told), Some(given)) if far_apart(told, given) => {
                    unused("--array", format!("{} at {told:?} m", station.name));
                }
                _ => {}
            }
        }
        let has =
            |name: &str| array.stations.iter().any(|known| is_same_station(&known.name, name));
        let lost = observation.stations.iter().filter(|station| station.position.is_none());
        let lost = lost.filter(|station| !has(&station.name));
        let lost: Vec<&str> = lost.map(|station| station.name.as_str()).collect();
        if !lost.is_empty() {
            bail!("--array has no station {}", lost.join(", "));
        }
        Ok(())
    }
}

/// Gives a station without a position what the data do not tell of it.
fn fill(station: &mut Station, known: &Station) {
    let without = Station::named(&station.name);
    station.position = known.position;
    if station.sefd == without.sefd {
        station.sefd = known.sefd;
    }
    if station.leakage == without.leakage {
        station.leakage = known.leakage;
    }
    station.elevation_deg = station.elevation_deg.or(known.elevation_deg);
    station.feed_rotation = station.feed_rotation.or(known.feed_rotation);
}

/// Returns whether two positions in metres are not of one station: farther apart than surveys of it.
fn far_apart(told: [f64; 3], given: [f64; 3]) -> bool {
    (0..3).any(|k| (told[k] - given[k]).abs() > 1000.0)
}

/// Returns whether two numbers are the same but for digits that were left out.
fn agree(told: f64, given: f64) -> bool {
    (told - given).abs() <= 1e-5 * told.abs().max(given.abs())
}

/// An error, with the options that give what the data lack where that is the error.
fn told(error: anyhow::Error) -> anyhow::Error {
    match error.downcast_ref() {
        Some(Error::MissingMetadata(_)) => anyhow!(
            "{} with --source, --array, --mjd, --frequency or --bandwidth",
            crate::plain::reasons(&error)
        ),
        _ => error,
    }
}
