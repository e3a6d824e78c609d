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

pub(super) use resolve::{Counted, Resolver, range};

use crate::transport::View;
use core::f64::consts::TAU;
use kerrlight_geodesic::Kerr;
use kerrlight_geodesic::analytic::CriticalCurve;
use square::Plane;

/// A ray with its share of a square's area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stratum {
    /// Place of arrival, in the view's coordinates.
    pub x: f64,
    /// The same, upwards.
    pub y: f64,
    /// Its share.
    pub share: f64,
}

/// Strata along photon rings in which rays are placed.
#[derive(Debug, Clone)]
pub struct RingStrata {
    hole: Kerr,
    view: View,
    /// Distance of the critical curve from the origin of an observer's screen, at equal steps of the angle.
    curve: Vec<f64>,
    spacing: f64,
    /// Ratio of the distance of rays to `spacing`, so that they are as few as the picture is small.
    coarseness: f64,
    /// True if only squares that the critical curve runs through have strata.
    only_on_curve: bool,
}

/// Distance from the critical curve, in widths of the square, below which the logarithm gives way to the
/// distance itself: the images within it fill 1/25 of the square.
const CORE: f64 = 0.02;

/// Points at which the critical curve is known beforehand.
const POINTS: u32 = 512;

/// Largest error of the curve between these points, or of W's own curvature, in M.
const SLACK: f64 = 0.05;

/// A square is quartered at most this often where W is no plane on it.
const DEEPEST: u32 = 6;

/// A part of a square.
#[derive(Debug, Clone, Copy)]
struct Part {
    center: (f64, f64),
    size: f64,
    /// Share of the area of the square.
    share: f64,
    /// Number of times the square was quartered to get it.
    level: u32,
}

impl Part {
    fn quarters(self) -> [Part; 4] {
        let Part { center: (x, y), size, share, level } = self;
        let step = 0.25 * size;
        [(-step, -step), (step, -step), (-step, step), (step, step)].map(|(dx, dy)| Part {
            center: (x + dx, y + dy),
            size: 0.5 * size,
            share: 0.25 * share,
            level: level + 1,
        })
    }
}

/// Takes a part of a square, with a plane and its strata.
type Take<'a> = dyn FnMut(&Part, Option<(&Plane, &[([f64; 2], f64)])>) + 'a;

impl RingStrata {
    /// Prepares strata for a view of a hole. `spacing` is that of rays in the logarithm of their distance from the
    /// critical curve: that of the finest feature of what shines, about its size by its radius.
    pub fn new(hole: &Kerr, view: &View, spacing: f64) -> Self {
        let curve = match view {
            View::Screen(observer) => {
                let curve = CriticalCurve::new(hole, observer.inclination());
                curve.points(POINTS).map(|point| point.alpha.hypot(point.beta)).collect()
            }
            View::Camera(_) => Vec::new(),
        };
        RingStrata {
            hole: *hole,
            view: *view,
            curve,
            spacing,
            coarseness: 1.0,
            only_on_curve: false,
        }
    }

    /// The same for squares that are cut where their light says so: only those that the critical curve runs
    /// through, which no cutting ends, have strata.
    pub fn on_curve(self) -> Self {
        RingStrata { only_on_curve: true, ..self }
    }

    /// The same with strata that are `coarseness` times as wide, and squares that are quartered where W is that much
    /// farther from a plane.
    pub fn coarsened(&self, coarseness: f64) -> Self {
        RingStrata { coarseness, ..self.clone() }
    }

    pub(super) fn coarseness(&self) -> f64 {
        self.coarseness
    }

    /// Returns the number of rays that [`place`](Self::place) adds for a square.
    pub fn count(&self, center: (f64, f64), size: f64) -> usize {
        if self.is_far(center, size) {
            return 0;
        }
        let mut count = 0;
        let whole = Part { center, size, share: 1.0, level: 0 };
        self.cut(whole, &mut |_, strata| count += strata.map_or(1, |(_, strata)| strata.len()));
        if count > 1 { count } else { 0 }
    }

    /// Adds the rays of the square of width `size` about (x, y), ordered along W; none where a
    /// single ray at its centre will do.
    pub fn place(&self, center: (f64, f64), size: f64, rays: &mut Vec<Stratum>) {
        if self.is_far(center, size) {
            return;
        }
        let first = rays.len();
        let whole = Part { center, size, share: 1.0, level: 0 };
        self.cut(whole, &mut |part, strata| {
            let Part { center: (x, y), size, share, .. } = *part;
            let Some((plane, strata)) = strata else { return rays.push(Stratum { x, y, share }) };
            for (place, within) in strata {
                let [dx, dy] = self.onto(plane, *place, x, y, size);
                rays.push(Stratum { x: x + dx * size, y: y + dy * size, share: share * within });
            }
        });
        if rays.len() == first + 1 {
            rays.truncate(first);
        }
    }

    /// Returns whether a square has one stratum, without W: images are as wide as their distance from the curve times
    /// the spacing.
    fn is_far(&self, (x, y): (f64, f64), size: f64) -> bool {
        if self.curve.is_empty() {
            return false;
        }
        let turn = (y.atan2(x) / TAU).rem_euclid(1.0) * f64::from(POINTS);
        let near = self.curve.get(turn as usize % self.curve.len()).copied().unwrap_or(0.0);
        // Beyond size/width from the curve an image is wider than the square.
        (x.hypot(y) - near).abs() > 2.0 * size * (1.0 + 1.0 / self.width()) + SLACK
    }

    /// Width of a stratum in the logarithm of the distance from the critical curve.
    fn width(&self) -> f64 {
        self.spacing * self.coarseness
    }

    /// Tells `take` the parts of a square on each of which W is a plane, and this plane with its strata; none of a part
    /// that one ray at its centre stands for.
    fn cut(&self, part: Part, take: &mut Take<'_>) {
        let Part { center: (x, y), size, level, .. } = part;
        let half = 0.5 * size;
        let at = |dx: f64, dy: f64| self.height(x + dx * half, y + dy * half);
        let corners = [at(-1.0, -1.0), at(1.0, -1.0), at(-1.0, 1.0), at(1.0, 1.0)];
        let plane = Plane::through(at(0.0, 0.0), corners);
        if !plane.is_finite() || self.only_on_curve && !plane.is_near(corners) {
            return take(&part, None);
        }
        // Strata that are twice as wide bear parts that are twice as large.
        let deepest = DEEPEST.saturating_sub(self.coarseness.log2() as u32);
        if level < deepest && plane.is_bent(self.coarseness) && plane.is_near(corners) {
            return part.quarters().into_iter().for_each(|quarter| self.cut(quarter, take));
        }
        // Of the whole square: rays of its quarters follow the same grading.
        // Few strata are better spread evenly.
        let core = (CORE * self.coarseness).min(0.5) * plane.reach() * f64::from(1 << level);
        take(&part, Some((&plane, &plane.strata(core, self.width()))));
    }

    /// A place of the plane moved to where W is what the plane says, inside the square.
    fn onto(&self, plane: &Plane, place: [f64; 2], x: f64, y: f64, size: f64) -> [f64; 2] {
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
