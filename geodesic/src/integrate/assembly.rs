//! A path made of steps that were taken elsewhere: on a graphics device, in floats.
//!
//! The steps are the series of [`path`](crate::integrate::path), so that whatever reads a path reads this one. What is
//! singular at the horizon is not part of them: it is added here, in doubles.

use crate::integrate::mino::index;
use crate::integrate::outcome::Outcome;
use crate::integrate::path::{Path, Segment, turn};
use crate::integrate::run::{start_angle, start_constants, switch_leg};
use crate::integrate::uncertainty::Budget;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;

/// Coefficients of each series of a [`TaylorStep`].
const TERMS: usize = 11;

/// A step of a backward ray, as series in the scaled Mino time bτ from its start on; b = √max(1, η + λ²), within rounding,
/// is a constant of the ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaylorStep {
    /// Length in bτ, from 0, on which the series are used.
    pub length: f64,
    /// +1 on a step that starts inwards, −1 on one that starts outwards.
    pub leg: f64,
    /// Centre of the expansion, missing from the first coefficient of b/r: rays next to a photon orbit are followed in
    /// their distance from it.
    pub centre: f64,
    /// Taylor coefficients, lowest power first, of b/r; cos θ, sin θ cos φ and sin θ sin φ without frame dragging and
    /// without the observer's azimuth; and the integrals of the regular parts of dφ/d(bτ) and of d(delay/b)/d(bτ), as
    /// the documentation of the equations of motion (`integrate/mino.rs`) has them, from the observer on.
    pub series: [[f32; TERMS]; 6],
}

/// A whole ray in steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RaySteps<'a> {
    /// b.
    pub scale: f64,
    pub outcome: Outcome,
    /// Estimated error: relative in radii, radians in angles.
    pub error: f64,
    pub steps: &'a [TaylorStep],
}

/// Variables of a state with azimuth and time.
const ALL: usize = index::AZIMUTH + 2;

impl Path {
    /// Makes it the path of `ray`, from its steps.
    pub(crate) fn assemble(&mut self, hole: &Kerr, ray: &Ray, taken: RaySteps<'_>) {
        self.reset::<ALL>(hole, ray, taken.scale);
        self.width = TERMS;
        let e = taken.error;
        let budget =
            Budget { local: e, direction: e, polar: e, azimuth: e, delay: e, ..Budget::default() };
        let mut leg = if ray.inward { 1.0 } else { -1.0 };
        let (mut s, mut turned) = (0.0, start_angle(ray));
        let mut constants = start_constants(hole, ray, leg);
        for (k, step) in taken.steps.iter().enumerate() {
            self.append(step);
            if k > 0 {
                turned += turn(
                    self.rotation_sign,
                    self.horizontal(k - 1),
                    self.horizontal(k).map(|[x, _]| x),
                );
            }
            if step.leg != leg {
                let w = self.polynomial(k, 0).0[0] / self.scale;
                constants = switch_leg(hole, leg, w, constants);
                leg = step.leg;
            }
            self.segments.push(Segment { s, h: step.length, leg, constants, turned, budget });
            s += step.length;
        }
        (self.start, self.end, self.outcome) = (Budget::default(), s, taken.outcome);
        (0..taken.steps.len()).for_each(|k| self.find_events(k));
    }

    /// Appends the series of a step, as polynomials in the part of it that is over.
    fn append(&mut self, step: &TaylorStep) {
        for (row, series) in step.series.iter().enumerate() {
            let (first, mut power) = (self.coefficients.len(), 1.0);
            for coefficient in series {
                self.coefficients.push(f64::from(*coefficient) * power);
                power *= step.length;
            }
            self.coefficients[first] += if row == 0 { step.centre } else { 0.0 };
        }
    }

    /// sin θ cos φ and sin θ sin φ without frame dragging at the start of step `k`, each with its rate.
    fn horizontal(&self, k: usize) -> [[f64; 2]; 2] {
        [2, 3].map(|row| self.polynomial(k, row).0).map(|series| [series[0], series[1]])
    }

    /// Returns whether the ray is above the equatorial plane, or is about to be, at the start of step `k` or the end of
    /// the last.
    fn is_above(&self, k: usize) -> bool {
        let last = k == self.segments.len();
        let (u, rate) = self.polynomial(k - usize::from(last), 1).both(f64::from(last));
        if u == 0.0 { rate > 0.0 } else { u > 0.0 }
    }

    /// Takes a crossing of the equatorial plane and a turning point within step `k`.
    fn find_events(&mut self, k: usize) {
        let Segment { s, h, leg, .. } = self.segments[k];
        if self.is_above(k) != self.is_above(k + 1) {
            let x = self.polynomial(k, 1).solve(0.0, 0.0, 1.0);
            self.crossings.push(s + h * x);
        }
        let radial = self.polynomial(k, 0);
        let turns = match self.segments.get(k + 1) {
            Some(next) => next.leg != leg,
            None => leg * radial.slope(1.0) < 0.0 && self.outcome == Outcome::Escaped,
        };
        if turns {
            let x = radial.solve_slope();
            let w = radial.value(x) / self.scale;
            (self.turning, self.turning_w) = (Some(s + h * x), Some(w));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Inclination, Motion, Observer, Quantities, Tracer, View};

    /// The finest for which the tracer takes series of order 10.
    const TOLERANCE: f64 = 2.4e-6;

    /// The steps of a path, its series rounded to floats.
    fn steps(path: &Path) -> Vec<TaylorStep> {
        let step = |(k, segment): (usize, &Segment<f64>)| {
            let row = |row: usize| {
                let scaled = path.polynomial(k, row).0.iter().enumerate();
                let rounded = scaled.map(|(n, c)| (c / segment.h.powi(n as i32)) as f32);
                rounded.collect::<Vec<_>>().try_into().unwrap()
            };
            let last = k + 1 == path.segments.len();
            let length = if last { path.end - segment.s } else { segment.h };
            let series = core::array::from_fn(row);
            TaylorStep { length, leg: segment.leg, centre: 0.0, series }
        };
        path.segments.iter().enumerate().map(step).collect()
    }

    /// A path that is taken apart and put together again is the same but for rounding to floats.
    #[test]
    fn exact_paths_come_back_from_their_steps() {
        let inclination = Inclination::from_degrees(70.0).unwrap();
        for spin in [0.0, 0.9, -1.0] {
            let hole = Kerr::new(spin).unwrap();
            let screen = Observer::at_infinity(inclination).with_azimuth(0.7);
            let camera = Camera::new(&hole, inclination, 12.0, Motion::Static).unwrap();
            let views = [View::Screen(screen), View::Camera(camera.with_pointing(1.5, 0.3, 0.0))];
            for (view, reach) in views.iter().zip([9.0, 1.2]) {
                for k in 0..60 {
                    let (y, x) = (2.4 * f64::from(k)).sin_cos();
                    let size = reach * f64::from(k + 1) / 60.0;
                    let ray = view.ray(&hole, size * x, size * y).unwrap();
                    come_back(&hole, &ray);
                }
            }
        }
    }

    fn come_back(hole: &Kerr, ray: &Ray) {
        let (mut exact, mut found) = (Path::new(), Path::new());
        Tracer::new(TOLERANCE).unwrap().trace(hole, ray, Quantities::ALL, &mut exact);
        let steps = steps(&exact);
        let (scale, outcome) = (exact.scale, exact.outcome());
        found.assemble(hole, ray, RaySteps { scale, outcome, error: 1e-6, steps: &steps });
        assert_eq!((found.outcome(), found.steps()), (outcome, exact.steps()));
        assert!((found.mino_total() / exact.mino_total() - 1.0).abs() < 1e-6);
        let times = |path: &Path| -> Vec<f64> {
            path.equatorial_crossings().chain(path.turning_point().map(|(t, _)| t)).collect()
        };
        let [own, theirs] = [&exact, &found].map(times);
        assert_eq!(own.len(), theirs.len(), "{ray:?}");
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-5 * exact.mino_total();
        assert!(own.iter().zip(&theirs).all(near), "{own:?} {theirs:?}");
        for k in 1..30 {
            let [a, b] =
                [&exact, &found].map(|path| path.at(path.mino_total() * f64::from(k) / 30.0));
            let gap = 1.0 - hole.horizon() * a.inverse_radius;
            assert!((a.radius() / b.radius() - 1.0).abs() < 1e-5, "{a:?} {b:?}");
            assert!((a.cos_theta() - b.cos_theta()).abs() < 1e-5, "{a:?} {b:?}");
            assert!((a.azimuth - b.azimuth).abs() * gap < 1e-5, "{a:?} {b:?}");
            assert!((a.delay - b.delay).abs() * gap < 1e-5 * scale.max(a.radius()), "{a:?} {b:?}");
        }
    }
}
