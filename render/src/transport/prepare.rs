//! Preparation of a scene: everything that can be computed before any ray.

use super::layers::{Numbering, Wanted};
use super::optics::Optics;
use super::polarized::Polarization;
use super::sources::disc::CROSSINGS;
use super::sources::media::Media;
use super::sources::meshes::Meshes;
use super::sources::sky::Sky;
use super::sources::spots::Spots;
use crate::Error;
use crate::emission::disc::DiscModel;
use crate::emission::mesh::MeshFile;
use crate::emission::sky::{Catalogue, Panorama, SkyModel};
use crate::scene::Scene;
use crate::volume::VolumeFile;
use kerrlight_geodesic::{
    BlockRequest, BlockTracer, Inclination, Kerr, Observer, Quantities, RayDevice, View,
};
use std::sync::Arc;

/// A scene with everything computed that does not depend on the ray.
///
/// Use it to ask what single rays see, or to drive a renderer of your own: preparing costs what the
/// scene's files and tables need (milliseconds for a disc), [`observe_block`](Self::observe_block)
/// a few microseconds a ray where the closed form applies. It is `Sync`: each thread brings its own
/// [`Scratch`](super::Scratch). Intensities are in scene units, radii and delays in M.
///
/// ```
/// use kerrlight_render::scene::Scene;
/// use kerrlight_render::transport::{PreparedScene, Scratch};
///
/// let scene = Scene::parse(r#"
///     hole = { spin = 0.9 }
///     observer = { inclination_deg = 60.0 }
///     screen = { field_of_view_m = 30.0, width = 64 }
///     effects = { redshift = true, spectral_index = 0.0 }
///     tracer = { integrator = "elliptic", tolerance = 1e-8 }
///     disc = { outer_edge = 20.0, peak_intensity = 1.0, opaque = true }
/// "#)?;
/// let prepared = PreparedScene::new(&scene, None)?;
/// // α = −6 M, β = 2 M, at the scene's own time of observation.
/// let seen = prepared.observe(-6.0, 2.0, &mut Scratch::default())?;
/// assert!(seen.intensity > 0.0 && seen.redshift > 1.0); // the side that approaches
/// # Ok::<(), kerrlight_render::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PreparedScene {
    pub(super) optics: Optics,
    pub(super) tracer: BlockTracer,
    pub(super) request: BlockRequest,
    /// The request for blocks in which spots are sighted.
    pub(super) sighting: BlockRequest,
    /// Time of observation, in M.
    pub(super) time: f64,
    pub(super) disc: Option<DiscModel>,
    pub(super) media: Media,
    pub(super) meshes: Option<Arc<Meshes>>,
    pub(super) spots: Spots,
    pub(super) sky: Option<Sky>,
}

/// The decoded files that a scene names.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    /// The picture of a `[sky.image]`.
    pub sky: Option<Panorama>,
    /// The stars of a `[sky.catalogue]`.
    pub stars: Option<Catalogue>,
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

/// Relative size of features with sharp edges, as far as photon rings go: the error of a ring with two
/// edges is a few hundredths of it.
const SHARP: f64 = 0.1;

/// Photon rings of what is smaller are sampled as if it were as large as this, of what is larger, as this.
const FINEST: f64 = 0.03;
const SMOOTH: f64 = 0.5;

/// The view of a scene.
///
/// # Errors
/// If a value is outside its range.
pub(crate) fn view(scene: &Scene, hole: &Kerr) -> Result<View, Error> {
    if let Some(camera) = &scene.camera {
        return Ok(View::Camera(camera.camera(hole, scene.observer.time)?));
    }
    let observer = &scene.observer;
    let inclination = Inclination::from_degrees(observer.inclination_deg)?;
    let placed = if observer.radius.is_finite() {
        Observer::at_radius(inclination, observer.radius)?
    } else {
        Observer::at_infinity(inclination)
    };
    Ok(View::Screen(placed.with_azimuth(observer.azimuth_deg.to_radians())))
}

impl Optics {
    fn new(scene: &Scene) -> Result<Self, Error> {
        let hole = Kerr::new(scene.hole.spin)?;
        let kept = |name: &str| scene.screen.keeps(name);
        Ok(Optics {
            view: view(scene, &hole)?,
            hole,
            tolerance: scene.tracer.tolerance,
            spectral_index: scene.effects.index(),
            slow_light: scene.effects.slow_light,
            lensing: scene.effects.lensing,
            one_by_one: false,
            recorded: Quantities { azimuth: kept("azimuth"), time: kept("delay"), velocity: false },
            polarization: Polarization::new(scene)?,
            wanted: Wanted::new(scene),
            numbering: Numbering::new(scene),
        })
    }
}

impl PreparedScene {
    /// Prepares a scene with the files that it names.
    ///
    /// # Errors
    /// If a value is outside its range (a parsed [`Scene`] never is), if there is not one file for
    /// each mesh and each volume, or if a mesh's vertex comes to lie too far out.
    pub fn new(scene: &Scene, assets: impl Into<Assets>) -> Result<Self, Error> {
        let assets: Assets = assets.into();
        let optics = Optics::new(scene)?;
        let (hole, settings) = (optics.hole, &scene.tracer);
        let tracer = BlockTracer::new(hole, optics.view, settings.integrator, settings.tolerance)?;
        let mut prepared = PreparedScene {
            tracer,
            request: BlockRequest::default(),
            sighting: BlockRequest::default(),
            time: scene.observer.time,
            disc: scene.disc.as_ref().map(|disc| DiscModel::new(disc, &hole)),
            media: Media::new(scene, &assets.volumes, &hole)?,
            meshes: Meshes::new(scene, &assets.meshes, &hole)?.map(Arc::new),
            spots: Spots::new(scene, &hole),
            sky: Sky::new(scene, assets.sky, assets.stars),
            optics,
        };
        prepared.request = prepared.needs(scene.effects.half_orbits);
        prepared.sighting = prepared.sighting();
        Ok(prepared)
    }

    /// Returns the quantities needed of each ray.
    fn needs(&self, half_orbits: Option<u32>) -> BlockRequest {
        BlockRequest {
            crossings: if self.disc.is_some() { CROSSINGS } else { 0 },
            all_crossings: self.disc.is_some(),
            // dw/dτ tells whether light of plunging matter moves outward; its g depends on it.
            rates: self.optics.polarization.is_some()
                || self.disc.as_ref().is_some_and(DiscModel::plunges),
            // The closed form ends at the radius of an observer, light comes from beyond it.
            exit: self.sky.is_some()
                || self.optics.wanted.exit
                || self.optics.wanted.footprint
                || self.shines_beyond_observer(),
            beams: self.optics.lensing && self.sky.as_ref().is_some_and(Sky::is_averaged),
            half_orbits,
            paths: self.meshes.is_some() || self.media.have_cells() || !self.spots.is_empty(),
            probes: None,
            samples: 0,
            nodes: self.media.nodes(&self.optics),
        }
    }

    /// Returns whether a disc, gas or spots reach farther out than a screen at a finite radius.
    fn shines_beyond_observer(&self) -> bool {
        let disc = self.disc.as_ref().map(|disc| disc.edges()[1]);
        let media = self.media.nodes(&self.optics).into_iter().map(|nodes| nodes.request.radius);
        let spots = (!self.spots.is_empty()).then(|| self.spots.probes(&self.optics).radius);
        let reach = media.chain(disc).chain(spots).fold(0.0, f64::max);
        self.optics.view.observer().is_some_and(|observer| reach * observer.inverse_radius() > 1.0)
    }

    /// The same where spots are sighted: see [`Spots::sight`].
    fn sighting(&self) -> BlockRequest {
        BlockRequest {
            paths: self.meshes.is_some() || self.media.have_cells(),
            probes: Some(self.spots.probes(&self.optics)),
            ..self.request.clone()
        }
    }

    /// Moves to another time of observation, and with it a camera that moves; `scene` is the one
    /// that this was made of, but for its time of observation.
    ///
    /// # Errors
    /// If the camera is impossible there.
    pub fn move_to(&mut self, scene: &Scene) -> Result<(), Error> {
        self.optics.view = view(scene, &self.optics.hole)?;
        self.tracer = self.tracer.clone().with_view(self.optics.view);
        if let Some(sky) = &mut self.sky {
            sky.respace(scene);
        }
        self.time = scene.observer.time;
        Ok(())
    }

    /// The same scene with rays traced on a device: see [`BlockTracer::with_device`].
    pub fn with_device(self, device: Arc<dyn RayDevice>) -> Self {
        PreparedScene { tracer: self.tracer.with_device(device), ..self }
    }

    /// Returns the parts that are traced on this processor where rays are traced on a device.
    pub fn beside_device(&self) -> Vec<&'static str> {
        if !self.optics.lensing {
            return vec!["everything (lensing is off)"];
        }
        let wanted = self.optics.wanted;
        let parts = [
            (self.request.beams, "ray bundles on the sky"),
            (wanted.depth, "the channel Z"),
            (wanted.motion, "the channels motion"),
            (wanted.footprint, "the channel footprint"),
        ];
        parts.into_iter().filter_map(|(needed, what)| needed.then_some(what)).collect()
    }

    /// The same scene with every spot and every triangle asked along every ray, without a hierarchy:
    /// for comparisons.
    pub fn one_by_one(mut self) -> Self {
        self.optics.one_by_one = true;
        self
    }

    /// The hole.
    pub fn hole(&self) -> &Kerr {
        &self.optics.hole
    }

    /// The screen or the camera.
    pub fn view(&self) -> &View {
        &self.optics.view
    }

    /// The scene's own time of observation, in M.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Returns the tracer of its rays.
    pub fn tracer(&self) -> &BlockTracer {
        &self.tracer
    }

    /// Returns whether rays are bent.
    pub fn has_lensing(&self) -> bool {
        self.optics.lensing
    }

    /// The brightest light of the disc, if it were met, along the ray that arrives at (x, y).
    pub(crate) fn brightest_disc(&self, (x, y): (f64, f64)) -> f64 {
        let (Some(disc), Ok(ray)) = (&self.disc, self.optics.view.ray(&self.optics.hole, x, y))
        else {
            return 0.0;
        };
        let polarized = self.optics.polarized(x, y, ray.lambda);
        let light = disc.brightest(&self.optics, polarized, [ray.lambda, ray.eta]);
        let shift = self.optics.spectral_index.zip(self.optics.blueshift(x, y));
        shift.map_or(light, |(index, shift)| light * shift.powf(3.0 + index))
    }

    /// The sky.
    pub fn sky(&self) -> Option<&SkyModel> {
        self.sky.as_ref().map(Sky::model)
    }

    /// Returns whether g is computed.
    pub fn has_redshift(&self) -> bool {
        self.optics.spectral_index.is_some()
    }

    /// Returns whether light is polarised, and whether circularly too.
    pub fn polarization(&self) -> [bool; 2] {
        let circular = self.optics.polarization.as_ref().map(Polarization::is_circular);
        [circular.is_some(), circular == Some(true)]
    }

    /// Returns the layers of rays besides their light.
    pub(crate) fn wanted(&self) -> Wanted {
        self.optics.wanted
    }

    /// Returns whether anything shines or is opaque but the hole.
    pub fn has_sources(&self) -> bool {
        let solid = self.disc.is_some() || self.meshes.is_some();
        solid || self.media.len() > 0 || !self.spots.is_empty()
    }

    /// Returns whether anything absorbs.
    pub fn absorbs(&self) -> bool {
        self.media.absorb()
    }

    /// Returns whether there is a disc that hides what is behind it.
    pub fn has_opaque_disc(&self) -> bool {
        self.disc.as_ref().is_some_and(|disc| disc.opaque)
    }

    /// Spacing of rays, in the logarithm of their distance from the critical curve, that resolves what
    /// shines in its images of higher order; none where there are no such images.
    pub fn ring_spacing(&self) -> Option<f64> {
        if !self.optics.lensing || self.request.half_orbits == Some(0) {
            return None;
        }
        let edges = self.disc.is_some() || self.meshes.is_some();
        let media = self.media.iter().map(|medium| medium.relative_size());
        let sizes = self.spots.relative_sizes().chain(media).chain(edges.then_some(SHARP));
        Some(sizes.reduce(f64::min)?.clamp(FINEST, SMOOTH))
    }
}
