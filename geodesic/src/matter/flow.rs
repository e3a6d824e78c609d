//! Matter on circular orbits, and the redshift factor g = ν_obs/ν_em of its light.

use crate::numbers::vector::{cross, dot};
use crate::spacetime::kerr::Kerr;
use crate::spacetime::orbits;
use crate::spacetime::point::PathPoint;

/// g = 1/(uᵗ(1 − Ωλ)) for a circular equatorial geodesic that turns about +z at radius r;
/// `None` at and inside the photon orbit, where there is none.
///
/// # Examples
/// The extremes at r = 6 around a hole without spin, seen edge-on, are 1/(√2 ∓ …):
/// ```
/// use kerrlight_geodesic::{Kerr, flow::keplerian_redshift};
/// let hole = Kerr::new(0.0).unwrap();
/// // λ of a photon emitted along the motion at r = 6: r/√(1 − 2/r).
/// let lambda = 6.0 / (2.0f64 / 3.0).sqrt();
/// assert!((keplerian_redshift(&hole, 6.0, lambda).unwrap() - 2f64.sqrt()).abs() < 1e-14);
/// ```
pub fn keplerian_redshift(hole: &Kerr, r: f64, lambda: f64) -> Option<f64> {
    let (cube, root) = orbit(hole, r)?;
    // A ray with more angular momentum does not reach this radius.
    Some(root / (cube + hole.spin() - lambda)).filter(|g| *g > 0.0)
}

/// Boyer–Lindquist components (uᵗ, uʳ, u^θ, u^φ) of a circular equatorial geodesic that turns about +z at radius r
/// (in M); `None` at and inside the photon orbit.
pub fn keplerian_velocity(hole: &Kerr, r: f64) -> Option<[f64; 4]> {
    let (cube, root) = orbit(hole, r)?;
    Some([(cube + hole.spin()) / root, 0.0, 0.0, 1.0 / root])
}

/// r^{3/2} and the root N with uᵗ = (r^{3/2} + a)/N and Ω = 1/(r^{3/2} + a).
fn orbit(hole: &Kerr, r: f64) -> Option<(f64, f64)> {
    let cube = r * r.sqrt();
    let norm = cube * orbits::photon_orbit_distance(hole, r);
    (norm > 0.0 && r > hole.horizon()).then(|| (cube, norm.sqrt()))
}

/// g of matter that moves rigidly at constant r with angular velocity vector `omega`
/// (Cartesian, radians per M of coordinate time): dn/dt = ω × n.
///
/// Returns the redshift of rotating matter. With v = ω × n, the norm of u = uᵗ(1, 0, v) is g_tt + 2g_tφ φ̇ + M|v|² −
/// a²(Σ + 2r)/Σ · v_z², M = \[(r² + a²)² − a²Δ sin²θ\]/Σ, free of coordinate poles, and k·u = −uᵗ(1 + n'·v) with n' of
/// the backward ray. `None` where such a motion is not slower than light, and outside of which no matter can be.
///
/// The point must have been traced with its azimuth.
pub fn rotating_redshift(hole: &Kerr, point: &PathPoint, omega: [f64; 3]) -> Option<f64> {
    let v = cross(omega, point.direction);
    let norm = rotation_norm(hole, point.radius(), point.direction, v);
    let energy = 1.0 + dot(point.velocity, v);
    (norm > 0.0 && energy > 0.0).then(|| norm.sqrt() / energy)
}

/// The same where the backward ray with angular momentum `lambda` is known by its position, r and
/// n, and d cos θ/dτ alone: 1 + n'·v = 1 + v_z (d cos θ/dτ)/sin²θ − λ φ̇.
pub fn rotating_redshift_at(
    hole: &Kerr,
    (r, n): (f64, [f64; 3]),
    (lambda, polar_velocity): (f64, f64),
    omega: [f64; 3],
) -> Option<f64> {
    let v = cross(omega, n);
    let norm = rotation_norm(hole, r, n, v);
    // On the axis itself v_z and the swirl vanish.
    let sin2 = (n[0] * n[0] + n[1] * n[1]).max(1e-300);
    let swirl = n[0] * v[1] - n[1] * v[0];
    let energy = 1.0 + (v[2] * polar_velocity - lambda * swirl) / sin2;
    (norm > 0.0 && energy > 0.0).then(|| norm.sqrt() / energy)
}

/// The redshift of matter that moves along the radius besides: `fall` is its dr/dt, and `momentum` has the λ (in M) of
/// the backward ray, its d cos θ/dτ and its d(1/r)/dτ.
///
/// N loses Σ/Δ (dr/dt)², and k·u gains p_r dr/dt with p_r = (d(1/r)/dτ)/(Δ/r²).
pub fn falling_redshift_at(
    hole: &Kerr,
    (r, n): (f64, [f64; 3]),
    momentum: [f64; 3],
    (omega, fall): ([f64; 3], f64),
) -> Option<f64> {
    let v = cross(omega, n);
    let norm = falling_norm(hole, r, n, (v, fall));
    let [lambda, polar, radial] = momentum;
    let sin2 = (n[0] * n[0] + n[1] * n[1]).max(1e-300);
    let swirl = n[0] * v[1] - n[1] * v[0];
    let along = radial * fall * r * r / hole.delta(r);
    let energy = 1.0 + (v[2] * polar - lambda * swirl) / sin2 - along;
    (norm > 0.0 && energy > 0.0).then(|| norm.sqrt() / energy)
}

/// [`rotation_norm`] of matter with dr/dt = `fall` besides; not above 0 at and inside the horizon.
pub fn falling_norm(hole: &Kerr, r: f64, n: [f64; 3], (v, fall): ([f64; 3], f64)) -> f64 {
    let delta = hole.delta(r);
    if delta <= 0.0 {
        return 0.0;
    }
    rotation_norm(hole, r, n, v) - hole.sigma(r, n[2]) / delta * fall * fall
}

/// (uᵗ)⁻², dimensionless, of matter at r n (r in M, n a unit vector) with dn/dt = v in M⁻¹; not above 0 where it
/// would not be slower than light.
pub fn rotation_norm(hole: &Kerr, r: f64, n: [f64; 3], v: [f64; 3]) -> f64 {
    let a = hole.spin();
    let sigma = hole.sigma(r, n[2]);
    let sin2 = n[0] * n[0] + n[1] * n[1];
    let area = ((r * r + a * a).powi(2) - a * a * hole.delta(r) * sin2) / sigma;
    // sin²θ dφ/dt
    let swirl = n[0] * v[1] - n[1] * v[0];
    1.0 - 2.0 * r / sigma * (1.0 - 2.0 * a * swirl) - area * dot(v, v)
        + a * a * (sigma + 2.0 * r) / sigma * v[2] * v[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Inclination, Observer, Path, Quantities, Tracer};

    /// Edge-on extremes at the ISCO: the photon's turning point is the emitter's radius,
    /// where λ takes its largest magnitude.
    #[test]
    fn exact_edge_on_redshift_extremes() {
        let cases = [
            (0.0, 0.471404520791, std::f64::consts::SQRT_2),
            (0.9, 0.0862931974423, 1.60220081857),
        ];
        for (a, least, most) in cases {
            let hole = Kerr::new(a).unwrap();
            let r = orbits::isco(&hole);
            // Tangential equatorial photons: λ = (±r√Δ − 2a)/(r − 2).
            let lambda = |s: f64| (s * r * hole.delta(r).sqrt() - 2.0 * a) / (r - 2.0);
            let g = |s| keplerian_redshift(&hole, r, lambda(s)).unwrap();
            assert!((g(1.0) - most).abs() < 1e-9, "{} {most}", g(1.0));
            assert!((g(-1.0) - least).abs() < 1e-9, "{} {least}", g(-1.0));
        }
    }

    /// Both formulas agree in the equatorial plane; off the poles' singularities too.
    #[test]
    fn exact_rotating_matter_agrees_with_the_keplerian_formula() {
        for a in [-0.9, 0.0, 0.5, 0.94] {
            let hole = Kerr::new(a).unwrap();
            let observer = Observer::at_infinity(Inclination::from_degrees(50.0).unwrap());
            let tracer = Tracer::new(1e-12).unwrap();
            let mut path = Path::new();
            for (alpha, beta) in [(-8.0, 3.0), (7.0, 1.0), (0.0, -9.0)] {
                let ray = observer.ray(&hole, alpha, beta).unwrap();
                tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
                let hit = path.at(path.equatorial_crossings().next().unwrap());
                let rate = orbits::keplerian_angular_velocity(&hole, hit.radius());
                let g = rotating_redshift(&hole, &hit, [0.0, 0.0, rate]).unwrap();
                let expected = keplerian_redshift(&hole, hit.radius(), ray.lambda).unwrap();
                assert!((g / expected - 1.0).abs() < 1e-9, "a = {a}: {g} {expected}");
                // About any axis, anywhere: from the components and from d cos θ/dτ.
                let omega = [0.3 * rate, -0.5 * rate, 0.6 * rate];
                for part in [0.3, 0.5, 0.7] {
                    let point = path.at(part * path.mino_total());
                    let place = (point.radius(), point.direction);
                    let motion = (ray.lambda, point.velocity[2]);
                    let g = rotating_redshift_at(&hole, place, motion, omega);
                    let expected = rotating_redshift(&hole, &point, omega);
                    match (g, expected) {
                        (Some(g), Some(expected)) => {
                            assert!((g / expected - 1.0).abs() < 1e-8, "{g} {expected}");
                        }
                        (g, expected) => assert_eq!(g, expected),
                    }
                }
            }
        }
    }

    #[test]
    fn no_matter_faster_than_light() {
        let hole = Kerr::new(0.0).unwrap();
        assert_eq!(keplerian_redshift(&hole, 3.0, 0.0), None);
        assert_eq!(keplerian_redshift(&hole, 1.0, 0.0), None);
    }
}
