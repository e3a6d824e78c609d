//! What finer models would move a world by: one Gauss–Newton step of each from the best world.

use super::covariance::covariance;
use super::polish::{Bowl, Polish};
use super::problem::{Estimate, WorldProblem};
use super::{Free, World};
use crate::Error;
use kerrlight_common::simd::Float;
use nalgebra::DVector;

/// The best volume of a world, and the bowl there.
pub struct Standing {
    best: Estimate,
    bowl: Bowl,
    /// χ²/2 above that of a right model, by more than its scatter by chance.
    excess: f64,
}

/// A kind of refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// What becomes finer.
    pub source: &'static str,
    /// What endless refinement moves the world by, over what this one does.
    pub onwards: f64,
}

/// What a refinement does.
pub struct Refined {
    kind: Refinement,
    /// By what it moves the world, in units of scales.
    step: DVector<f64>,
    /// By what that lowers χ²/2, and by what the refinement itself does.
    fall: f64,
    gain: f64,
}

/// An error that the model has of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelError {
    /// What of the model makes it.
    pub source: &'static str,
    /// By what it may have moved each free parameter, in its own unit.
    pub step: Vec<f64>,
}

/// Standard deviations of χ², √(2 N) for N data, that count as chance.
const BY_CHANCE: f64 = 2.0;
/// The least part of an excess that refinements are taken to explain: below it they are no measure of it.
const LEAST: f64 = 0.02;

impl<T: Float + Default> WorldProblem<'_, T> {
    /// The best volume of a world.
    ///
    /// # Errors
    /// As those of [`polish`](Self::polish).
    pub fn standing(&self, world: World) -> Result<Standing, Error> {
        let best = self.solve(world)?;
        let bowl = self.bowl(&best, Polish::default().following)?;
        let data = best.chi2 / self.reduced(best.chi2);
        let chance = BY_CHANCE * (2.0 * data).sqrt();
        let excess = 0.5 * (self.scale * best.chi2 - data - chance).max(0.0);
        Ok(Standing { best, bowl, excess })
    }
}

impl Standing {
    /// What a finer model of the same data does; none if its bowl is not finite.
    ///
    /// # Errors
    /// As those of [`polish`](WorldProblem::polish).
    pub fn refined<T: Float + Default>(
        &self,
        kind: Refinement,
        finer: &WorldProblem<'_, T>,
    ) -> Result<Option<Refined>, Error> {
        let there = finer.solve(self.best.world)?;
        let bowl = finer.bowl(&there, Polish::default().following)?;
        let covariance = covariance(finer.free, &self.best.world, &bowl.bends, 1.0);
        let Some(covariance) = covariance else { return Ok(None) };
        // Slopes of the model itself are ripples beside the middle of its bowl.
        let step = -covariance * (bowl.slopes - &self.bowl.slopes);
        let fall = 0.5 * step.dot(&(&bowl.bends * &step));
        Ok(Some(Refined { kind, step, fall, gain: self.best.value - there.value }))
    }

    /// Errors that refinements make likely.
    ///
    /// A model that lacks something of size s moves the world in proportion to s, and χ² by s²: what refinements leave of an
    /// excess of χ² moves the world further, as if they went on, but by no more than the excess can at all (Cauchy and
    /// Schwarz). A refinement that the data contradict counts as little as they say it is likely.
    pub fn errors(&self, free: &[Free], refined: &[Refined]) -> Vec<ModelError> {
        let gained: f64 = refined.iter().map(|refined| refined.gain.max(0.0)).sum();
        let part = if self.excess > 0.0 { (gained / self.excess).clamp(LEAST, 1.0) } else { 1.0 };
        let further = 1.0 / (1.0 - (1.0 - part).sqrt());
        let error = |Refined { kind, step, fall, gain }: &Refined| {
            let most = (self.excess / fall).sqrt();
            let likely = (0.5 * gain.min(0.0)).exp();
            let factor = likely * further.min(most).max(kind.onwards);
            let own = |(free, step): (&Free, &f64)| factor * step * free.parameter.scale();
            let step = free.iter().zip(step.iter()).map(own).collect();
            ModelError { source: kind.source, step }
        };
        refined.iter().map(error).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::world::{Parameter, Prior};
    use nalgebra::DMatrix;

    fn standing(excess: f64) -> Standing {
        let best = Estimate { world: World::new(0.3, 1.0), x: Vec::new(), chi2: 0.0, value: 0.0 };
        let (slopes, bends) = (DVector::zeros(1), DMatrix::identity(1, 1));
        Standing { best, bowl: Bowl { slopes, bends, responses: Vec::new() }, excess }
    }

    /// The factor on a step of one unit that costs `fall`, of a refinement with this gain.
    fn factor(excess: f64, gain: f64, fall: f64) -> f64 {
        let prior = Prior::Uniform { low: -0.9, high: 0.9 };
        let free = [Free { parameter: Parameter::Spin, prior }];
        let kind = Refinement { source: "voxels", onwards: 1.0 };
        let step = DVector::from_element(1, 1.0 / free[0].parameter.scale());
        let refined = [Refined { kind, step, fall, gain }];
        standing(excess).errors(&free, &refined)[0].step[0]
    }

    /// An error of size s that a refinement reduces to s/2 leaves a quarter of the excess, and moves the world by half of
    /// what it moves it by in all.
    #[test]
    fn exact_what_is_left_of_an_excess_moves_the_world_as_well() {
        assert!((factor(100.0, 75.0, 1.0) - 2.0).abs() < 1e-12);
        // All is explained, or there is nothing to explain.
        assert!((factor(100.0, 120.0, 1.0) - 1.0).abs() < 1e-12);
        assert!((factor(0.0, 5.0, 1.0) - 1.0).abs() < 1e-12);
        // Nothing is: as much as the excess can do, which is a step √100 times as long.
        assert!((factor(100.0, 0.0, 1.0) - 10.0).abs() < 1e-12);
        // Data speak against the refinement, by four standard deviations.
        assert!((factor(0.0, -8.0, 1.0) - (-4.0f64).exp()).abs() < 1e-12);
    }
}
