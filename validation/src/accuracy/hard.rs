//! Stress test with millions of random rays: special spins and inclinations and their
//! neighbours, tiny and huge impact parameters, the neighbourhood of the critical curve.

use super::Oracle;
use super::rays::{Angle, Draw, beside_critical_curve, in_disc, log_uniform};
use kerrlight_geodesic::{
    Error, Integrator, Kerr, Outcome, Placement, RayTable, Request, Uncertainty, Unresolved,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Kind of difficulty that rays are chosen for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Kind {
    /// Impact parameters of the hole's size.
    #[default]
    Strong,
    /// Impact parameters from 1e-12 to 1e6 M.
    AnyScale,
    /// α or β exactly zero.
    OnAxis,
    /// A relative 1e-14 to 1e-1 beside the critical curve.
    NearCritical,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 4] = [Kind::Strong, Kind::AnyScale, Kind::OnAxis, Kind::NearCritical];

    /// The words that tables use.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Strong => "within 15 M",
            Kind::AnyScale => "1e-12 to 1e6 M",
            Kind::OnAxis => "alpha or beta zero",
            Kind::NearCritical => "near-critical",
        }
    }
}

/// Counts of the outcomes of the rays of one kind.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tally {
    /// The kind.
    pub kind: Kind,
    /// Number of rays.
    pub rays: u64,
    /// Numbers of rays that were captured, and that escaped.
    pub fates: [u64; 2],
    /// Numbers of rays that were given up on a photon orbit, and at the step limit.
    pub unresolved: [u64; 2],
    /// Number of rays with another fate than the oracle's.
    pub wrong_fates: u64,
    /// Number of rays with another number of equatorial crossings.
    pub wrong_crossings: u64,
    /// Number of rays with a number that is not one, or an infinite one.
    pub not_finite: u64,
    /// Number of positions within their estimates of r, θ and φ, delay included.
    pub bounded: u64,
    /// Largest error over its estimate, and the ray it belongs to.
    pub worst: Option<(f64, Draw)>,
    /// A ray with another fate, number of crossings, or a number that is not one.
    pub example: Option<Draw>,
}

impl Tally {
    fn add(mut self, o: &Self) -> Self {
        self.rays += o.rays;
        for k in 0..2 {
            self.fates[k] += o.fates[k];
            self.unresolved[k] += o.unresolved[k];
        }
        self.wrong_fates += o.wrong_fates;
        self.wrong_crossings += o.wrong_crossings;
        self.not_finite += o.not_finite;
        self.bounded += o.bounded;
        let ratio = |worst: &Option<(f64, Draw)>| worst.map_or(0.0, |(ratio, _)| ratio);
        if ratio(&o.worst) > ratio(&self.worst) {
            self.worst = o.worst;
        }
        self.example = self.example.or(o.example);
        self
    }

    /// Returns whether no ray went wrong and the worst error is within ten times its estimate.
    pub fn passes(&self) -> bool {
        let wrong = self.wrong_fates + self.wrong_crossings + self.not_finite + self.unresolved[1];
        wrong == 0 && self.worst.is_none_or(|(ratio, _)| ratio <= 10.0)
    }
}

/// Rays that share one seed and are done together.
const BATCH: u64 = 2000;

/// Traces `rays` random rays, held against the oracle; `progress` hears how many more are done
/// and says whether to go on. What was traced before it says no counts.
///
/// # Errors
/// If the tolerance is out of its range.
pub fn run(
    integrator: Integrator,
    tolerance: f64,
    rays: u64,
    seed: u64,
    progress: impl Fn(u64) -> bool + Sync,
) -> Result<Vec<Tally>, Error> {
    (0..rays.div_ceil(BATCH))
        .into_par_iter()
        .map_init(Oracle::default, |oracle, batch| {
            if !progress(0) {
                return Ok(nothing());
            }
            let count = BATCH.min(rays - batch * BATCH);
            let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_add(batch));
            let mut tallies = nothing();
            for k in (0..count).take_while(|_| progress(0)) {
                let tally = &mut tallies[(k % Kind::ALL.len() as u64) as usize];
                let ray = draw(&mut rng, tally.kind)?;
                judge(&ray, integrator, tolerance, oracle, tally)?;
            }
            progress(tallies.iter().map(|tally| tally.rays).sum());
            Ok(tallies)
        })
        .try_reduce(nothing, |a, b| Ok(add(a, &b)))
}

/// Tallies of no rays.
fn nothing() -> Vec<Tally> {
    Kind::ALL.map(|kind| Tally { kind, ..Tally::default() }).to_vec()
}

fn add(all: Vec<Tally>, more: &[Tally]) -> Vec<Tally> {
    all.into_iter().zip(more).map(|(a, b)| a.add(b)).collect()
}

fn any_of<T: Copy>(rng: &mut impl Rng, values: &[T]) -> T {
    values[rng.random_range(0..values.len())]
}

fn spin(rng: &mut impl Rng) -> f64 {
    let special = [0.0, 1.0, -1.0, 1e-12, -1e-12, 1e-6, -1e-6, 1.0 - 1e-12, 1e-12 - 1.0];
    match rng.random_range(0..3) {
        0 => any_of(rng, &special),
        1 => any_of(rng, &[1.0, -1.0]) * (1.0 - log_uniform(rng, -12.0, -1.0)),
        _ => rng.random_range(-1.0..1.0),
    }
}

fn inclination(rng: &mut impl Rng) -> Angle {
    match rng.random_range(0..4) {
        0 => Angle::Degrees(any_of(rng, &[0.0, 90.0, 180.0])),
        1 => {
            let off = log_uniform(rng, -15.0, -2.0);
            let angle = any_of(rng, &[off, FRAC_PI_2 + off, FRAC_PI_2 - off, PI - off]);
            Angle::Radians(angle.min(PI))
        }
        _ => Angle::Radians(f64::acos(rng.random_range(-1.0..1.0))),
    }
}

/// A random hard ray.
fn draw(rng: &mut impl Rng, kind: Kind) -> Result<Draw, Error> {
    let (spin, inclination) = (spin(rng), inclination(rng));
    let [alpha, beta] = match kind {
        Kind::Strong => in_disc(rng, 15.0),
        Kind::AnyScale => {
            let mut any = || any_of(rng, &[1.0, -1.0]) * log_uniform(rng, -12.0, 6.0);
            [any(), any()]
        }
        Kind::OnAxis => {
            let (b, way) = (log_uniform(rng, -3.0, 2.0), rng.random_range(0..4));
            let zero = any_of(rng, &[0.0, -0.0]);
            [[b, zero], [-b, zero], [zero, b], [zero, -b]][way]
        }
        Kind::NearCritical => {
            let distance = log_uniform(rng, -14.0, -1.0);
            beside_critical_curve(rng, spin, inclination, distance)?
        }
    };
    // Finite observers for one ray in four, where they see the ray.
    let far = 2.0 * alpha.hypot(beta).max(10.0);
    let radius = if rng.random_range(0..4) == 0 { far * 10.0 } else { f64::INFINITY };
    Ok(Draw { spin, inclination, radius, alpha, beta })
}

fn judge(
    ray: &Draw,
    integrator: Integrator,
    tolerance: f64,
    oracle: &mut Oracle,
    tally: &mut Tally,
) -> Result<(), Error> {
    let request = Request {
        crossings: MOST_CROSSINGS,
        uncertainty: true,
        ..Request::samples(Placement::MinoTime(5))
    };
    let (hole, observer) = (Kerr::new(ray.spin)?, ray.observer()?);
    let table =
        integrator.trace(&hole, &observer, &[ray.alpha], &[ray.beta], tolerance, &request)?;
    oracle.trace(ray)?;
    tally.rays += 1;
    match table.outcome[0] {
        Outcome::Captured => tally.fates[0] += 1,
        Outcome::Escaped => tally.fates[1] += 1,
        Outcome::Unresolved(Unresolved::PhotonOrbit) => tally.unresolved[0] += 1,
        Outcome::Unresolved(Unresolved::StepLimit) => tally.unresolved[1] += 1,
        Outcome::Surface | Outcome::Unresolved(Unresolved::OtherHole) => {}
    }
    let unresolved = table.outcome[0].is_unresolved();
    let wrong_fate = !unresolved && table.outcome[0] != oracle.outcome();
    let wrong_count = !unresolved && !wrong_fate && !same_crossings(&hole, &table, oracle);
    let estimate = table.uncertainty[0];
    let (truth, finite) = errors(&table, oracle);
    tally.wrong_fates += u64::from(wrong_fate);
    tally.wrong_crossings += u64::from(wrong_count);
    tally.not_finite += u64::from(!finite);
    if wrong_fate || wrong_count || !finite {
        tally.example = tally.example.or(Some(*ray));
        return Ok(());
    }
    let ratio = ratio(&truth, &estimate);
    tally.bounded += u64::from(ratio <= 1.0);
    if tally.worst.is_none_or(|(worst, _)| ratio > worst) {
        tally.worst = Some((ratio, *ray));
    }
    Ok(())
}

/// Crossings that are looked at.
const MOST_CROSSINGS: usize = 64;

/// Returns whether a ray has as many crossings as the oracle's, up to its end. Those closer to the
/// horizon than 64 roundings of its radius do not count: no double tells on which side they are.
fn same_crossings(hole: &Kerr, table: &RayTable, oracle: &Oracle) -> bool {
    let outside = |r: f64| r > hole.horizon() * (1.0 + 64.0 * f64::EPSILON);
    let found = table.crossings.radius.iter().filter(|r| outside(**r)).count();
    let before_end = |time: &f64| *time <= table.mino_total[0];
    let crossings = oracle.crossings().into_iter().map(|time| time.hi);
    let expected = crossings.filter(before_end).take(MOST_CROSSINGS);
    found == expected.filter(|time| outside(oracle.at(*time).radius().hi)).count()
}

/// The largest of the errors over their estimates.
fn ratio(truth: &Uncertainty, estimate: &Uncertainty) -> f64 {
    let pairs = [
        (truth.radius, estimate.radius),
        (truth.theta, estimate.theta),
        // An azimuth that is not known at all is within half a turn.
        (truth.azimuth, estimate.azimuth),
        (truth.delay, estimate.delay),
    ];
    pairs
        .iter()
        .map(|(truth, estimate)| if *truth > 0.0 { truth / estimate } else { 0.0 })
        .fold(0.0, f64::max)
}

/// The largest errors of a ray's points, and whether all its numbers are finite.
fn errors(table: &RayTable, oracle: &Oracle) -> (Uncertainty, bool) {
    let mut worst = Uncertainty::default();
    let mut finite = true;
    // Later crossings crowd at the horizon of a hole that turns as fast as it can.
    for (points, most) in [(&table.crossings, 2), (&table.samples, usize::MAX)] {
        for k in 0..points.len().min(most) {
            let at = [points.radius[k], points.theta[k], points.azimuth[k], points.delay[k]];
            finite &= at.iter().all(|x| x.is_finite());
            // Azimuth and delay have no limit at the horizon, where the last sample lies, or 1e-8 before it.
            let is_captured = table.outcome[0] == Outcome::Captured;
            let last = points.mino_time[k] >= table.mino_total[0] * (1.0 - 1e-12)
                || (is_captured && most == usize::MAX && k + 1 == points.len());
            if !last && finite {
                worst = worst.max(oracle.judge(points, k));
            }
        }
    }
    debug_assert!(worst.azimuth <= TAU);
    (worst, finite)
}
