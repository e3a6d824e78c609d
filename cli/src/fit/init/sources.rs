//! Sources whose numbers are published.

use kerrlight_tomo::interferometry::earth::SourcePosition;

/// A source whose mass and distance are known.
pub struct Source {
    /// What it is called.
    pub name: &'static str,
    /// How names of it in files begin.
    pub words: [&'static str; 2],
    /// Where it is.
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
    /// Whether it varies within minutes.
    pub varies: bool,
    /// Flux of what is compact and its standard deviation, Jy, where short baselines see more.
    pub compact_jy: Option<[f64; 2]>,
    /// Where mass and distance come from.
    pub mass: &'static str,
    /// Where the inclination comes from.
    pub inclination: &'static str,
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
        mass: "M87* (EHT Collaboration 2019, ApJL 875, L1)",
        inclination: "17 degrees from the jet's axis, with the hole turned away (EHT Collaboration 2019, ApJL 875, L5)",
    },
];
