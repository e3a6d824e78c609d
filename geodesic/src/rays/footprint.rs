//! Footprints: the patch of the sky and of the equatorial plane that a small patch of the screen
//! covers, such as the beam of a pixel, for a renderer that filters its textures or wants
//! magnifications.
//!
//! The Jacobians are exact: dual numbers with the two screen coordinates as parameters follow the
//! same equations as the rays themselves.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Kerr, Observer, footprint};
//! let hole = Kerr::new(0.9)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let beams = footprint::of_screen(&hole, &observer, &[-6.0], &[2.0], 1e-10, 1)?;
//! let sky = beams.sky[0].expect("this ray escapes");
//! let pixel = 0.05; // radius of a pixel in M
//! println!("a pixel covers {:.3} rad of the sky", pixel * sky.ellipse().semi_major);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```

use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::integrate::path::Path;
use crate::integrate::trace::{Tracer, trace_series};
use crate::numbers::dual::Dual;
use crate::numbers::vector::dot;
use crate::rays::blocks::{BLOCK, check_columns, in_blocks};
use crate::screen::camera::Camera;
use crate::screen::observer::{Observer, Ray};
use crate::screen::view::View;
use crate::simd::span;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;
use crate::spacetime::quantities::Quantities;

/// A number with its derivatives with respect to the two coordinates of the screen.
pub type Number = Dual<f64, 2>;

/// The image of the unit circle of the screen under a linear map to a plane: a circle of radius
/// ε around a ray covers ε times this ellipse, as long as ε is small.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ellipse {
    /// Longer semi-axis, per unit of the screen.
    pub semi_major: f64,
    /// Shorter semi-axis, ≥ 0, in the unit of the longer one.
    pub semi_minor: f64,
    /// Direction of the longer axis in the plane: angle from the first towards the second
    /// basis vector, in (−π/2, π/2].
    pub orientation: f64,
    /// Determinant of the map: the area covered per area of the screen, negative where the image
    /// is mirrored.
    pub magnification: f64,
}

impl Ellipse {
    /// Returns the footprint of the linear map with these columns (images of the two unit vectors
    /// of the screen).
    pub fn of_map(columns: [[f64; 2]; 2]) -> Self {
        // Closed form of the singular values of a 2 × 2 matrix: half sum and half difference of
        // the lengths of its conformal and its mirroring part, free of cancellation.
        let [[a, c], [b, d]] = columns;
        let (even, odd) = ((a + d).hypot(c - b), (a - d).hypot(c + b));
        let magnification = a * d - b * c;
        let semi_major = 0.5 * (even + odd);
        let semi_minor = if semi_major > 0.0 { magnification.abs() / semi_major } else { 0.0 };
        let twice = (c - b).atan2(a + d) + (c + b).atan2(a - d);
        Ellipse { semi_major, semi_minor, orientation: half_turn(0.5 * twice), magnification }
    }
}

/// An angle of an axis, brought to (−π/2, π/2].
fn half_turn(angle: f64) -> f64 {
    use core::f64::consts::{FRAC_PI_2, PI};
    let angle = angle.rem_euclid(PI);
    if angle > FRAC_PI_2 { angle - PI } else { angle }
}

/// Direction on the sky at infinity of an escaping ray, and how that changes with the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sky {
    /// Unit vector towards the source, n = (sin θ cos φ, sin θ sin φ, cos θ).
    pub direction: [f64; 3],
    /// ∂n/∂(first screen coordinate): per M of α, or per unit of a camera's x. Tangent to the
    /// sphere; regular at the poles.
    pub by_first: [f64; 3],
    /// ∂n/∂(second screen coordinate).
    pub by_second: [f64; 3],
}

impl Sky {
    /// Polar angle of the source, in radians.
    pub fn theta(&self) -> f64 {
        let [x, y, z] = self.direction;
        x.hypot(y).atan2(z)
    }

    /// Azimuth of the source in (−π, π], in radians.
    pub fn azimuth(&self) -> f64 {
        self.direction[1].atan2(self.direction[0])
    }

    /// Two unit vectors that span the plane tangent to the sky in which
    /// [`ellipse`](Self::ellipse) lies: right (the horizontal one that turns about +z) and up, as
    /// seen from inside with +z up; at the poles some pair. right × up points back to the hole.
    pub fn frame(&self) -> [[f64; 3]; 2] {
        let [x, y, z] = self.direction;
        let s = x.hypot(y);
        let [cos, sin] = if s > 0.0 { [x / s, y / s] } else { [1.0, 0.0] };
        // Looking along n with +z up, −ê_φ lies to the right.
        [[sin, -cos, 0.0], [-z * cos, -z * sin, s]]
    }

    /// The patch of sky, in radians per unit of the screen, that a circle on the screen covers, in
    /// the plane of [`frame`](Self::frame). `magnification` is in steradians per unit of the
    /// screen squared: positive where a picture of the sky keeps its handedness, negative where
    /// it is mirrored. (Seen from infinity the sky behind a weak lens is mirrored: such an
    /// observer is farther away than the lens can focus.)
    pub fn ellipse(&self) -> Ellipse {
        let [right, up] = self.frame();
        let in_frame = |v: &[f64; 3]| [dot(right, *v), dot(up, *v)];
        Ellipse::of_map([in_frame(&self.by_first), in_frame(&self.by_second)])
    }
}

/// Point where a ray meets the equatorial plane, and how that changes with the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Azimuth, unwrapped from the observer on, in radians.
    pub azimuth: f64,
    /// ∂r/∂(first, second screen coordinate): in M per M, or M per unit of a camera's plane.
    pub radius_by: [f64; 2],
    /// ∂φ/∂(first, second screen coordinate), in radians per such unit.
    pub azimuth_by: [f64; 2],
}

impl Disc {
    /// The patch of the plane that a circle on the screen covers, with (dr, r dφ) as Cartesian
    /// coordinates: what a texture painted in r cos φ, r sin φ needs.
    pub fn ellipse(&self) -> Ellipse {
        let column = |k: usize| [self.radius_by[k], self.radius * self.azimuth_by[k]];
        Ellipse::of_map([column(0), column(1)])
    }
}

/// The beams of many rays.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Beams {
    /// Outcome of each ray.
    pub outcome: Vec<Outcome>,
    /// End of each ray on the sky, if there is one.
    pub sky: Vec<Option<Sky>>,
    /// The first equatorial crossings of all rays, ray after ray: see [`of`](Self::of).
    pub crossings: Vec<Disc>,
    ends: Vec<usize>,
}

impl Beams {
    /// The crossings of ray number `ray`; none if there is no such ray.
    pub fn of(&self, ray: usize) -> &[Disc] {
        &self.crossings[span(&self.ends, ray)]
    }

    fn take(&mut self, path: &Path<Number>, crossings: usize) {
        let escaped = path.outcome() == Outcome::Escaped;
        self.outcome.push(path.outcome());
        self.sky.push(escaped.then(|| sky(&path.at(path.mino_total()))));
        let hits = path.equatorial_crossings().take(crossings);
        self.crossings.extend(hits.map(|time| disc(&path.at(time))));
        self.ends.push(self.crossings.len());
    }

    fn append(&mut self, other: Self) {
        let before = self.crossings.len();
        self.ends.extend(other.ends.iter().map(|end| end + before));
        self.outcome.extend(other.outcome);
        self.sky.extend(other.sky);
        self.crossings.extend(other.crossings);
    }
}

/// Quantities of rays that beams are made of.
const WANTED: Quantities = Quantities { azimuth: true, time: false, velocity: false };

fn sky(end: &PathPoint<Number>) -> Sky {
    let n = end.direction;
    let by = |k: usize| n.map(|x| x.slope[k]);
    Sky { direction: n.map(|x| x.value), by_first: by(0), by_second: by(1) }
}

fn disc(point: &PathPoint<Number>) -> Disc {
    let (radius, azimuth) = (point.radius(), point.azimuth);
    Disc {
        radius: radius.value,
        azimuth: azimuth.value,
        radius_by: radius.slope,
        azimuth_by: azimuth.slope,
    }
}

/// Returns the end of one ray on the sky, and how that changes with the two parameters of its dual
/// numbers (see [`Observer::ray`] and [`Camera::ray`]); `None` if it does not escape. `path` is
/// memory that is reused from ray to ray.
///
/// # Errors
/// If `tolerance` is not in \[1e-14, 1e-2\].
pub fn of_ray(
    hole: &Kerr<Number>,
    ray: &Ray<Number>,
    tolerance: f64,
    path: &mut Path<Number>,
) -> Result<Option<Sky>, Error> {
    trace_series(tolerance, hole, ray, WANTED, path)?;
    let escaped = path.outcome() == Outcome::Escaped;
    Ok(escaped.then(|| sky(&path.at(path.mino_total()))))
}

/// The beams around the points (`alpha[k]`, `beta[k]`) of an observer's screen, with at most
/// `crossings` equatorial crossings each, on all cores with the feature `rayon`. Derivatives are
/// per M of α (first) and β (second).
///
/// # Errors
/// If the columns differ in length, `tolerance` is not in \[1e-14, 1e-2\], or as for
/// [`Observer::ray`].
pub fn of_screen(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    tolerance: f64,
    crossings: usize,
) -> Result<Beams, Error> {
    beams(hole, &View::Screen(*observer), alpha, beta, tolerance, crossings)
}

/// The beams around the points (`x[k]`, `y[k]`) of a camera's picture plane: see [`of_screen`].
/// Derivatives are per unit of x (first) and y (second), the tangents of angles. Since such a
/// unit square covers a solid angle of (1 + x² + y²)^(−3/2), a source is magnified by that over the
/// absolute `magnification` of its [`Sky::ellipse`].
///
/// # Errors
/// As for [`of_screen`], with [`Camera::ray`].
pub fn of_camera(
    camera: &Camera,
    x: &[f64],
    y: &[f64],
    tolerance: f64,
    crossings: usize,
) -> Result<Beams, Error> {
    beams(camera.hole(), &View::Camera(*camera), x, y, tolerance, crossings)
}

fn beams(
    hole: &Kerr,
    view: &View,
    first: &[f64],
    second: &[f64],
    tolerance: f64,
    crossings: usize,
) -> Result<Beams, Error> {
    check_columns(first, second)?;
    Tracer::new(tolerance)?;
    let lifted = hole.lift();
    let pieces = in_blocks(BLOCK, first, second, |first, second| -> Result<Beams, Error> {
        let mut beams = Beams::default();
        let mut path = Path::empty();
        for (first, second) in first.iter().zip(second) {
            let ray = view.beam(hole, *first, *second)?;
            trace_series(tolerance, &lifted, &ray, WANTED, &mut path)?;
            beams.take(&path, crossings);
        }
        Ok(beams)
    });
    let mut whole = Beams::default();
    for piece in pieces {
        whole.append(piece?);
    }
    Ok(whole)
}
