//! The only place where a pixel is a sum: light of every source along one ray.

mod chord;
mod glimpse;
mod meshes;
mod spots;
mod surface;
#[cfg(test)]
mod tests;
mod tree;

pub use glimpse::{Fate, Glimpse};

use crate::emission::disc::DiscModel;
use crate::emission::mesh::{MeshFile, MeshModel};
use crate::emission::sky::{Panorama, SkyModel};
use crate::emission::spot::SpotModel;
use crate::scene::Scene;
use glimpse::Gather;
use kerrlight_geodesic::{
    Inclination, Kerr, Observer, OutOfRange, Outcome, Path, PathPoint, Ray, Tracer, Want,
};
use meshes::{Hit, MeshTree};
use spots::{Met, SpotTree};
use std::sync::{Arc, Mutex};
use tree::WalkScratch;

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
    /// Trees over the spots by time of observation, the latest last.
    spot_trees: Arc<Mutex<SpotTrees>>,
    meshes: Option<Arc<MeshTree>>,
    one_by_one: bool,
    sky: Option<SkyModel>,
}

/// The decoded files that a scene names.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    /// The picture of a `[sky.image]`.
    pub sky: Option<Panorama>,
    /// A file for each `[[mesh]]`, in their order.
    pub meshes: Vec<MeshFile>,
}

impl From<Option<Panorama>> for Assets {
    fn from(sky: Option<Panorama>) -> Self {
        Assets { sky, meshes: Vec::new() }
    }
}

/// Trees with the time that they are for.
type SpotTrees = Vec<(f64, Arc<SpotTree>)>;

/// Trees that are kept: as many as a movie's block of frames may need at once.
const MOST_TREES: usize = 256;

/// Memory that is reused from ray to ray.
#[derive(Debug, Default)]
pub struct Scratch {
    path: Path,
    intervals: Vec<[f64; 2]>,
    walk: WalkScratch,
    met: Vec<Met>,
    pieces: Vec<[f64; 2]>,
    hits: Vec<Hit>,
}

fn mesh_tree(
    scene: &Scene,
    files: &[MeshFile],
    hole: &Kerr,
) -> Result<Option<Arc<MeshTree>>, OutOfRange> {
    if files.len() != scene.mesh.len() {
        let (value, allowed) = (files.len() as f64, "one file for each [[mesh]]");
        return Err(OutOfRange { field: "number of mesh files", value, allowed });
    }
    if files.is_empty() {
        return Ok(None);
    }
    let placed = scene.mesh.iter().zip(files).map(|(mesh, file)| MeshModel::new(mesh, file));
    Ok(Some(Arc::new(MeshTree::new(placed.collect::<Result<_, _>>()?, hole))))
}

impl Stage {
    /// The stage of a scene with the files that it names.
    ///
    /// # Errors
    /// If a value is outside its range (a parsed [`Scene`] never is), if there is not one file for
    /// each mesh, or if a mesh's vertex comes to lie too far out.
    pub fn new(scene: &Scene, assets: impl Into<Assets>) -> Result<Self, OutOfRange> {
        let assets: Assets = assets.into();
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
            spot_trees: Arc::default(),
            meshes: mesh_tree(scene, &assets.meshes, &hole)?,
            one_by_one: false,
            sky: scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, assets.sky)),
        })
    }

    /// The same stage, on which every spot and every triangle is asked along every ray, without
    /// a hierarchy: for comparisons.
    pub fn one_by_one(mut self) -> Self {
        self.one_by_one = true;
        self
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
        let trees: Vec<_> = times.iter().map(|time| self.spot_tree(*time)).collect();
        for (k, (alpha, beta)) in alpha.iter().zip(beta).enumerate() {
            let ray = self.observer.ray(&self.hole, *alpha, *beta)?;
            self.tracer.trace(&self.hole, &ray, Want::ALL, &mut scratch.path);
            let mut still = Gather::new();
            let hidden = self.meet_meshes(&ray, scratch);
            let end = hidden.unwrap_or(f64::INFINITY);
            let surface = self.add_disc(&ray, &scratch.path, end, &mut still).or(hidden);
            self.add_meshes(scratch, surface.unwrap_or(f64::INFINITY), &mut still);
            let places = seen.iter_mut().skip(k).step_by(rays);
            for ((time, tree), place) in times.iter().zip(&trees).zip(places) {
                let tree = tree.as_deref();
                *place = self.glimpse(*time, tree, &ray, still.clone(), surface, scratch);
            }
        }
        Ok(())
    }

    /// What one traced ray sees at one time; `still` is what does not depend on it.
    fn glimpse(
        &self,
        time: f64,
        tree: Option<&SpotTree>,
        ray: &Ray,
        mut gather: Gather,
        surface: Option<f64>,
        scratch: &mut Scratch,
    ) -> Glimpse {
        let end = surface.unwrap_or_else(|| scratch.path.mino_total());
        match tree {
            Some(tree) => self.add_spots(time, tree, ray, scratch, end, &mut gather),
            None => self.add_every_spot(time, scratch, end, &mut gather),
        }
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

    /// The tree over the spots for a time of observation. With slow light one tree serves all;
    /// without, each time has its own. It is made when it is first asked for.
    fn spot_tree(&self, time: f64) -> Option<Arc<SpotTree>> {
        if self.spots.is_empty() || self.one_by_one {
            return None;
        }
        let (key, at) = if self.slow_light { (0.0, None) } else { (time, Some(time)) };
        // Nothing that holds the lock can panic halfway through a change.
        let mut trees = self.spot_trees.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((_, tree)) = trees.iter().rev().find(|(of, _)| *of == key) {
            return Some(tree.clone());
        }
        let tree = Arc::new(SpotTree::new(&self.spots, &self.hole, at, time));
        if trees.len() >= MOST_TREES {
            trees.remove(0);
        }
        trees.push((key, tree.clone()));
        Some(tree)
    }

    /// When the light that is seen at `time` passed a point.
    fn emission_time(&self, time: f64, point: &PathPoint) -> f64 {
        if self.slow_light { time - point.delay } else { time }
    }
}
