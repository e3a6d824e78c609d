//! Data as a search looks at them.

use super::{known_geometry, model};
use crate::fit::geometry::{Effort, Geometry, GeometryProblem};
use crate::fit::journal::{Memory, key};
use crate::fit::linear::{Change, GaussianField, Prior as Penalty, StopRule, Voxels, Weighted};
use crate::fit::settings::{
    FieldKind, FitFile, LossKind, PriorOfVoxels, Screen, SearchView, UnknownGeometry, Within,
};
use crate::fit::setup::linear_problem::terms;
use crate::fit::setup::{
    CoarseView, FitData, Result, change, emission_times, linear, motion, priors,
};
use crate::fit::{Objective, Weighted as Imaged};
use kerrlight_vlbi::operator::Pulse;

/// Data as a search looks at them.
pub(super) struct SearchData {
    pub(super) view: CoarseView,
    frames: usize,
    /// Rounds of each solution over the voxels that shine.
    rounds: usize,
    /// The same through other pixels, where those of the fit are only samples of a smooth image.
    pub(super) resampled: Vec<SearchData>,
}

/// Pixels do not count where they are nearer to the critical curve, M. Second images of matter at 3 to 9 M are within 0.7 M.
const BESIDE_THE_RING: f64 = 0.8;

/// Other rays that the best geometry is looked for through.
// Six with those of the fit: Student's t widens the scatter of six by 5/3, that of four by 3.
pub(super) const LATTICES: usize = 5;
/// Pixels of a look through others over those of the fit, along each side: finer and wider ones.
const RESAMPLED: [f64; LATTICES] = [1.15, 0.87, 1.25, 0.93, 1.08];
/// Iterations of a round, for each over all voxels.
const SETTLING: usize = 6;

impl SearchData {
    /// Prepares a search all over: volumes are told apart by a few iterations, through single rays.
    pub fn coarsely(file: &FitFile, measured: &FitData, view: &SearchView) -> Result<Self> {
        let screen = Screen { ring_rays: Some(1), samples_per_pixel: None, ..file.screen.clone() };
        Self::new(&FitFile { screen, ..file.clone() }, measured, view, 0)
    }

    /// Prepares a search among geometries that are much alike, whose volumes are solved for nearly to the end; and the same
    /// through other pixels.
    pub fn finely(file: &FitFile, measured: &FitData, view: &SearchView) -> Result<Self> {
        let mut seen = Self::exactly(file, measured, view)?;
        if measured.pulse == Pulse::Delta && !has_images(file) {
            let pixels = seen.view.file.screen.pixels as f64;
            for share in RESAMPLED {
                let pixels = (share * pixels).round() as usize;
                let other = seen.sampled(pixels)?;
                seen.resampled.push(other);
            }
        }
        Ok(seen)
    }

    /// The same through other pixels.
    pub fn sampled(&self, pixels: usize) -> Result<Self> {
        let CoarseView { file, measured, .. } = &self.view;
        let view = CoarseView::sampled(file, measured, pixels)?;
        Ok(Self { view, resampled: Vec::new(), ..*self })
    }

    /// Visibilities are seen through as many pixels as are asked for, were they more than those of the fit, with all nodes on
    /// rays; through half of these or fewer, and where there are images, as a coarse search sees them.
    fn exactly(file: &FitFile, measured: &FitData, view: &SearchView) -> Result<Self> {
        let SearchView { pixels, frames, .. } = *view;
        if has_images(file) || pixels == file.screen.pixels || 2 * pixels <= file.screen.pixels {
            return Self::new(file, measured, view, 1);
        }
        let view = CoarseView::sampled(file, measured, pixels)?;
        Ok(Self { view, frames, rounds: 1, resampled: Vec::new() })
    }

    fn new(file: &FitFile, measured: &FitData, view: &SearchView, rounds: usize) -> Result<Self> {
        let SearchView { pixels, frames, .. } = *view;
        let view = CoarseView::new(file, measured, pixels)?;
        Ok(Self { view, frames, rounds, resampled: Vec::new() })
    }

    pub fn with<R>(
        &self,
        unknown: &UnknownGeometry,
        view: &SearchView,
        scale: f64,
        memory: Memory<'_>,
        search: impl FnOnce(&GeometryProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let CoarseView { file, instrument, measured } = &self.view;
        let plain = motion(file, measured.times.clone())?;
        let count = file.screen.pixels * file.screen.pixels;
        let data = measured.terms(&file.loss, count)?;
        let objective = Objective { model: instrument.forward(&plain)?, data };
        let all = objective.observed();
        let frames: Vec<usize> =
            all.iter().copied().step_by((all.len() / self.frames).max(1)).collect();
        let settings = linear(file)?;
        let voxels = Voxels::cube(view.nodes, file.region.r_max, settings.degree);
        let gaussian = settings.prior_of(FieldKind::Gaussian);
        let gaussian = gaussian.map(|prior| self::gaussian(prior, &voxels)).transpose()?;
        let terms = terms(&objective.data).into_iter();
        // Beside a prior what is minimised is a mean over the data.
        let (terms, data): (Vec<_>, f64) = match gaussian {
            Some(_) => (terms.collect(), 1.0),
            None => {
                let terms: Vec<_> = terms.map(|term| counted(term, &frames)).collect();
                let data = terms.iter().map(|term| term.weight).sum();
                (terms, data)
            }
        };
        let scaled = |penalty: Penalty| Penalty { weight: data * penalty.weight, ..penalty };
        let penalties: Vec<Penalty> = priors(settings).into_iter().map(scaled).collect();
        // Knots are the same in all geometries.
        let change = change(file, emission_times(instrument, &plain))?;
        search(&GeometryProblem {
            model: &model(file, instrument, &plain)?,
            known: known_geometry(file),
            free: &unknown.free,
            frames: &frames,
            terms: &terms,
            half_width: file.region.r_max,
            upper: settings.upper,
            flux: settings.flux_jy,
            penalties: &penalties,
            change: Change { weight: data * change.weight, ..change },
            gaussian: gaussian.as_ref(),
            scale,
            memory,
            effort: Effort {
                nodes: view.nodes,
                degree: settings.degree,
                patience: StopRule {
                    looking: view.iterations,
                    rounds: self.rounds,
                    // Few voxels shine: iterations over these are cheap. Without them what is left
                    // moves the geometry by more than noise does.
                    settling: self.rounds * SETTLING * view.iterations,
                },
            },
        })
    }

    /// Does something with data that change smoothly with the geometry. Single rays meet the narrow images near the critical
    /// curve or miss them: images of such rays are compared without the pixels that are nearer than [`BESIDE_THE_RING`] to the
    /// critical curve of a geometry near by. Other data, emission that changes, and a geometry that is known are compared as they
    /// are.
    pub fn smoothly<R>(
        &self,
        problem: &GeometryProblem<'_, f32>,
        geometry: Geometry,
        work: impl FnOnce(&GeometryProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let CoarseView { file, measured, .. } = &self.view;
        let is_known = problem.free.is_empty();
        if is_known || problem.model.ring.is_some() || problem.change.is_any() || !self.is_images()
        {
            return work(problem);
        }
        let mut data = measured.terms(&file.loss, problem.model.x.len())?;
        let ring = problem.model.ring_pixels(&geometry, BESIDE_THE_RING)?;
        data.image =
            data.image.map(|image| Imaged { term: Box::new(image.term.without(ring)), ..image });
        let terms = terms(&data).into_iter();
        let terms: Vec<_> = match problem.gaussian {
            Some(_) => terms.collect(),
            // What is left out of χ² is left out of the number of data that it is compared with.
            None => terms.map(|term| counted(term, problem.frames)).collect(),
        };
        // The same geometry has another value with other pixels left out.
        let memory = problem.memory.about(key(geometry.bits()));
        work(&GeometryProblem { terms: &terms, memory, ..*problem })
    }

    /// Returns whether images are all that is compared.
    pub fn is_images(&self) -> bool {
        self.compares(LossKind::Image)
    }

    /// Returns whether visibilities of a smooth image are all that is compared: of its pixels there can be as many as are
    /// needed.
    pub fn is_sampled(&self) -> bool {
        self.compares(LossKind::Visibilities) && self.view.measured.pulse == Pulse::Delta
    }

    fn compares(&self, kind: LossKind) -> bool {
        self.view.file.loss.iter().all(|loss| loss.data == kind)
    }
}

fn has_images(file: &FitFile) -> bool {
    file.loss.iter().any(|loss| loss.data == LossKind::Image)
}

fn gaussian(prior: &PriorOfVoxels, voxels: &Voxels) -> Result<GaussianField> {
    GaussianField::new(prior.law(), voxels).within("linear.prior")
}

/// Data with their weight times their number in some frames.
pub(super) fn counted<'a>(term: Weighted<'a, f32>, frames: &[usize]) -> Weighted<'a, f32> {
    Weighted { weight: term.weight * term.count(frames) as f64, ..term }
}
