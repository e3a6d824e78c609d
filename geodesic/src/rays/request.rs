//! Requests for quantities along rays. Quantities that are not requested are not integrated.

use crate::error::{Error, check};
use crate::spacetime::quantities::Quantities;

/// Placement of samples on a ray, from the observer on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum Placement {
    /// Nowhere.
    #[default]
    None,
    /// This many points equidistant in Mino time, from the observer to the ray's end: the horizon, or back at the
    /// observer's radius; infinity for an observer who is there and for a camera. Points at infinity are left out.
    MinoTime(usize),
    /// Middles of this many pieces of equal length ∫Σ dτ (the affine parameter, for unit energy) of the part inside
    /// a sphere.
    PathLength {
        /// Number of pieces.
        points: usize,
        /// Boyer–Lindquist radius of the sphere, in M.
        radius: f64,
    },
    /// Nodes of the Gauss–Legendre rule in Mino time on each of the one or two pieces of the ray between two radii.
    GaussLegendre {
        /// Nodes on each piece.
        points: usize,
        /// Smaller radius, in M.
        from: f64,
        /// Larger radius, in M.
        to: f64,
    },
}

/// Quantities wanted of every ray. r, θ and Mino time come with every point.
///
/// ```
/// use kerrlight_geodesic::{Placement, Request};
/// // Positions on the equatorial plane with azimuths, and nothing else:
/// let request = Request { crossings: 3, azimuth: true, ..Request::default() };
/// assert!(request.samples == Placement::None && !request.time);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Request {
    /// Largest number of equatorial crossings.
    pub crossings: usize,
    /// Placement of samples.
    pub samples: Placement,
    /// Azimuth.
    pub azimuth: bool,
    /// Coordinate time.
    pub time: bool,
    /// Covariant four-momentum; brings the azimuth with it.
    pub momentum: bool,
    /// The path weight of samples: what an integral over the affine parameter
    /// s = ∫Σ dτ gives to each.
    pub weight: bool,
    /// Estimates of the errors of positions.
    pub uncertainty: bool,
}

/// The most crossings that can be asked for: a ray whose numbers tell it from the critical curve has some dozens.
const MOST_CROSSINGS: usize = 1000;

impl Request {
    /// Everything about this many crossings.
    pub fn crossings(n: usize) -> Self {
        Request { crossings: n, azimuth: true, time: true, ..Request::default() }
    }

    /// Everything about samples placed like this.
    pub fn samples(placement: Placement) -> Self {
        Request { samples: placement, azimuth: true, time: true, ..Request::default() }
    }

    pub(crate) fn quantities(&self) -> Quantities {
        Quantities {
            azimuth: self.azimuth || self.momentum,
            time: self.time,
            velocity: self.momentum,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let count = |field, n: usize| {
            check(field, n as f64, (1..=1_000_000).contains(&n), "a number in [1, 1000000]")
        };
        let ok = self.crossings <= MOST_CROSSINGS;
        check("crossings", self.crossings as f64, ok, "a number in [0, 1000]")?;
        match self.samples {
            Placement::None => {}
            Placement::MinoTime(points) => {
                count("samples", points)?;
            }
            Placement::PathLength { points, radius } => {
                count("samples", points)?;
                let ok = radius > 0.0 && radius.is_finite();
                check("radius of the sphere", radius, ok, "a positive finite number (M)")?;
            }
            Placement::GaussLegendre { points, from, to } => {
                // Finding the nodes takes a time that grows with the square of their number.
                let ok = (1..=10_000).contains(&points);
                check("samples", points as f64, ok, "a number of nodes in [1, 10000]")?;
                check("from", from, from > 0.0 && from.is_finite(), "a positive number (M)")?;
                let ok = to > from && to.is_finite();
                check("to", to, ok, "a finite number above `from` (M)")?;
            }
        }
        Ok(())
    }
}
