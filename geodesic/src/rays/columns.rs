//! The product of every tracer: a table of rays in columns.

use crate::integrate::outcome::Outcome;
use crate::integrate::uncertainty::Uncertainty;
use crate::rays::block::PlaneCrossing;
use crate::rays::request::Request;
use crate::rays::sampling::{Sink, Summary};
use crate::simd::span;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

/// Points of many rays in columns, ray after ray. Columns that were not requested are empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Points {
    /// Ends of each ray's points; the first ray's start at 0.
    ends: Vec<usize>,
    /// Mino time since the observer in M⁻¹, growing backward in time.
    pub mino_time: Vec<f64>,
    /// Boyer–Lindquist radius, in M.
    pub radius: Vec<f64>,
    /// Polar angle, in radians.
    pub theta: Vec<f64>,
    /// Azimuth, continuous along the ray from the observer's on, in radians.
    pub azimuth: Vec<f64>,
    /// t_o − t (see [`PathPoint::delay`]), in M.
    pub delay: Vec<f64>,
    /// Covariant momentum (p_t, p_r, p_θ, p_φ) of the photon for unit energy at infinity: the first two dimensionless,
    /// the angular ones in M.
    pub momentum: Vec<[f64; 4]>,
    /// Weights of the points in an integral over the affine parameter, in M.
    pub weight: Vec<f64>,
}

impl Points {
    /// The places in the columns of the points of ray number `ray`: none if there is no such
    /// ray.
    pub fn of(&self, ray: usize) -> core::ops::Range<usize> {
        span(&self.ends, ray)
    }

    /// Returns the ends of each ray's points in the columns; those of the first ray start at 0.
    pub fn ends(&self) -> &[usize] {
        &self.ends
    }

    /// Number of points of all rays.
    pub fn len(&self) -> usize {
        self.radius.len()
    }

    /// Returns whether there is no point at all.
    pub fn is_empty(&self) -> bool {
        self.radius.is_empty()
    }

    /// Closes the ray to which the points pushed last belong.
    pub(crate) fn end_ray(&mut self) {
        self.ends.push(self.radius.len());
    }

    pub(crate) fn push(&mut self, request: &Request, hole: &Kerr, lambda: f64, point: &PathPoint) {
        self.mino_time.push(point.mino_time);
        self.radius.push(point.radius());
        self.theta.push(point.theta());
        if request.azimuth {
            self.azimuth.push(point.azimuth);
        }
        if request.time {
            self.delay.push(point.delay);
        }
        if request.momentum {
            self.momentum.push(point.momentum(hole, lambda));
        }
    }

    pub(crate) fn push_crossing(&mut self, request: &Request, crossing: &PlaneCrossing) {
        self.mino_time.push(crossing.mino_time);
        self.radius.push(crossing.radius);
        self.theta.push(core::f64::consts::FRAC_PI_2);
        if request.azimuth {
            self.azimuth.push(crossing.azimuth);
        }
        if request.time {
            self.delay.push(crossing.delay);
        }
    }

    /// Makes room for `points` samples of a request.
    pub(crate) fn reserve(&mut self, request: &Request, points: usize) {
        let room = |asked: bool| if asked { points } else { 0 };
        self.mino_time.reserve(points);
        self.radius.reserve(points);
        self.theta.reserve(points);
        self.azimuth.reserve(room(request.azimuth));
        self.delay.reserve(room(request.time));
        self.momentum.reserve(room(request.momentum));
        self.weight.reserve(room(request.weight));
    }

    pub(crate) fn append(&mut self, other: Self) {
        let before = self.radius.len();
        self.ends.extend(other.ends.iter().map(|end| end + before));
        self.mino_time.extend(other.mino_time);
        self.radius.extend(other.radius);
        self.theta.extend(other.theta);
        self.azimuth.extend(other.azimuth);
        self.delay.extend(other.delay);
        self.momentum.extend(other.momentum);
        self.weight.extend(other.weight);
    }

    /// Returns the number of points that `pieces` have in all.
    fn count<'a>(pieces: impl Iterator<Item = &'a Self>) -> usize {
        pieces.map(|points| points.radius.len()).sum()
    }
}

/// Traced rays in columns: the same from every [`Integrator`](crate::Integrator).
///
/// Ray k has `outcome[k]`, `mino_total[k]` and so on; its crossings and samples are the points
/// `crossings.of(k)` and `samples.of(k)` of the columns in [`Points`]. A column that the
/// [`Request`] does not ask for is empty. 100 000 rays with one crossing take about 10 MB.
///
/// ```
/// use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Outcome, Request};
///
/// let hole = Kerr::new(0.0)?;
/// let observer = Observer::at_infinity(Inclination::from_degrees(0.0)?);
/// let (alpha, beta) = ([6.0, 3.0, 8.0], [0.0, 4.0, 0.0]);
/// let request = Request::crossings(1);
/// let rays = Integrator::Elliptic.trace(&hole, &observer, &alpha, &beta, 1e-12, &request)?;
///
/// assert_eq!(rays.len(), 3);
/// assert_eq!(rays.outcome, [Outcome::Escaped, Outcome::Captured, Outcome::Escaped]);
/// // Without spin a ray turns where b² = r³/(r − 2).
/// let r = rays.turning_radius[2];
/// assert!((r.powi(3) / (r - 2.0) - 64.0).abs() < 1e-10);
/// let hits: Vec<f64> = rays.crossings.of(0).map(|k| rays.crossings.radius[k]).collect();
/// assert!(hits.len() == 1 && hits[0] > 4.0 && hits[0] < 6.0);
/// assert!(rays.samples.radius.is_empty()); // not requested
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RayTable {
    /// Outcome of each ray.
    pub outcome: Vec<Outcome>,
    /// Mino time of each whole ray in M⁻¹: to the horizon, to infinity, or back to a finite
    /// observer's radius; of cameras' rays to infinity. NaN where unresolved.
    pub mino_total: Vec<f64>,
    /// Smallest radius in M of each ray that turns; NaN of others.
    pub turning_radius: Vec<f64>,
    /// Number of times each ray crosses the equatorial plane.
    pub crossing_count: Vec<u32>,
    /// Unit vector of the direction in which each ray escapes, NaN of those that do not: of
    /// [`Integrator::trace_view`](crate::Integrator::trace_view) alone.
    pub exit: Vec<[f64; 3]>,
    /// The first crossings, as many as were requested.
    pub crossings: Points,
    /// The samples.
    pub samples: Points,
    /// Largest estimated errors of each ray's crossings and samples, if requested; a sample at the horizon itself,
    /// where azimuth and delay have no limit, does not count.
    pub uncertainty: Vec<Uncertainty>,
}

impl RayTable {
    /// Number of rays.
    pub fn len(&self) -> usize {
        self.outcome.len()
    }

    /// Returns whether there is no ray.
    pub fn is_empty(&self) -> bool {
        self.outcome.is_empty()
    }

    /// The table of all rays of `pieces`, one after the other.
    pub(crate) fn joined(pieces: Vec<Self>, request: &Request) -> Self {
        let mut pieces = pieces.into_iter();
        // Most often the only one.
        let Some(mut whole) = pieces.next() else { return Self::default() };
        let rest = pieces.as_slice();
        whole.crossings.reserve(request, Points::count(rest.iter().map(|piece| &piece.crossings)));
        whole.samples.reserve(request, Points::count(rest.iter().map(|piece| &piece.samples)));
        pieces.for_each(|piece| whole.append(piece));
        whole
    }

    pub(crate) fn append(&mut self, other: Self) {
        self.outcome.extend(other.outcome);
        self.mino_total.extend(other.mino_total);
        self.turning_radius.extend(other.turning_radius);
        self.crossing_count.extend(other.crossing_count);
        self.exit.extend(other.exit);
        self.crossings.append(other.crossings);
        self.samples.append(other.samples);
        self.uncertainty.extend(other.uncertainty);
    }
}

impl Sink<f64> for RayTable {
    fn summary(&mut self, summary: Summary<f64>) {
        self.outcome.push(summary.outcome);
        self.mino_total.push(summary.total.unwrap_or(f64::NAN));
        self.turning_radius.push(summary.turning_radius.unwrap_or(f64::NAN));
        self.crossing_count.push(summary.crossing_count);
        self.exit.extend(summary.exit);
    }

    fn crossing(&mut self, request: &Request, hole: &Kerr, lambda: f64, point: &PathPoint) {
        self.crossings.push(request, hole, lambda, point);
    }

    fn sample(
        &mut self,
        request: &Request,
        hole: &Kerr,
        lambda: f64,
        point: &PathPoint,
        weight: Option<f64>,
    ) {
        self.samples.push(request, hole, lambda, point);
        self.samples.weight.extend(weight);
    }

    fn end(&mut self, worst: Option<Uncertainty>) {
        self.crossings.end_ray();
        self.samples.end_ray();
        self.uncertainty.extend(worst);
    }
}
