//! The grid's values from movies and visibilities where the axis is known.

use super::certificate::Certificate;
use super::data::{Data, Weighted};
use super::descent::{Descent, Each, Ending, Method, Stop};
use super::nodes::{dilated, refined};
use super::objective::{Objective, Prior};
use super::operator::{Active, Operator};
use super::scaled::Scaled;
use super::walk::{Voxels, Walk};
use crate::dynamics::Axis;
use crate::fit::Chain;
use crate::simd::Scalar;
use core::ops::ControlFlow;
use kerrlight_geodesic::OutOfRange;

/// min Σ weight · χ²/data + priors over 0 ≤ e ≤ `upper` at the nodes of a grid.
#[derive(Clone, Copy)]
pub struct LinearProblem<'a, T: Scalar> {
    /// Nodes of the rays, weighed for the axis ([`Chain::weigh`]).
    pub chain: &'a Chain<T>,
    /// The axis that matter turns about.
    pub axis: Axis,
    /// The frames of the movie that count.
    pub frames: &'a [usize],
    /// The data.
    pub terms: &'a [Weighted<'a, T>],
    /// The grid.
    pub voxels: Voxels,
    /// The largest emission that is allowed; the certificate is about fields that are nowhere brighter.
    pub upper: f64,
    /// Penalties; none is the usual.
    pub priors: &'a [Prior],
}

/// Where a solution is first looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coarse {
    /// Nodes along each axis of the coarse grid.
    pub nodes: usize,
    /// Every how many-eth frame counts.
    pub stride: usize,
    /// Iterations there.
    pub iterations: usize,
}

/// How a linear problem is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearSettings {
    /// By which steps; quasi-Newton ones in place of conjugate gradients where the problem is not quadratic.
    pub method: Method,
    /// The coarse problem whose solution says where to begin; all nodes of the grid count at once, without one.
    pub coarse: Option<Coarse>,
    /// Nodes count at first where the coarse solution exceeds this part of its maximum, or a node not farther than
    /// `dilation` along each axis has it so.
    pub threshold: f64,
    /// In nodes of the grid.
    pub dilation: usize,
    /// Times that nodes may be admitted again.
    pub rounds: usize,
    /// Iterations in each round.
    pub iterations: usize,
    /// A round ends where the projected gradient has fallen to this part of what it began with.
    pub tolerance: f64,
    /// Nodes are admitted whose slope is below minus this part of the largest one where nothing shines, and
    /// that violate the conditions for a minimum more than any that counts already.
    pub admission: f64,
    /// Bytes of the sparse matrix; frames beyond are computed anew in each iteration.
    pub memory: usize,
}

impl Default for LinearSettings {
    fn default() -> Self {
        Self {
            method: Method::QuasiNewton,
            coarse: Some(Coarse { nodes: 32, stride: 8, iterations: 20 }),
            threshold: 0.02,
            dilation: 2,
            rounds: 8,
            iterations: 80,
            tolerance: 1e-4,
            admission: 1e-4,
            memory: 768 << 20,
        }
    }
}

/// What is known while iterations go on.
pub struct LinearProgress<'a> {
    /// 0: the coarse problem.
    pub round: usize,
    /// Values, gradients and products so far.
    pub evaluations: usize,
    /// Of what is minimised (of the coarse problem, in round 0).
    pub value: f64,
    /// Nodes that count.
    pub nodes: usize,
    /// Entries of the sparse matrix.
    pub entries: usize,
    active: &'a Active,
    x: &'a [f64],
}

impl LinearProgress<'_> {
    /// Emission at all nodes of the grid (of the coarse one, in round 0).
    pub fn emission(&self) -> Vec<f64> {
        self.active.expand(self.x)
    }
}

/// A solution.
#[derive(Clone, Debug)]
pub struct LinearSolution<T> {
    /// Emission at the nodes, parameters of the linear grid.
    pub emission: Vec<T>,
    /// How good it is; none if it was cancelled.
    pub certificate: Option<Certificate>,
    /// Why the last round ended.
    pub ending: Ending,
    /// Rounds, the coarse problem not counted.
    pub rounds: usize,
    /// Nodes that counted in the last round.
    pub nodes: usize,
    /// Values, gradients and products with second derivatives, those over all nodes included.
    pub evaluations: usize,
    /// Largest bytes of a sparse matrix.
    pub bytes: usize,
}

/// Told how it goes, says whether to go on.
pub type Watch<'a> = dyn FnMut(&LinearProgress<'_>) -> ControlFlow<()> + 'a;

impl<T: Scalar + Default> LinearProblem<'_, T> {
    /// Solves it. All threads take part; their number does not change a bit.
    ///
    /// # Errors
    /// If a number is out of its range, data do not fit the rays, or none is in the frames.
    pub fn solve(
        &self,
        settings: &LinearSettings,
        watch: &mut Watch<'_>,
    ) -> Result<LinearSolution<T>, OutOfRange> {
        self.check(settings)?;
        let mut run = Run { problem: self, settings, watch, evaluations: 0, bytes: 0, round: 0 };
        let (mut x, mut is_active) = match settings.coarse {
            Some(coarse) => match run.coarse(coarse)? {
                Some(start) => start,
                None => return Ok(run.cancelled(vec![0.0; self.voxels.count()], 0)),
            },
            None => (vec![0.0; self.voxels.count()], vec![true; self.voxels.count()]),
        };
        let data = self.data()?;
        loop {
            run.round += 1;
            let done = run.round(&data, &mut x, &mut is_active);
            if let Some(solution) = done {
                return Ok(solution);
            }
        }
    }

    /// The value that some iterations over all nodes reach from a dark field.
    ///
    /// # Errors
    /// As those of [`solve`](Self::solve).
    pub fn least(&self, iterations: usize) -> Result<f64, OutOfRange> {
        let settings = LinearSettings { coarse: None, tolerance: 0.0, ..LinearSettings::default() };
        self.check(&settings)?;
        let data = self.data()?;
        let active = Active::new(&vec![true; self.voxels.count()], self.voxels.corners());
        let operator = Operator::new(self.walk(), active, self.frames, settings.memory);
        let shape = self.voxels.shape();
        let mut objective = Objective::new(&operator, &data, self.priors, shape);
        let mut least = f64::INFINITY;
        let mut watch = |progress: &LinearProgress<'_>| {
            least = least.min(progress.value);
            ControlFlow::Continue(())
        };
        let mut run = Run {
            problem: self,
            settings: &settings,
            watch: &mut watch,
            evaluations: 0,
            bytes: 0,
            round: 0,
        };
        run.minimise(&mut objective, &vec![0.0; self.voxels.count()], iterations);
        // Nothing helps, where nothing was seen.
        Ok(if least.is_finite() { least } else { objective.nothing().0 })
    }

    fn data(&self) -> Result<Data<'_, T>, OutOfRange> {
        Data::new(self.terms, self.frames, self.chain.pixels(), self.chain.frames())
    }

    fn walk(&self) -> Walk<'_, T> {
        Walk::new(self.chain, self.axis, self.voxels)
    }

    fn check(&self, settings: &LinearSettings) -> Result<(), OutOfRange> {
        let check = |field, value: f64, ok, allowed| {
            if ok { Ok(()) } else { Err(OutOfRange { field, value, allowed }) }
        };
        self.voxels.grid()?;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        check("upper", self.upper, positive(self.upper), "above 0")?;
        for Prior { regulariser, weight } in self.priors {
            regulariser.checked()?;
            check("prior weight", *weight, weight.is_finite() && *weight >= 0.0, "0 or above")?;
        }
        let LinearSettings { threshold, tolerance, admission, .. } = *settings;
        check("threshold", threshold, (0.0..1.0).contains(&threshold), "0 to 1")?;
        check("tolerance", tolerance, (0.0..1.0).contains(&tolerance), "0 to 1")?;
        check("admission", admission, (0.0..1.0).contains(&admission), "0 to 1")?;
        check("rounds", settings.rounds as f64, settings.rounds > 0, "1 or more")?;
        if let Some(Coarse { nodes, stride, .. }) = settings.coarse {
            check("coarse nodes", nodes as f64, nodes >= 2, "2 or more")?;
            check("coarse stride", stride as f64, stride >= 1, "1 or more")?;
        }
        Ok(())
    }
}

/// Values at the nodes, and which of them count.
type Start = (Vec<f64>, Vec<bool>);

/// A solution under way.
struct Run<'a, 'p, 'w, T: Scalar> {
    problem: &'a LinearProblem<'p, T>,
    settings: &'a LinearSettings,
    watch: &'a mut Watch<'w>,
    evaluations: usize,
    bytes: usize,
    round: usize,
}

impl<T: Scalar + Default> Run<'_, '_, '_, T> {
    fn cancelled(&self, x: Vec<f64>, nodes: usize) -> LinearSolution<T> {
        LinearSolution {
            emission: x.iter().map(|x| T::of(*x)).collect(),
            certificate: None,
            ending: Ending::Cancelled,
            rounds: self.round,
            nodes,
            evaluations: self.evaluations,
            bytes: self.bytes,
        }
    }

    /// Minimises over the nodes that count.
    fn minimise(
        &mut self,
        objective: &mut Objective<'_, '_, T>,
        x: &[f64],
        iterations: usize,
    ) -> (Vec<f64>, Ending) {
        let method = match self.settings.method {
            Method::ConjugateGradients if !objective.is_quadratic() => Method::QuasiNewton,
            method => method,
        };
        let (active, entries) = (&objective.operator.active, objective.operator.entries());
        let (round, before) = (self.round, self.evaluations);
        let mut iteration = 0;
        let watch = &mut *self.watch;
        let mut each = |value: f64, x: &[f64]| {
            iteration += 1;
            let (evaluations, nodes) = (before + iteration, active.count());
            watch(&LinearProgress { round, evaluations, value, nodes, entries, active, x })
        };
        let each: &mut Each<'_> = &mut each;
        let stop = Stop { iterations, tolerance: self.settings.tolerance };
        let scaled = Scaled::new(objective, self.problem.upper);
        Descent::new(scaled, x, each).run(method, stop)
    }

    /// The coarse problem's solution at the nodes of the grid, and where they count.
    fn coarse(&mut self, coarse: Coarse) -> Result<Option<Start>, OutOfRange> {
        let fine = self.problem.voxels;
        let voxels = Voxels { nodes: fine.nodes.map(|n| n.min(coarse.nodes)), ..fine };
        let frames: Vec<usize> =
            self.problem.frames.iter().copied().step_by(coarse.stride).collect();
        let problem = LinearProblem { voxels, frames: &frames, priors: &[], ..*self.problem };
        let data = problem.data()?;
        let active = Active::new(&vec![true; voxels.count()], voxels.corners());
        let operator = Operator::new(problem.walk(), active, &frames, self.settings.memory);
        self.bytes = self.bytes.max(operator.bytes());
        let mut objective = Objective::new(&operator, &data, &[], voxels.shape());
        let dark = vec![0.0; operator.active.count()];
        let (x, ending) = self.minimise(&mut objective, &dark, coarse.iterations);
        self.evaluations += objective.evaluations;
        if ending == Ending::Cancelled {
            return Ok(None);
        }
        let x = refined(&voxels, &operator.active.expand(&x), &fine)?;
        let least = self.settings.threshold * x.iter().fold(0.0f64, |most, x| most.max(*x));
        let bright: Vec<bool> = x.iter().map(|x| *x > least).collect();
        let is_active = dilated(bright, fine.nodes, self.settings.dilation);
        let x = x.iter().zip(&is_active).map(|(x, active)| if *active { *x } else { 0.0 });
        Ok(Some((x.collect(), is_active)))
    }

    /// Minimises over the nodes that count, looks at all of them, and says which count next; the solution,
    /// if nothing is to be added.
    fn round(
        &mut self,
        data: &Data<'_, T>,
        x: &mut Vec<f64>,
        is_active: &mut Vec<bool>,
    ) -> Option<LinearSolution<T>> {
        let (problem, settings) = (self.problem, self.settings);
        let active = Active::new(is_active, problem.voxels.corners());
        let operator = Operator::new(problem.walk(), active, problem.frames, settings.memory);
        self.bytes = self.bytes.max(operator.bytes());
        let shape = problem.voxels.shape();
        let mut objective = Objective::new(&operator, data, problem.priors, shape);
        let (dark, dark_slope) = objective.nothing();
        let start = operator.active.gather(x);
        let (inner, ending) = self.minimise(&mut objective, &start, settings.iterations);
        *x = operator.active.expand(&inner);
        if ending == Ending::Cancelled {
            self.evaluations += objective.evaluations;
            return Some(self.cancelled(core::mem::take(x), operator.active.count()));
        }
        let (value, gradient) = objective.everywhere(&inner);
        self.evaluations += objective.evaluations;
        let upper = problem.upper;
        let (gap, violation) = Certificate::bounds(x, &gradient, upper);
        let certificate = Certificate { value, dark, gap, violation, dark_slope, upper };
        // As long as those that count violate the conditions, others need not satisfy them any better.
        let inside = Certificate::bounds(&inner, &operator.active.gather(&gradient), upper).1;
        let least = -inside.max(settings.admission * dark_slope);
        let outside = |k: &usize| !is_active[*k] && gradient[*k] < least;
        let admitted: Vec<bool> = (0..x.len()).map(|k| outside(&k)).collect();
        let none = !admitted.iter().any(|new| *new) && ending != Ending::Exhausted;
        if none || self.round >= settings.rounds {
            return Some(LinearSolution {
                emission: x.iter().map(|x| T::of(*x)).collect(),
                certificate: Some(certificate),
                nodes: operator.active.count(),
                ending,
                ..self.cancelled(Vec::new(), 0)
            });
        }
        let shining: Vec<bool> = x.iter().zip(&admitted).map(|(x, new)| *x > 0.0 || *new).collect();
        *is_active = dilated(shining, problem.voxels.nodes, 1);
        None
    }
}
