//! Every way to trace rays, behind one interface and with one kind of result.

use crate::error::{Error, check};
use crate::integrate::path::{Outcome, Path};
use crate::integrate::trace::{Method, Tracer};
use crate::integrate::uncertainty::Uncertainty;
use crate::numbers::scalar::Elementary;
use crate::rays::blocks::in_blocks;
use crate::rays::columns::RayTable;
use crate::rays::elliptic_rays;
use crate::rays::request::Request;
use crate::rays::sampling::{self, Sampler, Trajectory};
use crate::screen::observer::{Observer, Ray};
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

/// How rays are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[non_exhaustive]
pub enum Integrator {
    /// `rk45-affine`: Runge–Kutta 5(4) in the affine parameter on Kerr–Schild coordinates, an
    /// independent referee. Needs an observer at a finite radius.
    #[cfg(feature = "affine")]
    Rk45Affine,
    /// `rk45-mino`: see [`Method::Rk45`].
    Rk45Mino,
    /// `dop853-mino`: see [`Method::Dop853`].
    Dop853Mino,
    /// `taylor-mino`: see [`Method::Taylor`].
    #[default]
    TaylorMino,
    /// `elliptic`: the closed form in elliptic functions, several rays a SIMD register
    /// ([`simd`](crate::simd)). By far the fastest for samples equidistant in Mino time and
    /// for equatorial crossings, which is all that it does; its accuracy is what rounding
    /// leaves, whatever the tolerance. For an observer at infinity or at 5 M and more.
    Elliptic,
}

impl Integrator {
    /// All of them.
    pub const ALL: &'static [Integrator] = &[
        #[cfg(feature = "affine")]
        Integrator::Rk45Affine,
        Integrator::Rk45Mino,
        Integrator::Dop853Mino,
        Integrator::TaylorMino,
        Integrator::Elliptic,
    ];

    /// The name that commands, files and documents use.
    pub fn name(self) -> &'static str {
        match self {
            #[cfg(feature = "affine")]
            Integrator::Rk45Affine => "rk45-affine",
            Integrator::Rk45Mino => "rk45-mino",
            Integrator::Dop853Mino => "dop853-mino",
            Integrator::TaylorMino => "taylor-mino",
            Integrator::Elliptic => "elliptic",
        }
    }

    /// The integrator with that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|integrator| integrator.name() == name)
    }

    /// Its stepping method, for those in Mino time.
    pub fn method(self) -> Option<Method> {
        match self {
            #[cfg(feature = "affine")]
            Integrator::Rk45Affine => None,
            Integrator::Rk45Mino => Some(Method::Rk45),
            Integrator::Dop853Mino => Some(Method::Dop853),
            Integrator::TaylorMino => Some(Method::Taylor),
            Integrator::Elliptic => None,
        }
    }

    /// Traces the rays that arrive at (`alpha[k]`, `beta[k]`) and takes from them what is
    /// requested, on all cores with the feature `rayon`. A ray depends on nothing but itself:
    /// the number of threads does not change a bit of the result.
    ///
    /// ```
    /// use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Outcome, Request};
    /// let hole = Kerr::new(0.94)?;
    /// let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
    /// let (alpha, beta) = ([-6.0, 0.5], [2.0, 0.5]);
    /// let request = Request::crossings(1);
    /// let rays = Integrator::TaylorMino.trace(&hole, &observer, &alpha, &beta, 1e-10, &request)?;
    /// assert_eq!(rays.outcome, [Outcome::Escaped, Outcome::Captured]);
    /// println!("meets the disc at r = {}", rays.crossings.radius[rays.crossings.of(0)][0]);
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the columns differ in length, a number is out of its range (the request's, the
    /// tolerance's, those of [`Observer::ray`]), or the observer is at infinity where the
    /// integrator cannot have it.
    pub fn trace(
        self,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        tolerance: f64,
        request: &Request,
    ) -> Result<RayTable, Error> {
        check_columns(alpha, beta)?;
        request.check()?;
        if self == Integrator::Elliptic {
            return elliptic_rays::trace(hole, observer, alpha, beta, request);
        }
        let rule = sampling::rule(request);
        let at_infinity = observer.is_at_infinity();
        let block = |alpha: &[f64], beta: &[f64]| -> Result<RayTable, Error> {
            let mut sampler = Sampler::new(request, hole, at_infinity, &rule, RayTable::default());
            self.trace_block(hole, observer, alpha, beta, tolerance, request, &mut sampler)?;
            Ok(sampler.sink)
        };
        let pieces = in_blocks(alpha, beta, block);
        let mut whole = RayTable::default();
        for piece in pieces {
            whole.append(piece?);
        }
        Ok(whole)
    }

    #[allow(clippy::too_many_arguments)]
    fn trace_block(
        self,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        tolerance: f64,
        request: &Request,
        sampler: &mut Sampler<'_, f64, RayTable>,
    ) -> Result<(), Error> {
        let rays = alpha.iter().zip(beta);
        let Some(method) = self.method() else {
            #[cfg(feature = "affine")]
            for (alpha, beta) in rays {
                let ray = observer.ray(hole, *alpha, *beta)?;
                let pair = AffinePair::trace(hole, observer, [*alpha, *beta], tolerance, request)?;
                sampler.take(&pair, ray.lambda);
            }
            return Ok(());
        };
        let tracer = Tracer::with_method(method, tolerance)?;
        let mut path = Path::new();
        for (alpha, beta) in rays {
            let ray = observer.ray(hole, *alpha, *beta)?;
            tracer.trace(hole, &ray, request.quantities(), &mut path);
            sampler.take(&MinoPath { path: &path, ray: &ray }, ray.lambda);
        }
        Ok(())
    }
}

/// Whether there is a β for every α.
pub(crate) fn check_columns(alpha: &[f64], beta: &[f64]) -> Result<(), Error> {
    let same = alpha.len() == beta.len();
    check("number of beta", beta.len() as f64, same, "as many as of alpha")?;
    Ok(())
}

/// A path in Mino time, ended at the radius of a finite observer.
pub(crate) struct MinoPath<'a, T> {
    pub path: &'a Path<T>,
    pub ray: &'a Ray<T>,
}

impl<T: Elementary> Trajectory<T> for MinoPath<'_, T> {
    fn outcome(&self) -> Outcome {
        self.path.outcome()
    }

    fn total(&self) -> T {
        match self.path.turning_point() {
            // A ray that starts inwards is back where it started after twice the time.
            Some((turning, _)) if self.ray.inverse_radius > 0.0 && self.ray.inward => {
                turning + turning
            }
            _ => self.path.mino_total(),
        }
    }

    fn turning_radius(&self) -> Option<T> {
        self.path.turning_point().map(|(_, r)| r)
    }

    fn crossings(&self, found: &mut Vec<T>) {
        let total = self.total();
        found.extend(self.path.equatorial_crossings().filter(|time| time.value() <= total.value()));
    }

    fn at(&self, mino_time: T) -> PathPoint<T> {
        self.path.at(mino_time)
    }

    fn uncertainty(&self, mino_time: T) -> Uncertainty {
        self.path.uncertainty_at(mino_time)
    }

    fn uncertainty_at_crossing(&self, _: usize, mino_time: T) -> Uncertainty {
        self.path.uncertainty_at_crossing(mino_time)
    }

    fn within(&self, lo: f64, hi: f64, pieces: &mut Vec<[T; 2]>) {
        self.path.intervals_within(lo, hi, pieces);
        let total = self.total();
        for piece in pieces.iter_mut() {
            if piece[1].value() > total.value() {
                piece[1] = total;
            }
        }
        pieces.retain(|[start, end]| start.value() < end.value());
    }
}

/// A ray in the affine parameter, and the same ray with ten times the tolerance: their
/// difference is the estimate of its error.
#[cfg(feature = "affine")]
struct AffinePair {
    fine: crate::integrate::affine::AffinePath,
    coarse: Option<crate::integrate::affine::AffinePath>,
}

#[cfg(feature = "affine")]
impl AffinePair {
    fn trace(
        hole: &Kerr,
        observer: &Observer,
        [alpha, beta]: [f64; 2],
        tolerance: f64,
        request: &Request,
    ) -> Result<Self, Error> {
        let with = |tolerance: f64| {
            crate::integrate::affine::AffineTracer::new(tolerance)?
                .trace(hole, observer, alpha, beta)
        };
        let coarse = request.uncertainty.then(|| with((10.0 * tolerance).min(1e-2)));
        Ok(AffinePair { fine: with(tolerance)?, coarse: coarse.transpose()? })
    }
}

/// How far two positions are from each other.
#[cfg(feature = "affine")]
fn difference(a: &PathPoint, b: &PathPoint, observer: f64) -> Uncertainty {
    let turn = (a.azimuth - b.azimuth).rem_euclid(core::f64::consts::TAU);
    // Coordinates are rounded where they are largest, at the observer.
    let floor = 16.0 * f64::EPSILON * (1.0 + observer / a.radius());
    Uncertainty {
        radius: (b.inverse_radius / a.inverse_radius - 1.0).abs() + floor,
        theta: (a.theta() - b.theta()).abs() + floor,
        azimuth: turn.min(core::f64::consts::TAU - turn) + floor,
        delay: (a.delay - b.delay).abs() + floor * (a.delay.abs() + a.radius()),
    }
}

/// How much larger the error may be than the difference from a run at ten times the tolerance,
/// whose own error has the same sign or vanishes by chance: measured (docs/measurements/geodesics.md of the
/// repository).
#[cfg(feature = "affine")]
const AFFINE_CAUTION: f64 = 3.0;

#[cfg(feature = "affine")]
impl AffinePair {
    /// The coarse run, if it came to the same end.
    fn comparable(&self) -> Option<&crate::integrate::affine::AffinePath> {
        self.coarse.as_ref().filter(|coarse| coarse.outcome() == self.fine.outcome())
    }

    /// The estimate without a run to compare with: none was asked for, or it ended elsewhere.
    fn unknown(&self) -> Uncertainty {
        if self.coarse.is_some() { Uncertainty::UNKNOWN } else { Uncertainty::default() }
    }

    /// The largest difference at equal Mino time over the last two steps of the coarse run: at
    /// one point alone it may vanish by chance, next to a node above all.
    fn worst_up_to(
        &self,
        coarse: &crate::integrate::affine::AffinePath,
        mino_time: f64,
    ) -> Uncertainty {
        let from = coarse.step_before(mino_time).min(mino_time);
        let places = [0.25, 0.5, 0.75, 1.0].map(|part| from + (mino_time - from) * part);
        let worst = places.into_iter().map(|time| self.at_equal_time(coarse, time));
        worst.fold(Uncertainty::default(), Uncertainty::max)
    }

    fn at_equal_time(
        &self,
        coarse: &crate::integrate::affine::AffinePath,
        mino_time: f64,
    ) -> Uncertainty {
        let end = coarse.mino_total();
        let (a, b) = (self.fine.at(mino_time), coarse.at(mino_time.min(end)));
        // Back at the observer, where a ray flies out with dr/dτ = r², the ray that ends
        // earlier is as far behind as its time is short.
        let r = a.radius();
        let overrun = (mino_time - end).max(0.0) * r;
        let mut error = difference(&a, &b, self.fine.start_radius());
        error.radius += overrun;
        error.delay += overrun * r;
        error
    }

    /// By how much an error of θ moves a crossing.
    fn early(&self, theta: f64, mino_time: f64) -> f64 {
        let step = 1e-4 * self.fine.mino_total();
        let [before, after] = [-step, step].map(|step| self.fine.at(mino_time + step).theta());
        let rate = (after - before).abs() / (2.0 * step);
        (theta / rate.max(1e-300)).min(self.fine.mino_total())
    }
}

#[cfg(feature = "affine")]
impl Trajectory<f64> for AffinePair {
    fn outcome(&self) -> Outcome {
        self.fine.outcome()
    }

    fn total(&self) -> f64 {
        self.fine.mino_total()
    }

    fn turning_radius(&self) -> Option<f64> {
        self.fine.closest_approach()
    }

    fn crossings(&self, found: &mut Vec<f64>) {
        found.extend(self.fine.equatorial_crossings());
    }

    fn at(&self, mino_time: f64) -> PathPoint {
        self.fine.at(mino_time)
    }

    fn uncertainty(&self, mino_time: f64) -> Uncertainty {
        match self.comparable() {
            Some(coarse) => self.worst_up_to(coarse, mino_time).rescaled(AFFINE_CAUTION),
            None => self.unknown(),
        }
    }

    fn uncertainty_at_crossing(&self, k: usize, mino_time: f64) -> Uncertainty {
        let other = self.comparable().map(|coarse| (coarse, coarse.equatorial_crossings()));
        let Some((coarse, Some(other))) = other.map(|(c, times)| (c, times.get(k).copied())) else {
            return self.unknown();
        };
        let at_once = self.worst_up_to(coarse, mino_time);
        let radius = self.fine.start_radius();
        let apart = difference(&self.fine.at(mino_time), &coarse.at(other), radius);
        // An error of θ that the two runs do not share moves the crossing too.
        let early = (other - mino_time).abs().max(self.early(at_once.theta, mino_time));
        let moved = |time: f64| {
            let time = time.clamp(0.0, self.fine.mino_total());
            difference(&self.fine.at(mino_time), &self.fine.at(time), radius)
        };
        let moved = moved(mino_time - early).max(moved(mino_time + early));
        at_once.max(apart).max(moved).rescaled(AFFINE_CAUTION)
    }

    fn within(&self, lo: f64, hi: f64, pieces: &mut Vec<[f64; 2]>) {
        self.fine.intervals_within(lo, hi, pieces);
    }
}
