//! The field that is nowhere negative and nearest to one that is.

use super::super::convex::Convex;
use super::super::descent::{Descent, Stop};
use super::super::scaled::Scaled;
use super::GaussianField;
use core::ops::ControlFlow;

/// Most iterations, and the part of the first gradient that may be left.
const ENOUGH: Stop = Stop { iterations: 4000, tolerance: 1e-9, settled: 0.0 };

impl Convex for &GaussianField {
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut Vec<f64>) -> f64 {
        gradient.clear();
        gradient.resize(x.len(), 0.0);
        GaussianField::value_and_gradient(self, x, 1.0, gradient)
    }

    fn diagonal(&self) -> Vec<f64> {
        GaussianField::diagonal(self, 1.0)
    }
}

impl GaussianField {
    /// A field that it gives, moved to the nearest one between 0 and `upper`: the least |L (x − draw)|² (Bardsley & Fox
    /// 2012; Everink, Dong & Andersen 2023). The same for the same seed.
    pub fn drawn_between(&self, upper: f64, seed: u64) -> Vec<f64> {
        let draw = self.drawn(seed);
        let start: Vec<f64> = draw.iter().map(|x| x.clamp(0.0, upper)).collect();
        let about = self.clone().about(draw);
        let mut problem = &about;
        let mut each = |_: f64| ControlFlow::Continue(());
        let descent = Descent::new(Scaled::new(&mut problem, upper), &start, &mut each);
        descent.run(ENOUGH).x
    }
}
