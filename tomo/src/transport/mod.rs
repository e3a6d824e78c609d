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
mod volume;

pub use glimpse::{Fate, Glimpse};
pub use medium::{Emission, Medium, Moment, Needs};

use crate::emission::disc::DiscModel;
use crate::emission::gas::{GasEffects, GasModel};
use crate::emission::sky::{Panorama, SkyModel};
use crate::emission::spot::SpotModel;
use crate::scene::{Integrator, Scene};
use glimpse::{Gather, wrap};
use kerrlight_geodesic::bundle::{Crossings, Nodes, Samples};
use kerrlight_geodesic::{Inclination, Kerr, Observer, OutOfRange, Path, PathPoint, Tracer};
use rays::{End, Sight};
use surface::Hit;

/// A scene with everything computed that does not depend on the ray.
#[derive(Debug, Clone)]
pub struct Stage {
    /// The hole.
    pub hole: Kerr,
    /// The observer.
    pub observer: Observer,
    tracer: Tracer,
    time: f64,
    /// Spectral index α, if redshift is simulated.
    redshift: Option<f64>,
    slow_light: bool,
    /// The last number of half-orbits that is seen.
    half_orbits: Option<u32>,
    tolerance: f64,
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
}

/// Memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct Scratch {
    path: Path,
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
        let inclination = Inclination::from_degrees(scene.observer.inclination_deg)?;
        let observer = if scene.observer.radius.is_finite() {
            Observer::at_radius(inclination, scene.observer.radius)?
        } else {
            Observer::at_infinity(inclination)
        };
        let kept = |name: &str| {
            let channels = scene.screen.channels.as_ref();
            channels.is_none_or(|channels| channels.iter().any(|channel| channel == name))
        };
        let redshift = scene.effects.redshift.then_some(scene.effects.spectral_index).flatten();
        let effects = GasEffects { redshift, absorption: scene.effects.absorption };
        let length = 100.0 * crate::units::SPEED_OF_LIGHT;
        let length = length * crate::units::gravitational_time(scene.hole.mass_msun);
        let gas = scene.gas.as_ref().map(|gas| GasModel::new(gas, &hole, length, effects));
        let closed_form = scene.tracer.integrator == Integrator::Elliptic
            && 1.0 / observer.inverse_radius() >= NEAREST;
        Ok(Stage {
            hole,
            observer: observer.with_azimuth(scene.observer.azimuth_deg.to_radians()),
            tracer: Tracer::with_method(scene.tracer.integrator.method(), scene.tracer.tolerance)?,
            time: scene.observer.time,
            redshift,
            slow_light: scene.effects.slow_light,
            half_orbits: scene.effects.half_orbits,
            tolerance: scene.tracer.tolerance,
            closed_form,
            steps_for_all: !scene.spot.is_empty(),
            places: Needs { azimuth: kept("azimuth"), time: kept("delay"), velocity: false },
            gas,
            disc: scene.disc.as_ref().map(|disc| DiscModel::new(disc, &hole)),
            spots: scene.spot.iter().map(|spot| SpotModel::new(spot, &hole)).collect(),
            sky: scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, picture)),
        })
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
        if self.closed_form {
            self.trace_block(alpha, beta, scratch)?;
        } else {
            scratch.sights.resize(rays, Sight { by_steps: true, ..Sight::default() });
        }
        let medium = self.gas.as_ref().map(|gas| gas as &dyn Medium);
        scratch.volume.reset(medium.map_or(0, |_| rays * times.len()));
        if let (Some(medium), true) = (medium, self.closed_form) {
            self.fill_block(medium, (alpha, beta), times, scratch)?;
        }
        let mut path = core::mem::take(&mut scratch.path);
        for k in 0..rays {
            if scratch.sights[k].by_steps {
                let ray = self.observer.ray(&self.hole, alpha[k], beta[k])?;
                scratch.sights[k] = self.trace_steps(&ray, &mut path, &mut scratch.hits);
                if let Some(medium) = medium {
                    self.fill_path(medium, &path, k, times, scratch);
                }
            }
            self.look_along(k, times, &path, scratch, seen);
        }
        scratch.path = path;
        Ok(())
    }

    /// What is seen along ray number `k`, of which everything is known but the light of the
    /// surfaces and the spots. `path` is its own if it was traced step by step.
    fn look_along(
        &self,
        k: usize,
        times: &[f64],
        path: &Path,
        scratch: &mut Scratch,
        seen: &mut [Glimpse],
    ) {
        let sight = scratch.sights[k].clone();
        let mut still = Gather::new();
        let hits = &scratch.hits[sight.hits.clone()];
        self.add_disc(hits, sight.lambda, sight.last_time(), &mut still);
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
            if let Some(place) = seen.get_mut(j * scratch.sights.len() + k) {
                *place = self.glimpse(&sight, gather);
            }
        }
    }

    /// The sum of everything and the sky.
    fn glimpse(&self, sight: &Sight, mut gather: Gather) -> Glimpse {
        let fate = match (sight.surface, sight.end) {
            (Some(_), _) => Fate::Surface,
            (None, End::Captured) => Fate::Captured,
            (None, End::Escaped) => Fate::Escaped,
            (None, End::Unresolved) => Fate::Unresolved,
        };
        if let (Some(sky), Some(direction), None) = (&self.sky, sight.exit, sight.surface)
            && sight.until >= sight.total
        {
            let through = (-gather.depth).exp() as f32;
            for (channel, light) in gather.rgb.iter_mut().zip(sky.look(direction)) {
                *channel += through * light;
            }
        }
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

    /// When the light that is seen at `time` passed a point.
    fn emission_time(&self, time: f64, point: &PathPoint) -> f64 {
        if self.slow_light { time - point.delay } else { time }
    }
}
