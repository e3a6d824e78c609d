//! Sources whose numbers are published.

use crate::{interferometry, plain};
use kerrlight_vlbi::earth::SourcePosition;
use kerrlight_vlbi::noise::SCATTERED;
use kerrlight_vlbi::observation::Observation;
use std::path::Path;

/// A source whose mass and distance are known.
#[derive(Clone, Copy)]
pub struct Source {
    /// Name.
    pub name: &'static str,
    /// Begins of its names in files.
    pub words: [&'static str; 2],
    /// Position.
    pub position: SourcePosition,
    /// Solar masses.
    pub mass_msun: f64,
    /// kpc.
    pub distance_kpc: f64,
    /// Angle from the spin to the observer, degrees.
    pub inclination_deg: f64,
    /// A setting that leaves out baselines that see more than the surroundings of the hole.
    pub uv_min: Option<&'static str>,
    /// A setting for the medium that its light has passed.
    pub blur: Option<&'static str>,
    /// True if it varies within minutes.
    pub varies: bool,
    /// Flux of what is compact and its standard deviation, Jy, where short baselines see more.
    pub compact_jy: Option<[f64; 2]>,
    /// Field and width of the light in published images, µas, with their source; the longest baseline decides without it.
    pub image: Option<PublishedImages>,
    /// Source of mass and distance.
    pub mass: &'static str,
    /// Source of the inclination.
    pub inclination: &'static str,
}

/// Assumptions of published images.
#[derive(Clone, Copy)]
pub struct PublishedImages {
    /// Their field, µas.
    pub field_uas: f64,
    /// Full width at half maximum of the Gaussian in which light is expected, µas.
    pub envelope_uas: f64,
    /// Where.
    pub source: &'static str,
}

/// Those that are recognised by position or name.
pub const SOURCES: [Source; 2] = [
    Source {
        name: "Sgr A*",
        words: ["SGRA", "SGR_A"],
        position: SourcePosition::SGR_A,
        mass_msun: 4.154e6,
        distance_kpc: 8.178,
        inclination_deg: 30.0,
        uv_min: None,
        blur: Some(
            "scattering = \"sgra\" #! the interstellar medium blurs Sgr A* (Johnson et al. 2018, ApJ 865, 104)",
        ),
        varies: true,
        compact_jy: None,
        image: Some(PublishedImages {
            field_uas: 150.0,
            envelope_uas: 80.0,
            source: "as in published images of Sgr A* (EHT Collaboration 2022, ApJL 930, L14)",
        }),
        mass: "Sgr A* (GRAVITY Collaboration 2019, A&A 625, L10)",
        inclination: "the EHT's models prefer views of Sgr A* near face-on, 30 degrees or less from an axis (2022, ApJL 930, L16)",
    },
    Source {
        name: "M87*",
        words: ["M87", "VIRGOA"],
        position: SourcePosition::M87,
        mass_msun: 6.5e9,
        distance_kpc: 16_800.0,
        inclination_deg: 163.0,
        uv_min: Some(
            "uv_min = 1e8 #! shorter baselines see the jet as well: 1.1 Jy, where the ring has about 0.6",
        ),
        blur: None,
        varies: false,
        compact_jy: Some([0.6, 0.1]),
        image: None,
        mass: "M87* (EHT Collaboration 2019, ApJL 875, L1)",
        inclination: "17 degrees from the jet's axis, with the hole turned away (EHT Collaboration 2019, ApJL 875, L5)",
    },
];

/// The source that words of a file's name begin with.
pub fn named_in(name: &str) -> Option<&'static Source> {
    let upper = name.to_ascii_uppercase();
    let starts = |word: &str| {
        // Only where a word begins: `usagra.csv` names no source.
        let before = |at: usize| upper[..at].chars().next_back();
        upper.match_indices(word).any(|(at, _)| !before(at).is_some_and(char::is_alphanumeric))
    };
    SOURCES.iter().find(|source| source.words.iter().any(|word| starts(word)))
}

/// The source that a comment above a table names: `# source: SGRA`.
pub fn named_above(text: &str) -> Option<&'static Source> {
    let comments = text.lines().take_while(|line| line.starts_with('#'));
    let mut names = comments.filter_map(|line| line.split_once("source:"));
    names.find_map(|(_, name)| named_in(name.trim()))
}

/// Visibilities of a file, with what is known of their source.
pub struct Seen {
    /// The visibilities.
    pub observation: Observation,
    /// The file's name.
    pub file: String,
    /// The source, where its mass and distance are known.
    pub source: Option<Source>,
    /// The source's name in a line of text.
    pub name: String,
}

impl Seen {
    /// Reads a file.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let observation = interferometry::read(path)?;
        let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        let source = known(&observation);
        let name = source.as_ref().map_or(observation.source.trim(), |source| source.name);
        let name = plain::line(if name.is_empty() { "unnamed source" } else { name }).into_owned();
        Ok(Self { observation, file, source, name })
    }
}

/// Frequencies at which what is published of images and fluxes holds, Hz.
const BAND_HZ: core::ops::RangeInclusive<f64> = 200e9..=260e9;

/// Returns the source that an observation is of, if it is one of these: at another frequency without what holds at 1.3 mm alone,
/// and without scattering where `kerrlight observe` has simulated none.
fn known(observation: &Observation) -> Option<Source> {
    let source = *found(observation)?;
    let is_scattered = observation.history.iter().any(|line| line.contains(SCATTERED));
    let is_sharp = is_simulated(observation) && !is_scattered;
    let source = Source { blur: source.blur.filter(|_| !is_sharp), ..source };
    let is_far = observation.frequency_hz.is_some_and(|hz| !BAND_HZ.contains(&hz));
    Some(match is_far {
        true => Source { uv_min: None, compact_jy: None, image: None, ..source },
        false => source,
    })
}

/// Returns whether `kerrlight observe` has made it.
pub fn is_simulated(observation: &Observation) -> bool {
    let is_told = |line: &String| line.contains("kerrlight ") && line.contains(" observe");
    observation.history.iter().any(is_told)
}

fn found(observation: &Observation) -> Option<&'static Source> {
    let word: String = observation.source.to_ascii_uppercase().split_whitespace().collect();
    SOURCES.iter().find(|source| {
        let near = observation.position.is_some_and(|at| {
            let hours = (at.ra_hours - source.position.ra_hours).abs();
            hours < 0.01 && (at.dec_deg - source.position.dec_deg).abs() < 0.1
        });
        near || source.words.iter().any(|name| word.starts_with(name))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of 1.3 mm hold there alone, and what is simulated is scattered if that was asked for.
    #[test]
    fn exact_what_is_published_holds_for_the_data() {
        let mut seen = Observation::empty(kerrlight_vlbi::observation::Basis::Circular);
        seen.source = "M87".to_owned();
        let is_compact = |seen: &Observation| known(seen).unwrap().compact_jy.is_some();
        assert!(is_compact(&seen));
        for (hz, expected) in [(229.1e9, true), (86.0e9, false), (43.0e9, false)] {
            seen.frequency_hz = Some(hz);
            assert_eq!(is_compact(&seen), expected, "{hz}");
        }
        seen.source = "SGRA".to_owned();
        let is_blurred = |seen: &Observation| known(seen).unwrap().blur.is_some();
        assert!(is_blurred(&seen));
        seen.history = vec!["kerrlight 0.1.0 observe".to_owned()];
        assert!(!is_blurred(&seen));
        seen.history.push(SCATTERED.to_owned());
        assert!(is_blurred(&seen));
    }

    #[test]
    fn exact_sources_are_known_by_their_names() {
        let name = |name: &str| named_in(name).map(|source| source.name);
        assert_eq!(name("ER6_SGRA_2017_097_hi.csv"), Some("Sgr A*"));
        assert_eq!(name("m87.csv"), Some("M87*"));
        assert_eq!((name("curve.csv"), name("usagra.csv")), (None, None));
        let above = |text: &str| named_above(text).map(|source| source.name);
        assert_eq!(above("# light curve\n# source: SGRA\ntime,Q,U\n"), Some("Sgr A*"));
        assert_eq!(above("time,Q,U\n# source: SGRA\n"), None);
    }
}
