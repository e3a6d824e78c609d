//! Exact derivatives of where rays go with respect to spin, inclination and screen: what a fit
//! of a spin, or of an orientation, needs.
//!
//! They come from dual numbers through the same equations (forward-mode differentiation), not
//! from differences: they are as accurate as the positions.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Kerr, Observer, Request, derivatives};
//! let hole = Kerr::new(0.9)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let request = Request::crossings(2);
//! let rays = derivatives::trace(&hole, &observer, &[-6.0], &[2.0], 1e-12, &request)?;
//! for k in rays.values.crossings.of(0) {
//!     let (r, by) = (rays.values.crossings.radius[k], rays.crossings.radius[k]);
//!     println!("r = {r:.6} M, dr/da = {:.6}, dr/di = {:.6} M/rad", by.spin, by.inclination);
//! }
//!
//! // Without spin, seen along the axis, radii depend on √(α² + β²) alone.
//! let hole = Kerr::new(0.0)?;
//! let above = Observer::at_infinity(Inclination::from_degrees(0.0)?);
//! let rays = derivatives::trace(&hole, &above, &[6.0], &[4.0], 1e-12, &Request::crossings(1))?;
//! let by = rays.crossings.radius[0];
//! assert!((4.0 * by.alpha - 6.0 * by.beta).abs() < 1e-9);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # What is held fixed
//! A derivative follows the point, whose Mino time moves with the parameters as its definition
//! says: a crossing stays on the equator, a sample of `MinoTime(n)` stays at its fraction of the
//! whole Mino time, one of `GaussLegendre` or `PathLength` at its node between the two radii or at
//! its fraction of the length inside the sphere. [`Gradients::mino_time`] says how the Mino time
//! moves, [`Gradients::rate`] how the position changes with it, so that
//! [`Gradients::at_fixed_mino_time`] has what is left: the derivative at the same Mino time.
//! The observer's radius and azimuth are fixed always.

use crate::error::{Error, check};
use crate::integrate::path::Path;
use crate::integrate::trace::{Tracer, trace_series};
use crate::integrate::uncertainty::Uncertainty;
use crate::numbers::dual::Dual;
use crate::rays::blocks::{BLOCK, check_columns, in_blocks};
use crate::rays::columns::RayTable;
use crate::rays::request::Request;
use crate::rays::sampling::{self, Sampler, Sink, Summary};
use crate::rays::trajectory::MinoPath;
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

type Number = Dual<f64, 4>;

/// The derivatives of one number with respect to the four parameters of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gradient {
    /// Per unit of spin a.
    pub spin: f64,
    /// Per radian of inclination.
    pub inclination: f64,
    /// Per M of α.
    pub alpha: f64,
    /// Per M of β.
    pub beta: f64,
}

impl Gradient {
    const NONE: Gradient =
        Gradient { spin: f64::NAN, inclination: f64::NAN, alpha: f64::NAN, beta: f64::NAN };

    /// Returns the derivatives in the order spin, inclination, α, β: the unit of the quantity per 1, per
    /// radian, per M and per M.
    pub fn to_array(self) -> [f64; 4] {
        [self.spin, self.inclination, self.alpha, self.beta]
    }

    pub(crate) fn of(number: Number) -> Self {
        let [spin, inclination, alpha, beta] = number.slope;
        Gradient { spin, inclination, alpha, beta }
    }

    fn less(self, rate: f64, by: Gradient) -> Self {
        Gradient {
            spin: self.spin - rate * by.spin,
            inclination: self.inclination - rate * by.inclination,
            alpha: self.alpha - rate * by.alpha,
            beta: self.beta - rate * by.beta,
        }
    }
}

/// Rates of the coordinates of a point along its ray, per Mino time (which grows backward).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rate {
    /// dr/dτ, in M².
    pub radius: f64,
    /// dθ/dτ, in M.
    pub theta: f64,
    /// dφ/dτ, in M.
    pub azimuth: f64,
    /// d(delay)/dτ, in M².
    pub delay: f64,
}

/// Derivatives of points in columns, in the places of the columns of
/// [`Points`](crate::Points). Columns that were not requested are empty. At the horizon itself,
/// where azimuth and delay diverge, their derivatives are NaN.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gradients {
    /// Gradient of the Mino time.
    pub mino_time: Vec<Gradient>,
    /// Gradient of the radius.
    pub radius: Vec<Gradient>,
    /// Gradient of the polar angle (0 on the axis itself, where it has none).
    pub theta: Vec<Gradient>,
    /// Gradient of the azimuth.
    pub azimuth: Vec<Gradient>,
    /// Gradient of the delay.
    pub delay: Vec<Gradient>,
    /// Gradient of the path weight.
    pub weight: Vec<Gradient>,
    /// Gradient of the covariant momentum (p_t, p_r, p_θ, p_φ).
    pub momentum: Vec<[Gradient; 4]>,
    /// Rates of change along the ray: those of azimuth and delay wherever they are requested,
    /// else 0.
    pub rate: Vec<Rate>,
}

/// Derivatives of the position of a point that stays at its Mino time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fixed {
    /// Gradient of the radius.
    pub radius: Gradient,
    /// Gradient of the polar angle.
    pub theta: Gradient,
    /// Gradient of the azimuth; 0 unless requested.
    pub azimuth: Gradient,
    /// Gradient of the delay; 0 unless requested.
    pub delay: Gradient,
}

impl Gradients {
    /// The derivatives of point number `k` at its fixed Mino time instead of its fixed label:
    /// ∂x/∂p|_τ = dx/dp − (dx/dτ)(dτ/dp). `None` if there is no such point.
    pub fn at_fixed_mino_time(&self, k: usize) -> Option<Fixed> {
        let (time, rate) = (*self.mino_time.get(k)?, *self.rate.get(k)?);
        let fixed = |column: &[Gradient], rate: f64| {
            column.get(k).map_or(Gradient::default(), |total| total.less(rate, time))
        };
        Some(Fixed {
            radius: fixed(&self.radius, rate.radius),
            theta: fixed(&self.theta, rate.theta),
            azimuth: fixed(&self.azimuth, rate.azimuth),
            delay: fixed(&self.delay, rate.delay),
        })
    }

    fn push(&mut self, request: &Request, hole: &Kerr<Number>, lambda: Number, point: &Point) {
        // Beyond the last double outside the horizon a logarithm has no slope.
        let there = point.inverse_radius.value * hole.horizon().value > 1.0 - 4.0 * f64::EPSILON;
        let of = |number| if there { Gradient::NONE } else { Gradient::of(number) };
        self.mino_time.push(Gradient::of(point.mino_time));
        self.radius.push(Gradient::of(point.radius()));
        self.theta.push(Gradient::of(point.theta()));
        if request.azimuth {
            self.azimuth.push(of(point.azimuth));
        }
        if request.time {
            self.delay.push(of(point.delay));
        }
        if request.momentum {
            self.momentum.push(point.momentum(hole, lambda).map(of));
        }
        let [radius, theta, azimuth, delay] = values(point).rates(&hole.values(), lambda.value);
        let azimuth = if request.azimuth { azimuth } else { 0.0 };
        let delay = if request.time { delay } else { 0.0 };
        self.rate.push(Rate { radius, theta, azimuth, delay });
    }

    fn append(&mut self, other: Self) {
        self.mino_time.extend(other.mino_time);
        self.radius.extend(other.radius);
        self.theta.extend(other.theta);
        self.azimuth.extend(other.azimuth);
        self.delay.extend(other.delay);
        self.weight.extend(other.weight);
        self.momentum.extend(other.momentum);
        self.rate.extend(other.rate);
    }
}

type Point = PathPoint<Number>;

/// A point without its derivatives.
fn values(point: &Point) -> PathPoint {
    PathPoint {
        mino_time: point.mino_time.value,
        inverse_radius: point.inverse_radius.value,
        inverse_radius_rate: point.inverse_radius_rate.value,
        direction: point.direction.map(|x| x.value),
        velocity: point.velocity.map(|x| x.value),
        azimuth: point.azimuth.value,
        delay: point.delay.value,
    }
}

/// Traced rays with the derivatives of their points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Differentiated {
    /// The rays themselves, as from [`Integrator::TaylorMino`](crate::Integrator::TaylorMino).
    pub values: RayTable,
    /// Gradient of [`RayTable::mino_total`]; NaN where unresolved.
    pub mino_total: Vec<Gradient>,
    /// Gradient of [`RayTable::turning_radius`]; NaN where the ray does not turn.
    pub turning_radius: Vec<Gradient>,
    /// Gradients of the points of [`RayTable::crossings`].
    pub crossings: Gradients,
    /// Gradients of the points of [`RayTable::samples`].
    pub samples: Gradients,
}

impl Differentiated {
    fn append(&mut self, other: Self) {
        self.values.append(other.values);
        self.mino_total.extend(other.mino_total);
        self.turning_radius.extend(other.turning_radius);
        self.crossings.append(other.crossings);
        self.samples.append(other.samples);
    }
}

impl Sink<Number> for Differentiated {
    fn summary(&mut self, summary: Summary<Number>) {
        let of = |number: Option<Number>| number.map_or(Gradient::NONE, Gradient::of);
        self.mino_total.push(of(summary.total));
        self.turning_radius.push(of(summary.turning_radius));
        self.values.summary(Summary {
            outcome: summary.outcome,
            total: summary.total.map(|total| total.value),
            turning_radius: summary.turning_radius.map(|radius| radius.value),
            crossing_count: summary.crossing_count,
            exit: summary.exit,
        });
    }

    fn crossing(&mut self, request: &Request, hole: &Kerr<Number>, lambda: Number, point: &Point) {
        self.values.crossing(request, &hole.values(), lambda.value, &values(point));
        self.crossings.push(request, hole, lambda, point);
    }

    fn sample(
        &mut self,
        request: &Request,
        hole: &Kerr<Number>,
        lambda: Number,
        point: &Point,
        weight: Option<Number>,
    ) {
        let plain = weight.map(|weight| weight.value);
        self.values.sample(request, &hole.values(), lambda.value, &values(point), plain);
        self.samples.push(request, hole, lambda, point);
        self.samples.weight.extend(weight.map(Gradient::of));
    }

    fn end(&mut self, worst: Option<Uncertainty>) {
        self.values.end(worst);
    }
}

/// Hole and observer whose spin and inclination are the first two parameters of all derivatives.
pub(crate) fn with_parameters(
    hole: &Kerr,
    observer: &Observer,
) -> Result<(Kerr<Number>, Observer<Number>), Error> {
    let a = hole.spin();
    check("spin", a, a.abs() < 1.0, "a number in (-1, 1), for derivatives")?;
    let observer = observer.with_inclination(observer.inclination().parameter(1));
    Ok((Kerr::from_spin(Number::parameter(a, 0))?, observer))
}

/// Traces the rays that arrive at (`alpha[k]`, `beta[k]`) by
/// [`Integrator::TaylorMino`](crate::Integrator::TaylorMino) and takes from them what is
/// requested together with its derivatives, on all cores with the feature `rayon`. An estimate of
/// [`Uncertainty`] is that of the values; derivatives next to the critical curve are less certain
/// by about the inverse of their relative distance from it.
///
/// # Errors
/// If the columns differ in length or a number is out of its range (the request's, the
/// tolerance's, those of [`Observer::ray`]), or if |a| = 1, where the horizon's radius has no
/// derivative.
pub fn trace(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    tolerance: f64,
    request: &Request,
) -> Result<Differentiated, Error> {
    check_columns(alpha, beta)?;
    request.check()?;
    Tracer::new(tolerance)?;
    let (hole, observer) = with_parameters(hole, observer)?;
    let rule = sampling::rule(request);
    let pieces = in_blocks(BLOCK, alpha, beta, |alpha, beta| -> Result<Differentiated, Error> {
        let sink = Differentiated::default();
        let mut sampler = Sampler::new(request, &hole, [observer.is_at_infinity(); 2], &rule, sink);
        let mut path = Path::empty();
        for (alpha, beta) in alpha.iter().zip(beta) {
            let [alpha, beta] = [Number::parameter(*alpha, 2), Number::parameter(*beta, 3)];
            let ray = observer.ray(&hole, alpha, beta)?;
            trace_series(tolerance, &hole, &ray, request.quantities(), &mut path)?;
            sampler.take(&MinoPath::new(&path, &ray), ray.lambda);
        }
        Ok(sampler.sink)
    });
    let mut whole = Differentiated::default();
    for piece in pieces {
        whole.append(piece?);
    }
    Ok(whole)
}
