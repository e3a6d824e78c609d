//! Motion of matter: how fast it turns, and whether it falls.

use super::Axis;
use super::infall::{Falling, Origin, Profile};
use crate::Error;
use kerrlight_geodesic::Dual;
use kerrlight_geodesic::vector::{norm, rotate};
use std::sync::Arc;

/// Angular velocity as a function of the (spherical) radius, in radians a unit of time; positive is
/// right-handed about the axis. Matter of most laws stays at its radius; that of [`Falling`](Self::Falling) does not.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum AngularVelocity {
    /// 1/(r^{3/2} + drag), circular geodesics (Bardeen, Press & Teukolsky 1972): the drag is the spin for
    /// orbits about it, spin · ξ_z for tilted ones, 0 in the paper.
    Keplerian {
        /// Spin as the flow sees it, in M^{3/2}.
        drag: f64,
    },
    /// rate · (radius/r)^exponent.
    PowerLaw {
        /// Radius at which the rate is reached, M.
        radius: f64,
        /// Radians a unit of time.
        rate: f64,
        /// 1.5: Keplerian without spin.
        exponent: f64,
    },
    /// Linear between tabulated radii, and held beyond the first and the last.
    Table {
        /// Growing, M.
        radii: Vec<f64>,
        /// Radians a unit of time.
        rates: Vec<f64>,
    },
    /// Another one, faster by a factor.
    Scaled {
        /// The other one.
        of: Box<AngularVelocity>,
        /// Dimensionless.
        factor: f64,
    },
    /// Linear between knots, of matter that stays at its radius.
    Profile(Profile),
    /// Matter that changes its radius.
    Falling(Arc<Falling>),
}

/// Least |dr/dt|: below it matter is on a circle.
const STILL: f64 = 1e-12;

impl AngularVelocity {
    /// BH-NeRF's experiments of known velocity: e(t, x) = e₀(R(ξ, 2π t v(|x|)) x),
    /// v = (3.5/r)^{3/2} turns a unit of time. The pattern turns left-handed about ξ.
    pub fn bhnerf() -> Self {
        Self::PowerLaw { radius: 3.5, rate: -core::f64::consts::TAU, exponent: 1.5 }
    }

    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let finite = |field, value: f64| (field, value, value.is_finite(), "a finite number");
        match &self {
            Self::Keplerian { drag } => first_wrong([finite("drag", *drag)]),
            Self::PowerLaw { radius, rate, exponent } => first_wrong([
                ("radius", *radius, radius.is_finite() && *radius > 0.0, "above 0"),
                finite("rate", *rate),
                finite("exponent", *exponent),
            ]),
            // Made of numbers that were checked.
            Self::Profile(_) | Self::Falling(_) => Ok(()),
            Self::Scaled { of, factor } => {
                of.clone().checked()?;
                first_wrong([finite("factor", *factor)])
            }
            Self::Table { radii, rates } => {
                let (r, v) = (radii.len(), rates.len());
                let length = ("rates", v as f64, r == v && v > 0, "as many as radii, 1 or more");
                let positive = |x: &f64| x.is_finite() && *x > 0.0;
                let grow = radii.windows(2).map(|pair| {
                    ("radii", pair[1], positive(&pair[1]) && pair[1] > pair[0], "above 0, growing")
                });
                let first = radii.iter().take(1).map(|x| ("radii", *x, positive(x), "above 0"));
                let rates = rates.iter().map(|x| finite("rates", *x));
                first_wrong(core::iter::once(length).chain(first).chain(grow).chain(rates))
            }
        }?;
        Ok(self)
    }

    /// Ω in radians per M at radius r (M).
    pub fn rate(&self, r: f64) -> f64 {
        match self {
            Self::Keplerian { drag } => 1.0 / (r.powf(1.5) + drag),
            Self::PowerLaw { radius, rate, exponent } => rate * (radius / r).powf(*exponent),
            Self::Table { .. } => self.interpolated(r).0,
            Self::Profile(profile) => profile.rates(r)[1],
            Self::Falling(flow) => flow.rates(r)[1],
            Self::Scaled { of, factor } => factor * of.rate(r),
        }
    }

    /// dΩ/dr in radians per M² at radius r (M).
    pub fn slope(&self, r: f64) -> f64 {
        match self {
            Self::Keplerian { .. } => -1.5 * r.sqrt() * self.rate(r).powi(2),
            Self::PowerLaw { exponent, .. } => -exponent / r * self.rate(r),
            Self::Table { .. } => self.interpolated(r).1,
            Self::Profile(profile) => {
                let r = Dual::<f64, 1>::parameter(r, 0);
                profile.rates(r)[1].slope[0]
            }
            Self::Falling(flow) => flow.slopes(r)[1].slope[0],
            Self::Scaled { of, factor } => factor * of.slope(r),
        }
    }

    /// dr/dt, dimensionless, at radius r (M): 0 where matter turns on circles.
    pub fn fall(&self, r: f64) -> f64 {
        self.falling().map_or(0.0, |flow| flow.rates(r)[0])
    }

    /// The flow whose matter changes its radius; none where it turns on circles.
    pub fn falling(&self) -> Option<&Arc<Falling>> {
        match self {
            Self::Falling(flow) => Some(flow),
            _ => None,
        }
    }

    /// Returns the place of the matter at a point (M) `elapsed` (M) before, if it moves like this about an axis.
    pub fn before(&self, axis: Axis, point: [f64; 3], elapsed: f64) -> [f64; 3] {
        self.way_back(axis, point).before(elapsed)
    }

    /// The way that the matter at a point (M) has come, if it moves like this about an axis: what is the same for all
    /// times is looked up once.
    pub fn way_back(&self, axis: Axis, point: [f64; 3]) -> WayBack<'_> {
        let r = norm(point);
        let speed = match self.falling() {
            None => Speed::Circular(self.rate(r)),
            Some(flow) => Speed::Falling(flow, flow.origin(r)),
        };
        WayBack { axis: axis.vector(), point, speed }
    }

    /// Returns the factor by which a point at radius r (M) is stretched, and the angle by which it is turned about the
    /// axis (radians, right-handed), to where its matter was `elapsed` (M) before.
    pub fn step_back(&self, r: f64, elapsed: f64) -> [f64; 2] {
        match self.falling() {
            None => [1.0, -self.rate(r) * elapsed],
            Some(flow) => flow.before(&flow.origin(r), elapsed),
        }
    }

    /// Derivatives of [`step_back`](Self::step_back): of the stretch (per M) and the angle (radians per M) with respect to
    /// the radius, and of both with respect to the elapsed time.
    pub fn step_back_slopes(&self, r: f64, elapsed: f64) -> [[f64; 2]; 2] {
        let circular = || [[0.0, -self.slope(r) * elapsed], [0.0, -self.rate(r)]];
        let Some(flow) = self.falling() else { return circular() };
        let [fall, turn] = flow.rates(r);
        if fall.abs() < STILL {
            return circular();
        }
        let [stretch, _] = self.step_back(r, elapsed);
        let [fall_before, turn_before] = flow.rates(stretch * r);
        // ∫ dr/v between the two radii stays the same.
        let by_radius = [(fall_before / fall - stretch) / r, (turn_before - turn) / fall];
        [by_radius, [-fall_before / r, -turn_before]]
    }

    fn interpolated(&self, r: f64) -> (f64, f64) {
        let Self::Table { radii, rates } = self else { return (0.0, 0.0) };
        let above = radii.partition_point(|x| *x <= r);
        let at = |k: usize| (radii.get(k).copied(), rates.get(k).copied());
        // Below the first radius the index wraps to one that is not there.
        match (at(above.wrapping_sub(1)), at(above)) {
            ((Some(a), Some(left)), (Some(b), Some(right))) => {
                let slope = (right - left) / (b - a);
                (left + slope * (r - a), slope)
            }
            ((_, Some(end)), _) | (_, (_, Some(end))) => (end, 0.0),
            _ => (0.0, 0.0),
        }
    }

    /// Angle in radians by which the point at (x, y, z) is turned at time t to where its matter was at
    /// t₀ = `reference`, if it stays at its radius: −Ω(r)(t − t₀).
    pub fn angle(&self, point: [f64; 3], time: f64, reference: f64) -> f64 {
        -self.rate(norm(point)) * (time - reference)
    }
}

/// The way that the matter at a point has come.
#[derive(Clone, Copy, Debug)]
pub struct WayBack<'a> {
    axis: [f64; 3],
    point: [f64; 3],
    speed: Speed<'a>,
}

#[derive(Clone, Copy, Debug)]
enum Speed<'a> {
    Circular(f64),
    Falling(&'a Falling, Origin),
}

impl WayBack<'_> {
    /// Returns the place `elapsed` (M) before, M.
    pub fn before(&self, elapsed: f64) -> [f64; 3] {
        let (stretch, angle) = match &self.speed {
            Speed::Circular(rate) => (1.0, -rate * elapsed),
            Speed::Falling(flow, origin) => flow.before(origin, elapsed).into(),
        };
        rotate(self.axis, angle, self.point.map(|x| stretch * x))
    }
}

type Range = (&'static str, f64, bool, &'static str);

/// Refuses the first number that is out of its range.
pub(super) fn first_wrong(ranges: impl IntoIterator<Item = Range>) -> Result<(), Error> {
    let wrong = ranges.into_iter().find(|(_, _, ok, _)| !ok);
    wrong.map_or(Ok(()), |(field, value, _, allowed)| {
        Err(Error::out_of_range(field, value, allowed))
    })
}

/// Injection: the time when matter begins to shine; nothing is seen of what left a point before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Injection {
    /// Time of emission, in the points' own time (slow light: the frame's time less the delay).
    pub time: f64,
}

impl Injection {
    /// Returns whether a point shines at its time (M).
    pub fn shines(self, time: f64) -> bool {
        time >= self.time
    }
}
