//! A solution under way: the coarse problem, then rounds over the nodes that count.

use super::certificate::{Certificate, Stationarity};
use super::data::Data;
use super::descent::{Descended, Descent, Each, Ending, Stop};
use super::error::LinearError;
use super::initial_fields::{InitialField, Spots, Trials};
use super::objective::{Objective, Penalised};
use super::operator::Operator;
use super::problem::LinearProblem;
use super::ray_weights::{Voxels, refined};
use super::scaled::Scaled;
use super::settings::{Coarse, LinearSettings};
use super::solution::{LinearProgress, LinearSolution, Watch};
use crate::Error;
use crate::fit::forward::occupancy::dilated;
use kerrlight_common::simd::Float;

/// Values at the nodes, and which of them count.
type Start = (Vec<f64>, Vec<bool>);

/// Field of the coarse problem, and the lit field that it began with if there was one.
type Coarsely = (Vec<f64>, Option<Vec<f64>>);

/// Grid on which lit fields are evaluated if no coarse problem is requested.
pub(super) const LIT: Coarse = Coarse { nodes: 32, stride: 1, iterations: 20 };
/// Lit fields of a problem, and of one of the many problems of a scan.
const MANY: Trials = Trials { spots: Spots { circles: 12, on_each: 16 }, best: 4, iterations: 0 };
pub(super) const FEW: Trials =
    Trials { spots: Spots { circles: 8, on_each: 12 }, best: 2, iterations: 0 };
/// Nodes count at first where the coarse solution exceeds this part of its maximum, or where one not farther than
/// `DILATION` nodes along each axis does.
const THRESHOLD: f64 = 0.02;
const DILATION: usize = 2;
/// Nodes are admitted whose slope is below minus this part of the largest one where nothing shines, and that violate the
/// conditions for a minimum more than any that counts already.
const ADMISSION: f64 = 1e-4;
/// Iterations of the coarse problem from a lit field, for one from a dark field.
const PATIENCE: usize = 3;

/// A solution under way.
pub(super) struct Run<'a, 'p, 'w, T: Float> {
    pub problem: &'a LinearProblem<'p, T>,
    settings: &'a LinearSettings,
    watch: &'a mut Watch<'w>,
    evaluations: usize,
    bytes: usize,
    pub round: usize,
    /// The lit field that a problem began with, at all nodes; empty if it is convex.
    lit: Vec<f64>,
    /// Value and largest slope there.
    at_lit: [f64; 2],
    /// The quiescent image that explains the data best without any emission; empty if none is recovered.
    image: Vec<f64>,
}

impl<'a, 'p, 'w, T: Float> Run<'a, 'p, 'w, T> {
    pub fn new(
        problem: &'a LinearProblem<'p, T>,
        settings: &'a LinearSettings,
        watch: &'a mut Watch<'w>,
    ) -> Self {
        let (lit, at_lit) = (Vec::new(), [0.0; 2]);
        let image = Vec::new();
        Self { problem, settings, watch, evaluations: 0, bytes: 0, round: 0, lit, at_lit, image }
    }

    /// Solves for the quiescent image alone, where there is one: what both can explain is to be the image's. Whether to
    /// go on.
    pub fn image_first(&mut self, data: &Data<'_, T>) -> bool {
        let problem = self.problem;
        // Other data have no slope in the dark: a round image is among their initial fields.
        if problem.beside() == 0 || !data.is_convex() {
            return true;
        }
        let nodes = vec![false; problem.unknowns()];
        // No node counts: there are no rows to keep.
        let operator = Operator::new(problem.walk(), problem.active(&nodes), problem.frames, 0);
        let mut objective = Objective::new(&operator, data, problem.penalised(data));
        let dark = vec![0.0; problem.beside()];
        let found = self.minimise(&mut objective, &dark, self.settings.iterations);
        self.evaluations += objective.evaluations;
        self.image = found.x;
        found.ending != Ending::Cancelled
    }

    /// No emission, and the image that was found first.
    pub fn dark(&self, count: usize) -> Vec<f64> {
        let mut dark = vec![0.0; count];
        dark[count - self.image.len()..].copy_from_slice(&self.image);
        dark
    }

    pub fn cancelled(&self, x: Vec<f64>, nodes: usize) -> LinearSolution<T> {
        let (fields, image) = x.split_at(x.len() - self.problem.beside());
        let single = |x: &[f64]| x.iter().map(|x| T::of(*x)).collect();
        LinearSolution {
            emission: single(fields),
            quiescent: single(image),
            certificate: None,
            stationarity: None,
            ending: Ending::Cancelled,
            rounds: self.round,
            nodes,
            evaluations: self.evaluations,
            bytes: self.bytes,
        }
    }

    /// Minimises over the nodes that count.
    pub fn minimise(
        &mut self,
        objective: &mut Objective<'_, '_, T>,
        x: &[f64],
        iterations: usize,
    ) -> Descended {
        let nodes = objective.operator.active.count();
        let (round, before) = (self.round, self.evaluations);
        let mut iteration = 0;
        let watch = &mut *self.watch;
        let mut each = |value: f64| {
            iteration += 1;
            watch(&LinearProgress { round, evaluations: before + iteration, value, nodes })
        };
        let each: &mut Each<'_> = &mut each;
        let LinearSettings { tolerance, settled, .. } = *self.settings;
        // χ² of N data scatters by √(2 N), √(2/N) of itself: `settled` is a part of that.
        let settled = settled * (2.0 / objective.data.count as f64).sqrt();
        let stop = Stop { iterations, tolerance, settled };
        let scaled = Scaled::new(objective, self.problem.upper);
        Descent::new(scaled, x, each).run(stop)
    }

    /// The coarse problem's solution at the nodes of the grid, and where they count.
    pub fn coarse(&mut self, coarse: Coarse) -> Result<Option<Start>, Error> {
        let fine = self.problem.voxels;
        let voxels = Voxels { nodes: fine.nodes.map(|n| n.min(coarse.nodes)), ..fine };
        let convex = self.problem.data()?.is_convex();
        // Without phases more frames are needed to tell solutions apart; what changes may be seen in one alone.
        let stride = match (convex, self.problem.change.is_any()) {
            (_, true) => 1,
            (true, _) => coarse.stride,
            (false, _) => coarse.stride.div_ceil(2),
        };
        let frames: Vec<usize> = self.problem.frames.iter().copied().step_by(stride).collect();
        // A Gaussian prior belongs to the nodes of the fine grid.
        let problem =
            LinearProblem { voxels, frames: &frames, priors: &[], gaussian: None, ..*self.problem };
        let data = problem.data()?;
        let operator = Operator::new(problem.walk(), problem.all(), &frames, self.settings.memory);
        self.bytes = self.bytes.max(operator.bytes());
        let mut objective = Objective::new(&operator, &data, problem.penalised(&data));
        let found = self.coarse_field(&mut objective, coarse.iterations)?;
        self.evaluations += objective.evaluations;
        let Some((x, lit)) = found else { return Ok(None) };
        let refined = |x: &[f64]| -> Result<Vec<f64>, Error> {
            let all = operator.active.expand(x);
            let (fields, image) = all.split_at(all.len() - operator.active.beside);
            let knots = fields.chunks_exact(voxels.count());
            let fields = knots.map(|knot| refined(&voxels, knot, &fine));
            let mut all = fields.collect::<Result<Vec<_>, _>>()?.concat();
            all.extend_from_slice(image);
            Ok(all)
        };
        self.lit = lit.map_or(Ok(Vec::new()), |lit| refined(&lit))?;
        let x = refined(&x)?;
        // Parameters of a quiescent image have another unit: they do not say what is bright.
        let fields = &x[..x.len() - operator.active.beside];
        let least = THRESHOLD * fields.iter().fold(0.0f64, |most, x| most.max(*x));
        let bright: Vec<bool> = fields.iter().map(|x| *x > least).collect();
        let mut is_active = dilated(bright, fine.nodes, DILATION);
        is_active.resize(x.len(), true);
        let x = x.iter().zip(&is_active).map(|(x, active)| if *active { *x } else { 0.0 });
        Ok(Some((x.collect(), is_active)))
    }

    /// Solves the coarse problem from a dark field, or from lit ones where data are not convex; returns its field, and
    /// where it began.
    fn coarse_field(
        &mut self,
        objective: &mut Objective<'_, '_, T>,
        iterations: usize,
    ) -> Result<Option<Coarsely>, Error> {
        if !objective.data.is_convex() {
            let lit = self.lit(objective, Trials { iterations: PATIENCE * iterations, ..MANY })?;
            return Ok(lit.map(|InitialField { start, x, .. }| (x, Some(start))));
        }
        let dark = self.dark(objective.operator.active.count());
        let found = self.minimise(objective, &dark, iterations);
        Ok((found.ending != Ending::Cancelled).then_some((found.x, None)))
    }

    /// Value and slope at the lit field, where there is one.
    pub fn reference(&mut self, data: &Data<'_, T>) -> Result<(), Error> {
        if data.is_convex() {
            return Ok(());
        }
        let problem = self.problem;
        // Rows of all nodes are not worth their memory for a single evaluation.
        let operator = Operator::new(problem.walk(), problem.all(), problem.frames, 0);
        let mut objective = Objective::new(&operator, data, problem.penalised(data));
        let (value, gradient) = objective.everywhere(&self.lit);
        self.evaluations += 1;
        let slope = gradient.iter().fold(0.0f64, |most, g| most.max(g.abs()));
        self.at_lit = [objective.finite(value, &self.lit)?, slope];
        Ok(())
    }

    /// Minimises over the nodes that count, looks at all of them, and says which count next; the solution,
    /// if nothing is to be added.
    pub fn round(
        &mut self,
        data: &Data<'_, T>,
        x: &mut Vec<f64>,
        is_active: &mut Vec<bool>,
    ) -> Result<Option<LinearSolution<T>>, Error> {
        let (problem, settings) = (self.problem, self.settings);
        let active = problem.active(is_active);
        let operator = Operator::new(problem.walk(), active, problem.frames, settings.memory);
        self.bytes = self.bytes.max(operator.bytes());
        // The first round does not know yet where births are: all cost the same.
        let prices = match self.round {
            0 | 1 => Vec::new(),
            _ => problem.change.prices(x, problem.voxels.shape()),
        };
        let terms = Penalised { prices: &prices, ..problem.penalised(data) };
        let mut objective = Objective::new(&operator, data, terms);
        let (dark, dark_slope) = objective.nothing();
        let start = operator.active.gather(x);
        let Descended { x: mut inner, ending, .. } =
            self.minimise(&mut objective, &start, settings.iterations);
        if ending == Ending::Cancelled {
            self.evaluations += objective.evaluations;
            *x = operator.active.expand(&inner);
            return Ok(Some(self.cancelled(core::mem::take(x), operator.active.count())));
        }
        // Value and gradient below have to be those of the field that is returned.
        self.rescale(&objective, &mut inner)?;
        *x = operator.active.expand(&inner);
        let (value, gradient) = objective.everywhere(&inner);
        // Nodes that must stay dark are no part of the box: their slopes would widen the gap.
        let gradient = problem.only_allowed(gradient);
        self.evaluations += objective.evaluations;
        let (upper, value) = (problem.upper, objective.finite(value, &inner)?);
        let (gap, violation) = Certificate::bounds(x, &gradient, upper);
        let convex = data.is_convex();
        // A dark field has no slope where data are not convex: the lit one gives the scale.
        let slope = if convex { dark_slope } else { self.at_lit[1] };
        // As long as those that count violate the conditions, others need not satisfy them any better.
        let inside = Certificate::bounds(&inner, &operator.active.gather(&gradient), upper).1;
        let least = -inside.max(ADMISSION * slope);
        let outside = |k: &usize| !is_active[*k] && gradient[*k] < least;
        let admitted: Vec<bool> = (0..x.len()).map(|k| outside(&k)).collect();
        // A descent that ran out of iterations goes on in another round, with new nodes or without.
        // Nor does the first one know the prices of what it has found.
        let is_priced = self.round > 1 || !problem.change.is_sharpened();
        let is_settled = ending != Ending::Exhausted && is_priced;
        let none = !admitted.iter().any(|new| *new) && is_settled;
        if none || self.round >= settings.rounds {
            let certificate = Certificate { value, dark, gap, violation, dark_slope, upper };
            return Ok(Some(self.solution(
                x,
                convex,
                certificate,
                ending,
                operator.active.count(),
            )));
        }
        let fields = x.len() - problem.beside();
        // Neighbours of light count, so that it can spread; all other dark nodes are dropped.
        let shining = x[..fields].iter().zip(&admitted).map(|(x, new)| *x > 0.0 || *new);
        *is_active = dilated(shining.collect(), problem.voxels.nodes, 1);
        is_active.resize(x.len(), true);
        Ok(None)
    }

    /// A field with what can be said of it.
    fn solution(
        &self,
        x: &[f64],
        convex: bool,
        certificate: Certificate,
        ending: Ending,
        nodes: usize,
    ) -> LinearSolution<T> {
        let Certificate { value, violation, upper, .. } = certificate;
        let [start, start_slope] = self.at_lit;
        let flatness = Stationarity { value, start, violation, start_slope, upper };
        LinearSolution {
            certificate: convex.then_some(certificate),
            stationarity: (!convex).then_some(flatness),
            ending,
            ..self.cancelled(x.to_vec(), nodes)
        }
    }

    /// Brings a field whose data do not know the flux back to the one that was given, within the bound. The bound
    /// acted on another scale before, so that it may cut off some of the peak; it must leave nine tenths of the flux.
    fn rescale(&self, objective: &Objective<'_, '_, T>, x: &mut [f64]) -> Result<(), Error> {
        let Some(flux) = self.problem.flux.filter(|_| objective.data.is_scale_free()) else {
            return Ok(());
        };
        let scale = flux / objective.flux(x);
        let upper = self.problem.upper;
        let needed = x.iter().fold(0.0f64, |most, x| most.max(scale * *x));
        x.iter_mut().for_each(|x| *x = (scale * *x).min(upper));
        if needed > upper && objective.flux(x) < 0.9 * flux {
            return Err(LinearError::TooBright { flux, needed, upper }.into());
        }
        Ok(())
    }
}
