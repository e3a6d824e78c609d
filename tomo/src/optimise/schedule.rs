//! Learning rates.

use crate::Error;

/// Polynomial decay of a learning rate: to + (from − to)(1 − step/steps)^power, then `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polynomial {
    /// Learning rate of step 0, in units of the parameters.
    pub from: f64,
    /// Learning rate from step `steps` on, in the same unit.
    pub to: f64,
    /// Steps of the decay.
    pub steps: u64,
    /// Exponent of the decay; 1: linear.
    pub power: f64,
}

impl Polynomial {
    /// BH-NeRF's: 1e-4 to 1e-6, linear over `steps` (Levis et al. 2022: 5000).
    pub fn bhnerf(steps: u64) -> Self {
        Self { from: 1e-4, to: 1e-6, steps, power: 1.0 }
    }

    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let whole = self.steps as f64;
        for (field, value, ok, allowed) in [
            ("from", self.from, positive(self.from), "above 0"),
            ("to", self.to, self.to.is_finite() && self.to >= 0.0, "0 or above"),
            ("power", self.power, positive(self.power), "above 0"),
            ("steps", whole, self.steps > 0, "1 or more"),
        ] {
            if !ok {
                return Err(Error::out_of_range(field, value, allowed));
            }
        }
        Ok(self)
    }

    /// Learning rate of a step, counted from 0, in units of the parameters.
    pub fn rate(&self, step: u64) -> f64 {
        let left = 1.0 - step.min(self.steps) as f64 / self.steps.max(1) as f64;
        self.to + (self.from - self.to) * left.powf(self.power)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_linear_and_cubic_decay() {
        let linear = Polynomial::bhnerf(5000).checked().unwrap();
        for (step, rate) in [(0, 1e-4), (2500, 5.05e-5), (5000, 1e-6), (9000, 1e-6)] {
            assert!((linear.rate(step) - rate).abs() < 1e-19, "{step}");
        }
        let cubic = Polynomial { from: 9.0, to: 1.0, steps: 4, power: 3.0 };
        assert_eq!([0, 1, 2, 3, 4].map(|k| cubic.rate(k)), [9.0, 4.375, 2.0, 1.125, 1.0]);
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let error = Polynomial { from: f64::NAN, ..Polynomial::bhnerf(10) }.checked().unwrap_err();
        assert_eq!(error.to_string(), "from = NaN is not allowed: above 0");
        let error = Polynomial::bhnerf(0).checked().unwrap_err();
        assert_eq!(error.to_string(), "steps = 0 is not allowed: 1 or more");
    }
}
