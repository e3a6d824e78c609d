//! The only place where a pixel is a sum: light of every source along one ray.
//!
//! Rays come in blocks ([`rays`](self)): in closed form on SIMD lanes where that is asked for and
//! keeps its digits, else step by step. Surfaces come first, since they end rays; then what
//! fills space, on quadrature nodes; then spots; then the sky.

mod glimpse;
mod medium;
mod rays;
mod spots;
mod surface;
mod view;
mod volume;

pub use glimpse::{Fate, Glimpse};
pub use medium::{Emission, Medium, Moment, Needs};
pub use view::View;

use crate::emission::disc::DiscModel;
use crate::emission::gas::{GasEffects, GasModel};
use crate::emission::sky::{Beam, Panorama, SkyModel};
use crate::emission::spot::SpotModel;
use crate::scene::{Integrator, Scene};
use glimpse::{Gather, wrap};
use kerrlight_geodesic::bundle::{Crossings, Nodes, Samples};
use kerrlight_geodesic::{
    Kerr, Observer, OutOfRange, Path, PathPoint, Tracer, footprint, footprint::Number,
};
use rays::{End, Sight};
use surface::Hit;

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
    /// The last number of half-orbits that is seen.
    half_orbits: Option<u32>,
    /// Whether rays are traced in closed form where possible.
    closed_form: bool,
    /// Whether every ray needs its path for some source.
    steps_for_all: bool,
    /// What is told of the brightest contribution.
    places: Needs,
    disc: Option<DiscModel>,
    gas: Option<GasModel>,
    spots: Vec<SpotModel>,
    sky: Option<SkyModel>,
    /// Distance of neighbouring rays on the screen, if the sky is averaged over their beams.
    beams: Option<f64>,
}

/// Memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct Scratch {
    path: Path,
    beam: Path<Number>,
    intervals: Vec<[f64; 2]>,
    crossings: Crossings,
    nodes: Nodes,
    samples: Samples,
    sights: Vec<Sight>,
    hits: Vec<Hit>,
    volume: volume::Workspace,
}

/// Where the SIMD kernels can have an observer, in M.
const NEAREST: f64 = 10.0;

impl Stage {
    /// The stage of a scene; `picture` is the decoded file of a `[sky.image]`.
    ///
    /// # Errors
    /// If a value is outside its range (a parsed [`Scene`] never is).
    pub fn new(scene: &Scene, picture: Option<Panorama>) -> Result<Self, OutOfRange> {
        let hole = Kerr::new(scene.hole.spin)?;
        let kept = |name: &str| {
            let channels = scene.screen.channels.as_ref();
            channels.is_none_or(|channels| channels.iter().any(|channel| channel == name))
        };
        let redshift = scene.effects.redshift.then_some(scene.effects.spectral_index).flatten();
        let effects = GasEffects { redshift, absorption: scene.effects.absorption };
        let length = 100.0 * crate::units::SPEED_OF_LIGHT;
        let length = length * crate::units::gravitational_time(scene.hole.mass_msun);
        let gas = scene.gas.as_ref().map(|gas| GasModel::new(gas, &hole, length, effects));
        let view = View::new(scene, &hole)?;
        let sky = scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, picture));
        Ok(Stage {
            hole,
            view,
            tracer: Tracer::with_method(scene.tracer.integrator.method(), scene.tracer.tolerance)?,
            time: scene.observer.time,
            redshift,
            slow_light: scene.effects.slow_light,
            half_orbits: scene.effects.half_orbits,
            tolerance: scene.tracer.tolerance,
            closed_form: scene.tracer.integrator == Integrator::Elliptic,
            steps_for_all: !scene.spot.is_empty(),
            places: Needs { azimuth: kept("azimuth"), time: kept("delay"), velocity: false },
            gas,
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

    /// Whether anything absorbs.
    pub fn absorbs(&self) -> bool {
        self.gas.as_ref().is_some_and(Medium::absorbs)
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
        let rays = alpha.len();
        scratch.sights.clear();
        scratch.hits.clear();
        let observer = self.closed_form();
        match observer {
            Some(observer) => self.trace_block(observer, alpha, beta, scratch)?,
            None => scratch.sights.resize(rays, Sight { by_steps: true, ..Sight::default() }),
        }
        let medium = self.gas.as_ref().map(|gas| gas as &dyn Medium);
        scratch.volume.reset(medium.map_or(0, |_| rays * times.len()));
        if let (Some(medium), Some(observer)) = (medium, observer) {
            self.fill_block(medium, observer, (alpha, beta), times, scratch)?;
        }
        let mut path = core::mem::take(&mut scratch.path);
        for k in 0..rays {
            if scratch.sights[k].by_steps {
                let ray = self.view.ray(&self.hole, alpha[k], beta[k])?;
                scratch.sights[k] = self.trace_steps(&ray, &mut path, &mut scratch.hits);
                if let Some(medium) = medium {
                    self.fill_path(medium, &path, k, times, scratch);
                }
            }
            self.look_along(k, (alpha[k], beta[k]), times, &path, scratch, seen)?;
        }
        scratch.path = path;
        Ok(())
    }

    /// The observer, if it is one whose rays are to be had in closed form.
    fn closed_form(&self) -> Option<&Observer> {
        match &self.view {
            View::Screen(observer) => {
                Some(observer).filter(|o| self.closed_form && NEAREST * o.inverse_radius() <= 1.0)
            }
            View::Camera(_) => None,
        }
    }

    /// What is seen along ray number `k`, of which everything is known but the light of the
    /// surfaces, the spots and the sky. `path` is its own if it was traced step by step.
    fn look_along(
        &self,
        k: usize,
        (x, y): (f64, f64),
        times: &[f64],
        path: &Path,
        scratch: &mut Scratch,
        seen: &mut [Glimpse],
    ) -> Result<(), OutOfRange> {
        let sight = scratch.sights[k].clone();
        let mut still = Gather::new();
        let hits = &scratch.hits[sight.hits.clone()];
        self.add_disc(hits, sight.lambda, sight.last_time(), &mut still);
        let sky = self.sky_light(x, y, &sight, scratch)?;
        let shift = self.redshift.and_then(|_| self.view.blueshift(x, y));
        for (j, time) in times.iter().enumerate() {
            let mut gather = still.clone();
            if let (Some(gas), Some(light)) =
                (&self.gas, scratch.volume.lights.get(k * times.len() + j))
            {
                gather.add_light(light, gas.color());
            }
            if sight.by_steps {
                self.add_spots(*time, path, scratch, sight.last_time(), &mut gather);
            }
            gather.add_behind(sky);
            let Some(place) = seen.get_mut(j * scratch.sights.len() + k) else { continue };
            *place = glimpse(&sight, gather);
            if let (Some(index), Some(shift)) = (self.redshift, shift) {
                place.receive(shift, index);
            }
        }
        Ok(())
    }

    /// Light of the sky at the end of a ray, dark if it does not get there.
    fn sky_light(
        &self,
        x: f64,
        y: f64,
        sight: &Sight,
        scratch: &mut Scratch,
    ) -> Result<[f32; 3], OutOfRange> {
        let (Some(sky), Some(direction), None) = (&self.sky, sight.exit, sight.surface) else {
            return Ok([0.0; 3]);
        };
        if sight.until < sight.total {
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
        Ok(sky.look(direction))
    }

    /// When the light that is seen at `time` passed a point.
    fn emission_time(&self, time: f64, point: &PathPoint) -> f64 {
        if self.slow_light { time - point.delay } else { time }
    }
}

/// The sum of everything along a ray.
fn glimpse(sight: &Sight, gather: Gather) -> Glimpse {
    let fate = match (sight.surface, sight.end) {
        (Some(_), _) => Fate::Surface,
        (None, End::Captured) => Fate::Captured,
        (None, End::Escaped) => Fate::Escaped,
        (None, End::Unresolved) => Fate::Unresolved,
    };
    let mean = if gather.intensity > 0.0 { gather.shift / gather.intensity } else { 0.0 };
    Glimpse {
        intensity: gather.intensity,
        rgb: gather.rgb,
        redshift: mean,
        crossings: sight.crossings,
        radius: gather.place.radius,
        azimuth: wrap(gather.place.azimuth),
        delay: gather.place.delay,
        optical_depth: gather.depth,
        fate,
    }
}

/// Distance of neighbouring rays on the screen.
fn ray_spacing(scene: &Scene) -> f64 {
    scene.pixel_size() / f64::from(scene.screen.samples_per_pixel.isqrt())
}
