//! A convex function in coordinates in which its second derivatives are about as large along each axis,
//! y = √D x; the box stays one.

use super::convex::Convex;

pub(super) struct Scaled<'a> {
    inner: &'a mut dyn Convex,
    root: Vec<f64>,
    upper: f64,
    unscaled: Vec<f64>,
}

impl<'a> Scaled<'a> {
    pub fn new(inner: &'a mut dyn Convex, upper: f64) -> Self {
        let root = inner.diagonal().iter().map(|x| x.sqrt()).collect();
        Self { inner, root, upper, unscaled: Vec::new() }
    }

    pub fn from(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.root).map(|(x, root)| x * root).collect()
    }

    pub fn to(&self, y: &[f64]) -> Vec<f64> {
        let x = y.iter().zip(&self.root).map(|(y, root)| y / root);
        // Division may round a number at its bound to one beyond it.
        x.map(|x| x.clamp(0.0, self.upper)).collect()
    }

    pub fn upper(&self, k: usize) -> f64 {
        self.upper * self.root[k]
    }

    /// The nearest point of the box.
    pub fn project(&self, y: &mut [f64]) {
        for (y, root) in y.iter_mut().zip(&self.root) {
            *y = y.clamp(0.0, self.upper * root);
        }
    }

    fn divide(&self, gradient: &mut [f64]) {
        gradient.iter_mut().zip(&self.root).for_each(|(g, root)| *g /= root);
    }

    pub fn value_and_gradient(&mut self, y: &[f64], gradient: &mut Vec<f64>) -> f64 {
        self.fill(y);
        let value = self.inner.value_and_gradient(&self.unscaled, gradient);
        self.divide(gradient);
        value
    }

    fn fill(&mut self, y: &[f64]) {
        self.unscaled.clear();
        self.unscaled.extend(y.iter().zip(&self.root).map(|(y, root)| y / root));
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// y += a x.
pub(super) fn add(y: &mut [f64], a: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}
