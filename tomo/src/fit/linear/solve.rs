//! The grid's values from movies and visibilities where the axis is known.

use super::certificate::{Certificate, Stationarity};
use super::change::Change;
use super::data::{Data, Weighted};
use super::descent::{Ending, Method};
use super::gaussian::GaussianField;
use super::objective::{Objective, Penalised};
use super::operator::{Active, Operator};
use super::run::{FEW, LIT, Run};
use super::start::{Lit, Trials};
use super::walk::{Voxels, Walk};
use crate::Error;
use crate::dynamics::Axis;
use crate::fit::regulariser::Prior;
use crate::fit::{ForwardModel, Quiescent};
use crate::simd::Float;
use core::ops::ControlFlow;

/// min Σ weight · χ²/data + priors over 0 ≤ e ≤ `upper` at the nodes of a grid.
#[derive(Clone, Copy)]
pub struct LinearProblem<'a, T: Float> {
    /// Nodes of the rays, weighed for the axis ([`ForwardModel::weigh`]).
    pub model: &'a ForwardModel<T>,
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
    /// Mean flux of a frame (the sum of its pixels), for data none of which knows it; others do not look at it.
    pub flux: Option<f64>,
    /// Penalties; none is the usual.
    pub priors: &'a [Prior],
    /// A Gaussian prior of the numbers of the nodes, none is the usual. With it all data count as their errors say:
    /// what is minimised is (Σ weight · χ² + |L (x − center)|²)/data, −2/data times the logarithm of a density if the
    /// weights are 1.
    pub gaussian: Option<&'a GaussianField>,
    /// How emission may change while matter carries it; [`Change::NONE`] is the usual.
    pub change: Change,
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

/// Images that are made together.
const TOGETHER: usize = 32;

/// What is known while iterations go on.
pub struct LinearProgress<'a> {
    /// 0: the coarse problem.
    pub round: usize,
    /// Values, gradients and products so far.
    pub evaluations: usize,
    /// The loss, dimensionless (of the coarse problem, in round 0).
    pub value: f64,
    /// Nodes that count.
    pub nodes: usize,
    /// Entries of the sparse matrix.
    pub entries: usize,
    pub(super) active: &'a Active,
    pub(super) x: &'a [f64],
}

impl LinearProgress<'_> {
    /// Emission at all nodes of the grid (of the coarse one, in round 0), knot after knot.
    pub fn emission(&self) -> Vec<f64> {
        let mut all = self.active.expand(self.x);
        all.truncate(all.len() - self.active.beside);
        all
    }
}

/// A solution.
#[derive(Clone, Debug)]
pub struct LinearSolution<T> {
    /// Emission at the nodes, parameters of the linear grid; knot after knot where it may change.
    pub emission: Vec<T>,
    /// Parameters of what does not move ([`Quiescent`]), where that is recovered.
    pub quiescent: Vec<T>,
    /// How far from the minimum it can be; none if it was cancelled, or the data are not convex in the pixels.
    pub certificate: Option<Certificate>,
    /// How flat the function is there, if the data are not convex: all that can be said then.
    pub stationarity: Option<Stationarity>,
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

impl<T: Float> LinearSolution<T> {
    /// All parameters: those of the linear grid, and behind them those of what does not move.
    pub fn parameters(&self) -> Vec<T> {
        [self.emission.as_slice(), &self.quiescent].concat()
    }
}

/// What some iterations reached.
#[derive(Clone, Debug)]
pub struct Least {
    /// Emission at all nodes of the grid, and parameters of what does not move behind it.
    pub x: Vec<f64>,
    /// What is minimised.
    pub value: f64,
}

/// Told how it goes, says whether to go on.
pub type Watch<'a> = dyn FnMut(&LinearProgress<'_>) -> ControlFlow<()> + 'a;

impl<T: Float + Default> LinearProblem<'_, T> {
    /// Solves it. All threads take part; their number does not change a bit.
    ///
    /// # Errors
    /// If a number is out of its range, data do not fit the rays, or none is in the frames; if a χ² is not finite;
    /// with data that are not convex, if they do not know the flux and none is given, or show no light.
    pub fn solve(
        &self,
        settings: &LinearSettings,
        watch: &mut Watch<'_>,
    ) -> Result<LinearSolution<T>, Error> {
        self.check(settings)?;
        let data = self.data()?;
        let carried = match self.change.is_free() {
            true => Some(LinearProblem { change: Change::NONE, ..*self }.solve(settings, watch)?),
            false => None,
        };
        let mut run = Run::new(self, settings, watch);
        if !run.image_first(&data) {
            return Ok(run.cancelled(run.dark(self.unknowns()), 0));
        }
        // A prior has something to say of every node.
        let coarse = settings.coarse.filter(|_| self.gaussian.is_none() || !data.is_convex());
        let coarse = coarse.or((!data.is_convex()).then_some(LIT));
        let (mut x, mut is_active) = match coarse {
            Some(coarse) => match run.coarse(coarse)? {
                Some(start) => start,
                None => return Ok(run.cancelled(vec![0.0; self.unknowns()], 0)),
            },
            None => {
                let dark = || run.dark(self.unknowns());
                (self.center().unwrap_or_else(dark), vec![true; self.unknowns()])
            }
        };
        if let Some(carried) = carried {
            if carried.ending == Ending::Cancelled {
                return Ok(run.cancelled(x, 0));
            }
            // From a field that matter carries unchanged: no price is too high for it.
            let field: Vec<f64> = carried.emission.iter().map(|e| e.double()).collect();
            x = self.change.steady(&field);
            x.extend(carried.quiescent.iter().map(|x| x.double()));
            is_active.iter_mut().zip(&x).for_each(|(active, x)| *active |= *x > 0.0);
        }
        run.reference(&data)?;
        loop {
            run.round += 1;
            let done = run.round(&data, &mut x, &mut is_active)?;
            if let Some(solution) = done {
                return Ok(solution);
            }
        }
    }

    /// What some iterations over all nodes reach from a dark field, or from the best lit one where data are
    /// not convex.
    ///
    /// # Errors
    /// As those of [`solve`](Self::solve).
    pub fn least(&self, iterations: usize) -> Result<Least, Error> {
        self.least_from(None, iterations)
    }

    /// The same from a field at all nodes, where data are convex.
    ///
    /// # Errors
    /// As those of [`solve`](Self::solve).
    ///
    /// # Panics
    /// If the field has another number of values.
    pub fn least_from(&self, start: Option<&[f64]>, iterations: usize) -> Result<Least, Error> {
        let settings = LinearSettings { coarse: None, tolerance: 0.0, ..LinearSettings::default() };
        self.check(&settings)?;
        let data = self.data()?;
        let operator = Operator::new(self.walk(), self.all(), self.frames, settings.memory);
        let terms = self.penalised(&data);
        let mut objective = Objective::new(&operator, &data, &terms);
        let mut watch = |_: &LinearProgress<'_>| ControlFlow::Continue(());
        let mut run = Run::new(self, &settings, &mut watch);
        if !data.is_convex() {
            let lit = run.lit(&mut objective, Trials { iterations, ..FEW })?;
            let dark = || Least { x: vec![0.0; self.unknowns()], value: f64::INFINITY };
            return Ok(lit.map_or_else(dark, |Lit { x, value, .. }| Least { x, value }));
        }
        let start = start.map_or_else(|| vec![0.0; self.unknowns()], <[f64]>::to_vec);
        assert!(start.len() == self.unknowns());
        let found = run.minimise(&mut objective, &start, iterations);
        let value = objective.finite(found.value, &found.x)?;
        Ok(Least { x: found.x, value })
    }

    /// The matrix from voxels to pixels: frame by frame of [`frames`](Self::frames), pixel by pixel, a row of all voxels
    /// (and knots), in double precision.
    pub fn rows(&self) -> Vec<Vec<f64>> {
        let operator = Operator::new(self.walk(), self.all(), self.frames, usize::MAX);
        operator.all_rows()
    }

    /// The loss of the frames in a field at the nodes (knot after knot), with the parameters of what does not move behind
    /// it where that is recovered; without penalties.
    ///
    /// # Errors
    /// If a number is out of its range, or the field has other nodes.
    pub fn misfit(&self, emission: &[T]) -> Result<f64, Error> {
        if emission.len() != self.unknowns() {
            let allowed = "as many as the nodes at all knots";
            return Err(Error::out_of_range("values", emission.len() as f64, allowed));
        }
        let shines: Vec<bool> = emission.iter().map(|x| *x != T::zero()).collect();
        let data = self.data()?;
        let operator = Operator::new(self.walk(), self.active(&shines), self.frames, 0);
        let x = operator.active.gather(emission);
        let (mut slopes, mut sum) = (vec![T::zero(); self.model.pixels()], 0.0);
        for (k, frames) in self.frames.chunks(TOGETHER).enumerate() {
            let images = operator.some_images(&x, k * TOGETHER..k * TOGETHER + frames.len());
            for (frame, image) in frames.iter().zip(images.chunks_exact(slopes.len())) {
                sum += data.value(*frame, image, &mut slopes);
            }
        }
        Ok(sum)
    }

    /// Where a prior's density is highest: there a descent without a coarse problem begins.
    fn center(&self) -> Option<Vec<f64>> {
        let inside = |x: &f64| x.clamp(0.0, self.upper);
        self.gaussian.map(|gaussian| gaussian.center().iter().map(inside).collect())
    }

    pub(super) fn data(&self) -> Result<Data<'_, T>, Error> {
        let data = Data::new(self.terms, self.frames, self.model.pixels(), self.model.frames())?;
        Ok(if self.gaussian.is_some() { data.together(self.frames) } else { data })
    }

    pub(super) fn walk(&self) -> Walk<'_, T> {
        Walk::new(self.model, self.axis, (self.voxels, self.change.knots))
    }

    /// All nodes at all knots.
    pub(super) fn all(&self) -> Active {
        self.active(&vec![true; self.unknowns()])
    }

    /// These nodes, knot after knot.
    pub(super) fn active(&self, is_active: &[bool]) -> Active {
        Active::new(is_active, &self.voxels.corners(), self.beside())
    }

    /// Values at all nodes and knots, and parameters of what does not move.
    pub(super) fn unknowns(&self) -> usize {
        self.voxels.count() * self.change.knots.count + self.beside()
    }

    /// Parameters of what does not move.
    pub(super) fn beside(&self) -> usize {
        self.model.quiescent.as_ref().map_or(0, Quiescent::columns)
    }

    pub(super) fn penalised(&self, data: &Data<'_, T>) -> Penalised<'_> {
        let (priors, change, upper) = (self.priors, self.change, self.upper);
        let gaussian = self.gaussian.map(|gaussian| (gaussian, 1.0 / data.count as f64));
        let quiescent = self.model.quiescent.as_ref();
        Penalised { priors, shape: self.voxels.shape(), gaussian, change, quiescent, upper }
    }

    fn check(&self, settings: &LinearSettings) -> Result<(), Error> {
        let LinearProblem { upper, flux, .. } = *self;
        let check = |field, value: f64, ok, allowed| {
            if ok { Ok(()) } else { Err(Error::out_of_range(field, value, allowed)) }
        };
        self.voxels.field()?;
        self.change.checked()?;
        if let Some(gaussian) = self.gaussian {
            let (nodes, allowed) = (gaussian.count(), "those of the grid at one knot");
            check("nodes of the prior", nodes as f64, nodes == self.unknowns(), allowed)?;
        }
        let positive = |x: f64| x.is_finite() && x > 0.0;
        check("upper", upper, positive(upper), "above 0")?;
        let of_image = self.model.quiescent.as_ref().map_or(upper, |image| image.most);
        check("most of the quiescent image", of_image, of_image == upper, "upper")?;
        check("flux", flux.unwrap_or(1.0), flux.is_none_or(positive), "above 0")?;
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
