//! Path length: how far along a ray a point is.

use super::length::{Length, NODES};
use crate::integrate::path::Path;
use crate::numbers::quadrature::gauss_legendre;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;

/// Lengths ∫Σ dτ along rays: the affine parameter for unit energy at infinity, which far from the hole is the Euclidean
/// length.
#[derive(Debug, Clone)]
pub struct PathLength {
    rule: Vec<(f64, f64)>,
}

impl Default for PathLength {
    fn default() -> Self {
        PathLength { rule: gauss_legendre(NODES) }
    }
}

/// The part of W = ẇ² at infinity down to which the far part of a ray is integrated over w.
const FAR: f64 = 0.3;

/// Inverse radius, M⁻¹, that no photon orbits at: they have radii of 4 M at most.
const OUTSIDE: f64 = 0.2;

impl PathLength {
    /// Length in M from the observer to the point at Mino time `mino_time` (M⁻¹) of the path of `ray`. For an observer at
    /// infinity it is the limit of the length less the observer's distance from the plane through the hole across the line
    /// of sight, without gravity −s for a point s in front of that plane.
    ///
    /// # Examples
    /// ```
    /// use kerrlight_geodesic::{Inclination, Kerr, Observer, Path, PathLength, Quantities, Tracer};
    /// let (hole, observer) = (Kerr::new(0.0)?, Observer::at_infinity(Inclination::from_degrees(30.0)?));
    /// let (ray, mut path) = (observer.ray(&hole, 300.0, 0.0)?, Path::new());
    /// Tracer::new(1e-12)?.trace(&hole, &ray, Quantities::default(), &mut path);
    /// // Far from the hole rays are straight but for about 1 M: at the closest approach the plane is reached.
    /// let (time, _) = path.turning_point().unwrap();
    /// let length = PathLength::default().until(&hole, &ray, &path, time);
    /// assert!(length.abs() < 1.1);
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    pub fn until(&self, hole: &Kerr, ray: &Ray, path: &Path, mino_time: f64) -> f64 {
        let density = |time: f64| {
            let point = path.at(time);
            hole.sigma(point.radius(), point.cos_theta())
        };
        let (start, far) = match ray.inverse_radius > 0.0 {
            true => (0.0, 0.0),
            false => self.far_part(hole, ray, path, mino_time),
        };
        if start >= mino_time {
            return far;
        }
        far + Length::new([start, mino_time], &self.rule, density).total()
    }

    /// A Mino time on the way in, `mino_time` at most, and the length up to there: −1/w + ∫(1/√W − 1)/w² dw + ∫a²cos²θ dτ.
    fn far_part(&self, hole: &Kerr, ray: &Ray, path: &Path, mino_time: f64) -> (f64, f64) {
        let turning = path.turning_point().map_or(f64::INFINITY, |(time, _)| time);
        let mut time = mino_time.min(turning);
        // Behind the photon orbits W rises again: the far part ends before them.
        let is_near = |w: f64| w > OUTSIDE || ray.potential.value(w) < FAR;
        while is_near(path.at(time).inverse_radius) {
            time *= 0.5;
        }
        let w = path.at(time).inverse_radius;
        let excess = |x: f64| {
            let root = ray.potential.value(x).max(0.0).sqrt();
            // (1/√W − 1)/w² without cancellation.
            (1.0 - ray.potential.value(x)) / (x * x * root * (1.0 + root))
        };
        let radial = self.rule.iter().map(|(node, weight)| weight * w * excess(w * node));
        let polar = |time: f64| (hole.spin() * path.at(time).cos_theta()).powi(2);
        let polar = self.rule.iter().map(|(node, weight)| weight * time * polar(time * node));
        (time, radial.sum::<f64>() + polar.sum::<f64>() - 1.0 / w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Inclination, Observer, Quantities, Tracer};

    /// Lengths between two times of captured rays beside the critical curve, √27 M, are integrals of Σ = r².
    #[test]
    fn exact_lengths_of_captured_rays_beside_the_critical_curve() {
        let hole = Kerr::new(0.0).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(60.0).unwrap());
        for distance in [0.3, 1e-3, 1e-6] {
            let ray = observer.ray(&hole, 27f64.sqrt() * (1.0 - distance), 0.0).unwrap();
            let mut path = Path::new();
            Tracer::new(1e-12).unwrap().trace(&hole, &ray, Quantities::default(), &mut path);
            let (first, last) = (0.02, 0.98 * path.mino_total());
            let count = 200_000;
            let step = (last - first) / f64::from(count);
            let square = |k: i32| path.at(first + step * (f64::from(k) + 0.5)).radius().powi(2);
            let expected = step * (0..count).map(square).sum::<f64>();
            let length = |time: f64| PathLength::default().until(&hole, &ray, &path, time);
            let found = length(last) - length(first);
            assert!((found / expected - 1.0).abs() < 1e-6, "{distance} {found} {expected}");
        }
    }
}
