//! Matter that turns more slowly than on circular geodesics and falls in: the family of flows of Cárdenas-Avendaño,
//! Lupsasca & Zhu 2023 (Phys. Rev. D 107, 043030, appendix B; after Pu, Akiyama & Asada 2016).
//!
//! Three numbers in \[0, 1\] say how: ξ, β_r and β_φ. The circular part (index c) has the specific angular momentum
//! ℓ = L/E = ξ ℓ_K, with ℓ_K that of the circular geodesic. Outside the innermost stable circular orbit of the hole it
//! turns with uʳ_c = 0; inside it plunges with the energy and angular momentum that it has there. Free fall from rest
//! at infinity (E = 1, L = 0) has uʳ_ff = −√(2r(r² + a²))/r² and Ω_ff = 2ar/Π, Π = (r² + a²)² − a²Δ. What is mixed are
//! uʳ and Ω = u^φ/uᵗ:
//!
//! ```text
//! uʳ = uʳ_c + (1 − β_r)(uʳ_ff − uʳ_c)      Ω = Ω_c + (1 − β_φ)(Ω_ff − Ω_c)
//! ```
//!
//! and uᵗ follows from u·u = −1. ξ = β_r = β_φ = 1 is a disc of circular geodesics with
//! [`Plunge`](crate::plunge::Plunge) inside, β_r = β_φ = 0 free fall.
//!
//! With P = Π/r², Ω_c − Ω_ff = ℓΔ/\[P(P − 2aℓ/r)\]; no difference of nearly equal numbers is left at the horizon.

use crate::error::{Error, check};
use crate::numbers::scalar::Elementary;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::orbits;

/// Mixture of circular motion and free fall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixture<T = f64> {
    /// ξ: specific angular momentum over that of circular geodesics; 1, Keplerian.
    pub xi: T,
    /// β_r: 1, the radial velocity of the circular part; 0, that of free fall.
    pub beta_r: T,
    /// β_φ: 1, the angular velocity of the circular part; 0, that of free fall.
    pub beta_phi: T,
}

/// A flow of the family in the equatorial plane of a hole, about +z: retrograde for a < 0. `T` is `f64` or a number
/// with derivatives.
///
/// ```
/// use kerrlight_geodesic::{Kerr, infall::{Infall, Mixture}};
/// let flow = Infall::new(&Kerr::new(0.0)?, Mixture { xi: 0.5, beta_r: 0.0, beta_phi: 0.0 })?;
/// // Free fall from rest at infinity: dr/dt = −(1 − 2/r)√(2/r).
/// assert!((flow.rates(8.0)[0] + 0.75 * 0.5).abs() < 1e-15);
/// # Ok::<(), kerrlight_geodesic::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Infall<T = f64> {
    hole: Kerr<T>,
    mixture: Mixture<T>,
    isco: T,
    /// ℓ of the plunge, and (uʳ)² in powers of 1/r − 1/r_isco, from the first on.
    plunge: (T, [T; 3]),
}

impl<T: Elementary> Infall<T> {
    /// The flow about a hole.
    ///
    /// # Errors
    /// If ξ, β_r or β_φ is not in \[0, 1\].
    pub fn new(hole: &Kerr<T>, mixture: Mixture<T>) -> Result<Self, Error> {
        let Mixture { xi, beta_r, beta_phi } = mixture;
        for (field, number) in [("xi", xi), ("beta_r", beta_r), ("beta_phi", beta_phi)] {
            let value = number.value();
            check(field, value, (0.0..=1.0).contains(&value), "a number in [0, 1]")?;
        }
        let isco = orbits::stable_orbit(hole);
        let momentum = xi * keplerian_momentum(hole, isco);
        let plunge = (momentum, plunge_powers(hole, isco, momentum, xi.value() == 1.0));
        Ok(Infall { hole: *hole, mixture, isco, plunge })
    }

    /// Returns the radius where the circular part begins to plunge: the innermost stable circular orbit, in M.
    pub fn isco(&self) -> T {
        self.isco
    }

    /// The hole.
    pub fn hole(&self) -> Kerr<T> {
        self.hole
    }

    /// dr/dt (dimensionless) and Ω = dφ/dt (radians per M) at radius r (in M) outside the horizon.
    pub fn rates(&self, r: T) -> [T; 2] {
        let [_, fall, turn] = self.motion(r);
        [fall, turn]
    }

    /// The same at r = r_isco − s² (s above 0, in √M), with all digits next to the innermost stable orbit, where rates
    /// have no derivatives with respect to r.
    pub fn rates_below(&self, s: T) -> [T; 2] {
        let r = self.isco - s * s;
        let [_, fall, turn] = self.mixed(r, self.plunge.0, self.plunging(r, s * s));
        [fall, turn]
    }

    /// uᵗ, dr/dt and dφ/dt.
    fn motion(&self, r: T) -> [T; 3] {
        if r.value() < self.isco.value() {
            return self.mixed(r, self.plunge.0, self.plunging(r, self.isco - r));
        }
        let momentum = self.mixture.xi * keplerian_momentum(&self.hole, r);
        self.mixed(r, momentum, T::constant(0.0))
    }

    /// uʳ of the plunge at r = r_isco − depth.
    fn plunging(&self, r: T, depth: T) -> T {
        let [first, second, third] = self.plunge.1;
        let rise = depth / (r * self.isco);
        let square = rise * (first + rise * (second + rise * third));
        // Rounding next to the innermost stable orbit.
        if square.value() > 0.0 { -square.sqrt() } else { T::constant(0.0) }
    }

    /// The same for a circular part with this ℓ and uʳ.
    fn mixed(&self, r: T, momentum: T, circular: T) -> [T; 3] {
        let (a, s, one) = (self.hole.spin(), T::constant, T::constant(1.0));
        let Mixture { beta_r, beta_phi, .. } = self.mixture;
        let (delta, area) = (self.hole.delta(r), area(&self.hole, r));
        let free = -(s(2.0) * (r * r + a * a) / r).sqrt() / r;
        let radial = beta_r * circular + (one - beta_r) * free;
        let lag = beta_phi * momentum / (area - s(2.0) * a * momentum / r);
        let turn = s(2.0) * a / (r * area) + lag * delta / area;
        let gamma = (one - lag * lag * delta).sqrt();
        let time = (area * (delta + radial * radial * r * r)).sqrt() / (gamma * delta);
        [time, radial / time, turn]
    }
}

impl Infall {
    /// Boyer–Lindquist components (uᵗ, uʳ, u^θ, u^φ) at radius r (in M) in the equatorial plane; `None` at and inside the
    /// horizon, where uᵗ is not finite.
    pub fn velocity(&self, r: f64) -> Option<[f64; 4]> {
        let outside = r > self.hole.horizon() && r.is_finite();
        let [time, fall, turn] = if outside { self.motion(r) } else { return None };
        time.is_finite().then_some([time, time * fall, 0.0, time * turn])
    }

    /// g = ν_obs/ν_em of light with λ = L/E (in M) and η = Q/E² (in M²) that leaves the flow in the equatorial plane at
    /// radius r (in M), `outward` or inward: where a backward ray still falls inward, its light moves outward. `None`
    /// where [`velocity`](Self::velocity) is, and where no such light can be.
    pub fn redshift(&self, r: f64, lambda: f64, eta: f64, outward: bool) -> Option<f64> {
        let [time, radial, _, around] = self.velocity(r)?;
        let a = self.hole.spin();
        let (delta, photon) = (self.hole.delta(r), r * r + a * a - a * lambda);
        let square = photon * photon - delta * (eta + (lambda - a) * (lambda - a));
        let momentum = if outward { square.sqrt() } else { -square.sqrt() } / delta;
        let energy = time - lambda * around - momentum * radial;
        (square >= 0.0 && energy > 0.0).then(|| 1.0 / energy)
    }
}

/// P = Π/r² = r² + a² + 2a²/r.
fn area<T: Elementary>(hole: &Kerr<T>, r: T) -> T {
    let a2 = hole.spin() * hole.spin();
    r * r + a2 + T::constant(2.0) * a2 / r
}

/// ℓ_K = L/E of the circular geodesic that turns about +z at radius r.
fn keplerian_momentum<T: Elementary>(hole: &Kerr<T>, r: T) -> T {
    let (a, root, two) = (hole.spin(), r.sqrt(), T::constant(2.0));
    (r * r + a * a - two * a * root) / (root * (r - two) + a)
}

/// (uʳ)² of matter that starts at rest at the innermost stable orbit with specific angular momentum ℓ: coefficients of
/// the first three powers of 1/r − 1/r_isco. It is cubic in w = 1/r,
/// E² − 1 + 2w − [L² − a²(E² − 1)] w² + 2(L − aE)² w³.
fn plunge_powers<T: Elementary>(hole: &Kerr<T>, isco: T, momentum: T, keplerian: bool) -> [T; 3] {
    let (a, s, one) = (hole.spin(), T::constant, T::constant(1.0));
    let rest = area(hole, isco) - s(4.0) * a * momentum / isco;
    let energy2 = hole.delta(isco) / (rest - (one - s(2.0) / isco) * momentum * momentum);
    let square = energy2 * momentum * momentum - a * a * (energy2 - one);
    let twice = s(2.0) * energy2 * (momentum - a) * (momentum - a);
    let first = s(2.0) - s(2.0) * square / isco + s(3.0) * twice / (isco * isco);
    let second = s(3.0) * twice / isco - square;
    // On the circular geodesic itself both vanish; their derivatives do not.
    let exact = |x: T| if keplerian { x - s(x.value()) } else { x };
    [exact(first), exact(second), twice]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::flow::{falling_redshift_at, keplerian_redshift};
    use crate::matter::plunge::Plunge;
    use crate::numbers::dual::Dual;
    use crate::numbers::scalar::Scalar;
    use crate::{Inclination, Observer, Path, Quantities, Tracer};

    const SPINS: [f64; 6] = [-0.998, -0.5, 0.0, 0.2, 0.9, 0.998];

    fn flow(a: f64, [xi, beta_r, beta_phi]: [f64; 3]) -> Infall {
        Infall::new(&Kerr::new(a).unwrap(), Mixture { xi, beta_r, beta_phi }).unwrap()
    }

    /// Radii from next to the horizon to far out, on both sides of the innermost stable orbit.
    fn radii(flow: &Infall) -> Vec<f64> {
        let (inner, isco) = (flow.hole.horizon(), flow.isco);
        let inside = [1e-6, 0.01, 0.3, 0.8, 0.999_999].map(|f| inner + f * (isco - inner));
        let outside = [1.0, 1.000_001, 1.1, 2.0, 30.0].map(|f| f * isco);
        inside.into_iter().chain(outside).collect()
    }

    /// Components of the metric: tt, tφ, φφ and rr.
    fn metric(a: f64, r: f64) -> [f64; 4] {
        let delta = r * r - 2.0 * r + a * a;
        [-1.0 + 2.0 / r, -2.0 * a / r, r * r + a * a + 2.0 * a * a / r, r * r / delta]
    }

    #[test]
    fn exact_norm_of_the_velocity() {
        for a in SPINS {
            for mixture in [[1.0; 3], [0.7, 0.9, 0.9], [0.3, 0.0, 1.0], [0.0, 1.0, 0.2], [0.5; 3]] {
                let flow = flow(a, mixture);
                for r in radii(&flow) {
                    let [ut, ur, _, up] = flow.velocity(r).unwrap();
                    let [tt, tp, pp, rr] = metric(a, r);
                    let terms = [tt * ut * ut, 2.0 * tp * ut * up, pp * up * up, rr * ur * ur];
                    let size: f64 = terms.iter().map(|x| x.abs()).sum();
                    let norm: f64 = terms.iter().sum();
                    // Δ in the sum has the rounding of r.
                    let rounding = 1e-15 * r / (r - flow.hole.horizon());
                    assert!((norm + 1.0).abs() < (1e-13 + rounding) * size, "{a} {mixture:?} {r}");
                    assert!(ur <= 0.0 && (ur < 0.0 || mixture[1] == 1.0));
                }
            }
        }
    }

    #[test]
    fn exact_keplerian_flow_is_circular_geodesics_and_the_plunge() {
        for a in SPINS {
            let (hole, flow) = (Kerr::new(a).unwrap(), flow(a, [1.0; 3]));
            let plunge = Plunge::new(&hole);
            for r in radii(&flow) {
                let found = flow.velocity(r).unwrap();
                if r >= flow.isco {
                    let rate = orbits::keplerian_angular_velocity(&hole, r);
                    assert!((flow.rates(r)[1] / rate - 1.0).abs() < 1e-12, "{a} {r}");
                    assert_eq!(found[1], 0.0);
                    let g = flow.redshift(r, 0.4, 2.0, true).unwrap();
                    let expected = keplerian_redshift(&hole, r, 0.4).unwrap();
                    assert!((g / expected - 1.0).abs() < 1e-11, "{a} {r}");
                } else {
                    let expected = plunge.velocity(r).unwrap();
                    // Both start from r_isco − r, or from r_isco/r − 1.
                    let rounding = 1e-11 + 1e-15 * r / (flow.isco - r);
                    for (x, y) in found.into_iter().zip(expected) {
                        assert!((x - y).abs() <= rounding * y.abs(), "{a} {r}: {x} {y}");
                    }
                    let g = flow.redshift(r, 0.4, 2.0, true).unwrap();
                    let expected = plunge.redshift(r, 0.4, 2.0, true).unwrap();
                    assert!((g / expected - 1.0).abs() < 1e-10, "{a} {r}: {g} {expected}");
                }
            }
        }
    }

    /// E = 1 and L = 0 at any ξ.
    #[test]
    fn exact_free_fall_from_rest_at_infinity() {
        for a in SPINS {
            let flow = flow(a, [0.6, 0.0, 0.0]);
            for r in radii(&flow) {
                let [ut, ur, _, up] = flow.velocity(r).unwrap();
                let [tt, tp, pp, _] = metric(a, r);
                let rounding = 1e-15 * r / (r - flow.hole.horizon());
                assert!((tt * ut + tp * up + 1.0).abs() < (1e-13 + rounding) * ut, "{a} {r}");
                assert!((tp * ut + pp * up).abs() < (1e-13 + rounding) * ut, "{a} {r}");
                let expected = -(2.0 * r * (r * r + a * a)).sqrt() / (r * r);
                assert!((ur / expected - 1.0).abs() < 1e-13, "{a} {r}");
            }
        }
        // dr/dt = −(1 − 2/r)√(2/r) without spin.
        let [fall, turn] = flow(0.0, [1.0, 0.0, 0.0]).rates(9.0);
        assert!((fall + 7.0 / 9.0 * (2.0f64 / 9.0).sqrt()).abs() < 1e-15 && turn == 0.0);
    }

    /// The plunge of sub-Keplerian matter keeps E and L, and is at rest where it starts.
    #[test]
    fn exact_plunge_keeps_energy_and_angular_momentum() {
        for a in SPINS {
            for xi in [0.0, 0.4, 0.95] {
                let flow = flow(a, [xi, 1.0, 1.0]);
                let of = |r: f64| {
                    let [ut, _, _, up] = flow.velocity(r).unwrap();
                    let [tt, tp, pp, _] = metric(a, r);
                    [-(tt * ut + tp * up), tp * ut + pp * up]
                };
                let start = of(flow.isco);
                assert!(
                    (start[1] - xi * start[0] * keplerian_momentum(&flow.hole, flow.isco)).abs()
                        < 1e-11
                );
                for f in [0.1, 0.5, 0.9, 1.0 - 1e-9] {
                    let r = flow.hole.horizon() + f * (flow.isco - flow.hole.horizon());
                    for (x, y) in of(r).into_iter().zip(start) {
                        assert!((x - y).abs() < 1e-11, "{a} {xi} {f}: {x} {y}");
                    }
                }
                assert_eq!(flow.velocity(flow.isco).unwrap()[1], 0.0);
            }
        }
    }

    /// Formulas B39, B44 and B52 of the paper as they are printed.
    #[test]
    fn paper_rates_of_the_mixture() {
        let (a, r, xi, br, bp) = (0.5f64, 8.0f64, 0.7, 0.9, 0.8);
        let found = flow(a, [xi, br, bp]).velocity(r).unwrap();
        let delta = r * r - 2.0 * r + a * a;
        let pi = (r * r + a * a).powi(2) - a * a * delta;
        let l = xi * (r * r + a * a - 2.0 * a * r.sqrt()) / (r.sqrt() * (r - 2.0) + a);
        let circular = (a + (1.0 - 2.0 / r) * (l - a)) / (pi / (r * r) - 2.0 * a * l / r);
        let turn = circular + (1.0 - bp) * (2.0 * a * r / pi - circular);
        let ur = -(1.0 - br) * (2.0 * r * (r * r + a * a)).sqrt() / (r * r);
        let norm = 1.0 - (r * r + a * a) * turn * turn - 2.0 / r * (1.0 - a * turn).powi(2);
        let ut = ((1.0 + ur * ur * r * r / delta) / norm).sqrt();
        for (x, y) in found.into_iter().zip([ut, ur, 0.0, ut * turn]) {
            assert!((x - y).abs() < 1e-14, "{x} {y}");
        }
    }

    /// Light to the observer, from the closed form in the plane and from the point of a ray.
    #[test]
    fn exact_redshift_in_the_plane_and_along_rays() {
        for a in [-0.9, 0.0, 0.7] {
            let (hole, flow) = (Kerr::new(a).unwrap(), flow(a, [0.7, 0.8, 0.9]));
            let observer = Observer::at_infinity(Inclination::from_degrees(65.0).unwrap());
            let (tracer, mut path) = (Tracer::new(1e-12).unwrap(), Path::new());
            for (alpha, beta) in [(-8.0, 3.0), (6.0, 2.0), (2.0, 3.0), (1.0, -9.0)] {
                let ray = observer.ray(&hole, alpha, beta).unwrap();
                tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
                for time in path.equatorial_crossings() {
                    let hit = path.at(time);
                    let (r, rate) = (hit.radius(), hit.inverse_radius_rate);
                    let [fall, turn] = flow.rates(r);
                    let momentum = [ray.lambda, hit.velocity[2], rate];
                    let matter = ([0.0, 0.0, turn], fall);
                    let g = falling_redshift_at(&hole, (r, hit.direction), momentum, matter);
                    let expected = flow.redshift(r, ray.lambda, ray.eta, rate > 0.0).unwrap();
                    assert!((g.unwrap() / expected - 1.0).abs() < 1e-8, "{a}: {g:?} {expected}");
                }
            }
        }
    }

    #[test]
    fn exact_derivatives_by_central_differences() {
        type Number = Dual<f64, 5>;
        let rates = |p: [f64; 5]| flow(p[0], [p[1], p[2], p[3]]).rates(p[4]);
        for p in [[0.6, 0.7, 0.9, 0.8, 8.0], [-0.3, 0.8, 0.5, 0.9, 3.5], [0.9, 0.5, 1.0, 1.0, 1.9]]
        {
            let [a, xi, beta_r, beta_phi, r] = core::array::from_fn(|k| Number::parameter(p[k], k));
            let hole = Kerr::from_spin(a).unwrap();
            let flow = Infall::new(&hole, Mixture { xi, beta_r, beta_phi }).unwrap();
            let found = flow.rates(r);
            for k in (0..5).filter(|k| p[*k] < 1.0 || *k == 4) {
                let h = 1e-5;
                let at = |by: f64| {
                    let mut moved = p;
                    moved[k] += by * h;
                    rates(moved)
                };
                let [low, high] = [at(-1.0), at(1.0)];
                for (c, found) in found.iter().enumerate() {
                    let difference = (high[c] - low[c]) / (2.0 * h);
                    let slope = found.slope[k];
                    assert!(
                        (difference - slope).abs() < 1e-8 * (1.0 + slope.abs()),
                        "{p:?} {k} {c}"
                    );
                }
            }
            let s = (found[0].value, flow.isco().value - p[4]);
            if s.1 > 0.0 {
                let below = flow.rates_below(Number::constant(s.1.sqrt()));
                assert!((below[0].value / s.0 - 1.0).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn exact_refusals_name_the_number() {
        let hole = Kerr::new(0.5).unwrap();
        let refused = |xi, beta_r, beta_phi| {
            Infall::new(&hole, Mixture { xi, beta_r, beta_phi }).unwrap_err().field()
        };
        assert_eq!(refused(1.1, 1.0, 1.0), "xi");
        assert_eq!(refused(1.0, -0.1, 1.0), "beta_r");
        assert_eq!(refused(1.0, 1.0, f64::NAN), "beta_phi");
        assert_eq!(flow(0.5, [1.0; 3]).velocity(hole.horizon()), None);
    }
}
