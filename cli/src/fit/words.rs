//! What things are called in sentences.

use super::config::{FitFile, Kind, LossKind};
use super::unknowns;
use clap::ValueEnum;

/// All words that a setting may be, as they are written.
pub fn all<T: ValueEnum>() -> String {
    let words = T::value_variants().iter().filter_map(ValueEnum::to_possible_value);
    words.map(|word| word.get_name().to_owned()).collect::<Vec<_>>().join(", ")
}

/// Kinds of representations that kerrlight has itself.
pub fn representations() -> String {
    all::<Kind>()
}

/// Kinds of data.
pub fn data(kind: LossKind) -> &'static str {
    match kind {
        LossKind::Image => "images",
        LossKind::Visibilities => "visibilities",
        LossKind::Amplitudes => "amplitudes",
        LossKind::ClosurePhases => "closure phases",
        LossKind::LogClosureAmplitudes => "log closure amplitudes",
        LossKind::LightCurve => "the light curve",
    }
}

/// Kinds of representations, in a few words.
pub fn representation(kind: &Kind) -> &str {
    match kind {
        Kind::Bhnerf => "network (BH-NeRF)",
        Kind::Mlp4d => "network of space and time",
        Kind::FeatureGrid => "grids of features",
        Kind::Grid => "grid of voxels",
        Kind::LinearGrid => "linear grid of voxels",
        Kind::Own(name) => name,
    }
}

/// The same for somebody who does not know the names.
pub fn described(file: &FitFile) -> &str {
    match &file.representation.kind {
        Kind::Bhnerf => {
            "a neural network of the place that matter had at the reference time (BH-NeRF)"
        }
        Kind::Mlp4d => "a neural network of place and time, which knows nothing of orbits",
        Kind::FeatureGrid => {
            "a small neural network of features on grids of several resolutions that are carried along the orbits"
        }
        Kind::Grid => "values at the nodes of a grid that is carried along the orbits",
        Kind::LinearGrid if !unknowns::is_convex(file) => {
            "values at the nodes of a grid that is carried along the orbits, found by descent from several lit starts, as such data are not convex in the emission"
        }
        Kind::LinearGrid => {
            "values at the nodes of a grid that is carried along the orbits, as the solution of a convex problem"
        }
        Kind::Own(name) => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Serialize;

    /// What messages list is what settings are read as.
    #[test]
    fn exact_words_are_those_of_the_settings() {
        fn check<T: ValueEnum + Serialize>() {
            for value in T::value_variants() {
                let word = value.to_possible_value().unwrap();
                let written = toml::Value::try_from(value.clone()).unwrap();
                assert_eq!(written.as_str(), Some(word.get_name()));
            }
        }
        check::<Kind>();
        check::<LossKind>();
        assert_eq!(representations(), "bhnerf, mlp4d, feature-grid, grid, linear-grid");
    }
}
