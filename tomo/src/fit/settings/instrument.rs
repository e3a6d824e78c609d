//! Parameters of the instrument that are solved for.

use super::{FitError, refuse};
use kerrlight_vlbi::gains::{GainPriors, PRIOR_TABLES, prior_table};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Unknown parameters of the instrument.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstrumentSettings {
    /// Complex gains, one a station and frame. Needs one loss of visibilities, polarised visibilities or
    /// amplitudes. Every station needs a prior.
    pub gains: Option<GainSettings>,
    /// Leakage between the feeds, the same in all frames. Needs polarised visibilities, circular feeds, and a
    /// linear-grid or a linear start.
    pub leakage: Option<LeakageSettings>,
}

/// Leakage that is solved for in turn with the emission.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeakageSettings {
    /// Root mean square of |d| that is expected: its prior.
    #[schemars(range(min = 1e-6, max = 1.0), extend("unit" = "a root mean square of |d|"))]
    pub amplitude: f64,
    /// Times that emission and leakage are solved for in turn, at most.
    #[schemars(range(min = 1, max = 1000), extend("unit" = "times that both are solved for"))]
    pub rounds: usize,
}

/// Gains of stations that are solved for in every frame, beside every model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainSettings {
    /// Prior knowledge of the phases.
    pub phases: GainPhases,
    /// Standard deviation of ln |g| by station; 0: the amplitude is right.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("additionalProperties" = {"minimum": 0.0, "maximum": 10.0}, "unit" = "a standard deviation of ln |g|"))]
    pub stations: BTreeMap<String, f64>,
    /// Priors of stations that are not listed: `EHT2017` or `ngEHT`.
    pub table: Option<String>,
    /// Standard deviation of ln |g| of stations that neither has.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a standard deviation of ln |g|"))]
    pub amplitude: Option<f64>,
}

/// Prior knowledge of phases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GainPhases {
    /// Nothing, in any frame.
    Free,
    /// They are calibrated.
    Known,
}

impl GainSettings {
    /// The priors of these stations.
    ///
    /// # Errors
    /// If a station has none, a table is not known, or a listed station does not observe.
    pub fn priors(&self, stations: &[String]) -> Result<GainPriors, FitError> {
        if let Some(name) = self.stations.keys().find(|name| !stations.contains(name)) {
            refuse!(
                "instrument.gains.stations.{name}: no such station observes; there are {}",
                stations.join(", ")
            );
        }
        if let Some(name) = &self.table
            && !PRIOR_TABLES.iter().any(|known| known.eq_ignore_ascii_case(name))
        {
            refuse!(
                "instrument.gains.table = {name:?} is not allowed: {}",
                PRIOR_TABLES.join(" or ")
            );
        }
        let amplitude_sigma = stations.iter().map(|name| self.prior(name));
        Ok(GainPriors {
            free_phases: self.phases == GainPhases::Free,
            amplitude_sigma: amplitude_sigma.collect::<Result<_, _>>()?,
        })
    }

    fn prior(&self, station: &str) -> Result<f64, FitError> {
        let of_table = || self.table.as_ref().and_then(|name| prior_table(name, station));
        let known = self.stations.get(station).copied().or_else(of_table).or(self.amplitude);
        known.ok_or_else(|| {
            let why = "its gain has no prior; give the standard deviation of ln |g| (0.0: the amplitude is right), or \
                       `instrument.gains.amplitude = …` for all stations that are not listed";
            FitError::missing(&format!("instrument.gains.stations.{station}"), why)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> GainSettings {
        kerrlight_common::toml_file::read(text).unwrap()
    }

    #[test]
    fn exact_priors_from_the_list_the_table_and_the_rest() {
        let all: Vec<String> = ["AA", "LM", "XX"].map(str::to_owned).to_vec();
        let text =
            "phases = \"free\"\ntable = \"EHT2017\"\namplitude = 0.3\nstations = { AA = 0.0 }";
        let priors = settings(text).priors(&all).unwrap();
        assert_eq!(priors.amplitude_sigma, [0.0, 0.6, 0.3]);
        let without = settings("phases = \"known\"\ntable = \"EHT2017\"").priors(&all);
        let error = without.unwrap_err().to_string();
        assert!(error.starts_with("instrument.gains.stations.XX is missing"), "{error}");
        let other = settings("phases = \"free\"\nstations = { ZZ = 0.1 }").priors(&all);
        let error = other.unwrap_err().to_string();
        assert!(error.contains("stations.ZZ: no such station observes; there are AA, LM, XX"));
        let table = settings("phases = \"free\"\ntable = \"VLA\"").priors(&all);
        assert!(
            table.unwrap_err().to_string().contains("\"VLA\" is not allowed: EHT2017 or ngEHT")
        );
    }
}
