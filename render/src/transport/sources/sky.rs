//! The sky behind everything.

use crate::emission::sky::{Beam, Catalogue, Panorama, SkyModel};
use crate::scene::{self, Scene};
use kerrlight_geodesic::TracedRay;
use kerrlight_geodesic::footprint;

/// The sky of a scene.
#[derive(Debug, Clone)]
pub(in crate::transport) struct Sky {
    model: SkyModel,
    /// Distance of neighbouring rays on the screen, if the sky is averaged over their beams.
    beams: Option<f64>,
}

impl Sky {
    /// The sky of a scene, if it has one, with the picture or the stars that it names.
    pub fn new(scene: &Scene, picture: Option<Panorama>, stars: Option<Catalogue>) -> Option<Self> {
        let model = scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, picture, stars))?;
        let averaged = scene.effects.ray_bundles || matches!(model, SkyModel::Catalogue(_));
        let model = if averaged { model.for_beams() } else { model };
        Some(Sky { model, beams: averaged.then(|| ray_spacing(scene)) })
    }

    /// Takes the spacing of rays from a scene whose camera has moved.
    pub fn respace(&mut self, scene: &Scene) {
        self.beams = self.beams.map(|_| ray_spacing(scene));
    }

    /// Returns its model.
    pub fn model(&self) -> &SkyModel {
        &self.model
    }

    /// Returns whether it is averaged over beams.
    pub fn is_averaged(&self) -> bool {
        self.beams.is_some()
    }

    /// Its linear colour at the end of a ray, averaged over the ray's beam if there is one; dark if the ray does not
    /// get there.
    #[inline]
    pub fn light(&self, ray: &TracedRay, beam: Option<&footprint::Sky>) -> [f32; 3] {
        let (Some(direction), None) = (ray.exit, ray.surface) else { return [0.0; 3] };
        match (self.beams, beam) {
            (Some(spacing), Some(end)) => self.model.mean_color(&Beam::new(end, spacing)),
            _ => self.model.color(direction),
        }
    }
}

/// Distance of neighbouring rays on the screen; with a point-spread function, of rays whose beams are as wide as it.
fn ray_spacing(scene: &Scene) -> f64 {
    if let Some(scene::Sky::Catalogue(stars)) = &scene.sky {
        return Beam::spacing(stars.psf_fwhm_pixels * scene.pixel_size());
    }
    scene.pixel_size() / f64::from(scene.screen.samples_per_pixel.isqrt())
}
