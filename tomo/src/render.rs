//! From a scene to a picture: rays over all pixels, in parallel. Every pixel is computed on
//! its own, so the picture does not depend on the number of threads.

use crate::image::{Channel, Picture};
use crate::scene::Scene;
use crate::transport::{Assets, Fate, Glimpse, Scratch, Stage};
use kerrlight_geodesic::OutOfRange;
use rayon::prelude::*;

/// Told how many rows of pixels are done; returns whether to go on.
pub type Progress<'a> = dyn Fn(usize) -> bool + Sync + 'a;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A value is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// There is no light to scale.
    #[error("`screen.total_flux_jy` cannot be met: the picture's own flux is {0:e} scene units")]
    NoFlux(f64),
    /// A value does not fit the picture's 32-bit channels.
    #[error("channel {channel}: a value is too large for a 32-bit float; lower the brightness")]
    NotFinite {
        /// The channel.
        channel: String,
    },
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

/// The picture of a scene with what is worth knowing about it.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// Rays that were given up.
    pub unresolved: usize,
    /// Factor from the scene's intensity unit to that of the `intensity` channel.
    pub unit_factor: f64,
    /// Unit of the `intensity` channel.
    pub intensity_unit: &'static str,
}

/// Renders `scene` with the decoded files that it names.
///
/// # Errors
/// If a value is out of range or `progress` returned false.
pub fn render(
    scene: &Scene,
    assets: impl Into<Assets>,
    progress: &Progress<'_>,
) -> Result<Rendered, RenderError> {
    let stage = Stage::new(scene, assets)?;
    let grid = Grid::new(scene);
    let rows: Vec<Vec<Pixel>> = (0..grid.height)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, row| {
            let pixels = (0..grid.width)
                .map(|column| grid.pixel(&stage, column, row, scratch))
                .collect::<Result<Vec<_>, OutOfRange>>()?;
            if progress(1) { Ok(pixels) } else { Err(RenderError::Stopped) }
        })
        .collect::<Result<_, RenderError>>()?;
    assemble(scene, &stage, &grid, &rows)
}

/// Where rays go: pixel centres on a regular grid, rows from the top (largest β), square
/// pixels, `side`² rays a pixel.
struct Grid {
    width: usize,
    height: usize,
    size: f64,
    side: usize,
}

/// A pixel: averages of light, data of its most central ray.
#[derive(Clone, Copy)]
struct Pixel {
    intensity: f64,
    rgb: [f32; 3],
    center: Glimpse,
    unresolved: u32,
}

impl Grid {
    fn new(scene: &Scene) -> Self {
        Grid {
            width: scene.screen.width as usize,
            height: scene.screen.height as usize,
            size: scene.pixel_size(),
            side: scene.screen.samples_per_pixel.isqrt() as usize,
        }
    }

    /// Screen coordinates of ray (i, j) of a pixel, exactly antisymmetric about the centre.
    fn screen(&self, column: usize, row: usize, i: usize, j: usize) -> (f64, f64) {
        let along = |pixel: usize, sub: usize, count: usize| {
            // In units of 1/(2·side) of a pixel, so that the centre is an exact 0.
            let twice = 2 * (pixel * self.side + sub) + 1;
            (twice as f64 - (count * self.side) as f64) / (2 * self.side) as f64 * self.size
        };
        (along(column, i, self.width), -along(row, j, self.height))
    }

    fn pixel(
        &self,
        stage: &Stage,
        column: usize,
        row: usize,
        scratch: &mut Scratch,
    ) -> Result<Pixel, OutOfRange> {
        let central = self.side / 2;
        let (mut intensity, mut rgb, mut center, mut unresolved) = (0.0, [0.0; 3], None, 0);
        for j in 0..self.side {
            for i in 0..self.side {
                let (alpha, beta) = self.screen(column, row, i, j);
                let glimpse = stage.look(alpha, beta, scratch)?;
                intensity += glimpse.intensity;
                for (sum, light) in rgb.iter_mut().zip(glimpse.rgb) {
                    *sum += light;
                }
                unresolved += u32::from(glimpse.fate == Fate::Unresolved);
                if (i, j) == (central, central) {
                    center = Some(glimpse);
                }
            }
        }
        let rays = (self.side * self.side) as f64;
        // The central ray is one of the loop's.
        let center = center.unwrap_or_else(|| unreachable!("side ≥ 1"));
        Ok(Pixel {
            intensity: intensity / rays,
            rgb: rgb.map(|c| c / rays as f32),
            center,
            unresolved,
        })
    }
}

fn assemble(
    scene: &Scene,
    stage: &Stage,
    grid: &Grid,
    rows: &[Vec<Pixel>],
) -> Result<Rendered, RenderError> {
    let pixels = || rows.iter().flatten();
    let (unit_factor, intensity_unit) = intensity_unit(scene, pixels().map(|p| p.intensity).sum())?;
    let mut channels = Vec::new();
    let mut add = |name: &str, value: &dyn Fn(&Pixel) -> f64| {
        let values = pixels().map(|p| value(p) as f32).collect();
        channels.push(Channel { name: name.to_owned(), values });
    };
    for (k, name) in ["R", "G", "B"].into_iter().enumerate() {
        add(name, &|p| f64::from(p.rgb[k]));
    }
    add("intensity", &|p| p.intensity * unit_factor);
    if stage.has_redshift() {
        add("redshift", &|p| p.center.redshift);
    }
    add("crossings", &|p| f64::from(p.center.crossings));
    add("radius", &|p| p.center.radius);
    add("azimuth", &|p| p.center.azimuth);
    add("delay", &|p| p.center.delay);
    add("outcome", &|p| f64::from(p.center.fate as u8));
    if let Some(bad) = channels.iter().find(|c| c.values.iter().any(|v| !v.is_finite())) {
        return Err(RenderError::NotFinite { channel: bad.name.clone() });
    }
    Ok(Rendered {
        picture: Picture { width: grid.width, height: grid.height, channels },
        unresolved: pixels().map(|p| p.unresolved as usize).sum(),
        unit_factor,
        intensity_unit,
    })
}

/// Factor and name of the unit of intensity: the scene's own, or Jy/µas² such that the
/// picture holds the flux that was asked for.
fn intensity_unit(scene: &Scene, sum: f64) -> Result<(f64, &'static str), RenderError> {
    let Some(flux) = scene.screen.total_flux_jy else { return Ok((1.0, "scene unit")) };
    let hole = &scene.hole;
    let angle = crate::units::gravitational_angle(hole.mass_msun, hole.distance_kpc);
    let factor = flux / (sum * (scene.pixel_size() * angle).powi(2));
    if factor.is_normal() { Ok((factor, "Jy/uas^2")) } else { Err(RenderError::NoFlux(sum)) }
}
