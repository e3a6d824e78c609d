//! The geometries around the best one, looked at through several problems: other rays, voxels and pixels.

use super::fit_radius::Reach;
use super::gauss_newton::Polished;
use super::problem::GeometryProblem;
use super::quadratic_form::{Envelope, Evaluations, diagonals, ends, fitted};
use crate::Error;
use crate::fit::linear::{Voxels, refined};
use kerrlight_common::simd::Float;
use nalgebra::DMatrix;

/// Neighbours of a geometry.
pub struct Surroundings<'a> {
    polished: &'a Polished,
    voxels: Voxels,
    reach: Reach,
    /// Variance of slopes per place of the reach; none where a prior bounds what the volume follows of the noise.
    scatter: Option<DMatrix<f64>>,
    seen: Vec<Evaluations>,
}

impl Surroundings<'_> {
    /// Looks at the same geometries through another problem: along other rays, or with other voxels or pixels.
    ///
    /// # Errors
    /// As those of [`polish`](GeometryProblem::polish).
    pub fn look<T: Float>(&mut self, other: &GeometryProblem<'_, T>) -> Result<(), Error> {
        let Self { polished, reach, voxels, .. } = self;
        let to = other.voxels();
        // Responses that are carried over spare the other voxels a bowl of their own.
        let on_others = |response: &Vec<f64>| refined(voxels, response, &to);
        let responses: Result<Vec<_>, Error> = polished.responses.iter().map(on_others).collect();
        let start = other.solve(polished.best.geometry)?;
        let n = reach.columns.ncols();
        let places = [ends(n), diagonals(n)].concat();
        let mut there = Evaluations::default();
        other.look_at(&start, &responses?, &reach.columns, places, &mut there)?;
        self.seen.push(there);
        Ok(())
    }

    /// The bowl through all that was looked at; second derivatives of the data count one over `inflation`. None if it has
    /// no middle.
    pub fn envelope<T: Float>(
        &self,
        problem: &GeometryProblem<'_, T>,
        inflation: f64,
    ) -> Option<Envelope> {
        let Self { polished, reach, scatter, seen, .. } = self;
        // Where all lattices together are no bowl, the axes of the first one alone may be.
        let form = fitted(seen, problem.free.len()).unwrap_or_else(|| reach.form());
        let about = polished.best.geometry;
        let (columns, scatter) = (&reach.columns, scatter.as_ref());
        let found = problem.middle(about, &form, columns, scatter, inflation, reach.is_wide);
        let ripple = form.ripple;
        found.map(|(geometry, covariance)| Envelope { geometry, covariance, ripple })
    }
}

impl<T: Float> GeometryProblem<'_, T> {
    /// Returns the neighbours of a geometry along the rays of this problem. None if the covariance of the steps that led
    /// there is not finite.
    ///
    /// # Errors
    /// As those of [`polish`](Self::polish).
    pub fn around<'a>(&self, polished: &'a Polished) -> Result<Option<Surroundings<'a>>, Error> {
        let Some(reach) = self.reach(polished)? else { return Ok(None) };
        let mut seen = reach.seen();
        // The reach has looked at the ends of the axes already.
        let (best, responses) = (&polished.best, &polished.responses);
        self.look_at(best, responses, &reach.columns, diagonals(self.free.len()), &mut seen)?;
        let scatter = match self.gaussian {
            None => Some(self.scatter_of_slopes(&polished.best, &reach.columns)?),
            Some(_) => None,
        };
        Ok(Some(Surroundings { polished, voxels: self.voxels(), reach, scatter, seen: vec![seen] }))
    }
}
