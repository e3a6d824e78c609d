//! `kerrlight observe`: what an array of telescopes would see.

use crate::answer::Answer;
use crate::assets::Reach;
use crate::interferometry::arguments::{self, Observing};
use crate::interferometry::movie_files::{self, FrameTimes};
use crate::interferometry::{ObservationFile, scene_movie};
use crate::paths;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use kerrlight_common::toml_file::shown;
use kerrlight_vlbi::noise::{Corruptions, GainErrors};
use kerrlight_vlbi::operator::{Method, Pulse};
use kerrlight_vlbi::schedule;
use kerrlight_vlbi::simulate::{self, StokesMovie};
use std::path::PathBuf;

/// Arguments of `kerrlight observe`.
#[derive(Debug, Args)]
pub struct Observe {
    /// Images to observe: a grid of Jy/pixel (.csv, first line north, first column east), an array or
    /// movie (.npy, .npz: (frames,) height, width), an image (.fits), a picture (.exr), a movie of
    /// pictures (a folder of .exr, a pattern such as 'frame_%04d.exr' or 'frames/*.exr', or several
    /// files, in the order of the numbers in their names), or a scene (.toml)
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    reach: Reach,
    /// Times of the movie's images: `scans` (image k at scan k; needed only where the images' own times
    /// disagree), `own` (EXR of kerrlight: the scene's times, the first being the first scan; .npz: hours
    /// of UTC named `times`), hours of UTC of the first and of the last, or a file with an hour a line.
    /// Between images the source changes linearly
    #[arg(long, value_name = "scans|own|FROM-TO|FILE", value_parser = movie_files::frame_times,
          allow_hyphen_values = true)]
    frame_times: Option<FrameTimes>,
    /// Width of the image on the sky in microarcseconds, for files that do not tell
    #[arg(long, value_name = "UAS", allow_negative_numbers = true)]
    fov_uas: Option<f64>,
    /// EHT2017, ngEHT, or a file in eht-imaging's format
    #[arg(long, value_name = "ARRAY")]
    array: String,
    #[command(flatten)]
    observing: Observing,
    /// Shape of a pixel
    #[arg(long, value_name = "PULSE", default_value = "triangle", value_parser = arguments::named([
        ("delta", "A point", Pulse::Delta),
        ("rectangle", "A square", Pulse::Rectangle),
        ("triangle", "A pyramid twice as wide as the pixel, eht-imaging's default", Pulse::Triangle),
    ]))]
    pulse: Pulse,
    /// Fourier transform: the sum over pixels, a fast transform, or which of them is expected to be
    /// faster
    #[arg(long, value_name = "TRANSFORM", default_value = "auto", value_parser = arguments::named([
        ("auto", "The faster one for these pixels and visibilities", Method::Cheaper(ACCURACY)),
        ("direct", "The sum over pixels", Method::Direct),
        ("fast", "Fast Fourier transform and a kernel, within 1e-12 of the flux", Method::Fast(ACCURACY)),
    ]))]
    transform: Method,
    /// Noise that is added; errors are those of thermal noise in any case
    #[arg(long, value_name = "NOISE", default_value = "none")]
    noise: Noise,
    /// Seed of all random numbers, needed where there are any
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Standard deviation of the logarithm of station gains, constant in time
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, allow_negative_numbers = true)]
    gain_constant: f64,
    /// Standard deviation of the logarithm of station gains, a new one each scan
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, allow_negative_numbers = true)]
    gain_scan: f64,
    /// Random phases of stations, new ones each scan
    #[arg(long)]
    random_phases: bool,
    /// Blur by the scattering towards Sgr A*
    #[arg(long)]
    scatter_sgra: bool,
    /// Tell source, date, frequency, stations and history in lines of a CSV that start with `#`
    #[arg(long)]
    comments: bool,
    /// Output visibilities; the name's ending tells the format, `-` is CSV on standard output
    #[arg(short, long, value_name = "FILE.uvfits|.txt|.csv")]
    pub output: PathBuf,
}

/// Bound of the fast transform's errors as a part of the flux.
const ACCURACY: f64 = 1e-12;

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Noise {
    /// None
    None,
    /// Thermal noise from the stations' SEFDs, bandwidth and integration time
    Thermal,
}

impl Observe {
    /// Observes.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let file = ObservationFile::new(&self.output, None, self.comments)?;
        let files = self.files()?;
        files.iter().try_for_each(|input| file.output.must_differ_from(input))?;
        if let Some(FrameTimes::File(path)) = &self.frame_times {
            file.output.must_differ_from(path)?;
        }
        // The name of a built-in array is no file and differs from every output.
        file.output.must_differ_from(self.array.as_ref())?;
        let seed = self.seed()?;
        let array = arguments::array_of(&self.array)?;
        let (schedule, setup) = (self.observing.schedule()?, self.observing.setup()?);
        let source = &self.observing.source;
        let mut observation =
            schedule::observe_affordable(&array, source.position, &schedule, &setup)
                .with_context(|| source.name.clone())?;
        observation.source.clone_from(&source.name);
        let times_h = schedule.hours_utc(setup.ut1)?;
        let (movie, frames_h, said) = self.movie(&files, &times_h)?;
        if let Some(warning) = odd(&movie) {
            eprintln!("warning: {}: {warning}", self.shown());
        }
        let fill =
            simulate::fill_stokes(&mut observation, &movie, self.pulse, &frames_h, self.transform);
        let transform = fill.with_context(|| self.shown())?;
        self.corruptions().apply(&mut observation, seed)?;
        observation.history = self.history(said, transform);
        file.warn_of_polarization(&observation, &self.shown());
        file.write(&observation)?;
        let count = observation.rows.len();
        eprintln!("{count} visibilities; {}", observation.history.join("; "));
        let answer = Answer::written([&file.output]).with("visibilities", count);
        Ok(answer.with("history", observation.history))
    }

    /// All files of the input.
    fn files(&self) -> anyhow::Result<Vec<PathBuf>> {
        let mut all = Vec::new();
        for input in &self.inputs {
            all.extend(movie_files::files(input)?);
        }
        // A pattern that the shell has expanded comes in the order of letters: 1, 10, 2.
        movie_files::sort_by_numbers(&mut all);
        Ok(all)
    }

    /// The inputs, in one line.
    fn shown(&self) -> String {
        let first = self.inputs[0].display();
        match self.inputs.len() {
            1 => first.to_string(),
            n => format!("{first} and {} more", n - 1),
        }
    }

    /// Images, the hours of UTC at which they show the source, and how these came about.
    fn movie(
        &self,
        files: &[PathBuf],
        scans_h: &[f64],
    ) -> anyhow::Result<(StokesMovie, Vec<f64>, String)> {
        if !files.iter().any(|path| paths::ending(path) == "toml") {
            let (movie, own) = movie_files::read(files, self.fov_uas)?;
            let choice = self.frame_times.as_ref();
            let (times, said) = movie_files::times(movie.i.frames(), &own, choice, scans_h)
                .with_context(|| self.shown())?;
            return Ok((movie, times, said));
        }
        if self.fov_uas.is_some() || self.frame_times.is_some() {
            bail!("--fov-uas and --frame-times are not for scenes, which have field and times");
        }
        let [scene] = files else { bail!("a scene is observed alone, without other files") };
        let movie = scene_movie::read(scene, scans_h, self.reach)?;
        let times = scans_h[..movie.i.frames()].to_vec();
        Ok((movie, times, "rendered at the time of each scan".to_owned()))
    }

    fn corruptions(&self) -> Corruptions {
        let gains = GainErrors {
            constant_amplitude: self.gain_constant,
            scan_amplitude: self.gain_scan,
            random_phases: self.random_phases,
            ..GainErrors::default()
        };
        let thermal = self.noise == Noise::Thermal;
        Corruptions { scattering: self.scatter_sgra, gains, thermal }
    }

    /// The seed, which random numbers do not go without.
    fn seed(&self) -> anyhow::Result<u64> {
        for (name, value) in
            [("--gain-constant", self.gain_constant), ("--gain-scan", self.gain_scan)]
        {
            if !(0.0..=3.0).contains(&value) {
                bail!("{name} {value} is not allowed: 0 to 3");
            }
        }
        let Corruptions { gains, thermal, .. } = self.corruptions();
        let random = thermal || gains != GainErrors::default();
        match self.seed {
            Some(seed) => Ok(seed),
            None if random => {
                bail!("--seed is needed for noise or gains: it makes them repeatable")
            }
            None => Ok(0),
        }
    }

    /// Every number that decided the data.
    fn history(&self, images: String, transform: String) -> Vec<String> {
        let mut lines = vec![
            concat!("kerrlight ", env!("CARGO_PKG_VERSION"), " observe").to_owned(),
            format!("input {}", self.shown()),
            images,
        ];
        lines.extend(self.fov_uas.map(|fov| format!("field of view {} uas", shown(fov))));
        lines.extend(self.observing.history(&self.array));
        lines.push(format!("pulse {:?}", self.pulse));
        lines.push(transform);
        let corruptions = self.corruptions();
        lines.extend(corruptions.history());
        let gains = corruptions.gains;
        if gains != GainErrors::default() {
            lines.push(format!("{gains:?}"));
        }
        lines.push(match (self.noise, self.seed) {
            (Noise::None, None) => "noise none".to_owned(),
            (noise, seed) => format!("noise {noise:?}, seed {}", seed.unwrap_or_default()),
        });
        lines
    }
}

/// Names a property of pixels that is allowed and most probably not meant.
fn odd(movie: &StokesMovie) -> Option<String> {
    let pixels = &movie.i.pixels;
    let least = pixels.iter().fold(f64::INFINITY, |least, x| least.min(*x));
    let most = pixels.iter().fold(f64::NEG_INFINITY, |most, x| most.max(*x));
    match (least, most) {
        (0.0, 0.0) => Some("every pixel is 0: so is every visibility, but for noise".to_owned()),
        _ if least < 0.0 => {
            Some(format!("pixels below 0 (down to {least:e} Jy): no total intensity"))
        }
        _ => overpolarised(movie).map(|count| {
            let all = pixels.len();
            format!("√(Q² + U² + V²) exceeds Stokes I in {count} of {all} pixels: no light is polarised so much")
        }),
    }
}

/// Counts the pixels that are polarised by more than all of their light, beyond what single precision
/// rounds.
fn overpolarised(movie: &StokesMovie) -> Option<usize> {
    let [q, u, v] = movie.polarized.each_ref().map(|plane| plane.as_deref().unwrap_or_default());
    let at = |plane: &[f64], k: usize| plane.get(k).copied().unwrap_or(0.0);
    let exceeds =
        |(k, i): &(usize, &f64)| at(q, *k).hypot(at(u, *k)).hypot(at(v, *k)) > *i * (1.0 + 1e-5);
    let count = movie.i.pixels.iter().enumerate().filter(exceeds).count();
    (count > 0).then_some(count)
}
