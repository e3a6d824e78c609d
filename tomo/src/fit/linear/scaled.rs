//! Functions that a descent minimises: convex ones, in coordinates in which second derivatives are about as large along each
//! axis, y = √D x; the box stays one.

/// A convex function of numbers in a box.
pub(super) trait Convex {
    /// Its value; overwrites the gradient.
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut Vec<f64>) -> f64;
    /// Positive numbers that are to the second derivatives as well as is known.
    fn diagonal(&self) -> Vec<f64>;
}

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
        // Division may round a number at its bound to one beside it, which would count as free.
        let x = |(y, root): (&f64, &f64)| match *y >= self.upper * root {
            true => self.upper,
            false => (y / root).clamp(0.0, self.upper),
        };
        y.iter().zip(&self.root).map(x).collect()
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

    pub fn value_and_gradient(&mut self, y: &[f64], gradient: &mut Vec<f64>) -> f64 {
        self.unscaled.clear();
        self.unscaled.extend(y.iter().zip(&self.root).map(|(y, root)| y / root));
        let value = self.inner.value_and_gradient(&self.unscaled, gradient);
        gradient.iter_mut().zip(&self.root).for_each(|(g, root)| *g /= root);
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Diagonal(Vec<f64>);

    impl Convex for Diagonal {
        fn diagonal(&self) -> Vec<f64> {
            self.0.clone()
        }

        fn value_and_gradient(&mut self, _: &[f64], _: &mut Vec<f64>) -> f64 {
            0.0
        }
    }

    /// What is at its bound in one unit is so in the other.
    #[test]
    fn exact_numbers_at_their_bounds_stay_there() {
        let mut inner = Diagonal((1..2000).map(|k| 0.37 * f64::from(k)).collect());
        for upper in [0.8, 1.0, 3.0, 1000.0] {
            let scaled = Scaled::new(&mut inner, upper);
            let mut y = vec![1e9; 1999];
            scaled.project(&mut y);
            assert!(scaled.to(&y).iter().all(|x| *x == upper), "{upper}");
        }
    }
}
