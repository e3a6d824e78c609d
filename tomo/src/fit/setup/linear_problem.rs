//! The linear problem of a fit: the grid that fits its data best about a known axis.

use super::change::change;
use super::{Result, linear, priors};
use crate::fit::linear::{
    Change, Coarse, GaussianField, LinearProblem, LinearSettings, LinearSolution, LogNormalField,
    Voxels, Watch, Weighted,
};
use crate::fit::settings::{FieldKind, FitFile, Kind, Linear, Start, Within};
use crate::fit::{Data, Objective};
use kerrlight_render::dynamics::Axis;

/// Nodes along an axis from which on a coarser grid is solved first.
const FINE: usize = 40;

/// Nodes along an axis of the grid on which emission that changes is looked for first.
const COARSE: usize = 24;
/// Bytes of the sparse matrix of emission that changes: its rows take long to compute anew.
const MANY_ROWS: usize = 2 << 30;

/// Share of the first gradient that is left beside a prior: what data hardly tell is decided last.
const SURE: f64 = 1e-7;
/// Share of the first gradient that is left without one: slopes of bright data, or with respect to the pixels of a quiescent
/// image, which add up over all frames, fall to a thousandth while the volume has hardly been found.
const LEFT: f64 = 1e-6;
/// Part of what noise changes χ² by that ten iterations must gain.
const GAIN: f64 = 0.1;

/// All terms of the data, the image first.
pub(super) fn terms(data: &Data<f32>) -> Vec<Weighted<'_, f32>> {
    data.terms().map(|(term, weight)| Weighted { weight, term }).collect()
}

/// The grid that fits its frames best: that of the fit, or of its start. `times` are those of the first and the last
/// emission, M since the reference time. With a `seed` the prior of the voxels, if any, gives a field in place of its mean:
/// beside data that have noise once more, the solution is a draw of the posterior (randomise, then optimise: Bardsley et al.
/// 2014).
///
/// # Errors
/// If a setting is missing or out of range, or the problem has no solution.
pub fn solve_linear(
    file: &FitFile,
    objective: &mut Objective<f32>,
    axis: Axis,
    times: [f64; 2],
    seed: Option<u64>,
    watch: &mut Watch<'_>,
) -> Result<LinearSolution<f32>> {
    objective.model.weigh(axis);
    let stride = match file.training.start {
        Start::Linear { stride, .. } if file.representation.kind != Kind::LinearGrid => stride,
        _ => 1,
    };
    let frames: Vec<usize> = objective.observed().into_iter().step_by(stride.max(1)).collect();
    let change = change(file, times)?;
    solve_frames(&Of { file, objective, axis, change, seed }, &frames, watch)
}

/// Parts of the linear problem of a fit; its model is weighed for the axis.
pub(super) struct Of<'a> {
    pub file: &'a FitFile,
    pub objective: &'a Objective<f32>,
    pub axis: Axis,
    pub change: Change,
    /// Seed of the field that the prior's density is about; about its mean, without one.
    pub seed: Option<u64>,
}

impl Of<'_> {
    /// The prior of the voxels, if that of the emission is Gaussian.
    fn gaussian(&self, voxels: &Voxels) -> Result<Option<GaussianField>> {
        let prior = linear(self.file)?.prior_of(FieldKind::Gaussian);
        let Some(prior) = prior else { return Ok(None) };
        let field = GaussianField::new(prior.law(), voxels).within("linear.prior")?;
        Ok(Some(match self.seed {
            Some(seed) => {
                let center = field.drawn(seed);
                field.about(center)
            }
            None => field,
        }))
    }

    /// The prior of the voxels, if that of the logarithm of the emission is.
    fn log_normal(&self, voxels: &Voxels) -> Result<Option<LogNormalField>> {
        let prior = linear(self.file)?.prior_of(FieldKind::LogNormal);
        let Some(prior) = prior else { return Ok(None) };
        let field = LogNormalField::new(prior.law(), voxels).within("linear.prior")?;
        Ok(Some(match self.seed {
            Some(seed) => field.about(seed),
            None => field,
        }))
    }

    /// The problem of some frames.
    pub fn with<R>(
        &self,
        frames: &[usize],
        solve: impl FnOnce(&LinearProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let Of { file, objective, axis, change, .. } = *self;
        let settings = linear(file)?;
        let priors = priors(settings);
        let voxels = Voxels::cube(file.voxel_nodes(), file.region.r_max, settings.degree);
        let gaussian = self.gaussian(&voxels)?;
        solve(&LinearProblem {
            model: &objective.model,
            axis,
            frames,
            terms: &terms(&objective.data),
            voxels,
            upper: settings.upper,
            flux: settings.flux_jy,
            priors: &priors,
            gaussian: gaussian.as_ref(),
            change,
        })
    }
}

/// Iterations of each round: a start has its own if it says so.
fn iterations(file: &FitFile, settings: &Linear) -> usize {
    match file.training.start {
        Start::Linear { iterations: Some(own), .. }
            if file.representation.kind != Kind::LinearGrid =>
        {
            own
        }
        _ => settings.iterations,
    }
}

/// Returns the conditions to end a round: what is left of the slopes, and the part of what noise changes χ² by that ten
/// iterations must gain.
fn enough(of: &Of<'_>, settings: &Linear) -> (f64, f64) {
    let (file, usual) = (of.file, LinearSettings::default());
    let is_steady = !of.change.is_any();
    match settings.prior {
        // A draw of a posterior is to be as exact as the minimum.
        Some(_) => (SURE, 0.0),
        None if of.objective.model.quiescent().is_some() => (LEFT, 0.0),
        // What is not convex comes on slowly, and goes on for longer than it seems.
        None if file.representation.kind == Kind::LinearGrid && is_steady && file.is_convex() => {
            (LEFT, GAIN)
        }
        None => (usual.tolerance, 0.0),
    }
}

/// The grid that fits some frames best.
pub(super) fn solve_frames(
    of: &Of<'_>,
    frames: &[usize],
    watch: &mut Watch<'_>,
) -> Result<LinearSolution<f32>> {
    let (change, nodes) = (of.change, of.file.voxel_nodes());
    let settings = linear(of.file)?;
    let usual = LinearSettings::default();
    let coarse = usual.coarse.filter(|_| nodes >= FINE).map(|coarse| Coarse {
        // Few frames are thinned less, so that at least five of them are left.
        stride: coarse.stride.min(frames.len().div_ceil(8)).max(1),
        ..coarse
    });
    let coarse = match change.is_any() {
        // Every frame: knots between those that are left out would be seen by none.
        true => Some(Coarse { nodes: nodes.min(COARSE), stride: 1, iterations: 20 }),
        false => coarse,
    };
    let memory = if change.is_any() { MANY_ROWS } else { usual.memory };
    let (rounds, iterations) = (settings.rounds, iterations(of.file, settings));
    let (tolerance, settled) = enough(of, settings);
    let how = LinearSettings { rounds, iterations, coarse, memory, tolerance, settled };
    of.with(frames, |problem| match of.log_normal(&problem.voxels)? {
        Some(prior) => problem.solve_log_normal(&prior, &how, watch),
        None => problem.solve(&how, watch),
    })
}
