//! The grid's values from movies and visibilities where the axis is known.

use super::change::Change;
use super::descent::Ending;
use super::initial_fields::{InitialField, Trials};
use super::objective::Objective;
use super::operator::Operator;
use super::problem::LinearProblem;
use super::run::{FEW, LIT, Run};
use super::settings::LinearSettings;
use super::solution::{Least, LinearProgress, LinearSolution, Watch};
use crate::Error;
use core::ops::ControlFlow;
use kerrlight_common::simd::Float;

/// Images that are made together.
const TOGETHER: usize = 32;

impl<T: Float> LinearProblem<'_, T> {
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
        // A prior has something to say of every node: none is left out at first. Data that are not
        // convex need a lit field all the same.
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
            // Light at nodes that do not count would be lost.
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

    /// Returns the field that some iterations over all nodes reach from a field at all nodes; if none is given, from a dark
    /// one, or from where a prior's density is highest, or from the best lit field where data are not convex.
    ///
    /// # Errors
    /// As those of [`solve`](Self::solve).
    ///
    /// # Panics
    /// If the field has another number of values.
    pub fn least(&self, start: Option<&[f64]>, iterations: usize) -> Result<Least, Error> {
        // Values of many similar problems are compared: each takes all of its iterations.
        let settings = LinearSettings { coarse: None, tolerance: 0.0, ..LinearSettings::default() };
        self.check(&settings)?;
        let data = self.data()?;
        let operator = Operator::new(self.walk(), self.all(), self.frames, settings.memory);
        let mut objective = Objective::new(&operator, &data, self.penalised(&data));
        let mut watch = |_: &LinearProgress| ControlFlow::Continue(());
        let mut run = Run::new(self, &settings, &mut watch);
        if start.is_none() && !data.is_convex() {
            let lit = run.lit(&mut objective, Trials { iterations, ..FEW })?;
            let dark = || Least { x: vec![0.0; self.unknowns()], value: f64::INFINITY };
            let everywhere = |InitialField { x, value, .. }: InitialField| Least {
                x: operator.active.expand(&x),
                value,
            };
            return Ok(lit.map_or_else(dark, everywhere));
        }
        let dark = || self.center().unwrap_or_else(|| vec![0.0; self.unknowns()]);
        let start = start.map_or_else(dark, <[f64]>::to_vec);
        assert!(start.len() == self.unknowns());
        // Nodes where no emission may be are not among those that are solved for.
        let start = operator.active.gather(&start);
        let found = run.minimise(&mut objective, &start, iterations);
        let value = objective.finite(found.value, &found.x)?;
        Ok(Least { x: operator.active.expand(&found.x), value })
    }

    /// The loss of the frames in a field at the nodes (knot after knot), with the parameters of what does not move behind
    /// it where that is recovered; without penalties.
    ///
    /// # Errors
    /// If a number is out of its range, or the field has other nodes.
    pub fn misfit(&self, emission: &[T]) -> Result<f64, Error> {
        let ok = emission.len() == self.unknowns();
        Error::check("values", emission.len() as f64, ok, "as many as the nodes at all knots")?;
        // Dark nodes add nothing to an image.
        let shines: Vec<bool> = emission.iter().map(|x| *x != T::zero()).collect();
        let data = self.data()?;
        let operator = Operator::new(self.walk(), self.active(&shines), self.frames, 0);
        let x = operator.active.gather(emission);
        let (mut slopes, mut sum) = (vec![T::zero(); self.model.pixels()], 0.0);
        // Some frames at a time: a movie may be larger than memory.
        for (k, frames) in self.frames.chunks(TOGETHER).enumerate() {
            let images = operator.some_images(&x, k * TOGETHER..k * TOGETHER + frames.len());
            for (frame, image) in frames.iter().zip(images.chunks_exact(slopes.len())) {
                sum += data.value(*frame, image, &mut slopes);
            }
        }
        Ok(sum)
    }
}
