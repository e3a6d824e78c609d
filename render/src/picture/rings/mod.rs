//! Photon rings: where a square of the picture lies so close to the critical curve that images of higher
//! order are narrower than it, its rays are placed along the images instead of at its centre.
//!
//! W at the barrier of the radial potential is a smooth function of the screen with its zero on the
//! critical curve. Next to it the image number n + 1 of whatever shines is that of number n with its distance
//! from the curve times e^−γ (Gralla & Lupsasca 2020, arXiv:1910.12873): in the logarithm of the distance
//! all of them are equally wide. A square is therefore cut into strata between level lines of W that
//! are equidistant in this logarithm. Each stratum has one ray, whose weight is its share of the area.
//! No ray has to meet a ring for it to be found.

mod resolve;
mod square;

pub(super) use resolve::{Counted, Resolver};

use crate::transport::View;
use core::f64::consts::TAU;
use kerrlight_geodesic::Kerr;
use kerrlight_geodesic::analytic::CriticalCurve;
use square::Plane;

/// A ray with its share of a square's area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stratum {
    /// Where it arrives, in the view's coordinates.
    pub x: f64,
    /// The same, upwards.
    pub y: f64,
    /// Its share.
    pub share: f64,
}

/// What places rays along photon rings.
#[derive(Debug, Clone)]
pub struct RingStrata {
    hole: Kerr,
    view: View,
    /// Distance of the critical curve from the origin of an observer's screen, at equal steps of the angle.
    curve: Vec<f64>,
    spacing: f64,
    /// Whether only squares that the critical curve runs through have strata.
    only_on_curve: bool,
}

/// Distance from the critical curve, in widths of the square, below which the logarithm gives way to the
/// distance itself: the images within it fill 1/25 of the square.
const CORE: f64 = 0.02;

/// Points at which the critical curve is known beforehand.
const POINTS: u32 = 512;

/// What the curve between these points, or W's own curvature, may be off by, in M.
const SLACK: f64 = 0.05;

/// A square is quartered at most this often where W is no plane on it.
const DEEPEST: u32 = 6;

impl RingStrata {
    /// For a view of a hole. `spacing` is that of rays in the logarithm of their distance from the critical
    /// curve: that of the finest feature of what shines, about its size by its radius.
    pub fn new(hole: &Kerr, view: &View, spacing: f64) -> Self {
        let curve = match view {
            View::Screen(observer) => {
                let curve = CriticalCurve::new(hole, observer.inclination());
                curve.points(POINTS).map(|point| point.alpha.hypot(point.beta)).collect()
            }
            View::Camera(_) => Vec::new(),
        };
        RingStrata { hole: *hole, view: *view, curve, spacing, only_on_curve: false }
    }

    /// The same for squares that are cut where their light says so: only those that the critical curve runs
    /// through, which no cutting ends, have strata.
    pub fn on_curve(self) -> Self {
        RingStrata { only_on_curve: true, ..self }
    }

    /// Adds the rays of the square of width `size` about (x, y), ordered along W; none where a
    /// single ray at its centre will do.
    pub fn place(&self, (x, y): (f64, f64), size: f64, rays: &mut Vec<Stratum>) {
        if self.is_far(x, y, size) {
            return;
        }
        let first = rays.len();
        self.cut((x, y), size, (1.0, 0), rays);
        if rays.len() == first + 1 {
            rays.truncate(first);
        }
    }

    /// Whether a square has one stratum, without W: images are as wide as their distance from the curve
    /// times the spacing.
    fn is_far(&self, x: f64, y: f64, size: f64) -> bool {
        if self.curve.is_empty() {
            return false;
        }
        let turn = (y.atan2(x) / TAU).rem_euclid(1.0) * f64::from(POINTS);
        let near = self.curve.get(turn as usize % self.curve.len()).copied().unwrap_or(0.0);
        (x.hypot(y) - near).abs() > 2.0 * size * (1.0 + 1.0 / self.spacing) + SLACK
    }

    fn cut(
        &self,
        (x, y): (f64, f64),
        size: f64,
        (share, level): (f64, u32),
        rays: &mut Vec<Stratum>,
    ) {
        let half = 0.5 * size;
        let at = |dx: f64, dy: f64| self.height(x + dx * half, y + dy * half);
        let corners = [at(-1.0, -1.0), at(1.0, -1.0), at(-1.0, 1.0), at(1.0, 1.0)];
        let plane = Plane::through(at(0.0, 0.0), corners);
        if !plane.is_finite() {
            return rays.push(Stratum { x, y, share });
        }
        if self.only_on_curve && !plane.is_near(corners) {
            return rays.push(Stratum { x, y, share });
        }
        if level < DEEPEST && plane.is_bent() && plane.is_near(corners) {
            return self.quarter((x, y), size, (share, level), rays);
        }
        // Of the whole square: rays of its quarters follow the same grading.
        let core = CORE * plane.reach() * f64::from(1 << level);
        for (place, part) in plane.strata(core, self.spacing) {
            let [dx, dy] = self.onto(&plane, place, (x, y), size);
            rays.push(Stratum { x: x + dx * size, y: y + dy * size, share: share * part });
        }
    }

    fn quarter(
        &self,
        (x, y): (f64, f64),
        size: f64,
        (share, level): (f64, u32),
        rays: &mut Vec<Stratum>,
    ) {
        let step = 0.25 * size;
        for (dx, dy) in [(-step, -step), (step, -step), (-step, step), (step, step)] {
            self.cut((x + dx, y + dy), 0.5 * size, (0.25 * share, level + 1), rays);
        }
    }

    /// A place of the plane moved to where W is what the plane says, inside the square.
    fn onto(&self, plane: &Plane, place: [f64; 2], (x, y): (f64, f64), size: f64) -> [f64; 2] {
        let [dx, dy] = place;
        let height = self.height(x + dx * size, y + dy * size);
        let step = plane.step(place, height);
        [dx + step[0], dy + step[1]].map(|z| z.clamp(-0.4999, 0.4999))
    }

    /// W at the barrier of the ray that arrives at a point; 1, the value at infinity, for one that falls in
    /// without a barrier, NaN where none arrives from the hole's side.
    fn height(&self, x: f64, y: f64) -> f64 {
        match self.view.ray(&self.hole, x, y) {
            Ok(ray) if ray.inward && !ray.is_from_horizon => {
                ray.potential.barrier.map_or(1.0, |barrier| barrier.height)
            }
            _ => f64::NAN,
        }
    }
}
