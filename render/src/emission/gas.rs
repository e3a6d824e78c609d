//! A volumetric flow with an analytic density and motion, such as the EHT's tests of radiative
//! transfer use (Gold et al. 2020, ApJ 897, 148, section 3.2).

use super::medium::{CellSize, Emission, Medium, Moment, Part};
use crate::scene::{Effects, Gas, GasMotion, GasProfile};
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{Kerr, Quantities};

/// A flow around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct GasModel {
    hole: Kerr,
    profile: GasProfile,
    scale_radius: f64,
    flatness: f64,
    motion: GasMotion,
    /// Emissivity at density 1, in erg s⁻¹ cm⁻² Hz⁻¹ sr⁻¹ per M.
    emissivity: f64,
    /// Absorption coefficient at density 1 and g = 1, per M; 0 where absorption is off.
    absorption: f64,
    /// Spectral index, if redshift is simulated.
    spectral_index: Option<f64>,
    outer: f64,
    color: [f32; 3],
}

/// Metric at a point, as far as the flows need it.
struct Metric {
    sin2: f64,
    delta: f64,
    sigma: f64,
    /// r² + a².
    across: f64,
    /// −g^tt ΔΣ.
    area: f64,
    /// g^tφ ΔΣ.
    tp: f64,
    /// g^φφ ΔΣ.
    pp: f64,
    /// r sin θ.
    big_r: f64,
}

impl GasModel {
    /// The gas of a scene around a hole with M = GM/c² of `centimetres`.
    pub fn new(gas: &Gas, hole: &Kerr, centimetres: f64, effects: &Effects) -> Self {
        let emissivity = gas.emissivity * centimetres;
        GasModel {
            hole: *hole,
            profile: gas.profile,
            scale_radius: gas.scale_radius,
            flatness: gas.flatness,
            motion: gas.motion,
            emissivity,
            absorption: if effects.absorption { gas.absorptivity * emissivity } else { 0.0 },
            spectral_index: effects.index(),
            outer: gas.outer_radius,
            color: gas.color,
        }
    }

    /// Densities at nodes, 1 at the scale. Loops without branches, for the sake of SIMD.
    fn densities(&self, nodes: &RayNodes<'_>, out: &mut Vec<f64>) {
        let (scale, flat) = (1.0 / self.scale_radius, 0.5 * self.flatness * self.flatness);
        let places = nodes.radius.iter().zip(nodes.cos_theta);
        out.clear();
        match self.profile {
            GasProfile::Gaussian => {
                let round = 0.5 * scale * scale;
                out.extend(places.map(|(r, u)| -(round * r * r + flat * u * u)));
                out.iter_mut().for_each(|x| *x = x.exp());
            }
            GasProfile::PowerLaw { slope } => {
                out.extend(places.map(|(r, u)| (r * scale).powf(-slope) * (-flat * u * u).exp()))
            }
        }
    }

    /// g at the nodes of a ray with angular momentum `lambda`; 0 where nothing can move so.
    fn redshifts(&self, nodes: &RayNodes<'_>, lambda: f64, out: &mut Vec<f64>) {
        out.clear();
        let places = nodes.radius.iter().zip(nodes.cos_theta);
        match (self.spectral_index, self.motion) {
            (None, _) => out.resize(nodes.radius.len(), 1.0),
            (_, GasMotion::AngularMomentum { l0 }) => {
                out.extend(places.map(|(r, u)| self.on_circles(*r, *u, lambda, l0)));
            }
            (_, GasMotion::Keplerian) => {
                out.extend(places.map(|(r, u)| self.keplerian(*r, *u, lambda)));
            }
            (_, GasMotion::FreeFall) => {
                let places = places.zip(nodes.radial_velocity);
                out.extend(places.map(|((r, u), rate)| self.free_fall(*r, *u, lambda, *rate)));
            }
        }
    }

    /// The metric at a point.
    #[inline(always)]
    fn metric(&self, r: f64, u: f64) -> Metric {
        let a = self.hole.spin();
        // On the axis g^φφ has a pole and l vanishes: their product is 0 and no NaN.
        let sin2 = ((1.0 - u) * (1.0 + u)).max(1e-300);
        let (delta, sigma) = (self.hole.delta(r), self.hole.sigma(r, u));
        let across = r * r + a * a;
        let area = across * across - a * a * delta * sin2;
        let (tp, pp) = (-2.0 * a * r, delta / sin2 - a * a);
        Metric { sin2, delta, sigma, across, area, tp, pp, big_r: r * sin2.sqrt() }
    }

    /// g with the angular momentum l = l₀ R^{3/2}/(1 + R), covariant u = U(−1, 0, 0, l).
    #[inline(always)]
    fn on_circles(&self, r: f64, u: f64, lambda: f64, l0: f64) -> f64 {
        let Metric { delta, sigma, area, tp, pp, big_r, .. } = self.metric(r, u);
        let l = l0 * big_r * big_r.sqrt() / (1.0 + big_r);
        let norm = area + 2.0 * l * tp - l * l * pp;
        let energy = area + tp * (l + lambda) - pp * l * lambda;
        // ν_em = U · energy/(ΔΣ), U = √(ΔΣ/norm).
        let g = (norm * delta * sigma).max(0.0).sqrt() / energy;
        // False for NaN too: 0/0 may come out where nothing can move so.
        if g > 0.0 { g } else { 0.0 }
    }

    /// Contravariant four-velocity; `None` where nothing can move like this.
    fn velocity(&self, r: f64, u: f64) -> Option<[f64; 4]> {
        let a = self.hole.spin();
        let Metric { sin2, delta, sigma, across, area, tp, pp, big_r } = self.metric(r, u);
        let raised = |ut: f64, up: f64| {
            let scale = 1.0 / (delta * sigma);
            [(tp * up - area * ut) * scale, (tp * ut + pp * up) * scale]
        };
        match self.motion {
            GasMotion::AngularMomentum { l0 } => {
                let l = l0 * big_r * big_r.sqrt() / (1.0 + big_r);
                let norm = area + 2.0 * l * tp - l * l * pp;
                let size = (delta * sigma / norm).sqrt();
                let [t, phi] = raised(-size, size * l);
                (norm > 0.0).then_some([t, 0.0, 0.0, phi])
            }
            GasMotion::Keplerian => {
                let omega = 1.0 / (big_r * big_r.sqrt() + a);
                let lift = 1.0 - a * omega * sin2;
                let norm = 1.0 - 2.0 * r / sigma * lift * lift - across * sin2 * omega * omega;
                let t = 1.0 / norm.sqrt();
                (norm > 0.0).then_some([t, 0.0, 0.0, t * omega])
            }
            GasMotion::FreeFall => {
                let [t, phi] = raised(-1.0, 0.0);
                Some([t, -(2.0 * r * across).sqrt() / sigma, 0.0, phi])
            }
        }
    }

    /// g on circles with Ω = 1/(R^{3/2} + a).
    #[inline(always)]
    fn keplerian(&self, r: f64, u: f64, lambda: f64) -> f64 {
        let a = self.hole.spin();
        let sin2 = (1.0 - u) * (1.0 + u);
        let big_r = r * sin2.sqrt();
        let omega = 1.0 / (big_r * big_r.sqrt() + a);
        // −(g_tt + 2 g_tφ Ω + g_φφ Ω²)
        let lift = 1.0 - a * omega * sin2;
        let lift = 2.0 * r / self.hole.sigma(r, u) * lift * lift;
        let norm = 1.0 - lift - (r * r + a * a) * sin2 * omega * omega;
        let g = norm.max(0.0).sqrt() / (1.0 - omega * lambda);
        if g > 0.0 { g } else { 0.0 }
    }

    /// g of matter that falls from rest at infinity, for a backward ray with dw/dτ = `w_rate`:
    /// u_t = −1, u_φ = 0, u_r = −√(2r(r² + a²))/Δ.
    #[inline(always)]
    fn free_fall(&self, r: f64, u: f64, lambda: f64, w_rate: f64) -> f64 {
        let a = self.hole.spin();
        let (delta, sigma) = (self.hole.delta(r), self.hole.sigma(r, u));
        let across = r * r + a * a;
        let area = across * across - a * a * delta * (1.0 - u) * (1.0 + u);
        // ν_em = −g^tt + g^tφ λ − g^rr p_r u_r with p_r = w' r²/Δ.
        let fall = (2.0 * r * across).sqrt() * w_rate * r * r;
        delta * sigma / (area - 2.0 * a * r * lambda + fall)
    }
}

impl Medium for GasModel {
    fn part(&self) -> Part {
        Part::Gas
    }

    fn cell_size(&self) -> Option<CellSize> {
        None
    }

    fn thin_layer(&self) -> Option<f64> {
        // The coarsest nodes are up to 0.08 apart.
        (self.flatness > 12.0).then(|| 1.0 / self.flatness)
    }

    fn relative_size(&self) -> f64 {
        let falls = match self.profile {
            GasProfile::Gaussian => 1.0,
            GasProfile::PowerLaw { slope } => slope.max(1.0),
        };
        // The density falls by a factor e over r/slope along the radius, and with σ = 1/h in cos θ.
        1.0 / self.flatness.max(falls)
    }

    fn sphere(&self) -> f64 {
        self.outer
    }

    fn quantities(&self) -> Quantities {
        let velocity = self.spectral_index.is_some() && self.motion == GasMotion::FreeFall;
        Quantities { azimuth: false, time: false, velocity }
    }

    fn color(&self) -> [f32; 3] {
        self.color
    }

    fn scale(&self) -> f64 {
        self.emissivity * self.scale_radius
    }

    fn four_velocity(&self, r: f64, u: f64, _: f64) -> Option<[f64; 4]> {
        self.velocity(r, u)
    }

    fn changes(&self) -> bool {
        false
    }

    fn absorbs(&self) -> bool {
        self.absorption > 0.0
    }

    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, _: Moment, out: &mut Emission) {
        self.redshifts(nodes, lambda, &mut out.redshift);
        self.densities(nodes, &mut out.emissivity);
        let index = self.spectral_index.unwrap_or(0.0);
        if index != 0.0 {
            // j ∝ g^α at the emitted frequency.
            let pairs = out.emissivity.iter_mut().zip(&out.redshift);
            pairs
                .for_each(|(density, g)| *density *= if *g > 0.0 { power(*g, index) } else { 0.0 });
        }
        if self.absorption > 0.0 {
            // κ ∝ g^{5/2 + α} along ds/g.
            let pairs = out.emissivity.iter().zip(&out.redshift);
            out.absorption.clear();
            out.absorption.extend(pairs.map(|(n, g)| self.absorption * n * g * g.sqrt()));
        }
        // dI = g² j ds.
        let pairs = out.emissivity.iter_mut().zip(&out.redshift);
        pairs.for_each(|(j, g)| *j *= self.emissivity * g * g);
    }
}

/// g^α, for the common indices without a logarithm.
fn power(g: f64, index: f64) -> f64 {
    if index.fract() == 0.0 { g.powi(index as i32) } else { g.powf(index) }
}
