//! Discretisation errors: what finer models would move a geometry by, one Gauss–Newton step of each from the best geometry,
//! and what the χ² that they leave may.

use super::covariance::covariance;
use super::gauss_newton::Bowl;
use super::problem::{Estimate, GeometryProblem};
use super::quadratic_form::in_own_units;
use super::{Free, Geometry};
use crate::Error;
use crate::fit::linear::Weighted;
use kerrlight_common::simd::Float;
use nalgebra::{DMatrix, DVector};

/// The best volume of a geometry, and the bowl there.
pub struct Standing {
    best: Estimate,
    bowl: Bowl,
    /// χ²/2 above that of a right model.
    excess: f64,
}

/// A kind of refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// Part of the model that becomes finer.
    pub source: &'static str,
    /// Ratio of the step of endless refinement to that of this one.
    pub onwards: f64,
}

/// Effect of a refinement.
pub struct Refined {
    kind: Refinement,
    /// Step of the geometry, in units of scales.
    step: DVector<f64>,
    /// Part of its square that is more than chance.
    certain: f64,
    /// Decrease of χ²/2.
    gain: f64,
    /// Excess of χ²/2 of the finer model.
    excess: f64,
}

/// An error that the model has of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelError {
    /// Part of the model that makes it.
    pub source: &'static str,
    /// Its covariance row by row, in the free parameters' own units.
    pub covariance: Vec<f64>,
}

impl ModelError {
    /// Source of what no refinement explains of χ².
    pub const UNEXPLAINED: &'static str = "unexplained χ²";
}

/// All of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelErrors {
    /// Those that are known.
    pub known: Vec<ModelError>,
    /// The kind of data for which finer models cannot be compared, so that errors leave out what they would say.
    pub left_out: Option<&'static str>,
}

/// Standard deviations of χ², √(2 N) for N data, that count as chance.
const BY_CHANCE: f64 = 2.0;

impl<T: Float> GeometryProblem<'_, T> {
    /// Returns what χ²/2 becomes lower by, at least, if images change as those of the same volume do through another model: the
    /// residuals r and that change d, in units of errors, leave (r·d)²/(2 d·d) less.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn gain(&self, at: &Estimate, other: &Self) -> Result<f64, Error> {
        let residuals = |problem: &Self| -> Result<Vec<f64>, Error> {
            let images = problem.images(at.geometry, &self.voxels(), &at.x)?;
            Ok(problem.residuals(&images))
        };
        let (mut along, mut square) = (0.0, 0.0);
        for (r, other) in residuals(self)?.into_iter().zip(residuals(other)?) {
            let d = other - r;
            along -= r * d;
            square += d * d;
        }
        // |r + t d|² is least at t = −r·d/d·d: below 0, residuals point away from the other model.
        Ok(if along > 0.0 { 0.5 * self.scale * along * along / square } else { 0.0 })
    }

    /// Residuals of images, frame after frame, in units of errors.
    fn residuals(&self, images: &[T]) -> Vec<f64> {
        let pixels = images.len() / self.frames.len().max(1);
        let frames = || self.frames.iter().zip(images.chunks_exact(pixels));
        let of = |Weighted { term, .. }: &Weighted<'_, T>| {
            frames().flat_map(|(frame, image)| term.residuals(*frame, image)).collect::<Vec<_>>()
        };
        self.terms.iter().flat_map(of).map(|residual| residual.value).collect()
    }

    /// The best volume of a geometry.
    ///
    /// # Errors
    /// As those of [`polish`](Self::polish).
    pub fn standing(&self, geometry: Geometry) -> Result<Standing, Error> {
        let best = self.solve(geometry)?;
        let bowl = self.bowl(&best)?;
        let excess = self.excess(self.scale * self.left(&best)?);
        Ok(Standing { best, bowl, excess })
    }

    /// Returns the excess of χ²/2 over that of a right model and over its scatter by chance, where it is this over the number
    /// of data.
    pub fn excess(&self, reduced_chi2: f64) -> f64 {
        (self.excess_of_all(reduced_chi2) - 0.5 * BY_CHANCE * (2.0 * self.data()).sqrt()).max(0.0)
    }

    /// The same over the number of data alone: a right model lies below it by what its volume follows of the noise.
    pub fn excess_of_all(&self, reduced_chi2: f64) -> f64 {
        (0.5 * self.data() * (reduced_chi2 - 1.0)).max(0.0)
    }
}

impl Standing {
    /// Returns the effect of a finer model of the same data; none if its bowl is not finite.
    ///
    /// # Errors
    /// As those of [`polish`](GeometryProblem::polish).
    pub fn refined<T: Float>(
        &self,
        kind: Refinement,
        finer: &GeometryProblem<'_, T>,
    ) -> Result<Option<Refined>, Error> {
        // As far from the end as the other volume: slopes that are left over from there cancel.
        let there = finer.solve(self.best.geometry)?;
        let excess = finer.excess(finer.scale * finer.left(&there)?);
        let bowl = finer.bowl(&there)?;
        let left_by =
            |bends| covariance(finer.free, &self.best.geometry, bends, 1.0).filter(is_finite);
        let both = left_by(&bowl.bends).zip(left_by(&self.bowl.bends));
        let Some((finer, own)) = both else { return Ok(None) };
        // Slopes of the model itself are ripples beside the middle of its bowl.
        let slopes = bowl.slopes - &self.bowl.slopes;
        let certain = beyond_chance(&slopes, &finer, &own);
        let step = -finer * slopes;
        Ok(Some(Refined { kind, step, certain, gain: self.best.value - there.value, excess }))
    }

    /// Errors that refinements make likely, each as much as the data do not contradict, and what the excess that they leave
    /// can make.
    ///
    /// Of that excess E no parameter explains anything. A discrepancy of the model with as much χ²/2 along the derivative of
    /// a parameter moves it by √(2 E) times the standard deviation that the data leave it, and by no more in any other
    /// direction (Cauchy and Schwarz): 2 E times their covariance.
    pub fn errors(&self, free: &[Free], refined: &[Refined]) -> Vec<ModelError> {
        let own = |source, covariance: &DMatrix<f64>| ModelError {
            source,
            covariance: in_own_units(free, covariance),
        };
        let of_refined = |Refined { kind, step, certain, gain, excess }: &Refined| {
            // Coarser models follow more of the noise: a finer one with a higher χ² that explains the data is not contradicted.
            let against = (-gain).max(0.0).min(*excess);
            // The square of the step counts exp(−against) times, as a ratio of likelihoods.
            let step = step * (kind.onwards * (-0.5 * against).exp() * certain.sqrt());
            own(kind.source, &(&step * step.transpose()))
        };
        // Several may explain the same.
        let explained = refined.iter().fold(0.0f64, |most, refined| most.max(refined.gain));
        let left = 2.0 * (self.excess - explained).max(0.0);
        let unexplained = covariance(free, &self.best.geometry, &self.bowl.bends, left)
            .filter(|_| left > 0.0)
            .map(|covariance| own(ModelError::UNEXPLAINED, &covariance));
        refined.iter().map(of_refined).chain(unexplained).collect()
    }
}

fn is_finite(matrix: &DMatrix<f64>) -> bool {
    matrix.iter().all(|x| x.is_finite())
}

/// Part of the square of the step between two models that is more than noise makes of it, if slopes differ by so much and the data
/// leave these covariances with the finer model and with the other one.
///
/// A finer model leaves more open, and the noise of the same data moves the two minima apart with a covariance that is the
/// difference of theirs (Hausman 1978, Econometrica 46, 1251).
fn beyond_chance(slopes: &DVector<f64>, finer: &DMatrix<f64>, other: &DMatrix<f64>) -> f64 {
    // Without an inverse nothing says what chance makes: all counts.
    let Some(inverse) = finer.clone().try_inverse() else { return 1.0 };
    let square = slopes.dot(&(finer * slopes));
    // E[Δ·C⁻¹Δ] = tr C⁻¹(C − C₀): noise moves the minima apart by Δ = −C s.
    let by_chance = (slopes.len() as f64 - (inverse * other).trace()).max(0.0);
    if square > by_chance { 1.0 - by_chance / square } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::geometry::Parameter;
    use crate::fit::geometry::tests::uniform;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    /// Returns a bowl in which the data leave the spin a standard deviation of 0.001.
    fn standing(excess: f64) -> Standing {
        let best =
            Estimate { geometry: Geometry::new(0.3, 1.0), x: Vec::new(), chi2: 0.0, value: 0.0 };
        let bends = DMatrix::from_element(1, 1, (Parameter::Spin.scale() / 0.001).powi(2));
        let slopes = DVector::zeros(1);
        Standing { best, bowl: Bowl { slopes, bends, responses: Vec::new() }, excess }
    }

    /// Standard deviations by a step of 0.01 of a refinement with this gain and excess, and by what of the first excess it does not
    /// explain.
    fn errors(excess: f64, gain: f64, finer_excess: f64) -> Vec<f64> {
        let free = [uniform(Parameter::Spin, -0.9, 0.9)];
        let kind = Refinement { source: "voxels", onwards: 1.5 };
        let step = DVector::from_element(1, 0.01 / Parameter::Spin.scale());
        let refined = Refined { kind, step, certain: 1.0, gain, excess: finer_excess };
        let errors = standing(excess).errors(&free, &[refined]);
        errors.iter().map(|error| error.covariance[0].sqrt()).collect()
    }

    fn assert_close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn exact_what_refinements_leave_of_an_excess_is_an_error() {
        // All is explained, or there is nothing to explain.
        assert_close(&errors(100.0, 120.0, 0.0), &[0.015]);
        assert_close(&errors(0.0, 5.0, 0.0), &[0.015]);
        // Data speak against the refinement, by four standard deviations.
        assert_close(&errors(0.0, -8.0, 20.0), &[0.015 * (-4.0f64).exp()]);
        // A finer model that follows less of the noise explains them nevertheless, or all but a little.
        assert_close(&errors(0.0, -80.0, 0.0), &[0.015]);
        assert_close(&errors(0.0, -80.0, 2.0), &[0.015 * (-1.0f64).exp()]);
        // What is left can move the spin by √200 of its standard deviations.
        assert_close(&errors(150.0, 50.0, 100.0), &[0.015, 0.001 * 200f64.sqrt()]);
        // More than its prior is not an error.
        let wide = errors(1e9, 0.0, 1e9)[1];
        assert!(wide < 1.8 / 12f64.sqrt() && wide > 0.99 * 1.8 / 12f64.sqrt(), "{wide}");
    }

    /// Noise alone moves the minimum of a finer model away from that of a coarser one: a third of such a step counts in the mean,
    /// at most. Of a discrepancy far above the noise nearly all does.
    #[test]
    fn exact_noise_makes_no_model_error() {
        const N: usize = 60;
        let mut random = Pcg64::seed_from_u64(9);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let tangents = DMatrix::from_fn(N, 2, |_, _| normal());
        let volume = DMatrix::from_fn(N, 50, |_, _| normal());
        // What no voxel explains, of few voxels and of all.
        let off = |count: usize| {
            let q = volume.columns(0, count).into_owned().qr().q();
            DMatrix::identity(N, N) - &q * q.transpose()
        };
        let [few, many] = [off(10), off(50)];
        let left =
            |off: &DMatrix<f64>| (tangents.transpose() * off * &tangents).try_inverse().unwrap();
        let [other, finer] = [left(&few), left(&many)];
        let mut certain = |bias: f64| {
            let noise = DVector::from_fn(N, |_, _| normal()) + volume.column(20) * bias;
            // The coarse model stands at its minimum.
            let at = &other * tangents.transpose() * &few * &noise;
            let rest = noise - &tangents * at;
            let slopes = |off: &DMatrix<f64>| -(tangents.transpose() * off * &rest);
            beyond_chance(&(slopes(&many) - slopes(&few)), &finer, &other)
        };
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
        let by_chance = mean((0..400).map(|_| certain(0.0)).collect());
        let biased = mean((0..400).map(|_| certain(30.0)).collect());
        assert!(by_chance < 0.35 && biased > 0.8, "{by_chance} {biased}");
    }

    /// A model of images that lacks something: whatever that is, it moves no parameter by more than the errors say that
    /// come of its χ².
    #[test]
    fn exact_no_discrepancy_moves_a_parameter_farther_than_its_chi2_allows() {
        let mut random = Pcg64::seed_from_u64(5);
        let free = [Parameter::Spin, Parameter::Xi].map(|of| uniform(of, -500.0, 500.0));
        let mut worst = 0.0f64;
        for round in 0..400 {
            let mut drawn = || random.random::<f64>() - 0.5;
            let tangents = DMatrix::from_fn(40, 2, |_, _| 1e3 * drawn());
            let bends = tangents.transpose() * &tangents;
            let inverse = bends.clone().try_inverse().unwrap();
            // Half of them along the derivative of the first parameter, the worst that there is.
            let along = &tangents * inverse.column(0);
            let missing = match round % 2 {
                0 => DVector::from_fn(40, |_, _| drawn()),
                _ => along,
            };
            let moved = &inverse * tangents.transpose() * &missing;
            let standing = Standing {
                bowl: Bowl { slopes: DVector::zeros(2), bends, responses: Vec::new() },
                ..standing(0.5 * missing.norm_squared())
            };
            let [error] = &standing.errors(&free, &[])[..] else { panic!("one error") };
            for k in 0..2 {
                let sigma = error.covariance[3 * k].sqrt() / free[k].parameter.scale();
                worst = worst.max(moved[k].abs() / sigma);
            }
        }
        assert!((worst - 1.0).abs() < 1e-6, "{worst}");
    }
}
