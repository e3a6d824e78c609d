//! Test of error estimates: integrator × tolerance × class of rays × kind of point, each of r, θ, φ
//! and delay on its own.
//!
//! Errors of samples are taken at equal Mino time. A crossing is judged as it is used, against
//! the true crossing, so that an error of when the ray crosses counts as one of where.

use super::Oracle;
use super::rays::{Angle, Draw, beside_critical_curve, in_disc, log_uniform};
use kerrlight_geodesic::{Error, Integrator, Kerr, Placement, RayTable, Request, Uncertainty};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::f64::consts::PI;

/// A class of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Anywhere within 15 M, any spin, from infinity.
    Generic,
    /// Spin 0.
    NoSpin,
    /// Spin ±1.
    Extremal,
    /// A relative 1e-14 to 0.1 beside the critical curve, spin ±0.998, from infinity.
    NearCritical,
    /// The same from an observer at 20 M.
    NearCriticalFrom20,
    /// Observer at 6 M.
    From6,
    /// Observer at 20 M.
    From20,
    /// Observer at 1000 M.
    From1000,
    /// Observer at 10 M; rays a relative 1e-10 to 0.1 inside the one that turns there.
    Tangential,
    /// Inclination of 1e-10 to 0.1 rad off the axis.
    NearAxis,
    /// Impact parameters of 1e2 to 1e6 M.
    Far,
}

impl Class {
    /// All of them.
    pub const ALL: [Class; 11] = [
        Class::Generic,
        Class::NoSpin,
        Class::Extremal,
        Class::NearCritical,
        Class::NearCriticalFrom20,
        Class::From6,
        Class::From20,
        Class::From1000,
        Class::Tangential,
        Class::NearAxis,
        Class::Far,
    ];

    /// The words that tables use.
    pub fn name(self) -> &'static str {
        match self {
            Class::Generic => "anywhere within 15 M",
            Class::NoSpin => "spin 0",
            Class::Extremal => "spin ±1",
            Class::NearCritical => "near-critical, spin ±0.998",
            Class::NearCriticalFrom20 => "near-critical from 20 M",
            Class::From6 => "observer at 6 M",
            Class::From20 => "observer at 20 M",
            Class::From1000 => "observer at 1000 M",
            Class::Tangential => "turning next to 10 M",
            Class::NearAxis => "1e-10 to 0.1 rad off the axis",
            Class::Far => "impact parameters 1e2 to 1e6 M",
        }
    }

    fn observer(self) -> f64 {
        match self {
            Class::From6 => 6.0,
            Class::From20 | Class::NearCriticalFrom20 => 20.0,
            Class::From1000 => 1000.0,
            Class::Tangential => 10.0,
            _ => f64::INFINITY,
        }
    }

    fn spin(self, rng: &mut impl Rng) -> f64 {
        let sign = if rng.random() { 1.0 } else { -1.0 };
        match self {
            Class::NoSpin => 0.0,
            Class::Extremal => sign,
            Class::NearCritical | Class::NearCriticalFrom20 => sign * 0.998,
            _ => rng.random_range(-1.0..1.0),
        }
    }

    fn draw(self, rng: &mut impl Rng) -> Result<Draw, Error> {
        let spin = self.spin(rng);
        let mut inclination = f64::acos(rng.random_range(-1.0..1.0));
        if self == Class::NearAxis {
            let off = log_uniform(rng, -10.0, -1.0);
            inclination = if rng.random() { off } else { PI - off };
        }
        let inclination = Angle::Radians(inclination);
        let [alpha, beta] = match self {
            Class::NearCritical | Class::NearCriticalFrom20 => {
                let distance = log_uniform(rng, -14.0, -1.0);
                beside_critical_curve(rng, spin, inclination, distance)?
            }
            Class::Far => {
                let b = log_uniform(rng, 2.0, 6.0);
                let [x, y] = in_disc(rng, 1.0);
                [b * x, b * y]
            }
            Class::From6 => in_disc(rng, 8.0),
            Class::Tangential => beside_edge(rng, spin, inclination, self.observer())?,
            _ => in_disc(rng, 15.0),
        };
        Ok(Draw { spin, inclination, radius: self.observer(), alpha, beta })
    }

    /// Random rays of this class that their observer sees.
    pub fn rays(self, n: usize, seed: u64) -> Result<Vec<Draw>, Error> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut rays = Vec::with_capacity(n);
        while rays.len() < n {
            let ray = self.draw(&mut rng)?;
            let hole = Kerr::new(ray.spin)?;
            if ray.observer()?.ray(&hole, ray.alpha, ray.beta).is_ok() {
                rays.push(ray);
            }
        }
        Ok(rays)
    }
}

/// A point a relative 1e-10 to 0.1 inside the edge of what a finite observer sees: there the ray
/// turns.
fn beside_edge(
    rng: &mut impl Rng,
    spin: f64,
    inclination: Angle,
    radius: f64,
) -> Result<[f64; 2], Error> {
    let hole = Kerr::new(spin)?;
    let [x, y] = in_disc(rng, 1.0);
    let observer = Draw { spin, inclination, radius, alpha: x, beta: y }.observer()?;
    let (mut seen, mut unseen) = (0.0, 100.0 * radius);
    for _ in 0..100 {
        let b = 0.5 * (seen + unseen);
        let ok = observer.ray(&hole, b * x, b * y).is_ok();
        if ok { seen = b } else { unseen = b }
    }
    let b = seen * (1.0 - log_uniform(rng, -10.0, -1.0));
    Ok([b * x, b * y])
}

/// Points of a ray that are judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum At {
    /// 20 samples equidistant in Mino time.
    Samples,
    /// The first three equatorial crossings.
    Crossings,
}

/// One quantity of one row.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Held {
    /// Number of rays with an error beyond their estimate.
    pub beyond: usize,
    /// Largest error over its estimate.
    pub worst: f64,
    /// Median of estimate over error.
    pub overestimate: f64,
    /// Largest error.
    pub error: f64,
}

/// Result for one class, kind of point and setting.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Class of rays.
    pub class: Class,
    /// Points that are judged.
    pub at: At,
    /// Integrator.
    pub integrator: Integrator,
    /// Its tolerance.
    pub tolerance: f64,
    /// Rays with such a point, of which the fate and the number of crossings are right.
    pub rays: usize,
    /// Rays that have another fate or number of crossings than the truth.
    pub wrong: usize,
    /// r (relative), θ, φ (radians) and delay (M).
    pub held: [Held; 4],
}

impl Row {
    /// Returns a row of a table: rays, those that come out wrong, and of r, θ, φ and delay the rays
    /// beyond their estimate, the largest error over its estimate, the median estimate over error,
    /// and the largest error.
    pub fn line(&self) -> String {
        let at = if self.at == At::Samples { "samples" } else { "crossings" };
        let setting = format!("{} {:.0e}", self.integrator.name(), self.tolerance);
        let mut text = format!(
            "| {} | {at} | {setting} | {} | {} |",
            self.class.name(),
            self.rays,
            self.wrong
        );
        for Held { beyond, worst, overestimate, error } in &self.held {
            text += &format!(" {beyond}; {worst:.2}; {overestimate:.0}; {error:.0e} |");
        }
        text
    }

    /// Returns whether the estimates of r, θ, φ and delay bound the errors of 99 % of the rays,
    /// each; of fewer than a hundred rays one may be beyond.
    pub fn holds(&self) -> bool {
        self.held.iter().all(|held| 100 * held.beyond <= self.rays.max(100))
    }
}

/// Errors and estimates of one ray: r, θ, φ, delay.
type Judged = Option<([f64; 4], [f64; 4])>;

/// One ray by one setting at one kind of point.
///
/// # Errors
/// If the fate or the number of crossings is wrong.
fn judge(
    ray: &Draw,
    at: At,
    (integrator, tolerance): (Integrator, f64),
    oracle: &Oracle,
) -> Result<Judged, ()> {
    let request = match at {
        At::Samples => Request::samples(Placement::MinoTime(20)),
        At::Crossings => Request::crossings(3),
    };
    let request = Request { uncertainty: true, ..request };
    let (Ok(hole), Ok(observer)) = (Kerr::new(ray.spin), ray.observer()) else { return Err(()) };
    let traced = integrator.trace(&hole, &observer, &[ray.alpha], &[ray.beta], tolerance, &request);
    // What an integrator does not serve is no ray of it.
    let Ok(table) = traced else { return Ok(None) };
    if table.mino_total[0].is_nan() {
        return Ok(None);
    }
    if table.outcome[0] != oracle.outcome() {
        return Err(());
    }
    let truth = match at {
        At::Samples => samples(&table, hole.horizon(), oracle),
        At::Crossings => crossings(&table, oracle)?,
    };
    let estimate = table.uncertainty[0];
    let estimate = [estimate.radius, estimate.theta, estimate.azimuth, estimate.delay];
    let columns = |t: Uncertainty| ([t.radius, t.theta, t.azimuth, t.delay], estimate);
    Ok(truth.map(columns))
}

fn samples(table: &RayTable, horizon: f64, oracle: &Oracle) -> Option<Uncertainty> {
    let points = &table.samples;
    // Azimuth and delay have no limit at the horizon itself.
    let counts = |k: &usize| points.radius[*k] > horizon * (1.0 + 2e-8);
    (0..points.len()).filter(counts).map(|k| oracle.judge(points, k)).reduce(Uncertainty::max)
}

fn crossings(table: &RayTable, oracle: &Oracle) -> Result<Option<Uncertainty>, ()> {
    let times = oracle.crossings();
    let points = &table.crossings;
    let end = table.mino_total[0];
    let before_end = times.iter().filter(|time| time.hi <= end).count();
    if before_end.abs_diff(table.crossing_count[0] as usize) > 0 {
        return Err(());
    }
    let judged = |k: usize| oracle.compare(times[k], points, k);
    Ok((0..points.len()).map(judged).reduce(Uncertainty::max))
}

/// Judges `n` random rays of a class by every setting.
///
/// # Errors
/// If a spin or tolerance is out of range.
pub fn run(
    class: Class,
    settings: &[(Integrator, f64)],
    n: usize,
    seed: u64,
) -> Result<Vec<Row>, Error> {
    let rays = class.rays(n, seed)?;
    let of_ray = |oracle: &mut Oracle, ray: &Draw| -> Result<Vec<Result<Judged, ()>>, Error> {
        oracle.trace(ray)?;
        let both = settings
            .iter()
            .flat_map(|setting| [(At::Samples, *setting), (At::Crossings, *setting)]);
        Ok(both.map(|(at, setting)| judge(ray, at, setting, oracle)).collect())
    };
    let judged: Vec<_> =
        rays.par_iter().map_init(Oracle::default, of_ray).collect::<Result<_, _>>()?;
    let mut rows = Vec::new();
    for at in [At::Samples, At::Crossings] {
        for (k, (integrator, tolerance)) in settings.iter().enumerate() {
            let column = 2 * k + usize::from(at == At::Crossings);
            let of_this = || judged.iter().map(|ray| ray[column]);
            let pairs: Vec<_> = of_this().filter_map(|ray| ray.ok().flatten()).collect();
            let wrong = of_this().filter(Result::is_err).count();
            let (integrator, tolerance) = (*integrator, *tolerance);
            let held = core::array::from_fn(|q| held(pairs.iter().map(|(t, e)| (t[q], e[q]))));
            rows.push(Row { class, at, integrator, tolerance, rays: pairs.len(), wrong, held });
        }
    }
    Ok(rows)
}

/// Counts the errors that their estimates bound.
fn held(pairs: impl Iterator<Item = (f64, f64)>) -> Held {
    let mut held = Held::default();
    let mut over = Vec::new();
    for (error, estimate) in pairs {
        // An infinite estimate says that nothing is known; a NaN is beyond any other.
        let holds = error <= estimate || estimate == f64::INFINITY;
        held.beyond += usize::from(!holds);
        held.worst = held.worst.max(if holds && error == 0.0 { 0.0 } else { error / estimate });
        held.error = held.error.max(error);
        over.push(estimate / error.max(f64::EPSILON));
    }
    over.sort_by(f64::total_cmp);
    held.overestimate = over.get(over.len() / 2).copied().unwrap_or(f64::NAN);
    held
}
