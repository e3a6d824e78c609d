//! Simulation: the true emission, and the array that sees it.

use super::{
    Effects, FieldSettings, FitError, FitFile, Hole, Motion, Observer, Region, SimulatedCurve,
    Within, merge,
};
use crate::Error;
use kerrlight_common::toml_file;
use kerrlight_render::polarization::PolarizationLaw;
use kerrlight_vlbi::noise::GainErrors;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// Data that are simulated in place of measured ones. All that is not given here is as the fit assumes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Simulation {
    /// The simulated emission.
    pub truth: Truth,
    /// Times of images.
    pub movie: Option<Movie>,
    /// The array that observes it, at times of its own.
    pub observation: Option<Observation>,
    /// The light curve that is observed of it, at times of its own.
    pub light_curve: Option<SimulatedCurve>,
    /// Draws numbers that have a prior from it, with the seed of the fit, for calibration. With `screen.ring_rays`, along
    /// 16 times as many rays near the critical curve where the second forward model does not make the data.
    #[serde(default)]
    pub drawn: bool,
    /// Settings of the hole that differ from the fit's.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "Option<Hole>")]
    pub hole: Table,
    /// Settings of the observer that differ from the fit's.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "Option<Observer>")]
    pub observer: Table,
    /// Settings of the region that differ from the fit's.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "Option<Region>")]
    pub region: Table,
    /// Effects that differ from the fit's.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "Option<Effects>")]
    pub effects: Table,
    /// Settings of the motion that differ from the fit's.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "Option<Motion>")]
    pub motion: Table,
    /// Settings of the field and its light that differ from the fit's.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "Option<PolarizationLaw>")]
    pub polarization: Table,
}

impl Simulation {
    /// Images of emission, in the geometry that the fit assumes.
    pub fn movie(truth: Truth, movie: Movie) -> Self {
        Self { truth, movie: Some(movie), ..Self::default() }
    }

    /// Number of kinds of data.
    pub(crate) fn kinds(&self) -> usize {
        let Self { movie, observation, light_curve, .. } = self;
        [movie.is_some(), observation.is_some(), light_curve.is_some()]
            .into_iter()
            .filter(|is| *is)
            .count()
    }

    /// Tables that take the place of those of the fit.
    fn changes(&mut self) -> Table {
        let Self { hole, observer, region, effects, motion, polarization, .. } = self;
        let all = [
            ("hole", hole),
            ("observer", observer),
            ("region", region),
            ("effects", effects),
            ("motion", motion),
            ("polarization", polarization),
        ];
        let given = all.into_iter().filter(|(_, table)| !table.is_empty());
        given.map(|(key, table)| (key.to_owned(), Value::Table(core::mem::take(table)))).collect()
    }
}

impl FitFile {
    /// The simulated emission, if data are simulated.
    pub fn truth(&self) -> Option<&Truth> {
        self.simulation.as_ref().map(|simulation| &simulation.truth)
    }

    /// The array that observes the simulation, if there is one.
    pub fn observation(&self) -> Option<&Observation> {
        self.simulation.as_ref()?.observation.as_ref()
    }

    /// The simulated light curve, if there is one.
    pub fn simulated_curve(&self) -> Option<&SimulatedCurve> {
        self.simulation.as_ref()?.light_curve.as_ref()
    }

    /// The settings that data are simulated with: those of the fit with the changes of `simulation`.
    ///
    /// # Errors
    /// If a change is no setting or out of range, or a number that has a prior is not given.
    pub fn simulated(&self) -> Result<Self, Error> {
        let mut file = self.clone();
        let Some(simulation) = &mut file.simulation else { return Ok(file) };
        let (changes, drawn) = (simulation.changes(), simulation.drawn);
        let mut file: Self = if changes.is_empty() {
            file
        } else {
            let mut table = toml_file::table_of(&file).within("settings")?;
            merge(&mut table, &changes);
            toml_file::read_table(&table).within("simulation")?
        };
        file.search = None;
        if drawn {
            file.draw()?;
        }
        match file.first_prior() {
            None => Ok(file),
            Some(key) => {
                let why = format!(
                    "{key} has a prior; say what is simulated, or draw it with `drawn = true` in [simulation]"
                );
                Err(FitError::missing(&format!("simulation.{key}"), why).into())
            }
        }
    }
}

/// Frames of a simulated movie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Movie {
    /// Number of frames.
    #[schemars(range(min = 1, max = 100_000), extend("unit" = "frames"))]
    pub frames: usize,
    /// Time of the first frame, M.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub from: f64,
    /// Time of the last frame, M.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub to: f64,
}

/// True emission.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Gaussian spots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spot: Vec<Spot>,
    /// Arcs about the z axis with a Gaussian cross-section.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tube: Vec<Tube>,
    /// Letters and digits, extruded along the axis, their tops away from the hole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub glyph: Vec<GlyphShape>,
    /// A field drawn from a prior of voxels with the fit's seed, in the cube about the region.
    pub field: Option<FieldSettings>,
    /// Rings on the screen about the hole, the same in every frame.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ring: Vec<Ring>,
}

/// A Gaussian spot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Centre when the spot was round, M: x, y, z.
    #[schemars(inner(range(min = -1e6, max = 1e6)), extend("unit" = "M"))]
    pub center: [f64; 3],
    /// Standard deviation, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub sigma: f64,
    /// Emission at the centre.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "emission at the centre"))]
    pub amplitude: f64,
    /// Time for which differential rotation has sheared it by the reference time, M.
    #[serde(default)]
    #[schemars(range(min = -1e6, max = 1e6), extend("unit" = "M"))]
    pub wound_for: f64,
    /// Time in which it shines; always without it.
    pub shines: Option<Shines>,
}

/// An arc about the z axis, in the plane of the hole, with a Gaussian cross-section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tube {
    /// Radius of the arc, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// Standard deviation across it, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub sigma: f64,
    /// Azimuths of its ends, degrees.
    #[schemars(inner(range(min = -720.0, max = 720.0)), extend("unit" = "degrees"))]
    pub azimuth_deg: [f64; 2],
    /// Emission on the arc, far from its ends.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "emission on the arc"))]
    pub amplitude: f64,
}

/// A ring on the screen about the hole, the same in every frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Radius, M; 0 is a round spot.
    #[schemars(range(min = 0.0, max = 1e6), extend("unit" = "M"))]
    pub radius: f64,
    /// Standard deviation across it, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub sigma: f64,
    /// Stokes I, Jy.
    #[schemars(range(min = 0.0, max = 1e15), extend("unit" = "Jy"))]
    pub flux_jy: f64,
    /// Stokes Q, of the same shape, Jy.
    #[serde(default)]
    #[schemars(range(min = -1e15, max = 1e15), extend("unit" = "Jy"))]
    pub q_jy: f64,
    /// Stokes U, of the same shape, Jy.
    #[serde(default)]
    #[schemars(range(min = -1e15, max = 1e15), extend("unit" = "Jy"))]
    pub u_jy: f64,
    /// Excess of the brightest side over the mean, as a part of the mean.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "a part of the mean brightness"))]
    pub asymmetry: f64,
    /// Position angle of the brightest side, degrees east of north.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees east of north"))]
    pub brightest_deg: f64,
}

/// Spots on an arc are this many of their standard deviations apart: closer, nothing of a flat arc changes in double
/// precision.
const SPACING: f64 = 0.4;

impl Tube {
    /// The spots that it is made of.
    pub fn spots(&self) -> Vec<Spot> {
        let [from, to] = self.azimuth_deg.map(f64::to_radians);
        let length = self.radius * (to - from).abs();
        let count = (length / (SPACING * self.sigma)).ceil().clamp(1.0, 1e5);
        let share = length / count / (core::f64::consts::TAU.sqrt() * self.sigma);
        let spot = |k: usize| {
            let (sin, cos) = (from + (to - from) * (k as f64 + 0.5) / count).sin_cos();
            Spot {
                center: [self.radius * cos, self.radius * sin, 0.0],
                sigma: self.sigma,
                amplitude: self.amplitude * share,
                ..Spot::default()
            }
        };
        (0..count as usize).map(spot).collect()
    }
}

/// Times at which emission appears and fades.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shines {
    /// Time at which it has reached half of its brightness, M; ever since without it.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub from: Option<f64>,
    /// Time at which it has faded to half, M; for ever without it.
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub until: Option<f64>,
    /// Time constant of the logistic rise and decay, M.
    #[schemars(range(min = 1e-6, max = 1e9), extend("unit" = "M"))]
    pub rise: f64,
}

impl Shines {
    /// The share of the brightness at a time.
    pub fn at(&self, time: f64) -> f64 {
        let logistic = |t: f64| 1.0 / (1.0 + (-t / self.rise).exp());
        let rising = self.from.map_or(1.0, |from| logistic(time - from));
        rising * self.until.map_or(1.0, |until| logistic(until - time))
    }
}

/// Shape of a letter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlyphShape {
    /// The letter or digit.
    pub letter: char,
    /// Its middle: x, y, z in M.
    pub center: [f64; 3],
    /// Height, above 0 M.
    pub height: f64,
    /// Extent along the axis, above 0 M.
    pub thickness: f64,
    /// Standard deviation of the blurred edges, above 0 M and at most the height.
    pub softness: f64,
    /// Emission in broad strokes.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "emission in the strokes"))]
    pub amplitude: f64,
}

/// The array that sees the simulated movie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// `EHT2017`, `ngEHT`, or an array file in eht-imaging's format.
    pub array: String,
    /// `sgra`, `m87`, or `RA,DEC` in hours and degrees.
    pub source: String,
    /// Modified Julian date.
    pub mjd: i32,
    /// Hours of UTC of the first scan and of one after the last; this or `gmst`.
    pub utc: Option<[f64; 2]>,
    /// The same in hours of Greenwich mean sidereal time, beginning on the day `mjd`.
    pub gmst: Option<[f64; 2]>,
    /// Number of scans, a frame each.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "scans"))]
    pub scans: u32,
    /// Integration time of a scan, above 0 s.
    #[schemars(range(min = 1e-6, max = 1e6), extend("unit" = "seconds"))]
    pub integration_s: f64,
    /// Frequency, above 0 GHz.
    #[schemars(range(min = 0.001, max = 1e6), extend("unit" = "GHz"))]
    pub frequency_ghz: f64,
    /// Bandwidth, above 0 GHz.
    #[schemars(range(min = 1e-9, max = 1000.0), extend("unit" = "GHz"))]
    pub bandwidth_ghz: f64,
    /// Least and greatest elevation, degrees.
    #[schemars(inner(range(min = -90.0, max = 90.0)), extend("unit" = "degrees"))]
    pub elevation_deg: [f64; 2],
    /// Noise that is added; errors are thermal in both cases.
    pub noise: Noise,
    /// Gain errors of the stations.
    pub gains: Option<GainErrors>,
    /// Root mean square of |d| of the leakage, drawn once for each feed; needs a loss of polarised visibilities.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "a root mean square of |d|"))]
    pub leakage: Option<f64>,
    /// Fraction of each amplitude that the fit adds to its error in quadrature.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "part of the amplitude"))]
    #[schemars(example = 0.02)]
    pub systematic: Option<f64>,
    /// Time of the first scan, M.
    #[serde(default)]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub first_time: f64,
}

/// Noise of simulated data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Noise {
    /// None; errors are those of thermal noise.
    None,
    /// Thermal.
    Thermal,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built_in() -> FitFile {
        toml_file::read(include_str!("../../../../cli/src/fit/built_in.toml")).unwrap()
    }

    fn with(changes: &str) -> FitFile {
        let mut table = toml_file::table_of(&built_in()).unwrap();
        merge(&mut table, &changes.parse().unwrap());
        toml_file::read_table(&table).unwrap()
    }

    #[test]
    fn exact_a_simulation_differs_where_it_says_so() {
        let file = built_in();
        assert_eq!(file.simulated().unwrap(), file);
        let file = with("[simulation.hole]\nspin = 0.9\n[simulation.effects]\nslow_light = false");
        let simulated = file.simulated().unwrap();
        assert_eq!(simulated.hole.spin.value(), 0.9);
        assert_eq!(simulated.hole.mass_msun, file.hole.mass_msun);
        assert!(!simulated.effects.slow_light && simulated.effects.redshift_power == Some(2.0));
        let file = with("[simulation.hole]\nspn = 0.9\n");
        let error = format!("{:#}", file.simulated().unwrap_err());
        assert!(error.contains("unknown field `spn`"), "{error}");
    }

    #[test]
    fn exact_what_has_a_prior_is_simulated_with_a_value() {
        let prior = "hole.spin = { uniform = [0.5, 0.6] }\n";
        let error = format!("{:#}", with(prior).simulated().unwrap_err());
        assert!(
            error.contains("simulation.hole.spin is missing: hole.spin has a prior"),
            "{error}"
        );
        let given = with(&format!("{prior}simulation.hole.spin = 0.1"));
        assert_eq!(given.simulated().unwrap().hole.spin.value(), 0.1);
        let drawn = with(&format!("{prior}simulation.drawn = true"));
        let spin = drawn.simulated().unwrap().hole.spin;
        assert!(spin.prior().is_none() && (0.5..0.6).contains(&spin.value()), "{spin:?}");
        assert_eq!(drawn.simulated().unwrap(), drawn.simulated().unwrap());
        let other = FitFile { seed: 2, ..drawn };
        assert_ne!(other.simulated().unwrap().hole.spin, spin);
    }
}
