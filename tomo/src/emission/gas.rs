//! A volumetric flow with an analytic density and motion, such as the EHT's tests of radiative
//! transfer use (Gold et al. 2020, ApJ 897, 148, section 3.2).

use crate::scene::{Gas, GasMotion, GasProfile};
use crate::transport::{Emission, Medium, Moment, Needs};
use kerrlight_geodesic::Kerr;
use kerrlight_geodesic::bundle::RayNodes;

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
    redshift: Option<f64>,
    outer: f64,
    color: [f32; 3],
}

/// What effects ask of a medium.
#[derive(Debug, Clone, Copy)]
pub struct GasEffects {
    /// Spectral index α, if redshift is simulated.
    pub redshift: Option<f64>,
    /// Whether it absorbs.
    pub absorption: bool,
}

impl GasModel {
    /// The gas of a scene around a hole with M = GM/c² of `centimetres`.
    pub fn new(gas: &Gas, hole: &Kerr, centimetres: f64, effects: GasEffects) -> Self {
        let emissivity = gas.emissivity * centimetres;
        GasModel {
            hole: *hole,
            profile: gas.profile,
            scale_radius: gas.scale_radius,
            flatness: gas.flatness,
            motion: gas.motion,
            emissivity,
            absorption: if effects.absorption { gas.absorptivity * emissivity } else { 0.0 },
            redshift: effects.redshift,
            outer: gas.outer_radius,
            color: gas.color,
        }
    }

    /// Density at radius r and cos θ = u, 1 at its scale.
    fn density(&self, r: f64, u: f64) -> f64 {
        let x = r / self.scale_radius;
        let flat = (self.flatness * u).powi(2);
        match self.profile {
            GasProfile::Gaussian => (-0.5 * (x * x + flat)).exp(),
            GasProfile::PowerLaw { slope } => x.powf(-slope) * (-0.5 * flat).exp(),
        }
    }

    /// g = ν_obs/ν_em at a point for a photon with angular momentum `lambda` and, for motions in
    /// r, dw/dτ = `w_rate`; `None` where nothing can move like this.
    fn redshift_factor(&self, r: f64, u: f64, lambda: f64, w_rate: f64) -> Option<f64> {
        let a = self.hole.spin();
        let sin2 = ((1.0 - u) * (1.0 + u)).max(1e-300);
        let (delta, sigma) = (self.hole.delta(r), self.hole.sigma(r, u));
        let area = (r * r + a * a).powi(2) - a * a * delta * sin2;
        match self.motion {
            GasMotion::AngularMomentum { l0 } => {
                // Covariant u = U(−1, 0, 0, l); inverse metric times ΔΣ.
                let big_r = r * sin2.sqrt();
                let l = l0 * big_r * big_r.sqrt() / (1.0 + big_r);
                let (tp, pp) = (-2.0 * a * r, (delta - a * a * sin2) / sin2);
                let norm = area + 2.0 * l * tp - l * l * pp;
                let energy = area + tp * (l + lambda) - pp * l * lambda;
                // ν_em = U · energy/(ΔΣ), U = √(ΔΣ/norm).
                (norm > 0.0 && energy > 0.0).then(|| (norm * delta * sigma).sqrt() / energy)
            }
            GasMotion::Keplerian => {
                let big_r = r * sin2.sqrt();
                let omega = 1.0 / (big_r * big_r.sqrt() + a);
                // −(g_tt + 2 g_tφ Ω + g_φφ Ω²)
                let lift = 2.0 * r / sigma * (1.0 - a * omega * sin2).powi(2);
                let norm = 1.0 - lift - (r * r + a * a) * sin2 * omega * omega;
                let energy = 1.0 - omega * lambda;
                (norm > 0.0 && energy > 0.0).then(|| norm.sqrt() / energy)
            }
            GasMotion::FreeFall => {
                // u_t = −1, u_φ = 0, u_r = −√(2r(r² + a²))/Δ; p_r = w' r²/Δ.
                let fall = (2.0 * r * (r * r + a * a)).sqrt() * w_rate * r * r;
                // ν_em = −g^tt + g^tφ λ − g^rr p_r u_r
                let energy = area - 2.0 * a * r * lambda + fall;
                Some(delta * sigma / energy)
            }
        }
    }
}

impl Medium for GasModel {
    fn sphere(&self) -> f64 {
        self.outer
    }

    fn needs(&self) -> Needs {
        let velocity = self.redshift.is_some() && self.motion == GasMotion::FreeFall;
        Needs { azimuth: false, time: false, velocity }
    }

    fn color(&self) -> [f32; 3] {
        self.color
    }

    fn scale(&self) -> f64 {
        self.emissivity * self.scale_radius
    }

    fn changes(&self) -> bool {
        false
    }

    fn absorbs(&self) -> bool {
        self.absorption > 0.0
    }

    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, _: Moment, out: &mut Emission) {
        let rates = nodes.radial_velocity.iter().copied().chain(core::iter::repeat(0.0));
        for ((r, u), rate) in nodes.radius.iter().zip(nodes.cos_theta).zip(rates) {
            let g = match self.redshift {
                Some(_) => self.redshift_factor(*r, *u, lambda, rate).unwrap_or(0.0),
                None => 1.0,
            };
            let density = if g > 0.0 { self.density(*r, *u) } else { 0.0 };
            let index = self.redshift.unwrap_or(0.0);
            // dI = g² j ds with j ∝ g^α at the emitted frequency.
            let boosted = if density > 0.0 { density * g * power(g, index) } else { 0.0 };
            out.emissivity.push(self.emissivity * boosted * g);
            if self.absorption > 0.0 {
                // κ ∝ g^{2.5 + α} along ds/g.
                out.absorption.push(self.absorption * boosted * g.sqrt());
            }
            out.redshift.push(g);
        }
    }
}

/// g^α, for the common indices without a logarithm.
fn power(g: f64, index: f64) -> f64 {
    if index.fract() == 0.0 { g.powi(index as i32) } else { g.powf(index) }
}
