//! The sky behind everything.

use crate::emission::sky::{Beam, Panorama, SkyModel};
use crate::scene::Scene;
use crate::transport::optics::Optics;
use kerrlight_geodesic::Error;
use kerrlight_geodesic::footprint::{self, Number};
use kerrlight_geodesic::{Path, TracedRay};

/// The sky of a scene.
#[derive(Debug, Clone)]
pub(in crate::transport) struct Sky {
    model: SkyModel,
    /// Distance of neighbouring rays on the screen, if the sky is averaged over their beams.
    beams: Option<f64>,
}

impl Sky {
    /// The sky of a scene, if it has one, with the picture that it names.
    pub fn new(scene: &Scene, picture: Option<Panorama>) -> Option<Self> {
        let model = scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, picture))?;
        let averaged = scene.effects.ray_bundles;
        let model = if averaged { model.for_beams() } else { model };
        Some(Sky { model, beams: averaged.then(|| ray_spacing(scene)) })
    }

    /// Takes the spacing of rays from a scene whose camera has moved.
    pub fn respace(&mut self, scene: &Scene) {
        self.beams = self.beams.map(|_| ray_spacing(scene));
    }

    /// What it is.
    pub fn model(&self) -> &SkyModel {
        &self.model
    }

    /// Whether it is averaged over beams.
    pub fn is_averaged(&self) -> bool {
        self.beams.is_some()
    }

    /// Its linear colour at the end of a ray that arrives at (x, y); dark if the ray does not get
    /// there.
    #[inline]
    pub fn light(
        &self,
        optics: &Optics,
        (x, y): (f64, f64),
        ray: &TracedRay,
        path: &mut Path<Number>,
    ) -> Result<[f32; 3], Error> {
        let (Some(direction), None) = (ray.exit, ray.surface) else { return Ok([0.0; 3]) };
        if ray.until < ray.mino_total {
            return Ok([0.0; 3]);
        }
        if let (Some(spacing), true) = (self.beams, optics.lensing) {
            let beam = optics.view.beam(&optics.hole, x, y)?;
            let hole = optics.hole.lift();
            if let Some(end) = footprint::of_ray(&hole, &beam, optics.tolerance, path)? {
                return Ok(self.model.mean_color(&Beam::new(&end, spacing)));
            }
        }
        Ok(self.model.color(direction))
    }
}

/// Distance of neighbouring rays on the screen.
fn ray_spacing(scene: &Scene) -> f64 {
    scene.pixel_size() / f64::from(scene.screen.samples_per_pixel.isqrt())
}
