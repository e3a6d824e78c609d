//! A screen or a camera: what makes rays of points of a picture.

use crate::error::Error;
use crate::numbers::dual::Dual;
use crate::screen::camera::Camera;
use crate::screen::observer::{Observer, Ray, check_hole};
use crate::spacetime::kerr::Kerr;

/// Place from which a picture is taken: a distant observer's screen or a camera near the hole.
///
/// Code that renders or traces takes a `View` and need not know which of the two it has: points
/// are (x, y), and [`blueshift`](Self::blueshift) tells what a camera's motion and depth in the
/// potential do to the light that it receives.
///
/// ```
/// use kerrlight_geodesic::{Camera, Inclination, Kerr, Motion, Observer, View};
///
/// let hole = Kerr::new(0.0)?;
/// let inclination = Inclination::from_degrees(90.0)?;
/// let screen = View::Screen(Observer::at_infinity(inclination));
/// assert_eq!(screen.blueshift(3.0, 4.0), None);
///
/// // At rest at 8 M light arrives blueshifted by 1/√(1 − 2/r), from every direction.
/// let camera = View::Camera(Camera::new(&hole, inclination, 8.0, Motion::Static)?);
/// let blueshift = camera.blueshift(0.2, -0.1).unwrap();
/// assert!((blueshift - 0.75f64.sqrt().recip()).abs() < 1e-14);
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum View {
    /// Bardeen's screen: points are (α, β) in M, and frequencies are those at infinity.
    Screen(Observer),
    /// A camera: points lie in the picture plane at distance 1, and frequencies are those in the
    /// camera's frame.
    Camera(Camera),
}

impl View {
    /// The photon that arrives at the point (x, y) of the picture: (α, β) in M of an observer, tangents of angles from
    /// the line of sight of a camera.
    ///
    /// # Errors
    /// If no photon arrives there, see [`Observer::ray`] and [`Camera::ray`], or a camera was made for another hole.
    pub fn ray(&self, hole: &Kerr, x: f64, y: f64) -> Result<Ray, Error> {
        self.check_hole(hole)?;
        match self {
            View::Screen(observer) => observer.ray(hole, x, y),
            View::Camera(camera) => camera.ray(x, y),
        }
    }

    /// The same photon with its derivatives with respect to x and y, for
    /// [`footprint::of_ray`](crate::footprint::of_ray).
    ///
    /// # Errors
    /// As for [`ray`](Self::ray).
    pub fn beam(&self, hole: &Kerr, x: f64, y: f64) -> Result<Ray<Dual<f64, 2>>, Error> {
        self.check_hole(hole)?;
        let (x, y) = (Dual::parameter(x, 0), Dual::parameter(y, 1));
        match self {
            View::Screen(observer) => {
                let lifted = observer.with_inclination(observer.inclination().lift());
                lifted.ray(&hole.lift(), x, y)
            }
            View::Camera(camera) => camera.ray(x, y),
        }
    }

    /// Checks that it looks at `hole`: a camera was made for one.
    pub(crate) fn check_hole(&self, hole: &Kerr) -> Result<(), Error> {
        match self {
            View::Screen(_) => Ok(()),
            View::Camera(camera) => check_hole(camera.hole().spin(), hole.spin()),
        }
    }

    /// Ratio of the frequency of light that arrives at (x, y) to its frequency at infinity; `None` for
    /// a screen, where the two are equal, and for light that cannot come from there
    /// ([`Ray::is_from_horizon`]).
    pub fn blueshift(&self, x: f64, y: f64) -> Option<f64> {
        match self {
            View::Screen(_) => None,
            View::Camera(camera) => {
                let shift = camera.blueshift(camera.direction(x, y));
                Some(shift).filter(|shift| *shift > 0.0 && shift.is_finite())
            }
        }
    }

    /// The observer whose screen it is; `None` for a camera.
    pub fn observer(&self) -> Option<&Observer> {
        match self {
            View::Screen(observer) => Some(observer),
            View::Camera(_) => None,
        }
    }
}
