//! What a fit may not know of the world beside the emission: the hole, the view of it, and how matter moves.
//!
//! [`World`] is a point in the space of these parameters, [`WorldModel`] makes a forward model of it, and
//! [`Tangents`] say how each node moves with each parameter, so that images, χ² and gradients follow exactly.

mod covariance;
mod derivative;
mod discretisation;
mod envelope;
mod explore;
mod fall;
mod knots;
mod model;
mod polish;
mod prior;
mod problem;
mod reach;
mod redshift;
mod scan;
mod spread;
mod surroundings;
mod tangents;
mod twin;

#[cfg(test)]
mod tests;

pub use derivative::WorldBuffers;
pub use discretisation::{ModelError, ModelErrors, Refined, Refinement, Standing};
pub use envelope::Envelope;
pub use explore::{Exploration, Explored, Sample, WorldWatch};
pub use model::{Law, WorldModel};
pub use polish::{Polish, Polished};
pub use prior::Prior;
pub use problem::{Effort, Estimate, Free, Span, WorldProblem};
pub use scan::{ScanPoint, Scanned, WorldScan};
pub use spread::Spread;
pub use surroundings::Surroundings;
pub use tangents::Tangents;

use crate::Error;
use core::f64::consts::{PI, TAU};
use kerrlight_geodesic::Dual;

/// A parameter of the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// a, M; negative where matter that turns right-handed about the axis is retrograde.
    Spin,
    /// Angle from the spin axis to the observer, radians.
    Inclination,
    /// Of the spin axis on the sky, radians east of north (anticlockwise on images with north up).
    PositionAngle,
    /// Where the hole is on the screen, M of the reference mass to the right (west).
    OffsetX,
    /// The same, upwards (north).
    OffsetY,
    /// Mass over the reference mass, dimensionless: the unit of time, and the angular size at the same distance.
    Mass,
    /// Angular velocity over that of the law, dimensionless: below 1, sub-Keplerian.
    Rotation,
    /// Power of g that emission goes with, dimensionless: 2 + spectral index.
    RedshiftPower,
    /// ξ of [`Law::Infall`]: specific angular momentum over that of circular geodesics, 0 to 1.
    Xi,
    /// β_r of the same: radial velocity from that of free fall, 0, to that of circular orbits, 1.
    BetaR,
    /// β_φ of the same: the same of the angular velocity.
    BetaPhi,
    /// Ω at a knot of [`Law::Profile`], the first of which is 0 and the last below [`KNOTS`], over that of the profile,
    /// dimensionless.
    Angular(u8),
    /// dr/dt at a knot of the same, over that of the profile.
    Radial(u8),
}

/// Knots of a [`Law::Profile`], at most.
pub const KNOTS: usize = 6;

/// Number of parameters.
pub const PARAMETERS: usize = 11 + 2 * KNOTS;

/// A number with its derivatives with respect to all parameters.
pub(super) type Number = Dual<f64, PARAMETERS>;

/// Names of the factors at the knots.
const ANGULAR: [&str; KNOTS] = [
    "angular_factor_0",
    "angular_factor_1",
    "angular_factor_2",
    "angular_factor_3",
    "angular_factor_4",
    "angular_factor_5",
];
const RADIAL: [&str; KNOTS] = [
    "radial_factor_0",
    "radial_factor_1",
    "radial_factor_2",
    "radial_factor_3",
    "radial_factor_4",
    "radial_factor_5",
];

/// Their words in a sentence.
const ANGULAR_LABELS: [&str; KNOTS] = [
    "angular velocity at the first radius over the assumed one",
    "angular velocity at the second radius over the assumed one",
    "angular velocity at the third radius over the assumed one",
    "angular velocity at the fourth radius over the assumed one",
    "angular velocity at the fifth radius over the assumed one",
    "angular velocity at the sixth radius over the assumed one",
];
const RADIAL_LABELS: [&str; KNOTS] = [
    "radial velocity at the first radius over the assumed one",
    "radial velocity at the second radius over the assumed one",
    "radial velocity at the third radius over the assumed one",
    "radial velocity at the fourth radius over the assumed one",
    "radial velocity at the fifth radius over the assumed one",
    "radial velocity at the sixth radius over the assumed one",
];

impl Parameter {
    /// All of them, in the order of [`World`].
    pub const ALL: [Parameter; PARAMETERS] = [
        Parameter::Spin,
        Parameter::Inclination,
        Parameter::PositionAngle,
        Parameter::OffsetX,
        Parameter::OffsetY,
        Parameter::Mass,
        Parameter::Rotation,
        Parameter::RedshiftPower,
        Parameter::Xi,
        Parameter::BetaR,
        Parameter::BetaPhi,
        Parameter::Angular(0),
        Parameter::Angular(1),
        Parameter::Angular(2),
        Parameter::Angular(3),
        Parameter::Angular(4),
        Parameter::Angular(5),
        Parameter::Radial(0),
        Parameter::Radial(1),
        Parameter::Radial(2),
        Parameter::Radial(3),
        Parameter::Radial(4),
        Parameter::Radial(5),
    ];

    /// Those of [`Law::Infall`] alone.
    pub const FLOW: [Parameter; 3] = [Parameter::Xi, Parameter::BetaR, Parameter::BetaPhi];

    /// Its place in [`World`].
    pub fn index(self) -> usize {
        match self {
            Parameter::Spin => 0,
            Parameter::Inclination => 1,
            Parameter::PositionAngle => 2,
            Parameter::OffsetX => 3,
            Parameter::OffsetY => 4,
            Parameter::Mass => 5,
            Parameter::Rotation => 6,
            Parameter::RedshiftPower => 7,
            Parameter::Xi => 8,
            Parameter::BetaR => 9,
            Parameter::BetaPhi => 10,
            Parameter::Angular(knot) => 11 + usize::from(knot),
            Parameter::Radial(knot) => 11 + KNOTS + usize::from(knot),
        }
    }

    /// Its words in a sentence, and its unit, degrees for angles.
    pub fn label(self) -> (&'static str, &'static str) {
        match self {
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
            Parameter::Angular(knot) => (ANGULAR_LABELS[usize::from(knot)], ""),
            Parameter::Radial(knot) => (RADIAL_LABELS[usize::from(knot)], ""),
        }
    }

    /// Whether it is a factor at a knot of [`Law::Profile`].
    pub fn is_of_knots(self) -> bool {
        matches!(self, Parameter::Angular(_) | Parameter::Radial(_))
    }

    /// What settings and results call it.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::Spin => "spin",
            Parameter::Inclination => "inclination_deg",
            Parameter::PositionAngle => "position_angle_deg",
            Parameter::OffsetX => "offset_x",
            Parameter::OffsetY => "offset_y",
            Parameter::Mass => "mass_factor",
            Parameter::Rotation => "rotation_factor",
            Parameter::RedshiftPower => "redshift_power",
            Parameter::Xi => "xi",
            Parameter::BetaR => "beta_r",
            Parameter::BetaPhi => "beta_phi",
            Parameter::Angular(knot) => ANGULAR[usize::from(knot)],
            Parameter::Radial(knot) => RADIAL[usize::from(knot)],
        }
    }

    /// What one of settings and results is in [`World`]: a degree is π/180.
    pub fn unit(self) -> f64 {
        match self {
            Parameter::Inclination | Parameter::PositionAngle => PI / 180.0,
            _ => 1.0,
        }
    }

    /// Least and largest value that a model exists for.
    pub fn range(self) -> [f64; 2] {
        match self {
            // Derivatives end where the horizons meet.
            Parameter::Spin => [-0.999, 0.999],
            Parameter::Inclination => [0.0, PI],
            Parameter::PositionAngle => [-TAU, TAU],
            Parameter::OffsetX | Parameter::OffsetY => [-1e3, 1e3],
            Parameter::Mass => [1e-3, 1e3],
            Parameter::Rotation => [-10.0, 10.0],
            Parameter::RedshiftPower => [-10.0, 10.0],
            Parameter::Xi | Parameter::BetaR | Parameter::BetaPhi => [0.0, 1.0],
            Parameter::Angular(_) | Parameter::Radial(_) => [1e-3, 1e3],
        }
    }

    /// The difference of two values, the short way about a circle for angles on the sky.
    pub fn difference(self, a: f64, b: f64) -> f64 {
        match self {
            Parameter::PositionAngle => (a - b + PI).rem_euclid(TAU) - PI,
            _ => a - b,
        }
    }

    /// A step that changes images by about as much as one of any other parameter.
    pub fn scale(self) -> f64 {
        match self {
            Parameter::Spin => 0.3,
            Parameter::Inclination | Parameter::PositionAngle => 0.2,
            Parameter::OffsetX | Parameter::OffsetY => 0.5,
            Parameter::Mass | Parameter::Rotation | Parameter::Angular(_) => 0.1,
            Parameter::RedshiftPower => 0.5,
            Parameter::Xi => 0.15,
            Parameter::BetaR => 0.05,
            Parameter::BetaPhi => 0.1,
            Parameter::Radial(_) => 0.3,
        }
    }
}

/// A value of every parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World([f64; PARAMETERS]);

impl World {
    /// The bits of all its numbers.
    pub(crate) fn bits(&self) -> Vec<u64> {
        crate::fit::journal::bits(&self.0)
    }

    /// A hole of the reference mass in the middle of the screen, its spin towards north, matter as fast as the law or the
    /// profile, and on circular orbits where the law has three more parameters.
    pub fn new(spin: f64, inclination: f64, redshift_power: f64) -> Self {
        let mut world = World([1.0; PARAMETERS]);
        for (parameter, value) in [
            (Parameter::Spin, spin),
            (Parameter::Inclination, inclination),
            (Parameter::PositionAngle, 0.0),
            (Parameter::OffsetX, 0.0),
            (Parameter::OffsetY, 0.0),
            (Parameter::RedshiftPower, redshift_power),
        ] {
            world = world.with(parameter, value);
        }
        world
    }

    /// Of a parameter.
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// The same with another value of a parameter.
    pub fn with(mut self, parameter: Parameter, value: f64) -> Self {
        self.0[parameter.index()] = value;
        self
    }

    /// Itself, if every value is in its range.
    ///
    /// # Errors
    /// Names the parameter that is not.
    pub fn checked(self) -> Result<Self, Error> {
        for parameter in Parameter::ALL {
            let ([low, high], value) = (parameter.range(), self.get(parameter));
            if !(low..=high).contains(&value) {
                let allowed = match parameter {
                    Parameter::Spin => "-0.999 to 0.999",
                    Parameter::Inclination => "0 to pi radians",
                    Parameter::PositionAngle => "-2 pi to 2 pi radians",
                    Parameter::OffsetX | Parameter::OffsetY => "-1000 to 1000 M",
                    Parameter::Mass => "0.001 to 1000",
                    Parameter::Rotation | Parameter::RedshiftPower => "-10 to 10",
                    Parameter::Xi | Parameter::BetaR | Parameter::BetaPhi => "0 to 1",
                    Parameter::Angular(_) | Parameter::Radial(_) => "0.001 to 1000",
                };
                return Err(Error::out_of_range(parameter.name(), value, allowed));
            }
        }
        Ok(self)
    }

    /// All values, each the parameter of its own derivative.
    pub(super) fn numbers(&self) -> [Number; PARAMETERS] {
        core::array::from_fn(|k| Number::parameter(self.0[k], k))
    }
}
