//! `kerrlight observe`: what an array of telescopes would see.

use crate::interferometry::arguments::{self, Observing};
use crate::interferometry::{ObservationFile, image_files, scene_movie};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use kerrlight_tomo::interferometry::noise::{
    GainErrors, ScatteringKernel, add_thermal_noise, apply_gains, scatter,
};
use kerrlight_tomo::interferometry::observation::Observation;
use kerrlight_tomo::interferometry::operator::Pulse;
use kerrlight_tomo::interferometry::{schedule, simulate};
use std::path::PathBuf;

/// Arguments of `kerrlight observe`.
#[derive(Debug, Args)]
pub struct Observe {
    /// What is seen: a grid of Jy/pixel (.csv, first line north, first column east), an array or
    /// movie (.npy, .npz: (frames,) height, width), an image (.fits), a picture (.exr) or a scene
    /// (.toml)
    input: PathBuf,
    /// Width of the image on the sky in microarcseconds, for files that do not tell
    #[arg(long, value_name = "UAS", allow_negative_numbers = true)]
    fov_uas: Option<f64>,
    /// EHT2017, ngEHT, or a file in eht-imaging's format
    #[arg(long, value_name = "ARRAY")]
    array: String,
    #[command(flatten)]
    observing: Observing,
    /// Shape of a pixel
    #[arg(long, value_name = "PULSE", default_value = "triangle")]
    pulse: PulseName,
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
    /// Where to write the visibilities; the name's ending tells the format
    #[arg(short, long, value_name = "FILE.uvfits|.txt|.csv")]
    output: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Noise {
    /// None
    None,
    /// From the stations' SEFDs, bandwidth and integration time
    Thermal,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PulseName {
    /// A point
    Delta,
    /// A square
    Rectangle,
    /// A pyramid twice as wide as the pixel, eht-imaging's default
    Triangle,
}

impl Observe {
    /// Observes.
    pub fn run(&self) -> anyhow::Result<()> {
        let output = ObservationFile::new(&self.output)?;
        output.spares(&self.input)?;
        output.spares(self.array.as_ref())?;
        let seed = self.seed()?;
        let array = arguments::array_of(&self.array)?;
        let (schedule, setup) = (self.observing.schedule()?, self.observing.setup()?);
        let source = &self.observing.source;
        let mut observation = schedule::observe(&array, source.position, &schedule, &setup)?;
        observation.source.clone_from(&source.name);
        if observation.rows.is_empty() {
            bail!("no two stations see {} at any time", source.name);
        }
        let times_h = schedule.hours_utc(setup.ut1)?;
        let is_scene = self.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let movie = match (is_scene, self.fov_uas) {
            (true, Some(_)) => bail!("--fov-uas is not for scenes, which have a field of view"),
            (true, None) => scene_movie::read(&self.input, &times_h)?,
            (false, fov_uas) => image_files::read(&self.input, fov_uas)?,
        };
        let fill = simulate::fill(&mut observation, &movie, self.pulse(), &times_h);
        fill.with_context(|| self.input.display().to_string())?;
        self.spoil(&mut observation, seed)?;
        observation.history = self.history();
        output.write(&observation)?;
        let count = observation.rows.len();
        eprintln!("{count} visibilities; {}", observation.history.join("; "));
        Ok(())
    }

    fn gains(&self) -> GainErrors {
        GainErrors {
            constant_amplitude: self.gain_constant,
            scan_amplitude: self.gain_scan,
            random_phases: self.random_phases,
        }
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
        let random = self.noise == Noise::Thermal || self.gains() != GainErrors::default();
        match self.seed {
            Some(seed) => Ok(seed),
            None if random => {
                bail!("--seed is needed for noise or gains: it makes them repeatable")
            }
            None => Ok(0),
        }
    }

    fn pulse(&self) -> Pulse {
        match self.pulse {
            PulseName::Delta => Pulse::Delta,
            PulseName::Rectangle => Pulse::Rectangle,
            PulseName::Triangle => Pulse::Triangle,
        }
    }

    /// In the order of light's way.
    fn spoil(&self, observation: &mut Observation, seed: u64) -> anyhow::Result<()> {
        if self.scatter_sgra {
            scatter(observation, &ScatteringKernel::SGR_A)?;
        }
        if self.gains() != GainErrors::default() {
            apply_gains(observation, self.gains(), seed);
        }
        if self.noise == Noise::Thermal {
            add_thermal_noise(observation, seed);
        }
        Ok(())
    }

    /// Every number that decided the data.
    fn history(&self) -> Vec<String> {
        let mut lines = vec![
            concat!("kerrlight ", env!("CARGO_PKG_VERSION"), " observe").to_owned(),
            format!("input {}", self.input.display()),
        ];
        lines.extend(self.fov_uas.map(|fov| format!("field of view {fov} uas")));
        lines.extend(self.observing.history(&self.array));
        lines.push(format!("pulse {:?}", self.pulse));
        if self.scatter_sgra {
            lines.push("scattering of Sgr A* (Johnson et al. 2018)".to_owned());
        }
        if self.gains() != GainErrors::default() {
            lines.push(format!("{:?}", self.gains()));
        }
        lines.push(match (self.noise, self.seed) {
            (Noise::None, None) => "noise none".to_owned(),
            (noise, seed) => format!("noise {noise:?}, seed {}", seed.unwrap_or_default()),
        });
        lines
    }
}
