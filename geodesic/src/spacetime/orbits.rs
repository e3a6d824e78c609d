//! Circular orbits: where they are stable, how fast they turn, what they radiate.

use crate::numbers::scalar::Elementary;
use crate::spacetime::kerr::Kerr;

/// Radius in M of the innermost stable circular orbit that turns about +z: prograde for a > 0,
/// retrograde for a < 0 (Bardeen, Press & Teukolsky 1972, eq. 2.21).
pub fn isco(hole: &Kerr) -> f64 {
    isco_of(hole.spin())
}

/// The same for any kind of number. The derivative is that of the root of r² − 6r + 8a√r − 3a²; it diverges for
/// |a| → 1, where the orbit about +z meets the horizon.
pub fn stable_orbit<T: Elementary>(hole: &Kerr<T>) -> T {
    let (a, r) = (hole.spin(), isco_of(hole.spin().value()));
    let slope = 2.0 * r - 6.0 + 4.0 * a.value() / r.sqrt();
    if slope == 0.0 {
        return T::constant(r);
    }
    let root = a * T::constant(8.0 * r.sqrt()) - a * a * T::constant(3.0);
    T::constant(r) - (root - T::constant(root.value())) / T::constant(slope)
}

fn isco_of(a: f64) -> f64 {
    let (p, q) = ((1.0 + a).cbrt(), (1.0 - a).cbrt());
    let z1 = 1.0 + p * q * (p + q);
    let z2 = (3.0 * a * a + z1 * z1).sqrt();
    // 3 − z₁ = (p + q)(p − q)², which does not cancel for a → 0.
    let difference = 2.0 * a / (p * p + p * q + q * q);
    3.0 + z2 - difference * ((p + q) * (3.0 + z1 + 2.0 * z2)).sqrt()
}

/// Radius in M of the circular equatorial photon orbit that turns about +z (Bardeen, Press &
/// Teukolsky 1972, eq. 2.18); no circular orbit of matter lies inside it.
pub fn photon_orbit(hole: &Kerr) -> f64 {
    let (a, root) = (hole.spin(), 0.5 * hole.horizon_gap());
    1.0 + if a < 0.0 { equatorial_retrograde(root, -a) } else { equatorial_prograde(root, a) }
}

/// Radius in M of the circular equatorial photon orbit that turns against +z.
pub fn counter_rotating_photon_orbit(hole: &Kerr) -> f64 {
    let (a, root) = (hole.spin(), 0.5 * hole.horizon_gap());
    1.0 + if a < 0.0 { equatorial_prograde(root, -a) } else { equatorial_retrograde(root, a) }
}

/// Radius of the photon orbit over the poles, λ = 0: the root of r³ − 3r² + a²r + a² outside
/// the horizon (Teo 2003, Gen. Relativ. Gravit. 35, 1909).
pub fn polar_photon_orbit(hole: &Kerr) -> f64 {
    let a2 = hole.spin() * hole.spin();
    let size = 1.0 - a2 / 3.0;
    let root2 = 0.25 * hole.horizon_gap() * hole.horizon_gap();
    // The angle's cosine is (1 − a²)/size^{3/2}; its sine follows from a² (1 − a²/9 + …).
    let sine2 = (size * size * size - root2 * root2).max(0.0);
    let angle = sine2.sqrt().atan2(root2);
    1.0 + 2.0 * size.sqrt() * (angle / 3.0).cos()
}

/// Ω = dφ/dt = 1/(r^{3/2} + a), radians per M, of the circular equatorial geodesic that turns about +z.
pub fn keplerian_angular_velocity(hole: &Kerr, r: f64) -> f64 {
    1.0 / (r * r.sqrt() + hole.spin())
}

/// Energy per rest mass E = −u_t of a circular equatorial geodesic that turns about +z at radius r (M) outside the
/// photon orbit (Bardeen, Press & Teukolsky 1972, eq. 2.12).
pub fn circular_energy(hole: &Kerr, r: f64) -> f64 {
    let (a, x) = (hole.spin(), r.sqrt());
    if a == 1.0 {
        // Both factors below share x − 1.
        return (x * x + x - 1.0) / (x.powf(1.5) * (x + 2.0).sqrt());
    }
    let numerator = (x - 1.0) * (x * x + x - 1.0) - (1.0 - a);
    numerator / (x.powf(1.5) * photon_orbit_distance(hole, r).sqrt())
}

/// L = u_φ of a circular equatorial geodesic that turns about +z at radius r outside the
/// photon orbit (Bardeen, Press & Teukolsky 1972, eq. 2.13), in M.
pub fn circular_angular_momentum(hole: &Kerr, r: f64) -> f64 {
    let (a, x) = (hole.spin(), r.sqrt());
    if a == 1.0 {
        // Both factors below share x − 1.
        return (x * x * x + x * x + x - 1.0) / (x.powf(1.5) * (x + 2.0).sqrt());
    }
    (r * r - 2.0 * a * x + a * a) / (x.powf(1.5) * photon_orbit_distance(hole, r).sqrt())
}

/// x³ − 3x + 2a with x = √r (r in M), which vanishes on the photon orbit and is positive outside of
/// it, without cancellation near x = 1 for a → 1.
pub fn photon_orbit_distance(hole: &Kerr, r: f64) -> f64 {
    let x = r.sqrt();
    (x - 1.0) * (x - 1.0) * (x + 2.0) - 2.0 * (1.0 - hole.spin())
}

/// 1 − E at the innermost stable orbit, dimensionless: the share of the accreted mass that a thin disc radiates.
pub fn binding_efficiency(hole: &Kerr) -> f64 {
    1.0 - circular_energy(hole, isco(hole))
}

/// r − 1 of the prograde circular photon orbit, from √(1 − a²) and |a|: accurate for
/// |a| → 1 (Bardeen, Press & Teukolsky 1972, eq. 2.18, rewritten).
pub(crate) fn equatorial_prograde(root: f64, spin: f64) -> f64 {
    let t = 2.0 / 3.0 * root.atan2(spin);
    2.0 * (0.5 * t).sin().powi(2) + 2.0 * core::f64::consts::FRAC_PI_3.sin() * t.sin()
}

/// r − 1 of the retrograde circular photon orbit, likewise.
pub(crate) fn equatorial_retrograde(root: f64, spin: f64) -> f64 {
    1.0 + 2.0 * (2.0 / 3.0 * root.atan2(spin)).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(x: f64, y: f64, tolerance: f64) {
        assert!((x - y).abs() < tolerance, "{x} is not {y}");
    }

    /// Values of Bardeen, Press & Teukolsky's formulas at ten digits.
    #[test]
    fn paper_innermost_stable_orbits() {
        let cases = [
            (0.0, 6.0, 6.0),
            (0.5, 4.2330025295, 7.5545847145),
            (0.9, 2.3208830418, 8.7173522797),
            (0.998, 1.2369706552, 8.9943744548),
            (1.0, 1.0, 9.0),
        ];
        for (a, prograde, retrograde) in cases {
            close(isco(&Kerr::new(a).unwrap()), prograde, 2e-10);
            close(isco(&Kerr::new(-a).unwrap()), retrograde, 2e-10);
        }
    }

    /// r = 6 − 4√(2/3) a + O(a²) for a → 0.
    #[test]
    fn exact_innermost_stable_orbit_of_slow_holes() {
        for a in [-1e-7, -1e-12, 1e-15, 1e-9] {
            let expected = 6.0 - 4.0 * (2.0f64 / 3.0).sqrt() * a;
            close(isco(&Kerr::new(a).unwrap()), expected, 2e-15 + a * a);
        }
    }

    #[test]
    fn paper_binding_efficiency() {
        close(binding_efficiency(&Kerr::new(0.0).unwrap()), 1.0 - (8.0f64 / 9.0).sqrt(), 1e-15);
        close(binding_efficiency(&Kerr::new(0.998).unwrap()), 0.3209941656, 1e-10);
    }

    #[test]
    fn paper_photon_orbits() {
        close(photon_orbit(&Kerr::new(0.0).unwrap()), 3.0, 1e-14);
        close(photon_orbit(&Kerr::new(0.94).unwrap()), 1.4252442687, 1e-10);
        close(photon_orbit(&Kerr::new(-0.94).unwrap()), 3.9463660775, 1e-10);
        close(counter_rotating_photon_orbit(&Kerr::new(0.94).unwrap()), 3.9463660775, 1e-10);
        close(polar_photon_orbit(&Kerr::new(0.94).unwrap()), 2.5069454821737, 1e-13);
        close(polar_photon_orbit(&Kerr::new(0.0).unwrap()), 3.0, 1e-15);
        close(polar_photon_orbit(&Kerr::new(-1.0).unwrap()), 1.0 + 2f64.sqrt(), 1e-15);
    }

    /// r(r − 3)² = 4a² on the equatorial orbits, r³ − 3r² + a²r + a² = 0 on the polar one.
    #[test]
    fn exact_equations_of_the_photon_orbits() {
        for a in [1e-9, 0.1, 0.5, 0.9, 0.999, 1.0 - 1e-12, 1.0] {
            let hole = Kerr::new(a).unwrap();
            for r in [photon_orbit(&hole), counter_rotating_photon_orbit(&hole)] {
                close(r * (r - 3.0) * (r - 3.0), 4.0 * a * a, 1e-14);
            }
            let r = polar_photon_orbit(&hole);
            close(r * r * (r - 3.0) + a * a * (r + 1.0), 0.0, 2e-14);
        }
        // r − 1 = √(8(1 − a)/3) for a → 1.
        let hole = Kerr::new(1.0 - 1e-14).unwrap();
        let expected = ((8.0 / 3.0) * (1.0 - hole.spin())).sqrt();
        close((photon_orbit(&hole) - 1.0) / expected, 1.0, 1e-7);
    }

    /// L² and E² of a hole without spin; 2/√3 at the horizon of an extremal one.
    #[test]
    fn exact_angular_momentum() {
        let hole = Kerr::new(0.0).unwrap();
        close(circular_angular_momentum(&hole, 6.0), 12f64.sqrt(), 1e-14);
        close(circular_angular_momentum(&hole, 10.0), 10.0 / 7f64.sqrt(), 1e-14);
        let hole = Kerr::new(1.0).unwrap();
        close(circular_angular_momentum(&hole, 1.0), 2.0 / 3f64.sqrt(), 1e-15);
    }
}
