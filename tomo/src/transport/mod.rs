//! The only place where a pixel is a sum: light of every source along one ray.

mod glimpse;
mod spots;
mod surface;
mod view;

pub use glimpse::{Fate, Glimpse};
pub use view::View;

use crate::emission::disc::DiscModel;
use crate::emission::sky::{Beam, Panorama, SkyModel};
use crate::emission::spot::SpotModel;
use crate::scene::Scene;
use glimpse::Gather;
use kerrlight_geodesic::{
    Kerr, OutOfRange, Outcome, Path, PathPoint, Tracer, Want, footprint, footprint::Number,
};

/// A scene with everything computed that does not depend on the ray.
#[derive(Debug, Clone)]
pub struct Stage {
    /// The hole.
    pub hole: Kerr,
    /// Who looks.
    pub view: View,
    tracer: Tracer,
    tolerance: f64,
    time: f64,
    /// Spectral index α, if redshift is simulated.
    redshift: Option<f64>,
    slow_light: bool,
    disc: Option<DiscModel>,
    spots: Vec<SpotModel>,
    sky: Option<SkyModel>,
    /// Distance of neighbouring rays on the screen, if the sky is averaged over their beams.
    beams: Option<f64>,
}

/// Memory that is reused from ray to ray.
#[derive(Debug, Default)]
pub struct Scratch {
    path: Path,
    beam: Path<Number>,
    intervals: Vec<[f64; 2]>,
}

impl Stage {
    /// The stage of a scene; `picture` is the decoded file of a `[sky.image]`.
    ///
    /// # Errors
    /// If a value is outside its range (a parsed [`Scene`] never is).
    pub fn new(scene: &Scene, picture: Option<Panorama>) -> Result<Self, OutOfRange> {
        let hole = Kerr::new(scene.hole.spin)?;
        let sky = scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, picture));
        Ok(Stage {
            hole,
            view: View::new(scene, &hole)?,
            tracer: Tracer::with_method(scene.tracer.integrator.method(), scene.tracer.tolerance)?,
            tolerance: scene.tracer.tolerance,
            time: scene.observer.time,
            redshift: scene.effects.redshift.then_some(scene.effects.spectral_index).flatten(),
            slow_light: scene.effects.slow_light,
            disc: scene.disc.as_ref().map(|disc| DiscModel::new(disc, &hole)),
            spots: scene.spot.iter().map(|spot| SpotModel::new(spot, &hole)).collect(),
            sky: sky.map(|sky| if scene.effects.ray_bundles { sky.for_beams() } else { sky }),
            beams: scene.effects.ray_bundles.then(|| ray_spacing(scene)),
        })
    }

    /// The same stage seen at another time by a camera that moves; `scene` is the one that it was
    /// made of, but for its time of observation.
    ///
    /// # Errors
    /// If the camera is impossible there.
    pub fn move_to(&mut self, scene: &Scene) -> Result<(), OutOfRange> {
        self.view = View::new(scene, &self.hole)?;
        self.beams = self.beams.map(|_| ray_spacing(scene));
        self.time = scene.observer.time;
        Ok(())
    }

    /// The scene's own time of observation, in M.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Whether g is computed.
    pub fn has_redshift(&self) -> bool {
        self.redshift.is_some()
    }

    /// What is seen at (α, β) at the scene's own time.
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn look(
        &self,
        alpha: f64,
        beta: f64,
        scratch: &mut Scratch,
    ) -> Result<Glimpse, OutOfRange> {
        let mut seen = [Glimpse::default()];
        self.look_many(&[alpha], &[beta], &[self.time], scratch, &mut seen)?;
        let [seen] = seen;
        Ok(seen)
    }

    /// What is seen at each (`alpha[k]`, `beta[k]`) at each of `times` (of observation, in M):
    /// ray `k` at time `j` goes to `seen[j · rays + k]`. Rays are traced once for all times.
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn look_many(
        &self,
        alpha: &[f64],
        beta: &[f64],
        times: &[f64],
        scratch: &mut Scratch,
        seen: &mut [Glimpse],
    ) -> Result<(), OutOfRange> {
        let rays = alpha.len().max(1);
        for (k, (alpha, beta)) in alpha.iter().zip(beta).enumerate() {
            let ray = self.view.ray(&self.hole, *alpha, *beta)?;
            self.tracer.trace(&self.hole, &ray, Want::ALL, &mut scratch.path);
            let mut still = Gather::new();
            let surface = self.add_disc(&ray, &scratch.path, &mut still);
            let sky = self.sky_light(*alpha, *beta, surface, scratch)?;
            let shift = self.redshift.and_then(|_| self.view.blueshift(*alpha, *beta));
            let places = seen.iter_mut().skip(k).step_by(rays);
            for (time, place) in times.iter().zip(places) {
                *place = self.glimpse(*time, still.clone(), surface, scratch);
                for (channel, light) in place.rgb.iter_mut().zip(sky) {
                    *channel += light;
                }
                if let (Some(index), Some(shift)) = (self.redshift, shift) {
                    place.receive(shift, index);
                }
            }
        }
        Ok(())
    }

    /// What one traced ray sees at one time; `still` is what does not depend on it.
    fn glimpse(
        &self,
        time: f64,
        mut gather: Gather,
        surface: Option<f64>,
        scratch: &mut Scratch,
    ) -> Glimpse {
        let end = surface.unwrap_or_else(|| scratch.path.mino_total());
        self.add_spots(time, scratch, end, &mut gather);
        let path = &scratch.path;
        let fate = match (surface, path.outcome()) {
            (Some(_), _) => Fate::Surface,
            (None, Outcome::Captured) => Fate::Captured,
            (None, Outcome::Escaped) => Fate::Escaped,
            (None, Outcome::Unresolved(_)) => Fate::Unresolved,
        };
        let mean = if gather.intensity > 0.0 { gather.shift / gather.intensity } else { 0.0 };
        Glimpse {
            intensity: gather.intensity,
            rgb: gather.rgb,
            redshift: mean,
            crossings: path.equatorial_crossings().len() as u32,
            radius: gather.radius,
            azimuth: gather.azimuth,
            delay: gather.delay,
            fate,
        }
    }

    /// Light of the sky at the end of the traced ray, dark if it does not get there.
    fn sky_light(
        &self,
        x: f64,
        y: f64,
        surface: Option<f64>,
        scratch: &mut Scratch,
    ) -> Result<[f32; 3], OutOfRange> {
        let Some(sky) = &self.sky else { return Ok([0.0; 3]) };
        if surface.is_some() || scratch.path.outcome() != Outcome::Escaped {
            return Ok([0.0; 3]);
        }
        if let Some(spacing) = self.beams {
            let ray = self.view.bundle(&self.hole, x, y)?;
            let hole = self.hole.lift();
            let end = footprint::of_ray(&hole, &ray, self.tolerance, &mut scratch.beam)?;
            if let Some(end) = end {
                return Ok(sky.gather(&Beam::new(&end, spacing)));
            }
        }
        Ok(sky.look(scratch.path.at(scratch.path.mino_total()).direction))
    }

    /// When the light that is seen at `time` passed a point.
    fn emission_time(&self, time: f64, point: &PathPoint) -> f64 {
        if self.slow_light { time - point.delay } else { time }
    }
}

/// Distance of neighbouring rays on the screen.
fn ray_spacing(scene: &Scene) -> f64 {
    scene.pixel_size() / f64::from(scene.screen.samples_per_pixel.isqrt())
}
