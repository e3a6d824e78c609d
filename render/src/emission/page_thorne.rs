//! Flux of a thin disc in a steady state, with no torque at its inner edge, the innermost
//! stable orbit (Page & Thorne 1974, ApJ 191, 499; eq. 15n).

use kerrlight_geodesic::{Kerr, orbits};

/// The flux profile around one hole, for a disc that turns about +z.
#[derive(Debug, Clone)]
pub struct PageThorne {
    hole: Kerr,
    isco: f64,
    /// Roots of x³ − 3x + 2a and the weights of their logarithms.
    logarithms: Vec<(f64, f64)>,
}

/// Distance of |a| from 1 below which two roots merge, and their logarithms, whose weights cancel,
/// are dropped.
const EXTREMAL: f64 = 1e-14;

impl PageThorne {
    /// The profile around `hole`.
    pub fn new(hole: &Kerr) -> Self {
        let spin = hole.spin();
        let third = core::f64::consts::FRAC_PI_3;
        let angle = spin.acos() / 3.0;
        let roots = [2.0 * (angle - third).cos(), 2.0 * (angle + third).cos(), -2.0 * angle.cos()];
        let logarithms = (0..3).filter_map(|k| {
            let [x, y, z] = [roots[k], roots[(k + 1) % 3], roots[(k + 2) % 3]];
            let product = (x - y) * (x - z);
            // 3 (x − a)²/x without its removable singularity at a = 0: on the root,
            // x − a = x (x² − 1)/2.
            let weight = 0.75 * x * (x * x - 1.0).powi(2) / product;
            let merged = 1.0 - spin.abs() < EXTREMAL && (x.abs() - 1.0).abs() < 1e-6;
            (!merged).then_some((x, weight))
        });
        PageThorne { hole: *hole, isco: orbits::isco(hole), logarithms: logarithms.collect() }
    }

    /// Energy radiated per unit time and area by one face at radius r, in units G = c = M =
    /// Ṁ = 1; 0 inside the innermost stable orbit.
    pub fn flux(&self, r: f64) -> f64 {
        if r <= self.isco {
            return 0.0;
        }
        let (x, x0, a) = (r.sqrt(), self.isco.sqrt(), self.hole.spin());
        let mut bracket = (x - x0) - 1.5 * a * (x / x0).ln();
        for (root, weight) in &self.logarithms {
            bracket -= weight * ((x - root) / (x0 - root)).ln();
        }
        let distance = orbits::photon_orbit_distance(&self.hole, r);
        let flux = 3.0 * bracket / (r * r * distance);
        // Next to the inner edge the bracket is a difference of equals.
        flux.max(0.0) / (8.0 * core::f64::consts::PI)
    }

    /// Radius and value of the largest flux, by golden-section search.
    pub fn peak(&self) -> (f64, f64) {
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        // For every spin the peak lies between 1 and 2 times this radius.
        let (mut lo, mut hi) = (self.isco, 4.0 * self.isco);
        // 0.618⁸⁰ is less than the rounding of a radius.
        for _ in 0..80 {
            let (p, q) = (hi - golden * (hi - lo), lo + golden * (hi - lo));
            if self.flux(p) > self.flux(q) { hi = q } else { lo = p }
        }
        let r = 0.5 * (lo + hi);
        (r, self.flux(r))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(spin: f64) -> PageThorne {
        PageThorne::new(&Kerr::new(spin).unwrap())
    }

    /// A steady disc radiates the binding energy of its inner edge: ∫ 2F E 2πr dr over all
    /// radii, with E = −u_t for what reaches infinity, is 1 − E(isco).
    #[test]
    fn exact_luminosity_is_the_binding_energy() {
        for a in [-1.0, -0.7, 0.0, 1e-8, 0.5, 0.998, 1.0 - 1e-9, 1.0] {
            let hole = Kerr::new(a).unwrap();
            let disc = PageThorne::new(&hole);
            let isco = orbits::isco(&hole);
            // r = isco/s²: smooth integrand on (0, 1].
            let (n, rule) = (4000_i32, kerrlight_geodesic::quadrature::gauss_legendre(4));
            let step = 1.0 / f64::from(n);
            let total: f64 = (0..n)
                .flat_map(|k| rule.iter().map(move |(s, w)| ((f64::from(k) + s) * step, w * step)))
                .map(|(s, weight)| {
                    let r = isco / (s * s);
                    let jacobian = 2.0 * isco / (s * s * s);
                    let energy = orbits::circular_energy(&hole, r);
                    weight * jacobian * 4.0 * core::f64::consts::PI * r * energy * disc.flux(r)
                })
                .sum();
            let expected = orbits::binding_efficiency(&hole);
            assert!((total / expected - 1.0).abs() < 1e-6, "a = {a}: {total} {expected}");
        }
    }

    #[test]
    fn exact_zero_at_and_inside_the_inner_edge() {
        assert_eq!(profile(0.0).flux(6.0), 0.0);
        assert_eq!(profile(0.0).flux(3.0), 0.0);
    }
}
