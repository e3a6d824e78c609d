//! The minimum over fields as a function of numbers that move all images.

use super::*;
use crate::fit::linear::LinearProblem;
use nalgebra::DMatrix;

/// Data that the images of a field and ω times fixed images explain together.
struct Case {
    model: ForwardModel<f64>,
    moved: Vec<Vec<f64>>,
    data: Vec<f64>,
    /// A prior of the nodes, in place of a penalty on slopes.
    gaussian: Option<GaussianField>,
}

const VOXELS: usize = 5;
const SMOOTHNESS: [Prior; 1] = [Prior { regulariser: Regulariser::Smoothness, weight: 0.02 }];

impl Case {
    fn new(gaussian: Option<GaussianField>) -> Self {
        let model = forward_model();
        let voxels = Voxels::cube(VOXELS, 5.0, Degree::Linear);
        let count = FRAMES.len() * model.pixels();
        let mut data = movie(&model, &voxels, &random(voxels.count(), 7));
        let noise = random(count, 8);
        data.iter_mut().zip(noise).for_each(|(pixel, n)| *pixel += 2.0 * (n - 0.5));
        // One that fields can follow in part, and one that they cannot.
        let mut first = movie(&model, &voxels, &random(voxels.count(), 9));
        first.iter_mut().zip(random(count, 10)).for_each(|(pixel, n)| *pixel += n);
        let second = random(count, 11).iter().map(|n| n - 0.5).collect();
        Self { model, moved: vec![first, second], data, gaussian }
    }

    /// Hands the problem of data less ω times the images to a function.
    fn with<R>(&self, omega: [f64; 2], f: impl FnOnce(&LinearProblem<'_, f64>) -> R) -> R {
        let [a, b] = &self.moved[..] else { panic!("two numbers") };
        let left = self.data.iter().zip(a.iter().zip(b));
        let left = left.map(|(d, (a, b))| d - omega[0] * a - omega[1] * b).collect();
        let term = ImageTerm::new(left, self.model.pixels(), 0.5).unwrap();
        let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
        f(&LinearProblem {
            priors: if self.gaussian.is_some() { &[] } else { &SMOOTHNESS },
            gaussian: self.gaussian.as_ref(),
            ..of_images(&self.model, &terms, Voxels::cube(VOXELS, 5.0, Degree::Linear))
        })
    }

    fn least(&self, omega: [f64; 2]) -> (Vec<f64>, f64) {
        let Least { x, value } = self.with(omega, |problem| problem.least(None, 20_000)).unwrap();
        (x, value)
    }
}

/// Steps are small enough that no node goes dark or lights up.
#[test]
fn exact_slopes_and_bends_are_those_of_differences_of_the_minimum() {
    compare(&Case::new(None));
}

#[test]
fn exact_beside_a_prior_they_are_too() {
    let voxels = Voxels::cube(VOXELS, 5.0, Degree::Linear);
    let (mean, amplitude, correlation_length) = (1.0, 0.4, 4.0);
    let law = Matern { mean, amplitude, correlation_length, roughness: Roughness::Half };
    compare(&Case::new(Some(GaussianField::new(law, &voxels).unwrap())));
}

fn compare(case: &Case) {
    let (x, _) = case.least([0.0; 2]);
    // Images move by −∂(data)/∂ω.
    let found = case.with([0.0; 2], |problem| problem.profile(&x, &case.moved, 4000)).unwrap();
    let h = 2e-3;
    let at = |a: f64, b: f64| case.least([a * h, b * h]).1;
    let middle = at(0.0, 0.0);
    for (k, [a, b]) in [[h, 0.0], [0.0, h]].into_iter().enumerate() {
        let (up, down) = (case.least([a, b]).0, case.least([-a, -b]).0);
        let moves = up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * h));
        let most = found.responses[k].iter().fold(0.0f64, |most, x| most.max(x.abs()));
        for (moves, response) in moves.zip(&found.responses[k]) {
            assert!((moves - response).abs() < 5e-3 * most, "{k}: {moves} {response} {most}");
        }
    }
    for (k, [a, b]) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
        let (up, down) = (at(a, b), at(-a, -b));
        let slope = (up - down) / (2.0 * h);
        assert!((slope / found.slopes[k] - 1.0).abs() < 1e-5, "{k}: {slope} {:?}", found.slopes);
        let bend = (up - 2.0 * middle + down) / (h * h);
        let of = found.bends[3 * k];
        assert!((bend / of - 1.0).abs() < 2e-3, "{k}: {bend} {of}");
    }
    let mixed = (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * h * h);
    let scale = (found.bends[0] * found.bends[3]).sqrt();
    assert!((mixed - found.bends[1]).abs() < 2e-3 * scale, "{mixed} {:?}", found.bends);
    // Fields that have not followed to the end leave second derivatives too large, never negative: in the direction in which two
    // numbers do nearly the same, what is left is small.
    let same = case.moved[0].iter().zip(&case.moved[1]).map(|(a, b)| a + 1e-3 * b).collect();
    let alike = [case.moved[0].clone(), same];
    for steps in [1, 2, 4, 8, 16, 4000] {
        let found = case.with([0.0; 2], |problem| problem.profile(&x, &alike, steps)).unwrap();
        let bends = DMatrix::from_row_slice(2, 2, &found.bends);
        assert!(bends.symmetric_eigenvalues().min() > 0.0, "{steps}: {bends}");
    }
    // From a field that is not the best one, slopes are those of the best one as well.
    let shines = |x: &f64| *x > 0.0;
    let near = random(x.len(), 12);
    let near = x.iter().zip(near).map(|(x, n)| if shines(x) { x * (0.8 + 0.4 * n) } else { 0.0 });
    let near: Vec<f64> = near.collect();
    let there = case.with([0.0; 2], |problem| problem.profile(&near, &case.moved, 4000)).unwrap();
    let plain = case.with([0.0; 2], |problem| problem.profile(&near, &case.moved, 0)).unwrap();
    for k in 0..2 {
        let most = (plain.slopes[k] - found.slopes[k]).abs();
        let off = (there.slopes[k] - found.slopes[k]).abs();
        assert!(off < 1e-3 * most && most > 1e-3 * found.slopes[k].abs(), "{k}: {off} {most}");
    }
    // A field that is held follows nothing: the data say more.
    let held = case.with([0.0; 2], |problem| problem.profile(&x, &case.moved, 0)).unwrap();
    assert!(held.bends[0] > 1.05 * found.bends[0], "{held:?} {found:?}");
}
