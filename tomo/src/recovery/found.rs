//! Results of searches, and what of them a fit goes on with.

use super::problem::Problem;
use crate::fit::BackgroundDatum;
use crate::fit::geometry::Geometry;
use crate::fit::scan::{AxisLoss, AxisScan};
use crate::fit::settings::{FitFile, UnknownGeometry};
use crate::fit::setup::{self, BandScan, FoundGeometry, Held, Resolution};
use kerrlight_render::dynamics::Axis;

/// Stage before the emission is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// The parameters of the geometry that are not known.
    Geometry,
    /// The same, by the light curve of a flare in an orbital band.
    Band,
    /// A weight, by data that are held out.
    Weight,
}

/// Result of a search, with its problem.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Found<'a> {
    /// The geometry, of these settings and data.
    Geometry(&'a Problem, &'a UnknownGeometry, &'a FoundGeometry),
    /// Geometries and bands.
    Band(&'a Problem, &'a BandScan),
    /// Values of a weight.
    Weight(&'a FitFile, &'a [Held]),
}

/// Result of a search.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Searched {
    /// The geometry, with its errors.
    Geometry(Box<FoundGeometry>),
    /// Geometries and bands, with their probabilities.
    Band(BandScan),
}

/// Choice with which the rest of the fit goes on.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Choice {
    /// The geometry.
    Geometry {
        /// Spin, direction of the observer and parameters of the flow.
        geometry: Geometry,
        /// Resolution at which it was found.
        resolution: Resolution,
    },
    /// The best band.
    Band {
        /// Degrees.
        inclination_deg: f64,
        /// Degrees east of north.
        position_angle_deg: f64,
        /// Factor on the angular velocity.
        rotation_factor: f64,
        /// Expected background, Jy with its standard deviation.
        background: Option<Vec<BackgroundDatum>>,
    },
    /// Dimensionless, in the unit of its setting.
    Weight(f64),
}

impl Found<'_> {
    /// Returns the choice with which the fit goes on.
    pub fn choice(&self) -> Choice {
        match self {
            Found::Geometry(_, _, found) => {
                Choice::Geometry { geometry: found.geometry, resolution: found.resolution }
            }
            Found::Band(_, scan) => {
                let best = &scan.geometries[scan.best];
                Choice::Band {
                    inclination_deg: best.inclination_deg,
                    position_angle_deg: best.position_angle_deg,
                    rotation_factor: best.rotation_factor,
                    background: scan.background.clone(),
                }
            }
            Found::Weight(_, held) => {
                Choice::Weight(setup::best_held(held).map_or(f64::NAN, |best| best.value))
            }
        }
    }
}

/// The axis that a scan has found.
#[derive(Clone, Debug)]
pub struct FoundAxis {
    /// Scan of the whole sphere.
    pub scan: AxisScan,
    /// Near the best one, with a finer grid.
    pub refined: Option<AxisLoss>,
}

impl FoundAxis {
    /// The best axis.
    pub fn axis(&self) -> Axis {
        self.refined.unwrap_or(self.scan.best).axis
    }
}
