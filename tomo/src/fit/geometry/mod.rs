//! Unknown geometry beside the emission: the hole, the view of it, and how matter moves.
//!
//! [`Geometry`] is a point in the space of these parameters, and [`GeometryModel`] makes a forward model of it.

mod cma_es;
mod covariance;
mod discretisation;
mod fit_radius;
mod gauss_newton;
mod mirror_solution;
mod model;
mod neighbours;
mod prior;
mod problem;
mod quadratic_form;
mod uncertainty;

#[cfg(test)]
mod tests;

pub use cma_es::{Exploration, Explored, Sample, TrialWatch};
pub use discretisation::{ModelError, ModelErrors, Refined, Refinement, Standing};
pub use gauss_newton::Polished;
pub use model::{GeometryModel, Law};
pub use neighbours::Surroundings;
pub use prior::Prior;
pub use problem::{Effort, Estimate, Free, GeometryProblem, Span, bounded};
pub use quadratic_form::Envelope;
pub use uncertainty::Spread;

use crate::Error;
use core::f64::consts::{PI, TAU};
use serde::{Deserialize, Serialize};

/// A parameter of the geometry; its number is its place in [`Geometry`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// a, M; negative where matter that turns right-handed about the axis is retrograde.
    Spin,
    /// Angle from the spin axis to the observer, radians.
    #[serde(rename = "inclination_deg")]
    Inclination,
    /// Position angle of the spin axis on the sky, radians east of north (anticlockwise on images with north up).
    #[serde(rename = "position_angle_deg")]
    PositionAngle,
    /// ξ of [`Law::Infall`]: specific angular momentum over that of circular geodesics, 0 to 1.
    Xi,
    /// β_r of the same: radial velocity from that of free fall, 0, to that of circular orbits, 1.
    BetaR,
    /// β_φ of the same: the same of the angular velocity.
    BetaPhi,
}

/// Number of parameters.
pub const PARAMETERS: usize = 6;

impl Parameter {
    /// All of them, in the order of [`Geometry`].
    pub const ALL: [Parameter; PARAMETERS] = [
        Parameter::Spin,
        Parameter::Inclination,
        Parameter::PositionAngle,
        Parameter::Xi,
        Parameter::BetaR,
        Parameter::BetaPhi,
    ];

    /// Those of [`Law::Infall`] alone.
    pub const FLOW: [Parameter; 3] = [Parameter::Xi, Parameter::BetaR, Parameter::BetaPhi];

    /// Its words in a sentence, and its unit, degrees for angles.
    pub fn label(self) -> (&'static str, &'static str) {
        match self {
            Parameter::Spin => ("spin", ""),
            Parameter::Inclination => ("inclination", "°"),
            Parameter::PositionAngle => ("position angle of the spin", "°"),
            Parameter::Xi => ("angular momentum over that of circular orbits", ""),
            Parameter::BetaR => ("part of the radial velocity that is not free fall", ""),
            Parameter::BetaPhi => ("part of the angular velocity that is not free fall", ""),
        }
    }

    /// Returns its name in settings and results.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::Spin => "spin",
            Parameter::Inclination => "inclination_deg",
            Parameter::PositionAngle => "position_angle_deg",
            Parameter::Xi => "xi",
            Parameter::BetaR => "beta_r",
            Parameter::BetaPhi => "beta_phi",
        }
    }

    /// Returns the unit of settings and results in [`Geometry`]: a degree is π/180.
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
            // Priors may lie about an angle of either sign: what is found stays near them.
            Parameter::PositionAngle => [-TAU, TAU],
            Parameter::Xi | Parameter::BetaR | Parameter::BetaPhi => [0.0, 1.0],
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
            Parameter::Xi => 0.15,
            Parameter::BetaR => 0.05,
            Parameter::BetaPhi => 0.1,
        }
    }
}

/// A value of every parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry([f64; PARAMETERS]);

impl Geometry {
    /// The bits of all its numbers.
    pub(crate) fn bits(&self) -> Vec<u64> {
        crate::fit::journal::bits(&self.0)
    }

    /// A hole whose spin points towards north, with matter on circular orbits where the law has three more parameters.
    pub fn new(spin: f64, inclination: f64) -> Self {
        Geometry([spin, inclination, 0.0, 1.0, 1.0, 1.0])
    }

    /// Returns the value of a parameter.
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter as usize]
    }

    /// The same with another value of a parameter.
    pub fn with(mut self, parameter: Parameter, value: f64) -> Self {
        self.0[parameter as usize] = value;
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
                    Parameter::Xi | Parameter::BetaR | Parameter::BetaPhi => "0 to 1",
                };
                return Err(Error::out_of_range(parameter.name(), value, allowed));
            }
        }
        Ok(self)
    }
}
