//! The geometries around the best one, looked at through several problems: other rays, voxels and pixels.

use super::fit_radius::Reach;
use super::gauss_newton::Polished;
use super::problem::GeometryProblem;
use super::quadratic_form::{Envelope, Evaluations, diagonals, ends, fitted};
use crate::Error;
use kerrlight_common::simd::Float;

/// Neighbours of a geometry.
pub struct Surroundings<'a> {
    polished: &'a Polished,
    /// Voxels of the volume, along each axis.
    nodes: usize,
    reach: Reach,
    seen: Vec<Evaluations>,
}

impl Surroundings<'_> {
    /// Looks at the same geometries through another problem: along other rays, or with other voxels or pixels.
    ///
    /// # Errors
    /// As those of [`polish`](GeometryProblem::polish).
    pub fn look<T: Float + Default>(
        &mut self,
        other: &GeometryProblem<'_, T>,
    ) -> Result<(), Error> {
        let n = self.reach.columns.ncols();
        // The volume's response is that of the same voxels.
        let same = other.effort.nodes == self.nodes;
        let responses = if same { self.polished.responses.as_slice() } else { &[] };
        let start = other.solve(self.polished.best.geometry)?;
        let mut there = Evaluations::default();
        let places = [ends(n), diagonals(n)].concat();
        other.look_at(&start, responses, (&self.reach.columns, places), &mut there)?;
        self.seen.push(there);
        Ok(())
    }

    /// The bowl through all that was looked at; second derivatives of the data count one over `inflation`. None if it has
    /// no middle.
    pub fn envelope<T: Float + Default>(
        &self,
        problem: &GeometryProblem<'_, T>,
        inflation: f64,
    ) -> Option<Envelope> {
        let Self { polished, reach, seen, .. } = self;
        let form = fitted(seen, problem.free.len()).unwrap_or_else(|| reach.form());
        let trials = seen.iter().map(|seen| seen.values.len()).sum();
        let about = polished.best.geometry;
        let found = problem.middle(about, (&form, &reach.columns), inflation, reach.is_wide);
        let ripple = form.ripple;
        found.map(|(geometry, covariance)| Envelope { geometry, covariance, ripple, trials })
    }
}

impl<T: Float + Default> GeometryProblem<'_, T> {
    /// Returns the neighbours of a geometry along the rays of this problem. None if the covariance of the steps that led
    /// there is not finite.
    ///
    /// # Errors
    /// As those of [`polish`](Self::polish).
    pub fn around<'a>(&self, polished: &'a Polished) -> Result<Option<Surroundings<'a>>, Error> {
        let Some(reach) = self.reach(polished)? else { return Ok(None) };
        let mut seen = reach.seen();
        let places = (&reach.columns, diagonals(self.free.len()));
        self.look_at(&polished.best, &polished.responses, places, &mut seen)?;
        Ok(Some(Surroundings { polished, nodes: self.effort.nodes, reach, seen: vec![seen] }))
    }
}
