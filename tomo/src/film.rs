//! Many pictures of one scene: a film. Under a fixed camera each ray is traced once for a whole
//! batch of frames.

use crate::emission::sky::Panorama;
use crate::image::{Channel, Picture};
use crate::render::{ChannelOf, Grid, Pixel, Progress, RenderError, channels, intensity_unit};
use crate::scene::Scene;
use crate::transport::{Fate, Glimpse, Scratch, Stage};
use rayon::prelude::*;

/// A film of a scene.
#[derive(Debug)]
pub struct Film {
    scene: Scene,
    stage: Stage,
    channels: Vec<ChannelOf>,
}

/// One picture of a film.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The picture, its intensity in the scene's own unit.
    pub picture: Picture,
    /// Sum of the intensity over all pixels.
    pub light: f64,
    /// Rays that were given up.
    pub unresolved: usize,
}

/// A batch has at most this many values: 1 GiB.
const MOST_VALUES: usize = 1 << 28;

/// A batch has at most this many frames: then tracing costs little more than if it were done once
/// for all frames, and little is lost where a film is stopped.
const MOST_FRAMES: usize = 32;

/// Rays that are asked for at once.
const BLOCK: usize = 256;

impl Film {
    /// A film of `scene`; `sky` is the decoded file of a `[sky.image]`.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn new(scene: &Scene, sky: Option<Panorama>) -> Result<Self, RenderError> {
        let stage = Stage::new(scene, sky)?;
        let channels = channels(&stage);
        Ok(Film { scene: scene.clone(), stage, channels })
    }

    /// Frames that are rendered together: one if the camera moves, else as many as a GiB holds,
    /// at most 32.
    pub fn batch(&self) -> usize {
        if self.camera_moves() {
            return 1;
        }
        let pixels = self.scene.screen.width as usize * self.scene.screen.height as usize;
        (MOST_VALUES / (pixels * self.channels.len())).clamp(1, MOST_FRAMES)
    }

    /// Whether rays have to be traced anew for every frame.
    fn camera_moves(&self) -> bool {
        self.scene.camera.as_ref().is_some_and(|camera| !camera.key.is_empty())
    }

    /// Whether anything in the scene changes with time.
    pub fn changes(&self) -> bool {
        self.camera_moves() || !self.scene.spot.is_empty()
    }

    /// Factor and name of the unit of intensity that give a frame the scene's flux.
    ///
    /// # Errors
    /// If the frame has no light to be scaled.
    pub fn unit(&self, frame: &Frame) -> Result<(f64, &'static str), RenderError> {
        intensity_unit(&self.scene, frame.light)
    }

    /// The pictures at `times` (of observation, in M); with a moving camera they are traced one
    /// after the other.
    ///
    /// # Errors
    /// If a value is out of range or too large for 32 bits, or `progress`, which is told of rows,
    /// returned false.
    pub fn frames(
        &mut self,
        times: &[f64],
        progress: &Progress<'_>,
    ) -> Result<Vec<Frame>, RenderError> {
        if !self.camera_moves() {
            return self.together(times, progress);
        }
        let mut frames = Vec::with_capacity(times.len());
        for time in times {
            self.scene.observer.time = *time;
            self.stage.move_to(&self.scene)?;
            frames.append(&mut self.together(&[*time], progress)?);
        }
        Ok(frames)
    }

    fn together(&self, times: &[f64], progress: &Progress<'_>) -> Result<Vec<Frame>, RenderError> {
        let grid = Grid::new(&self.scene);
        let rows: Vec<Vec<RowOfFrame>> = (0..grid.height)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, row| {
                let done = self.row(&grid, row, times, scratch)?;
                if progress(1) { Ok(done) } else { Err(RenderError::Stopped) }
            })
            .collect::<Result<_, RenderError>>()?;
        (0..times.len()).map(|k| self.frame(&grid, rows.iter().map(|row| &row[k]))).collect()
    }

    /// A row of pixels of every frame.
    fn row(
        &self,
        grid: &Grid,
        row: usize,
        times: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<RowOfFrame>, RenderError> {
        let side = grid.side;
        let mut frames = vec![RowOfFrame::default(); times.len()];
        let (mut alpha, mut beta, mut seen) = (Vec::new(), Vec::new(), Vec::new());
        // Whole pixels, about a block's worth of rays.
        let columns: Vec<usize> = (0..grid.width).collect();
        for some in columns.chunks((BLOCK / (side * side)).max(1)) {
            alpha.clear();
            beta.clear();
            for (column, k) in some.iter().flat_map(|c| (0..side * side).map(move |k| (*c, k))) {
                let (x, y) = grid.screen(column, row, k % side, k / side);
                alpha.push(x);
                beta.push(y);
            }
            seen.clear();
            seen.resize(alpha.len() * times.len(), Glimpse::default());
            self.stage.look_many(&alpha, &beta, times, scratch, &mut seen)?;
            for (frame, seen) in frames.iter_mut().zip(seen.chunks_exact(alpha.len())) {
                for rays in seen.chunks_exact(side * side) {
                    frame.push(&self.channels, &mean(rays, side));
                }
            }
        }
        Ok(frames)
    }

    fn frame<'a>(
        &self,
        grid: &Grid,
        rows: impl Iterator<Item = &'a RowOfFrame> + Clone,
    ) -> Result<Frame, RenderError> {
        let count = self.channels.len();
        let channel = |k: usize| {
            let values = rows.clone().flat_map(|row| row.values.iter().skip(k).step_by(count));
            Channel { name: self.channels[k].0.to_owned(), values: values.copied().collect() }
        };
        let channels: Vec<Channel> = (0..count).map(channel).collect();
        if let Some(bad) = channels.iter().find(|c| c.values.iter().any(|v| !v.is_finite())) {
            return Err(RenderError::NotFinite { channel: bad.name.clone() });
        }
        Ok(Frame {
            picture: Picture { width: grid.width, height: grid.height, channels },
            light: rows.clone().map(|row| row.light).sum(),
            unresolved: rows.map(|row| row.unresolved).sum(),
        })
    }
}

/// A row of pixels of one frame: the values of all channels of one pixel after the other.
#[derive(Debug, Clone, Default)]
struct RowOfFrame {
    values: Vec<f32>,
    light: f64,
    unresolved: usize,
}

impl RowOfFrame {
    fn push(&mut self, channels: &[ChannelOf], pixel: &Pixel) {
        self.values.extend(channels.iter().map(|(_, value)| value(pixel) as f32));
        self.light += pixel.intensity;
        self.unresolved += pixel.unresolved as usize;
    }
}

/// A pixel from its rays, row by row.
fn mean(rays: &[Glimpse], side: usize) -> Pixel {
    let central = side / 2 * side + side / 2;
    let mut pixel = Pixel {
        intensity: 0.0,
        rgb: [0.0; 3],
        center: rays.get(central).copied().unwrap_or_default(),
        unresolved: 0,
    };
    for ray in rays {
        pixel.intensity += ray.intensity;
        for (sum, light) in pixel.rgb.iter_mut().zip(ray.rgb) {
            *sum += light;
        }
        pixel.unresolved += u32::from(ray.fate == Fate::Unresolved);
    }
    pixel.intensity /= rays.len() as f64;
    pixel.rgb = pixel.rgb.map(|c| c / rays.len() as f32);
    pixel
}
