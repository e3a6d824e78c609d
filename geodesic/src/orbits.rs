//! Circular orbits: where they are stable, how fast they turn, what they radiate.

use crate::kerr::Kerr;

/// Radius of the innermost stable circular orbit that turns about +z: prograde for a > 0,
/// retrograde for a < 0 (Bardeen, Press & Teukolsky 1972, eq. 2.21).
pub fn isco(hole: &Kerr) -> f64 {
    let a = hole.spin();
    let z1 = 1.0 + ((1.0 - a) * (1.0 + a)).cbrt() * ((1.0 + a).cbrt() + (1.0 - a).cbrt());
    let z2 = (3.0 * a * a + z1 * z1).sqrt();
    let root = ((3.0 - z1) * (3.0 + z1 + 2.0 * z2)).max(0.0).sqrt();
    3.0 + z2 - root.copysign(a)
}

/// Radius of the circular equatorial photon orbit that turns about +z (Bardeen, Press &
/// Teukolsky 1972, eq. 2.18); no circular orbit of matter lies inside it.
pub fn photon_orbit(hole: &Kerr) -> f64 {
    2.0 * (1.0 + ((2.0 / 3.0) * (-hole.spin()).acos()).cos())
}

/// Ω = dφ/dt = 1/(r^{3/2} + a) of the circular equatorial geodesic that turns about +z.
pub fn keplerian_angular_velocity(hole: &Kerr, r: f64) -> f64 {
    1.0 / (r * r.sqrt() + hole.spin())
}

/// E = −u_t of a circular equatorial geodesic that turns about +z at radius r outside the
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

/// x³ − 3x + 2a with x = √r, which vanishes on the photon orbit and is positive outside of
/// it, without cancellation near x = 1 for a → 1.
pub fn photon_orbit_distance(hole: &Kerr, r: f64) -> f64 {
    let x = r.sqrt();
    (x - 1.0) * (x - 1.0) * (x + 2.0) - 2.0 * (1.0 - hole.spin())
}

/// 1 − E at the innermost stable orbit: what a thin disc radiates of the mass it accretes.
pub fn binding_efficiency(hole: &Kerr) -> f64 {
    1.0 - circular_energy(hole, isco(hole))
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
    }
}
