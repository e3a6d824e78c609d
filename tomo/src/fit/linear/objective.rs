//! Objective of the linear problem: data and penalties as a function of the values at the nodes that count.

use super::change::Change;
use super::data::Data;
use super::error::LinearError;
use super::gaussian::GaussianField;
use super::operator::Operator;
use super::scaled::Convex;
use crate::Error;
use crate::fit::loss::regulariser::{Prior, Regulariser, Shape};
use crate::fit::quiescent::Quiescent;
use kerrlight_common::simd::Float;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Penalties on a field, and how it may change.
#[derive(Clone, Copy)]
pub(super) struct Penalised<'a> {
    /// Priors on the field of each knot.
    pub priors: &'a [Prior],
    /// The nodes of the grid.
    pub shape: Shape,
    /// Gaussian on the nodes, and one over the number of data that it is beside.
    pub gaussian: Option<(&'a GaussianField, f64)>,
    /// Change along the flow.
    pub change: Change,
    /// Prices of births, at all knots but the first, beside the weight of the change; all are 1 if there are none.
    pub prices: &'a [f64],
    /// Static image behind the values of nodes, with penalties of its own.
    pub quiescent: Option<&'a Quiescent>,
    /// The largest emission that is allowed.
    pub upper: f64,
}

impl Penalised<'_> {
    fn is_empty(&self) -> bool {
        self.priors.is_empty()
            && self.gaussian.is_none()
            && !(self.change.is_any() && self.change.weight > 0.0)
            && self.quiescent.is_none_or(|image| image.priors.is_empty())
    }

    /// Returns whether anything has second derivatives that are the same everywhere.
    fn is_curved(&self) -> bool {
        let is_smooth = |prior: &Prior| prior.regulariser == Regulariser::Smoothness;
        self.gaussian.is_some() || self.priors.iter().any(is_smooth)
    }

    /// Adds second derivatives of what is quadratic, at all nodes, times a direction.
    fn add_curvature(&self, direction: &[f64], out: &mut [f64]) {
        if let Some(at) = self.priors.iter().position(|p| p.regulariser == Regulariser::Smoothness)
        {
            // The gradient of a quadratic form at a direction is its second derivative times it.
            // What is no such form, or is added elsewhere, is left out.
            let change = Change { weight: 0.0, ..self.change };
            let smoothness = Self {
                priors: &self.priors[at..=at],
                gaussian: None,
                change,
                quiescent: None,
                ..*self
            };
            smoothness.value_and_gradient(direction, out);
        }
        if let Some((gaussian, share)) = self.gaussian {
            gaussian.add_curvature(direction, share, out);
        }
    }

    /// Returns the objective of values at all nodes and knots; those on fields are the means over time of a field that
    /// changes, sums over what is born. Adds slopes.
    pub fn value_and_gradient(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        // Before the slices that end where the parameters of the image begin.
        let of_image = self.quiescent.map_or(0.0, |image| image.penalty(x, slopes));
        let fields = self.shape.count() * self.change.knots.count;
        let (x, slopes) = (&x[..fields], &mut slopes[..fields]);
        let mut value =
            of_image + self.change.penalty(x, self.shape.cell(), self.upper, self.prices, slopes);
        if let Some((gaussian, share)) = self.gaussian {
            value += gaussian.value_and_gradient(x, share, slopes);
        }
        let (nodes, share) = (self.shape.count(), self.change.share());
        for (field, slopes) in x.chunks_exact(nodes).zip(slopes.chunks_exact_mut(nodes)) {
            for Prior { regulariser, weight } in self.priors {
                let weight = weight * share;
                value += regulariser.value_and_gradient(field, self.shape, weight, slopes);
            }
        }
        value
    }
}

/// The linear problem on the nodes that count.
pub(super) struct Objective<'a, 'b, T: Float> {
    pub operator: &'b Operator<'a, T>,
    pub data: &'b Data<'a, T>,
    pub terms: Penalised<'b>,
    dark: Option<Vec<T>>,
    /// Values and gradients and products with second derivatives that were computed.
    pub evaluations: usize,
}

impl<'a, 'b, T: Float> Objective<'a, 'b, T> {
    pub fn new(operator: &'b Operator<'a, T>, data: &'b Data<'a, T>, terms: Penalised<'b>) -> Self {
        // For products with second derivatives, which only of quadratic data are constant.
        let dark = if data.is_quadratic() { operator.dark(data) } else { None };
        Self { operator, data, terms, dark, evaluations: 0 }
    }

    /// Refuses a value that is no finite number, and says which data have it.
    pub fn finite(&self, value: f64, x: &[f64]) -> Result<f64, Error> {
        if value.is_finite() {
            return Ok(value);
        }
        let culprit = self.operator.not_finite(self.data, &rounded::<T>(x, 1.0));
        let (frame, data, value) = culprit.unwrap_or_else(|| (0, "penalties".to_owned(), value));
        Err(LinearError::NotFinite { data, frame, value }.into())
    }

    /// Mean flux of the frames.
    pub fn flux(&self, x: &[f64]) -> f64 {
        self.operator.flux(&rounded::<T>(x, 1.0))
    }

    /// Value, and the gradient with respect to all nodes of the grid.
    pub fn everywhere(&mut self, x: &[f64]) -> (f64, Vec<f64>) {
        self.evaluations += 1;
        let (value, mut gradient) =
            self.operator.value_and_gradient(self.data, &rounded::<T>(x, 1.0), true);
        let more = self.penalties(x, |slopes: &[f64]| {
            gradient.iter_mut().zip(slopes).for_each(|(g, s)| *g += s);
        });
        (value + more, gradient)
    }

    /// The value where nothing shines, and the largest slope there of the nodes that count.
    pub fn nothing(&mut self) -> (f64, f64) {
        let mut gradient = Vec::new();
        let value =
            self.value_and_gradient(&vec![0.0; self.operator.active.count()], &mut gradient);
        (value, gradient.iter().fold(0.0f64, |most, g| most.max(g.abs())))
    }

    /// The diagonal beside that of a Gaussian prior, where there is one: squares of the columns are as large then as their
    /// part of the trace of the data's second derivatives, which a random direction tells (Hutchinson 1990).
    fn beside_gaussian(&self, squares: Vec<f64>) -> Vec<f64> {
        let Some((gaussian, share)) = self.terms.gaussian.filter(|_| self.data.is_quadratic())
        else {
            return squares;
        };
        // Squares of columns know neither errors nor weights of the data. Alone their scale hardly
        // matters; beside second derivatives of a prior it does.
        let mut random = Pcg64::seed_from_u64(0);
        let signs: Vec<T> =
            squares.iter().map(|_| T::of(if random.random() { 1.0 } else { -1.0 })).collect();
        let bent = self.operator.curvature(self.data, self.dark.as_deref(), &signs);
        let trace: f64 = bent.iter().zip(&signs).map(|(bent, sign)| bent * sign.double()).sum();
        let scale = trace.max(0.0) / squares.iter().sum::<f64>();
        let prior = self.operator.active.gather(&gaussian.diagonal(share));
        squares.iter().zip(prior).map(|(square, prior)| scale * square + prior).collect()
    }

    /// Returns the second derivatives times a direction, where data are quadratic.
    pub fn curvature(&mut self, direction: &[f64]) -> Vec<f64> {
        self.evaluations += 1;
        // As long as an emission of one, so that the data's own slopes, which are subtracted, cost no digits.
        let largest = direction.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
        let scale = if largest > 0.0 { 1.0 / largest } else { 1.0 };
        let (dark, along) = (self.dark.as_deref(), rounded::<T>(direction, scale));
        let mut out = self.operator.curvature(self.data, dark, &along);
        out.iter_mut().for_each(|x| *x *= largest);
        if self.terms.is_curved() {
            let all = self.operator.active.expand(direction);
            let mut slopes = vec![0.0; all.len()];
            self.terms.add_curvature(&all, &mut slopes);
            let slopes = self.operator.active.gather(&slopes);
            out.iter_mut().zip(slopes).for_each(|(x, slope)| *x += slope);
        }
        if let Some(image) = self.terms.quiescent {
            image.bend(direction, &mut out);
        }
        out
    }

    fn penalties(&self, x: &[f64], add: impl FnOnce(&[f64])) -> f64 {
        if self.terms.is_empty() {
            return 0.0;
        }
        // Penalties couple neighbours: those that do not count enter as dark ones.
        let all = self.operator.active.expand(x);
        let mut slopes = vec![0.0; all.len()];
        let value = self.terms.value_and_gradient(&all, &mut slopes);
        add(&slopes);
        value
    }
}

fn rounded<T: Float>(x: &[f64], scale: f64) -> Vec<T> {
    x.iter().map(|x| T::of(scale * x)).collect()
}

impl<T: Float> Convex for Objective<'_, '_, T> {
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut Vec<f64>) -> f64 {
        self.evaluations += 1;
        let (value, slopes) =
            self.operator.value_and_gradient(self.data, &rounded::<T>(x, 1.0), false);
        *gradient = slopes;
        let active = &self.operator.active;
        value
            + self.penalties(x, |slopes: &[f64]| {
                gradient.iter_mut().zip(active.gather(slopes)).for_each(|(g, s)| *g += s);
            })
    }

    fn diagonal(&self) -> Vec<f64> {
        let mut squares = self.operator.squares();
        let nodes = squares.len() - self.operator.active.beside;
        let largest = squares[..nodes].iter().fold(0.0f64, |largest, x| largest.max(*x));
        // Nodes that are hardly seen are not to be moved by more than the others can follow.
        let least = if largest > 0.0 { 1e-4 * largest } else { 1.0 };
        squares[..nodes].iter_mut().for_each(|x| *x = x.max(least));
        self.beside_gaussian(squares)
    }
}
