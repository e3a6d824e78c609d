//! The only place where a pixel is a sum: light of every source along one ray.

use crate::emission::disc::DiscModel;
use crate::emission::sky::{Panorama, SkyModel};
use crate::emission::spot::{Comoving, SpotModel};
use crate::scene::Scene;
use kerrlight_geodesic::flow::{keplerian_redshift, rotating_redshift};
use kerrlight_geodesic::quadrature::gauss_4;
use kerrlight_geodesic::{
    Inclination, Kerr, Observer, OutOfRange, Outcome, Path, PathPoint, Ray, Tracer, Want,
};

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
    disc: Option<DiscModel>,
    spots: Vec<SpotModel>,
    sky: Option<SkyModel>,
}

/// What became of a pixel's ray, as written into the `outcome` channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// Fell into the hole (0).
    Captured = 0,
    /// Reached the sky (1).
    Escaped = 1,
    /// Met an opaque surface (2).
    Surface = 2,
    /// Was given up (3).
    Unresolved = 3,
}

/// What one ray sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glimpse {
    /// Intensity of all emission (the sky left out), in the scene's unit.
    pub intensity: f64,
    /// Linear colour: emission and sky.
    pub rgb: [f32; 3],
    /// Intensity-weighted mean of g over the emission; 0 where there is none.
    pub redshift: f64,
    /// Number of crossings of the equatorial plane outside the horizon, along the whole ray.
    pub crossings: u32,
    /// Radius of the brightest contribution; 0 where there is none.
    pub radius: f64,
    /// Azimuth of the brightest contribution in \[−π, π\]; 0 where there is none.
    pub azimuth: f64,
    /// Delay of the brightest contribution in M; 0 where there is none.
    pub delay: f64,
    /// What became of the ray.
    pub fate: Fate,
}

/// Light gathered along one ray.
struct Gather {
    intensity: f64,
    shift: f64,
    rgb: [f32; 3],
    brightest: f64,
    radius: f64,
    azimuth: f64,
    delay: f64,
}

impl Gather {
    fn new() -> Self {
        Gather {
            intensity: 0.0,
            shift: 0.0,
            rgb: [0.0; 3],
            brightest: 0.0,
            radius: 0.0,
            azimuth: 0.0,
            delay: 0.0,
        }
    }

    /// Adds intensity that is shifted by g.
    fn add(&mut self, intensity: f64, g: f64, color: [f32; 3]) {
        self.intensity += intensity;
        self.shift += g * intensity;
        for (channel, tint) in self.rgb.iter_mut().zip(color) {
            *channel += tint * intensity as f32;
        }
    }

    /// Remembers where the brightest contribution comes from.
    fn mark(&mut self, brightness: f64, point: &PathPoint) {
        if brightness > self.brightest {
            self.brightest = brightness;
            self.radius = point.radius();
            self.azimuth = wrap(point.azimuth);
            self.delay = point.delay;
        }
    }
}

/// Into \[−π, π\].
fn wrap(angle: f64) -> f64 {
    use core::f64::consts::TAU;
    angle - TAU * (angle / TAU).round()
}

/// Memory that is reused from ray to ray.
#[derive(Debug, Default)]
pub struct Scratch {
    path: Path,
    intervals: Vec<[f64; 2]>,
}

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
        Ok(Stage {
            hole,
            observer: observer.with_azimuth(scene.observer.azimuth_deg.to_radians()),
            tracer: Tracer::with_method(scene.tracer.integrator.method(), scene.tracer.tolerance)?,
            time: scene.observer.time,
            redshift: scene.effects.redshift.then_some(scene.effects.spectral_index).flatten(),
            slow_light: scene.effects.slow_light,
            disc: scene.disc.as_ref().map(|disc| DiscModel::new(disc, &hole)),
            spots: scene.spot.iter().map(|spot| SpotModel::new(spot, &hole)).collect(),
            sky: scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, picture)),
        })
    }

    /// Whether g is computed.
    pub fn has_redshift(&self) -> bool {
        self.redshift.is_some()
    }

    /// What is seen at (α, β).
    ///
    /// # Errors
    /// If no ray with these coordinates reaches the observer.
    pub fn look(
        &self,
        alpha: f64,
        beta: f64,
        scratch: &mut Scratch,
    ) -> Result<Glimpse, OutOfRange> {
        let ray = self.observer.ray(&self.hole, alpha, beta)?;
        self.tracer.trace(&self.hole, &ray, Want::ALL, &mut scratch.path);
        let mut gather = Gather::new();
        let surface = self.add_disc(&ray, &scratch.path, &mut gather);
        let end = surface.unwrap_or_else(|| scratch.path.mino_total());
        self.add_spots(scratch, end, &mut gather);
        let path = &scratch.path;
        let fate = match (surface, path.outcome()) {
            (Some(_), _) => Fate::Surface,
            (None, Outcome::Captured) => Fate::Captured,
            (None, Outcome::Escaped) => Fate::Escaped,
            (None, Outcome::Unresolved(_)) => Fate::Unresolved,
        };
        if let (Some(sky), Fate::Escaped) = (&self.sky, fate) {
            let seen = sky.look(path.at(path.mino_total()).direction);
            for (channel, light) in gather.rgb.iter_mut().zip(seen) {
                *channel += light;
            }
        }
        let mean = if gather.intensity > 0.0 { gather.shift / gather.intensity } else { 0.0 };
        Ok(Glimpse {
            intensity: gather.intensity,
            rgb: gather.rgb,
            redshift: mean,
            crossings: path.equatorial_crossings().len() as u32,
            radius: gather.radius,
            azimuth: gather.azimuth,
            delay: gather.delay,
            fate,
        })
    }

    /// Light of the disc: I = g^{3+α} I_em at every crossing up to the first that hides the
    /// rest, whose Mino time is returned.
    fn add_disc(&self, ray: &Ray, path: &Path, gather: &mut Gather) -> Option<f64> {
        let disc = self.disc.as_ref()?;
        for mino_time in path.equatorial_crossings() {
            let point = path.at(mino_time);
            let r = point.radius();
            if !disc.covers(r) {
                continue;
            }
            let g = match self.redshift {
                Some(_) => keplerian_redshift(&self.hole, r, ray.lambda).unwrap_or(0.0),
                None => 1.0,
            };
            let boost = self.redshift.map_or(1.0, |index| g.powf(3.0 + index));
            let intensity = boost * disc.intensity(r);
            gather.add(intensity, g, disc.color);
            gather.mark(intensity, &point);
            if disc.opaque {
                return Some(mino_time);
            }
        }
        None
    }

    /// Light of the spots between the observer and Mino time `end`: ∫ g^{2+α} j Σ dτ.
    fn add_spots(&self, scratch: &mut Scratch, end: f64, gather: &mut Gather) {
        for spot in &self.spots {
            let [lo, hi] = spot.shell();
            let lo = lo.max(self.hole.horizon());
            let mut total = SpotLight { spot, before: gather.intensity, brightest: None };
            scratch.path.intervals_within(lo, hi, &mut scratch.intervals);
            for &[from, to] in &scratch.intervals {
                let to = to.min(end);
                if from < to {
                    self.add_stretch(&scratch.path, &mut total, from, to, gather);
                }
            }
            if let Some((_, point)) = total.brightest {
                gather.mark(gather.intensity - total.before, &point);
            }
        }
    }

    /// A stretch of the path inside the spot's shell, cut so that no piece turns by much.
    fn add_stretch(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        from: f64,
        to: f64,
        gather: &mut Gather,
    ) {
        let pieces = ((to - from) * path.angular_rate() / LARGEST_TURN).ceil().max(1.0);
        let step = (to - from) / pieces;
        let mut start = self.node(light.spot, path.at(from));
        for k in 1..=pieces as usize {
            let end = self.node(light.spot, path.at(from + step * k as f64));
            self.add_piece(path, light, [&start, &end], 0, gather);
            start = end;
        }
    }

    fn node(&self, spot: &SpotModel, point: PathPoint) -> SpotNode {
        let (position, time) = (point.cartesian(), self.emission_time(&point));
        SpotNode { point, position, time, carried: spot.comoving(position, time) }
    }

    /// Halves a piece until it is short against the spot or lies outside of it, then sums.
    fn add_piece(
        &self,
        path: &Path,
        light: &mut SpotLight<'_>,
        [start, end]: [&SpotNode; 2],
        depth: u32,
        gather: &mut Gather,
    ) {
        let carried = [&start.carried, &end.carried];
        let length = light.spot.comoving_length([start.position, end.position], carried);
        if light.spot.is_missed(carried, length) {
            return;
        }
        let (from, to) = (start.point.mino_time, end.point.mino_time);
        if length > light.spot.sigma() && depth < DEEPEST {
            let middle = self.node(light.spot, path.at(0.5 * (from + to)));
            self.add_piece(path, light, [start, &middle], depth + 1, gather);
            self.add_piece(path, light, [&middle, end], depth + 1, gather);
            return;
        }
        for (mino_time, weight) in gauss_4(from, to) {
            self.add_node(&self.node(light.spot, path.at(mino_time)), weight, light, gather);
        }
    }

    /// One node of the quadrature.
    fn add_node(
        &self,
        node: &SpotNode,
        weight: f64,
        light: &mut SpotLight<'_>,
        gather: &mut Gather,
    ) {
        let emissivity = light.spot.emissivity(&node.carried, node.time);
        if emissivity <= 0.0 {
            return;
        }
        let point = &node.point;
        let r = point.radius();
        let g = match self.redshift {
            Some(_) => rotating_redshift(&self.hole, point, light.spot.angular_velocity(r)),
            None => Some(1.0),
        };
        // Where matter cannot move like this there is none.
        let Some(g) = g else { return };
        let boost = self.redshift.map_or(1.0, |index| g.powf(2.0 + index));
        let path_length = self.hole.sigma(r, point.cos_theta()) * weight;
        gather.add(boost * emissivity * path_length, g, light.spot.color);
        let density = boost * emissivity;
        if light.brightest.is_none_or(|(most, _)| density > most) {
            light.brightest = Some((density, *point));
        }
    }

    fn emission_time(&self, point: &PathPoint) -> f64 {
        if self.slow_light { self.time - point.delay } else { self.time }
    }
}

/// One spot's light along one ray.
struct SpotLight<'a> {
    spot: &'a SpotModel,
    /// Intensity gathered before this spot.
    before: f64,
    /// The brightest point, and its emission per length.
    brightest: Option<(f64, PathPoint)>,
}

/// A point of the path as a spot sees it.
struct SpotNode {
    point: PathPoint,
    position: [f64; 3],
    /// When the light that is seen passed here.
    time: f64,
    carried: Comoving,
}

/// Largest angle in radians by which a piece of path may turn before it is compared with
/// a spot.
const LARGEST_TURN: f64 = 0.5;

/// A piece is halved at most this often.
const DEEPEST: u32 = 24;
