//! Random rays of every kind, the same for the same seed.

use kerrlight_geodesic::analytic::CriticalCurve;
use kerrlight_geodesic::{Error, Inclination, Kerr, Observer};
use rand::{Rng, RngExt};
use std::f64::consts::{PI, TAU};

/// A kind of ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Anywhere within 15 M of the centre of the screen.
    Generic,
    /// A relative 1e-14 to 0.1 beside the critical curve.
    NearCritical,
    /// Inclination 1e-10 to 0.1 rad off the axis.
    NearPolar,
    /// Captured, and looked at inside 1.2 horizon radii.
    NearHorizon,
    /// Impact parameters of 1e2 to 1e6 M.
    Far,
}

impl Class {
    /// All of them.
    pub const ALL: [Class; 5] =
        [Class::Generic, Class::NearCritical, Class::NearPolar, Class::NearHorizon, Class::Far];

    /// The word that tables use.
    pub fn name(self) -> &'static str {
        match self {
            Class::Generic => "generic",
            Class::NearCritical => "near-critical",
            Class::NearPolar => "near-polar",
            Class::NearHorizon => "near-horizon",
            Class::Far => "far",
        }
    }

    /// Radius of the observer, in M.
    pub fn observer_radius(self) -> f64 {
        if self == Class::Far { 1e8 } else { 1000.0 }
    }
}

/// An angle as it was given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Angle {
    /// Radians.
    Radians(f64),
    /// Degrees, where 0, 90 and 180 are exact.
    Degrees(f64),
}

impl Angle {
    /// Returns the inclination.
    ///
    /// # Errors
    /// If it is out of range.
    pub fn inclination(self) -> Result<Inclination, Error> {
        match self {
            Angle::Radians(angle) => Inclination::from_radians(angle),
            Angle::Degrees(angle) => Inclination::from_degrees(angle),
        }
    }
}

/// A ray by what the user gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Draw {
    /// Spin.
    pub spin: f64,
    /// Inclination.
    pub inclination: Angle,
    /// Radius of the observer, infinity included.
    pub radius: f64,
    /// Bardeen's α, in M.
    pub alpha: f64,
    /// Bardeen's β, in M.
    pub beta: f64,
}

impl Draw {
    /// The observer.
    ///
    /// # Errors
    /// If a value is out of its range.
    pub fn observer(&self) -> Result<Observer, Error> {
        let inclination = self.inclination.inclination()?;
        if self.radius.is_finite() {
            Observer::at_radius(inclination, self.radius)
        } else {
            Ok(Observer::at_infinity(inclination))
        }
    }
}

/// 10 to a power that is uniform between two exponents.
pub fn log_uniform(rng: &mut impl Rng, from: f64, to: f64) -> f64 {
    10f64.powf(rng.random_range(from..to))
}

/// A point uniform in a disc.
pub fn in_disc(rng: &mut impl Rng, radius: f64) -> [f64; 2] {
    let (angle, r) = (rng.random_range(0.0..TAU), radius * rng.random::<f64>().sqrt());
    [r * angle.cos(), r * angle.sin()]
}

/// A point beside the critical curve, by a relative distance, on either side of it.
///
/// # Errors
/// If spin or inclination is out of range.
pub fn beside_critical_curve(
    rng: &mut impl Rng,
    spin: f64,
    inclination: Angle,
    distance: f64,
) -> Result<[f64; 2], Error> {
    let curve = CriticalCurve::new(&Kerr::new(spin)?, inclination.inclination()?);
    let point = curve.point(rng.random_range(0.0..TAU));
    let factor = if rng.random() { 1.0 + distance } else { 1.0 - distance };
    Ok([point.alpha * factor, point.beta * factor])
}

/// `n` random rays of a class around a hole of this spin, all seen by one observer.
///
/// # Errors
/// If the spin is out of range.
pub fn draw(rng: &mut impl Rng, class: Class, spin: f64, n: usize) -> Result<Vec<Draw>, Error> {
    let mut inclination = f64::acos(rng.random_range(-1.0..1.0));
    if class == Class::NearPolar {
        inclination = log_uniform(rng, -10.0, -1.0);
        if rng.random() {
            inclination = PI - inclination;
        }
    }
    let inclination = Angle::Radians(inclination);
    (0..n)
        .map(|_| {
            let [alpha, beta] = match class {
                Class::Generic | Class::NearPolar => in_disc(rng, 15.0),
                Class::NearCritical => {
                    let distance = log_uniform(rng, -14.0, -1.0);
                    beside_critical_curve(rng, spin, inclination, distance)?
                }
                Class::NearHorizon => in_disc(rng, 1.8),
                Class::Far => {
                    let (b, angle) = (log_uniform(rng, 2.0, 6.0), rng.random_range(0.0..TAU));
                    [b * angle.cos(), b * angle.sin()]
                }
            };
            Ok(Draw { spin, inclination, radius: class.observer_radius(), alpha, beta })
        })
        .collect()
}
