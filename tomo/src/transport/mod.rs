//! The only place where a pixel is a sum: light of every source along one ray.
//!
//! Rays come in blocks ([`rays`](self)): in closed form on SIMD lanes where that is asked for and
//! keeps its digits, else step by step.

mod bare;
mod cells;
mod chord;
mod meshes;
mod meter;
mod polarized;
mod quadrature;
mod ray;
mod rays;
mod result;
mod spots;
mod straight;
mod surface;
#[cfg(test)]
mod tests;
mod tree;
mod view;
mod volume;

pub use meter::Meter;
pub use result::{Fate, RayResult};
pub use view::View;

use crate::emission::disc::DiscModel;
use crate::emission::gas::{GasEffects, GasModel};
use crate::emission::medium::{Medium, Part};
use crate::emission::mesh::{MeshFile, MeshModel};
use crate::emission::sky::{Panorama, SkyModel};
use crate::emission::spot::SpotModel;
use crate::emission::volume::VolumeModel;
use crate::scene::{Integrator, Scene};
use crate::volume::VolumeFile;
use kerrlight_geodesic::simd::{Crossings, Nodes, Samples};
use kerrlight_geodesic::{
    Kerr, OutOfRange, Path, PathPoint, Quantities, Tracer, footprint::Number,
};
use meshes::{Hit as MeshHit, MeshTree};
use polarized::Polarization;
use rays::TracedRay;
use spots::{Met, SpotSpans, SpotTree};
use std::sync::{Arc, Mutex};
use surface::Hit;
use tree::WalkScratch;

/// A scene with everything computed that does not depend on the ray.
#[derive(Debug, Clone)]
pub struct PreparedScene {
    /// The hole.
    pub hole: Kerr,
    /// The observer or the camera.
    pub view: View,
    tracer: Tracer,
    tolerance: f64,
    time: f64,
    /// Spectral index α, if redshift is simulated.
    spectral_index: Option<f64>,
    slow_light: bool,
    lensing: bool,
    polarization: Option<Polarization>,
    /// The last number of half-orbits that is seen.
    half_orbits: Option<u32>,
    /// Whether rays are traced in closed form where possible.
    closed_form: bool,
    /// What is told of the brightest contribution.
    places: Quantities,
    disc: Option<DiscModel>,
    /// What fills space.
    media: Vec<Arc<dyn Medium>>,
    spots: Vec<SpotModel>,
    /// Trees over the spots by time of observation, the latest last.
    spot_trees: Arc<Mutex<SpotTrees>>,
    /// Trees over the spots by time of emission, with slow light.
    spot_spans: Option<Arc<SpotSpans>>,
    meshes: Option<Arc<MeshTree>>,
    one_by_one: bool,
    /// Whether rays of the closed form have nothing to ask but a disc and the sky.
    bare: bool,
    sky: Option<SkyModel>,
    /// Distance of neighbouring rays on the screen, if the sky is averaged over their beams.
    beams: Option<f64>,
}

/// The decoded files that a scene names.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    /// The picture of a `[sky.image]`.
    pub sky: Option<Panorama>,
    /// A file for each `[[mesh]]`, in their order.
    pub meshes: Vec<MeshFile>,
    /// A file for each `[[volume]]`, in their order.
    pub volumes: Vec<VolumeFile>,
}

impl From<Option<Panorama>> for Assets {
    fn from(sky: Option<Panorama>) -> Self {
        Assets { sky, ..Assets::default() }
    }
}

/// Trees with the time that they are for.
type SpotTrees = Vec<(f64, Arc<SpotTree>)>;

/// Trees that are kept: as many as a movie's block of frames may need at once.
const MOST_TREES: usize = 256;

/// Memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct Scratch {
    path: Path,
    beam: Path<Number>,
    intervals: Vec<[f64; 2]>,
    crossings: Crossings,
    nodes: Nodes,
    samples: Samples,
    traced: Vec<TracedRay>,
    hits: Vec<Hit>,
    volume: volume::Workspace,
    walk: WalkScratch,
    met: Vec<Met>,
    pieces: Vec<[f64; 2]>,
    mesh_hits: Vec<MeshHit>,
    /// Where the time goes; off unless it is replaced.
    pub meter: Meter,
}

/// Where the SIMD kernels can have an observer, in M.
const NEAREST: f64 = 10.0;

/// Relative size of features with sharp edges, as far as photon rings go: the error of a ring with two
/// edges is a few hundredths of it.
const SHARP: f64 = 0.1;

/// Photon rings of what is smaller are sampled as if it were as large as this, of what is larger, as this.
const FINEST: f64 = 0.03;
const SMOOTH: f64 = 0.5;

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

fn media(
    scene: &Scene,
    files: &[VolumeFile],
    hole: &Kerr,
) -> Result<Vec<Arc<dyn Medium>>, OutOfRange> {
    if files.len() != scene.volume.len() {
        let (value, allowed) = (files.len() as f64, "one file for each [[volume]]");
        return Err(OutOfRange { field: "number of volume files", value, allowed });
    }
    let spectral_index = scene.effects.index();
    let effects = GasEffects { spectral_index, absorption: scene.effects.absorption };
    let length = 100.0 * crate::units::SPEED_OF_LIGHT;
    let length = length * scene.hole.seconds().unwrap_or(f64::NAN); // of gas, which needs it
    let mut media: Vec<Arc<dyn Medium>> = Vec::new();
    if let Some(gas) = &scene.gas {
        media.push(Arc::new(GasModel::new(gas, hole, length, effects)));
    }
    let effects = (spectral_index, scene.effects.slow_light);
    for (source, file) in scene.volume.iter().zip(files) {
        media.push(Arc::new(VolumeModel::new(source, file, hole, effects)?));
    }
    Ok(media)
}

impl PreparedScene {
    /// The prepared scene of a scene with the files that it names.
    ///
    /// # Errors
    /// If a value is outside its range (a parsed [`Scene`] never is), if there is not one file for
    /// each mesh, or if a mesh's vertex comes to lie too far out.
    pub fn new(scene: &Scene, assets: impl Into<Assets>) -> Result<Self, OutOfRange> {
        let assets: Assets = assets.into();
        let hole = Kerr::new(scene.hole.spin)?;
        let kept = |name: &str| scene.screen.keeps(name);
        let spectral_index = scene.effects.index();
        let view = View::new(scene, &hole)?;
        let sky = scene.sky.as_ref().and_then(|sky| SkyModel::new(sky, assets.sky));
        let spots: Vec<_> = scene.spot.iter().map(|spot| SpotModel::new(spot, &hole)).collect();
        let slow_spots = scene.effects.slow_light.then_some(&spots[..]);
        Ok(PreparedScene {
            bare: bare::is_bare(scene),
            spot_spans: slow_spots.and_then(SpotSpans::new).map(Arc::new),
            spots,
            hole,
            view,
            tracer: Tracer::with_method(scene.tracer.integrator.method(), scene.tracer.tolerance)?,
            time: scene.observer.time,
            spectral_index,
            slow_light: scene.effects.slow_light,
            lensing: scene.effects.lensing,
            polarization: Polarization::new(scene)?,
            half_orbits: scene.effects.half_orbits,
            tolerance: scene.tracer.tolerance,
            closed_form: scene.tracer.integrator == Integrator::Elliptic,
            places: Quantities { azimuth: kept("azimuth"), time: kept("delay"), velocity: false },
            media: media(scene, &assets.volumes, &hole)?,
            disc: scene.disc.as_ref().map(|disc| DiscModel::new(disc, &hole)),
            spot_trees: Arc::default(),
            meshes: mesh_tree(scene, &assets.meshes, &hole)?,
            one_by_one: false,
            sky: sky.map(|sky| if scene.effects.ray_bundles { sky.for_beams() } else { sky }),
            beams: scene.effects.ray_bundles.then(|| ray_spacing(scene)),
        })
    }

    /// The same prepared scene seen at another time by a camera that moves; `scene` is the one that it was
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

    /// The same prepared scene, on which every spot and every triangle is asked along every ray, without
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
        self.spectral_index.is_some()
    }

    /// Whether light is polarised, and whether circularly too.
    pub fn polarization(&self) -> [bool; 2] {
        let circular = self.polarization.as_ref().map(Polarization::is_circular);
        [circular.is_some(), circular == Some(true)]
    }

    /// Whether anything absorbs.
    pub fn absorbs(&self) -> bool {
        self.media.iter().any(|medium| medium.absorbs())
    }

    /// Spacing of rays, in the logarithm of their distance from the critical curve, that resolves what
    /// shines in its images of higher order; none where there are no such images.
    pub fn ring_spacing(&self) -> Option<f64> {
        if !self.lensing || self.half_orbits == Some(0) {
            return None;
        }
        let edges = self.disc.is_some() || self.meshes.is_some();
        let spots = self.spots.iter().map(SpotModel::relative_size);
        let media = self.media.iter().map(|medium| medium.relative_size());
        let finest = spots.chain(media).chain(edges.then_some(SHARP)).reduce(f64::min)?;
        Some(finest.clamp(FINEST, SMOOTH))
    }

    /// Whether there is a disc that hides what is behind it.
    pub fn has_opaque_disc(&self) -> bool {
        self.disc.as_ref().is_some_and(|disc| disc.opaque)
    }

    /// The tree over the spots for a time of observation. With slow light one tree serves all, of
    /// which only the shell is asked where there are trees for spans of time; without, each time
    /// has its own. It is made when it is first asked for.
    fn spot_tree(&self, time: f64) -> Option<Arc<SpotTree>> {
        if self.spots.is_empty() || self.one_by_one {
            return None;
        }
        let (key, at) = if self.slow_light { (0.0, None) } else { (time, Some([time; 2])) };
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

/// Distance of neighbouring rays on the screen.
fn ray_spacing(scene: &Scene) -> f64 {
    scene.pixel_size() / f64::from(scene.screen.samples_per_pixel.isqrt())
}
