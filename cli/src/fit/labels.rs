//! What things are called in sentences.

use kerrlight_tomo::fit::settings::{FitFile, Kind};
use kerrlight_tomo::fit::world::{KNOTS, Parameter};

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
            "a neural network on coordinates pulled back to the reference time (BH-NeRF)"
        }
        Kind::Mlp4d => "a neural network of place and time, which knows nothing of orbits",
        Kind::FeatureGrid => {
            "a small neural network on multi-resolution feature grids that move with the matter"
        }
        Kind::Grid => "values at the nodes of a grid that is carried along the orbits",
        Kind::LinearGrid if !file.is_convex() => {
            "voxel values on a grid that moves with the matter, found by descent from several starts because these data make the problem non-convex"
        }
        Kind::LinearGrid => {
            "voxel values on a grid that moves with the matter, the solution of a convex problem"
        }
        Kind::Own(name) => name,
    }
}

/// What a parameter is called in a sentence, and its unit.
pub fn parameter(parameter: Parameter) -> (&'static str, &'static str) {
    match parameter {
        Parameter::Spin => ("spin", ""),
        Parameter::Inclination => ("inclination", "°"),
        Parameter::PositionAngle => ("position angle of the spin", "°"),
        Parameter::OffsetX => ("horizontal position of the hole", " M"),
        Parameter::OffsetY => ("vertical position of the hole", " M"),
        Parameter::Mass => ("mass over the assumed one", ""),
        Parameter::Rotation => ("angular velocity over the assumed one", ""),
        Parameter::RedshiftPower => ("power of the redshift factor", ""),
        Parameter::Xi => ("angular momentum over that of circular orbits", ""),
        Parameter::BetaR => ("part of the radial velocity that is not free fall", ""),
        Parameter::BetaPhi => ("part of the angular velocity that is not free fall", ""),
        Parameter::Angular(knot) => (ANGULAR[usize::from(knot)], ""),
        Parameter::Radial(knot) => (RADIAL[usize::from(knot)], ""),
    }
}

/// At the knots of a profile.
const ANGULAR: [&str; KNOTS] = [
    "angular velocity at the first radius over the assumed one",
    "angular velocity at the second radius over the assumed one",
    "angular velocity at the third radius over the assumed one",
    "angular velocity at the fourth radius over the assumed one",
    "angular velocity at the fifth radius over the assumed one",
    "angular velocity at the sixth radius over the assumed one",
];
const RADIAL: [&str; KNOTS] = [
    "radial velocity at the first radius over the assumed one",
    "radial velocity at the second radius over the assumed one",
    "radial velocity at the third radius over the assumed one",
    "radial velocity at the fourth radius over the assumed one",
    "radial velocity at the fifth radius over the assumed one",
    "radial velocity at the sixth radius over the assumed one",
];
