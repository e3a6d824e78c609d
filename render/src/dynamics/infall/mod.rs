//! Matter that moves along the radius besides, at the same angle to its axis: dr/dt and Ω are functions of the radius.
//!
//! Infall. With T(r) = ∫dr/v and Φ(r) = ∫Ω dr/v, v = dr/dt, matter at r was at r₀ with T(r₀) = T(r) − Δt a time Δt
//! before, and has turned by Φ(r) − Φ(r₀) since. One table of r and Φ by T does both.

mod profile;
#[cfg(test)]
mod tests;
mod trajectory;

pub use profile::Profile;
pub use trajectory::{Table, Trajectory};

use crate::Error;
use kerrlight_geodesic::infall::{Infall, Mixture};
use kerrlight_geodesic::{Elementary, Kerr, Scalar};
use trajectory::{Along, Point, Way};

/// Farther out matter is not followed, M.
const FARTHEST: f64 = 1e7;

/// β_r nearer to 1 is 1: matter that would take 10⁸ M for 1 M.
const STILL: f64 = 1e-8;

/// Holes that turn faster are taken for those that turn so fast.
const EXTREMAL: f64 = 1.0 - 1e-12;

/// Distance of the innermost stable orbit from the horizon, M, below which nothing between them is told apart.
const NARROW: f64 = 1e-4;

/// Law that gives dr/dt and Ω.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// The family between circular orbits and free fall ([`Infall`]), about the axis of the flow.
    Family(Family),
    /// Values between knots.
    Profile(Profile),
}

/// A flow whose matter changes its radius, with the table that carries it along.
#[derive(Clone, Debug, PartialEq)]
pub struct Falling {
    law: Law,
    /// Factor on angular velocities.
    factor: f64,
    flow: Option<Infall<Along>>,
    table: Trajectory,
    /// Radius from which on matter stays where it is, M.
    circular: f64,
}

/// Place of matter on its fall, for [`Falling::before`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    radius: f64,
    /// Not a number where matter stays at its radius.
    time: f64,
    /// Azimuth, or Ω where matter stays at its radius.
    azimuth: f64,
}

impl Origin {
    /// Returns its radius, M.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// When, by the table, and its azimuth; no number, and Ω, where matter stays at its radius.
    pub fn in_table(&self) -> [f64; 2] {
        [self.time, self.azimuth]
    }
}

/// Numbers of the family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Family {
    /// a of the hole as the flow sees it, M: negative where it is retrograde.
    pub spin: f64,
    /// Mixture of circles and free fall.
    pub mixture: Mixture,
}

impl Falling {
    /// Makes the flow with a table of its own: about a millisecond.
    ///
    /// # Errors
    /// If a number is out of its range, or a profile's matter does not change its radius.
    pub fn new(law: Law) -> Result<Self, Error> {
        let profile = match &law {
            Law::Family(family) => return family.falling(),
            Law::Profile(profile) => profile,
        };
        if !profile.falls() {
            return Err(Error::out_of_range("radial", 0.0, "not 0, where matter falls"));
        }
        let table = profile.trajectory();
        Ok(Self { law, factor: 1.0, flow: None, table, circular: f64::INFINITY })
    }

    /// Returns the law that it follows.
    pub fn law(&self) -> &Law {
        &self.law
    }

    /// dr/dt (dimensionless) and Ω (radians per M) at radius r (M); at and inside the horizon those next to it.
    pub fn rates(&self, r: f64) -> [f64; 2] {
        self.slopes(r).map(|rate| rate.value)
    }

    /// The same with the derivatives with respect to r.
    pub fn slopes(&self, r: f64) -> [Along; 2] {
        let r = Along::parameter(r, 0);
        let [fall, turn] = match (&self.law, &self.flow) {
            (Law::Profile(profile), _) => profile.rates(r),
            (Law::Family(_), Some(flow)) => flow.rates(outside(flow, r)),
            (Law::Family(_), None) => [Along::constant(0.0); 2],
        };
        [fall, turn * Along::constant(self.factor)]
    }

    /// The same with all angular velocities multiplied by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let table = self.table.turned(factor);
        Self { factor: factor * self.factor, table, ..self.clone() }
    }

    /// The table, number by number.
    pub fn numbers(&self) -> Table {
        self.table.numbers()
    }

    /// Matter at a radius (M), to be carried back.
    pub fn origin(&self, radius: f64) -> Origin {
        let inside = (radius < self.circular).then(|| self.table.time_at(radius)).flatten();
        match inside {
            Some(time) => Origin { radius, time, azimuth: self.table.at(time)[1] },
            None => Origin { radius, time: f64::NAN, azimuth: self.rates(radius)[1] },
        }
    }

    /// Returns the factor by which a point is stretched, and the angle by which it is turned about the axis (radians,
    /// right-handed), to where its matter was `elapsed` (M) before.
    #[inline]
    pub fn before(&self, origin: &Origin, elapsed: f64) -> [f64; 2] {
        if origin.time.is_nan() {
            return [1.0, -origin.azimuth * elapsed];
        }
        let [radius, azimuth] = self.table.at(origin.time - elapsed);
        [radius / origin.radius, azimuth - origin.azimuth]
    }

    /// The radius at which matter at `radius` was `elapsed` before, M.
    pub fn radius_before(&self, radius: f64, elapsed: f64) -> f64 {
        radius * self.before(&self.origin(radius), elapsed)[0]
    }
}

impl Family {
    fn flow(&self) -> Result<Infall<Along>, Error> {
        let s = Along::constant;
        let Mixture { xi, beta_r, beta_phi } = self.mixture;
        let mixture = Mixture { xi: s(xi), beta_r: s(beta_r), beta_phi: s(beta_phi) };
        // Derivatives end where the horizons meet.
        let spin = self.spin;
        let is_extremal = spin.abs() > EXTREMAL && spin.abs() <= 1.0;
        let spin = if is_extremal { EXTREMAL.copysign(spin) } else { spin };
        Ok(Infall::new(&Kerr::from_spin(s(spin))?, mixture)?)
    }

    /// Returns the radius from which on matter stays where it is, M.
    fn circular_from(&self) -> Result<f64, Error> {
        Ok(if self.is_still() { self.flow()?.isco().value } else { f64::INFINITY })
    }

    fn is_still(&self) -> bool {
        1.0 - self.mixture.beta_r < STILL
    }

    /// The fall from far away, or from the innermost stable orbit where matter stays on circles outside of it, to next
    /// to the horizon.
    fn trajectory(&self) -> Result<Trajectory, Error> {
        let (flow, s) = (self.flow()?, Along::constant);
        let (isco, horizon) = (flow.isco(), flow.hole().horizon());
        let gap = isco - horizon;
        // Of extremal holes there are no digits for what lies inside of the orbit.
        let is_narrow = gap.value() < NARROW;
        let gap = if is_narrow { s(NARROW) } else { gap };
        let (half, flow) = (gap * s(0.5), &flow);
        let at = move |r: Along| -> Point<Along> {
            let [fall, turn] = flow.rates(r);
            [r, fall, turn]
        };
        // Rates are smooth in the root of the depth below the orbit, not in the depth.
        let below = move |part: Along| -> Point<Along> {
            let [fall, turn] = flow.rates_below(part * half.sqrt());
            [isco - half * part * part, fall, turn]
        };
        let far = move |part: Along| at(isco + gap * (part - s(1.0)));
        let near = move |part: Along| at(horizon + half * part);
        let least = if is_narrow { 1.01 } else { 1.0 };
        let outside = Way {
            marks: falling(geometric(least, FARTHEST / gap.value())),
            at: Box::new(far),
            rough: false,
        };
        if is_narrow {
            return Ok(Trajectory::new(&[outside], 0));
        }
        let below = Way { marks: self.below(), at: Box::new(below), rough: !self.is_eternal() };
        let inside = Way { marks: falling(geometric(1e-7, 1.0)), at: Box::new(near), rough: false };
        // Times count from half-way to the horizon: a plunge from the orbit may take for ever.
        Ok(match self.is_still() {
            true => Trajectory::new(&[below, inside], 1),
            false => Trajectory::new(&[outside, below, inside], 2),
        })
    }

    /// Returns whether nothing leaves the innermost stable orbit: a plunge from it has begun long ago.
    fn is_eternal(&self) -> bool {
        self.is_still() && self.mixture.xi == 1.0
    }

    /// Marks below the innermost stable orbit: roots of the part of the half way to the horizon.
    fn below(&self) -> Vec<f64> {
        match self.is_eternal() {
            true => geometric(1e-6, 1.0),
            false => core::iter::once(0.0).chain(geometric(1e-8, 1.0)).collect(),
        }
    }

    fn falling(self) -> Result<Falling, Error> {
        let (law, flow) = (Law::Family(self), self.flow()?);
        let circular = self.circular_from()?;
        Ok(Falling { law, factor: 1.0, table: self.trajectory()?, flow: Some(flow), circular })
    }
}

/// A radius, or that of the horizon where it is not outside of it.
fn outside(flow: &Infall<Along>, r: Along) -> Along {
    let least = flow.hole().horizon() * Along::constant(1.0 + 1e-9);
    if r.value > least.value { r } else { least }
}

fn falling(mut marks: Vec<f64>) -> Vec<f64> {
    marks.reverse();
    marks
}

/// Marks from `from` to `to`, each a thirtieth or so larger than the one before: rounding, not the
/// polynomials, then limits the table.
fn geometric(from: f64, to: f64) -> Vec<f64> {
    let count = (30.0 * (to / from).ln()).ceil().max(1.0);
    let mark = |k: f64| from * (to / from).powf(k / count);
    (0..=count as usize).map(|k| mark(k as f64)).collect()
}
