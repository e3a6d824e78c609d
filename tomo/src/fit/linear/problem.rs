//! A linear problem: what is minimised, and over what.

use super::active::Active;
use super::change::Change;
use super::data::{Data, Weighted};
use super::gaussian::GaussianField;
use super::objective::Penalised;
use super::ray_weights::{Voxels, Walk};
use super::settings::{Coarse, LinearSettings};
use crate::Error;
use crate::fit::loss::regulariser::Prior;
use crate::fit::{ForwardModel, Quiescent};
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;

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
    /// Change of emission while matter carries it; [`Change::NONE`] is the usual.
    pub change: Change,
}

impl<T: Float> LinearProblem<'_, T> {
    /// Returns the field at which a prior's density is highest: there a descent without a coarse problem begins.
    pub(super) fn center(&self) -> Option<Vec<f64>> {
        let inside = |x: &f64| x.clamp(0.0, self.upper);
        self.gaussian.map(|gaussian| gaussian.center().iter().map(inside).collect())
    }

    pub(super) fn data(&self) -> Result<Data<'_, T>, Error> {
        let data = Data::new(self.terms, self.frames, self.model.pixels(), self.model.frames())?;
        Ok(if self.gaussian.is_some() { data.together(self.frames) } else { data })
    }

    pub(super) fn walk(&self) -> Walk<'_, T> {
        Walk::new(self.model, self.axis, self.voxels, self.change.knots)
    }

    /// All nodes at all knots where emission may be.
    pub(super) fn all(&self) -> Active {
        self.active(&vec![true; self.unknowns()])
    }

    /// Those of these nodes, knot after knot, where emission may be.
    pub(super) fn active(&self, is_active: &[bool]) -> Active {
        let allowed = self.allowed();
        let mut is_active = is_active.to_vec();
        // A quiescent image behind the knots may be long enough for another chunk.
        let knots = is_active.chunks_exact_mut(allowed.len()).take(self.change.knots.count);
        knots.flat_map(|knot| knot.iter_mut().zip(&allowed)).for_each(|(x, may)| *x &= *may);
        Active::new(&is_active, &self.voxels.corners(), self.beside())
    }

    /// Returns the nodes of a knot where emission may be.
    fn allowed(&self) -> Vec<bool> {
        let [.., spacing] = self.voxels.shape().spacing;
        let allows = |node| self.change.allows(self.voxels.position(node), spacing);
        (0..self.voxels.count()).map(allows).collect()
    }

    /// A gradient without slopes of nodes where no emission may be.
    pub(super) fn only_allowed(&self, mut gradient: Vec<f64>) -> Vec<f64> {
        let allowed = self.allowed();
        let knots = gradient.chunks_exact_mut(allowed.len()).take(self.change.knots.count);
        for (slope, _) in
            knots.flat_map(|knot| knot.iter_mut().zip(&allowed)).filter(|(_, may)| !**may)
        {
            *slope = 0.0;
        }
        gradient
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
        Penalised {
            priors,
            shape: self.voxels.shape(),
            gaussian,
            change,
            prices: &[],
            quiescent,
            upper,
        }
    }

    /// Refuses a prior of other nodes.
    pub(super) fn check_prior(&self, nodes: usize) -> Result<(), Error> {
        let ok = nodes == self.unknowns();
        Error::check("nodes of the prior", nodes as f64, ok, "those of the grid at one knot")
    }

    pub(super) fn check(&self, settings: &LinearSettings) -> Result<(), Error> {
        let LinearProblem { upper, flux, .. } = *self;
        let check = Error::check;
        self.voxels.field()?;
        self.change.checked()?;
        self.gaussian.map_or(Ok(()), |gaussian| self.check_prior(gaussian.count()))?;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        check("upper", upper, positive(upper), "above 0")?;
        // Descent and certificate have one bound for all numbers.
        let of_image = self.model.quiescent.as_ref().map_or(upper, |image| image.most);
        check("most of the quiescent image", of_image, of_image == upper, "upper")?;
        check("flux", flux.unwrap_or(1.0), flux.is_none_or(positive), "above 0")?;
        for Prior { regulariser, weight } in self.priors {
            regulariser.checked()?;
            check("prior weight", *weight, weight.is_finite() && *weight >= 0.0, "0 or above")?;
        }
        let tolerance = settings.tolerance;
        check("tolerance", tolerance, (0.0..1.0).contains(&tolerance), "0 to 1")?;
        check("rounds", settings.rounds as f64, settings.rounds > 0, "1 or more")?;
        if let Some(Coarse { nodes, stride, .. }) = settings.coarse {
            check("coarse nodes", nodes as f64, nodes >= 2, "2 or more")?;
            check("coarse stride", stride as f64, stride >= 1, "1 or more")?;
        }
        Ok(())
    }
}
