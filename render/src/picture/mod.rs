//! Pictures of scenes: bands of rows, tile by tile on all cores, kept in a journal until the whole picture is there.
//! Every pixel is computed on its own, so the picture depends neither on the number of threads nor on the size of tiles
//! nor on interruptions.

mod adaptive;
mod bands;
mod channels;
mod choice;
mod film;
mod finish;
mod grid;
mod journal;
mod layers;
mod pixels;
mod placement;
mod raw;
mod rings;
mod tally;
mod workspace;

pub use channels::{CHANNELS, ChannelKind};
pub use journal::{AnyJournal, Found, Journal};
pub use raw::Frame;
pub use rings::{RingStrata, Stratum};
pub use tally::{Summary, own_unit};

pub use crate::transport::{Plan, Step};

use crate::Error;
use crate::image::Picture;
use crate::image::exr::{Layout, Style};
use crate::scene::{Rings, Scene};
use crate::transport::{Assets, Meter, PreparedScene, names};
use grid::Grid;
use kerrlight_geodesic::RayDevice;
use rings::Resolver;
use std::sync::Arc;
use workspace::Workspace;

/// Told how many more rows of pixels are done; returns whether to go on.
pub type Progress<'a> = dyn Fn(usize) -> bool + Sync + 'a;

/// Reason why there is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// There is no light to scale.
    #[error("`screen.total_flux_jy` cannot be met: the picture's own flux is {0:e} scene units")]
    NoFlux(f64),
    /// A value does not fit the picture's 32-bit channels.
    #[error("channel {channel}: a value is too large for a 32-bit float; lower the brightness")]
    NotFinite {
        /// The channel.
        channel: &'static str,
    },
    /// A channel that the scene does not have.
    #[error("`screen.channels`: this scene has no channel `{name}`; it has {there}")]
    Channel {
        /// The name that was requested.
        name: String,
        /// The channels that there are.
        there: String,
    },
    /// A channel that pictures with refined pixels do not have.
    #[error(
        "`screen.channels`: {channel} is not there with `screen.image_error`: give samples_per_pixel in its place"
    )]
    Refined {
        /// The channel.
        channel: &'static str,
    },
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

/// A picture to be rendered: what is seen, where rays go, and what is kept of it.
#[derive(Debug)]
pub struct Raster {
    scene: Scene,
    prepared: PreparedScene,
    grid: Grid,
    rings: Option<Resolver>,
    channels: Vec<&'static ChannelKind>,
    layout: Layout,
    /// Factor from the scene's unit of intensity to that in which bands are kept: the file's,
    /// unless it is to be found from the whole picture.
    unit: f64,
    /// Columns of a tile.
    tile: usize,
}

/// Rays of a block of a trial.
const TRIAL: usize = 64;

/// Columns of a tile: with the rows of a band a block of rays.
const TILE: usize = 64;

/// The same for devices, which take many rays at a time.
const DEVICE_TILE: usize = 2048;

/// Returns the resolver of photon rings, if the scene has them resolved.
fn resolver(scene: &Scene, prepared: &PreparedScene) -> Option<Resolver> {
    match scene.screen.rings {
        Rings::Resolved => Resolver::new(prepared, &Grid::new(scene), scene.screen.image_error),
        Rings::RegularGrid => None,
    }
}

impl Raster {
    /// The picture of `scene` with the decoded files that it names.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn new(scene: &Scene, assets: impl Into<Assets>) -> Result<Self, Error> {
        let prepared = PreparedScene::new(scene, assets)?;
        let grid = Grid::new(scene);
        let refined = scene.screen.image_error.is_some();
        let channels = choice::chosen(&prepared, refined, scene.screen.channels.as_deref())?;
        let rings = resolver(scene, &prepared);
        let names: Vec<&str> = channels.iter().map(|kind| kind.name).collect();
        let layout = Layout::new(grid.width, grid.height, &names, Style::default())?;
        let unit = if scene.screen.total_flux_jy.is_none() { own_unit(scene) } else { 1.0 };
        let scene = scene.clone();
        Ok(Raster { scene, prepared, grid, rings, channels, layout, unit, tile: TILE })
    }

    /// The same with tiles of `columns` pixels; no pixel depends on it.
    pub fn with_tile(self, columns: usize) -> Self {
        Raster { tile: columns.max(1), ..self }
    }

    /// The same with rays traced on a device, in its precision, and with tiles wide enough for it. Rays that it does not
    /// vouch for, and what [`beside_device`](Self::beside_device) lists, are traced on this processor.
    pub fn with_device(self, device: Arc<dyn RayDevice>) -> Self {
        let prepared = self.prepared.with_device(device);
        Raster { prepared, tile: self.tile.max(DEVICE_TILE), ..self }
    }

    /// The device on which rays are traced, if it is not this processor.
    pub fn device(&self) -> Option<&dyn RayDevice> {
        self.prepared.tracer().device()
    }

    /// Returns the plan of the picture.
    pub fn plan(&self) -> Plan {
        self.prepared.plan()
    }

    /// Returns the parts of the scene that are traced on this processor even so.
    pub fn beside_device(&self) -> Vec<&'static str> {
        self.prepared.beside_device()
    }

    /// Time of all parts on one thread for `rays` rays spread over the picture.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn trial(&self, rays: usize) -> Result<Meter, Error> {
        let mut work = Workspace::default();
        work.scratch.meter = Meter::running();
        let (width, height) = (self.grid.width, self.grid.height);
        // Blocks of neighbours, as in the picture, on a sequence that fills the plane evenly
        // (Roberts 2018: powers of the reciprocal of the plastic number).
        let blocks = rays.div_ceil(TRIAL);
        for k in 0..blocks {
            let place =
                |ratio: f64, size: usize| ((k as f64 * ratio).fract() * size as f64) as usize;
            let (column, row) =
                (place(0.754_877_666_246_692_7, width), place(0.569_840_290_998_053_2, height));
            work.clear();
            for j in 0..TRIAL {
                let (column, row) =
                    ((column + j % 8).min(width - 1), (row + j / 8).min(height - 1));
                let (x, y) = self.grid.inside(column, row, [0.0; 2]);
                work.push_ray(x, y);
            }
            work.observe(&self.prepared)?;
        }
        Ok(work.scratch.meter)
    }

    /// Returns about the number of rays that photon rings take besides those of the regular grid, what hides them left
    /// out of account: counted in up to 256 rows.
    pub fn ring_rays(&self) -> u64 {
        let every = self.grid.height.div_ceil(256);
        self.rings.as_ref().map_or(0, |rings| rings.rays(&self.grid, every))
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.layout.bands()
    }

    /// Everything about the scene that decides the picture, as a text. The contents of files
    /// that the scene names are not in it.
    pub fn identity(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        let (scene, names) = (self.scene.to_toml(), self.names());
        let device =
            self.device().map_or(String::new(), |device| format!("on {}\n", device.name()));
        let unit = self.unit;
        format!("kerrlight {version}\n{scene}\n{names:?}\nin {unit:e} scene units\n{device}")
    }

    /// Names of the channels.
    pub fn names(&self) -> Vec<&'static str> {
        self.channels.iter().map(|kind| kind.name).collect()
    }

    /// Describes the channels.
    pub fn legend(&self) -> String {
        choice::legend(&self.channels)
    }

    /// Describes the numbers in the channel `id`, a line for each; nothing without that channel.
    pub fn identifiers(&self) -> Option<String> {
        self.names().contains(&"id").then_some(())?;
        let names = names(&self.scene).into_iter().enumerate();
        Some(names.map(|(k, name)| format!("{k} {name}\n")).collect())
    }
}

/// The picture of a scene and its summary.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// Its summary.
    pub summary: Summary,
}

/// Renders a picture that fits into memory.
///
/// `assets` are the decoded files that the scene names (`None` without any); `progress` is told
/// of finished rows and returns whether to go on. All threads of the current rayon pool work, and
/// their number does not change a bit of the picture. [`Raster`] renders band by band into a
/// journal instead, for pictures that are larger than memory or that must survive a crash.
///
/// ```
/// use kerrlight_render::picture::render;
/// use kerrlight_render::scene::Scene;
///
/// let scene = Scene::parse(r#"
///     hole = { spin = 0.0, mass_msun = 6.5e9, distance_kpc = 16800.0 }
///     observer = { inclination_deg = 0.0 }
///     screen = { field_of_view_m = 30.0, width = 16, total_flux_jy = 0.5 }
///     tracer = { integrator = "elliptic", tolerance = 1e-8 }
///     disc = { outer_edge = 12.0, peak_intensity = 1.0, opaque = true }
/// "#)?;
/// let rendered = render(&scene, None, &|_rows| true)?;
///
/// let intensity = rendered.picture.channel("intensity").unwrap(); // Jy/µas²
/// assert_eq!(intensity.len(), 16 * 16);
/// let side = scene.pixel_size() * scene.hole.angle_uas().unwrap(); // µas
/// let flux: f64 = intensity.iter().map(|x| f64::from(*x) * side * side).sum();
/// assert!((flux - 0.5).abs() < 1e-5 && rendered.summary.flux_unit == "Jy");
/// // Seen along the axis of a hole without spin, the picture is symmetric.
/// let at = |row: usize, column: usize| intensity[16 * row + column];
/// assert!((at(4, 7) - at(7, 4)).abs() < 1e-5 * at(4, 7) && at(4, 7) > 0.0);
/// # Ok::<(), kerrlight_render::Error>(())
/// ```
///
/// # Errors
/// If a value is out of range or does not fit, or `progress` returned false.
pub fn render(
    scene: &Scene,
    assets: impl Into<Assets>,
    progress: &Progress<'_>,
) -> Result<Rendered, Error> {
    Raster::new(scene, assets)?.render(progress)
}

impl Raster {
    /// Renders a picture that fits into memory.
    ///
    /// # Errors
    /// If a value is out of range or does not fit, or `progress` returned false.
    pub fn render(&self, progress: &Progress<'_>) -> Result<Rendered, Error> {
        let mut frames = self.raw(&[self.prepared.time()], progress)?;
        // One for each time.
        let frame = frames.pop().unwrap_or_default();
        let factor = self.unit_factor(&frame)?;
        self.rendered(frame, factor)
    }
}
