//! Polarised light: what a scene's field and electrons make of the light of its sources.

use super::PreparedScene;
use super::surface::Hit;
use crate::emission::disc::DiscModel;
use crate::emission::medium::{Emission, Medium};
use crate::polarization::{Gas, MagneticField, PowerLaw, Stokes, view, view_at};
use crate::scene::Scene;
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{Kerr, OutOfRange, PathPoint, ScreenPoint, ZamoFrame};

/// The field of the gas and its electrons.
#[derive(Debug, Clone)]
pub(super) struct Polarization {
    law: PowerLaw,
    circular: bool,
    field: MagneticField,
}

impl Polarization {
    /// That of a scene, if it is asked for.
    pub fn new(scene: &Scene) -> Result<Option<Self>, OutOfRange> {
        let effects = &scene.effects;
        let (Some(field), true) = (scene.magnetic_field, effects.polarization) else {
            return Ok(None);
        };
        let index = effects.index().unwrap_or(f64::NAN);
        let law = PowerLaw::new(index, effects.circular_polarization_lorentz_factor)?;
        let circular = effects.circular_polarization_lorentz_factor.is_some();
        Ok(Some(Polarization { law, circular, field }))
    }

    /// Whether V is computed.
    pub fn is_circular(&self) -> bool {
        self.circular
    }
}

impl PreparedScene {
    /// The screen of a ray, if light is polarised.
    pub(super) fn screen_point(&self, x: f64, y: f64) -> Option<ScreenPoint> {
        let (Some(_), super::View::Screen(observer)) = (&self.polarization, &self.view) else {
            return None;
        };
        Some(ScreenPoint::new(&self.hole, observer.inclination().sin(), x, y))
    }

    /// Makes the emission of a medium that of electrons in the field: emissivities times their
    /// own for unit field, and Q, U, V per intensity.
    pub(super) fn polarize(
        &self,
        medium: &dyn Medium,
        nodes: &RayNodes<'_>,
        lambda: f64,
        screen: &ScreenPoint,
        out: &mut Emission,
    ) {
        out.polarization.clear();
        let Some(Polarization { law, field, .. }) = &self.polarization else { return };
        for (k, emissivity) in out.emissivity.iter_mut().enumerate() {
            let (r, u) = (nodes.radius[k], nodes.cos_theta[k]);
            let rates = [nodes.radial_velocity[k], nodes.polar_velocity[k]];
            let azimuth = nodes.azimuth.get(k).copied().unwrap_or(0.0);
            let stokes = medium.four_velocity(r, u, azimuth).and_then(|velocity| {
                let momentum = momentum(&self.hole, [r, u], rates, lambda);
                view_at(&self.hole, screen, [r, u], momentum, velocity, field)
            });
            let stokes = stokes.map(|view| law.emissivity(&view)).unwrap_or_default();
            *emissivity *= stokes.i;
            out.polarization.push(share(&stokes));
        }
    }

    /// Light of the disc at a crossing for unit intensity in the gas frame: g^{3+α} j ℓ_p.
    pub(super) fn polarized_hit(
        &self,
        disc: &DiscModel,
        hit: &Hit,
        lambda: f64,
        screen: &ScreenPoint,
    ) -> Stokes {
        let Some(Polarization { law, field, .. }) = &self.polarization else {
            return Stokes::default();
        };
        let r = hit.place.radius;
        let seen = ZamoFrame::at(&self.hole, r, 1.0, 0.0).and_then(|frame| {
            let gas = match disc.plunging_velocity(r) {
                Some(velocity) => Gas::of_velocity(&frame, velocity),
                None => Gas::keplerian(&self.hole, &frame)?,
            };
            let photon = frame.covariant(momentum(&self.hole, [r, 0.0], hit.rates, lambda));
            view(&frame, screen, photon, gas, field.at(&frame))
        });
        seen.and_then(|view| law.of_layer(&view)).unwrap_or_default()
    }

    /// Emissivity, for unit emissivity across a unit field, and Q, U, V per intensity, at a point
    /// of matter that turns with `omega`.
    pub(super) fn polarized_spot(
        &self,
        point: &PathPoint,
        lambda: f64,
        omega: [f64; 3],
        screen: &ScreenPoint,
    ) -> Stokes {
        let Some(Polarization { law, field, .. }) = &self.polarization else {
            return Stokes::default();
        };
        let seen = ZamoFrame::of(&self.hole, point).and_then(|frame| {
            let gas = Gas::rotating(&frame, point, omega)?;
            let photon = frame.covariant(point.momentum(&self.hole, lambda));
            view(&frame, screen, photon, gas, field.at(&frame))
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
    let sin = ((1.0 - u) * (1.0 + u)).sqrt().max(1e-150);
    [-1.0, w_rate * r * r / hole.delta(r), u_rate / sin, lambda]
}
