//! The bowl beneath the ripples of a value over geometries: a Laplace approximation at the scale of the errors.
//!
//! Pixels and voxels are coarse: the value over geometries has ripples of a degree and of a few units, with a minimum in each. The
//! second derivatives in one of them are those of the ripple. What the data say of the geometry is the bowl beneath: a
//! quadratic form through values so far away that they have risen by more than the ripples are high, seen along several
//! lattices of rays and, where pixels are samples only, through other pixels. Its middle is the geometry, and how far ripples,
//! lattices and pixels move that is part of the error.

use super::covariance::covariance;
use super::problem::{Estimate, GeometryProblem};
use super::{Free, Geometry};
use crate::Error;
use kerrlight_common::simd::Float;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A quadratic form over geometries.
#[derive(Clone, Debug)]
pub struct Envelope {
    /// Its middle, the mean over the lattices.
    pub geometry: Geometry,
    /// Covariance of the free parameters row by row, in their own units: the inverse of the form's second derivatives,
    /// and what ripples and lattices move the middle by.
    pub covariance: Vec<f64>,
    /// Standard deviation of the ripples, in units of the value.
    pub ripple: f64,
}

/// A part of a step that is not worth taking.
const NEXT_TO_NOTHING: f64 = 0.1;

/// Values at places ξ, along one lattice of rays.
#[derive(Default)]
pub(super) struct Evaluations {
    pub places: Vec<DVector<f64>>,
    pub values: Vec<f64>,
}

/// Form that is fitted to the values of all lattices: a constant and a slope of each, and second derivatives of all.
pub(super) struct Form {
    pub slopes: Vec<DVector<f64>>,
    pub bends: DMatrix<f64>,
    /// Covariance of a slope.
    pub uncertain: DMatrix<f64>,
    /// Standard deviation of what it leaves.
    pub ripple: f64,
}

impl<T: Float> GeometryProblem<'_, T> {
    /// The best volume of a geometry at a distance, or at that part of the distance which bounds leave; none if they leave
    /// next to nothing.
    pub(super) fn beside(
        &self,
        from: &Estimate,
        responses: &[Vec<f64>],
        step: &DVector<f64>,
    ) -> Result<Option<(Estimate, f64)>, Error> {
        let part = self.part_within(&from.geometry, step.as_slice());
        if part < NEXT_TO_NOTHING {
            return Ok(None);
        }
        let step = step * part;
        let x = self.along(from, responses, step.as_slice());
        let there = self.solve_from(self.moved(&from.geometry, step.as_slice()), &x)?;
        Ok(Some((there, part)))
    }

    /// Looks at the geometries of some places.
    pub(super) fn look_at(
        &self,
        from: &Estimate,
        responses: &[Vec<f64>],
        columns: &DMatrix<f64>,
        places: Vec<DVector<f64>>,
        seen: &mut Evaluations,
    ) -> Result<(), Error> {
        for place in places {
            let there = self.beside(from, responses, &(columns * &place))?;
            if let Some((there, part)) = there {
                // A bound shortens the way: the value is that of the place that was looked at.
                seen.places.push(place * part);
                seen.values.push(there.value);
            }
        }
        Ok(())
    }

    /// The middle of a form, and its covariance in the parameters' own units.
    pub(super) fn middle(
        &self,
        about: Geometry,
        form: &Form,
        columns: &DMatrix<f64>,
        scatter: Option<&DMatrix<f64>>,
        inflation: f64,
        is_wide: bool,
    ) -> Option<(Geometry, Vec<f64>)> {
        let (inverse, outward) =
            (form.bends.clone().try_inverse()?, columns.clone().try_inverse()?);
        let lowest: Vec<DVector<f64>> = form.slopes.iter().map(|g| -(&inverse * g)).collect();
        let middles: Vec<DVector<f64>> = lowest.iter().cloned().map(near).collect();
        let mean = mean_of(&middles);
        let mut moved = &inverse * &form.uncertain * &inverse;
        // Of the lowest places themselves: those that are brought back to where was looked lie closer together.
        moved += covariance_of_mean(&lowest);
        let lowest = mean_of(&lowest);
        if let Some(scatter) = scatter {
            // Slopes scatter by noise, which is taken to be as large as the residuals.
            moved += sandwich_excess(scatter, form, &inverse) * inflation;
        }
        if is_wide || lowest.norm() > 1.0 {
            // Far from the middle a form is not quadratic: the lowest geometry is as good a guess. Where the middle lies beyond all
            // geometries that were looked at, none of them is a minimum.
            moved += &lowest * lowest.transpose();
        }
        let step = columns * &mean;
        let geometry = self.moved(&about, step.as_slice());
        // The form is one of ξ = columns⁻¹ u, priors are in units u of scales.
        let bends = outward.transpose() * &form.bends * &outward;
        let whole = covariance(self.free, &geometry, &bends, inflation)?
            + columns * moved * columns.transpose();
        Some((geometry, in_own_units(self.free, &whole)))
    }
}

/// Returns the sandwich covariance of the middle (White 1982, Econometrica 50, 1), from the variance of slopes, less the inverse of the
/// form's second derivatives, in directions in which it is larger.
fn sandwich_excess(scatter: &DMatrix<f64>, form: &Form, inverse: &DMatrix<f64>) -> DMatrix<f64> {
    // H⁻¹ B H⁻¹ − H⁻¹ = H⁻¹ (B − H) H⁻¹ for the scatter B and the second derivatives H.
    let mut more = SymmetricEigen::new(scatter - &form.bends);
    more.eigenvalues.apply(|x| *x = x.max(0.0));
    inverse * more.recompose() * inverse
}

fn mean_of(places: &[DVector<f64>]) -> DVector<f64> {
    places.iter().sum::<DVector<f64>>() / places.len() as f64
}

/// Returns the covariance of the mean of places from their scatter; nothing for one alone.
fn covariance_of_mean(places: &[DVector<f64>]) -> DMatrix<f64> {
    let (n, count, mean) = (places[0].len(), places.len() as f64, mean_of(places));
    let scatter = places.iter().fold(DMatrix::zeros(n, n), |sum, place| {
        let away = place - &mean;
        sum + &away * away.transpose()
    });
    // Σ/(n (n − 1)), wider since so few have to tell the scatter.
    if count > 1.0 { scatter * (few(count) / (count * (count - 1.0))) } else { scatter }
}

/// Returns the factor by which the scatter of so few is too small: the variance of Student's t with n − 1 degrees of freedom,
/// where it has one.
fn few(count: f64) -> f64 {
    // ν/(ν − 2) with ν = n − 1; fewer than four have no variance and take that of four.
    if count > 3.0 { (count - 1.0) / (count - 3.0) } else { 3.0 }
}

/// Covariances in the parameters' own units, row by row.
pub(super) fn in_own_units(free: &[Free], whole: &DMatrix<f64>) -> Vec<f64> {
    let (n, scale) = (free.len(), |k: usize| free[k].parameter.scale());
    (0..n * n).map(|k| whole[(k / n, k % n)] * scale(k / n) * scale(k % n)).collect()
}

/// A place not farther away than values were taken.
fn near(place: DVector<f64>) -> DVector<f64> {
    let length = place.norm();
    if length > 1.0 { place / length } else { place }
}

/// A place along an axis.
pub(super) fn along(n: usize, k: usize, x: f64) -> DVector<f64> {
    let mut place = DVector::zeros(n);
    place[k] = x;
    place
}

/// Both ends of each axis.
pub(super) fn ends(n: usize) -> Vec<DVector<f64>> {
    (0..n).flat_map(|k| [-1.0, 1.0].map(|x| along(n, k, x))).collect()
}

/// The diagonals between two axes: each pair has two of its four, one of each direction.
pub(super) fn diagonals(n: usize) -> Vec<DVector<f64>> {
    let pairs = (0..n).flat_map(|a| (0..a).map(move |b| (a, b)));
    let root = 0.5f64.sqrt();
    let of = |(a, b)| [root, -root].map(|x| along(n, a, x) + along(n, b, root));
    pairs.flat_map(of).collect()
}

/// The least squares form; none if there are too few values, or it is no bowl.
pub(super) fn fitted(seen: &[Evaluations], n: usize) -> Option<Form> {
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|a| (0..=a).map(move |b| (a, b))).collect();
    let lattices = seen.len();
    // Other rays, voxels and pixels move the bowl and its depth; all are taken to bend it alike.
    let (first_bend, unknowns) = (lattices * (1 + n), lattices * (1 + n) + pairs.len());
    let count: usize = seen.iter().map(|seen| seen.values.len()).sum();
    // What the form leaves has to tell the ripples.
    if count < unknowns + 2 {
        return None;
    }
    let (mut rows, mut values) = (DMatrix::zeros(count, unknowns), DVector::zeros(count));
    let all = seen.iter().enumerate();
    let all = all.flat_map(|(l, seen)| seen.places.iter().zip(&seen.values).map(move |at| (l, at)));
    for (row, (l, (place, value))) in all.enumerate() {
        values[row] = *value;
        rows[(row, l * (1 + n))] = 1.0;
        (0..n).for_each(|k| rows[(row, l * (1 + n) + 1 + k)] = place[k]);
        for (j, (a, b)) in pairs.iter().enumerate() {
            // u·B·u/2 holds the product of two different parameters twice.
            let share = if a == b { 0.5 } else { 1.0 };
            rows[(row, first_bend + j)] = share * place[*a] * place[*b];
        }
    }
    let inverse = (rows.transpose() * &rows).try_inverse()?;
    let found = &inverse * (rows.transpose() * &values);
    let left = (&values - &rows * &found).norm_squared() / (count - unknowns) as f64;
    let mut bends = DMatrix::zeros(n, n);
    for (j, (a, b)) in pairs.iter().enumerate() {
        (bends[(*a, *b)], bends[(*b, *a)]) = (found[first_bend + j], found[first_bend + j]);
    }
    // Where this is no bowl its stationary point is no minimum.
    bends.clone().cholesky()?;
    let slopes = (0..lattices).map(|l| found.rows(l * (1 + n) + 1, n).into_owned()).collect();
    let uncertain = inverse.view((1, 1), (n, n)) * left;
    Some(Form { slopes, bends, uncertain, ripple: left.sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    fn places(n: usize) -> Vec<DVector<f64>> {
        let middles = (0..n).flat_map(|k| [-0.5, 0.5].map(|x| along(n, k, x)));
        ends(n).into_iter().chain(middles).chain(diagonals(n)).collect()
    }

    /// A bowl with ripples in one lattice, and another lattice that is deeper and moved.
    #[test]
    fn exact_the_bowl_beneath_is_found() {
        let bends = DMatrix::from_row_slice(2, 2, &[8.0, 1.5, 1.5, 6.0]);
        let middles = [[0.2, -0.1], [0.3, 0.1]].map(|m| DVector::from_row_slice(&m));
        let value = |l: usize, place: &DVector<f64>| {
            let away = place - &middles[l];
            700.0 - 5.0 * l as f64 + 0.5 * (away.transpose() * &bends * &away)[(0, 0)]
        };
        let seen: Vec<Evaluations> = (0..2)
            .map(|l| Evaluations {
                places: places(2),
                values: places(2).iter().map(|p| value(l, p)).collect(),
            })
            .collect();
        let form = fitted(&seen, 2).unwrap();
        assert!((&form.bends - &bends).norm() < 1e-9 && form.ripple < 1e-6);
        for (slope, middle) in form.slopes.iter().zip(&middles) {
            assert!((&bends * middle + slope).norm() < 1e-9);
        }
        let upside_down = |seen: &Evaluations| Evaluations {
            places: seen.places.clone(),
            values: seen.values.iter().map(|x| -x).collect(),
        };
        assert!(fitted(&[upside_down(&seen[0]), upside_down(&seen[1])], 2).is_none());
    }

    /// Ripples of a known deviation that are independent of each other move the middle as often as stated.
    #[test]
    fn exact_ripples_move_the_middle_by_what_is_stated() {
        let mut random = Pcg64::seed_from_u64(3);
        let (mut pulls, rounds) = (0.0, 4000);
        for _ in 0..rounds {
            let mut noise = || 1.7320508 * (2.0 * random.random::<f64>() - 1.0);
            let values = |p: &DVector<f64>| 4.0 * p.norm_squared() + 0.3 * noise();
            let places = places(2);
            let values = places.iter().map(values).collect();
            let form = fitted(&[Evaluations { places, values }], 2).unwrap();
            pulls += form.slopes[0][0].powi(2) / form.uncertain[(0, 0)];
        }
        // F with 1 and 4 degrees of freedom has the mean 2.
        let mean = pulls / f64::from(rounds);
        assert!((mean - 2.0).abs() < 0.35, "{mean}");
    }

    /// Student's t of five degrees of freedom has the variance 5/3, which is stated.
    #[test]
    fn exact_six_places_tell_the_error_of_their_mean() {
        let mut random = Pcg64::seed_from_u64(11);
        let mut place =
            || DVector::from_fn(1, |_, _| 5.0 * random.sample::<f64, _>(StandardNormal));
        let rounds = 4000;
        let square = |places: Vec<DVector<f64>>| {
            mean_of(&places)[0].powi(2) / covariance_of_mean(&places)[(0, 0)]
        };
        let sum: f64 = (0..rounds).map(|_| square((0..6).map(|_| place()).collect())).sum();
        assert!((sum / f64::from(rounds) - 1.0).abs() < 0.1, "{sum}");
        assert_eq!(covariance_of_mean(&[place()])[(0, 0)], 0.0);
    }

    /// Half as many numbers as data follow noise in a way that differs from place to place: lowest places scatter by more than the
    /// rise about them tells (Neyman & Scott 1948, Econometrica 16, 1), and at most by what is stated.
    #[test]
    fn exact_noise_that_is_followed_moves_the_middle_as_stated() {
        const DATA: usize = 120;
        const NUMBERS: usize = 60;
        const REACH: f64 = 0.15;
        let mut random = Pcg64::seed_from_u64(7);
        let mut normal = |rows, columns| {
            DMatrix::from_fn(rows, columns, |_, _| random.sample::<f64, _>(StandardNormal))
        };
        let ([mut rise, mut stated], mut bowls) = ([0.0; 2], 0);
        for _ in 0..300 {
            let [here, first, second] = [0; 3].map(|_| normal(DATA, NUMBERS));
            let truth = normal(NUMBERS, 1) * 0.2;
            let data = &here * truth + normal(DATA, 1);
            let least = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
                (a.transpose() * a).cholesky().unwrap().solve(&(a.transpose() * b))
            };
            let value = |p: &DVector<f64>| {
                let there = &here + REACH * (p[0] * &first + p[1] * &second);
                0.5 * (&data - &there * least(&there, &data)).norm_squared()
            };
            let values = places(2).iter().map(value).collect();
            // Without a bowl no error is stated.
            let Some(form) = fitted(&[Evaluations { places: places(2), values }], 2) else {
                continue;
            };
            bowls += 1;
            let x = least(&here, &data);
            let moved =
                REACH * DMatrix::from_columns(&[(&first * &x).column(0), (&second * &x).column(0)]);
            let absorbed = &here * least(&here, &moved);
            let scatter = moved.transpose() * (&moved - absorbed);
            let inverse = form.bends.clone().try_inverse().unwrap();
            let middle = -&inverse * &form.slopes[0];
            let square = |covariance: DMatrix<f64>| {
                middle.dot(&(covariance.try_inverse().unwrap() * &middle)) / 2.0
            };
            rise += square(inverse.clone());
            stated += square(&inverse + sandwich_excess(&scatter, &form, &inverse));
        }
        let [rise, stated] = [rise, stated].map(|sum| sum / f64::from(bowls));
        // The form is as wide as the scatter: slopes across it scatter by less than at its middle.
        assert!(rise > 1.4 && (0.75..1.1).contains(&stated), "{rise} {stated}");
    }
}
