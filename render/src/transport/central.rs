//! Central rays of pixels besides their light, on request: path length, motion on the picture, and the part of the sky that
//! the pixel covers. These rays are traced once more, step by step.

use super::layers::{Kind, Layers, Origin};
use super::optics::in_cartesian;
use super::prepare::PreparedScene;
use kerrlight_geodesic::footprint::{self, Number};
use kerrlight_geodesic::vector::{cross, dot};
use kerrlight_geodesic::{Kerr, Path, PathLength, PathPoint, Quantities, Scalar, trace_series};

/// Memory that is reused from ray to ray.
#[derive(Debug, Default)]
pub(super) struct CentralScratch {
    path: Path,
    beam: Path<Number>,
    length: PathLength,
}

/// Distance in M at which an infinitely distant observer is placed where path lengths are counted from.
pub(crate) const FAR: f64 = 1000.0;

impl PreparedScene {
    /// Adds what is wanted of the ray at (x, y), the centre of a pixel of some size, both in units of the view.
    pub(crate) fn add_central(
        &self,
        x: f64,
        y: f64,
        pixel: f64,
        scratch: &mut super::Scratch,
        layers: &mut Layers,
    ) -> Result<(), crate::Error> {
        let (wanted, scratch) = (self.optics.wanted, &mut scratch.central);
        if let (true, Some(origin)) = (wanted.depth, layers.origin) {
            layers.depth = Some(self.depth(x, y, origin.mino_time, scratch)?);
        }
        let moves = |origin: &Origin| self.optics.numbering.kind(origin.source) != Kind::Other;
        if let (true, Some(origin)) = (wanted.motion, layers.origin.filter(moves)) {
            layers.motion = self.motion(x, y, origin, scratch)?.map(|rate| finite(rate / pixel));
        }
        if wanted.footprint && layers.exit.is_some() {
            layers.footprint = self.footprint(x, y, scratch)? * pixel * pixel;
        }
        Ok(())
    }

    /// ∫Σ dτ in M from the observer, or from [`FAR`], up to a Mino time.
    fn depth(
        &self,
        x: f64,
        y: f64,
        mino_time: f64,
        CentralScratch { path, length, .. }: &mut CentralScratch,
    ) -> Result<f64, crate::Error> {
        let (hole, view) = (&self.optics.hole, &self.optics.view);
        let ray = view.ray(hole, x, y)?;
        self.tracer.tracer().trace(hole, &ray, Quantities::default(), path);
        let from = if ray.inverse_radius > 0.0 { 0.0 } else { FAR };
        Ok(finite(from + length.until(hole, &ray, path, mino_time)))
    }

    /// The solid angle in sr of the sky that a unit square of the view around (x, y) covers, from the differential of the
    /// lens map.
    fn footprint(
        &self,
        x: f64,
        y: f64,
        CentralScratch { beam, .. }: &mut CentralScratch,
    ) -> Result<f64, crate::Error> {
        let hole = &self.optics.hole;
        let ray = self.optics.view.beam(hole, x, y)?;
        let end = footprint::of_ray(&hole.lift(), &ray, self.optics.tolerance, beam)?;
        Ok(end.map_or(0.0, |end| finite(end.ellipse().magnification.abs())))
    }

    /// Velocity on the view, per M of the observer's time, of the image at (x, y) of the matter at `origin`.
    ///
    /// The matter that is seen at (x, y) after a Mino time τ is at X(t − delay): with the derivatives of the ray's point and
    /// its delay with respect to x, y and τ this is a linear system for the rates of the three.
    fn motion(
        &self,
        x: f64,
        y: f64,
        origin: Origin,
        CentralScratch { beam, .. }: &mut CentralScratch,
    ) -> Result<[f64; 2], crate::Error> {
        let hole = &self.optics.hole;
        let ray = self.optics.view.beam(hole, x, y)?;
        trace_series(self.optics.tolerance, &hole.lift(), &ray, Quantities::ALL, beam)?;
        let point = beam.at(Number::constant(origin.mino_time));
        let position = point.cartesian();
        let velocity = self.velocity(origin, &point);
        let along = rates(hole, &point, ray.lambda.value);
        // Without slow light all matter is seen at the time of observation, whatever the delay.
        let slow = if self.optics.slow_light { 1.0 } else { 0.0 };
        let column =
            |by: [f64; 3], delay: f64| core::array::from_fn(|k| by[k] + slow * velocity[k] * delay);
        let on_view = |k: usize| column(position.map(|x| x.slope[k]), point.delay.slope[k]);
        let columns = [on_view(0), on_view(1), column(along.0, along.1)];
        Ok(solve(columns, velocity))
    }

    /// dx/dt of the matter at a point of a source.
    fn velocity(&self, origin: Origin, point: &PathPoint<Number>) -> [f64; 3] {
        let x = point.cartesian().map(|x| x.value);
        match self.optics.numbering.kind(origin.source) {
            Kind::Disc => {
                self.disc.as_ref().map_or([0.0; 3], |disc| disc.velocity(&self.optics.hole, x))
            }
            Kind::Medium(m) => {
                let (r, u) = (point.radius().value, point.cos_theta().value);
                self.media.velocity(m, r, u, point.azimuth.value)
            }
            Kind::Spot(number) => self.spots.velocity(number, x),
            // Meshes are at rest, whatever their matter does.
            Kind::Mesh(_) | Kind::Other => [0.0; 3],
        }
    }
}

/// d(position, delay)/dτ along a ray.
fn rates(hole: &Kerr, point: &PathPoint<Number>, lambda: f64) -> ([f64; 3], f64) {
    let lambda = Number::constant(lambda);
    let [fall, polar, turn, delay] = point.rates(&hole.lift(), lambda).map(|rate| rate.value);
    let (u, azimuth) = (point.cos_theta().value, point.azimuth.value);
    let place = [point.radius().value, u, azimuth];
    (in_cartesian(place, [fall, polar, turn]), delay)
}

/// The first two unknowns of three linear equations, by Cramer's rule; 0 where there is no solution.
fn solve([a, b, c]: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 2] {
    let volume = dot(a, cross(b, c));
    [dot(right, cross(b, c)) / volume, dot(a, cross(right, c)) / volume].map(finite)
}

fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}
