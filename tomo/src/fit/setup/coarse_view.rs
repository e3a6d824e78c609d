//! Coarse views of searches: fewer pixels and nodes, or other ones.

use super::linear_problem::terms;
use super::{FitData, Instrument, Result, axis, linear, priors, sky, spacing};
use crate::fit::linear::{Change, LinearProblem, Voxels};
use crate::fit::settings::{FitFile, LossKind, Region, Screen, WidthOf};
use crate::fit::{Motion, Objective, Sampling};
use crate::representation::Degree;
use kerrlight_common::frames::Frames;
use kerrlight_vlbi::operator::Pulse;

/// Coarse view of a fit for a search.
pub struct CoarseView {
    pub(super) file: FitFile,
    pub(super) instrument: Instrument,
    pub(super) measured: FitData,
}

impl CoarseView {
    /// The same view with fewer pixels, and as many fewer nodes on rays. Images are known at every n-th
    /// pixel; visibilities are explained by pixels n times as wide. A loss that has both is seen through
    /// all pixels, as is one of few.
    ///
    /// # Errors
    /// As [`Instrument::new`].
    pub fn new(file: &FitFile, measured: &FitData, pixels: usize) -> Result<Self> {
        let images = file.loss.iter().filter(|loss| loss.data == LossKind::Image).count();
        let screen = &file.screen;
        let every = screen.pixels / pixels.max(2);
        if every < 2 || (images > 0 && images < file.loss.len()) {
            let instrument = Instrument::new(file)?;
            return Ok(Self { file: file.clone(), instrument, measured: measured.without_truth() });
        }
        if images > 0 {
            Self::thinned(file, measured, every)
        } else {
            let region = fewer_nodes(file, file.screen.pixels / pixels);
            Self::sampled(&FitFile { region, ..file.clone() }, measured, pixels)
        }
    }

    /// Every n-th row and column of images.
    fn thinned(file: &FitFile, measured: &FitData, every: usize) -> Result<Self> {
        let n = file.screen.pixels;
        // Half a step in: the lattice stays about the middle of the screen.
        let places: Vec<usize> = (every / 2..n).step_by(every).collect();
        let kept: Vec<usize> = places
            .iter()
            .flat_map(|row| places.iter().map(move |column| row * n + column))
            .collect();
        let region = fewer_nodes(file, every);
        let file = FitFile { region, ..file.clone() };
        let instrument = Instrument::of(&file, &kept)?;
        let thin = |movie: &Frames<f64>| {
            movie.mapped(kept.len(), |image| kept.iter().map(|k| image[*k]).collect())
        };
        let movie = measured.movie.as_ref().map(thin).transpose()?;
        let measured = FitData { movie, ..measured.without_truth() };
        // Pixels keep their size, which rays within them are spread over.
        let screen = Screen {
            pixels: places.len(),
            width: spacing(&file.screen)? * places.len() as f64,
            width_of: WidthOf::Edges,
            ..file.screen.clone()
        };
        Ok(Self { file: FitFile { screen, ..file }, instrument, measured })
    }

    /// Other pixels over the same field.
    ///
    /// # Errors
    /// As [`Instrument::new`].
    pub fn sampled(file: &FitFile, measured: &FitData, pixels: usize) -> Result<Self> {
        let n = file.screen.pixels as f64;
        let screen = Screen {
            pixels,
            width: spacing(&file.screen)? * n,
            width_of: WidthOf::Edges,
            // The light of a pixel goes with its area.
            jy_per_pixel: file.screen.jy_per_pixel * (n / pixels as f64).powi(2),
            ..file.screen.clone()
        };
        let file = FitFile { screen, ..file.clone() };
        let instrument = Instrument::new(&file)?;
        let pulse = match (measured.pulse, measured.sky) {
            // Data keep the pixels that they were made of.
            (Pulse::Triangle, Some(own)) => Pulse::TriangleOf(own.pixel_rad),
            (pulse, _) => pulse,
        };
        let measured = FitData { sky: sky(&file).ok(), pulse, ..measured.without_truth() };
        Ok(Self { file, instrument, measured })
    }

    /// Hands the linear problem of all axes, through about so many frames, to a search.
    ///
    /// # Errors
    /// If a setting is missing or out of range, or those of the search.
    pub fn search<R>(
        &self,
        motion: &Motion,
        frames: usize,
        search: impl FnOnce(&LinearProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let file = &self.file;
        let settings = linear(file)?;
        let model = self.instrument.forward(motion)?;
        let count = file.screen.pixels * file.screen.pixels;
        let objective = Objective { model, data: self.measured.terms(&file.loss, count)? };
        let all = objective.observed();
        let chosen: Vec<usize> = all.iter().copied().step_by((all.len() / frames).max(1)).collect();
        search(&LinearProblem {
            model: &objective.model,
            axis: axis(file)?.0,
            frames: &chosen,
            terms: &terms(&objective.data),
            voxels: Voxels::cube(file.voxel_nodes(), file.region.r_max, Degree::Linear),
            upper: settings.upper,
            flux: settings.flux_jy,
            priors: &priors(settings),
            gaussian: None,
            change: Change::NONE,
        })
    }
}

/// The fewest equidistant nodes that a ray is thinned to: a node for each of the grid's voxels that it crosses.
const FEWEST: usize = 32;

/// The region with every n-th node, or panels of half as many.
fn fewer_nodes(file: &FitFile, every: usize) -> Region {
    let nodes = match file.region.nodes {
        Sampling::Gauss { order, split } => Sampling::Gauss { order: order.div_ceil(2), split },
        Sampling::EqualMinoTime { per_ray } => {
            Sampling::EqualMinoTime { per_ray: per_ray.min(FEWEST.max(per_ray / every)) }
        }
    };
    Region { nodes, ..file.region.clone() }
}
