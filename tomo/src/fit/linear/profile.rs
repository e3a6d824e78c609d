//! Slopes and curvatures of data along numbers that move all images, when the field follows them: variable projection
//! (Golub & Pereyra 1973).
//!
//! With F(ω) the minimum over fields of a function of images and fields, its slope is that at the minimising field held
//! (the envelope theorem); at a field near it, less what the field's own slope gains where the field follows. Its second
//! derivative is the Schur complement
//! `Iᵀ H I − (Aᵀ H I)ᵀ (Aᵀ H A + P)⁻¹ Aᵀ H I` of images' derivatives I, second derivatives H of the data, operator A and
//! second derivatives P of penalties, over the nodes that shine. Second derivatives of the images are left out
//! (Gauss & Newton).

use super::data::Data;
use super::objective::Objective;
use super::operator::Operator;
use super::problem::LinearProblem;
use super::scaled::Convex;
use crate::Error;
use crate::optimise::{add, dot};
use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// Slope and second derivatives of the minimum over fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Slope with respect to each number.
    pub slopes: Vec<f64>,
    /// Row by row.
    pub bends: Vec<f64>,
    /// Change of the best field with each number, at all nodes.
    pub responses: Vec<Vec<f64>>,
}

/// Conjugate gradients end where a step adds less than this part of what the field has absorbed.
const ENOUGH: f64 = 1e-9;

/// Second derivatives of the data times what each number moves, pixel after pixel.
struct Moved<T> {
    /// Slopes of the data at the field.
    slopes: Vec<f64>,
    /// Images' derivatives times H, number after number.
    bent: Vec<Vec<T>>,
}

impl<T: Float> LinearProblem<'_, T> {
    /// Takes the profile at a field (values at all nodes) that is the best one or near it, with derivatives of the
    /// frames' images with respect to each number, frame after frame.
    ///
    /// `iterations` are those of the conjugate gradients by which the field follows; without any it is held.
    ///
    /// # Errors
    /// If data do not fit the rays, or none is in the frames.
    pub fn profile(
        &self,
        x: &[f64],
        tangents: &[Vec<T>],
        iterations: usize,
    ) -> Result<Profile, Error> {
        let data = self.data()?;
        // Nodes at a bound stay there when numbers change a little.
        let shines: Vec<bool> = x.iter().map(|x| *x > 0.0 && *x < self.upper).collect();
        let operator = Operator::new(self.walk(), self.active(&shines), self.frames, usize::MAX);
        let here = operator.active.gather(x);
        let free: Vec<T> = here.iter().map(|x| T::of(*x)).collect();
        let images = operator.images(&free);
        let moved = moved(&data, self.frames, &images, tangents);
        let mut objective = Objective::new(&operator, &data, self.penalised(&data));
        let taken: Vec<Vec<f64>> = moved.bent.iter().map(|bent| operator.adjoint(bent)).collect();
        let following = taken.iter().map(|b| solved(&mut objective, b, iterations));
        let (absorbed, left): (Vec<Vec<f64>>, Vec<Vec<f64>>) = following.unzip();
        // What a field that is not solved for to the end would still do as numbers move.
        let mut downhill = Vec::new();
        objective.value_and_gradient(&here, &mut downhill);
        let slopes = moved.slopes.iter().zip(&absorbed).map(|(s, a)| s - dot(&downhill, a));
        let slopes = slopes.collect();
        let n = tangents.len();
        let product = |a: &[T], b: &[T]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a.double() * b.double()).sum()
        };
        let bend = |k: usize| {
            let (a, b) = (k / n, k % n);
            // Second derivatives of the misfit that these very fields leave: never negative, and their error is of second order
            // in that of the fields. Without the residuals it is of first order.
            let follows = dot(&taken[a], &absorbed[b]) + dot(&absorbed[a], &left[b]);
            product(&tangents[a], &moved.bent[b]) - follows
        };
        // The form is symmetric but for rounding.
        let bends = (0..n * n).map(|k| 0.5 * (bend(k) + bend(k % n * n + k / n))).collect();
        let response = |absorbed: &Vec<f64>| {
            let moved: Vec<f64> = absorbed.iter().map(|x| -x).collect();
            operator.active.expand(&moved)
        };
        let responses = absorbed.iter().map(response).collect();
        Ok(Profile { slopes, bends, responses })
    }
}

fn moved<T: Float>(
    data: &Data<'_, T>,
    frames: &[usize],
    images: &[T],
    tangents: &[Vec<T>],
) -> Moved<T> {
    let pixels = images.len() / frames.len();
    let of_frame = |(k, frame): (usize, &usize)| {
        let range = k * pixels..(k + 1) * pixels;
        let image = &images[range.clone()];
        let (mut here, mut there) = (vec![T::zero(); pixels], vec![T::zero(); pixels]);
        data.value(*frame, image, &mut here);
        let largest = |all: &[T]| all.iter().fold(0.0f64, |most, x| most.max(x.double().abs()));
        let of_number = |tangent: &Vec<T>| {
            let tangent = &tangent[range.clone()];
            let slope: f64 = here.iter().zip(tangent).map(|(a, b)| a.double() * b.double()).sum();
            // As long as the image, so that the slopes that are subtracted cost no digits.
            let length = largest(tangent);
            let step = if length > 0.0 { largest(image).max(1e-12) / length } else { 1.0 };
            let shifted: Vec<T> =
                image.iter().zip(tangent).map(|(x, t)| *x + T::of(step) * *t).collect();
            data.value(*frame, &shifted, &mut there);
            let bent = there.iter().zip(&here).map(|(a, b)| (*a - *b) * T::of(1.0 / step));
            (slope, bent.collect::<Vec<T>>())
        };
        tangents.iter().map(of_number).collect::<Vec<_>>()
    };
    let all: Vec<Vec<(f64, Vec<T>)>> = frames.par_iter().enumerate().map(of_frame).collect();
    let of = |n: usize| all.iter().map(move |frame| &frame[n]);
    let numbers = 0..tangents.len();
    Moved {
        slopes: numbers.clone().map(|n| of(n).map(|x| x.0).sum()).collect(),
        bent: numbers.map(|n| of(n).flat_map(|x| x.1.iter().copied()).collect()).collect(),
    }
}

/// M⁻¹ b by conjugate gradients with a diagonal preconditioner, and what M times it leaves of b.
fn solved<T: Float>(
    objective: &mut Objective<'_, '_, T>,
    b: &[f64],
    iterations: usize,
) -> (Vec<f64>, Vec<f64>) {
    let diagonal = objective.diagonal();
    let scaled = |r: &[f64]| -> Vec<f64> { r.iter().zip(&diagonal).map(|(r, d)| r / d).collect() };
    let mut x = vec![0.0; b.len()];
    let mut r = b.to_vec();
    let mut z = scaled(&r);
    let mut p = z.clone();
    let (mut rz, mut absorbed) = (dot(&r, &z), 0.0);
    for _ in 0..iterations {
        let product = objective.curvature(&p);
        let bend = dot(&p, &product);
        // No residual is left but rounding, or no curvature along the direction.
        if bend <= 0.0 || rz <= 0.0 {
            break;
        }
        let step = rz / bend;
        add(&mut x, step, &p);
        add(&mut r, -step, &product);
        // A step adds this to xᵀ M x: directions are conjugate.
        let gained = step * rz;
        absorbed += gained;
        if gained < ENOUGH * absorbed {
            break;
        }
        z = scaled(&r);
        let next = dot(&r, &z);
        let keep = next / rz;
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + keep * *p);
        rz = next;
    }
    (x, r)
}
