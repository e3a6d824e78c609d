//! Laws of motion, as files write them.

use super::AngularVelocity;
use super::infall::{Falling, Family, Law, Profile};
use crate::Error;
use kerrlight_geodesic::infall::Mixture;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Motion of matter about an axis, as scenes and fits write it: a law of the angular velocity Ω(r), or one of both Ω and
/// dr/dt. Numbers of the type `N` are those that a fit may not know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Velocity<N = f64> {
    /// Ω = 1/(r^{3/2} + drag).
    Keplerian {
        /// Spin of the flow; for circular geodesics that of the hole. Without it, a ξ_z.
        #[schemars(range(min = -1.0, max = 1.0), extend("unit" = "a/M, as Ω = 1/(r^{3/2} + drag)"))]
        drag: Option<f64>,
    },
    /// Ω = rate (radius/r)^exponent.
    PowerLaw {
        /// Radius at which Ω is `rate`, M.
        #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
        radius: f64,
        /// Ω there, radians per M.
        #[schemars(range(min = -1e3, max = 1e3), extend("unit" = "radians per M"))]
        rate: f64,
        /// 1.5: Keplerian without spin; 0: a rigid body.
        #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "an exponent"))]
        exponent: f64,
    },
    /// Ω linear between the entries, constant beyond.
    Table {
        /// Growing radii, M.
        #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "M"))]
        radii: Vec<f64>,
        /// Ω at each, radians per M.
        #[schemars(inner(range(min = -1e3, max = 1e3)), extend("unit" = "radians per M"))]
        rates: Vec<f64>,
    },
    /// Another law plus a Gaussian process in radius.
    Perturbed(Perturbed<N>),
    /// Mixture of circular orbits and free fall (Cárdenas-Avendaño, Lupsasca & Zhu 2023).
    Infall {
        /// ξ: specific angular momentum over that of circular geodesics.
        #[schemars(extend("minimum" = 0.0, "maximum" = 1.0, "unit" = "an angular momentum over that of circular orbits"))]
        xi: N,
        /// β_r: 1, radial velocity of circular orbits and their plunge; 0, of free fall.
        #[schemars(extend("minimum" = 0.0, "maximum" = 1.0, "unit" = "0: free fall, 1: circular"))]
        beta_r: N,
        /// β_φ: the same of the angular velocity.
        #[schemars(extend("minimum" = 0.0, "maximum" = 1.0, "unit" = "0: free fall, 1: circular"))]
        beta_phi: N,
        /// Spin of the flow. Without it, a ξ_z.
        #[schemars(range(min = -1.0, max = 1.0), extend("unit" = "a/M"))]
        drag: Option<f64>,
    },
    /// Monotone cubics through Ω and dr/dt, constant beyond.
    Profile {
        /// Growing radii, M.
        #[schemars(inner(range(min = 1e-3, max = 1e6)), extend("unit" = "M"))]
        radii: Vec<f64>,
        /// Ω at each, radians per M.
        #[schemars(inner(range(min = -1e3, max = 1e3)), extend("unit" = "radians per M"))]
        angular: Vec<f64>,
        /// dr/dt at each: all below 0, all above 0, or all 0.
        #[schemars(inner(range(min = -1.0, max = 1.0)), extend("unit" = "dr/dt"))]
        radial: Vec<f64>,
    },
}

/// A law and a Gaussian process over the radius, which is drawn from a seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perturbed<N = f64> {
    /// The law that is perturbed.
    pub of: Box<Velocity<N>>,
    /// Standard deviation of the process, rad/M.
    pub deviation: f64,
    /// Its correlation length, M.
    pub correlation_length: f64,
    /// First and last radius of its table of 100 rows, M.
    pub radii: [f64; 2],
    /// Its seed; the fit's without it.
    pub seed: Option<u64>,
}

impl<N> Velocity<N> {
    /// Itself with other numbers in place of those that may not be known.
    pub fn map<M>(self, f: &impl Fn(N) -> M) -> Velocity<M> {
        match self {
            Velocity::Keplerian { drag } => Velocity::Keplerian { drag },
            Velocity::PowerLaw { radius, rate, exponent } => {
                Velocity::PowerLaw { radius, rate, exponent }
            }
            Velocity::Table { radii, rates } => Velocity::Table { radii, rates },
            Velocity::Perturbed(Perturbed { of, deviation, correlation_length, radii, seed }) => {
                let of = Box::new(of.map(f));
                Velocity::Perturbed(Perturbed { of, deviation, correlation_length, radii, seed })
            }
            Velocity::Infall { xi, beta_r, beta_phi, drag } => {
                Velocity::Infall { xi: f(xi), beta_r: f(beta_r), beta_phi: f(beta_phi), drag }
            }
            Velocity::Profile { radii, angular, radial } => {
                Velocity::Profile { radii, angular, radial }
            }
        }
    }

    /// Itself with `seed` for the perturbations that have none.
    #[must_use]
    pub fn seeded(mut self, seed: u64) -> Self {
        let mut law = &mut self;
        while let Velocity::Perturbed(by) = law {
            by.seed.get_or_insert(seed);
            law = &mut by.of;
        }
        self
    }
}

impl Velocity {
    /// Returns the angular velocity about a hole whose spin as the flow sees it is `drag` (M); perturbations without a
    /// seed are drawn from `seed`.
    ///
    /// # Errors
    /// Names the number that is out of its range, or says that what falls cannot be perturbed.
    pub fn angular(&self, seed: u64, drag: f64) -> Result<AngularVelocity, Error> {
        match self.clone() {
            Velocity::Keplerian { drag: own } => {
                AngularVelocity::Keplerian { drag: own.unwrap_or(drag) }
            }
            Velocity::PowerLaw { radius, rate, exponent } => {
                AngularVelocity::PowerLaw { radius, rate, exponent }
            }
            Velocity::Table { radii, rates } => AngularVelocity::Table { radii, rates },
            Velocity::Perturbed(by) => {
                let of = by.of.angular(seed, drag)?;
                if of.falling().is_some() {
                    let allowed = "a law of matter that stays at its radius";
                    return Err(Error::out_of_range("of", f64::NAN, allowed));
                }
                of.perturbed(&by, by.seed.unwrap_or(seed))?
            }
            Velocity::Infall { xi, beta_r, beta_phi, drag: own } => {
                let mixture = Mixture { xi, beta_r, beta_phi };
                let law = Law::Family(Family { spin: own.unwrap_or(drag), mixture });
                AngularVelocity::Falling(Arc::new(Falling::new(law)?))
            }
            Velocity::Profile { radii, angular, radial } => {
                match Profile::new(radii, angular, radial)? {
                    profile if profile.falls() => {
                        AngularVelocity::Falling(Arc::new(Falling::new(Law::Profile(profile))?))
                    }
                    profile => AngularVelocity::Profile(profile),
                }
            }
        }
        .checked()
    }

    /// Returns whether matter changes its radius.
    pub fn falls(&self) -> bool {
        match self {
            Velocity::Infall { .. } => true,
            Velocity::Profile { radial, .. } => radial.iter().any(|v| *v != 0.0),
            _ => false,
        }
    }

    /// Itself with `drag` (M) for a flow that follows its hole.
    #[must_use]
    pub fn dragged(mut self, spin: f64) -> Self {
        let mut law = &mut self;
        while let Velocity::Perturbed(by) = law {
            law = &mut by.of;
        }
        if let Velocity::Keplerian { drag } | Velocity::Infall { drag, .. } = law {
            drag.get_or_insert(spin);
        }
        self
    }

    /// Returns whether all perturbations have seeds.
    pub fn has_seeds(&self) -> bool {
        match self {
            Velocity::Perturbed(by) => by.seed.is_some() && by.of.has_seeds(),
            _ => true,
        }
    }
}
