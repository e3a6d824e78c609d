//! Matter that falls in from the innermost stable circular orbit (Cunningham 1975, ApJ 202,
//! 788): it keeps the energy and angular momentum it had there.

use crate::spacetime::kerr::Kerr;
use crate::spacetime::orbits;

/// The flow in the equatorial plane between the innermost stable orbit and the horizon, of
/// matter that turned about +z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plunge {
    hole: Kerr,
    isco: f64,
    energy: f64,
    angular_momentum: f64,
}

impl Plunge {
    /// The plunging flow of a hole.
    pub fn new(hole: &Kerr) -> Self {
        let isco = orbits::isco(hole);
        // At the innermost stable orbit E² = 1 − 2/(3r) and L = 2[1 + 2√(3r − 2)]/√27.
        let energy = (1.0 - 2.0 / (3.0 * isco)).sqrt();
        let angular_momentum = 2.0 * (1.0 + 2.0 * (3.0 * isco - 2.0).sqrt()) / 27f64.sqrt();
        Plunge { hole: *hole, isco, energy, angular_momentum }
    }

    /// E = −u_t, per rest mass.
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// L = u_φ, per rest mass, in M.
    pub fn angular_momentum(&self) -> f64 {
        self.angular_momentum
    }

    /// Returns the radius where the flow starts: the innermost stable orbit, in M.
    pub fn isco(&self) -> f64 {
        self.isco
    }

    /// uʳ = −√(2/(3 r_isco)) (r_isco/r − 1)^{3/2}, dimensionless, for r (M) up to the innermost stable orbit.
    pub fn radial_velocity(&self, r: f64) -> f64 {
        -(2.0 / (3.0 * self.isco)).sqrt() * (self.isco / r - 1.0).max(0.0).powf(1.5)
    }

    /// Boyer–Lindquist components (uᵗ, uʳ, u^θ, u^φ) at radius r (in M); `None` outside of
    /// the innermost stable orbit and at or inside of the horizon, where uᵗ is not finite.
    pub fn velocity(&self, r: f64) -> Option<[f64; 4]> {
        let (a, r2) = (self.hole.spin(), r * r);
        let delta = self.hole.delta(r);
        if !self.reaches(r) || delta <= 0.0 {
            return None;
        }
        let (forward, rest) = (self.momentum(r) / delta, self.rest());
        let time = ((r2 + a * a) * forward + a * rest) / r2;
        Some([time, self.radial_velocity(r), 0.0, (a * forward + rest) / r2])
    }

    /// g = ν_obs/ν_em of light with λ = L/E (in M) and η = Q/E² (in M²) that leaves the flow
    /// at radius r (in M), `outward` or inward: where a backward ray still falls inward, its
    /// light moves outward. `None` where [`velocity`](Self::velocity) is, and where no such
    /// light can be.
    pub fn redshift(&self, r: f64, lambda: f64, eta: f64, outward: bool) -> Option<f64> {
        let (a, r2) = (self.hole.spin(), r * r);
        let delta = self.hole.delta(r);
        let photon = r2 + a * a - a * lambda;
        let carter = eta + (lambda - a) * (lambda - a);
        let photon_radial = photon * photon - delta * carter;
        if !self.reaches(r) || delta <= 0.0 || photon_radial < 0.0 {
            return None;
        }
        let (matter, rest) = (self.momentum(r), self.rest());
        let roots = photon_radial.sqrt() * r2 * self.radial_velocity(r).abs();
        // (P P' ± √R √R')/Δ; with the lower sign, rationalised: finite at the horizon.
        let sum = matter * photon + roots;
        let radial = if outward {
            sum / delta
        } else {
            let mass = r2 + rest * rest;
            (carter * matter * matter + mass * (photon * photon - delta * carter)) / sum
        };
        let energy = (radial - rest * (lambda - a)) / r2;
        (energy > 0.0).then(|| 1.0 / energy)
    }

    fn reaches(&self, r: f64) -> bool {
        r > self.hole.horizon() && r <= self.isco
    }

    /// E(r² + a²) − aL.
    fn momentum(&self, r: f64) -> f64 {
        let a = self.hole.spin();
        self.energy * (r * r + a * a) - a * self.angular_momentum
    }

    /// L − aE.
    fn rest(&self) -> f64 {
        self.angular_momentum - self.hole.spin() * self.energy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::flow::keplerian_redshift;

    const SPINS: [f64; 7] = [-1.0, -0.6, 0.0, 1e-9, 0.5, 0.94, 0.998];

    /// g_μν u^μ u^ν = −1 in the equatorial plane, and E and L from the components.
    #[test]
    fn exact_norm_energy_and_angular_momentum() {
        for a in SPINS {
            let hole = Kerr::new(a).unwrap();
            let flow = Plunge::new(&hole);
            for fraction in [0.01, 0.3, 0.8, 1.0] {
                let r = hole.horizon() + fraction * (flow.isco() - hole.horizon());
                let [ut, ur, _, up] = flow.velocity(r).unwrap();
                let (gtt, gtp, gpp) =
                    (-1.0 + 2.0 / r, -2.0 * a / r, r * r + a * a + 2.0 * a * a / r);
                let grr = r * r / hole.delta(r);
                let terms = [gtt * ut * ut, 2.0 * gtp * ut * up, gpp * up * up, grr * ur * ur];
                let size: f64 = terms.iter().map(|x| x.abs()).sum();
                let norm: f64 = terms.iter().sum();
                assert!((norm + 1.0).abs() < 1e-13 * size, "a = {a}, r = {r}: {norm}");
                let energy = -(gtt * ut + gtp * up);
                assert!((energy - flow.energy()).abs() < 1e-13 * size, "{energy}");
                let momentum = gtp * ut + gpp * up;
                assert!((momentum - flow.angular_momentum()).abs() < 1e-13 * size);
            }
        }
    }

    #[test]
    fn exact_start_on_the_innermost_stable_orbit() {
        for a in SPINS {
            let hole = Kerr::new(a).unwrap();
            let flow = Plunge::new(&hole);
            let r = flow.isco();
            let miss = flow.energy() - orbits::circular_energy(&hole, r);
            assert!(miss.abs() < 1e-12, "a = {a}: {miss:e}");
            let miss = flow.angular_momentum() - orbits::circular_angular_momentum(&hole, r);
            assert!(miss.abs() < 1e-11, "a = {a}: {miss:e}");
            let g = flow.redshift(r, 0.7, 3.0, true).unwrap();
            let expected = keplerian_redshift(&hole, r, 0.7).unwrap();
            assert!((g / expected - 1.0).abs() < 1e-11, "a = {a}: {g} {expected}");
        }
    }

    /// 1/g = uᵗ − λ u^φ − k_r uʳ with k_r = ±√R/Δ, term by term.
    #[test]
    fn exact_redshift_from_the_components() {
        for a in [-0.9, 0.0, 0.7] {
            let hole = Kerr::new(a).unwrap();
            let flow = Plunge::new(&hole);
            let r = 0.5 * (hole.horizon() + flow.isco());
            let (lambda, eta) = (-1.2, 4.0);
            let [ut, ur, _, up] = flow.velocity(r).unwrap();
            let delta = hole.delta(r);
            let p = r * r + a * a - a * lambda;
            let kr = (p * p - delta * (eta + (lambda - a).powi(2))).sqrt() / delta;
            for (outward, sign) in [(true, 1.0), (false, -1.0)] {
                let expected = 1.0 / (ut - lambda * up - sign * kr * ur);
                let g = flow.redshift(r, lambda, eta, outward).unwrap();
                assert!((g / expected - 1.0).abs() < 1e-12, "a = {a}: {g} {expected}");
            }
        }
    }

    #[test]
    fn no_plunge_elsewhere() {
        let hole = Kerr::new(0.5).unwrap();
        let flow = Plunge::new(&hole);
        assert_eq!(flow.velocity(flow.isco() * 1.01), None);
        assert_eq!(flow.velocity(hole.horizon()), None);
        assert_eq!(flow.redshift(f64::NAN, 0.0, 0.0, true), None);
        // Light with λ = 50 never gets that close.
        assert_eq!(flow.redshift(3.0, 50.0, 0.0, true), None);
    }
}
