//! Polarised light of the sources.

use crate::Error;
use crate::emission::disc::DiscModel;
use crate::emission::medium::{Emission, Medium};
use crate::polarization::{Gas, MagneticField, PowerLaw, Stokes, view, view_at};
use crate::scene::Scene;
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{Kerr, PathPoint, PlaneCrossing, ScreenPoint, ZamoFrame};

/// The field of the gas and its electrons.
#[derive(Debug, Clone)]
pub(super) struct Polarization {
    law: PowerLaw,
    circular: bool,
    field: MagneticField,
}

impl Polarization {
    /// Takes the polarisation of a scene, if it is simulated.
    pub fn new(scene: &Scene) -> Result<Option<Self>, Error> {
        let effects = &scene.effects;
        let (Some(field), true) = (scene.magnetic_field, effects.polarization) else {
            return Ok(None);
        };
        let index = effects.index().unwrap_or(f64::NAN);
        let law = PowerLaw::new(index, effects.circular_polarization_lorentz_factor)?;
        let circular = effects.circular_polarization_lorentz_factor.is_some();
        Ok(Some(Polarization { law, circular, field }))
    }

    /// Returns whether V is computed.
    pub fn is_circular(&self) -> bool {
        self.circular
    }
}

/// Polarised light along one ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct PolarizedRay<'a> {
    pub hole: &'a Kerr,
    pub polarization: &'a Polarization,
    /// Place of arrival.
    pub screen: ScreenPoint,
    /// λ = L/E, in M.
    pub lambda: f64,
}

impl PolarizedRay<'_> {
    /// Makes the emission of a medium that of electrons in the field: emissivities times their
    /// own for unit field, and Q, U, V per intensity.
    pub fn polarize(&self, medium: &dyn Medium, nodes: &RayNodes<'_>, out: &mut Emission) {
        let Polarization { law, field, .. } = self.polarization;
        out.polarization.clear();
        for (k, emissivity) in out.emissivity.iter_mut().enumerate() {
            let (r, u) = (nodes.radius[k], nodes.cos_theta[k]);
            let rates = [nodes.radial_velocity[k], nodes.polar_velocity[k]];
            let azimuth = nodes.azimuth.get(k).copied().unwrap_or(0.0);
            let stokes = medium.four_velocity(r, u, azimuth).and_then(|velocity| {
                let momentum = momentum(self.hole, [r, u], rates, self.lambda);
                view_at(self.hole, &self.screen, [r, u], momentum, velocity, field)
            });
            let stokes = stokes.map(|view| law.emissivity(&view)).unwrap_or_default();
            *emissivity *= stokes.i;
            out.polarization.push(share(&stokes));
        }
    }

    /// Returns the brightest light of the disc at a radius for unit intensity in the gas frame, in whichever direction a ray with
    /// this η = Q/E² crosses it there.
    pub fn brightest_of_disc(&self, disc: &DiscModel, r: f64, eta: f64) -> f64 {
        let a = self.hole.spin();
        let (energy, drag) = (r * r + a * a - a * self.lambda, self.lambda - a);
        // R and Θ at the equator: dr/dτ = ±√R, dθ/dτ = ±√η.
        let radial = energy * energy - self.hole.delta(r) * (eta + drag * drag);
        let [fall, turn] = [radial, eta].map(|square| square.max(0.0).sqrt());
        let directions = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
        let light =
            directions.map(|[out, up]| self.crossing(disc, r, [out * fall / (r * r), up * turn]).i);
        light.into_iter().fold(0.0, f64::max)
    }

    /// Light of the disc at a crossing for unit intensity in the gas frame: g^{3+α} j ℓ_p.
    pub fn of_disc(&self, disc: &DiscModel, crossing: &PlaneCrossing) -> Stokes {
        self.crossing(disc, crossing.radius, crossing.rates)
    }

    /// The same for a crossing with these d(1/r)/dτ and d cos θ/dτ.
    fn crossing(&self, disc: &DiscModel, r: f64, rates: [f64; 2]) -> Stokes {
        let Polarization { law, field, .. } = self.polarization;
        let hole = self.hole;
        let seen = ZamoFrame::at(hole, r, 1.0, 0.0).and_then(|frame| {
            let gas = match disc.plunging_velocity(r) {
                Some(velocity) => Gas::of_velocity(&frame, velocity),
                None => Gas::keplerian(hole, &frame)?,
            };
            let photon = frame.covariant(momentum(hole, [r, 0.0], rates, self.lambda));
            view(&frame, &self.screen, photon, gas, field.at(&frame))
        });
        seen.and_then(|view| law.of_layer(&view)).unwrap_or_default()
    }

    /// Emissivity, for unit emissivity across a unit field, and Q, U, V per intensity, at a point
    /// of matter that turns with `omega`.
    pub fn of_spot(&self, point: &PathPoint, omega: [f64; 3]) -> Stokes {
        let Polarization { law, field, .. } = self.polarization;
        let seen = ZamoFrame::of(self.hole, point).and_then(|frame| {
            let gas = Gas::rotating(&frame, point, omega)?;
            let photon = frame.covariant(point.momentum(self.hole, self.lambda));
            view(&frame, &self.screen, photon, gas, field.at(&frame))
        });
        seen.map(|view| law.emissivity(&view)).unwrap_or_default()
    }
}

/// Q, U, V over I.
pub(super) fn share(stokes: &Stokes) -> [f64; 3] {
    if stokes.i > 0.0 { [stokes.q, stokes.u, stokes.v].map(|x| x / stokes.i) } else { [0.0; 3] }
}

/// Covariant momentum of the arriving photon at (r, cos θ), from dw/dτ and d cos θ/dτ of the
/// backward ray.
fn momentum(hole: &Kerr, [r, u]: [f64; 2], [w_rate, u_rate]: [f64; 2], lambda: f64) -> [f64; 4] {
    // On the axis d cos θ/dτ is 0 as well: no NaN.
    let sin = ((1.0 - u) * (1.0 + u)).sqrt().max(1e-150);
    [-1.0, w_rate * r * r / hole.delta(r), u_rate / sin, lambda]
}
